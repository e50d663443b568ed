# Copyright 2026 ride_estimation contributors
"""What accelerometers at the mount bases cannot tell: how a bracket that moves on its own tilts.

The tilt of a bracket is inferred from the vertical motion of its neighbours, which is right for a frame that moves as a
rigid, twisting plate. What a single bracket moves beyond that is measured as translation; whether it also tilts is
unknown, and the tilt inferred for all brackets is off by ``local motion / distance``. How much the brackets move on their own
is read from the part of the measured base motion that no rigid, twisting frame can have; the same level is assumed in all
three directions.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.model.plant import Plant
from ride_estimation.diagnosis.model.response import LinearResponse
from ride_estimation.diagnosis.runs.noise import smoothed_power
from ride_estimation.frames import AXES, point_motion_matrix

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

#: first bending mode of the frame of a heavy truck, 6 to 9 Hz (Gillespie 1985, SAE 850001), the softest of the usual bases
_BENDING_HZ = 8.0
_FLEX_SHARE = 0.2  # of what a base does that is bending; a lever of 2 cm then errs by as much as a right model may
#: of the slope that three brackets show together. What left and right of the road differ by is independent at both axles: a soft
#: frame twists as much at an axle as it rolls, and at brackets half way to the axles half as much
_TWIST_SHARE = 0.5
_LEAST_REACH = 0.1  # half the distance of brackets below which their slope is no plate's [m]


def own_sensor(plant: Plant, base: str) -> dict[str, str]:
    """Return mount -> nearest accelerometer for the mounts of a base that have one to themselves."""
    sensors = {s.sensor: plant.vehicle.sensors[s.sensor] for s in plant.inputs}
    candidates = [name for name, s in sensors.items() if s.body == base]
    mounts = [m for m in plant.mounts if plant.vehicle.mounts[m].base == base]
    pairs = sorted(
        (float(np.linalg.norm(sensors[s].position - plant.vehicle.mounts[m].position)), m, s)
        for m in mounts for s in candidates
    )
    out: dict[str, str] = {}
    for _, mount, sensor in pairs:
        if mount not in out and sensor not in out.values():
            out[mount] = sensor
    return out


def plate_motion(positions: Array) -> Array:
    """Return the translations of points of a plate that moves rigidly and twists, shape (3 S, 7)."""
    offset = positions - positions.mean(axis=0)
    rigid = np.vstack([point_motion_matrix(r) for r in offset])
    twist = np.zeros((3 * len(offset), 1))
    twist[1::3, 0], twist[2::3, 0] = -offset[:, 0] * offset[:, 2], offset[:, 0] * offset[:, 1]
    return np.hstack([rigid, twist])


def null_directions(motion: Array) -> Array:
    """Return an orthonormal basis of the patterns that a motion map cannot reach, shape (rows, d)."""
    size = np.maximum(np.linalg.norm(motion, axis=0), 1e-12)
    left, values, _ = np.linalg.svd(motion / size, full_matrices=True)
    return np.asarray(left[:, int(np.count_nonzero(values > 1e-6 * values[0])) :])


def vertical_inputs(plant: Plant) -> tuple[tuple[str, ...], Array]:
    """Return the base sensors and the readings of a unit vertical acceleration of each, shape (nu, S)."""
    names = tuple(dict.fromkeys(s.sensor for s in plant.inputs))
    out = np.zeros((len(plant.inputs), len(names)))
    for i, s in enumerate(plant.inputs):
        out[i, names.index(s.sensor)] = plant.vehicle.sensors[s.sensor].rotation[2, s.component]
    return names, out


def local_motion(plant: Plant, base_spectrum: ComplexArray, noise: ComplexArray, samples: int, width: int) -> Array:
    """Return the power of what every base sensor's bracket moves on its own, one direction, shape (F, S).

    Parameters
    ----------
    base_spectrum
        Base accelerations of the mounts, shape (F, nb).
    noise
        How noise of the inputs, times its standard deviation, reaches them, shape (F, nb, nu).
    samples, width
        Length of the run; bins over which power is averaged.

    Returns
    -------
    ndarray
        Variance per sample in the unit of :func:`noise.smoothed_power`; zero where fewer than three brackets carry a sensor.
    """
    names, _ = vertical_inputs(plant)
    out = np.zeros((len(base_spectrum), len(names)))
    for base in dict.fromkeys(plant.vehicle.sensors[s].body for s in names):
        own = own_sensor(plant, base)
        if len(own) < 3:
            continue
        level = _excess(plant, tuple(own), base_spectrum, noise, samples, width)
        if level is None:
            continue
        # a faulty sensor looks like a bracket that moves on its own, but not to the brackets without it
        total = max(float(level.sum()), 1e-300)
        others = [_excess(plant, tuple(m for m in own if m != left), base_spectrum, noise, samples, width) for left in own]
        share = min([1.0, *(float(p.sum()) / total for p in others if p is not None)])
        for sensor in own.values():
            out[:, names.index(sensor)] = share * level
    return out


def _excess(
    plant: Plant, mounts: tuple[str, ...], base_spectrum: ComplexArray, noise: ComplexArray, samples: int, width: int
) -> Array | None:
    """Return the power per direction that some brackets have beyond a twisting plate and noise, shape (F,).

    None where these brackets cannot tell.
    """
    rows = np.concatenate([3 * plant.mounts.index(m) + np.arange(len(AXES)) for m in mounts])
    null = null_directions(plate_motion(np.array([plant.vehicle.mounts[m].position for m in mounts])))
    if null.shape[1] == 0:
        return None
    measured = smoothed_power(base_spectrum[:, rows] @ null, samples, width).mean(axis=1)
    expected = np.sum(np.abs(np.einsum("rd,fru->fdu", null, noise[:, rows])) ** 2, axis=(1, 2)) / null.shape[1]
    return np.asarray(np.maximum(measured - expected, 0.0))


def unseen_tilt(plant: Plant, base_spectrum: ComplexArray, inputs: ComplexArray, omega: Array, samples: int, width: int) -> Array:
    """Return the power of the roll and pitch acceleration of every bracket that no base sensor shows, shape (F, 2 M).

    From its first bending mode on, a share of the vertical motion of a frame is bending, which has a slope of its own; below
    it bends in proportion to its acceleration. Three brackets do not show a twist at all: each may then roll and pitch
    by half of the slope that they show together, more or less.

    Parameters
    ----------
    base_spectrum, inputs
        Base accelerations of the mounts, shape (F, nb), and measured readings, shape (F, nu).
    omega
        Angular frequencies [rad/s], shape (F,).
    samples, width
        As in :func:`local_motion`.
    """
    bends = np.minimum(omega / (2.0 * np.pi * _BENDING_HZ), 1.0) ** 4
    out = np.zeros((len(omega), 2 * len(plant.mounts)))
    shown = smoothed_power(inputs @ plant.slope.T, samples, width)
    vertical = smoothed_power(base_spectrum[:, 2::3], samples, width)
    twisting = {t.place for t in plant.tilts if t.kind == "twist"}
    for j, mount in enumerate(plant.mounts):
        base = plant.vehicle.mounts[mount].base
        places = np.array([plant.vehicle.mounts[m].position for m in own_sensor(plant, base)])
        slopes = [bool(np.any(plant.slope[3 * j + part])) for part in range(2)]
        for part in (p for p in range(2) if slopes[p]):
            reach = 0.5 * float(np.ptp(places[:, 1 - part]))
            out[:, 2 * j + part] = bends * vertical[:, j] * (_FLEX_SHARE / max(reach, _LEAST_REACH)) ** 2
            if all(slopes) and mount not in twisting:
                out[:, 2 * j + part] += _TWIST_SHARE**2 * shown[:, 3 * j + part]
    return out


def turned(plant: Plant, turning: Array, twice: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the base accelerations (F, nb, q) and wrenches (F, n, q) of turning brackets.

    Gravity that the tilt removes from the base acceleration, the lever from the sensor to the mount, and static mount loads
    that turn with the bracket.

    Parameters
    ----------
    turning
        Roll, pitch and yaw acceleration of the brackets per unit of q quantities, shape (nb, q).
    twice
        :attr:`LinearResponse.twice_integrated`.
    """
    return plant.lever_motion(turning) + plant.gravity_tilt(turning) * twice, plant.static_tilt(turning) * twice


