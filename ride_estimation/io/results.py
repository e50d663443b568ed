# Copyright 2026 ride_estimation contributors
"""``result.json`` and ``signals.npz`` of a replay, the same bytes for the same run."""

from __future__ import annotations

import dataclasses
import hashlib
import os
import platform
from collections.abc import Mapping, Sequence
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

import ride_estimation
from ride_estimation.errors import InputDataError, RideEstimationError
from ride_estimation.frames import AXES
from ride_estimation.io.atomic import replacing
from ride_estimation.jit import COMPILED
from ride_estimation.metrics import nrmse
from ride_estimation.signals.quality import ChannelQuality
from ride_estimation.signals.recording import Recording, run_title
from ride_estimation.vehicles.vehicle import Vehicle

if TYPE_CHECKING:  # whoever only looks for a folder or reads results need not wait for the estimator to be imported
    from ride_estimation.assessment.run_assessment import RunAssessment
    from ride_estimation.estimation.carried_points import CarriedPoint
    from ride_estimation.estimation.common.estimate import Estimate
    from ride_estimation.estimation.common.settings import PipelineSettings
    from ride_estimation.estimation.offline import OfflineRun

RESULT_SCHEMA = "ride_estimation/result/1"


def output_folder(path: str | Path) -> Path:
    """Create and return the folder results go to.

    Raises
    ------
    InputDataError
        The path is a file, or the folder cannot be made.
    """
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputDataError(f"{folder}: the output folder cannot be made: {error.strerror or error}") from error
    return folder


def require_folder(path: str | Path) -> None:
    """Refuse an output folder that cannot be made, before the work is done; nothing is created.

    Raises
    ------
    InputDataError
        The path or a folder above it is a file, or may not be written to.
    """
    folder = Path(path)
    nearest = next(place for place in (folder, *folder.parents, Path.cwd()) if place.exists())
    if not nearest.is_dir():
        raise InputDataError(f"{folder}: the output folder cannot be made: {nearest} is a file")
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise InputDataError(f"{folder}: the output folder cannot be made: {nearest} may not be written to")


def software() -> dict[str, str]:
    """Return the versions a result depends on, and whether the kernels were compiled (they round otherwise than plain Python)."""
    return {
        "ride_estimation": ride_estimation.__version__,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "scipy": scipy.__version__,
        "filterpy": metadata.version("filterpy"),
        "rosbags": metadata.version("rosbags"),
        "kernels": f"numba {metadata.version('numba')}" if COMPILED else "plain Python",
        "machine": platform.machine(),
    }


def channel_fit(run: OfflineRun) -> dict[str, float | None]:
    """Return the NRMSE (over the standard deviation of the measurement) per accelerometer channel, None for a constant one."""
    fit: dict[str, float | None] = {}
    for sensor, measured in run.measured.items():
        for i, axis in enumerate(AXES):
            given, model = measured[run.valid, i].astype(float), run.predicted[sensor][run.valid, i].astype(float)
            try:
                fit[f"{sensor}.{axis}"] = nrmse(given, model)
            except RideEstimationError:
                fit[f"{sensor}.{axis}"] = None
    return fit


def parameter_entry(estimate: Estimate) -> dict[str, Any]:
    """Return one parameter as results state it."""
    return {
        "name": estimate.name, "value": estimate.value, "std": estimate.std, "unit": estimate.unit, "prior": estimate.prior,
        "status": estimate.status.value, "reason": estimate.reason,
    }


def result_document(
    recording: Recording,
    vehicle: Vehicle,
    run: OfflineRun,
    quality: Mapping[str, ChannelQuality],
    warnings: tuple[str, ...],
    layout: tuple[str, ...],
    assessment: RunAssessment,
    settings: PipelineSettings,
) -> dict[str, Any]:
    """Return the content of ``result.json``; with the same files, versions and machine it is the same, byte by byte."""
    channels = {}
    for name, q in quality.items():
        health = run.health.sensors.get(name)
        channels[name] = {
            "samples": q.samples, "used": health.accepted if health else 0, "rate_hz": q.rate_hz,
            "gaps": q.gaps, "longest_gap_s": q.longest_gap_s, "clipped": q.clipped,
            "rejected": dict(sorted(health.rejected.items())) if health else {"not_used_by_the_estimator": q.samples},
            "refused_ticks": dict(sorted(health.refused.items())) if health else {},
            "signal_to_noise_db": q.signal_to_noise_db, "findings": list(q.findings),
        }
    return {
        "schema": RESULT_SCHEMA,
        "software": software(),
        "run": {
            "path": run_title(recording.name), "checksum": recording.checksum,
            "duration_s": float((run.stamp_ns.max() - run.stamp_ns.min()) * 1e-9),
            "ticks": len(run.stamp_ns), "valid_ticks": int(run.valid.sum()), "restarts": dict(run.health.restarts),
            "channels": channels, "ignored": dict(recording.ignored),
        },
        "vehicle": {"name": vehicle.name, "checksum": vehicle.checksum},
        "settings": dataclasses.asdict(settings),
        "parameters": [parameter_entry(estimate) for estimate in run.parameters],
        "parameters_smoothed": [parameter_entry(estimate) for estimate in run.smoothed_parameters],
        "mass_properties": [parameter_entry(estimate) for estimate in run.mass_properties],
        "layout": list(layout),
        "identifiability": run.identifiability,
        "fit": channel_fit(run),
        **assessment.document(),
        "forces": {
            "smoothed": not isinstance(run.smoothed, str),
            "hindsight": not isinstance(run.smoothed, str),  # name of before, kept for one version
            "meaning": {
                "mount_force": "as the node publishes it live, from what came before every instant",
                "mount_force_smoothed": run.forces_in_words(),
            },
        },
        "digest": run.digest,
        "warnings": list(warnings),
    }


def write_signals(path: Path, run: OfflineRun, carried: Sequence[CarriedPoint] = ()) -> str:
    """Write ``signals.npz``, smoothed forces and carried bodies where there are any; return its SHA-256 for ``result.json``."""
    s = run.signals
    later: dict[str, Any] = {}
    if not isinstance(run.smoothed, str):
        h = run.smoothed
        later = {"mount_force_smoothed": h.force, "mount_force_smoothed_std": h.std, "mount_deflection_smoothed": h.deflection}
        # the names of before, kept for one version
        later |= {name.replace("smoothed", "hindsight"): values for name, values in later.items()}
    arrays = dict(
        time_s=run.time_s,
        stamp_ns=run.stamp_ns,
        valid=run.valid,
        cg_accel=s["cg_accel"],
        cg_accel_std=s["cg_accel_std"],
        inertial_load=s["inertial_load"],
        inertial_load_std=s["inertial_load_std"],
        cg_specific_force=s["cg_specific_force"],
        angular_rate=s["angular_rate"],
        tilt=s["tilt"],
        mount_names=np.array(run.mount_names, dtype=np.str_),
        mount_force=s["mount_force"],
        mount_force_std=s["mount_force_std"],
        mount_force_std_equilibrium=s["mount_force_std_equilibrium"],
        mount_force_std_model=s["mount_force_std_model"],
        mount_deflection=s["mount_deflection"],
        **later,
    )
    if carried:
        arrays |= {
            "carried_names": np.array([p.place for p in carried], dtype=np.str_),
            "carried_specific_force": np.stack([p.simulated for p in carried], axis=1),
            "carried_specific_force_std": np.stack([p.std for p in carried], axis=1),
        }
    with replacing(path) as new:
        np.savez(new, **arrays)
        return sha256_of(new)


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file in hexadecimal digits."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
