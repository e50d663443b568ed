# Copyright 2026 ride_estimation contributors
"""Does ``plan`` predict what ``replay`` states? Random sensor layouts, each replayed on a drive that no plan has seen.

The replayed vehicle has other stiffness and damping than its file (up to 10 %), another road, other noise and other
installation errors.

    python benchmarks/plan_agreement.py --layouts 20
"""

from __future__ import annotations

import argparse
import dataclasses

import numpy as np

from ride_estimation.api.predicted import predicted_replay
from ride_estimation.errors import RideEstimationError
from ride_estimation.estimation.offline import run_offline
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.identification.sensitivities import Excitation
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.sensors.measurement import SensorErrors
from ride_estimation.simulation.field_run import run_scenario
from ride_estimation.simulation.scenario import RoadSpec, Scenario
from ride_estimation.vehicles.vehicle import Vehicle

DURATION_S = 30.0


@dataclasses.dataclass(frozen=True)
class Agreement:
    """Planned over replayed standard deviation of every parameter, shares of equal status, whether refusals agree."""

    std_ratio: np.ndarray
    status_agrees: float
    refusals_agree: bool

    def within(self, factor: float) -> float:
        """Return the share of standard deviations that agree within a factor."""
        return float(np.mean(np.abs(np.log(self.std_ratio)) <= np.log(factor)))


def random_layout(whole: Vehicle, rng: np.random.Generator) -> Vehicle:
    """Return the vehicle with three or more cab sensors and some of those at the mounts."""
    cab = [n for n, s in whole.sensors.items() if s.body == "cab" and s.kind == "accelerometer"]
    kept = {*rng.choice(cab, rng.integers(3, len(cab) + 1), replace=False)}
    for travel in (False, True):
        group = [n for n, s in whole.sensors.items() if n not in cab and (s.kind == "displacement") == travel]
        if group and rng.uniform() < 0.7:
            count = len(group) if rng.uniform() < 0.6 else rng.integers(2, len(group))
            kept |= {*rng.choice(group, count, replace=False)}
    return dataclasses.replace(whole, sensors={n: s for n, s in whole.sensors.items() if n in kept})


def agreement(layouts: int, seed: int) -> Agreement:
    """Plan and replay random layouts of the truck."""
    rng = np.random.default_rng(seed)
    whole, excitation = load_vehicle("truck_cab_transducers"), Excitation(duration_s=DURATION_S)
    ratios: list[float] = []
    same: list[bool] = []
    refusals = True
    for number in range(layouts):
        vehicle = random_layout(whole, rng)
        planned = predicted_replay(vehicle, excitation)
        factors = {
            (m, a, q): float(rng.uniform(0.9, 1.1))
            for m, mount in vehicle.mounts.items() for a in mount.elements for q in ("stiffness", "damping")
        }  # fmt: skip
        drive = Scenario(
            "other", 900 + 31 * seed + number, "", DURATION_S, speed=((0.0, excitation.speed),),
            road=RoadSpec(excitation.roughness), true_factors=factors,
            sensor_errors=SensorErrors(gain_std=0.003, misalignment_std=0.0017, bias_std=0.01),
        )  # fmt: skip
        try:
            found = run_offline(run_scenario(drive, vehicle).recording, Pipeline(vehicle), smoothing=False).parameters
        except RideEstimationError:
            refusals &= bool(planned.refusal)
            continue
        refusals &= not planned.refusal
        stated = {p.name: p for p in planned.parameters}
        for p in found:
            same.append(p.status.value == stated[p.name].status)
            ratios.append(stated[p.name].relative_std / (p.std / abs(p.value)))
    return Agreement(np.array(ratios), float(np.mean(same)), refusals)


def main() -> None:
    """Print the shares."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--layouts", type=int, default=20)
    parser.add_argument("--seed", type=int, default=71)
    options = parser.parse_args()
    found = agreement(options.layouts, options.seed)
    print(f"{len(found.std_ratio)} parameters on {options.layouts} layouts; refusals agree: {found.refusals_agree}")
    print(f"std within a factor 1.5: {100 * found.within(1.5):.1f} % (goal 95); within 2: {100 * found.within(2.0):.1f} %")
    print(f"status agrees: {100 * found.status_agrees:.1f} % (goal 95)")


if __name__ == "__main__":
    main()
