# Copyright 2026 ride_estimation contributors
"""``ride-estimation simulate``: a scenario file to a bag and its truth."""

from __future__ import annotations

import argparse

from ride_estimation.api.simulating import simulate
from ride_estimation.cli.progress import Progress
from ride_estimation.io.results import require_folder

#: usual share of the time by stage
_STAGES = {"simulating": 0.8, "writing the bag": 0.2}


def run(options: argparse.Namespace) -> int:
    """Simulate and write; print what was written."""
    require_folder(options.out)
    with Progress(f"simulate {options.scenario.stem}", shares=_STAGES) as progress:
        progress.begin("simulating")
        found = simulate(options.scenario, options.vehicle, progress=progress.update)
        progress.begin("writing the bag")
        bag = found.save(options.out)
    recording = found.field_run.recording
    messages = sum(len(c.stamp_ns) for c in recording.channels.values())
    print(f"{bag}: {messages} samples of {len(recording.channels)} sensors, {found.scenario.duration:g} s")
    print(f"{options.out / 'truth.npz'}: {', '.join(found.field_run.truth.signals)}")
    return 0
