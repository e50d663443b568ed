# Copyright 2026 ride_estimation contributors
"""The node's ``/diagnostics``: names that tell nodes apart, stamps of one clock, changes of level as lines of the log."""

from __future__ import annotations

import time
from collections.abc import Iterable

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.node import Node

from ride_estimation.errors import ConfigurationError
from ride_estimation.nodes import conversions, qos
from ride_estimation.nodes.level_log import LevelLog


class Diagnostics:
    """Publishes statuses of a node.

    A status ``load`` of the node ``/truck1/ride/estimator`` is published as ``/truck1/ride/estimator: load`` (as
    ``diagnostic_updater`` does it, with the full name), its hardware id ``cab`` as ``truck1/ride/cab``. The stamp is that of
    the node's clock: wall time, or ``/clock`` with ``use_sim_time``.

    Parameters
    ----------
    node
        Whose statuses they are.

    Raises
    ------
    ConfigurationError
        QoS overrides of ``/diagnostics`` that the middleware refuses.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._name, self._namespace = node.get_fully_qualified_name(), node.get_namespace().strip("/")
        self._log = LevelLog(self._write)
        try:
            self._publisher = node.create_publisher(
                DiagnosticArray, "/diagnostics", qos.output(), qos_overriding_options=qos.overridable()
            )
        except qos.REFUSED as error:
            raise ConfigurationError(str(error), where="/diagnostics") from error

    def publish(self, statuses: Iterable[DiagnosticStatus]) -> None:
        """Publish statuses, and log what changed."""
        told = list(statuses)
        self._log.note(told, time.monotonic())
        for status in told:
            status.name = f"{self._name}: {status.name}"
            status.hardware_id = "/".join(filter(None, (self._namespace, status.hardware_id)))
        self._publisher.publish(conversions.diagnostics(self._node.get_clock().now().nanoseconds, told))

    def _write(self, level: bytes, line: str) -> None:
        # one call each: rclpy takes another severity from the same line of code for a mistake
        logger = self._node.get_logger()
        if level == DiagnosticStatus.OK:
            logger.info(line)
        elif level == DiagnosticStatus.WARN:
            logger.warning(line)
        else:
            logger.error(line)
