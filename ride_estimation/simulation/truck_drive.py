# Copyright 2026 ride_estimation contributors
"""Drive the two-axle truck over the scenario's road and return how each cab mount base moves.

The cab's mass rides on the frame as a lump; the cab's own motion does not act back on the frame.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from ride_estimation.excitation import obstacles as shapes
from ride_estimation.excitation.driving import lane_change, speed_profile, travelled
from ride_estimation.excitation.engine import crank_angle, order_lines
from ride_estimation.excitation.road import Road, flat_road, random_road
from ride_estimation.simulation.base_motion import BaseMotion, derivative
from ride_estimation.simulation.response import Response
from ride_estimation.simulation.scenario import Engine, Obstacle, Pave, Scenario
from ride_estimation.simulation.simulate import simulate
from ride_estimation.vehicles.assembly import Assembly, assemble
from ride_estimation.vehicles.two_axle_truck import FRAME_HALVES, WHEELS, TruckData, two_axle_truck
from ride_estimation.vehicles.vehicle import Vehicle

Array = NDArray[np.float64]

#: seconds driven before the run is recorded, so that it begins in full motion
RUN_UP_S = 6.0
#: base name of mounts that stand on the road
ROAD = "road"
#: road beyond the wheels at both ends [m]
_MARGIN_M = 12.0


@dataclasses.dataclass(frozen=True)
class Drive:
    """Result of driving the truck: motion of the cab mount bases, vehicle speed [m/s], distance [m], run-up samples.

    ``speed`` and ``distance`` have shape (N,) like the base motion; the first ``lead`` samples are the run-up.
    """

    base: BaseMotion
    speed: Array
    distance: Array
    lead: int


def drive(scenario: Scenario, cab: Vehicle) -> Drive:
    """Drive the truck through a scenario.

    Parameters
    ----------
    cab
        The vehicle whose mount bases are wanted. A mount on ``road`` follows the road under it (left track for y of 0 or
        more), every other prescribed base rides on the frame.
    """
    rate = scenario.simulation_rate
    lead = round(RUN_UP_S * rate)
    count = lead + round(scenario.duration * rate) + 1
    time = (np.arange(count) - lead) / rate
    speed = speed_profile(time, scenario.speed)
    distance = travelled(time, speed)
    distance -= distance[lead]
    road = make_road(scenario, distance)
    truck = assemble(two_axle_truck(scenario.truck))
    wheels, slopes = _wheel_paths(road, scenario.truck, truck, distance, rate)
    forward = derivative(speed, rate)
    sideways = sum((lane_change(time, c.begin, c.duration, c.peak) for c in scenario.lane_changes), np.zeros(count))
    load = _inertia_load(truck, forward, sideways) + _slope_load(truck, slopes)
    response = simulate(truck, wheels, load=load)
    base = _on_road(_frame_motion(response, scenario.truck, cab, speed, sideways), road, scenario.truck, cab, distance)
    if scenario.engine is not None:
        riding = np.array([m.base != ROAD for m in cab.mounts.values()])
        base = _with_engine(base, scenario.engine, time, scenario.seed, riding)
    return Drive(base, speed, distance, lead)


def make_road(scenario: Scenario, distance: Array) -> Road:
    """Make the road of a scenario, long enough for all wheels at the given distances of the front axle [m].

    Sharp obstacles and cobbles are laid as the hub path of the rolling wheel, the random road as the mean over the tyre
    patch.
    """
    truck = scenario.truck
    start = float(distance.min()) - truck.wheelbase - _MARGIN_M
    length = float(distance.max()) + _MARGIN_M - start
    spec = scenario.road
    if spec.roughness > 0.0:
        road = random_road(
            length, scenario.seed, roughness=spec.roughness, waviness=spec.waviness,
            coherence_length=spec.coherence_length, start=start,
        )
    else:
        road = flat_road(length, start=start)
    road = road.smoothed(truck.contact_length)
    for number, pave in enumerate(scenario.pave):
        tracks = [_pave_track(road, pave, 1000 * scenario.seed + 10 * number + side) for side in range(2)]
        road = road.plus(*(shapes.rolled_envelope(t, road.spacing, truck.wheel_radius) for t in tracks))
    for obstacle in scenario.obstacles:
        path = _obstacle_path(road, obstacle, truck.wheel_radius)
        road = road.plus(*(path if obstacle.side in ("both", side) else 0.0 * path for side in ("left", "right")))
    return road


def _pave_track(road: Road, pave: Pave, seed: int) -> Array:
    inside = (road.distance >= pave.begin) & (road.distance <= pave.end)
    track = np.zeros(len(inside))
    if np.any(inside):
        track[inside] = shapes.belgian_pave(road.distance[inside], seed, stone=pave.stone, height_std=pave.height_std)
    return track


def _obstacle_path(road: Road, obstacle: Obstacle, radius: float) -> Array:
    shape = {"cosine": shapes.cosine_bump, "block": shapes.block, "ramp": shapes.ramp}[obstacle.kind]
    profile = shape(road.distance, obstacle.at, obstacle.length, obstacle.height)
    return profile if obstacle.kind == "cosine" else shapes.rolled_envelope(profile, road.spacing, radius)


def _wheel_paths(
    road: Road, data: TruckData, truck: Assembly, distance: Array, rate: float
) -> tuple[BaseMotion, Array]:
    """Return the motion under the tyres, faded in over two seconds, and the road slope at the wheels, shape (N, 4)."""
    fade = _fade(len(distance), rate)
    left, right = (np.asarray(np.gradient(t, road.spacing), dtype=float) for t in (road.left, road.right))
    grade = Road(road.spacing, left, right, road.start)
    at = (distance, distance - data.wheelbase)
    height = np.hstack([road.heights(s) for s in at]) * fade[:, None]
    slope = np.hstack([grade.heights(s) for s in at]) * fade[:, None]
    displacement = np.zeros((len(distance), len(truck.mount_names), 3))
    for column, wheel in enumerate(WHEELS):
        displacement[:, truck.mount_names.index(f"tyre_{wheel}"), 2] = height[:, column]
    return BaseMotion.from_displacement(displacement, rate), slope


def _fade(samples: int, rate: float) -> Array:
    """Return a smooth rise from 0 to 1 over the first two seconds, shape (N,)."""
    share = np.clip(np.arange(samples) / (2.0 * rate), 0.0, 1.0)
    return share**2 * (3.0 - 2.0 * share)


def _inertia_load(truck: Assembly, forward: Array, sideways: Array) -> Array:
    """Return the load in the frame that drives along, ``-m a`` on every body, shape (N, Q)."""
    load = np.zeros((len(forward), len(truck.coordinates)))
    for column, (body, coordinate) in enumerate(truck.coordinates):
        if coordinate in ("x", "y"):
            load[:, column] = -truck.vehicle.bodies[body].mass.value * (forward if coordinate == "x" else sideways)
    return load


def _slope_load(truck: Assembly, slopes: Array) -> Array:
    """Return the fore-aft force of a wheel on a slope, ``-F_static dz/ds``, as generalised load, shape (N, Q)."""
    load = np.zeros((len(slopes), len(truck.coordinates)))
    for column, wheel in enumerate(WHEELS):
        number = truck.mount_names.index(f"tyre_{wheel}")
        mount = truck.vehicle.mounts[f"tyre_{wheel}"]
        row = truck.point_map(mount.body, mount.position)[0]
        load -= np.outer(truck.static_force[number, 2] * slopes[:, column], row)
    return load


def _frame_motion(response: Response, data: TruckData, cab: Vehicle, speed: Array, sideways: Array) -> BaseMotion:
    """Return the motion of the frame at the cab mounts, in the inertial frame that moves with the initial speed.

    The frame vibrates in axes that drive along and turn with the heading about the origin of the vehicle file:
    ``p = path + R(heading) (r + d) - r``.
    """
    rate, count = response.base_motion.rate_hz, len(speed)
    turn_rate = np.where(speed > 1.0, sideways / np.maximum(speed, 1.0), 0.0)
    heading, change = _integral(turn_rate, rate), derivative(turn_rate, rate)
    turn = np.zeros((count, 3, 3))
    turn[:, 0, 0] = turn[:, 1, 1] = np.cos(heading)
    turn[:, 1, 0] = np.sin(heading)
    turn[:, 0, 1], turn[:, 2, 2] = -turn[:, 1, 0], 1.0
    spin, spin_change = (np.outer(part, [0.0, 0.0, 1.0]) for part in (turn_rate, change))
    # at a walk the lateral acceleration does not turn the vehicle: it slips
    slip = _integral(sideways - speed * turn_rate, rate)
    still = np.zeros(count)
    velocity = _turned(turn, np.stack([speed, slip, still], axis=1)) - [speed[0], 0.0, 0.0]
    path = np.stack([_integral(velocity[:, i], rate) for i in range(3)], axis=1)
    along = _turned(turn, np.stack([derivative(speed, rate) - turn_rate * slip, sideways, still], axis=1))
    arrays = [np.zeros((count, len(cab.mounts), 3)) for _ in range(6)]
    for number, mount in enumerate(cab.mounts.values()):
        share = data.share_of_front(float(mount.position[0]))
        maps = [response.assembly.point_map(half, mount.position) for half in FRAME_HALVES]
        point = share * maps[0] + (1.0 - share) * maps[1]
        motions = [part @ point.T for part in (response.coordinates, response.rates, response.accelerations)]
        place, speed_in, pull = (part[:, :3] for part in motions)
        carried = np.cross(spin, mount.position + place)
        turning = (
            mount.position + place,
            speed_in + carried,
            pull + 2.0 * np.cross(spin, speed_in) + np.cross(spin_change, mount.position + place) + np.cross(spin, carried),
        )
        beyond = (np.zeros(3), carried, turning[2] - pull)
        for i, common in enumerate((path, velocity, along)):
            arrays[i][:, number] = motions[i][:, :3] + common + beyond[i] + _turned(turn - np.eye(3), turning[i])
            arrays[3 + i][:, number] = motions[i][:, 3:]
        for i, part in enumerate((heading, turn_rate, change)):
            arrays[3 + i][:, number, 2] += part
    return BaseMotion(rate, *arrays)


def _turned(turn: Array, vectors: Array) -> Array:
    return np.asarray(np.einsum("nij,nj->ni", turn, vectors))


def _on_road(base: BaseMotion, road: Road, data: TruckData, cab: Vehicle, distance: Array) -> BaseMotion:
    """Replace the vertical motion of mounts on the road by the road itself, faded in like the wheels of the truck."""
    on_road = [(n, m) for n, m in enumerate(cab.mounts.values()) if m.base == ROAD]
    if not on_road:
        return base
    fade = _fade(len(distance), base.rate_hz)
    displacement = np.zeros((len(distance), len(on_road), 3))
    for column, (_, mount) in enumerate(on_road):
        side = 0 if mount.position[1] >= 0.0 else 1
        along = distance + float(mount.position[0]) - data.front_axle_x
        displacement[:, column, 2] = fade * road.heights(np.clip(along, road.distance[0], road.distance[-1]))[:, side]
    alone = BaseMotion.from_displacement(displacement, base.rate_hz)
    changed = {}
    for field in dataclasses.fields(BaseMotion)[1:]:
        values = getattr(base, field.name).copy()
        values[:, [n for n, _ in on_road]] = getattr(alone, field.name)
        changed[field.name] = values
    return dataclasses.replace(base, **changed)


def _with_engine(base: BaseMotion, engine: Engine, time: Array, seed: int, riding: NDArray[np.bool_]) -> BaseMotion:
    """Add the engine's order lines to the base displacement of the riding mounts, each with its own strength and phase."""
    revolutions = np.interp(time, [p[0] for p in engine.speed], [p[1] for p in engine.speed])
    angle = crank_angle(time, revolutions)
    omega = 2.0 * math.pi * np.maximum(revolutions, 1.0)
    generator = np.random.default_rng([seed, 77])
    mounts = base.displacement.shape[1]
    strength = 1.0 + 0.2 * generator.uniform(-1.0, 1.0, (mounts, 3))
    strength *= np.array([engine.fore_aft_share, engine.lateral_share, 1.0]) * riding[:, None]
    phase = generator.uniform(0.0, 2.0 * math.pi, (mounts, 3))
    fade = np.clip((time - time[0]) / 2.0, 0.0, 1.0) * (revolutions > 1.0)
    added = np.zeros_like(base.displacement)
    for order, amplitude in engine.orders.items():
        for m, a in np.ndindex(mounts, 3):
            line = order_lines(angle, {order: amplitude * float(strength[m, a])}, {order: float(phase[m, a])})
            added[:, m, a] -= fade * line / (order * omega) ** 2
    velocity = derivative(added, base.rate_hz)
    return dataclasses.replace(
        base, displacement=base.displacement + added, velocity=base.velocity + velocity,
        acceleration=base.acceleration + derivative(velocity, base.rate_hz),
    )


def _integral(signal: Array, rate: float) -> Array:
    return np.concatenate([[0.0], np.cumsum(0.5 * (signal[1:] + signal[:-1]))]) / rate