def tilt_uncertainty(
    plant: Plant, base_spectrum: ComplexArray, inputs: ComplexArray, noise: ComplexArray, omega: Array, samples: int, width: int
) -> tuple[Array, Array]:
    """Return what is unknown of the tilt of brackets.

    Parameters
    ----------
    base_spectrum, noise, samples, width
        As in :func:`local_motion`.
    inputs, omega
        As in :func:`unseen_tilt`.

    Returns
    -------
    tuple
        Standard deviation per sample of q unknown accelerations, shape (F, q), and how brackets turn with them, shape (nb, q).
    """
    local = local_motion(plant, base_spectrum, noise, samples, width)
    unseen = unseen_tilt(plant, base_spectrum, inputs, omega, samples, width)
    own = np.eye(3 * len(plant.mounts))[:, [3 * j + part for j in range(len(plant.mounts)) for part in range(2)]]
    power, turning = np.hstack([local, unseen]), np.hstack([plant.slope @ vertical_inputs(plant)[1], own])
    used = np.any(power > 0.0, axis=0)
    return np.sqrt(power[:, used]), turning[:, used]


def tilt_spectrum(plant: Plant, response: LinearResponse, slope: Array, inputs: ComplexArray) -> ComplexArray:
    """Return the outputs of a tilt of brackets, shape (F, ny).

    Parameters
    ----------
    slope
        Roll, pitch and yaw of the brackets from twice integrated readings, shape (nb, nu).
    inputs
        Shape (F, nu).
    """
    twice = response.twice_integrated[:, :, 0] * inputs
    base = inputs @ plant.lever_motion(slope).T + twice @ plant.gravity_tilt(slope).T
    columns = base[:, :, None], (twice @ plant.static_tilt(slope).T)[:, :, None]
    return np.asarray(response.outputs(response.coordinates(*columns), columns[0])[:, :, 0])
