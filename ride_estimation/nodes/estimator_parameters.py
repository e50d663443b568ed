# Copyright 2026 ride_estimation contributors
"""The parameters of the estimator node, and the files written from them.

``python -m ride_estimation.nodes.estimator_parameters --write`` writes ``config/nodes/estimator.yaml`` and
``docs/parameters.md`` of a source tree again.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from ride_estimation.estimation.common.settings import PipelineSettings
from ride_estimation.estimation.output import REPORT_PERIOD_S
from ride_estimation.nodes.executors import EXECUTORS
from ride_estimation.nodes.parameters import NodeParameter, Value, markdown, parameter_file

_DEFAULTS = PipelineSettings()

#: what the node itself needs
NODE_PARAMETERS: tuple[NodeParameter, ...] = (
    NodeParameter("vehicle", "truck_cab", "", "vehicle file, or the name of a bundled one", read_only=True),
    NodeParameter(
        "state_file", "", "", "state to continue from and to save to; empty starts from the vehicle file", read_only=True
    ),
    NodeParameter("save_interval", 60.0, "s", "time between two savings to state_file; 0 saves never", 0.0, 86400.0),
    NodeParameter("save_directory", "~/.ros/ride_estimation", "", "folder that ~/save_parameters writes to", read_only=True),
    NodeParameter("autostart", True, "", "configure and activate without a lifecycle manager", read_only=True),
    NodeParameter("executor", EXECUTORS[0], "", "how callbacks are run", allowed=EXECUTORS, read_only=True),
    NodeParameter("input_depth", 500, "messages", "queue per input topic: rate times longest stall", 200, 10000, read_only=True),
    NodeParameter("output_depth", 50, "messages", "queue per output topic", 1, 10000, read_only=True),
    NodeParameter("publish_every", 1, "ticks", "publish every n-th estimate; all are computed", 1, 1000),
    NodeParameter(
        "input_timeout", 0.5, "s", "silence of a topic that is an error; three usual intervals where those are longer", 0.2, 60.0
    ),
    NodeParameter(
        "diagnostics_period", REPORT_PERIOD_S, "s", "data time between two diagnostics and parameter messages", 0.1, 60.0
    ),
    NodeParameter("cg_frame", "cab_cg", "", "frame at the centre of gravity, axes of the cab", read_only=True),
    NodeParameter("vehicle_frame", "cab_link", "", "frame of the vehicle file: its origin and axes", read_only=True),
    NodeParameter("mount_frame_prefix", "mount_", "", "frame of a mount force is this and the mount's name", read_only=True),
    NodeParameter(
        "publish_tf", True, "", "publish the frames of CG, mounts, sensors on /tf_static; off where a URDF does", read_only=True
    ),
)

#: settings of the estimators, by the same name as in PipelineSettings; changing one keeps what was learned
PIPELINE_PARAMETERS: tuple[NodeParameter, ...] = (
    NodeParameter(
        "rate_hz", 0.0, "Hz", "ticks of the common time base; 0 takes the fastest sensor", 20.0, 2e4, or_zero=True, read_only=True
    ),
    NodeParameter(
        "block_ticks", _DEFAULTS.block_ticks, "ticks", "ticks processed together, latency against load", 1, 1000, read_only=True
    ),
    NodeParameter(
        "latency_budget", _DEFAULTS.latency_budget, "s", "longest time samples may be held back to come sensor by sensor", 0.5, 60
    ),
    NodeParameter(
        "tilt_acceleration_std",
        _DEFAULTS.tilt_acceleration_std,
        "m/s^2",
        "horizontal acceleration that must not be taken for tilt",
        1e-3,
        100.0,
    ),
    NodeParameter(
        "tilt_correlation_time", _DEFAULTS.tilt_correlation_time, "s", "time over which it stays similar", 1e-3, 100.0
    ),
    NodeParameter(
        "parameter_corner_hz", _DEFAULTS.parameter_corner_hz, "Hz", "high-pass corner of the parameter estimators", 0.05, 5.0
    ),
    NodeParameter("parameter_interval", _DEFAULTS.parameter_interval, "s", "time between two parameter updates", 0.05, 10.0),
    NodeParameter(
        "parameter_memory", _DEFAULTS.parameter_memory, "s", "excited time after which knowledge counts a third", 5.0, 3600.0
    ),
    NodeParameter("noise_scale", _DEFAULTS.noise_scale, "-", "factor on the sensor noise of the vehicle file", 0.1, 100.0),
    NodeParameter(
        "excitation_accel", _DEFAULTS.excitation_accel, "m/s^2", "RMS cab acceleration below which nothing is updated", 0.0, 10.0
    ),
    NodeParameter(
        "prior_stiffness_std", _DEFAULTS.prior_stiffness_std, "-", "std of log stiffness where the file states none", 1e-3, 3.0
    ),
    NodeParameter(
        "prior_damping_std", _DEFAULTS.prior_damping_std, "-", "std of log damping where the file states none", 1e-3, 3.0
    ),
    NodeParameter("largest_ratio", _DEFAULTS.largest_ratio, "-", "bound of a parameter as multiple of its prior", 1.1, 100.0),
    NodeParameter("largest_step", _DEFAULTS.largest_step, "-", "largest change of a logarithm in one update", 1e-3, 2.0),
    NodeParameter("estimate_parameters", _DEFAULTS.estimate_parameters, "", "false keeps the vehicle file's values"),
)

TABLE: tuple[NodeParameter, ...] = NODE_PARAMETERS + PIPELINE_PARAMETERS
NAMES = frozenset(parameter.name for parameter in TABLE)


def pipeline_settings(given: Mapping[str, Value]) -> PipelineSettings:
    """Return the estimator settings for node parameter values.

    Raises
    ------
    ConfigurationError
        A value the estimators refuse.
    """
    chosen = {p.name: given[p.name] for p in PIPELINE_PARAMETERS}
    rate = chosen.pop("rate_hz")
    return PipelineSettings(rate_hz=float(rate) if rate else None, **chosen)  # type: ignore[arg-type]


def documents() -> dict[str, str]:
    """Return the files written from the table: path below the repository root -> text."""
    title = "Parameters of the estimator node with their defaults."
    page = "# Parameters of the estimator node\n\nWritten from the table in `ride_estimation/nodes/estimator_parameters.py`.\n\n"
    return {
        "config/nodes/estimator.yaml": parameter_file(TABLE, title),
        "docs/parameters.md": page + markdown(TABLE),
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table, or write the files with ``--write``."""
    given = sys.argv[1:] if arguments is None else arguments
    if "--write" in given:
        root = Path(__file__).resolve().parents[2]
        for name, text in documents().items():
            (root / name).write_text(text, encoding="utf-8")
        return 0
    print(markdown(TABLE))
    return 0


if __name__ == "__main__":
    sys.exit(main())
