# Copyright 2026 ride_estimation contributors
"""Speed of the vehicle simulation: one million steps of the cab on four three-axis modified Berg mounts, side by side.

Run: ``python benchmarks/simulation_speed.py``. CPU time of one thread, after warm-up. The scipy and MuJoCo columns solve the
cab with Kelvin-Voigt mounts (the simplest law; neither has rubber), scaled to the same simulated time. scipy's figure
includes evaluating the base spline; MuJoCo carries the four driven base bodies too (twelve more coordinates).
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
from scipy import signal
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "test" / "reference"))

from ride_estimation.elements.modified_berg import ModifiedBerg  # noqa: E402
from ride_estimation.io.vehicle_file import load_vehicle  # noqa: E402
from ride_estimation.simulation.base_motion import BaseMotion  # noqa: E402
from ride_estimation.simulation.simulate import CompiledModel, simulate  # noqa: E402
from ride_estimation.vehicles.assembly import assemble  # noqa: E402
from ride_estimation.vehicles.modes import linearise  # noqa: E402

RATE = 1000.0


def base_motion(samples: int, rate: float = RATE, seed: int = 1) -> BaseMotion:
    """Return band-limited random motion of four mount bases."""
    noise = np.random.default_rng(seed).standard_normal((samples, 4, 3))
    sos = signal.butter(2, [0.5, 20.0], "bandpass", fs=rate, output="sos")
    return BaseMotion.from_displacement(0.01 * signal.sosfilt(sos, noise, axis=0), rate)


def cpu(function, *arguments, **options):
    """Return CPU seconds of one call."""
    begin = time.process_time()
    function(*arguments, **options)
    return time.process_time() - begin


def rubber(stiffness: float) -> ModifiedBerg:
    """Return a modified Berg mount of about the given stiffness."""
    return ModifiedBerg(0.7 * stiffness, 1e8, 0.3 * stiffness, 0.3 * stiffness / 12.6, 0.3 * stiffness,
                        0.3 * stiffness / 126.0, 100.0, 1e-3, 0.0)


def scipy_seconds(assembly, base: BaseMotion) -> float:
    """Return CPU seconds of solve_ivp (RK45, rtol 1e-6) on the linear cab."""
    a, b = linearise(assembly).state_space()
    mount, axis = assembly.component_index()
    spline = CubicHermiteSpline(base.time_s, base.displacement[:, mount, axis], base.velocity[:, mount, axis])
    rate = spline.derivative()

    def slope(t, state):
        return a @ state + b @ np.concatenate([spline(t), rate(t)])

    return cpu(solve_ivp, slope, (0.0, base.time_s[-1]), np.zeros(12), rtol=1e-6, atol=1e-8, max_step=0.01)


def main() -> None:
    """Print the table."""
    assembly = assemble(load_vehicle(ROOT / "config" / "vehicles" / "truck_cab.yaml"))
    stiffness = {c: e.stiffness for c, e in zip(assembly.components, assembly.elements)}
    mounts = {c: rubber(k) for c, k in stiffness.items()}
    short = base_motion(2000)
    CompiledModel(assembly, short, substeps=1).run_raw(mounts)
    simulate(assembly, short, full_rotation=True)
    blocks, each = 10, 100_000
    model = CompiledModel(assembly, base_motion(each), substeps=1)
    rubber_s = sum(cpu(model.run_raw, mounts) for _ in range(blocks))
    voigt_s = sum(cpu(model.run_raw) for _ in range(blocks))
    exact = base_motion(each)
    rotation_s = blocks * cpu(simulate, assembly, exact, full_rotation=True, substeps=1)
    minute = CompiledModel(assembly, base_motion(12_000, 200.0))
    again_s = min(cpu(minute.run_raw, mounts) for _ in range(5))
    simulated = blocks * each / RATE
    print(f"{'1 000 000 steps of 1 ms, 6-DOF cab':58s} CPU s   us/step")
    for name, seconds in (
        ("12 modified Berg axes, small rotations", rubber_s),
        ("12 Kelvin-Voigt axes, small rotations", voigt_s),
        ("12 Kelvin-Voigt axes, full rotation", rotation_s),
    ):
        print(f"{name:58s} {seconds:6.2f}  {1e6 * seconds / (blocks * each):6.2f}")
    print(f"60 s at 200 Hz again with changed modified Berg mounts ({minute.substeps} substep): {1e3 * again_s:.1f} ms")
    reference = base_motion(10_000)
    theirs = scipy_seconds(assembly, reference) / (len(reference.displacement) / RATE) * simulated
    print(f"scipy solve_ivp RK45 rtol 1e-6, Kelvin-Voigt: {theirs:.0f} s for the same time, {theirs / voigt_s:.0f} times ours")
    try:
        import mujoco_cab
    except ImportError:
        print("MuJoCo is not installed: no comparison")
        return
    import mujoco

    plant = mujoco_cab.cab_model(assembly.vehicle, assembly.static_force, 1.0 / RATE)
    data = mujoco.MjData(plant)

    def steps() -> None:
        mujoco.mj_step(plant, data, nstep=20_000)

    steps()
    other = cpu(steps) * blocks * each / 20_000
    print(f"MuJoCo RK4, Kelvin-Voigt by tendons, full rotation: {other:.1f} s, {other / rotation_s:.1f} times ours")


if __name__ == "__main__":
    main()
