# Copyright 2026 ride_estimation contributors
"""Time-domain identification of the modified Berg model: variable projection against the published method class.

Published method class (document 003 eq. (25), (26)): the force is simulated by a Python loop (Runge-Kutta 4 for the Maxwell
cells, turning points for the friction), and all eight parameters are fitted by a trust-region least-squares search with finite
differences. It is an emulation of the class, not the authors' code. It runs twice, side by side: interpreted, about as fast as
the simulations of the document, and with the same loop compiled, as a present-day competitor would have it. All work on the same
record from the same start in the same process; thread CPU time is counted, compiling is not.

Run: ``python benchmarks/bench_identification.py [--quick]``
"""

from __future__ import annotations

import argparse
import functools
import math
import time
from collections.abc import Callable, Sequence

import numba
import numpy as np
from scipy.optimize import least_squares
from scipy.special import erfc

from ride_estimation.identification.bench.columns import fused_gram, numpy_gram
from ride_estimation.identification.bench.models import model_by_name
from ride_estimation.identification.bench.record import BenchRecord, check_record
from ride_estimation.identification.bench.time_domain import TimeDomainFit, fit_time_domain, prepare

# document 003 Table 3, modified Berg, time domain, in SI: ke1 ke3 k1 c1 k2 c2 f x2
TRUTH = np.array([127.1e3, -0.116e9, 6.285e3, 1.555e3, 20.0e3, 0.159e3, 81.73, 0.766e-3])
START = TRUTH * np.array([0.8, 0.5, 1.8, 0.6, 0.6, 1.7, 1.5, 0.6])


def stepped_chirp(step_s: float = 1e-3, duration_s: float = 200.0) -> tuple[np.ndarray, np.ndarray]:
    """Document 003 eq. (28), (29), Table 2, half periods of constant frequency; displacement in m."""
    t = np.arange(round(duration_s / step_s) + 1) * step_s
    amplitude = 0.02 + 0.5 * (10.0 - 0.02) * erfc((t - 135.48) / 32.26)
    x = np.zeros(t.size)
    begin, sign = 0.0, 1.0
    while begin < duration_s:
        f = (40.0 - 0.015) / math.sinh(0.056 * 200.0) * math.sinh(0.056 * begin) + 0.015
        part = (
            (t >= begin) & (t < begin + 0.5 / f)
            if f < 1.0
            else slice(math.ceil(begin / step_s - 1e-9), min(t.size, math.ceil((begin + 0.5 / f) / step_s - 1e-9)))
        )
        x[part] = sign * amplitude[part] * np.sin(2.0 * np.pi * f * (t[part] - begin))
        begin, sign = begin + 0.5 / f, -sign
    return t, x * 1e-3


def loop_force(p: np.ndarray, x: list[float], h: float) -> np.ndarray:
    """Simulate sample by sample in plain Python: RK4 for two Maxwell cells, turning-point recursion for friction."""
    ke1, ke3, k1, c1 = float(p[0]), float(p[1]), float(p[2]), float(p[3])
    k2, c2, f_max, x2 = float(p[4]), float(p[5]), float(p[6]), float(p[7])
    o1, o2 = k1 / c1, k2 / c2
    m1 = m2 = friction = anchor_force = 0.0
    anchor, before, direction = x[0], x[0], 0
    out = [ke1 * x[0] + ke3 * x[0] ** 3]
    for value in x[1:]:
        v = (value - before) / h
        a1 = k1 * v - o1 * m1
        b1 = k1 * v - o1 * (m1 + 0.5 * h * a1)
        g1 = k1 * v - o1 * (m1 + 0.5 * h * b1)
        d1 = k1 * v - o1 * (m1 + h * g1)
        m1 += h / 6.0 * (a1 + 2.0 * b1 + 2.0 * g1 + d1)
        a2 = k2 * v - o2 * m2
        b2 = k2 * v - o2 * (m2 + 0.5 * h * a2)
        g2 = k2 * v - o2 * (m2 + 0.5 * h * b2)
        d2 = k2 * v - o2 * (m2 + h * g2)
        m2 += h / 6.0 * (a2 + 2.0 * b2 + 2.0 * g2 + d2)
        new = 1 if v > 0.0 else -1 if v < 0.0 else direction
        if new != direction:
            anchor, anchor_force, direction = before, friction, new
        u = value - anchor
        if direction > 0:
            friction = anchor_force + u * (f_max - anchor_force) / (x2 * (1.0 - anchor_force / f_max) + u)
        elif direction < 0:
            friction = anchor_force + u * (f_max + anchor_force) / (x2 * (1.0 + anchor_force / f_max) - u)
        out.append(ke1 * value + ke3 * value**3 + m1 + m2 + friction)
        before = value
    return np.array(out)


