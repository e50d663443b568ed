# Copyright 2026 ride_estimation contributors
"""How brackets follow the twist of the base, from what they would do along x and y otherwise.

What mounts move against each other is an input of the model without a spectrum, so equilibrium alone tells the shares of bracket
tilt: a combination of roll and pitch well and each of them hardly. But a wrong share is motion too: ``T^+ y`` are the inputs
and ``S delta``, which is gravity times the twist. Slower than a frame vibrates, real motion that goes with its twist is in
proportion to it (the axis of the twist lies at another height): ``c W``, W the acceleration of the twist; other motion has
nothing to do with it. Least squares over the lines of that band, c an unknown of every deformation, weighted by the spectrum of
the deformation; the covariance of the slow states is the prior, and those that are correlated with the shares follow.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import InputDataError
from ride_estimation.estimation.model.joint import JointEstimate
from ride_estimation.estimation.model.segments import DEFORMS_HZ, Model, Projected, Segment, project, states_of
from ride_estimation.estimation.model.sensitivity import Sensitivity

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: frequency up to which frames do not vibrate and gravity on tilted brackets stands out [Hz]: with 1.5 to 5 Hz the shares of the
#: bundled drive are 0 to 0.2 off, within 1.5 standard deviations, with 20 Hz 1.0 and seven
_BELOW_HZ = 3.0
#: standard deviation of an arm c [m]: size of a frame
_ARM_STD = 0.5
#: Gauss-Newton steps
_STEPS = 3
_SINGULAR = "the tilt of the brackets cannot be estimated: the vehicle file does not fit this drive"


def learn_shares(joint: JointEstimate) -> None:
    """Bring what the motion of the bases tells of the shares into an estimate, in place.

    Parameters
    ----------
    joint
        Slow states of a run, estimated.

    Raises
    ------
    InputDataError
        The numbers left what can be computed.
    """
    if not np.any(joint.plant.twist):
        return
    try:
        _learn(joint)
    except np.linalg.LinAlgError as error:
        raise InputDataError(_SINGULAR) from error


def _learn(joint: JointEstimate) -> None:
    slow = joint.plant.slow
    shares = np.arange(slow.tilt_shares.start, slow.tilt_shares.stop)
    before = joint.covariance[np.ix_(shares, shares)]
    known = np.linalg.inv(before)
    follow = joint.covariance[np.ix_(slow.free, shares)] @ known
    start, change, after = joint.theta.copy(), np.zeros(len(shares)), before
    for _ in range(_STEPS):
        found = [_equations(joint, segment) for segment in joint.segments]
        after = np.linalg.inv(known + sum(information for information, _ in found))
        change = change + after @ (sum(score for _, score in found) - known @ change)
        joint.theta = start.copy()
        joint.theta[slow.free] += follow @ change
    joint.covariance[np.ix_(slow.free, slow.free)] -= follow @ (before - after) @ follow.T


def _equations(joint: JointEstimate, segment: Segment) -> tuple[Array, Array]:
    """Return information (S, S) and score (S,) of the shares in the inputs of a segment."""
    plant, model, lines = joint.plant, joint.model(), segment.lines
    p = project(model, segment)
    at = slice(int(np.sum(lines.frequency < DEFORMS_HZ)), int(np.sum(lines.frequency < _BELOW_HZ)))
    # all deformations but the twist
    others = np.linalg.qr(np.column_stack([plant.twist, np.eye(len(plant.twist))]))[0][:, 1:]
    deformations = p.inputs()[:, plant.states.deforming]
    found, twist = deformations @ others, deformations[at] @ plant.twist
    noise = np.sum(np.abs(np.matmul(others.T, p.unroot[:, plant.states.deforming])) ** 2, axis=2)
    spectrum = np.maximum(lines.smooth(np.abs(lines.taper(found)) ** 2), noise)[at]
    slope = np.matmul(others.T, _slope(model, segment, p)[at, plant.states.deforming])
    columns = np.concatenate([slope, np.broadcast_to(twist[:, None, None], (*slope.shape[:2], 1))], axis=2)
    weighted = columns.conj() / spectrum[:, :, None]
    moments = 2.0 * np.einsum("fij,fik->ijk", weighted, columns).real
    right = 2.0 * np.einsum("fij,fi->ij", weighted, found[at]).real
    by_arm = moments[:, :-1, -1] / (moments[:, -1, -1:] + _ARM_STD**-2.0)
    information = np.sum(moments[:, :-1, :-1] - by_arm[:, :, None] * moments[:, -1:, :-1], axis=0)
    return information, np.sum(right[:, :-1] - by_arm * right[:, -1:], axis=0)


def _slope(model: Model, segment: Segment, p: Projected) -> Complex:
    """Return what an error of the shares adds to the inputs, shape (F, W, S): directly, and by the ends that change with it."""
    shares, whole = model.plant.slow.tilt_shares, slice(0, len(p.seen))
    sensitivity = Sensitivity.of(model, np.arange(shares.start, shares.stop))
    change = sensitivity.readings(segment, p, states_of(model, segment, p)[0], whole)
    left = np.matmul(p.free, change).reshape(-1, change.shape[2])
    ends = np.linalg.solve(p.ends_information, (p.jump.reshape(len(left), -1).conj().T @ left).real)
    return np.asarray(np.matmul(p.inverse(), p.white.whiten(change) - p.jump_readings @ ends))
