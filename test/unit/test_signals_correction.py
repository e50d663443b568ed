# Copyright 2026 ride_estimation contributors
"""Known errors of a sensor: built in by the sensor model, put right by the aligner, live and offline alike."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from ride_estimation.errors import ConfigurationError
from ride_estimation.estimation.pipeline import Pipeline
from ride_estimation.io.vehicle_file import load_vehicle, save_vehicle, vehicle_from_mapping, vehicle_to_mapping
from ride_estimation.sensors.measurement import SensorErrors, draw_unit, measure
from ride_estimation.sensors.sensor import Sensor
from ride_estimation.signals.alignment import StampAligner, StreamSpec, align
from ride_estimation.signals.corrected_run import corrected_run
from ride_estimation.signals.correction import Correction
from ride_estimation.signals.recording import Channel, Recording, UniformRun

RATE = 200.0
#: late by 11 ms, z reads 8 % too much, offsets on all axes
KNOWN = Correction(0.011, (1.0, 0.95, 1.08), (0.2, 0.0, -0.4))


def truth(time):
    """Return three channels of tones up to 12 Hz [m/s^2]."""
    tones = [(1.3, 0.8), (4.7, 1.1), (11.9, 0.6)]
    return np.stack([sum(a * np.sin(2 * np.pi * f * time + p + a) for f, a in tones) for p in (0.0, 1.0, 2.0)], axis=1)


def test_the_sensor_model_builds_in_what_alignment_puts_right():
    fine = 4000.0
    ideal = truth(np.arange(0.0, 8.0, 1.0 / fine))
    errors = SensorErrors(rate=RATE, anti_alias=0.0, latency=0.0, synchronous=True)
    channels = {}
    for name, correction in (("good", Correction()), ("known", KNOWN)):
        sensor = Sensor(name, "accelerometer", f"/{name}", "cab", noise_std=1e-6, correction=correction)
        generator = np.random.default_rng(3)
        unit = draw_unit(sensor, errors, generator)
        time = np.arange(0.05, 7.9, 1.0 / RATE)
        channels[name] = measure(sensor, ideal, fine, time, errors, unit, (), generator, 1_000_000_000)
    late = channels["known"]
    # the reading by its definition: the true value 11 ms earlier, times the gain, plus the bias
    expected = truth(late.stamp_ns * 1e-9 - 1.0 - 0.011) * np.array(KNOWN.gain) + np.array(KNOWN.bias)
    assert late.values == pytest.approx(expected, abs=1e-4)  # noise 1e-6, spline through 4 kHz
    run = align(Recording("r", channels), RATE)
    good, known = run.data["good"], run.data["known"]
    inner = slice(20, -20)
    # cubic through four samples at 200 Hz: (pi f / rate)^4 / 4 of a 12 Hz tone of 0.6
    assert known[inner] == pytest.approx(good[inner], abs=1e-3)
    assert run.corrections == {"known": KNOWN}


def test_live_and_offline_correct_alike():
    vehicle = load_vehicle("config/vehicles/truck_cab.yaml")
    name = next(n for n, s in vehicle.sensors.items() if s.body == "cab")
    sensors = {**vehicle.sensors, name: dataclasses.replace(vehicle.sensors[name], correction=KNOWN)}
    vehicle = dataclasses.replace(vehicle, sensors=sensors)
    rng = np.random.default_rng(1)
    stamps = 1_000_000_000 + np.arange(600, dtype=np.int64) * 5_000_000
    channels = {}
    for s in vehicle.sensors.values():
        values = 0.3 * rng.standard_normal((len(stamps), s.channels)) + np.array([0.0, 0.0, 9.81])[: s.channels]
        channels[s.name] = Channel(s.name, stamps, values, stamps, correction=s.correction)
    recording = Recording("r", channels)
    run = align(recording, RATE)
    pipeline = Pipeline(vehicle)
    blocks = []
    names = list(channels)
    for index, stamp, values, _ in recording.in_order():
        blocks += pipeline.observe(names[index], stamp, values, None)
    blocks += pipeline.finish()
    live = {int(t): v for b in blocks for t, v in zip(b.stamp_ns, b.measured[name])}
    ticks = run.start_ns + np.arange(run.samples) * 5_000_000
    common = [i for i, t in enumerate(ticks) if int(t) in live]
    assert len(common) > 500
    # the same aligner code: the same bits
    assert np.array_equal(run.data[name][common], np.array([live[int(ticks[i])] for i in common]))


def test_corrections_found_one_after_the_other_make_one():
    rng = np.random.default_rng(2)
    true = rng.standard_normal((50, 3))
    found = Correction(0.002, (1.1, 1.0, 0.9), (0.0, 0.3, 0.0))
    raw = KNOWN.reading(found.reading(true))
    both = KNOWN.and_then(found, 3)
    assert both.apply(raw) == pytest.approx(true, abs=1e-12)  # rounding
    assert both.delay == pytest.approx(0.013)


def test_a_run_states_its_corrections_and_they_are_applied_once():
    time = np.arange(0.0, 10.0, 1.0 / RATE)
    raw = KNOWN.reading(truth(time - KNOWN.delay))
    run = UniformRun("r", RATE, 0, {"a": raw}, {"a": np.ones(len(raw), dtype=bool)})
    once = corrected_run(run, {"a": KNOWN})
    twice = corrected_run(once, {"a": KNOWN})
    inner = once.valid["a"]
    assert np.count_nonzero(~inner) == 3  # 11 ms at the end are not there
    assert once.data["a"][50:-50] == pytest.approx(truth(time)[50:-50], abs=1e-3)  # cubic spline at 200 Hz, 12 Hz tone
    assert np.array_equal(once.data["a"], twice.data["a"])


def test_a_stated_variance_becomes_that_of_the_corrected_values():
    aligner = StampAligner([StreamSpec("a", 3, correction=KNOWN), StreamSpec("b", 3)])
    for index in (0, 1):
        aligner.push(index, 1_000_000_000, (0.0, 0.0, 9.81), (0.01, 0.01, 0.01))
    assert aligner.variance(0) == pytest.approx([0.01, 0.01 / 0.95**2, 0.01 / 1.08**2])
    assert aligner.variance(1) == (0.01, 0.01, 0.01)


def test_the_range_follows_gain_and_bias():
    correction = Correction(0.0, (1.0, 1.0, 2.0), (0.0, 0.0, 4.0))
    sensor = Sensor("a", "accelerometer", "/a", "cab", full_scale=20.0, correction=correction)
    assert sensor.reach == pytest.approx((20.0 - 4.0) / 2.0)
    assert Sensor("a", "accelerometer", "/a", "cab", full_scale=20.0).reach == 20.0


def test_corrections_survive_the_vehicle_file(tmp_path):
    vehicle = load_vehicle("config/vehicles/truck_cab_transducers.yaml")
    names = list(vehicle.sensors)
    transducer = next(n for n in names if vehicle.sensors[n].kind == "displacement")
    own = {names[0]: KNOWN, transducer: Correction(-0.004, (1.02,), (0.001,))}
    sensors = {n: dataclasses.replace(s, correction=own.get(n, s.correction)) for n, s in vehicle.sensors.items()}
    save_vehicle(dataclasses.replace(vehicle, sensors=sensors), tmp_path / "v.yaml")
    again = load_vehicle(tmp_path / "v.yaml")
    assert {n: s.correction for n, s in again.sensors.items() if not s.correction.empty} == own


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("delay_s", 0.4, "outside -0.25 to 0.25 s"),
        ("delay", 0.1, "no unit in the key"),
        ("gain", 0.0, "outside 0.1 to 10"),
        ("gain", [1.0, 2.0], "not a finite number or a list of 3"),
        ("gain", "much", "not a finite number"),
        ("bias_m_per_s2", [0.0, 0.0, 90.0], "outside -50 to 50"),
        ("bias_m", 0.1, "allowed: bias_m_per_s2"),
    ],
)
def test_wrong_corrections_are_refused_by_name(key, value, said):
    document = vehicle_to_mapping(load_vehicle("config/vehicles/truck_cab.yaml"))
    document["sensors"]["cab_front_left"][key] = value
    with pytest.raises(ConfigurationError) as caught:
        vehicle_from_mapping(document)
    assert said in str(caught.value)
    assert "cab_front_left" in str(caught.value)


def test_units_of_the_file_are_converted():
    document = vehicle_to_mapping(load_vehicle("config/vehicles/truck_cab.yaml"))
    document["sensors"]["cab_front_left"].update({"delay_ms": 3.0, "gain": 1.05, "bias_g": 0.01})
    correction = vehicle_from_mapping(document).sensors["cab_front_left"].correction
    assert correction.delay == pytest.approx(0.003)
    assert correction.gain == (1.05, 1.05, 1.05)
    assert correction.bias == pytest.approx((0.0980665,) * 3)
