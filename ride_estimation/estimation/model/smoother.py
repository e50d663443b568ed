# Copyright 2026 ride_estimation contributors
"""Smoothed forces and deflections of a run: the states of the model, given all readings and the slow states of the whole run.

Inputs of the base are what the readings say, ``T^+ y = w + n``, weighted by how much of it is motion (Wiener):
``w = S (S + N)^-1 T^+ y`` with N the noise and what the slow states leave uncertain, ``N = (T* T)^-1 + G P G*``, G the derivative
of ``T^+ y`` with the slow states and P their covariance. An error of the force follows from the inputs that are missed, from
noise, and from the slow states, which change inputs and laws at once: ``(L K G + dF/dtheta) P (L K G + dF/dtheta)*``, L from the
inputs to the force, K the weight. The error of k, c, gain, misalignment ... is in it once, at the motion of the time.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from ride_estimation.estimation.model.joint import JointEstimate, largest
from ride_estimation.estimation.model.plant import unbalanced
from ride_estimation.estimation.model.second_order import force_of_second_order
from ride_estimation.estimation.model.segment_ends import Ends, ends_of
from ride_estimation.estimation.model.segments import (
    DEFORMS_HZ,
    Model,
    Projected,
    Segment,
    input_power,
    motion_of,
    project,
    renew,
    shrinkage,
    states_of,
)  # fmt: skip
from ride_estimation.estimation.model.sensitivity import Sensitivity, times_real

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: lines handled together: bounds the memory
_CHUNK = 256
#: power over the standard deviation of its estimate from which motion shows, below this frequency [Hz]
_SHOWN, _SLOW_HZ = 2.0, 5.0
#: how often second order, noise and what brackets do by themselves are renewed at least (after two the nominal drive was 20
#: instead of 15 % off along x) and at most, and change of the NIS from which they have settled: a cab that rolls by 0.75
#: degrees rms took six times, after three an octave was at NIS 3.6 instead of 1.1
_LEAST_RENEWALS, _RENEWALS, _SETTLED = 3, 12, 0.05


@dataclasses.dataclass(frozen=True)
class SmoothedSegment:
    """A segment of N samples.

    Attributes
    ----------
    force, std, deflection
        Forces of the mounts on the body, axes of the body, with standard deviation [N]; deflections [m]; shape (N, M, 3).
    nis
        Mean normalised square of what no input explains, in the octave where it is largest: 1 where the model describes
        the segment.
    bridged
        Whether it is estimated without one of the sensors.
    """

    force: Array
    std: Array
    deflection: Array
    nis: float
    bridged: bool = False


def smooth(joint: JointEstimate, readings: Array, silent: NDArray[np.bool_] | None = None) -> SmoothedSegment:
    """Return the forces of a segment.

    Parameters
    ----------
    joint
        Slow states of the run, estimated.
    readings
        Of the segment, shape (N, C), in the order of the plant's sensors.
    silent
        Which of them are none, shape (C,).
    """
    plant, model = joint.plant, joint.model()
    segment = Segment.of(readings, joint.dt, plant, silent)
    if silent is not None and np.any(silent[plant.of_bases]):
        segment.expected = _expected_deformation(joint, model, segment)
    p, nis = _settled(model, segment)
    error = _Errors(joint, model, segment, p)
    v = error.states()
    variance = error.variance(v)
    factor, held = plant.mass_factor
    v[:, plant.states.motion] += np.matmul(p.response.accel, segment.second_accel[:, :, None])[:, :, 0]
    moving = segment.lines.back(v)
    moving[:, plant.states.motion] += segment.lines.leap(p.ends)
    d = model.dynamics
    variance += _mend_ends(model, moving, error.ends(moving), segment.lines.dt)
    shape = (len(readings), len(plant.mounts), 3)
    force = model.still + moving @ d.force.T + force_of_second_order(plant, model.constants, d, moving).reshape(len(moving), -1)
    deflection = moving @ d.deflection.T + model.constants.deflected
    # stiffness, damping and mass are known up to a common factor: where the mass is held its error is that of every force
    variance += (held * force) ** 2
    force = plant.load.in_body_axes(force.reshape(shape))
    std = factor * np.sqrt(variance).reshape(shape)
    return SmoothedSegment(factor * force, std, deflection.reshape(shape), nis, silent is not None)


def _expected_deformation(joint: JointEstimate, model: Model, segment: Segment) -> Array:
    """Return the spectra of the deformations of the base that another part of the run lets expect, shape (F, n).

    There all sensors were heard. Motion and deformation grow alike with road and speed: spectra are taken over those of the
    accelerations that the bases have in both.
    """
    plant, lines, before = joint.plant, segment.lines, joint.segments[0]
    found = _Errors(joint, model, before, project(model, before)).power[:, plant.states.deforming]
    heard = plant.of_bases[np.isfinite(segment.noise[plant.of_bases])]
    then, now = (s.lines.smooth(np.abs(s.lines.taper(s.moving[:, heard])) ** 2).sum(axis=1) for s in (before, segment))
    ratio = (found / then[:, None]).T
    return np.asarray(now[:, None] * np.stack([np.interp(lines.frequency, before.lines.frequency, r) for r in ratio], axis=1))


def _settled(model: Model, segment: Segment) -> tuple[Projected, float]:
    """Renew the second order of a segment until it changes nothing; return what is left over and its NIS in the worst octave."""
    p, nis = project(model, segment), np.inf
    for step in range(1, _RENEWALS + 1):
        renew(model, segment, p)
        p, before = project(model, segment), nis
        nis = largest(*p.squares(segment))
        if step >= _LEAST_RENEWALS and abs(nis - before) < _SETTLED:
            break
    return p, nis


def _mend_ends(model: Model, moving: Array, ends: Ends, dt: float) -> Array:
    """Put the motion near the ends right, (N, V) in place; return by how much the variance of forces is larger there, (N, 3 M).

    How the body accelerates is measured there too: the base deforms, and the body gives way until its mounts push as before.
    """
    s, d = model.plant.states, model.dynamics
    wrench = model.constants.points.T @ d.force
    follows = -np.linalg.solve(wrench[:, s.relative], wrench)
    relative = ends.value @ follows[:, s.deformation].T + ends.rate @ follows[:, s.deformation_rate].T
    moving[:, s.deformation] += ends.value
    moving[:, s.deformation_rate] += ends.rate
    moving[:, s.relative] += relative
    moving[:, s.relative_rate] += np.gradient(relative, dt, axis=0)
    force = d.force[:, s.deformation] + d.force[:, s.relative] @ follows[:, s.deformation]
    return np.asarray(ends.variance @ (force**2).T)


class _Errors:
    """Inputs of a segment with all that makes them err."""

    def __init__(self, joint: JointEstimate, model: Model, segment: Segment, p: Projected) -> None:
        self._model, self._segment, self._p = model, segment, p
        self._sensitivity = Sensitivity.of(model)
        free = joint.plant.slow.free
        values, vectors = np.linalg.eigh(joint.covariance[np.ix_(free, free)])
        #: root of the covariance of the slow states
        self._root = vectors * np.sqrt(np.maximum(values, 0.0))
        self._gain = self._of_slow_states(states_of(model, segment, p)[0])
        self._noise = np.matmul(p.unroot, p.unroot.conj().transpose(0, 2, 1))
        self._raw = p.inputs()
        total = segment.lines.smooth(self._noise + np.matmul(self._gain, self._gain.conj().transpose(0, 2, 1)))
        self._variance = variance = np.diagonal(total, axis1=1, axis2=2).real
        deforming = model.plant.states.deforming
        self._shown, shrinks = shrinkage(segment, deforming, input_power(segment.lines, self._raw, variance))
        #: what the spectra of the inputs are expected to be, shape (F, W)
        self.power = shrinkage(segment, deforming, self._expected_power(variance))[0]
        self._deforms = 1.0 / (1.0 + (DEFORMS_HZ / segment.lines.frequency) ** 8)
        #: weight of the inputs
        self._weight = np.linalg.inv(np.eye(len(variance[0])) + total * shrinks[:, None, :])
        self._weight[:, 6:] *= self._deforms[:, None, None]

    def _of_slow_states(self, v: Complex) -> Complex:
        """Return the derivative of ``T^+ y`` with the slow states, in units of their standard deviations, (F, W, P)."""
        p = self._p
        inverse, found = p.white.transform(p.inverse()), []
        for first in range(0, len(v), _CHUNK):
            at = slice(first, first + _CHUNK)
            found.append(np.matmul(inverse[at], self._sensitivity.readings(self._segment, p, v, at)))
        return -times_real(np.concatenate(found), self._root)

    def _expected_power(self, noise: Array) -> Array:
        """Return what the spectra of the inputs are expected to be, shape (F, W), where noise hides them too.

        A spectrum is not negative: the mean of a normal distribution that is cut off at zero. Deformation slower than what the
        accelerometers show is taken to go on as it begins to show, and not to rise: the road twists a frame by the difference of
        four heights.
        """
        lines = self._segment.lines
        std = lines.smoothing_error() * noise
        difference = lines.smooth(np.abs(lines.taper(self._raw)) ** 2) - noise
        ratio = np.clip(difference / std, -5.0, 5.0)
        found = np.where(ratio < 5.0, std * stats.norm.pdf(ratio) + difference * stats.norm.cdf(ratio), difference)
        found = np.maximum(found, 0.0)
        for pattern in range(6, found.shape[1]):
            order = 4.0 if pattern < self._model.plant.states.deforming.stop else 0.0
            hidden = np.flatnonzero((ratio[:, pattern] < _SHOWN) & (lines.frequency < _SLOW_HZ))
            first = max(int(hidden[-1]) + 1 if len(hidden) else 0, int(np.argmax(lines.frequency >= DEFORMS_HZ)))
            shown = slice(first, 2 * first + 2)
            level = np.log(np.maximum(found[shown, pattern], 1e-300) / lines.frequency[shown] ** order)
            slope, size = np.polyfit(np.log(lines.frequency[shown] / lines.frequency[first]), level, 1)
            below = lines.frequency[:first] / lines.frequency[first]
            expected = np.exp(size) * below ** max(slope, 0.0) * lines.frequency[:first] ** order
            found[:first, pattern] = np.minimum(found[:first, pattern], expected)
        return found

    def states(self) -> Complex:
        """Return states and inputs, shape (F, V)."""
        drive = np.matmul(self._weight, self._raw[:, :, None])[:, :, 0]
        return motion_of(self._model.plant.states, self._p, drive, self._deforms[:, None])

    def ends(self, moving: Array) -> Ends:
        """Return how the deformation of the base near the ends differs from that in the motion (N, V).

        Its spectrum is the one that weighs the inputs, and where that ends the expected one.
        """
        s, shown = self._model.plant.states, self._deforms[:, None]
        power = (shown * self._shown + (1.0 - shown) * self.power)[:, s.deforming]
        raw, noise = self._raw[:, s.deforming], self._variance[:, s.deforming]
        return ends_of(self._segment.lines, raw, power, noise, moving[:, s.deformation], moving[:, s.deformation_rate])

    def variance(self, v: Complex) -> Array:
        """Return the variance of the forces at states and inputs v, shape (N, 3 M)."""
        model, lines, p = self._model, self._segment.lines, self._p
        motion, drive = model.plant.states.motion, model.plant.states.drive
        force = np.matmul(model.dynamics.force[:, motion], p.response.drive) + model.dynamics.force[:, drive]
        weighted = np.matmul(force, self._weight)
        missed = force - weighted
        steady = np.einsum("fij,fj,fij->i", missed, self.power, missed.conj()).real
        steady += np.einsum("fij,fji->i", np.matmul(weighted, self._noise), weighted.conj().transpose(0, 2, 1)).real
        everything = slice(0, len(v))
        direct = self._sensitivity.forces(v) + np.matmul(
            np.matmul(model.dynamics.force[:, motion], p.response.accel), self._sensitivity.pushes(self._segment, v, everything)
        )
        body = self._root[: direct.shape[2]]
        changes = np.matmul(weighted, self._gain) + times_real(direct, body)
        still = self._sensitivity.still.T @ body
        found = np.empty((lines.count, len(steady)))
        for i in range(len(steady)):
            moving = lines.back(changes[:, i])
            found[:, i] = np.einsum("np,np->n", moving, moving) + 2.0 * moving @ still[i] + still[i] @ still[i]
        means = np.diag(model.plant.static_covariance(model.constants)) + self._unknown_means(v)
        return np.asarray(found + 2.0 / lines.count * steady + means)

    def _unknown_means(self, v: Complex) -> Array:
        """Return the variance by the means of forces beside their laws, shape (3 M,): no acceleration tells them.

        They are about as large as these forces move; what the springs carry of the weight is as uncertain as they are.
        """
        m, plant = self._model.constants, self._model.plant
        left = unbalanced(m.points, m.stiffness)
        square = 2.0 / self._segment.lines.count * np.sum(np.abs(v[:, plant.states.free_force]) ** 2, axis=0)
        places = list(plant.freed)
        weight = np.array(plant.freed_std) * m.static.ravel()[places]
        return np.asarray(left[:, places] ** 2 @ (m.mass**2 * square + weight**2))
