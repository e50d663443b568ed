# Copyright 2026 ride_estimation contributors
"""Deformation of the frame under the mounts: the part of the deflections no rigid motion explains, as a random process.

Deflections are ``D = Phi q + e``: rigid relative motion q (equilibrium shows what it does to the forces) and deformation e, with
``Q = I - Phi Phi^+`` and ``Q D'' = -Q a_base``: the body and everything common to all brackets (attitude, bias of the body)
cancel. Integrated twice the noise of the base sensors grows as ``1 / omega^4`` below about 2 Hz, where frames are nearly rigid.

Per axis the spectrum of ``Q D''`` is followed (:mod:`deformation_spectrum`) and the causal filter that leaves least of the
force, ``k^2 var(e) + c^2 var(e')``, is chosen from a bank of optimal ones (:mod:`deformation_filter`); what it leaves is the
variance the attachment forces state. Vertical deformation twists the frame and tilts the brackets; gravity then appears in their
horizontal axes and is taken out with the estimated twist, and what is left of it is noise there. What a finite rotation strains
in second order is no deformation and comes from the rotation itself.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.common.saved_state import fields_of, take_fields
from ride_estimation.estimation.kinematics.bracket_tilt import BracketTilt
from ride_estimation.estimation.kinematics.deformation_filter import FilterBank
from ride_estimation.estimation.kinematics.deformation_spectrum import DeformationSpectrum
from ride_estimation.estimation.kinematics.frame_kernel import filter_history, frame_block

Array = NDArray[np.float64]

#: memory of the constant bias [s]
_BIAS_MEMORY = 30.0
#: standard deviation of the deformation while nothing is known of the spectrum [m]
_UNKNOWN = 5e-4
#: the same of its rate [m/s]
_UNKNOWN_RATE = 1e-2
#: a filter is left only for one with so much less error variance
_WORTH = 0.9
#: share of the twist's mean square its error must be below for its tilt to be taken out
_TRUSTED = 0.25
#: time in which that fades in [s]
_FADE = 2.0
#: largest corner over the rate of the ticks, for linear interpolation between samples
_RESOLVED = 0.05
#: attributes that are part of a saved state
_SAVED = ("_state", "variance", "rate_variance", "_time", "_age", "_trusted", "_trust")


class FrameDeformation:
    """Deformation of the frame at the mounts, and how well it is known.

    Parameters
    ----------
    wrench
        G of the free coordinates, shape (F, 3 M); its transpose gives the deflections of a rigid motion.
    base_variance
        Noise variance of the base sensors, shape (M,).
    tilting
        How the brackets tilt with their frame.
    gravity
        [m/s^2].
    arms
        Mount minus CG, shape (M, 3) [m].
    """

    def __init__(self, wrench: Array, base_variance: Array, tilting: BracketTilt, gravity: float, arms: Array) -> None:
        size = wrench.shape[1]
        self.projector = np.eye(size) - np.linalg.pinv(wrench) @ wrench
        self._count = size // 3
        self._arms, self._tilting, self._gravity = arms, tilting, gravity
        self._freedom = np.array([np.trace(self.projector[a::3, a::3]) for a in range(3)])
        self._base_variance = float(np.mean(base_variance))
        #: whether the acceleration of every base is measured: one that is made up from the others says nothing about the spectrum
        self.learns = True
        self.take_tilt()
        self.reset()

    def reset(self) -> None:
        """Start again from an undeformed frame of which nothing is known."""
        self._step = self._age = 0.0
        self._state = np.zeros((6, len(self.projector)))
        self.restart()

    def restart(self) -> None:
        """Start again from an undeformed frame; biases of the sensors and what is known of its spectrum stay."""
        self._state[[0, 1, 2, 3, 5]] = 0.0
        #: time since the start, and since the biases are followed [s]
        self._time = 0.0
        #: transition, share of the old and of the new sample of the filter of every axis
        self._filters = np.zeros((3, 4, 4)), np.zeros((3, 4)), np.zeros((3, 4))
        self._trusted, self._trust = False, 0.0
        self._chosen = np.full(3, -1)
        if self._step:
            self._spectrum.interrupt()
            self._begin()
        #: error variance of value and rate of a channel before projection, per axis
        self.variance, self.rate_variance = np.full(3, _UNKNOWN**2), np.full(3, _UNKNOWN_RATE**2)

    @property
    def bias(self) -> list[float]:
        """Return the constant relative accelerations, (3 M,) as a plain list [m/s^2]."""
        found: list[float] = self._state[4].tolist()
        return found

    def undeform(self, bias: Sequence[float]) -> None:
        """Begin from an undeformed frame with biases of an earlier time, none for unknown ones; filters and spectrum stay."""
        self._state[:] = 0.0
        if self._step:  # a new filter would be given the states of what is remembered
            self._spectrum.interrupt()
        if bias:
            self._state[4] = bias
        else:
            self._age = 0.0

    def take_tilt(self) -> None:
        """Take over how the brackets tilt: the maps of the twist, and the spread of its shares."""
        self._turn_map = self._tilting.maps.mean(axis=0)
        self.tilt = self._gravity_map(self._tilting.maps)
        self.tilt_square = self._square(self.tilt)
        #: variance of what a unit of vertical deformation wrongly adds because the shares are uncertain, per axis
        self.spread_square = np.sum([self._square(self._gravity_map(maps)) for maps in self._tilting.spread], axis=0)

    def _gravity_map(self, tilt_maps: Array) -> Array:
        """Return what gravity adds to the projected relative acceleration through tilt, from vertical deformations, (3 M, M)."""
        size = len(self.projector)
        tilt = np.zeros((size, size))
        tilt[0::3], tilt[1::3] = self._gravity * tilt_maps[:, 1], -self._gravity * tilt_maps[:, 0]
        seen = self.projector @ tilt[:, 2::3]
        seen[2::3] = 0.0
        return np.asarray(seen)

    def _square(self, gravity_map: Array) -> Array:
        """Return the mean squared gain of a map per degree of freedom, shape (3,)."""
        square = np.sum((gravity_map @ self.projector[2::3, 2::3]) ** 2, axis=1)
        return np.asarray(square.reshape(self._count, 3).sum(axis=0) / np.maximum(self._freedom, 1e-9))

    def observe(
        self, relative: Array, turn: Array, turn_rate: Array, frame_turn: Array, frame_turn_rate: Array, stiffness: Array,
        damping: Array, dt: float,
    ) -> tuple[Array, Array]:  # fmt: skip
        """Return deformation and its rate at the ticks of a block, shape (K, M, 3) each.

        Parameters
        ----------
        relative
            Relative acceleration of body and bracket without what gravity adds through tilt, shape (K, M, 3) [m/s^2].
        turn, turn_rate
            Rotation of the body against the brackets and its rate, shape (K, M, 3).
        frame_turn, frame_turn_rate
            Rotation of the frame that the brackets do not make and its rate, shape (K, 3).
        stiffness, damping
            Tangents of the mounts, shape (M, 3): what an error of value and rate costs.
        dt
            Tick [s].
        """
        ticks = len(relative)
        if dt != self._step:
            self._design(dt)
        self._time, self._age = self._time + ticks * dt, self._age + ticks * dt
        shape = relative.shape
        flat = np.empty((ticks, len(self.projector)))
        value, rate = np.empty_like(flat), np.empty_like(flat)
        forget = 1.0 - math.exp(-dt / min(_BIAS_MEMORY, self._age))
        frame_block(
            relative, turn, turn_rate, frame_turn, frame_turn_rate, self._turn_map, self._arms, self.projector, self.tilt,
            self._trust, dt, forget, *self._filters, self._state, flat, value, rate,
        )  # fmt: skip
        self._trust = min(max(self._trust + (1.0 if self._trusted else -1.0) * ticks * dt / _FADE, 0.0), 1.0)
        if self.learns and self._spectrum.add(flat):
            self._choose(stiffness, damping)
        return value.reshape(shape), rate.reshape(shape)

    def covariance(self) -> tuple[Array, Array]:
        """Return the error covariances of value and rate, shape (3 M, 3 M) each."""
        q = self.projector
        return (q * np.tile(self.variance, self._count)) @ q, (q * np.tile(self.rate_variance, self._count)) @ q

    @property
    def seen(self) -> bool:
        """Return whether something is known of the spectrum."""
        return bool(self._step and self._spectrum.averaged)

    def made_up_covariance(self, share: Array) -> tuple[Array, Array]:
        """Return what made-up motion of bases leaves of value and rate, covariances of shape (3 M, 3 M) each.

        Its error is noise of the spectrum of what a bracket moves on its own; along the vertical it also tilts the brackets.

        Parameters
        ----------
        share
            Variance of the error over that of what a bracket moves on its own, shape (M, 3).
        """
        spectrum, q = self._spectrum, self.projector
        white = 2.0 * self._base_variance * self._step
        signal = spectrum.split(2, white, np.zeros(len(spectrum.frequencies)))[0]
        whole = signal / (2.0 * np.pi * spectrum.frequencies) ** 4
        chosen = self._chosen.tolist()
        own = [self._bank.passed(n, spectrum.density[:, a]) for a, n in enumerate(chosen)]
        tilted = [self._bank.passed(n, whole) for n in chosen]
        turned = self.tilt @ q[2::3, 2::3]
        found = []
        for kind in range(2):
            moved = (q * (share * [p[kind] for p in own]).ravel()) @ q
            scale = np.sqrt(np.tile([p[kind] for p in tilted], self._count))[:, None] * turned
            found.append(moved + (scale * share[:, 2]) @ scale.T)
        return found[0], found[1]

    @property
    def static_gain(self) -> Array:
        """Return value over acceleration that does not move of the filter of every axis, squared, shape (3,) [s^4]."""
        # until one is chosen the last of the bank is in force
        return np.asarray(self._bank.static[self._chosen]) if self._step else np.zeros(3)

    def _design(self, dt: float) -> None:
        """Make ready for a tick: the highest corner until the spectrum is known."""
        self._step = dt
        self._spectrum = DeformationSpectrum(self._freedom, dt)
        frequencies, widths = self._spectrum.frequencies, self._spectrum.widths
        self._bank = FilterBank(frequencies, widths, _RESOLVED / dt)
        self._begin()

    def _begin(self) -> None:
        """Put the highest corner in force: what the start leaves fades most quickly."""
        self._chosen[:] = -1
        for axis in range(3):
            self._use(axis, self._bank.discretised(len(self._bank.corner) - 1, self._step))

    def _use(self, axis: int, discretised: tuple[Array, Array, Array]) -> None:
        """Put a filter in force for an axis."""
        for own, part in zip(self._filters, discretised):
            own[axis] = part

    def _choose(self, stiffness: Array, damping: Array) -> None:
        """Choose the filter of every axis; the vertical one first, as what it leaves tilts the others."""
        k2, c2 = np.mean(stiffness**2, axis=0), np.mean(damping**2, axis=0)
        tilt = whole = np.zeros(len(self._spectrum.frequencies))
        for axis in (2, 0, 1):
            if self._freedom[axis] > 1e-6:
                noise = tilt * self.tilt_square[axis] + whole * self.spread_square[axis]
                left, bend = self._choose_axis(axis, k2[axis], c2[axis], noise)
                if axis == 2:
                    tilt, whole = left, bend

    def _choose_axis(self, axis: int, k2: float, c2: float, tilt: Array) -> tuple[Array, Array]:
        """Choose a filter for what errors cost; return the densities of the value's error and of the value [m^2/Hz]."""
        spectrum, bank, dt = self._spectrum, self._bank, self._step
        measured = spectrum.density[:, axis]
        signal, tilt, white = spectrum.split(axis, 2.0 * self._base_variance * dt, tilt)
        signal = signal * max(1.0, float(spectrum.surge[axis]))
        value, rate = bank.errors(signal, tilt, white, self._time)
        # the mean that stands for the bias is as good as the slowest part of the signal lets it be
        value = value + bank.static * measured[0] / (4.0 * min(_BIAS_MEMORY, self._age))
        cost = k2 * value + c2 * rate
        best, now = int(np.argmin(cost)), int(self._chosen[axis])
        if now < 0 or cost[best] < _WORTH * cost[now]:
            self._chosen[axis] = now = best
            self._use(axis, bank.discretised(now, dt))
            self._warm_up(axis)
        self.variance[axis], self.rate_variance[axis] = value[now], rate[now]
        whole = signal / (2.0 * np.pi * spectrum.frequencies) ** 4
        if axis != 2:
            return tilt, whole
        self._trusted = bool(value[now] < _TRUSTED * float(spectrum.widths @ whole))
        return self._trust * bank.left(now, signal, tilt + white) + (1.0 - self._trust) * whole, whole

    def _warm_up(self, axis: int) -> None:
        """Give a new filter the states it would have had it run all the time: without them its integrals would ring.

        It runs over the remembered samples from the start that makes its innovations smallest.
        """
        averages, step, rest = self._spectrum.history()
        index, count = int(self._chosen[axis]), self._count
        b, bias = self._bank.b[index], self._state[4, axis::3]
        # channels from rest, then the response to each state at the start
        state = np.hstack([np.zeros((4, count)), np.eye(4)])
        samples = np.hstack([averages[:, axis::3] - bias, np.zeros((len(averages), 4))])
        transition, old, new = (np.ascontiguousarray(part) for part in self._bank.discretised(index, step))
        # averages held over their interval: its integral, the rate, is then exact
        innovation = filter_history(samples, b, transition, np.zeros(4), old + new, state)
        seen, own = innovation[:, count:], innovation[:, :count]
        normal = seen.T @ seen + self._bank.start_weight(index, step)
        scale = 1.0 / np.sqrt(np.diag(normal))
        start = scale[:, None] * np.linalg.solve(normal * np.outer(scale, scale), -scale[:, None] * (seen.T @ own))
        now = state[:, :count] + state[:, count:] @ start
        # the interval of the last average ends half a tick after its last sample
        edge = rest[0, axis::3] - bias if len(rest) else self._state[5, axis::3]
        now[:3] -= 0.5 * self._step * now[1:]
        now[3] -= 0.5 * self._step * edge
        transition, old, new = (part[axis] for part in self._filters)
        filter_history(np.ascontiguousarray(rest[:, axis::3] - bias), b, transition, old, new, now)
        self._state[:4, axis::3] = now

    def save(self) -> dict[str, Any]:
        """Return the state as plain lists."""
        spectrum = self._spectrum.save() if self._step else None
        return {**fields_of(self, (*_SAVED, "_step", "_chosen")), "spectrum": spectrum}

    def load(self, saved: dict[str, Any]) -> None:
        """Continue from :meth:`save`."""
        self.reset()
        if saved["spectrum"] is None:
            return
        self._design(float(saved["step"]))
        self._spectrum.load(saved["spectrum"])
        self._chosen = np.array(saved["chosen"], dtype=int)
        for axis, n in enumerate(self._chosen.tolist()):
            if n >= 0:
                self._use(axis, self._bank.discretised(n, self._step))
        take_fields(self, _SAVED, saved)
