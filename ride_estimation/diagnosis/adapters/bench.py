# Copyright 2026 ride_estimation contributors
"""A bench record of one mount as a run: the same chain that tests a vehicle tests a force element.

A record of displacement and force is the same as a mount between a base that moves by minus the displacement and a body too
heavy to move: the body's acceleration times its mass is the force.

Noise of the displacement is white in displacement. As noise of an acceleration it would grow with the square of the frequency
and no single level would be right; through the mount it is a force noise ``|k + i omega c| s_x``, nearly white, and is stated
there: ``s^2 = s_F^2 + K^2 s_x^2`` with the mean square K^2 of the measured dynamic stiffness over the band.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ride_estimation.diagnosis.answer.result import INSUFFICIENT, Diagnosis, Evidence
from ride_estimation.diagnosis.common.settings import Settings
from ride_estimation.diagnosis.common.spectra import edge_taper, make_grid
from ride_estimation.diagnosis.diagnose import diagnose, insufficient
from ride_estimation.elements.base import ForceElement
from ride_estimation.elements.kelvin_voigt import KelvinVoigt
from ride_estimation.errors import InputDataError
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.recording import UniformRun
from ride_estimation.vehicles.vehicle import Body, Mount, Prior, Vehicle

Array = NDArray[np.float64]

_MASS = 1.0e9  # kg, moves by less than 1e-9 of the stroke for any mount
_NO_NOISE = 1.0e-9  # m/s^2, far below what any bench moves with
_HEAD_HZ = 5.0  # natural frequency of the head that is written with the found element [Hz]
_BLOCK_S = 1.0  # blocks of a bench record [s]
_FADE_S = 1.0  # fading of both ends [s]; the chain fades as long
_NO_GAIN = 1e-6  # gain tolerance [-]: the gain of either channel is a stiffness here, and that is free
_TRIM_S = 2.5  # rest, fading and the memory of the band's lower edge [s]

#: what a bench record can tell: force laws, and a changed record. A gain is a stiffness there; there is no body to disturb.
CAUSES = (
    "coulomb_friction", "viscoelasticity", "stiffness_nonlinearity", "damping_nonlinearity", "bump_stop", "backlash",
    "parameter_drift", "sensor_delay", "sensor_clipping",
)

#: linear laws that at one frequency are a stiffness and a damping
_NEED_TWO_FREQUENCIES = ("viscoelasticity", "sensor_delay")
_TONE_SHARE = 0.99  # share of the energy of the displacement within the main lobe of one line: a test at one frequency

MOUNT, FORCE, MOTION = "mount", "force", "motion"


def bench_vehicle(element: ForceElement, force_noise: float) -> Vehicle:
    """Return the bench as a vehicle: one body, one mount along z, a force and a motion channel.

    Parameters
    ----------
    element
        What is believed of the mount.
    force_noise
        Standard deviation of one force sample [N], noise of the displacement included.
    """
    body = Body("head", Prior(_MASS), np.zeros(3), _MASS * np.eye(3), coordinates=("z",))
    sensors = {
        FORCE: Sensor(FORCE, "accelerometer", "", "head", noise_std=max(force_noise, 1e-9) / _MASS, coupling="ac"),
        MOTION: Sensor(MOTION, "accelerometer", "", "piston", mount=MOUNT, coupling="ac", noise_std=_NO_NOISE),
    }
    mount = Mount(MOUNT, np.zeros(3), "head", "piston", {"z": element})
    return Vehicle("bench", {"head": body}, {MOUNT: mount}, sensors)


def bench_run(name: str, rate_hz: float, displacement: Array, force: Array, band_hz: tuple[float, float]) -> UniformRun:
    """Return a record as a run of the bench.

    Parameters
    ----------
    displacement
        Extension of the mount [m], shape (N,).
    force
        Tension [N], shape (N,).
    band_hz
        Band of the test [Hz]: derivatives are taken within it.

    Raises
    ------
    InputDataError
        Lengths differ, or values that are not finite.
    """
    x, f = np.asarray(displacement, dtype=float), np.asarray(force, dtype=float)
    if x.shape != f.shape or x.ndim != 1 or x.size < 8:
        raise InputDataError(
            f"record {name}: displacement and force need one length of at least 8; given {x.shape} and {f.shape}"
        )
    if not (np.all(np.isfinite(x)) and np.all(np.isfinite(f))):
        raise InputDataError(f"record {name}: values that are not finite")
    # the chain fades the ends of accelerations, which after double integration is a stretching of the base that lasts for
    # the whole record: displacement and force fade here, inside a margin of rest on which the other fading changes nothing
    fade, rest = edge_taper(len(x), rate_hz, _FADE_S), round(_FADE_S * rate_hz)
    x = np.pad((x - np.mean(x)) * fade, rest)
    f = np.pad((f - np.mean(f)) * fade, rest)
    grid = make_grid(len(x), rate_hz, band_hz)
    acceleration = grid.signal(grid.omega**2 * grid.spectrum(x))
    zero = np.zeros_like(x)
    # the base moves by -x: deflection (body minus base) is x; the tension pulls the body down: a = -F / m
    data = {MOTION: np.stack([zero, zero, acceleration], axis=1), FORCE: np.stack([zero, zero, -f / _MASS], axis=1)}
    valid = {key: np.ones(len(x), dtype=bool) for key in data}
    return UniformRun(name, rate_hz, 0, data, valid)


@dataclasses.dataclass(frozen=True)
class BenchSample:
    """A record on a uniform time base: rate [Hz], displacement [m] (extension), force [N] (tension), shapes (N,)."""

    name: str
    rate_hz: float
    displacement: Array
    force: Array


def incoherent_noise(values: Array, other: Array) -> float:
    """Return the standard deviation of white noise in a signal: what the other signal does not explain above the test.

    In the upper third of the spectrum every group of 16 bins gets its own transfer function from the other signal, so that
    wanted motion up there is no noise; the median over the groups keeps harmonics of a periodic test out.
    """
    window = np.hanning(len(values))
    y = np.fft.rfft((values - np.mean(values)) * window)
    x = np.fft.rfft((other - np.mean(other)) * window)
    first, width = 2 * len(y) // 3, 16
    count = (len(y) - first) // width
    if count == 0:
        return 0.0
    y, x = (v[first : first + count * width].reshape(count, width) for v in (y, x))
    explained = np.abs(np.sum(np.conj(x) * y, axis=1)) ** 2 / np.maximum(np.sum(np.abs(x) ** 2, axis=1), 1e-300)
    power = (np.sum(np.abs(y) ** 2, axis=1) - explained) / (width - 1)
    return float(np.sqrt(max(np.median(power), 0.0) / (0.375 * len(values))))


def driven_band(sample: BenchSample, settings: Settings) -> tuple[float, float]:
    """Return the band of a record [Hz]: from half the lowest frequency that is driven to the upper edge of the settings."""
    x = (sample.displacement - np.mean(sample.displacement)) * np.hanning(len(sample.displacement))
    energy = np.cumsum(np.abs(np.fft.rfft(x)) ** 2)
    lowest = float(np.fft.rfftfreq(len(x), 1.0 / sample.rate_hz)[int(np.searchsorted(energy, 0.01 * energy[-1]))])
    return max(0.5 * lowest, 4.0 * sample.rate_hz / len(x)), min(settings.band_hz[1], 0.42 * sample.rate_hz)


def one_frequency(displacement: Array) -> bool:
    """Return whether a displacement, shape (N,), is a sine of one frequency."""
    power = np.abs(np.fft.rfft((displacement - np.mean(displacement)) * np.hanning(len(displacement)))) ** 2
    peak = int(np.argmax(power))
    return float(power[max(peak - 2, 0) : peak + 3].sum()) > _TONE_SHARE * float(power.sum())


def secant(sample: BenchSample, band_hz: tuple[float, float]) -> tuple[float, float]:
    """Return stiffness [N/m] and damping [N s/m] that fit a record best in a band, both positive."""
    grid = make_grid(len(sample.force), sample.rate_hz, band_hz)
    weight = grid.band_weight
    x = grid.spectrum(sample.displacement - np.mean(sample.displacement)) * weight
    f = grid.spectrum(sample.force - np.mean(sample.force)) * weight
    total = max(float(np.sum(np.abs(x) ** 2)), 1e-300)
    rate = 1j * grid.omega * x
    modulus = float(np.sqrt(np.sum(np.abs(f) ** 2) / total))
    k = float(np.real(np.sum(np.conj(x) * f))) / total
    c = float(np.real(np.sum(np.conj(rate) * f))) / max(float(np.sum(np.abs(rate) ** 2)), 1e-300)
    omega = float(np.sqrt(np.sum(np.abs(rate) ** 2) / total))
    return max(k, 0.01 * modulus), max(c, 0.01 * modulus / omega)


def diagnose_bench(
    sample: BenchSample,
    validation: tuple[BenchSample, ...] = (),
    settings: Settings | None = None,
    keep_band: bool = False,
    progress: Callable[[float], None] | None = None,
) -> Diagnosis:
    """Diagnose one force element from a bench record: does a spring and a damper explain it, and what is missing.

    Parameters
    ----------
    sample
        Record that is fitted.
    validation
        Records that only judge; sampled at the same rate.
    settings
        Settings; block length and margins are shortened, because a bench forgets its start sooner.
    keep_band
        Keep the band of the settings; otherwise it is read from the record.
    progress
        Called with the share of the work done, 0 to 1.

    Raises
    ------
    InputDataError
        Lengths that differ, values that are not finite, another sample rate.
    """
    settings = settings or Settings()
    band_hz = settings.band_hz if keep_band else driven_band(sample, settings)
    tolerances = dataclasses.replace(settings.tolerances, gain=_NO_GAIN)
    settings = dataclasses.replace(
        settings, over_band=True, band_hz=band_hz, block_s=_BLOCK_S, trim_s=_TRIM_S, tolerances=tolerances,
        minimum_duration_s=2.0 * _TRIM_S + 8.0 * _BLOCK_S,
    )
    run = bench_run(sample.name, sample.rate_hz, sample.displacement, sample.force, band_hz)
    others = []
    for other in validation:
        if abs(other.rate_hz / sample.rate_hz - 1.0) > 1e-3:
            raise InputDataError(f"record {other.name}: sampled at {other.rate_hz:g} Hz, {sample.name} at {sample.rate_hz:g} Hz")
        others.append(bench_run(other.name, other.rate_hz, other.displacement, other.force, band_hz))
    k, c = secant(sample, band_hz)
    low, high = (2.0 * np.pi * f for f in band_hz)
    # mean of k^2 + (c omega)^2 over the band
    modulus = float(np.sqrt(k**2 + c**2 * (low**2 + low * high + high**2) / 3.0))
    noise = float(np.hypot(
        incoherent_noise(sample.force, sample.displacement), modulus * incoherent_noise(sample.displacement, sample.force)
    ))
    tone = one_frequency(sample.displacement)
    causes = tuple(c for c in CAUSES if not (tone and c in _NEED_TWO_FREQUENCIES))
    vehicle = bench_vehicle(KelvinVoigt(k, c), noise)
    # the rest at both ends of the run is not in the record
    lasts, needed = len(sample.force) / sample.rate_hz, settings.minimum_duration_s - 2.0 * _FADE_S
    if lasts < needed:
        answer = insufficient(vehicle, f"the record {sample.name} lasts {lasts:.1f} s; at least {needed:g} s are needed")
    else:
        answer = diagnose(vehicle, run, others, settings, progress, causes)
    warnings, remarks = answer.warnings, answer.remarks + _channel_remarks(answer)
    if tone and answer.verdict != INSUFFICIENT:
        words = (
            f"{sample.name} is driven at one frequency: {' and '.join(_NEED_TWO_FREQUENCIES)} look like a stiffness and a "
            "damping there; what separates them: a test at a second frequency"
        )
        answer = dataclasses.replace(answer, isolability=(*answer.isolability, words))
        warnings += (words,)
    evidence = None if answer.evidence is None else _in_newton(answer.evidence)
    # the secant that the fit starts from is no belief of anybody
    parameters = tuple(dataclasses.replace(p, prior=float("nan")) for p in answer.parameters)
    return dataclasses.replace(
        answer, extended=_element_alone(answer.extended, k, float(np.mean(sample.force))), warnings=warnings, remarks=remarks,
        evidence=evidence, parameters=parameters,
    )  # fmt: skip


def _in_newton(evidence: Evidence) -> Evidence:
    """Return the evidence with the acceleration of the heavy body as the force it stands for, tension positive."""
    power = (evidence.residual_power, evidence.extended_power, evidence.noise_power)
    residual, extended, noise = (_MASS**2 * p for p in power)
    ((time, measured, baseline, extended_force),) = evidence.stretch.values()
    stretch = (time, -_MASS * measured, -_MASS * baseline, -_MASS * extended_force)
    return dataclasses.replace(
        evidence, residual_power=residual, extended_power=extended, noise_power=noise, channel_names=(FORCE,),
        stretch={FORCE: stretch}, unit="N",
    )  # fmt: skip


def _channel_remarks(answer: Diagnosis) -> tuple[str, ...]:
    """Return what must be corrected in the record itself: a file of the element alone has no channels."""
    words = []
    for cause in (c for c in answer.causes if c.id.startswith("sensor_")):
        found = ", ".join(f"{p.name} {p.value:.4g} {p.unit}".strip() for p in cause.parameters)
        words.append(
            f"the {cause.location} channel of the record must be corrected ({found}); the vehicle file holds the element alone"
        )
    return tuple(words)


def _element_alone(vehicle: Vehicle, stiffness: float, preload: float) -> Vehicle:
    """Return the bench without its channels and with a head that a simulation can move: the element is what was found."""
    mass = stiffness / (2.0 * np.pi * _HEAD_HZ) ** 2
    head = dataclasses.replace(vehicle.bodies["head"], mass=Prior(mass), inertia=mass * np.eye(3))
    words = f"element from a bench record; the mass of the head is chosen for {_HEAD_HZ:g} Hz on it and was not measured"
    # the weight of the heavy body is none: the element carried the mean force of the record
    mounts = {
        name: dataclasses.replace(
            mount, seen={axis: dataclasses.replace(s, preload=(preload, preload)) for axis, s in mount.seen.items()}
        )
        for name, mount in vehicle.mounts.items()
    }
    return dataclasses.replace(vehicle, bodies={"head": head}, mounts=mounts, sensors={}, description=words)
