# Copyright 2026 ride_estimation contributors
"""Roads and the chassis motion they cause, synthesised as sums of harmonics with exact derivatives.

Left and right wheel paths with random phase over ``G(n) = G0 (n/n0)^-w`` (n0 = 0.1 cycles/m), partly coherent, pass
through the corner response of a two-mass truck suspension; four corner motions make heave, roll, pitch and twist of the
frame. Fore-aft, lateral and yaw motion and local bracket motion are processes of their own.
"""

from __future__ import annotations

import dataclasses

import numpy as np

#: way over which a wheel climbs a kerb, about the radius of a tyre on its belt [m]
KERB_RISE = 0.35
#: angle of the chassis per lateral and longitudinal acceleration [rad per m/s^2]
LEAN, DIVE = 0.006, 0.004


@dataclasses.dataclass(frozen=True)
class Road:
    """What the truck drives over.

    ``roughness`` G(n0) [m^3] (ISO 8608 class B 64e-6, C 256e-6, D 1024e-6), ``waviness`` w, ``speed`` [m/s],
    ``coherence_length`` of left against right [m], ``bumps`` as (time s, height m, length m, side 'both'|'left'|'right'),
    ``cobbles`` rms height [m] with ``cobble_length`` [m], ``horizontal`` ratio of the own horizontal to the vertical
    chassis acceleration, ``twist`` share of the axle twist that reaches the cab frame, ``local`` ratio of local bracket
    acceleration, ``follow`` shares of the frame's twist that brackets roll and pitch with (a cross member rolls, a rail
    pitches, a stiff subframe does neither), ``standing_s`` seconds at rest before the start, ``stop_s`` when it stops
    again [s], ``engine`` (frequency Hz, acceleration m/s^2) of a shake while moving, ``kerbs`` as (time s, height m,
    length m, side) climbed and left over ``KERB_RISE``, ``course`` as (``brake`` m/s^2 | ``bend`` m/s^2 | ``slope`` rad,
    time s, length s, amount): braking is a negative amount, a bend to the left and a slope nose down are positive.
    """

    roughness: float = 256e-6
    waviness: float = 2.0
    speed: float = 15.0
    coherence_length: float = 3.0
    bumps: tuple[tuple[float, float, float, str], ...] = ()
    cobbles: float = 0.0
    cobble_length: float = 0.2
    horizontal: float = 0.5
    twist: float = 0.5
    local: float = 0.1
    follow: tuple[float, float] = (1.0, 0.0)
    standing_s: float = 1.0
    ramp_s: float = 1.0
    stop_s: float = np.inf
    engine: tuple[float, float] = (0.0, 0.0)
    kerbs: tuple[tuple[float, float, float, str], ...] = ()
    course: tuple[tuple[str, float, float, float], ...] = ()
    wheelbase: float = 4.2
    track: float = 2.0
    front_axle_x: float = 0.3
    roll_centre_height: float = 0.8
    top_frequency: float = 40.0

    @staticmethod
    def random(rng: np.random.Generator, kind: str = "any") -> Road:
        """Draw a road; ``kind``: ``any`` (B to D, 6-25 m/s), ``smooth`` (A-B), ``rough`` (C-D), ``bumps``, ``cobbles``."""
        exponent = {"smooth": (-0.5, 1.2), "rough": (1.6, 3.2)}.get(kind, (0.8, 2.6))
        roughness = 16e-6 * 4.0 ** rng.uniform(*exponent)
        speed = float(rng.uniform(7.0, 24.0))
        # rough roads are driven slower: keep the vertical excitation in the range of real driving
        speed = min(speed, 24.0 * (256e-6 / roughness) ** 0.35) if roughness > 256e-6 else speed
        bumps: tuple[tuple[float, float, float, str], ...] = ()
        if kind == "bumps":
            speed = float(rng.uniform(4.0, 9.0))
            sides = ("both", "left", "right")
            bumps = tuple(
                (float(t), float(rng.uniform(-0.05, 0.07)), float(rng.uniform(0.4, 2.5)), str(rng.choice(sides)))
                for t in np.arange(4.0, 600.0, 5.0) + rng.uniform(-1.0, 1.0, 120)
            )
        cobbles = float(rng.uniform(0.002, 0.005)) if kind == "cobbles" else 0.0
        if kind == "cobbles":
            speed = float(rng.uniform(4.0, 9.0))
        return Road(
            roughness=roughness,
            waviness=float(rng.uniform(1.7, 2.4)),
            speed=speed,
            coherence_length=float(rng.uniform(1.0, 5.0)),
            bumps=bumps,
            cobbles=cobbles,
            cobble_length=float(rng.uniform(0.12, 0.4)),
            horizontal=float(rng.uniform(0.4, 0.8)),
            twist=float(rng.uniform(0.2, 0.8)),
            local=float(rng.uniform(0.05, 0.2)),
            wheelbase=float(rng.uniform(3.4, 5.5)),
            track=float(rng.uniform(1.8, 2.1)),
            front_axle_x=float(rng.uniform(-0.5, 0.6)),
            roll_centre_height=float(rng.uniform(0.4, 1.1)),
        )

    @staticmethod
    def standing(engine_hz: float = 0.0, engine_accel: float = 0.0) -> Road:
        """Return a vehicle at rest, shaken by the engine where given."""
        return Road(roughness=0.0, horizontal=0.0, local=0.0, twist=0.0, engine=(engine_hz, engine_accel))


