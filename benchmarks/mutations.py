# Copyright 2026 ride_estimation contributors
"""Break one line of the estimator's uncertainty logic at a time and see whether the fast tests notice.

    python benchmarks/mutations.py                    # all; prints which tests fail for each
    python benchmarks/mutations.py --only 3 7

Every mutation is put into a copy of the repository and the fast tests of the estimator run on it until one fails. Prints a line
per mutation and the sum; ends with 1 if a mutation survives. The unchanged copy has to pass first.
"""

from __future__ import annotations

import argparse
import dataclasses
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[1]
COPIED = (
    "ride_estimation",
    "test",
    "bags",
    "config",
    "benchmarks",
    "launch",
    "pyproject.toml",
    "setup.cfg",
    "setup.py",
    "package.xml",
)
#: what is run, until a test fails: fast tests of covariances first, then those of the whole estimator
TESTS = (
    "test/unit/test_estimation_force_covariance.py",
    "test/unit/test_estimation_residual_covariance.py",
    "test/unit/test_estimation_motion.py",
    "test/unit/test_estimation_interval.py",
    "test/unit/test_estimation_file_uncertainty.py",
    "test/unit/test_estimation_*.py",
    "test/unit/test_smoothed_forces.py",
    "test/metamorphic/test_metamorphic_estimator.py",
)


@dataclasses.dataclass(frozen=True)
class Mutation:
    """A line of a file of ``ride_estimation/estimation``, what is put in its place, and what is lost by it."""

    file: str
    line: str
    instead: str
    loses: str


