# Copyright 2026 ride_estimation contributors
"""What /diagnostics says about one input topic and about the node; facts in, status messages out."""

from __future__ import annotations

import dataclasses
from collections import Counter

from diagnostic_msgs.msg import DiagnosticStatus

from ride_estimation.nodes.conversions import status

#: hardware id of everything that is about the node itself
NODE = "ride_estimation"


@dataclasses.dataclass
class TopicState:
    """What the middleware and the decoder know of one input topic.

    Attributes
    ----------
    name, sensors
        Topic and the sensors it carries.
    type_name
        Message type of the subscription, empty while there is none.
    offered
        Types that publishers on the topic offer.
    publishers
        How many there are.
    incompatible_qos
        Policies that keep a publisher from matching.
    received
        Messages received.
    rejected
        Messages that could not be used, by reason.
    """

    name: str
    sensors: tuple[str, ...]
    type_name: str = ""
    offered: tuple[str, ...] = ()
    publishers: int = 0
    incompatible_qos: str = ""
    received: int = 0
    rejected: Counter[str] = dataclasses.field(default_factory=Counter)

    def verdict(self) -> tuple[bytes, str]:
        """Return level and message, the worst finding first."""
        if self.offered and not self.type_name:
            return DiagnosticStatus.ERROR, f"carries {', '.join(self.offered)}, which is not accepted here"
        if self.incompatible_qos:
            return DiagnosticStatus.ERROR, f"a publisher does not match: incompatible {self.incompatible_qos}"
        if self.received == 0:
            who = f"{self.publishers} publisher(s)" if self.publishers else "no publisher"
            return DiagnosticStatus.ERROR, f"configured, but nothing has been received ({who})"
        if self.rejected:
            return DiagnosticStatus.WARN, "some messages were not used: " + ", ".join(sorted(self.rejected))
        return DiagnosticStatus.OK, "receiving"

    def status(self) -> DiagnosticStatus:
        """Return the diagnostic status of the topic."""
        level, message = self.verdict()
        values: dict[str, object] = {
            "sensors": " ".join(self.sensors),
            "type": self.type_name,
            "publishers": self.publishers,
            "received": self.received,
        }
        values |= {f"rejected {reason}": count for reason, count in sorted(self.rejected.items())}
        return status(level, f"topic {self.name}", message, NODE, values)
