# Copyright 2026 ride_estimation contributors
"""``ride-estimation procedure``: the bench and yard procedures of documents 000 and 001 on recorded tables."""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path

import numpy as np

from ride_estimation.assessment import ride_comfort, seat
from ride_estimation.cli.finite import require_finite
from ride_estimation.cli.run_procedures import RUN_PROCEDURES, uniform_rate, write_columns
from ride_estimation.errors import InputDataError
from ride_estimation.identification import free_decay, hysteresis_loop, leaf_spring, modal_stiffness, static_tests, voigt_limits
from ride_estimation.io.atomic import write_atomically
from ride_estimation.io.results import output_folder
from ride_estimation.io.tables import Table, read_table
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.signals import integration
from ride_estimation.signals.smoothing import fourth_order_rate, gauss_smooth
from ride_estimation.signals.spectra import label_peaks, welch_spectrum
from ride_estimation.vehicles.assembly import assemble
from ride_estimation.vehicles.modes import linearise, modes, undamped_modes
from ride_estimation.vehicles.vehicle import Vehicle


def run(options: argparse.Namespace) -> int:
    """Run the chosen procedure."""
    require_finite(options)
    PROCEDURES[options.procedure](options)
    return 0


def _loop(options: argparse.Namespace) -> None:
    if len(options.files) != len(options.frequency):
        raise InputDataError(f"{len(options.files)} files but {len(options.frequency)} frequencies are given")
    loops = []
    for path, frequency in zip(options.files, options.frequency):
        if frequency <= 0.0:
            raise InputDataError(f"--frequency {frequency:g}: allowed are frequencies above 0 Hz")
        table = read_table(path)
        uniform_rate(table)
        time_s, displacement, force = table.column("time"), table.column("displacement", "m"), table.column("force", "N")
        loops.append(hysteresis_loop.analyse_loop(time_s, displacement, force, frequency))
        r = loops[-1]
        print(
            f"{path.name}: {frequency:g} Hz, {1000 * r.amplitude:.3g} mm, {r.wave}: stiffness {r.stiffness:.5g} N/m, "
            f"equivalent damping {r.damping:.4g} N s/m, loss {r.loss_energy:.4g} J a cycle"
        )
        named = ", ".join(f"{name.replace('_', ' ')} {k:.5g}" for name, k in r.by_definition.items())
        print(f"  dynamic stiffness K = |K*| by definition [N/m]: {named}")
        if r.stiffness <= 0.0 or r.loss_energy <= 0.0:
            print("warning: a spring that pushes the wrong way, or a loop that gives energy: sign of force or displacement?")
    warning = hysteresis_loop.viscous_check(loops)
    if warning:
        print(f"warning: {warning}")


def _lift(options: argparse.Namespace) -> None:
    table = read_table(options.file)
    if (options.lift_arm_m is None) != (options.axle_arm_m is None):
        raise InputDataError("--lift-arm-m and --axle-arm-m belong together: they make the load of the axle of the lifting force")
    if options.lift_arm_m is None:
        unloading = table.column("unloading", "N")
    else:
        unloading = table.column("lift", "N") * static_tests.lifting_load(1.0, options.lift_arm_m, options.axle_arm_m)
    result = static_tests.tyre_stiffness_from_lift(unloading, table.column("rise", "m"), options.tyres)
    print(f"tyre stiffness {result.stiffness:.5g} +- {result.std:.2g} N/m per tyre, scatter {result.residual_rms:.3g} N")


def _axles(options: argparse.Namespace) -> None:
    front, rear = static_tests.axle_loads(options.weight_n, options.cg_from_rear_m, options.wheelbase_m)
    print(f"front axle {front:.6g} N, rear axle {rear:.6g} N")


def _drop(options: argparse.Namespace) -> None:
    table = read_table(options.file)
    rate = uniform_rate(table)
    names = [n for n in table.columns if n != "time"]
    if len(names) != 1:
        raise InputDataError(f"{options.file}: one column beside time is needed; it has {', '.join(names)}")
    decay = free_decay.analyse_decay(table.column(names[0]), rate)
    mass = free_decay.effective_mass(options.pivot_inertia_kg_m2, options.arm_m)
    damping = free_decay.damping_constant(decay.damping_ratio, options.stiffness_n_per_m, mass)
    print(
        f"damping ratio {decay.damping_ratio:.4g} at {decay.frequency_hz:.4g} Hz from {decay.peaks} half cycles; effective mass "
        f"{mass:.5g} kg (inertia about the pivot over arm squared); damping {damping:.4g} N s/m"
    )
    if decay.spread > 0.2:
        print(f"warning: the decrement varies by {100 * decay.spread:.0f} %: the decay is not exponential (friction?)")


def _leaf(options: argparse.Namespace) -> None:
    geometry = (options.span_m, options.width_m, options.thickness_m)
    if options.force_n is not None and options.deflection_m is not None:
        rate = leaf_spring.rate_from_load(options.force_n, options.deflection_m)
    elif all(v is not None for v in geometry):
        rate = leaf_spring.semi_elliptic_rate(*geometry, leaves=options.leaves)
    else:
        raise InputDataError("give --span-m, --width-m and --thickness-m, or --force-n and --deflection-m")
    spread = f" +- {100.0 * rate.std / rate.value:.2g} %" if rate.std else ""
    print(f"spring rate {rate.value:.6g}{spread} N/m ({rate.source}); quarter-car --spring-rate-n-per-m holds it")


