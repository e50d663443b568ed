# Copyright 2026 ride_estimation contributors
"""A field run from a scenario file, with its truth."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

from ride_estimation.api.runs import Run
from ride_estimation.errors import ConfigurationError
from ride_estimation.io.field_run_files import write_field_run
from ride_estimation.io.scenario_file import load_scenario
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.simulation.field_run import FieldRun, run_scenario
from ride_estimation.simulation.scenario import Scenario
from ride_estimation.vehicles.vehicle import Vehicle


@dataclasses.dataclass(frozen=True, repr=False)
class Simulation:
    """A simulated field run.

    Attributes
    ----------
    scenario, path
        What was simulated, and its file.
    vehicle
        The vehicle file, which the true vehicle may differ from.
    field_run
        Recording and truth; ``field_run.truth.signals`` are arrays over ``time_s``.
    """

    scenario: Scenario
    path: Path
    vehicle: Vehicle
    field_run: FieldRun

    @property
    def run(self) -> Run:
        """Return the run as it would be read from its bag."""
        return Run(self.field_run.recording, self.vehicle)

    def save(self, folder: str | Path) -> Path:
        """Write ``bag/``, ``recipe.yaml``, ``truth.json`` and ``truth.npz`` into a folder; return the path of the bag."""
        return write_field_run(folder, self.field_run, self.scenario, self.vehicle, self.path)

    def __repr__(self) -> str:
        sensors = len(self.field_run.recording.channels)
        return f"Simulation({self.scenario.name}: {self.scenario.duration:g} s, {sensors} sensors, vehicle {self.vehicle.name})"


def simulate(
    scenario: str | Path, vehicle: Vehicle | str | Path | None = None, *, progress: Callable[[float], None] = lambda share: None
) -> Simulation:
    """Simulate a field run.

    Parameters
    ----------
    scenario
        Scenario file; ``config/scenarios/every_key.yaml`` explains all keys.
    vehicle
        A loaded vehicle, a vehicle file or the name of a bundled one, instead of the one the scenario names.
    progress
        Called with the share of the work done since the last call.

    Raises
    ------
    RideEstimationError
        Mistakes in the scenario or the vehicle file, all at once.

    Examples
    --------
    >>> import ride_estimation as re
    >>> re.simulate("bags/standing/recipe.yaml")
    Simulation(standing: 20 s, 8 sensors, vehicle truck_cab)
    """
    path = Path(scenario)
    loaded = load_scenario(path)
    if not isinstance(vehicle, Vehicle):
        vehicle = load_vehicle(vehicle or find_vehicle(path, loaded.vehicle_file))
    return Simulation(loaded, path, vehicle, run_scenario(loaded, vehicle, progress))


def find_vehicle(scenario: Path, named: str) -> Path:
    """Return the vehicle file a scenario names: relative to the scenario, to one of its parents, or to here.

    Raises
    ------
    ConfigurationError
        None of these exists; the message lists the places.
    """
    places = [folder / named for folder in (*scenario.resolve().parents, Path.cwd())]
    for place in places:
        if place.is_file():
            return place
    raise ConfigurationError(
        f"vehicle: {named!r} does not exist beside the scenario, in a folder above it or here; give --vehicle",
        where=str(scenario),
    )
