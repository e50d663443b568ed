# Copyright 2026 ride_estimation contributors
"""A recorded run through the handlers of the live node, one message after the other: no queue, no clock, nothing lost.

``python -m ride_estimation.nodes.lockstep RUN [--vehicle V.yaml]`` prints the digest of the estimates; it is the digest of
``ride-estimation replay`` on the same run, bit by bit.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import rclpy
from rclpy.context import Context
from rclpy.parameter import Parameter

from ride_estimation.errors import ConfigurationError, RideEstimationError
from ride_estimation.estimation.offline import EstimateDigest
from ride_estimation.io.playback import recorded_messages
from ride_estimation.nodes.estimator_node import EstimatorNode


def run_in_lockstep(node: EstimatorNode, path: str | Path) -> str:
    """Feed a run to a configured node and return the digest of its estimates.

    Parameters
    ----------
    node
        Configured, with nothing received yet.
    path
        The run.

    Raises
    ------
    ConfigurationError
        The node is not configured; the message is the node's.
    InputDataError
        The run cannot be read.
    """
    session = node.session
    if session is None:
        raise ConfigurationError(node.fault or "the node is not configured")
    digest = EstimateDigest()
    for message in recorded_messages(path, session.topics):
        for block in node.receive(message.topic, message.type_name, message.payload):
            digest.update(block)
    for block in node.finish():
        digest.update(block)
    digest.parameters(session.pipeline.parameters())
    return digest.hexdigest()


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the digest of one run; return 2 on bad input."""
    parser = argparse.ArgumentParser(description="replay a run through the handlers of the live node and print the digest")
    parser.add_argument("run", help="rosbag2 folder, .mcap, .db3 or ROS 1 .bag")
    parser.add_argument("--vehicle", default="truck_cab", help="vehicle file, or the name of a bundled one")
    options = parser.parse_args(arguments)
    context = Context()
    rclpy.init(context=context, args=[])
    node = EstimatorNode(
        context=context, use_global_arguments=False, parameter_overrides=[Parameter("vehicle", value=options.vehicle)]
    )
    try:
        print(f"digest {run_in_lockstep(node, options.run)}")
    except RideEstimationError as error:
        print(f"lockstep: {error}", file=sys.stderr)
        return 2
    finally:
        node.destroy_node()
        context.try_shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
