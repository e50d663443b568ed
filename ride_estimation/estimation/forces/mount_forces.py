# Copyright 2026 ride_estimation contributors
"""Attachment forces: the mount law corrected by rigid-body equilibrium, with the two parts of the uncertainty.

With constitutive forces F_c (covariance S), the wrench w the mounts carry (covariance W) and the map G of forces to wrench:
``K = S G^T (G S G^T + W)^-1``, ``F = F_c + K (w - G F_c)``. Error covariance ``K W K^T`` (what equilibrium leaves: measured
motion, mass) plus ``(I - K G) S (I - K G)^T`` (what the mount model assumes: for four three-axis mounts a six-dimensional null
space of G). What the integrators cannot see (slow motion) is shared by stiffness, ``f = K_s G^T (G K_s G^T)^-1 w``.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.common.block_math import mean_of_ticks
from ride_estimation.estimation.common.geometry import Geometry, weight_at
from ride_estimation.estimation.common.saved_state import fields_of, take_fields
from ride_estimation.estimation.forces.force_kernel import balanced_forces, follow_scaled, turned_motion, with_deformation
from ride_estimation.estimation.forces.mount_law import MountLaw
from ride_estimation.estimation.kinematics.bracket_tilt import BracketTilt
from ride_estimation.estimation.kinematics.deflection import DeflectionBlock, Equilibrium
from ride_estimation.estimation.kinematics.frame_deformation import FrameDeformation
from ride_estimation.frames import AXES
from ride_estimation.vehicles.prior import STATIC_LOAD_STD, std_of
from ride_estimation.vehicles.vehicle import Mount

Array = NDArray[np.float64]

#: share of the dynamic mount force that frame twist hides from the body (34 to 40 % in pilots, up to 80 % on twisting frames)
TWIST_SHARE = 0.7
#: memory of mean squares [s]
_MEMORY = 5.0
#: memory of those of spring forces where that is more: a bend is over before a mean has followed it [s]
_SHORT_MEMORY = 0.5
#: attributes that are part of a saved state
_SAVED = (
    "_elastic_square", "_elastic_now", "_viscous_square", "_dynamic_square", "_slow", "_gain", "_gain_slow", "_innovation",
    "_ratio", "_std", "_until", "_time", "static_force", "loaded", "_stiffness", "mass", "cg_offset", "parameter_std",
)  # fmt: skip
#: time between two recomputations of the gains [s]
_INTERVAL = 0.2
#: memory of the residual of equilibrium against its covariance [s]
_CONSISTENCY_MEMORY = 5.0
#: rows of the wrench that judge horizontal and vertical deflections
_ROWS = ((0, 1, 5), (2, 3, 4))
#: corner below which the residual wrench is shared by stiffness [rad/s]
_SLOW_CORNER = 0.8
#: growth of the variance of made-up motion from which on gains do not wait: a sensor was left out just now
_SUDDENLY = 2.0
#: deflection that no mount is known better than, keeps the equations regular [m]
_LEAST_DEFLECTION = 2e-6


@dataclasses.dataclass(frozen=True)
class ForceBlock:
    """Forces on the body and their standard deviation, total and by part (K, M, 3); deflection and rate in mount axes."""

    force: Array
    std: Array
    std_equilibrium: Array
    std_model: Array
    deflection: Array
    rate: Array
    deflection_std: Array


def share_by_stiffness(wrench: Array, stiffness: Array) -> Array:
    """Return ``K G^T (G K G^T)^+``, shape (3 M, 6): mount forces from the wrench by stiffness alone.

    Parameters
    ----------
    wrench
        G, shape (6, 3 M).
    stiffness
        Shape (3 M,) [N/m].
    """
    weighted = stiffness[:, None] * wrench.T
    return np.asarray(weighted @ np.linalg.pinv(wrench @ weighted, rcond=1e-9, hermitian=True))


def static_share(wrench: Array, stiffness: Array, weight: Array) -> Array:
    """Return the mount forces that carry the weight, shape (3 M,) [N].

    Vertical forces in the ratio of the vertical stiffness where those can carry it (a cab is set down level, its mounts are not
    strained sideways); all axes by stiffness where they cannot.

    Parameters
    ----------
    wrench
        Rows of G of the free coordinates, shape (F, 3 M).
    stiffness
        Shape (3 M,) [N/m].
    weight
        Wrench to be carried, shape (F,).
    """
    vertical = np.zeros_like(stiffness)
    vertical[2::3] = stiffness[2::3]
    force = share_by_stiffness(wrench, vertical) @ weight
    if np.linalg.norm(wrench @ force - weight) > 1e-6 * np.linalg.norm(weight):
        force = share_by_stiffness(wrench, stiffness) @ weight
    return np.asarray(force)


def static_split(
    mounts: Sequence[Mount], wrench: Array, shared: Array, weight: Array, share_std: Array | float = 0.0
) -> tuple[Array, Array]:
    """Return the static forces, shape (M, 3) [N], and what equilibrium leaves of their covariance, (3 M, 3 M) [N^2].

    Loads that the file states, else shares of the weight, with standard deviations; equilibrium holds without error:
    ``f = s + K (w - G s)``, ``K = S G^T (G S G^T)^+``.

    Parameters
    ----------
    mounts
        M of them.
    wrench, weight
        As in :func:`static_share`.
    shared
        Its result.
    share_std
        Relative standard deviation of the stiffness it rests on, shape (3 M,).
    """
    prior, std = shared.copy(), np.hypot(STATIC_LOAD_STD, share_std) * np.abs(shared)
    for i, mount in enumerate(mounts):
        if mount.static_load is not None:
            prior[3 * i + 2] = mount.static_load.value
            std[3 * i + 2] = std_of(mount.static_load, STATIC_LOAD_STD)
    # what is carried sideways at rest follows from equilibrium alone
    std = np.maximum(std, 1e-6 * max(float(np.abs(weight).max(initial=0.0)), 1.0))
    gain = share_by_stiffness(wrench, std**2)
    left = np.eye(len(prior)) - gain @ wrench
    force = prior + gain @ (weight - wrench @ prior) if any(m.static_load for m in mounts) else shared
    return force.reshape(len(mounts), 3), (left * std**2) @ left.T


def double_cross_gradient(vector: Array, arms: Array) -> Array:
    """Return the derivative of ``w x (w x r)`` by w at every arm r, shape (3 M, 3).

    Parameters
    ----------
    vector
        w, shape (3,).
    arms
        Shape (M, 3).
    """
    along = np.einsum("mi,j->mij", arms, vector)
    inner = (arms @ vector)[:, None, None] * np.eye(3)
    return np.asarray((inner + along.transpose(0, 2, 1) - 2.0 * along).reshape(-1, 3))


class MountForceEstimator:
    """Attachment forces block by block.

    Parameters
    ----------
    geometry
        Body and mounts.
    law
        The mount elements, scaled by the parameter estimator.
    known
        Which mount axes have a measured deflection, shape (M, 3).
    tilting
        How the brackets tilt with their frame.
    """

    def __init__(self, geometry: Geometry, law: MountLaw, known: NDArray[np.bool_], tilting: BracketTilt) -> None:
        self.geometry = geometry
        self.law = law
        self.known = known
        self._tilting = tilting
        self.mass = geometry.body.mass.value
        self.mass_relative_std = 0.0
        #: offset of the CG from its place in the file, shape (3,) [m]
        self.cg_offset = np.zeros(3)
        #: whether what mass and CG differ from the file by is a load that came on after the body was set level
        self.loaded = False
        #: covariance of a constant error of the wrench (bias of sensors), which no filter sees, (6, 6)
        self.constant_load = np.zeros((6, 6))
        #: whether there is one at even odds only, and mass and CG are halfway to it
        self.even_odds = False
        #: share of the mass that may have come on as a load since the vehicle file was written, standard deviation
        self.load_share = 0.0
        #: angular rate of the body and the variance of its components, shape (3,) each
        self.turning: tuple[Array, Array] = (np.zeros(3), np.zeros(3))
        #: share of the rotation of the brackets that the mount axes follow
        self.follow = 1.0
        count = len(geometry.mounts)
        self._count, self._ones, self._all_known = count, np.ones((count, 3)), bool(known.all())
        self._of_file = (
            None if geometry.base_observable.all() or not geometry.base_observable.any() else law.stiffness.ravel().copy()
        )
        #: axes whose deflection is that of a rigid frame only: what the frame twists there is open
        self._made_up = known & ~geometry.base_seen
        for sensor in geometry.transducers:
            self._made_up[geometry.mount_names.index(sensor.mount), AXES.index(sensor.axis)] = False
        # log standard deviations of stiffness and damping, set by the parameter estimator
        self.parameter_std = np.zeros((2, count, 3))
        #: variance of the forces for base sensors that read too much or too little [N^2]
        self.misread_variance = np.zeros((count, 3))
        #: variance of made-up base motion over that of what a bracket moves on its own, now and when gains were made, (M, 3)
        self._made_up_now = self._made_up_then = np.zeros((count, 3))
        free = geometry.free
        self._g = geometry.wrench[free]
        self._free = free
        # where every bracket is measured, deformation of the frame is distinguished from rigid motion
        self._frame: FrameDeformation | None = None
        self._transducer = np.zeros(3 * count, dtype=bool)
        for sensor in geometry.transducers:
            self._transducer[3 * geometry.mount_names.index(sensor.mount) + AXES.index(sensor.axis)] = True
        if geometry.has_base_motion:
            stated = [s.noise_std**2 for s in geometry.base_sensors if s is not None]
            self._frame = FrameDeformation(self._g, np.array(stated), tilting, geometry.vehicle.gravity, geometry.arms)
        self.reset()

    def bases_measured(self, measured: bool) -> None:
        """Say whether the motion of every base is measured; the spectrum of the frame is learned from nothing else."""
        if self._frame is not None:
            self._frame.learns = measured

    def take_tilt(self) -> None:
        """Take over what was learned about the tilt of the brackets."""
        if self._frame is not None:
            self._frame.take_tilt()

    def frame_bias(self) -> list[float]:
        """Return the constant relative accelerations of the deformation of the frame, (3 M,), as a plain list; empty without."""
        return [] if self._frame is None else self._frame.bias

    def undeform(self, bias: list[float]) -> None:
        """Begin the deformation of the frame from rest, with the :meth:`frame_bias` of before a base sensor spoiled it."""
        if self._frame is not None:
            self._frame.undeform(bias)

    def renew_gains(self) -> None:
        """Let the next block have gains of its own: the deflections are suddenly known less well."""
        self._until = self._time

    def take_made_up(self, made_up: Array) -> None:
        """Take the variance of made-up motion of the bases over that of what a bracket moves on its own, shape (M, 3)."""
        self._made_up_now = made_up
        if np.any(made_up > _SUDDENLY * self._made_up_then):
            self.renew_gains()

    def reset(self) -> None:
        """Forget running statistics and what the elements remember."""
        count = self._count
        if self._frame is not None:
            self._frame.reset()
        self._elastic_square, self._elastic_now = np.zeros((count, 3)), np.zeros((count, 3))
        self._viscous_square = np.zeros((count, 3))
        self._dynamic_square = np.zeros((count, 3))
        self._ratio = np.ones(2)
        self._time = 0.0
        self.restart()

    def restart(self) -> None:
        """Begin a new time base: what integrates begins anew, sizes and spectra of what was seen stay."""
        self.law.reset()
        #: what the mount model does not explain of the force on the body in the last block, shape (K, 6) [N, N m]
        self.missing = np.zeros((0, 6))
        count = self._count
        if self._frame is not None:
            self._frame.restart()
        self._slow = np.zeros(6)
        self._until = self._time
        self._square, self._count_square = np.zeros(6), 0
        self._gain = np.zeros((3 * count, 6))
        self._gain_slow = np.zeros((3 * count, 6))
        self._innovation = np.zeros(6)
        self._std = np.zeros((3, count, 3))
        nothing = np.zeros((0, 0))
        #: wrench, gain, mass and what :meth:`shared` made of them last
        self._shared: tuple[Array, Array, float, Array] = (nothing, nothing, 0.0, nothing)
        self._weighed: tuple[float, Array, Array] = (0.0, nothing, nothing)
        #: stiffness, mass, CG and load the static forces are those of
        self._static_of: tuple[Array | None, float, Array, bool] = (None, 0.0, self.cg_offset, False)
        self._update_static()

    def _update_static(self) -> None:
        of, mass, offset, loaded = self._static_of
        same = mass == self.mass and loaded is self.loaded and np.array_equal(offset, self.cg_offset)
        if of is self.law.stiffness and same:
            return
        self._static_of = self.law.stiffness, self.mass, self.cg_offset, self.loaded
        weight = weight_at(self.geometry, np.zeros(3)) if self.loaded else self._weight()
        stiffness = np.maximum(self.law.stiffness, 0.0).ravel()
        total = float(stiffness.max()) if stiffness.size else 0.0
        self._stiffness = stiffness + 1e-9 * (total if total > 0.0 else 1.0)
        # where only some mounts are identified their ratio to the others is worse than that of the file
        ratio = self._stiffness if self._of_file is None else self._of_file
        share = share_by_stiffness(self._g, ratio)
        shared = static_share(self._g, ratio, weight[self._free])
        known = (self.geometry.mounts, self._g, shared, weight[self._free], self.parameter_std[0].ravel())
        self.static_force, self._static_left = static_split(*known)
        self._gain_slow = np.zeros((3 * self._count, 6))
        self._gain_slow[:, self._free] = share
        # a load strains the mounts along all axes; what deflections show of that, the slow residual takes back
        self._strain = (self._gain_slow @ (self._weight() - weight)).reshape(self._count, 3)
        self.static_force = self.static_force + self._strain

    def observe(
        self,
        deflection: DeflectionBlock,
        support: Array,
        measured: NDArray[np.bool_],
        load_covariance: Array,
        turn_rate: Array,
        dt: float,
    ) -> ForceBlock:
        """Estimate the forces at the ticks of a block.

        Parameters
        ----------
        deflection
            From the deflection estimator, cab axes.
        support
            Wrench the mounts together carry, shape (K, 6) [N, N m].
        measured
            Whether it is more than a guess, shape (K,).
        load_covariance
            Of the wrench for the given mass, shape (6, 6).
        turn_rate
            Rate of the rotation of the body against each bracket, shape (K, M, 3) [rad/s].
        dt
            Tick [s].
        """
        ticks, count = len(support), self._count
        value, rate = self._with_frame(deflection, turn_rate, dt)
        x, v = np.empty_like(value), np.empty_like(value)
        turned_motion(value, rate, deflection.turn, turn_rate, self.follow, self.known, x, v)
        tension = self.law.tension(x, v, dt)
        static_force = self.static_force
        if measured.all():
            self._watch(x, v, support, dt)
        if self._time >= self._until:
            self._update_gains(deflection, load_covariance)
        force, self.missing = np.empty_like(tension), np.empty((ticks, 6))
        balanced_forces(
            tension, deflection.turn, self.follow, static_force, support, measured, self.geometry.wrench, self._gain,
            self._gain_slow, 1.0 - math.exp(-_SLOW_CORNER * dt), self._slow, self._square, self.missing, force,
        )  # fmt: skip
        self._count_square += int(np.count_nonzero(measured))
        std, spread = np.repeat(self._std[:, None], ticks, axis=1), deflection.std
        if not self._all_known:
            x = np.where(self.known, x, -(force - self.static_force) / np.maximum(self._stiffness.reshape(count, 3), 1.0))
            spread = np.where(self.known, spread, np.sqrt(self._elastic_square))
        return ForceBlock(force, std[0], std[1], std[2], x, v, spread)

    def _with_frame(self, deflection: DeflectionBlock, turn_rate: Array, dt: float) -> tuple[Array, Array]:
        """Return deflection and rate with the deformation of the frame as its own filter knows it, cab axes (K, M, 3)."""
        if self._frame is None:
            return deflection.deflection, deflection.rate
        own = self._frame.observe(
            deflection.relative, deflection.turn, turn_rate, deflection.frame_turn, deflection.frame_turn_rate,
            self.law.stiffness, self.law.damping, dt,
        )  # fmt: skip
        value, rate = np.empty_like(own[0]), np.empty_like(own[1])
        with_deformation(deflection.deflection, self._frame.projector, own[0], self._transducer, value)
        with_deformation(deflection.rate, self._frame.projector, own[1], self._transducer, rate)
        return value, rate

    def _watch(self, x: Array, v: Array, support: Array, dt: float) -> None:
        ticks = len(support)
        self._time += ticks * dt
        forget = 1.0 - math.exp(-ticks * dt / min(_MEMORY, max(self._time, 1e-9)))
        follow_scaled(x, self.law.stiffness, forget, self._elastic_square)
        follow_scaled(x, self.law.stiffness, 1.0 - math.exp(-ticks * dt / min(_SHORT_MEMORY, self._time)), self._elastic_now)
        follow_scaled(v, self.law.damping, forget, self._viscous_square)
        follow_scaled(self.shared(support), self._ones, forget, self._dynamic_square)

    def _weight(self) -> Array:
        """Return the wrench that carries the body at rest and what it carries, shape (6,); all masses scale together."""
        mass, offset, found = self._weighed
        if mass != self.mass or offset is not self.cg_offset:
            found = self.mass / self.geometry.body.mass.value * weight_at(self.geometry, self.cg_offset)
            self._weighed = self.mass, self.cg_offset, found
        return found

    def shared(self, support: Array) -> Array:
        """Return the dynamic part of a wrench shared among the mounts by stiffness, shape (K, M, 3) [N]."""
        # asked for several times per block
        of, gain, mass, found = self._shared
        if of is not support or gain is not self._gain_slow or mass != self.mass:
            found = np.asarray(((support - self._weight()) @ self._gain_slow.T).reshape(len(support), self._count, 3))
            self._shared = support, self._gain_slow, self.mass, found
        return found

    def equilibrium(self, support: Array) -> Equilibrium | None:
        """Return what equilibrium says of the rigid deflections for the wrench the mounts carry, shape (K, 6).

        None where not every mount has a vertical deflection from sensors: what the others carry is not known there.
        """
        if not (bool(self.known[:, 2].all()) and len(self.missing)):
            return None
        stiffness = self._stiffness.reshape(self._count, 3)
        force = self._gain_slow @ mean_of_ticks(self.missing)
        missing = np.asarray(-(force / self._stiffness).reshape(self._count, 3))
        return Equilibrium(-self.shared(support) / stiffness, self.law.damping / stiffness, missing)

    def _judge(self) -> None:
        """Follow how large the residual of equilibrium is against its covariance, for horizontal and vertical axes.

        The observable directions of equilibrium show how good the integrated deflections are in the unobservable ones.
        """
        if self._count_square and np.any(self._innovation):
            square = self._square / self._count_square
            share = 1.0 - np.exp(-_INTERVAL / _CONSISTENCY_MEMORY)
            for group, rows in enumerate(_ROWS):
                used = [r for r in rows if self._innovation[r] > 0.0]
                if used:
                    ratio = float(np.mean(square[used] / self._innovation[used]))
                    self._ratio[group] += share * (ratio - self._ratio[group])
        self._square, self._count_square = np.zeros(6), 0

    @property
    def consistency(self) -> float:
        """Return the mean squared residual of equilibrium over what the mount model and the noise let expect."""
        return float(np.mean(self._ratio))

    def _update_gains(self, deflection: DeflectionBlock, load_covariance: Array) -> None:
        self._until = self._time + _INTERVAL
        self._made_up_then = self._made_up_now
        self._judge()
        self._update_static()
        count, k, c = self._count, self.law.stiffness, self.law.damping
        elastic = np.maximum(self._elastic_square, self._elastic_now)
        parameters = self.parameter_std[0] ** 2 * elastic + self.parameter_std[1] ** 2 * self._viscous_square
        parameters += self.misread_variance
        variance = (k * deflection.std) ** 2 + (c * deflection.rate_std) ** 2 + parameters
        hidden = (TWIST_SHARE**2) * self._dynamic_square + (0.02 * np.abs(self.static_force)) ** 2
        seen = np.where(self.known & ~self._made_up, variance, hidden).ravel()
        # without motion of the bases the error is that of a deflection, alike in size at all mounts: weight by stiffness
        floor = (_LEAST_DEFLECTION * self._stiffness) ** 2
        model = prior = np.diag(seen + floor)
        if not self.known.all():
            spread = float(np.mean(hidden)) / float(np.mean(self._stiffness))
            prior = np.diag(np.where(self.known.ravel(), np.diag(prior), self._stiffness * spread))
        elif self._frame is not None:
            if not self._frame.seen:
                parameters = parameters + float(self._made_up_now.max(initial=0.0)) * hidden
            prior = self._covariance(deflection, self._frame, parameters) + np.diag(floor)
            # errs with the wrench, of the same rate: stated, but equilibrium must not be satisfied by it
            stiff = k.ravel()
            model = prior + stiff[:, None] * self._strain_covariance(deflection, self._frame) * stiff
        g = self._g
        load = load_covariance[np.ix_(self._free, self._free)]
        inverse = np.linalg.inv(g @ prior @ g.T + load)
        gain = prior @ g.T @ inverse
        self._gain = np.zeros((3 * count, 6))
        self._gain[:, self._free] = gain
        self._innovation = np.zeros(6)
        self._innovation[self._free] = np.einsum("ij,j,ij->i", g, seen, g) + np.diag(load_covariance)[self._free]
        rest = np.eye(3 * count) - gain @ g
        left = np.einsum("ij,jk,ik->i", rest, model, rest) + self._static_variance()
        # what is slower than any deflection is shared by a stiffness that is not known exactly
        slow = self.parameter_std[0].ravel() * (self._gain_slow @ self._slow)
        left += (np.eye(3 * count) - self._gain_slow[:, self._free] @ g) ** 2 @ slow**2
        if self.even_odds:
            left += self._strain.ravel() ** 2
        determined = np.einsum("ij,jk,ik->i", gain, load, gain)
        constant = self.constant_load + self._placed_load()
        determined = determined + np.einsum("ij,jk,ik->i", self._gain_slow, constant, self._gain_slow)
        determined = determined + self.mass_relative_std**2 * (self.static_force**2 + self._dynamic_square).ravel()
        self._std = np.sqrt(np.stack([left + determined, determined, left])).reshape(3, count, 3)

    def _placed_load(self) -> Array:
        """Return the covariance of the moments of a load that may lie anywhere between the mounts, as wrench (6, 6).

        At rest no accelerometer shows where it lies. Places are rectangular (GUM 4.3.7): the span over the root of twelve.
        """
        span = np.ptp(self.geometry.arms[:, :2], axis=0) if self._count else np.zeros(2)
        weight = self.load_share * self.mass * self.geometry.vehicle.gravity
        return np.asarray(np.diag([0.0, 0.0, 0.0, *(weight**2 * span[::-1] ** 2 / 12.0), 0.0]))

    def _static_variance(self) -> Array:
        """Return the variance of the static forces that equilibrium leaves, shape (3 M,)."""
        return np.asarray(np.diag(self._static_left))

    def _covariance(self, deflection: DeflectionBlock, frame: FrameDeformation, parameters: Array) -> Array:
        """Return the covariance of the constitutive forces: rigid motion, deformation of the frame, parameters."""
        k, c = self.law.stiffness.ravel(), self.law.damping.ravel()
        rigid = np.eye(len(k)) - frame.projector
        spread, rate_spread = deflection.std.ravel() ** 2, deflection.rate_std.ravel() ** 2
        value, rate = frame.covariance()
        value = value + (rigid * spread) @ rigid.T
        rate = rate + (rigid * rate_spread) @ rigid.T
        if frame.seen and self._made_up_now.any():
            own, own_rate = frame.made_up_covariance(self._made_up_now)
            value, rate = value + own, rate + own_rate
        for total, measured in ((value, spread), (rate, rate_spread)):
            total[self._transducer] = 0.0
            total[:, self._transducer] = 0.0
            total[self._transducer, self._transducer] = measured[self._transducer]
        return np.asarray(k[:, None] * value * k + c[:, None] * rate * c + np.diag(parameters.ravel()))

    def _strain_covariance(self, deflection: DeflectionBlock, frame: FrameDeformation) -> Array:
        """Return the covariance of deflections that an uncertain rotation is wrongly taken to strain the mounts by, (3 M, 3 M).

        A finite rotation theta strains them by ``theta x (theta x r) / 2``, and the filter of the deformation takes what an error
        of the rate omega leaves of ``omega x (omega x r)``, as slow as a bend, for one.
        """
        arms, maps = self.geometry.arms, self._tilting.maps
        turned = maps.mean(axis=0) ** 2 @ deflection.std.ravel() ** 2
        rate, rate_variance = self.turning
        theta = deflection.turn[-1].mean(axis=0)
        second_order = 0.5 * frame.projector @ double_cross_gradient(theta, arms)
        thrown = np.sqrt(np.tile(frame.static_gain, self._count))[:, None] * (frame.projector @ double_cross_gradient(rate, arms))
        return np.asarray((second_order * turned) @ second_order.T + (thrown * rate_variance) @ thrown.T)

    def save(self) -> dict[str, Any]:
        """Return the state as plain lists."""
        frame = self._frame.save() if self._frame is not None else None
        return {**fields_of(self, _SAVED), "law_states": self.law.states.tolist(), "frame": frame}

    def load(self, saved: dict[str, Any]) -> None:
        """Continue from :meth:`save`."""
        if self._frame is not None and saved.get("frame") is not None:
            self._frame.load(saved["frame"])
        self._static_of = None, 0.0, self.cg_offset, self.loaded
        take_fields(self, _SAVED, saved)
        self.law.states = np.array(saved["law_states"], dtype=float).reshape(self.law.states.shape)
