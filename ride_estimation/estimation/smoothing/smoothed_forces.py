# Copyright 2026 ride_estimation contributors
"""Smoothed attachment forces of a recorded run: a second, non-causal pass over what the online estimator was given.

Live, a deflection is a double integral that must not wait: its slow part drifts, and the deformation of the frame, which
equilibrium does not tell, is known to a tenth of the force. Of a recording the future is known too. Deflections come from
filters that look both ways (:mod:`smoothed_deflection`), parameters from a course that carries what was learned later back to
where nothing contradicts it; law, equilibrium and standard deviation are those of the online estimator
(:class:`~ride_estimation.estimation.forces.mount_forces.MountForceEstimator`).

Beside gaps of a base sensor and at the ends of a stretch the second pass may know less than the first: there the online estimate
takes over, as far as it states the smaller error.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.common.estimate import Estimate, Status
from ride_estimation.estimation.common.geometry import Geometry
from ride_estimation.estimation.forces.force_basis import ForceModel
from ride_estimation.estimation.forces.mount_forces import ForceBlock, MountForceEstimator
from ride_estimation.estimation.forces.mount_law import MountLaw
from ride_estimation.estimation.kinematics.bracket_tilt import BracketTilt
from ride_estimation.estimation.kinematics.deflection import DeflectionBlock
from ride_estimation.estimation.kinematics.deflection_kernel import LARGEST_TURN
from ride_estimation.estimation.kinematics.frame_deformation import FrameDeformation
from ride_estimation.estimation.model.run_forces import RunForces
from ride_estimation.estimation.model.run_parameters import beside_online
from ride_estimation.estimation.motion.loads import InertialLoads
from ride_estimation.estimation.output import OutputBlock
from ride_estimation.estimation.smoothing.parameter_course import smoothed_course
from ride_estimation.estimation.smoothing.smoothed_deflection import DeflectionSmoother, SmoothedDeflection
from ride_estimation.frames import AXES

Array = NDArray[np.float64]

#: length of the pieces over which parameters and covariances are held, shortest stretch that is looked at [s]
_PIECE, _SHORTEST = 0.25, 4.0
#: time in which a missing base sensor is forgotten, either way [s]
_FADES = 3.0
#: time before the end of a stretch in which the online estimate takes over: with nothing to come it is as good as any [s]
_LAST = 1.5
#: stated variance over that of the online estimate at which they count alike: below it the one that knows more counts
_WORSE = 2.0
#: names of parameters of vertical laws
_VERTICAL = (".z.stiffness", ".z.damping")
#: change of a logarithm, in standard deviations, that the laws are made anew for
_FINE = 0.1


#: arrays of the first pass that the second needs
SIGNALS = (
    "stamp_ns", "mount_force", "mount_force_std", "mount_deflection", "support_load", "cg_specific_force", "angular_rate",
)  # fmt: skip


@dataclasses.dataclass(frozen=True)
class SmoothedForces:
    """Smoothed forces.

    Attributes
    ----------
    force, std, deflection
        Shape (N, M, 3), as ``mount_force``, ``mount_force_std`` and ``mount_deflection`` of the online estimate.
    share
        Mean share of the second pass in them; the rest is the online estimate.
    model_share
        Mean share of the model of the whole run in them (:mod:`ride_estimation.estimation.model`).
    not_modelled
        Why that has none, or none of the vertical forces.
    findings
        Sentences: how the vehicle differs from its file by that model.
    parameters, mass_properties
        Stiffness and damping of the mounts, CG and inertia of the body by that model, none where it has no share.
    load
        Sentence on a load that the vehicle file does not contain, empty where the model found none; it is in ``std``.
    """

    force: Array
    std: Array
    deflection: Array
    share: float
    model_share: float = 0.0
    not_modelled: str = ""
    findings: tuple[str, ...] = ()
    parameters: tuple[Estimate, ...] = ()
    mass_properties: tuple[Estimate, ...] = ()
    load: str = ""


@dataclasses.dataclass(frozen=True)
class _Piece:
    """Consecutive ticks ``first`` to ``end`` with what holds for all of them; ``spread`` is the standard deviation of deflection
    and rate as the online estimator stated it, shape (2, M, 3).
    """

    first: int
    end: int
    spread: Array
    load_covariance: Array
    constant_load: Array
    motion_covariance: Array
    complete: bool
    model: ForceModel


@dataclasses.dataclass(frozen=True)
class _Recorded:
    """A stretch of N ticks without a break.

    Attributes
    ----------
    pieces, step
        What it is made of, and its tick [s].
    base
        Specific force of the brackets, shape (N, 3 M), single precision.
    frame_turn
        Rotation of the frame that the brackets do not make and its rate, shape (N, 2, 3).
    measured
        Deflection and rate along the axes a transducer measures, shape (N, 2, T).
    """

    pieces: list[_Piece]
    step: float
    base: NDArray[np.float32]
    frame_turn: Array
    measured: Array


class SmootherRecorder:
    """What the second pass needs of the first.

    Parameters
    ----------
    geometry
        Body, mounts and sensors.
    reason
        Why there shall be no second pass, empty where there shall.
    """

    def __init__(self, geometry: Geometry, reason: str = "") -> None:
        self.geometry = geometry
        #: why there is no second pass, empty where there is
        self.reason = reason or _reason(geometry)
        self._base: list[NDArray[np.float32]] = []
        self._frame_turn: list[Array] = []
        self._measured: list[Array] = []
        self.axes = np.array(
            [3 * geometry.mount_names.index(s.mount) + AXES.index(s.axis) for s in geometry.transducers], dtype=np.int64
        )
        #: pieces of every stretch of ticks without a break, and its tick [s]
        self._stretches: list[tuple[list[_Piece], float]] = []
        self._open: list[OutputBlock] = []
        self._ticks, self._stamp, self._step = 0, 0, 0

    def take(self, block: OutputBlock) -> OutputBlock:
        """Keep what is needed of a block and return the block without it."""
        basis = block.basis
        if self.reason:
            return dataclasses.replace(block, basis=None)
        if basis is None:
            return self._pass_over(block)
        d = basis.deflection
        size = len(d.base)
        self._base.append(d.base.reshape(size, -1).astype(np.float32))
        self._frame_turn.append(np.stack([d.frame_turn, d.frame_turn_rate], axis=1))
        self._measured.append(np.stack([x.reshape(size, -1)[:, self.axes] for x in (d.deflection, d.rate)], axis=1))
        self._stretch(block)
        self._open.append(block)
        self._stamp = int(block.stamp_ns[-1])
        if self._stamp - int(self._open[0].stamp_ns[0]) + self._step >= _PIECE * 1e9:
            self._close()
        return dataclasses.replace(block, basis=None)

    def _pass_over(self, block: OutputBlock) -> OutputBlock:
        """Let a block that says nothing end the stretch; its ticks count all the same."""
        self._close()
        size = len(block.valid)
        self._base.append(np.zeros((size, 3 * len(self.geometry.mounts)), dtype=np.float32))
        self._frame_turn.append(np.zeros((size, 2, 3)))
        self._measured.append(np.zeros((size, 2, len(self.axes))))
        self._ticks, self._stamp = self._ticks + size, 0
        return block

    def _stretch(self, block: OutputBlock) -> None:
        """Begin a new stretch where a block does not follow the last one."""
        step = int(block.stamp_ns[1] - block.stamp_ns[0]) if len(block.stamp_ns) > 1 else self._step
        if not self._stretches or step != self._step or int(block.stamp_ns[0]) - self._stamp != step:
            self._close()
            self._stretches.append(([], step * 1e-9))
            self._step = step

    def _close(self) -> None:
        """Make a piece of the blocks at hand."""
        if not self._open:
            return
        last, first = self._open[-1], self._ticks
        self._ticks += sum(len(b.stamp_ns) for b in self._open)
        basis = last.basis
        assert basis is not None
        complete = all(b.basis is not None and b.basis.complete for b in self._open)
        motion = last.cg_specific_force_covariance
        spread = np.stack([basis.deflection.std, basis.deflection.rate_std])
        piece = _Piece(first, self._ticks, spread, basis.load_covariance, basis.constant_load, motion, complete, basis.model)
        self._stretches[-1][0].append(piece)
        self._open = []

    def ordinary(self, model: RunForces) -> Array:
        """Return per tick whether the vehicle was one that a model describes, shape (N,).

        No load was found that the model has not, no sensor lost or suspect. Where the model has estimated a sensor's error beyond
        its tolerance, that is why sensors are suspect; a load and a law that is not linear make readings of a base suspect.
        """
        found = np.ones(self._ticks)
        for piece in (p for pieces, _ in self._stretches for p in pieces):
            misread = not (model.findings or model.faults or model.load) and np.any(piece.model.misread > 0.0)
            if (piece.model.loaded and not model.load) or not (piece.complete or model.faults) or misread:
                found[piece.first : piece.end] = 0.0
        return found

    @property
    def loaded(self) -> bool:
        """Return whether a load was found at any time: its mass is not in what the model takes as known."""
        return any(piece.model.loaded for pieces, _ in self._stretches for piece in pieces)

    def finish(self) -> list[_Recorded]:
        """Return the stretches of ticks without a break."""
        self._close()
        base, frame_turn, measured = np.concatenate(self._base), np.concatenate(self._frame_turn), np.concatenate(self._measured)
        found = []
        for pieces, step in self._stretches:
            at = slice(pieces[0].first, pieces[-1].end)
            found.append(_Recorded(pieces, step, base[at], frame_turn[at], measured[at]))
        return found


def _reason(geometry: Geometry) -> str:
    if not geometry.mounts:
        return "the vehicle file has no mounts of the body"
    if not geometry.has_base_motion:
        return (
            "not every mount has an accelerometer at its base: the deflections either come from transducers, which need no "
            "smoothing, or from equilibrium and ratios of stiffness, which smoothing does not improve"
        )
    return ""


class _SmoothedFrame(FrameDeformation):
    """Deformation that is known already: the deforming part of deflections that were smoothed as a whole."""

    def hold(self, value: Array, rate: Array, variance: Array) -> None:
        """Take deflection and rate of the next block, (K, 3 M), and their error variances, (2, 3)."""
        self._held = value @ self.projector.T, rate @ self.projector.T
        self.variance, self.rate_variance = variance

    def observe(self, relative: Array, *_: object) -> tuple[Array, Array]:
        """Return deformation and rate of the block, shape (K, M, 3)."""
        value, rate = self._held
        return value.reshape(relative.shape), rate.reshape(relative.shape)


class _SmoothedForces(MountForceEstimator):
    """The online forces, on smoothed deflections."""

    def __init__(self, geometry: Geometry, tilting: BracketTilt) -> None:
        known = np.ones((len(geometry.mounts), 3), dtype=bool)
        super().__init__(geometry, MountLaw(geometry), known, tilting)
        stated = np.array([s.noise_std**2 for s in geometry.base_sensors if s is not None])
        self.frame = _SmoothedFrame(self._g, stated, tilting, geometry.vehicle.gravity, geometry.arms)
        self._frame = self.frame

    def _rest(self) -> Array:
        """Return the forces at rest without what transducers show of a load; other deflections have no mean here."""
        return np.where(self._transducer.reshape(self._strain.shape), self.static_force - self._strain, self.static_force)

    def use(self, model: ForceModel) -> None:
        """Take over parameters; laws are made anew only where that matters."""
        change = np.abs(np.log(model.multipliers / self.law.multipliers))
        if np.any(change > np.maximum(_FINE * model.std, 1e-6)):
            self.law.scale(model.multipliers)
        self.mass, self.mass_relative_std = model.mass, model.mass_std
        self.misread_variance = model.misread
        self.follow, self.parameter_std, self.cg_offset, self.loaded = model.follow, model.std, model.cg_offset, model.loaded


def second_pass(
    recorder: SmootherRecorder, signals: Mapping[str, NDArray[Any]], tilting: BracketTilt, memory: float, model: RunForces,
    parameters: Sequence[Estimate], amplitude_std: Mapping[str, float],
) -> SmoothedForces | str:  # fmt: skip
    """Estimate the forces of a finished run again.

    Parameters
    ----------
    recorder
        Of the run.
    signals
        Joined arrays of the first pass, those of :data:`SIGNALS` at least.
    tilting
        How the brackets tilt, as learned in the end.
    memory
        Time over which parameters stay similar [s].
    model
        Forces by the model of the whole run.
    parameters, amplitude_std
        As estimated online in the end, and what dependence on the amplitude adds to them.

    Returns
    -------
    SmoothedForces or str
        The forces, or why there are none.
    """
    if recorder.reason:
        return recorder.reason
    force, deflection = signals["mount_force"].copy(), signals["mount_deflection"].copy()
    std = signals["mount_force_std"].copy()
    weight = np.zeros(len(force))
    looked = 0
    for recorded in recorder.finish():
        if len(recorded.base) * recorded.step < _SHORTEST:
            continue
        looked += 1
        _Stretch(recorder, recorded, signals, tilting, memory).write(force, std, deflection, weight)
    if not looked:
        return f"no stretch of the run without a break is {_SHORTEST:g} s long"
    if not all(np.isfinite(values).all() for values in (force, std, deflection)):
        return "its forces are not finite: the sensors contradict each other beyond use for a time"
    if model.refused:
        load = "" if recorder.loaded else model.load
        std = np.hypot(std, model.load_share * np.abs(force)) if load else std
        return SmoothedForces(force, std, deflection, float(weight.mean()), not_modelled=model.refused, load=load)
    # a force beside a law, a load and a faulty sensor explain why laws are not valid
    reason = "" if model.findings or model.load or model.faults else _not_linear(parameters)
    share = model.fade_in(signals["stamp_ns"], recorder.ordinary(model), force, std, deflection, 2 if reason else 3)
    beyond = tuple(f"{error} is beyond its tolerance" for error in model.faults)
    found = SmoothedForces(
        force, std, deflection, float(weight.mean()), share, reason, (*model.findings, *beyond), load=model.load
    )
    if not share or (recorder.loaded and not model.load):
        return found
    known = beside_online(model.parameters, parameters, amplitude_std)
    return dataclasses.replace(found, parameters=known, mass_properties=model.mass_properties)


def _not_linear(parameters: Sequence[Estimate]) -> str:
    """Return which vertical laws are not known as linear ones, empty where all are: they carry the weight.

    A damper with play that the residuals hide bent the stiffness of the mounts by 5 % and with it the static forces (cab_14 of
    the foreign runs: 55 instead of 100 % inside at the worst mount).
    """
    names = [e.name for e in parameters if e.name.endswith(_VERTICAL) and e.status is not Status.VALID]
    return f"vertical laws that are not valid: {', '.join(names[:3])}{' ...' if len(names) > 3 else ''}" if names else ""


class _Stretch:
    """A stretch of ticks without a break."""

    def __init__(
        self, recorder: SmootherRecorder, recorded: _Recorded, signals: Mapping[str, Array], tilting: BracketTilt, memory: float
    ) -> None:
        pieces, dt = recorded.pieces, recorded.step
        self._pieces, self._dt = pieces, dt
        first, end = pieces[0].first, pieces[-1].end
        self._ticks = slice(first, end)
        self._own = {name: signals[name][self._ticks] for name in SIGNALS}
        models = [p.model for p in pieces]
        self._models = smoothed_course(models, np.array([(p.end - p.first) * dt for p in pieces]), memory)
        self._forces = _SmoothedForces(recorder.geometry, tilting)
        self._forces.use(self._models[len(models) // 2])
        self._maps = tilting.maps.reshape(3 * len(tilting.maps), -1)
        self._frame_turn, self._frame_turn_rate = recorded.frame_turn[:, 0], recorded.frame_turn[:, 1]
        law = self._forces.law
        smoother = DeflectionSmoother(recorder.geometry, self._forces.frame, tilting.maps, law.stiffness, law.damping)
        g = recorder.geometry.wrench
        covariance = np.mean([p.motion_covariance for p in pieces], axis=0)
        variance = np.einsum("ri,rs,si->i", g, covariance, g).reshape(-1, 3).mean(axis=0)
        self._smoothed: SmoothedDeflection = smoother.smooth(
            self._own["cg_specific_force"], self._own["angular_rate"], recorded.base.astype(float), self._frame_turn, variance, dt
        )
        for values, measured in ((self._smoothed.value, 0), (self._smoothed.rate, 1)):
            values[:, recorder.axes] = recorded.measured[:, measured]

    def write(self, force: Array, std: Array, deflection: Array, weight: Array) -> None:
        """Fade the smoothed forces into those of the first pass, in place."""
        own, first = self._own, self._pieces[0].first
        incomplete = self._incomplete()
        scatter = np.var(own["mount_force"], axis=0)
        found_force, found, found_deflection = np.empty_like(own["mount_force"]), [], np.empty_like(own["mount_force"])
        shares = np.empty(len(self._pieces))
        for n, (piece, model) in enumerate(zip(self._pieces, self._models, strict=True)):
            at = slice(piece.first - first, piece.end - first)
            block = self._forces_of(piece, model, at)
            found_force[at], found_deflection[at] = block.force, block.deflection
            wide = incomplete[n] ** 2 * scatter
            found.append(block.std[0] ** 2 + wide)
            live = own["mount_force_std"][at.start] ** 2
            ratio = found[-1].mean(axis=0) / np.maximum(live.mean(axis=0), 1e-300)
            shares[n] = 1.0 / (1.0 + min(float(ratio.max()) / _WORSE, 1e3) ** 8)
        middle = np.array([0.5 * (p.first + p.end) - first for p in self._pieces])
        ticks = np.arange(len(found_force))
        share = np.interp(ticks, middle, shares) * np.clip((len(ticks) - ticks) * self._dt / _LAST, 0.0, 1.0)
        weight[self._ticks] = share
        length = [p.end - p.first for p in self._pieces]
        w = share[:, None, None]
        force[self._ticks] += w * (found_force - own["mount_force"])
        deflection[self._ticks] += w * (found_deflection - own["mount_deflection"])
        live_square = own["mount_force_std"] ** 2
        std[self._ticks] = np.sqrt(live_square + w * (np.repeat(np.array(found), length, axis=0) - live_square))

    def _forces_of(self, piece: _Piece, model: ForceModel, at: slice) -> ForceBlock:
        """Return the forces of a piece."""
        forces, count = self._forces, len(self._maps) // 3
        value, rate = self._smoothed.value[at], self._smoothed.rate[at]
        shape = (len(value), count, 3)
        frame_turn, frame_turn_rate = self._frame_turn[at], self._frame_turn_rate[at]
        turn = np.clip((value @ self._maps.T).reshape(shape) + frame_turn[:, None], -LARGEST_TURN, LARGEST_TURN)
        turn_rate = (rate @ self._maps.T).reshape(shape) + frame_turn_rate[:, None]
        variance = self._smoothed.variance_at(0.5 * (at.start + at.stop) * self._dt)
        forces.use(model)
        forces.frame.hold(value, rate, variance[1])
        forces.constant_load = piece.constant_load
        # deflections slower than any filter lets through are errors here too; equilibrium puts them right if it may
        spread, rate_spread = np.sqrt(piece.spread**2 + variance[0][:, None])
        block = DeflectionBlock(
            value.reshape(shape), rate.reshape(shape), value.reshape(shape), turn, frame_turn, frame_turn_rate, spread,
            rate_spread, value.reshape(shape),
        )  # fmt: skip
        measured = np.ones(len(value), dtype=bool)
        return forces.observe(block, self._support(piece.model, model, at), measured, piece.load_covariance, turn_rate, self._dt)

    def _support(self, then: ForceModel, now: ForceModel, at: slice) -> Array:
        """Return the wrench the mounts carry with mass and inertia known later."""
        support, motion, rate = (self._own[name][at] for name in ("support_load", "cg_specific_force", "angular_rate"))
        new, old = (InertialLoads(m.mass, 0.0, m.inertia, cg_offset=m.cg_offset).load(motion, rate) for m in (now, then))
        return np.asarray(support + new - old)

    def _incomplete(self) -> Array:
        """Return how close every piece is to one that lacked a sensor, 1 there and fading both ways, shape (pieces,)."""
        incomplete = np.array([0.0 if p.complete else 1.0 for p in self._pieces])
        fade = [float(np.exp(-(p.end - p.first) * self._dt / _FADES)) for p in self._pieces]
        for n in range(1, len(incomplete)):
            incomplete[n] = max(incomplete[n], fade[n] * incomplete[n - 1])
        for n in range(len(incomplete) - 2, -1, -1):
            incomplete[n] = max(incomplete[n], fade[n] * incomplete[n + 1])
        return incomplete