def published_class(
    simulate: Callable[..., np.ndarray], x: Sequence[float] | np.ndarray, force: np.ndarray, h: float
) -> tuple[np.ndarray, float, int]:
    """Fit all parameters by trust-region least squares with finite differences; return values, cost, simulations."""
    count = 0

    def residual(scaled: np.ndarray) -> np.ndarray:
        nonlocal count
        count += 1
        return simulate(scaled * START, x, h) - force

    lower = np.array([0.1, -10.0, *([0.02] * 6)])
    upper = np.array([10.0, 10.0, *([50.0] * 6)])
    found = least_squares(residual, np.ones(8), bounds=(lower, upper), method="trf", x_scale=1.0, ftol=1e-9, xtol=1e-9)
    return found.x * START, 2.0 * found.cost, count


def parameter_covariance(fit: TimeDomainFit) -> np.ndarray:
    """Return the covariance of coefficients and theta from the Gram matrix of a fit: white noise of the residual's size."""
    size = fit.model.parameter_count
    gram = fit.result.gram[:size, :size].copy()
    scale = np.append(np.ones(fit.model.layout.linear), fit.coefficients[fit.model.sensitivities])
    gram *= scale[:, None] * scale
    norm = np.sqrt(np.diag(gram))
    return fit.residual_std**2 * np.linalg.inv(gram / np.outer(norm, norm)) / np.outer(norm, norm)


def _median_cpu(work: Callable[[], object], times: int = 15) -> float:
    spent = []
    for _ in range(times):
        begin = time.thread_time()
        work()
        spent.append(time.thread_time() - begin)
    return float(np.median(spent))


def main() -> None:
    """Run both arms and print the comparison."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--quick", action="store_true", help="skip the slow arm")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    t, x = stepped_chirp()
    clean = loop_force(TRUTH, x.tolist(), 1e-3)
    force = clean + 0.005 * np.abs(clean).max() * rng.standard_normal(clean.size)
    record = check_record(BenchRecord("chirp", t, x, force))
    model = model_by_name("modified_berg")
    theta, _ = model.searched(START)
    fit_time_domain(model, [prepare(record)], start=theta)
    results = {}
    for name, gram in (("fused kernel", fused_gram), ("numpy and scipy", numpy_gram)):
        spent = []
        for _ in range(15):
            begin = time.thread_time()
            fit = fit_time_domain(model, [prepare(record)], start=theta, gram=gram)
            spent.append(time.thread_time() - begin)
        results[name] = (float(np.median(spent)), fit)
        print(
            f"{name:<22}{1e3 * np.median(spent):9.2f} ms CPU, {fit.result.passes} passes, rms residual {fit.residual_std:.6f} N"
        )
    best = results["fused kernel"][1]
    # what any fit of this record does at least once: read it and find its branches, and evaluate the columns over it
    prepared = prepare(record)
    spent = {
        "preparing the record": _median_cpu(lambda: prepare(record)),
        "one pass over it": _median_cpu(
            lambda: fused_gram(model.layout, prepared.motion, best.theta, prepared.force, prepared.force.size)
        ),
    }
    print(", ".join(f"{name} {1e3 * value:.2f} ms" for name, value in spent.items()))
    print("error against truth [%]", np.round(100 * (best.values / TRUTH - 1), 3))
    least = sum(spent.values())
    good, spent = 0, []
    for _ in range(40):
        start = np.log([10 ** rng.uniform(-1, 3), 10 ** rng.uniform(-1, 3), 10 ** rng.uniform(-4.5, -2)])
        begin = time.thread_time()
        fit = fit_time_domain(model, [prepare(record)], start=start)
        spent.append(time.thread_time() - begin)
        good += abs(fit.result.cost / best.result.cost - 1.0) < 1e-7
    print(f"random starts that reach the optimum: {good}/40, {1e3 * np.median(spent):.1f} ms CPU each (median)")
    if options.quick:
        return
    jacobian = model.physical_jacobian(best.theta, best.coefficients)
    deviation = np.sqrt(np.diag(jacobian @ parameter_covariance(best) @ jacobian.T))
    compiled = numba.njit(loop_force)
    compiled(TRUTH, x[:10], 1e-3)
    for name, simulate, path, times in (("compiled", compiled, x, 5), ("interpreted", loop_force, x.tolist(), 1)):
        values, cost, simulations = published_class(simulate, path, force, 1e-3)
        slow = _median_cpu(functools.partial(published_class, simulate, path, force, 1e-3), times)
        print(
            f"published class, {name:<12}{1e3 * slow:9.0f} ms CPU, {simulations} simulations, "
            f"rms residual {math.sqrt(cost / x.size):.6f} N"
        )
        print("  difference of the optima [standard deviations]", np.round((best.values - values) / deviation, 5))
        print(f"  cost of ours over theirs, less one: {best.result.cost / cost - 1.0:.1e}")
        for ours, (fast, _) in results.items():
            print(f"  ratio to {ours}: {slow / fast:.0f}")
        print(f"  ratio to one preparation and one pass, no search at all: {slow / least:.0f}")
        print(
            f"  a ratio of 100 leaves {1e3 * (slow / 100.0 - least):.2f} ms for the search on means, "
            f"which takes {1e3 * (results['fused kernel'][0] - least):.2f} ms"
        )


if __name__ == "__main__":
    main()
