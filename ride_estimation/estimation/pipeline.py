# Copyright 2026 ride_estimation contributors
"""From samples to motion, loads, parameters and attachment forces: what the node and ``replay`` both call.

``observe`` takes one sample of one sensor and returns the blocks of ticks that became complete. Everything is a pure function of
the sequence of calls: no clock, no thread, no randomness; a live run and its recording give the same bytes.
"""

from __future__ import annotations

import dataclasses
import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.estimation.common.block_math import mean_of_ticks
from ride_estimation.estimation.common.channel_layout import ChannelLayout
from ride_estimation.estimation.common.estimate import Estimate
from ride_estimation.estimation.common.geometry import geometry_of
from ride_estimation.estimation.common.saved_state import STATE_SCHEMA, all_finite, check_state
from ride_estimation.estimation.common.settings import PipelineSettings
from ride_estimation.estimation.faults.checkpoints import Checkpoints
from ride_estimation.estimation.faults.health import Health, base_messages, rate_message, residual_message, sensor_messages
from ride_estimation.estimation.faults.hint_spectra import SpectrumHints
from ride_estimation.estimation.faults.hints import Hint, sensor_hint
from ride_estimation.estimation.faults.input_checks import InputChecks
from ride_estimation.estimation.faults.late_sensors import LateSensors
from ride_estimation.estimation.faults.sensor_gate import GateVerdict
from ride_estimation.estimation.forces.base_fill import BaseFill
from ride_estimation.estimation.forces.carried_bodies import CarriedBodies
from ride_estimation.estimation.forces.force_kernel import follow_scaled
from ride_estimation.estimation.forces.mount_forces import MountForceEstimator
from ride_estimation.estimation.forces.mount_law import MountLaw
from ride_estimation.estimation.kinematics.bracket_tilt import BracketTilt
from ride_estimation.estimation.kinematics.deflection import DeflectionBlock, DeflectionEstimator
from ride_estimation.estimation.model.load import LoadEvidence, of_delivery
from ride_estimation.estimation.motion.cg_motion import CgMotionEstimator
from ride_estimation.estimation.motion.loads import InertialLoads
from ride_estimation.estimation.motion.motion_block import MotionBlock
from ride_estimation.estimation.motion.motion_kernel import force_at
from ride_estimation.estimation.numerical_guard import NUMERICAL_FAULT, NumericalGuard, fault_messages
from ride_estimation.estimation.output import OutputBlock
from ride_estimation.estimation.parameters.body_lean import BodyLean, Leaning
from ride_estimation.estimation.parameters.force_balance import BalanceInput
from ride_estimation.estimation.parameters.identifiable import describe
from ride_estimation.estimation.parameters.mass_reference import MassReference
from ride_estimation.estimation.parameters.parameter_estimator import ParameterEstimator
from ride_estimation.estimation.parameters.static_travel import Load, StaticTravel
from ride_estimation.frames import AXES
from ride_estimation.sensors.streams import stream_specs
from ride_estimation.signals.alignment import Block, StampAligner
from ride_estimation.signals.batch_feed import BatchFeed
from ride_estimation.signals.recording import Recording
from ride_estimation.vehicles.assembly import assemble
from ride_estimation.vehicles.data_range import DataRange, RangeMeter
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]

#: time in which the excess covariance of the motion fades [s]
_EXCESS_FADES = 1.0
#: disagreement of the body sensors, in units of their tolerance, from which on nothing learned is called valid
_CONTRADICTION = 4.0
#: time between two evaluations of how much they disagree [s]
_DISAGREEMENT_PERIOD = 0.5