def _velocity(options: argparse.Namespace) -> None:
    table = read_table(options.file)
    rate = uniform_rate(table)
    if options.of_displacement:
        _rate_of_displacement(options, table, rate)
        return
    acceleration = table.column(options.column, "m/s^2")
    found = integration.acceleration_to_velocity(acceleration, rate, options.corner_hz)
    duration = acceleration.size / rate
    drift = integration.velocity_drift(options.noise_m_per_s2, rate, duration)
    write_columns(options.out, ["time_s", "velocity_m_per_s"], table.column("time"), found)
    print(
        f"offset {acceleration.mean():.4g} m/s^2 removed: left in, it would drift to "
        f"{abs(acceleration.mean()) * duration:.3g} m/s in {duration:.4g} s, the noise alone to {drift:.3g} m/s; "
        f"high-pass {options.corner_hz:g} Hz without phase"
    )
    print(f"{options.out}: velocity {np.std(found):.4g} m/s rms; filter every signal it is compared with alike")


def _rate_of_displacement(options: argparse.Namespace, table: Table, rate: float) -> None:
    """Differentiate a measured displacement as document 004 does: Gauss kernel, then the difference of fourth order."""
    displacement, sd_s = table.column(options.column, "m"), 1e-3 * options.kernel_ms
    smooth = gauss_smooth(displacement, rate, sd_s)
    found = fourth_order_rate(smooth, 1.0 / rate)
    write_columns(options.out, ["time_s", "velocity_m_per_s"], table.column("time"), found)
    at_half = math.sqrt(2.0 * math.log(2.0)) / (2.0 * math.pi * sd_s)
    print(
        f"{options.out}: velocity {np.std(found):.4g} m/s rms; the Gauss kernel of {options.kernel_ms:g} ms halves {at_half:.3g} "
        f"Hz and moves the displacement by up to {1e3 * float(np.abs(displacement - smooth).max()):.3g} mm: take the rate from "
        "it, the displacement as measured"
    )


def _seat(options: argparse.Namespace) -> None:
    table = read_table(options.file)
    rate = uniform_rate(table)
    values = table.column(options.column, "m/s^2")
    times = seat.separation_times(values, rate)
    if times:
        listed = ", ".join(f"{t:.2f}" for t in times[:10]) + (" ..." if len(times) > 10 else "")
        print(f"warning: the occupant left the seat {len(times)} times (at {listed} s); the pad then measures only itself")
    else:
        print("the occupant never left the seat (vertical acceleration stays above -1 g)")
    still = np.zeros_like(values)
    day = ride_comfort.EXPOSURE_REFERENCE_S
    vertical = ride_comfort.assess(np.column_stack([still, still, values]), rate, day, "seat").axes[2]
    print(
        f"vertical axis, Wk: a_w {vertical.weighted_rms:.3g} m/s^2 (its A(8) after 8 h a day), VDV {vertical.vibration_dose:.3g} "
        f"m/s^1.75 of this record, crest factor {vertical.crest_factor:.3g}; the exposure takes the worst of three axes"
    )
    if options.standstill is not None:
        rest = read_table(options.standstill).column(options.column, "m/s^2")
        ratio = seat.signal_to_noise_db(values, rest)
        print(f"signal to noise {ratio:.1f} dB, a ratio of {10 ** (ratio / 20):.4g} (stand-still {np.std(rest):.3g} m/s^2 rms)")


def _peaks(options: argparse.Namespace) -> None:
    table = read_table(options.file)
    rate = uniform_rate(table)
    natural = list(options.modes_hz)
    if options.vehicle is not None:
        natural += [m.frequency_hz for m in undamped_modes(linearise(assemble(load_vehicle(options.vehicle))))]
    if not natural:
        raise InputDataError("give --vehicle or --modes-hz: without natural frequencies no peak is known to be a mode")
    spectra = [welch_spectrum(table.column(n), rate, options.block) for n in (options.output, options.input)]
    print(spectra[0].describe())
    found = label_peaks(spectra[0], spectra[1], natural)
    for peak in found:
        print(f"  {peak.frequency_hz:8.3f} Hz  {peak.label:<12}{peak.explained_by}")
    if not found:
        print("  no peak above its neighbourhood")


def _spectrum(options: argparse.Namespace) -> None:
    table = read_table(options.file)
    rate = uniform_rate(table)
    values = table.column(options.column)
    unit = table.units[options.column]
    spectrum = welch_spectrum(values, rate, options.block, options.claimed_resolution_hz)
    print(f"{spectrum.describe()}")
    strongest = spectrum.density[1:].argsort()[::-1][:5] + 1
    for index in sorted(strongest.tolist()):
        print(f"  {spectrum.frequency_hz[index]:8.3f} Hz  {spectrum.density[index]:.4g} {f'({unit})^2/Hz' if unit else 'per Hz'}")