MUTATIONS = (
    Mutation(
        "motion/cg_motion.py", "covariance[0, 0] += g**2 * block.pitch_variance", "pass",
        "uncertain tilt in the CG acceleration",
    ),
    Mutation(
        "motion/cg_motion.py", "return weights.covariance + self._rate_contribution(weights, rate, use_gyro)",
        "return weights.covariance", "uncertain angular rate in the CG motion",
    ),
    Mutation(
        "motion/residual_covariance.py", "return factor, bias * (weights @ weights.T)",
        "return 1.0, bias * (weights @ weights.T)", "residuals larger than the stated noise",
    ),
    Mutation(
        "motion/residual_covariance.py", "return factor, bias * (weights @ weights.T)",
        "return factor, 0.0 * (weights @ weights.T)", "biases of the sensors in the motion",
    ),
    Mutation(
        "motion/loads.py", "spread = np.array([self.mass_std**2, self.inertia_relative_std**2])",
        "spread = np.array([self.mass_std**2, 0.0])", "uncertain inertia in the loads",
    ),
    Mutation(
        "motion/loads.py", "variance = self.cg_std**2", "variance = 0.0 * self.cg_std", "uncertain CG in the loads",
    ),
    Mutation(
        "forces/mount_forces.py", "variance = (k * deflection.std) ** 2 + (c * deflection.rate_std) ** 2 + parameters",
        "variance = parameters", "uncertain deflections in the forces without measured bases",
    ),
    Mutation(
        "forces/mount_forces.py",
        'return np.asarray(k[:, None] * value * k + c[:, None] * rate * c + np.diag(parameters.ravel()))',
        "return np.asarray(k[:, None] * value * k + c[:, None] * rate * c)", "uncertain stiffness and damping in the forces",
    ),
    Mutation(
        "forces/mount_forces.py",
        'return np.asarray(k[:, None] * value * k + c[:, None] * rate * c + np.diag(parameters.ravel()))',
        "return np.asarray(np.diag(parameters.ravel()))", "uncertain deflections in the forces",
    ),
    Mutation(
        "forces/mount_forces.py", 'left = np.einsum("ij,jk,ik->i", rest, model, rest) + self._static_variance()',
        'left = np.einsum("ij,jk,ik->i", rest, model, rest)', "unknown split of the static loads",
    ),
    Mutation(
        "forces/mount_forces.py", 'determined = np.einsum("ij,jk,ik->i", gain, load, gain)', "determined = np.zeros(3 * count)",
        "uncertain loads of the body in the forces",
    ),
    Mutation(
        "forces/mount_forces.py",
        'determined = determined + np.einsum("ij,jk,ik->i", self._gain_slow, constant, self._gain_slow)', "pass",
        "constant errors of the loads in the forces",
    ),
    Mutation(
        "forces/mount_forces.py",
        "determined = determined + self.mass_relative_std**2 * (self.static_force**2 + self._dynamic_square).ravel()", "pass",
        "uncertain mass in the forces",
    ),
    Mutation(
        "forces/mount_forces.py", "left += self._strain.ravel() ** 2", "pass", "a load at even odds in the forces",
    ),
    Mutation(
        "sensor_errors/lean.py", "std[self._at] = np.sqrt((share * shown) ** 2 + self._turned * (1.0 - share))", "pass",
        "turned base sensors in k and c",
    ),
    Mutation(
        "sensor_errors/installed_errors.py", "found[:, :, own + 1 :] = hidden.transpose(1, 2, 0)", "pass",
        "errors of the base sensors in k and c",
    ),
    Mutation(
        "forces/base_fill.py", "share = _UNKNOWN_SHARE * unknown", "share = 0.0 * unknown",
        "deflections where a base motion is a guess",
    ),
    Mutation(
        "parameters/parameter_filter.py", "self.std = self.memory.standard_deviation(ekf.p, self.theta)",
        "self.std = np.sqrt(np.diag(ekf.p))", "scatter of the intervals in the std of k and c",
    ),
    Mutation(
        "parameters/parameter_estimator.py",
        "considered = np.sqrt(self.std[mine] ** 2 + np.sum(moved**2, axis=1) + self._amplitude.std**2)",
        "considered = np.sqrt(self.std[mine] ** 2 + self._amplitude.std**2)", "uncertain CG in k and c",
    ),
    Mutation(
        "parameters/parameter_estimator.py",
        "considered = np.sqrt(self.std[mine] ** 2 + np.sum(moved**2, axis=1) + self._amplitude.std**2)",
        "considered = np.sqrt(self.std[mine] ** 2 + np.sum(moved**2, axis=1))", "laws that depend on the amplitude in k and c",
    ),
    Mutation(
        "parameters/parameter_estimator.py",
        "return np.asarray(np.minimum(np.hypot(std, added), np.maximum(self._prior_std[: self.count], std)))", "return std",
        "installation errors of the sensors in k and c",
    ),
    Mutation(
        "model/smoother.py", "variance += _mend_ends(model, moving, error.ends(moving), segment.lines.dt)",
        "_mend_ends(model, moving, error.ends(moving), segment.lines.dt)", "the end of a run in the smoothed forces",
    ),
    Mutation(
        "model/segment_ends.py", "wider = np.interp(np.arange(part), instants, np.maximum(left - left[inside], 0.0))",
        "wider = 0.1 * np.interp(np.arange(part), instants, np.maximum(left - left[inside], 0.0))",
        "most of the uncertain deformation at the end of a run",
    ),
    Mutation(
        "model/run_parameters.py", "std = float(np.hypot(np.sqrt(joint.covariance[at, at]), held))",
        "std = float(np.sqrt(joint.covariance[at, at]))", "uncertain mass in k and c of a whole run",
    ),
    Mutation(
        "parameters/mass_reference.py", "return math.exp(mean), math.hypot(1.0 / math.sqrt(float(np.sum(weights))), spread)",
        "return math.exp(mean), 1.0 / math.sqrt(float(np.sum(weights)))", "force references that contradict each other",
    ),
    Mutation(
        "pipeline.py", "excess = max(verdict.excess, lasting, 1.0 + (self._excess - 1.0) * math.exp(-duration / _EXCESS_FADES))",
        "excess = 1.0", "sensors that contradict each other in the motion",
    ),
    Mutation(
        "model/segments.py", "total = information + np.eye(raw.shape[1]) * shrinks[:, :, None]", "total = information",
        "noise of the inputs: derivatives are taken at noise",
    ),
    Mutation(
        "model/segments.py", "lines = np.flatnonzero(share > _NO_SHARE)", "lines = np.flatnonzero(share > 1e30)",
        "what a bracket that moves alone and does not lean adds to the readings of the base",
    ),
    Mutation(
        "model/segments.py", "segment.wandering = own / np.abs(lines.laplace) ** 4", "segment.wandering = 0.0 * own",
        "how far mounts move by themselves",
    ),
    Mutation(
        "model/segments.py", "share = np.clip(1.0 - np.median(power, axis=1) / seen, 0.0, 1.0)",
        "share = np.ones(len(power))", "brackets follow the twist of the base and not what mounts move by themselves",
    ),
    Mutation(
        "model/smoother.py", "changes = np.matmul(weighted, self._gain) + times_real(direct, body)",
        "changes = 0.0 * (direct @ body)", "slow states in the std of smoothed forces",
    ),
    Mutation(
        "model/smoother.py", "self._weight = np.linalg.inv(np.eye(len(variance[0])) + total * shrinks[:, None, :])",
        "self._weight = np.broadcast_to(np.eye(len(variance[0])), total.shape).copy()", "noise in the inputs of smoothed forces",
    ),
)  # fmt: skip