@dataclasses.dataclass(frozen=True)
class BaseMotion:
    """Prescribed motion at half steps: chassis (2N+1, 12) and brackets (2N+1, M, 12), see kernel.place_brackets."""

    step: float
    chassis: np.ndarray
    brackets: np.ndarray
    road_left: np.ndarray


def _corner_response(freq: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return frame motion over road height of one axle: sprung and unsprung mass, random truck values."""
    s = 2j * np.pi * freq
    sprung, unsprung = 3000.0 * rng.uniform(0.8, 1.2), 350.0 * rng.uniform(0.8, 1.2)
    spring = sprung * (2 * np.pi * rng.uniform(1.3, 2.1)) ** 2
    damper = 2.0 * rng.uniform(0.2, 0.4) * np.sqrt(spring * sprung)
    tyre = 9e5 * rng.uniform(0.8, 1.3)
    link = spring + damper * s
    d11, d22 = sprung * s**2 + link, unsprung * s**2 + link + tyre
    return tyre * link / (d11 * d22 - link**2)


def _noise(freq: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return unit white complex amplitudes (one-sided density 1 per Hz) of a real signal."""
    df = freq[1]
    phase = rng.uniform(0.0, 2 * np.pi, freq.size)
    return np.sqrt(2.0 * df) * np.exp(1j * phase)


def _band(freq: np.ndarray, low: float, high: float) -> np.ndarray:
    """Return a smooth band-pass weight (0..1)."""
    f = np.maximum(freq, 1e-9)
    return 1.0 / np.sqrt(1.0 + (low / f) ** 8) / np.sqrt(1.0 + (f / high) ** 8)


def _blend(time: np.ndarray, start: float, length: float) -> tuple[np.ndarray, np.ndarray]:
    """Return a rise from 0 to 1 with continuous speed and acceleration, and its rate."""
    if length <= 0.0:
        return np.ones_like(time), np.zeros_like(time)
    part = np.clip((time - start) / length, 0.0, 1.0)
    return part**3 * (10.0 - 15.0 * part + 6.0 * part**2), 30.0 * part**2 * (1.0 - part) ** 2 / length


def _bump_profile(road: Road, time: np.ndarray, side: str) -> np.ndarray:
    profile = np.zeros_like(time)
    for when, height, length, where in road.bumps:
        if where in ("both", side):
            x = (time - when) * road.speed / length
            inside = (x >= 0.0) & (x <= 1.0)
            profile[inside] += height * 0.5 * (1.0 - np.cos(2 * np.pi * x[inside]))
    for when, height, length, where in road.kerbs:
        if where in ("both", side):
            rise = KERB_RISE / road.speed
            up, down = _blend(time, when, rise)[0], _blend(time, when + length / road.speed, rise)[0]
            profile += height * (up - down)
    return profile


def _pulse(time: np.ndarray, start: float, length: float, rise: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a pulse of height one with smooth flanks: its rate, itself, its integral."""
    rates, values, areas = [], [], []
    for begin in (start, start + length):
        value, rate = _blend(time, begin, rise)
        p = np.maximum(time - begin, 0.0) / rise
        area = rise * np.where(p < 1.0, p**4 * (2.5 - 3.0 * p + p**2), p - 0.5)
        rates.append(rate)
        values.append(value)
        areas.append(area)
    return rates[0] - rates[1], values[0] - values[1], areas[0] - areas[1]


def _course_motion(road: Road, time: np.ndarray) -> np.ndarray:
    """Return what braking, bends and slopes do to the chassis, (N, 12), seen from a frame that goes on at the first speed."""
    along, along_rate, speed = np.zeros_like(time), np.zeros_like(time), np.full_like(time, road.speed)
    side, side_rate, slope, slope_rate = (np.zeros_like(time) for _ in range(4))
    for kind, when, length, amount in road.course:
        rate, value, area = _pulse(time, when, length, 0.6 if kind != "slope" else 2.0)
        if kind == "slope":
            slope, slope_rate = slope + amount * value, slope_rate + amount * rate
        elif kind == "bend":
            side, side_rate = side + amount * value, side_rate + amount * rate
        else:
            along, along_rate, speed = along + amount * value, along_rate + amount * rate, speed + amount * area
    turning = side / speed
    step = time[1] - time[0]

    def summed(x: np.ndarray) -> np.ndarray:
        return np.concatenate([[0.0], np.cumsum(0.5 * (x[1:] + x[:-1]))]) * step

    heading = summed(turning)
    velocity = np.column_stack([speed * np.cos(heading) - road.speed, speed * np.sin(heading)])
    out = np.zeros((len(time), 12))
    out[:, 0], out[:, 1] = summed(velocity[:, 0]), summed(velocity[:, 1])
    out[:, 3:5] = velocity
    # the body dives and leans on its suspension
    out[:, 6], out[:, 9] = LEAN * side, LEAN * side_rate
    out[:, 7], out[:, 10] = slope - DIVE * along, slope_rate - DIVE * along_rate
    out[:, 8], out[:, 11] = heading, turning
    return out


def base_motion(
    road: Road, points: np.ndarray, duration: float, step: float, seed: int, centre: np.ndarray | None = None
) -> BaseMotion:
    """Return the base motion of brackets at ``points`` (M, 3) for ``duration`` [s] and integration step [s]."""
    rng = np.random.default_rng(seed)
    half = 0.5 * step
    n = 2 * round(duration / step) + 1
    period = n * half * 1.07
    size = 1 << int(np.ceil(np.log2(period / half)))
    freq = np.fft.rfftfreq(size, half)
    window = _band(freq, 0.25, road.top_frequency)
    f = np.maximum(freq, freq[1])

    def amplitude_of(complex_: np.ndarray) -> np.ndarray:
        return complex_ * size / 2.0

    density = np.sqrt(road.roughness * 0.1**road.waviness * road.speed ** (road.waviness - 1.0) / f**road.waviness)
    if road.cobbles > 0.0:
        centre_f = road.speed / road.cobble_length
        width = 0.35 * centre_f
        density = np.sqrt(density**2 + road.cobbles**2 / (width * np.sqrt(np.pi)) * np.exp(-(((f - centre_f) / width) ** 2)))
    wavenumber = f / max(road.speed, 0.1)
    coherence = np.exp(-road.coherence_length * wavenumber)
    left = _noise(freq, rng) * density
    right = coherence * left + np.sqrt(1.0 - coherence**2) * _noise(freq, rng) * density
    left, right = amplitude_of(left), amplitude_of(right)
    time = np.arange(size) * half
    if road.bumps or road.kerbs:
        left = left + np.fft.rfft(_bump_profile(road, time, "left"))
        right = right + np.fft.rfft(_bump_profile(road, time, "right"))
    front, rear = _corner_response(freq, rng), _corner_response(freq, rng)
    rear = rear * np.exp(-2j * np.pi * freq * road.wheelbase / max(road.speed, 0.1))
    fl, fr, rl, rr = (h * z * window for h, z in ((front, left), (front, right), (rear, left), (rear, right)))
    front_mean, rear_mean = 0.5 * (fl + fr), 0.5 * (rl + rr)
    front_roll, rear_roll = (fl - fr) / road.track, (rl - rr) / road.track
    pitch = -(front_mean - rear_mean) / road.wheelbase
    heave = front_mean - pitch * (0.0 - road.front_axle_x)
    roll = 0.5 * (front_roll + rear_roll)
    twist = road.twist * (front_roll - rear_roll) / road.wheelbase  # rad per metre of frame

    vertical = float(np.sqrt(np.mean(np.fft.irfft(heave * (2j * np.pi * freq) ** 2, size) ** 2)))

    def process(low: float, high: float, accel_rms: float) -> np.ndarray:
        """Return displacement amplitudes of a band-limited process of given acceleration rms."""
        if accel_rms <= 0.0:
            return np.zeros(freq.size, complex)
        raw = _noise(freq, rng) * _band(freq, low, high)
        raw = raw * accel_rms / np.sqrt(0.5 * np.sum(np.abs(raw) ** 2))
        return -amplitude_of(raw) / (2 * np.pi * f) ** 2

    own = road.horizontal * vertical
    fore = process(0.6, 25.0, own) + road.roll_centre_height * 0.5 * pitch
    side = process(0.6, 25.0, own) - road.roll_centre_height * roll
    yaw = process(0.5, 12.0, 0.3 * own)
    zero = np.zeros_like(fore)
    spectra = [fore, side, heave, roll, pitch, yaw]
    if road.engine[1] > 0.0:
        k = int(np.argmin(np.abs(freq - road.engine[0])))
        line = np.zeros_like(fore)
        line[k] = -road.engine[1] / (2 * np.pi * freq[k]) ** 2 * size / 2.0
        spectra[2] = spectra[2] + line
        spectra[3] = spectra[3] + 0.3j * line

    def series(spectrum: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        value = np.fft.irfft(spectrum, size)[:n]
        rate = np.fft.irfft(spectrum * 2j * np.pi * freq, size)[:n]
        return envelope * value, slope * value + envelope * rate

    t = np.arange(n) * half
    envelope, slope = _blend(t, road.standing_s, road.ramp_s)
    if np.isfinite(road.stop_s):
        fall, fall_rate = _blend(t, road.stop_s, 2.0)
        envelope, slope = envelope * (1.0 - fall), slope * (1.0 - fall) - envelope * fall_rate

    chassis = np.zeros((n, 12))
    for j, spectrum in enumerate(spectra):
        column = j if j < 3 else 3 + j
        chassis[:, column], chassis[:, column + 3] = series(spectrum)
    if road.course:
        chassis += _course_motion(road, t)
    points = np.asarray(points, float)
    middle = points.mean(axis=0) if centre is None else np.asarray(centre, float)
    brackets = np.zeros((n, len(points), 12))
    twist_value, twist_rate = series(twist)
    for i, point in enumerate(points):
        dx, y = point[0] - middle[0], point[1]
        brackets[:, i, 2] = twist_value * dx * y
        brackets[:, i, 5] = twist_rate * dx * y
        brackets[:, i, 6] = road.follow[0] * twist_value * dx
        brackets[:, i, 9] = road.follow[0] * twist_rate * dx
        brackets[:, i, 7] = -road.follow[1] * twist_value * y
        brackets[:, i, 10] = -road.follow[1] * twist_rate * y
        for axis in range(3):
            local = process(1.5, 25.0, road.local * vertical)
            value, rate = series(local if local.any() else zero)
            brackets[:, i, axis] += value
            brackets[:, i, 3 + axis] += rate
    return BaseMotion(step, chassis, brackets, np.fft.irfft(left, size)[:n])