class Pipeline:
    """The online estimator of one vehicle.

    Parameters
    ----------
    vehicle
        From the vehicle file.
    settings
        See :class:`PipelineSettings`.

    Raises
    ------
    ConfigurationError
        No accelerometer on any body, settings out of range.
    """

    def __init__(self, vehicle: Vehicle, settings: PipelineSettings | None = None) -> None:
        self.vehicle = vehicle
        self.settings = settings or PipelineSettings()
        self._late = LateSensors(vehicle.with_noise_scaled(self.settings.noise_scale))
        #: a delay was found: its readings begin anew with the first block that the aligner makes of them
        self._delayed = False
        self.geometry = geometry_of(self._late.vehicle())
        a = self.geometry
        self._motion = self._new_motion()
        self._loads = InertialLoads.of(a.body)
        self._carried = CarriedBodies(a, self.settings)
        self._tilting = BracketTilt(a)
        self._deflection = DeflectionEstimator(a, self._tilting)
        self._fill = BaseFill(a)
        self._law = MountLaw(a)
        self._forces = MountForceEstimator(a, self._law, self._deflection.known, self._tilting)
        self._parameters = ParameterEstimator(a, self._tilting, self.settings)
        self._mass_reference = MassReference(a, self._parameters.free_parameters)
        self._travel = StaticTravel(a)
        #: what static travel says of a load that the file does not know
        self._load: Load | None = None
        self._lean = BodyLean(a)
        #: how the body leans where neither its sensors nor a load that was found explain it
        self._leaning: Leaning | None = None
        self._factor = 1.0
        assembly = assemble(vehicle)
        preload = dict(zip(assembly.components, np.round(assembly.static_tension, 3).tolist(), strict=True))
        self._ports = tuple((name, axis) for name in a.mount_names for axis in AXES)
        self._shown = RangeMeter(*(preload.get(port) for port in self._ports))
        cells = [vehicle.sensors[name] for name, _ in self._mass_reference.cells]
        meter = a.speed_sensor
        used = [*a.body_sensors, *(s for s in a.base_sensors if s is not None), *a.transducers, *cells]
        used += [] if meter is None else [meter]
        self._sensors = tuple({s.name: s for s in used}.values())
        self._aligner = self._new_aligner()
        self._index = {s.name: i for i, s in enumerate(self._sensors)}
        self._layout = ChannelLayout.of(a, self._sensors, self._aligner.columns, self._mass_reference.cells)
        self._checks = InputChecks(a, self._sensors, self._layout, self._aligner.columns, self._motion)
        self._force = np.array([0.0, 0.0, vehicle.gravity])
        self._excess, self._rate = 1.0, np.zeros(3)
        self._agree()
        self._checkpoints = Checkpoints()
        self._unknown, self._restarts = Counter[str](), Counter[str]()
        self._ticks = self._invalid_ticks = 0
        self._dt, self._stamp = 0.0, 0
        self._run_time = self._next_reference = 0.0
        self._due: Callable[[], bool] | None = None
        self._guard = NumericalGuard(a)
        self._apply()
        self._hints = SpectrumHints(a)
        self._begin = self._learned()

    def _new_motion(self) -> CgMotionEstimator:
        a = self.geometry
        made = CgMotionEstimator(a.body_sensors, a.body.cg, a.free, self.vehicle.gravity, self.settings)
        made.speed_std = 0.0 if a.speed_sensor is None else a.speed_sensor.noise_std
        return made

    def _new_aligner(self) -> StampAligner:
        specs, chosen = stream_specs(self._sensors), self.settings
        return StampAligner(specs, chosen.rate_hz, block_ticks=chosen.block_ticks, latency_budget_s=chosen.latency_budget)

    def hints(self) -> tuple[Hint, ...]:
        """Return what the model or a sensor is suspected of, see :mod:`hints`."""
        self._settle()
        fault = self._motion.residual_test().fault
        return (*self._late.hints(), *(() if fault is None else (sensor_hint(fault),)), *self._hints.hints())

    # -- input ------------------------------------------------------------------------------------------------------------

    def observe(
        self, sensor_name: str, stamp_ns: int, values: Sequence[float], variance: Sequence[float] | None = None
    ) -> tuple[OutputBlock, ...]:
        """Take one sample and return the blocks that became complete.

        Parameters
        ----------
        sensor_name
            Name in the vehicle file; samples of sensors the estimator does not use are counted and passed over.
        stamp_ns
            Header stamp [ns].
        values
            SI, sensor axes, as many as the sensor has channels.
        variance
            What the message states of each value, None where it states nothing.
        """
        index = self._index.get(sensor_name)
        if index is None:
            self._unknown[sensor_name] += 1
            return ()
        if self._due is not None:
            self._settle()
        blocks = self._aligner.push(index, stamp_ns, values, variance)
        return tuple(self._guarded(b) for b in blocks) if blocks else ()

    def replay(self, recording: Recording) -> Iterator[tuple[tuple[OutputBlock, ...], int]]:
        """Take a whole recording in order of arrival: the same as :meth:`observe` for every sample, several at a time.

        Yields
        ------
        tuple
            Blocks that became complete, and the number of samples taken for them.
        """
        for name, channel in recording.channels.items():
            if name not in self._index:
                self._unknown[name] += len(channel.stamp_ns)
        feed = BatchFeed(self._aligner, [recording.channels.get(s.name) for s in self._sensors])
        while feed.more:
            self._settle()
            blocks, taken = feed.step()
            yield tuple(self._guarded(b) for b in blocks), taken

    def finish(self) -> tuple[OutputBlock, ...]:
        """Return what is left at the end of a run."""
        return tuple(self._guarded(b) for b in self._aligner.finish())

    def reset(self, reason: str) -> None:
        """Forget motion and learned parameters and begin again from the vehicle file."""
        self._due = None
        self._tilting.reset()
        self._forces.take_tilt()
        self._parameters = ParameterEstimator(self.geometry, self._tilting, self.settings)
        self._mass_reference = MassReference(self.geometry, self._parameters.free_parameters)
        self._checkpoints.clear()
        self._apply()
        self._forget_sizes()
        self._restart(reason)
        self._aligner = self._new_aligner()
        self._put_back()

    def recover(self, error: Exception) -> None:
        """Count arithmetic that failed before the estimators and begin again from the vehicle file."""
        self._guard.count(f"{type(error).__name__}: {error}")
        self.reset(NUMERICAL_FAULT)

    def _forget_sizes(self) -> None:
        """Forget how large deflections and forces are and the spectrum of the frame: they may be those of other sensors."""
        for part in (self._deflection, self._forces, self._fill):
            part.reset()

    def _restart(self, reason: str) -> None:
        """Begin a new time base: motion and integrators start again; parameters, sizes and spectra stay."""
        self._restarts[reason] += 1
        self._motion.reset()
        self._carried.reset()
        self._tilting.restart()
        self._deflection.restart()
        self._forces.restart()
        self._parameters.restart()
        self._travel.reset()
        self._lean.reset()
        self._shown.restart()
        self._fill.restart()
        self._hints.reset()
        self._checks.reset(same_time=reason == NUMERICAL_FAULT)
        self._excess = 1.0

    def _guarded(self, block: Block) -> OutputBlock:
        """Return the estimates of a block; arithmetic that fails or a load that cannot be ends in a restart, never in numbers."""
        found = self._guard.attempt(lambda: self._process(block))
        if found is None or not self._guard.accept(found, block.step_ns * 1e-9):
            self._begin_from_checkpoint()
            return self._guard.nothing(block, dict(self._layout.own_columns))
        return found

    def _begin_from_checkpoint(self) -> None:
        """Begin anew after a numerical fault, with what was learned before it."""
        learned, self._due = self._checkpoints.checkpoint() or self._begin, None
        self._new_body()
        self._agree()
        self._forget_sizes()
        self._restart(NUMERICAL_FAULT)
        self._go_back_to(learned)

    def _agree(self) -> None:
        """Begin with sensors of the body that agree; from what a bias adds to the covariance of the motion nothing is learned."""
        self._disagreement, self._next_disagreement = (1.0, np.zeros((6, 6)), np.zeros((6, 6))), 0.0
        self._constant = np.zeros((6, 6))

    def _new_body(self) -> None:
        """Begin the motion of the body without anything learned of its sensors; gyros that were left out stay so."""
        self._motion, self._next_disagreement = self._new_motion(), 0.0
        self._motion.leave_out_gyros(self._checks.gyros.found)

    # -- one block --------------------------------------------------------------------------------------------------------

    def _process(self, block: Block) -> OutputBlock:
        self._settle()
        if self._delayed and not self._aligner.waits_to_delay:
            self._delayed = False
            self._take_installation()
            self._begin_anew("a delay was found")
        if block.restart and self._ticks:
            self._restart(block.restart)
        dt = self._dt = block.step_ns * 1e-9
        ticks, layout, heard = len(block.values), self._layout, block.valid
        block, verdict = self._checked(block, dt)
        silenced = () if block.valid is heard else np.flatnonzero(np.any(heard & ~block.valid, axis=0)).tolist()
        measured = np.take(block.values, layout.body_columns, axis=1)
        gyro = np.take(block.values, layout.gyro_columns, axis=1)
        there = np.take(block.valid, layout.body_streams, axis=1)
        if silenced:
            self._fill.refused([i for i, stream, _, _ in layout.base if stream in silenced])
        self._motion.inconsistent = bool(verdict.suspects)
        motion = self._widened(self._motion.observe(measured, gyro, there, dt, layout.speed_of(block)), verdict, ticks * dt)
        self._rate, self._force = motion.rate[-1], mean_of_ticks(motion.motion[:, :3])
        accel, accel_covariance = self._motion.accelerate(motion)
        support = self._loads.load(motion.motion, motion.rate)
        support = self._carried.added_to(support, motion.motion, motion.rate, self._factor, dt)
        deflection = self._observe_deflection(block, motion, support, dt)
        turn_rate, covariance = self._deflection.turn_rate(deflection), self._load_covariance(motion)
        forces = self._forces.observe(deflection, support, motion.valid, covariance, turn_rate, dt)
        forces = self._fill.widen_forces(forces, ticks * dt)
        lost, whole = ticks - int(np.count_nonzero(motion.valid)), bool(block.valid.all())
        if not lost:
            for name, i, cell in layout.cell_readings(block, self._sensors):
                self._mass_reference.observe_cell(name, cell, forces.force[:, i] / self._factor, ticks * dt)
        complete = (whole or bool(block.valid[:, layout.needed].all())) and not (lost or verdict.suspects or verdict.unusual)
        before, predicted, usable = self._stamp, motion.predicted, complete and (whole or bool(there.all()))
        missing = self._forces.missing
        # parameters are learned with the CG of the file as long as nothing but a lean speaks against it
        learned = support if self._leaning is None else support + self._unmoved(motion)

        def learn() -> bool:
            self._learn(motion, deflection, turn_rate, learned, complete, before, dt)
            if usable:
                self._hints.observe(support, missing, dt)
            else:
                self._hints.interrupt()
            if self._checks.weighs:
                shared = self._forces.shared(support)[:, :, :2] / self._factor
                body = force_at(motion.motion, motion.rate, self.geometry.arms)[:, :, 2]
                self._checks.weigh(support / self._factor, shared, body)
            self._checks.learn(dt)
            return True

        self._due = learn
        self._ticks, self._invalid_ticks = self._ticks + ticks, self._invalid_ticks + lost
        self._stamp = int(block.start_ns + (ticks - 1) * block.step_ns)
        anomalies = not complete, self._loaded
        read = [{name: part[:, own] for name, own in layout.own_columns} for part in (measured, predicted)]
        found = motion, (accel, accel_covariance), support, self._loads, forces
        return OutputBlock.of(block.stamps_ns, *found, read, anomalies, tuple(self._sensors[i].name for i in silenced))

    def _checked(self, block: Block, dt: float) -> tuple[Block, GateVerdict]:
        """Return the block with every sensor in its place and what may be used of it; what faulty sensors taught is forgotten."""
        block, exchanged = self._checks.put_right(block, dt)
        if exchanged:
            self._new_body()
            self._begin_anew(exchanged)
        gyros = self._checks.contradicted_gyros(block, self._motion, dt)
        if gyros:
            self._motion.leave_out_gyros(gyros)
            self._begin_anew("a gyro was left out")
        self._checks.watch.observe(block, dt, self._aligner.variance, self._motion.set_variance)
        verdict = self._checks.judged(block, self._rate, self._force, dt)
        if verdict.began:
            self._take_back(verdict)
        return block if verdict.valid is block.valid else dataclasses.replace(block, valid=verdict.valid), verdict

    def _take_installation(self) -> None:
        """Judge the sensors by what is known of their installation now; what was said of them rested on late readings."""
        self.geometry = geometry_of(self._late.vehicle())
        gyros = self._checks.gyros.found
        self._motion = self._new_motion()
        self._checks.take_installation(self.geometry)
        self._motion.leave_out_gyros(gyros)
        self._agree()

    def _find_delay(self) -> None:
        """Have the aligner put back the readings of a sensor that is found to be late."""
        if self._delayed:
            return
        tests = [self._motion.fault_test, *self._checks.fault_tests]
        self._delayed = self._late.find(tests)
        if self._delayed or self._late.refine(tests):
            self._put_back()

    def _put_back(self) -> None:
        """Have the aligner take the delays that were found off the stamps to come."""
        for name, delay in self._late.delays().items():
            self._aligner.delay(self._index[name], delay)

    def _load_covariance(self, motion: MotionBlock) -> Array:
        """Return the covariance (6, 6) of the wrench that equilibrium is judged by; what is constant of it goes to the forces."""
        # an error of the mass scales all forces alike and is no evidence against equilibrium
        whole = self._loads_for_mass.covariance(motion.covariance, motion.motion[-1])
        own = whole
        if self._constant.any():
            moving = motion.covariance - self._constant
            own = self._loads_for_mass.covariance(moving, motion.motion[-1])
        still, moving = self._loads.covariance_of_cg(motion.motion[-1], self.vehicle.gravity)
        self._forces.constant_load, self._forces.turning = whole - own + still, (motion.rate[-1], motion.rate_variance)
        return np.asarray(own + moving + self._factor**2 * self._carried.covariance)

    def _widened(self, motion: MotionBlock, verdict: GateVerdict, duration: float) -> MotionBlock:
        """Widen the covariance of the motion while the sensors of the body contradict each other."""
        if self._run_time >= self._next_disagreement:
            self._next_disagreement = self._run_time + _DISAGREEMENT_PERIOD
            self._disagreement = self._motion.disagreement(self._dt)
        lasting, added, self._constant = self._disagreement
        excess = max(verdict.excess, lasting, 1.0 + (self._excess - 1.0) * math.exp(-duration / _EXCESS_FADES))
        self._excess = excess if excess >= 1.01 else 1.0
        if self._excess == 1.0 and not self._constant.any():
            return motion
        return dataclasses.replace(motion, covariance=motion.covariance * self._excess**2 + added + self._constant)

    def _learned(self) -> dict[str, Any]:
        return {"parameters": self._parameters.snapshot(), "anchor": self._mass_reference.save(), "tilt": self._tilting.save()}

    def _integrated(self) -> dict[str, Any]:
        return {"deflection": self._deflection.save(), "frame": self._forces.frame_bias()}

    def _go_back_to(self, learned: dict[str, Any]) -> None:
        """Return to what was learned at another time; filters of the signals begin anew."""
        self._parameters.load(learned["parameters"])
        self._mass_reference.load(learned["anchor"])
        self._tilting.load(learned["tilt"])
        self._tilting.restart()
        self._forces.take_tilt()
        self._apply()

    def _forget(self) -> None:
        """Forget what was learned in this run."""
        self._checkpoints.clear()
        self._go_back_to(self._begin)

    def _begin_anew(self, reason: str) -> None:
        """Begin a new time base without what was learned in this run."""
        self._forget_sizes()
        self._restart(reason)
        self._forget()

    def _take_back(self, verdict: GateVerdict) -> None:
        """Return to what was learned before a sensor became faulty; deflections it spoiled start again from rest."""
        spoiled = bases = [i for i, stream, _, _ in self._layout.base if stream in verdict.newly_refused]
        if any(stream in verdict.newly_refused for stream in self._layout.body_streams):
            spoiled = list(range(len(self.geometry.mounts)))
        copies = self._checkpoints.take(self._run_time, verdict.spoiled)
        if copies is not None and spoiled:
            self._deflection.restart_mounts(spoiled, copies[1]["deflection"])
        if bases:
            self._forces.undeform([] if copies is None else copies[1]["frame"])
            self._fill.spoil()
        self._parameters.restart()
        if copies is not None:
            self._go_back_to(copies[0])
        elif verdict.spoiled:
            self._deflection.reset()
            self._forget()

    def _unmoved(self, motion: MotionBlock) -> Array:
        """Return by how much less the mounts carry without the CG that a lean lets expect, shape (K, 6)."""
        own = dataclasses.replace(self._loads, cg_offset=self._parameters.cg_offset()[0])
        return own.load(motion.motion, motion.rate) - self._loads.load(motion.motion, motion.rate)

    def _observe_deflection(self, block: Block, motion: MotionBlock, support: Array, dt: float) -> DeflectionBlock:
        ticks, count = len(block.values), len(self.geometry.mounts)
        base, base_ok = self._layout.bases(block, count)
        spoke, measured = np.asarray(base_ok.all(axis=1)), base_ok & motion.valid[:, None]
        self._forces.bases_measured(bool(measured.all()))
        base, base_ok = self._fill.fill(base, base_ok, ticks * dt)
        self._parameters.errors.constant = self._deflection.constant
        self._deflection.forget_bias(self._fill.returned)
        if self._checks.bases_inconsistent:
            self._fill.suspect()
        if self._tilting.learns:
            body = force_at(motion.motion, motion.rate, self.geometry.arms)
            if self._tilting.observe(base, body, measured, dt):
                self._forces.take_tilt()
        expected, rest = np.zeros((count, 3)), self._forces.equilibrium(support)
        follow_scaled(self._forces.shared(support), 1.0 / np.maximum(self._law.stiffness, 1.0), 1.0, expected)
        found = self._deflection.observe(motion, base, base_ok, spoke, *self._layout.travels(block, count), expected, dt, rest)
        if self._deflection.began_anew:
            self._restarts["forces on the body contradicted the deflections"] += 1
            self._forces.renew_gains()
            self._parameters.restart()
        found = self._fill.widen(found, ticks * dt)
        self._forces.take_made_up(self._fill.made_up)
        return found

    def _settle(self) -> None:
        """Learn from the last block; put off until the next call so that the block's forces are handed out first."""
        if self._due is not None:
            due, self._due = self._due, None
            if self._guard.attempt(due) is None:
                self._begin_from_checkpoint()

    def _learn(
        self, motion: MotionBlock, deflection: DeflectionBlock, turn_rate: Array, support: Array, complete: bool, stamp_ns: int,
        dt: float,
    ) -> None:  # fmt: skip
        data = BalanceInput(
            support / self._factor, deflection.relative, deflection.deflection, deflection.rate, deflection.turn,
            turn_rate, self._forces.shared(support) / self._factor, deflection.frame_turn, deflection.base,
        )  # fmt: skip
        self._run_time += len(support) * dt
        p = self._parameters
        if self._constant.any():
            motion = dataclasses.replace(motion, covariance=motion.covariance - self._constant)
        moved = p.observe(data, motion, complete, stamp_ns, dt)
        self._checks.follow_changes(p.changes)
        if complete:
            self._shown.observe(deflection.deflection.reshape(len(support), -1), dt)
            ground = mean_of_ticks(deflection.base.reshape(len(support), -1)).reshape(-1, 3)
            self._lean.observe(ground, mean_of_ticks(motion.motion[:, :3]), len(support) * dt)
            self._travel.observe(self._forces.missing / self._factor, deflection.rate[:, :, 2], len(support) * dt)
        if moved or self._run_time >= self._next_reference:
            self._next_reference = self._run_time + 1.0
            self._find_delay()
            self._find_load()
            self._mass_reference.update(
                p.theta[: p.count], p.std[: p.count], self._forces.static_force / self._factor, self._run_time, p.excited_time
            )
            self._apply()
        self._checkpoints.keep(self._run_time, self._learned, self._integrated)

    def _find_load(self) -> None:
        """Ask static travel and the place of the CG whether the body carries something that its file does not know."""
        p, reference = self._parameters, self._mass_reference
        if self._travel.decided:
            self._load = self._travel.found()
            reference.take_static_travel(self._load)
        off = p.offset_of_cg()
        there = off is not None and not self._travel.excludes(self.geometry.least_load_share(off))
        if self._load is not None:
            p.take_load(True)
        elif there is not p.loaded:
            # a sensor that contradicts the others moves the CG too
            p.take_load(there and self._motion.residual_test().passed)
        found = self._loaded
        # a faulty sensor of the body leans it too
        faulty = self._motion.contradicting(_CONTRADICTION**2)
        self._leaning = None if found or faulty else self._lean.found(self._law.stiffness, p.errors.lean.common_std)
        reference.leaning = self._leaning
        reference.moved_cg = self._cg_offset() if found else None
        reference.possible_load = self._possible_load() if (p.loaded or self._leaning) and self._load is None else (0.0, 0.0)

    @property
    def _loaded(self) -> bool:
        """Whether the body carries a load that its file does not know."""
        return self._parameters.loaded or self._load is not None

    def _possible_load(self) -> tuple[float, float]:
        """Return share and standard deviation of a load that moves the CG to where it is, where travel does not decide."""
        p, offset = self._parameters, self._leaning.offset if self._leaning else self._parameters.seen_offset
        if not offset[:2].any():
            return 0.0, 0.0
        springs = [n for n, s in enumerate(p.free_parameters) if s.role == 0 and s.axis == 2]
        known = np.hypot(p.std[springs], [p.free_parameters[n].std for n in springs])
        ratio = self._travel.ratio() if self._travel.decided else (1.0, math.inf)
        least, stiffness = self.geometry.least_load_share(offset), of_delivery(p.theta[springs], known)
        found = LoadEvidence.of_accelerations(offset, least, stiffness, ratio).load(leans=False)[0]
        return found.share, found.std

    def _cg_offset(self) -> tuple[Array, Array]:
        """Return the offset of the CG from its place in the file and its standard deviation, shape (3,) each [m].

        Static travel determines it along x and y without the model of anything that moves.
        """
        offset, std = self._parameters.cg_offset()
        if self._load is not None:
            offset[:2], std[:2] = self._load.offset[:2], self._load.offset_std[:2]
        elif self._leaning is not None:
            # at even odds it is a load
            offset = offset + 0.5 * self._leaning.offset
            std = np.sqrt(std**2 + 0.25 * self._leaning.offset**2 + 0.5 * self._leaning.std**2)
        return offset, std

    def _apply(self) -> None:
        """Let mass and parameters reach loads and forces."""
        self._factor, relative = self._mass_reference.factor()
        body = self.geometry.body
        inertia, inertia_std = self._parameters.inertia()
        cg_offset, cg_std = self._cg_offset()
        self._loads = InertialLoads(
            body.mass.value * self._factor, body.mass.value * self._factor * relative, inertia * self._factor, inertia_std,
            cg_std, cg_offset,
        )  # fmt: skip
        self._loads_for_mass = dataclasses.replace(self._loads, mass_std=0.0)
        self._law.scale(self._parameters.multipliers() * self._factor)
        a, self._forces.mass = self.geometry, self._loads.mass
        self._forces.mass_relative_std = math.hypot(relative, a.carried_mass_std / a.file_mass)
        self._forces.cg_offset, self._forces.loaded = cg_offset, self._loaded or self._leaning is not None
        self._forces.even_odds = self._leaning is not None
        self._forces.follow, self._forces.load_share = self._parameters.follow, self._mass_reference.load_std
        self._forces.parameter_std = self._parameters.stds()
        self._forces.misread_variance = self._factor**2 * self._parameters.misread_variance

    # -- results ----------------------------------------------------------------------------------------------------------

    @property
    def loads(self) -> InertialLoads:
        """Return what makes loads of motion now: mass and inertia as they are estimated."""
        return self._loads

    def parameters(self) -> tuple[Estimate, ...]:
        """Return the mass and every stiffness and damping with standard deviation, status and reason."""
        self._settle()
        sensor = self._motion.contradicting(_CONTRADICTION**2)
        suspicion = f"the sensors of the body contradict each other ({sensor} most)" if sensor else self._checks.suspicion
        suspicion = suspicion or self._mass_reference.load_suspicion
        return (self._mass_reference.mass(self._stamp), *self._mass_reference.absolute(self._parameters.estimates(), suspicion))

    def amplitude_std(self) -> dict[str, float]:
        """Return by name what dependence on the amplitude adds to the standard deviation of the logarithm of a parameter."""
        return self._parameters.amplitude_std()

    def seen(self) -> dict[tuple[str, str], DataRange | None]:
        """Return the motion and preload that the data showed of every mount axis since the start, None where none yet."""
        return dict(zip(self._ports, self._shown.ranges(), strict=True))

    def identifiability(self) -> dict[str, Any]:
        """Return what the data make identifiable and what not, in words."""
        self._settle()
        p = self._parameters
        return describe(self.geometry, self.parameters(), self._mass_reference.has_reference, p.null_directions(), p.notes())

    def health(self) -> Health:
        """Return counts, statistics and sentences about the input and the estimates."""
        self._settle()
        test = self._motion.residual_test()
        ratio = {
            s.name: float(np.max(test.channel_ratio[3 * i : 3 * i + 3])) for i, s in enumerate(self.geometry.body_sensors)
        }
        sensors = self._checks.health(self._aligner.health(), ratio)
        messages = fault_messages(self._guard.faults) + self._late.messages() + self._checks.messages()
        messages += [m for m in (residual_message(test), rate_message(self._sensors, sensors)) if m]
        messages += sensor_messages(list(sensors.values()), self._ticks) + base_messages(self.geometry)
        messages += [*self.geometry.ignored, *self._parameters.notes(), *self._mass_reference.notes(), *self._tilting.notes()]
        if self._checkpoints.taken:
            messages.append(f"{self._checkpoints.taken} times updates of the last seconds were rolled back for a faulty sensor")
        messages += [f"{n} samples of {name}, which the estimator does not use" for name, n in sorted(self._unknown.items())]
        return Health(
            sensors, dict(self._restarts), dict(self._unknown), self._ticks, self._invalid_ticks, test, self._forces.consistency,
            self._parameters.innovation_ratio, self._parameters.excited, self._parameters.at_bound(), tuple(messages),
            dict(self._guard.faults), self._guard.faulty,
        )  # fmt: skip

    # -- persistence ------------------------------------------------------------------------------------------------------

    def save_state(self) -> dict[str, Any]:
        """Return the state as a mapping that JSON can hold; one that is not finite is that of the last checkpoint instead."""
        self._settle()
        if not all_finite(state := self._state()):
            self._guard.count("the state is not finite")
            self._begin_from_checkpoint()
            state = self._state()
        return state

    def _state(self) -> dict[str, Any]:
        return {
            "schema": STATE_SCHEMA, "vehicle": self.vehicle.checksum, "sensors": [s.name for s in self._sensors],
            "mounts": list(self.geometry.mount_names), "settings": dataclasses.asdict(self.settings),
            "motion": self._motion.save(), "deflection": self._deflection.save(), "forces": self._forces.save(),
            "parameters": self._parameters.save(), "anchor": self._mass_reference.save(), "run_time": self._run_time,
            "travel": self._travel.save(), "lean": self._lean.save(), "tilt": self._tilting.save(),
            "carried": self._carried.save(), "delays": self._late.save(), **self._checks.save(),
        }  # fmt: skip

    def load_state(self, state: dict[str, Any]) -> None:
        """Continue from :meth:`save_state`.

        Raises
        ------
        InputDataError
            A state of another vehicle file or of another version.
        """
        check_state(state, self._sensors, self.geometry.mount_names)
        self._due = None
        self._late.load(state["delays"])
        self._put_back()
        self._take_installation()
        self._checks.load(state)
        self._motion.leave_out_gyros(self._checks.gyros.found)
        self._motion.load(state["motion"])
        self._tilting.load(state["tilt"])
        if "carried" in state:
            self._carried.load(state["carried"])
        self._forces.take_tilt()
        self._deflection.load(state["deflection"])
        self._parameters.load(state["parameters"])
        self._mass_reference.load(state["anchor"])
        self._travel.load(state["travel"])
        self._lean.load(state["lean"])
        self._run_time = float(state["run_time"])
        self._apply()
        self._forces.load(state["forces"])
        self._begin = self._learned()