def mutated(text: str, mutation: Mutation) -> str:
    """Return the text of a file with the line replaced, at its indentation."""
    found = re.findall(rf"^([ ]*){re.escape(mutation.line)}$", text, flags=re.MULTILINE)
    if len(found) != 1:
        raise SystemExit(f"{mutation.file}: {len(found)} lines are {mutation.line!r}")
    return text.replace(found[0] + mutation.line + "\n", found[0] + mutation.instead + "\n")


def failing(copy: pathlib.Path, workers: int) -> str:
    """Return the first test that fails in a copy of the repository, empty where all pass."""
    files = dict.fromkeys(str(f.relative_to(copy)) for pattern in TESTS for f in sorted(copy.glob(pattern)))
    command = [sys.executable, "-m", "pytest", "-q", "-x", "--no-header", "-p", "no:cacheprovider", *files]
    command += ["-n", str(workers)] if workers > 1 else []
    environment = {**os.environ, "PYTHONPATH": str(copy)}
    done = subprocess.run(command, cwd=copy, env=environment, capture_output=True, text=True, check=False)
    if done.returncode == 0:
        return ""
    named = re.search(r"^(?:FAILED|ERROR) (\S+)", done.stdout, flags=re.MULTILINE)
    if named is None:
        raise SystemExit(f"the tests did not run:\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    return named[1]


def main() -> int:
    """Print which mutations the tests notice."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", type=int, nargs="+", help="numbers of the list, from 1")
    parser.add_argument("--workers", type=int, default=1, help="test processes")
    given = parser.parse_args()
    chosen = given.only or range(1, len(MUTATIONS) + 1)
    survived = 0
    with tempfile.TemporaryDirectory() as folder:
        copy = pathlib.Path(folder) / "ride_estimation"
        copy.mkdir()
        for name in COPIED:
            source = ROOT / name
            (shutil.copytree if source.is_dir() else shutil.copy2)(source, copy / name)
        broken = failing(copy, given.workers)
        if broken:
            raise SystemExit(f"without a mutation {broken} fails")
        print("| | file | lost | noticed by | s |\n|---|---|---|---|---|")
        for number in chosen:
            mutation = MUTATIONS[number - 1]
            file = copy / "ride_estimation" / "estimation" / mutation.file
            whole, began = file.read_text(encoding="utf-8"), time.monotonic()
            file.write_text(mutated(whole, mutation), encoding="utf-8")
            found = failing(copy, given.workers)
            file.write_text(whole, encoding="utf-8")
            survived += not found
            said = found or "NOTHING"
            print(f"| {number} | {mutation.file} | {mutation.loses} | {said} | {time.monotonic() - began:.0f} |", flush=True)
    print(f"{len(chosen) - survived} of {len(chosen)} noticed")
    return int(survived > 0)


if __name__ == "__main__":
    sys.exit(main())
