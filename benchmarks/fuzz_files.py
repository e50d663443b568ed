# Copyright 2026 ride_estimation contributors
"""Throw damaged and hostile files at every reader: no crash, no hang, bounded memory.

Every input is a good file after random changes and follows from (seed, target, number) alone, so that a finding can be
repeated: ``--only vehicle:1234``. A reader may succeed or raise an error of ``ride_estimation.errors``; everything else is a
finding: another exception, no answer within ``--hang`` seconds of processor time, a process that died, more than ``--memory``
MiB above the start. The inputs run in a forked process, so that even a crash of compiled code is counted and survived.

    python benchmarks/fuzz_files.py --inputs 100000 --seconds 300
    python benchmarks/fuzz_files.py --targets vehicle,mcap --guided 60     # guided by coverage, needs `pip install atheris`

Prints one line per target (inputs, accepted, refused, findings, inputs per second, growth of the memory) and the sum; exits
with 1 on any finding.
"""

from __future__ import annotations

import argparse
import collections
import contextlib
import dataclasses
import json
import os
import pathlib
import random
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
import types
import warnings

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "test")]
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from fuzz.command_line import command_targets  # noqa: E402
from fuzz.live import live_targets  # noqa: E402
from fuzz.mutate import mutated  # noqa: E402
from fuzz.targets import Target, targets  # noqa: E402

from ride_estimation.errors import RideEstimationError  # noqa: E402

BATCH = 5000
#: an input that uses no processor time, or cannot be stopped, ends the process after so long [s]; longer than the warm-up takes
WAIT_S = 120.0


class Hang(BaseException):
    """No answer in time; no ``except Exception`` can catch it."""


@dataclasses.dataclass
class Tally:
    inputs: int = 0
    accepted: int = 0
    refused: int = 0
    seconds: float = 0.0
    growth_mib: float = 0.0
    findings: list[tuple[int, str]] = dataclasses.field(default_factory=list)


def all_targets() -> dict[str, Target]:
    return {**targets(), **command_targets(), **live_targets()}


def the_input(seed: int, name: str, number: int, seeds: list[bytes], words: tuple[bytes, ...]) -> bytes:
    rng = random.Random(f"{seed}:{name}:{number}")
    return mutated(rng.choice(seeds), seeds, words, rng)


def one(target: Target, data: bytes, folder: pathlib.Path, hang: float) -> str:
    """Return ``accepted``, ``refused`` or what was found."""
    file = folder / f"input{target.suffix}"
    file.write_bytes(data)
    signal.setitimer(signal.ITIMER_PROF, hang)
    try:
        target.consume(file, folder)
    except RideEstimationError:
        return "refused"
    except Hang:
        return f"no answer within {hang:g} s"
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)
        own = [f for f in place if "ride_estimation" in f.filename] or place
        return f"{type(error).__name__}: {str(error)[:120]!r} at {pathlib.Path(own[-1].filename).name}:{own[-1].lineno}"
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
    return "accepted"


