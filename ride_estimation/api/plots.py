# Copyright 2026 ride_estimation contributors
"""Pictures of results for notebooks and papers: ``result.plot.forces("front_left")``."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from ride_estimation.diagnosis.answer.result import Diagnosis, Evidence
from ride_estimation.errors import ConfigurationError
from ride_estimation.estimation.offline import OfflineRun
from ride_estimation.reporting import diagnosis_report, replay_plots
from ride_estimation.reporting.plot import Plot


@dataclasses.dataclass(frozen=True)
class ReplayPlots:
    """Pictures of a replay; bands are two standard deviations."""

    result: OfflineRun

    def measured(self, sensor: str | None = None, window_s: float = 5.0) -> Plot:
        """Return the reading of an accelerometer of the body, what the rigid body gives there, their difference and spectra.

        Without a name it is that of the first accelerometer.

        Raises
        ------
        ConfigurationError
            No such accelerometer of the body.
        """
        chosen = _one_of("accelerometer of the body", sensor, tuple(self.result.predicted))
        return Plot(replay_plots.measured_against_model(self.result, chosen, window_s))

    def motion(self) -> Plot:
        """Return acceleration of the CG and inertial load over time."""
        return Plot(replay_plots.motion_and_load(self.result))

    def forces(self, mount: str | None = None, window_s: float = 5.0) -> Plot:
        """Return the forces of a mount where it carries most; without a name, of the mount whose force varies most.

        Raises
        ------
        ConfigurationError
            No such mount.
        """
        names, varies = self.result.mount_names, self.result.force[self.result.valid].std(axis=0).max(axis=-1, initial=0.0)
        most_first = [names[i] for i in np.argsort(-varies)]
        chosen = _one_of("mount", mount, most_first)
        return Plot(replay_plots.mount_forces(self.result, names.index(chosen), window_s=window_s))

    def parameters(self, *names: str) -> Plot:
        """Return parameters over time, divided by what the vehicle file says, for example ``"front_left.z.stiffness"``.

        Without a name they are the vertical stiffnesses.

        Raises
        ------
        ConfigurationError
            An unknown name.
        """
        known = tuple(p.name for p in self.result.parameters)
        usual = tuple(name for name in known if name.endswith(".z.stiffness")) or known[:1]
        chosen = tuple(_one_of("parameter", name, known) for name in names or usual)
        return Plot(replay_plots.parameter_convergence(self.result, chosen, "parameter"))


@dataclasses.dataclass(frozen=True)
class DiagnosisPlots:
    """Pictures of what the calibrated linear model leaves, and of what the extended model leaves."""

    answer: Diagnosis

    def residual(self) -> Plot:
        """Return the spectra of both residuals and of the predicted noise."""
        return Plot(diagnosis_report.residual_spectrum(self._evidence()))

    def stretch(self) -> Plot:
        """Return a few seconds of the channel with the largest relative misfit."""
        return Plot(diagnosis_report.stretch(self._evidence()))

    def loops(self) -> Plot:
        """Return force over deflection of the mount in question, and over its rate what the linear model lacks.

        Raises
        ------
        ConfigurationError
            The diagnosis has none, as that of a wrong sensor.
        """
        evidence = self._evidence()
        if not evidence.loops:
            raise ConfigurationError("this diagnosis has no force over deflection to show")
        return Plot(diagnosis_report.large_loop(evidence, diagnosis_report.leading_port(self.answer, evidence)))

    def _evidence(self) -> Evidence:
        if self.answer.evidence is None:
            raise ConfigurationError(f"a diagnosis that ends with {self.answer.verdict} has no residual to show")
        return self.answer.evidence


def _one_of(kind: str, given: str | None, known: Sequence[str]) -> str:
    """Return the name that was given, the first known one where none was."""
    if not known:
        raise ConfigurationError(f"this result has no {kind}")
    if given is not None and given not in known:
        raise ConfigurationError(f"no {kind} {given!r}; there are {', '.join(known)}")
    return known[0] if given is None else given
