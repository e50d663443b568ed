# Copyright 2026 ride_estimation contributors
"""Full fits of one search, within its budget of work, against one calibrated model."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from ride_estimation.diagnosis.calibration.linear_model import Calibrated, explains
from ride_estimation.diagnosis.calibration.regression import Regression
from ride_estimation.diagnosis.common.parallel import in_order
from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.common.splits import Splits
from ride_estimation.diagnosis.hypotheses.hypothesis import Fitted
from ride_estimation.diagnosis.runs.noise import temper_of
from ride_estimation.diagnosis.runs.run_view import RunView
from ride_estimation.diagnosis.search.fitting import FullFit, FullFitter
from ride_estimation.diagnosis.search.screening import Score

#: prior standard deviation of a coefficient that nothing is known of
_FREE = 1e12


class Fits:
    """Full fits of sets of hypotheses, counted.

    Parameters
    ----------
    calibrated
        Best linear model.
    splits
        Blocks; those of fit and select together are fitted.
    settings
        Budget and threads.

    Attributes
    ----------
    blocks
        That are fitted.
    dof
        Effective number of samples of these.
    count
        Fits so far.
    """

    def __init__(self, calibrated: Calibrated, splits: Splits, settings: Settings) -> None:
        self.settings, self.blocks, self._splits = settings, splits.train, splits
        self.dof = float(calibrated.view.block_dof[self.blocks].sum())
        self.count = 0
        self.hold(calibrated)

    def hold(self, calibrated: Calibrated) -> None:
        """Fit against another calibrated model of the same run from now on."""
        self.calibrated, self.fitter = calibrated, FullFitter(calibrated, self._splits)

    @property
    def spent(self) -> bool:
        """Return whether the budget of full fits is used up."""
        return self.count >= self.settings.most_fits

    def one(
        self, start: Sequence[Score | Fitted], passes: int, after: FullFit | None = None, settle: bool = False
    ) -> FullFit:
        """Return the full fit of one set of hypotheses, see :meth:`FullFitter.fit`."""
        self.count += 1
        return self.fitter.fit(start, passes, after, settle)

    def each(
        self, sets: Sequence[Sequence[Score | Fitted]], passes: int, after: FullFit | None
    ) -> Iterator[FullFit]:
        """Yield the full fits of some sets of hypotheses, in their order; each holds the trajectory of its model."""
        self.count += len(sets)
        yield from in_order(lambda start: self.fitter.fit(start, passes, after), sets, self.settings.threads)

    def all(self, sets: Sequence[Sequence[Score | Fitted]], passes: int, after: FullFit | None) -> list[FullFit]:
        """Return the full fits of some sets of hypotheses, in their order."""
        return list(self.each(sets, passes, after))

    def explained(self, fit: FullFit) -> bool:
        """Return whether a fit leaves no more than the measurement noise."""
        return explains(fit.misfit / self.dof)

    def temper(self, fits: Iterable[FullFit]) -> float:
        """Return the temper at which fits are compared, that of the one which leaves least."""
        return min((temper_of(f.misfit / self.dof, f.inefficiency) for f in fits), default=1.0)

    def residual_problem(self, accepted: FullFit | None, place: int | None = None) -> tuple[RunView, Regression]:
        """Return view and regression with the columns of the accepted causes, that at ``place`` excepted, in the baseline."""
        cal = self.calibrated
        if accepted is None:
            return cal.view, cal.regression
        base = accepted.regression
        skipped = accepted.part(place) if place is not None else slice(0, 0)
        used = [
            i for i in range(accepted.rows.shape[2])
            if accepted.coefficients[base.count + i] != 0.0 and not skipped.start <= i < skipped.stop
        ]
        return accepted.view, base.extended(accepted.rows[:, :, used], accepted.means[:, used], _FREE)