def peak_mib() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def batch(
    target: Target, name: str, numbers: range, seeds: list[bytes], options: argparse.Namespace, out: int, end: float
) -> None:
    """Run in the child: one line per batch with the counts, one per finding; the number in work is always written first."""
    warnings.simplefilter("ignore")

    def too_long(*_: object) -> None:
        raise Hang

    signal.signal(signal.SIGPROF, too_long)
    for line in (resource.RLIMIT_AS,):
        used = int(pathlib.Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
        resource.setrlimit(line, (used + (4 * options.memory << 20), resource.RLIM_INFINITY))
    shm = "/dev/shm" if os.path.isdir("/dev/shm") else None
    with tempfile.TemporaryDirectory(dir=shm) as scratch:
        folder = pathlib.Path(scratch)
        warm_up(target, folder)
        counts: collections.Counter[str] = collections.Counter()
        start, done = peak_mib(), numbers.start
        for number in numbers:
            os.pwrite(out, number.to_bytes(8, "little"), 0)
            verdict = one(target, the_input(options.seed, name, number, seeds, tuple(target.words)), folder, options.hang)
            done = number + 1
            if verdict in ("accepted", "refused"):
                counts[verdict] += 1
            else:
                os.write(out, (json.dumps({"finding": [number, verdict]}) + "\n").encode())
            growth = peak_mib() - start
            if growth > options.memory:
                os.write(out, (json.dumps({"finding": [number, f"memory grew by {growth:.0f} MiB"]}) + "\n").encode())
                break
            if time.monotonic() > end:
                break
        os.write(out, (json.dumps({"done": done, "growth": peak_mib() - start, **counts}) + "\n").encode())


def fork_batch(
    target: Target, name: str, numbers: range, seeds: list[bytes], options: argparse.Namespace, end: float
) -> list[dict]:
    """Run a batch in a child and return its lines; a child that died or hangs beyond reach is a finding."""
    with tempfile.TemporaryFile() as shared:
        out = shared.fileno()
        os.write(out, bytes(8))
        child = os.fork()
        if child == 0:
            code = 1
            try:
                batch(target, name, numbers, seeds, options, out, end)
                code = 0
            except BaseException:
                traceback.print_exc()
            finally:
                os._exit(code)
        last, seen = -1, time.monotonic()
        died = ""
        while True:
            pid, status = os.waitpid(child, os.WNOHANG)
            if pid:
                died = "" if status == 0 else f"the process died ({status})"
                break
            at = int.from_bytes(os.pread(out, 8, 0), "little")
            if at != last:
                last, seen = at, time.monotonic()
            elif time.monotonic() - seen > WAIT_S + 3.0 * options.hang:
                os.kill(child, signal.SIGKILL)
                os.waitpid(child, 0)
                died = "no answer, not even to an alarm, or no end of waiting"
                break
            time.sleep(0.02)
        data = os.pread(out, os.fstat(out).st_size, 0)
        lines = [json.loads(line) for line in data[8:].decode().splitlines()]
        if died:
            number = int.from_bytes(data[:8], "little")
            lines += [{"finding": [number, died]}, {"done": number + 1}]
        return lines


def warm_up(target: Target, folder: pathlib.Path) -> None:
    """Take good inputs without a clock: an alarm inside of an import or a compilation would spoil all inputs that follow."""
    place = folder / "good"
    place.mkdir()
    (place / "seeds").mkdir()
    for number, seed in enumerate(target.seeds(place / "seeds")):
        file = place / f"{number}{target.suffix}"
        file.write_bytes(seed)
        with contextlib.suppress(RideEstimationError):
            target.consume(file, place)
    shutil.rmtree(place)


def run_target(name: str, target: Target, inputs: int, options: argparse.Namespace, seconds: float) -> Tally:
    with tempfile.TemporaryDirectory() as folder:
        seeds = target.seeds(pathlib.Path(folder))
    tally, at, began = Tally(), options.first, time.monotonic()
    last, deadline = options.first + inputs, began + seconds
    while at < last and time.monotonic() < deadline:
        lines = fork_batch(target, name, range(at, min(at + BATCH, last)), seeds, options, deadline)
        for line in lines:
            if "finding" in line:
                tally.findings.append(tuple(line["finding"]))
            else:
                tally.inputs += line["done"] - at
                at = line["done"]
                tally.accepted += line.get("accepted", 0)
                tally.refused += line.get("refused", 0)
                tally.growth_mib = max(tally.growth_mib, line.get("growth", 0.0))
    tally.seconds = time.monotonic() - began
    return tally


def own_functions() -> list[types.FunctionType]:
    """Return the functions and methods of the readers."""
    found: list[types.FunctionType] = []
    for name, module in sorted(sys.modules.items()):
        if name.startswith(("ride_estimation.io", "ride_estimation.units", "ride_estimation.signals.quality")):
            own = [v for v in vars(module).values() if getattr(v, "__module__", "") == name]
            found += [v for v in own if isinstance(v, types.FunctionType)]
            found += [m for v in own if isinstance(v, type) for m in vars(v).values() if isinstance(m, types.FunctionType)]
    return found


def guided(name: str, target: Target, seconds: float, options: argparse.Namespace) -> int:
    """Let atheris choose the inputs by the coverage of the package's Python code."""
    import atheris

    with tempfile.TemporaryDirectory() as scratch:
        folder, corpus = pathlib.Path(scratch), pathlib.Path(scratch) / "corpus"
        corpus.mkdir()
        (folder / "seeds").mkdir()
        for number, data in enumerate(target.seeds(folder / "seeds")):
            (corpus / str(number)).write_bytes(data)
        for function in own_functions():
            atheris.instrument_func(function)

        def consume(data: bytes) -> None:
            file = folder / f"input{target.suffix}"
            file.write_bytes(data)
            with contextlib.suppress(RideEstimationError):
                target.consume(file, folder)

        warnings.simplefilter("ignore")
        arguments = [
            sys.argv[0],
            f"-max_total_time={seconds:.0f}",
            f"-timeout={options.hang:.0f}",
            f"-rss_limit_mb={2048}",
            "-max_len=65536",
        ]
        atheris.Setup([*arguments, f"-artifact_prefix={options.artifacts}/{name}-", str(corpus)], consume)
        atheris.Fuzz()
    return 0


def parser() -> argparse.ArgumentParser:
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--inputs", type=int, default=100_000, help="inputs over all targets (default 100000)")
    p.add_argument("--seconds", type=float, default=300.0, help="longest time for all targets (default 300)")
    p.add_argument("--targets", default="", help="names, separated by commas (default: all)")
    p.add_argument("--seed", type=int, default=0, help="of the mutations (default 0)")
    p.add_argument("--first", type=int, default=0, help="number of the first input, to go on where a run ended (default 0)")
    p.add_argument("--hang", type=float, default=5.0, help="longest answer [s of processor time] (default 5)")
    p.add_argument("--memory", type=int, default=512, help="largest growth of the resident memory [MiB] (default 512)")
    p.add_argument("--only", default="", help="TARGET:NUMBER: one input, with its traceback")
    p.add_argument(
        "--guided", type=float, default=0.0, metavar="S", help="S seconds on the first target, guided by coverage (atheris)"
    )
    p.add_argument("--artifacts", default=".", help="folder for inputs that atheris finds (default: here)")
    return p


def main() -> int:
    options = parser().parse_args()
    known = all_targets()
    if options.only:
        name, _, number = options.only.partition(":")
        with tempfile.TemporaryDirectory() as folder:
            place = pathlib.Path(folder)
            (place / "seeds").mkdir()
            seeds = known[name].seeds(place / "seeds")
            file = place / f"input{known[name].suffix}"
            file.write_bytes(the_input(options.seed, name, int(number), seeds, tuple(known[name].words)))
            shutil.copyfile(file, pathlib.Path(options.artifacts) / f"{name}-{number}{file.suffix}")
            known[name].consume(file, place)
        return 0
    chosen = options.targets.split(",") if options.targets else list(known)
    if options.guided:
        return guided(chosen[0], known[chosen[0]], options.guided, options)
    began = time.monotonic()
    total: list[Tally] = []
    print("| target | inputs | accepted | refused | findings | inputs/s | memory [MiB] |\n|---|---|---|---|---|---|---|")
    for k, name in enumerate(chosen):
        # an equal share of what time is left
        seconds = (began + options.seconds - time.monotonic()) / (len(chosen) - k)
        t = run_target(name, known[name], -(-options.inputs // len(chosen)), options, seconds)
        total.append(t)
        rate = t.inputs / max(t.seconds, 1e-9)
        print(
            f"| {name} | {t.inputs} | {t.accepted} | {t.refused} | {len(t.findings)} | {rate:.0f} | {t.growth_mib:.0f} |",
            flush=True,
        )
        seen: dict[str, tuple[int, int]] = {}
        for number, text in t.findings:
            first, count = seen.get(text, (number, 0))
            seen[text] = (first, count + 1)
        for text, (first, count) in sorted(seen.items(), key=lambda entry: -entry[1][1])[:12]:
            print(f"    {count} x {text}   (--only {name}:{first})", flush=True)
    inputs, findings = sum(t.inputs for t in total), sum(len(t.findings) for t in total)
    print(f"{inputs} inputs, {findings} findings, {time.monotonic() - began:.0f} s, seed {options.seed}, from {options.first}")
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())
