# Copyright 2026 ride_estimation contributors
"""Does ``plan`` predict what ``replay`` states? Random sensor layouts, each replayed on a drive that no plan has seen.

The replayed vehicle has other stiffness and damping than its file (up to 10 %), another road, other noise and other
installation errors. What one drive states differs from what the next one does, most along x, where the standard deviation
follows how far the sensors of this installation happen to lean: a second replay of each vehicle, on another road and with its
sensors mounted anew, shows how well any prediction can agree.

    python benchmarks/plan_agreement.py --layouts 20
"""

from __future__ import annotations

import argparse
import dataclasses

import numpy as np

from ride_estimation.api.predicted import predicted_replay
from ride_estimation.errors import RideEstimationError
from ride_estimation.estimation.common.estimate import Estimate
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
    """Planned over replayed standard deviation of every parameter, that of two replays, equal status of both, agreement of
    refusals, and the parameters whose status differs, in words."""

    std_ratio: np.ndarray
    std_repeated: np.ndarray
    status_agrees: float
    status_repeated: float
    refusals_agree: bool
    differing: tuple[str, ...]


def within(ratios: np.ndarray, factor: float) -> float:
    """Return the share of standard deviations that agree within a factor."""
    return float(np.mean(np.abs(np.log(ratios)) <= np.log(factor)))


def replayed(
    vehicle: Vehicle, excitation: Excitation, seed: int, factors: dict[tuple[str, str, str], float]
) -> tuple[Estimate, ...]:
    """Return what a replay states after a drive of the vehicle with other stiffness and damping."""
    drive = Scenario(
        "other", seed, "", DURATION_S, speed=((0.0, excitation.speed),), road=RoadSpec(excitation.roughness),
        true_factors=factors, sensor_errors=SensorErrors(gain_std=0.003, misalignment_std=0.0017, bias_std=0.01),
    )  # fmt: skip
    return run_offline(run_scenario(drive, vehicle).recording, Pipeline(vehicle), smoothing=False).parameters


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
    repeated: list[float] = []
    same: list[bool] = []
    same_again: list[bool] = []
    differing: list[str] = []
    refusals = True
    for number in range(layouts):
        vehicle = random_layout(whole, rng)
        planned = predicted_replay(vehicle, excitation)
        factors = {
            (m, a, q): float(rng.uniform(0.9, 1.1))
            for m, mount in vehicle.mounts.items() for a in mount.elements for q in ("stiffness", "damping")
        }  # fmt: skip
        own = 900 + 31 * seed + number
        try:
            found, again = (replayed(vehicle, excitation, s, factors) for s in (own, own + 500_000))
        except RideEstimationError:
            refusals &= bool(planned.refusal)
            continue
        refusals &= not planned.refusal
        stated = {p.name: p for p in planned.parameters}
        for p in found:
            plan = stated[p.name]
            same.append(p.status.value == plan.status)
            if not same[-1]:
                own_std = f"{100 * p.std / abs(p.value):.1f} %"
                words = f"plan {plan.words} {100 * plan.relative_std:.1f} %, replay {p.status.value} {own_std}"
                differing.append(f"layout {number}, {len(vehicle.sensors)} sensors: {p.name}: {words}")
            ratios.append(stated[p.name].relative_std / (p.std / abs(p.value)))
        same_again += [a.status is b.status for a, b in zip(found, again, strict=True)]
        repeated += [b.std / abs(b.value) / (a.std / abs(a.value)) for a, b in zip(found, again, strict=True)]
    shares = float(np.mean(same)), float(np.mean(same_again))
    return Agreement(np.array(ratios), np.array(repeated), *shares, refusals, tuple(differing))


def main() -> None:
    """Print the shares."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--layouts", type=int, default=20)
    parser.add_argument("--seed", type=int, default=71)
    parser.add_argument("--cases", action="store_true", help="print every parameter whose status differs")
    options = parser.parse_args()
    found = agreement(options.layouts, options.seed)
    print(f"{len(found.std_ratio)} parameters on {options.layouts} layouts; refusals agree: {found.refusals_agree}")
    for what, of in (("plan and replay", found.std_ratio), ("two replays", found.std_repeated)):
        print(f"{what}: std within a factor 1.5: {100 * within(of, 1.5):.1f} % (goal 95), within 2: {100 * within(of, 2):.1f} %")
    agrees, again = 100 * found.status_agrees, 100 * found.status_repeated
    print(f"status agrees: plan and replay {agrees:.1f} % (goal 95), two replays {again:.1f} %")
    for words in found.differing if options.cases else ():
        print(words)


if __name__ == "__main__":
    main()