def _modes(options: argparse.Namespace) -> None:
    vehicle = load_vehicle(options.vehicle)
    if options.matrices is not None:
        _matrices(vehicle, options.matrices)
    if not options.measured:
        if options.front_rear:
            raise InputDataError("--front-rear fits stiffness to modes: give --measured")
        _list_modes(vehicle)
        if options.closed_form:
            _closed_form(vehicle, {})
        return
    measured = {}
    for item in options.measured:
        name, _, value = item.partition("=")
        try:
            measured[name] = float(value)
        except ValueError as error:
            raise InputDataError(f"--measured {item!r}: give MODE=HZ, for example bounce=2.6") from error
    fit = modal_stiffness.fit_stiffness(vehicle, measured, front_rear=options.front_rear)
    for group, factor in fit.factors.items():
        unchanged = "as in the vehicle file: these modes do not depend on it"
        place = "about" if group in ("roll", "pitch", "yaw") else "along"
        print(
            f"stiffness {place} {group}: {unchanged if group in fit.not_identifiable else f'{factor:.3g} times the vehicle file'}"
        )
    print(f"{'mode':<10}{'measured Hz':>14}{'model Hz':>12}{'error %':>10}")
    for row in fit.modes:
        print(f"{row.name:<10}{row.measured_hz:>14.4g}{row.model_hz:>12.4g}{row.error_percent:>+10.1f}")
    print(fit.statement)
    if options.closed_form:
        _closed_form(vehicle, measured)
    for row in fit.modes:
        if abs(row.error_percent) > 1.0:
            print(static_tests.stiffness_ratio(row.model_hz, row.measured_hz))


def _list_modes(vehicle: Vehicle) -> None:
    """Print the modes of the vehicle file, gravity and coupling included."""
    print(f"{'mode':<24}{'Hz':>10}{'damping ratio':>16}")
    for mode in modes(linearise(assemble(vehicle))):
        print(f"{mode.words:<24}{mode.frequency_hz:>10.4g}{mode.damping_ratio:>16.3g}")


def _matrices(vehicle: Vehicle, path: Path) -> None:
    """Write the state space of the linear vehicle with the name of every state and input: their order is a convention."""
    model = linearise(assemble(vehicle))
    a, b = model.state_space()
    states = [f"{body}.{coordinate}" for body, coordinate in model.assembly.coordinates]
    inputs = [f"{mount}.{axis}" for mount, axis in model.assembly.components]
    driven = np.flatnonzero(np.tile(model.assembly.prescribed, 2))
    names = [*(f"{name}.displacement" for name in inputs), *(f"{name}.velocity" for name in inputs)]
    document = {
        "states": [*(f"{name}.displacement" for name in states), *(f"{name}.velocity" for name in states)],
        "inputs": [names[i] for i in driven], "A": a.tolist(), "B": b[:, driven].tolist(),
    }  # fmt: skip
    output_folder(path.parent)
    write_atomically(path, json.dumps(document, indent=1))
    print(f"{path}: x' = A x + B u, {len(a)} states, {len(driven)} inputs (motion of the bases), each named; SI and rad")


def _closed_form(vehicle: Vehicle, measured: dict[str, float]) -> None:
    """Print the closed-form modes of the vehicle file and what a translational mode makes of the stiffness of each mount."""
    closed = modal_stiffness.closed_form_modes(vehicle)
    listed = ", ".join(f"{name} {frequency:.4g}" for name, frequency in closed.frequency_hz.items())
    print(f"closed form of the vehicle file, uncoupled [Hz]: {listed}")
    for limitation in closed.limitations:
        print(f"warning: the closed form does not hold: {limitation}")
    (body,) = vehicle.bodies.values()
    for name in set(measured) & {"fore-aft", "lateral", "bounce"}:
        rate = modal_stiffness.equivalent_stiffness(measured[name], body.mass.value, len(vehicle.mounts))
        print(f"closed form, {name} at {measured[name]:g} Hz: {rate:.4g} N/m a mount")


def _limits(options: argparse.Namespace) -> None:
    rows = voigt_limits.voigt_limits(load_vehicle(options.vehicle), options.tuned_hz, options.amplitude_mm * 1e-3)
    print(f"mounts replaced by the spring and damper that equal them at {options.tuned_hz:g} Hz, {options.amplitude_mm:g} mm")
    print(f"{'resonance':<16}{'Hz':>10}{'mounts m/m':>14}{'Voigt m/m':>12}{'error %':>10}")
    for row in rows:
        print(f"{row.label:<16}{row.frequency_hz:>10.4g}{row.height:>14.4g}{row.voigt_height:>12.4g}{row.error_percent:>+10.1f}")


PROCEDURES = {
    "loop": _loop,
    "tyre-lift": _lift,
    "axle-loads": _axles,
    "drop-test": _drop,
    "leaf-spring": _leaf,
    "velocity": _velocity,
    "seat": _seat,
    "peaks": _peaks,
    "spectrum": _spectrum,
    "modes": _modes,
    "voigt-limits": _limits,
    **RUN_PROCEDURES,
}
