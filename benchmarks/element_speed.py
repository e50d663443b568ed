# Copyright 2026 ride_estimation contributors
"""Cost of the modified Berg force: one million samples, compiled kernel and numpy/scipy path, and all axes of a cab.

Run: ``python benchmarks/element_speed.py``. Times are processor time of this thread, the best of several runs after warm-up, so
other load on the machine matters little.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from ride_estimation.elements import terms as kernel
from ride_estimation.elements import vectorised
from ride_estimation.elements.modified_berg import ModifiedBerg
from ride_estimation.excitation.programmes import band_limited_random
from ride_estimation.excitation.sigmoid_chirp import SigmoidChirp
from ride_estimation.jit import COMPILED

SAMPLES = 1_000_000
RATE_HZ = 1000.0
AXES = 36  # 12 mounts of three axes


def best_ms(task: Callable[[], object], runs: int = 9) -> float:
    """Return the least processor time of a task [ms]."""
    task()
    times = []
    for _ in range(runs):
        start = time.thread_time()
        task()
        times.append(time.thread_time() - start)
    return 1e3 * min(times)


def main() -> None:
    element = ModifiedBerg.example()
    terms = element.terms()
    codes, params = kernel.pack_terms(terms)
    h = 1.0 / RATE_HZ
    t = np.arange(SAMPLES) * h
    signals = {
        "sigmoid chirp, repeated": np.tile(SigmoidChirp().signal(RATE_HZ)[1][:-1], 5)[:SAMPLES],
        "random 1-30 Hz": band_limited_random(0.25e-3, 1.0, 30.0, SAMPLES * h, RATE_HZ, seed=1)[1],
    }
    print(f"modified Berg force, {SAMPLES} samples, processor time [ms]")
    still = np.zeros(SAMPLES)
    for name, x in signals.items():
        numpy_ms = best_ms(lambda x=x: vectorised.response(terms, x, still, h), runs=3)
        print(f"{name}: {vectorised.reversals(x).size} reversals")
        print(f"  numpy and scipy                     {numpy_ms:8.1f}")
        if COMPILED:
            kernel_ms = best_ms(lambda x=x: kernel.response(codes, params, x, still, h))
            checked_ms = best_ms(lambda x=x: element.response(t, x))
            print(f"  compiled kernel                     {kernel_ms:8.1f}")
            print(f"  element.response (input is checked) {checked_ms:8.1f}")
            print(f"  numpy over kernel                   {numpy_ms / kernel_ms:8.1f}")
    if COMPILED:
        all_codes, all_params = kernel.pack_terms(terms * AXES)
        states, channel = kernel.initial_states(all_codes, all_params), np.repeat(np.arange(AXES), len(terms))
        x, v, force = np.full(AXES, 1e-4), np.zeros(AXES), np.zeros(AXES)

        def thousand_steps() -> None:
            for k in range(1000):
                x[0] = 1e-4 * (k % 7)
                kernel.network_commit(all_codes, all_params, states, channel, x, v, h, force)

        print(f"one step of {AXES} axes, called from Python: {best_ms(thousand_steps):.2f} us")


if __name__ == "__main__":
    main()
