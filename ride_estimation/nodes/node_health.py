# Copyright 2026 ride_estimation contributors
"""What /diagnostics says about topics, sensors and estimates; facts in, status messages out."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence

from diagnostic_msgs.msg import DiagnosticStatus

from ride_estimation.estimation.faults.health import Health, SensorHealth
from ride_estimation.nodes.backpressure import Load, LoadLevel
from ride_estimation.nodes.conversions import status
from ride_estimation.nodes.silence import Silence

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
        Message type the topic is read as, empty where no publisher offers an accepted one.
    offered
        Types that publishers on the topic offer.
    publishers
        How many publishers there are.
    incompatible_qos
        Policies that keep a publisher from matching.
    not_subscribed
        Why the middleware refused the subscription.
    arrived
        Messages that came from the middleware, those left out because of load among them.
    lost, left_out
        Messages that were sent and lost before they came here, and those that came and were left out because of load.
    received
        Messages received.
    rejected
        Messages that could not be used, by reason.
    silence
        How long nothing has arrived.
    """

    name: str
    sensors: tuple[str, ...]
    type_name: str = ""
    offered: tuple[str, ...] = ()
    publishers: int = 0
    incompatible_qos: str = ""
    not_subscribed: str = ""
    arrived: int = 0
    lost: int = 0
    left_out: int = 0
    received: int = 0
    rejected: Counter[str] = dataclasses.field(default_factory=Counter)
    silence: Silence = dataclasses.field(default_factory=Silence)

    def verdict(self) -> tuple[bytes, str]:
        """Return level and message, the worst finding first."""
        if self.offered and not self.type_name:
            return DiagnosticStatus.ERROR, f"carries {', '.join(self.offered)}, which is not accepted here"
        if self.not_subscribed:
            return DiagnosticStatus.ERROR, f"cannot be subscribed to as {self.type_name}: {self.not_subscribed}"
        if self.incompatible_qos:
            return DiagnosticStatus.ERROR, f"a publisher does not match: incompatible {self.incompatible_qos}"
        who = f"{self.publishers} publisher(s)" if self.publishers else "no publisher"
        if self.received == 0:
            return DiagnosticStatus.ERROR, f"configured, but nothing has been received ({who})"
        if self.silence.too_long:
            return DiagnosticStatus.ERROR, f"has stopped: nothing received for {self.silence.seconds:.1f} s ({who})"
        if unread := [name for name in self.offered if name != self.type_name]:
            return DiagnosticStatus.WARN, f"read as {self.type_name}; a publisher of {', '.join(unread)} is not read"
        if self.not_taken:
            return DiagnosticStatus.WARN, f"receiving, but {self.not_taken}"
        if self.rejected:
            return DiagnosticStatus.WARN, "some messages were not used: " + ", ".join(sorted(self.rejected))
        return DiagnosticStatus.OK, "receiving"

    @property
    def not_taken(self) -> str:
        """Return in words which messages were sent but not used by no fault of the sensor, empty where none."""
        counts = {"lost before they came to this node": self.lost, "left out because it was behind": self.left_out}
        return " and ".join(f"{count} messages were {what}" for what, count in counts.items() if count)

    def status(self) -> DiagnosticStatus:
        """Return the diagnostic status of the topic."""
        level, message = self.verdict()
        values: dict[str, object] = {
            "sensors": " ".join(self.sensors),
            "type": self.type_name,
            "publishers": self.publishers,
            "received": self.received,
            "lost before they came here": self.lost,
            "left out because of load": self.left_out,
        }
        values |= {f"rejected {reason}": count for reason, count in sorted(self.rejected.items())}
        return status(level, f"topic {self.name}", message, NODE, values)


def silence_words(states: Iterable[TopicState], estimates: Silence) -> list[str]:
    """Return sentences about inputs that have stopped and estimates that no longer come, none where all is well."""
    speaking = [state for state in states if state.arrived]
    stopped = [state for state in speaking if state.silence.too_long]
    found = []
    if stopped:
        who = "all inputs" if len(stopped) == len(speaking) else ", ".join(s.name for s in stopped)
        found.append(f"{who} stopped: nothing received for {min(s.silence.seconds for s in stopped):.1f} s")
    if estimates.too_long:
        found.append(f"no estimate for {estimates.seconds:.1f} s")
    return found


def pipeline_statuses(
    health: Health,
    body: str,
    unpublished: int,
    silent: Sequence[str],
    topics: Mapping[str, TopicState],
) -> Iterator[DiagnosticStatus]:
    """Return one status for the estimates and one per sensor.

    Parameters
    ----------
    health
        Of the pipeline.
    body
        Hardware id of the estimates.
    unpublished
        Ticks without a publishable estimate.
    silent
        Of :func:`silence_words`.
    topics
        Sensor -> its topic.
    """
    missing = any(sensor.accepted == 0 for sensor in health.sensors.values())
    level = DiagnosticStatus.OK
    if health.faulty or missing or silent:
        level = DiagnosticStatus.ERROR
    elif not health.ok:
        level = DiagnosticStatus.WARN
    messages = [*silent, *health.messages]
    values: dict[str, object] = {
        "ticks": health.ticks,
        "ticks without complete motion": health.invalid_ticks,
        "ticks not published": unpublished,
        "residual ratio": float(health.residual.ratio),
        "equilibrium ratio": float(health.equilibrium_ratio),
        "innovation ratio": float(health.innovation_ratio),
        "excited": bool(health.excited),
        "parameters at a bound": " ".join(health.at_bound),
    }
    values |= {f"restart {reason}": count for reason, count in sorted(health.restarts.items())}
    values |= {f"not used {name}": count for name, count in sorted(health.unknown_samples.items())}
    values |= {f"note {number + 1}": text for number, text in enumerate(messages)}
    yield status(level, "estimates", messages[0] if messages else "running", body, values)
    for sensor in health.sensors.values():
        yield sensor_status(sensor, topics[sensor.name])


#: level of a status by how the node keeps up
_LOAD_LEVELS = {
    LoadLevel.KEEPS_UP: DiagnosticStatus.OK, LoadLevel.LATE: DiagnosticStatus.WARN, LoadLevel.LOSES: DiagnosticStatus.ERROR
}  # fmt: skip


def load_status(load: Load) -> DiagnosticStatus:
    """Return whether the node keeps up with its messages."""
    left_out, lost = load.left_out.total(), load.lost.total()
    earlier = f"; earlier {left_out} messages were left out and {lost} lost before they came here" if left_out or lost else ""
    values: dict[str, object] = {
        "behind_s": load.behind_s,
        "largest behind_s": load.worst_s,
        "busy": load.busy,
        "processor": load.processor,
        "messages left out": left_out,
        "messages lost before they came here": lost,
    }
    return status(_LOAD_LEVELS[load.level], "load", load.words() or "keeps up" + earlier, NODE, values)


def sensor_status(sensor: SensorHealth, topic: TopicState) -> DiagnosticStatus:
    """Return rate, gaps, clipping and rejected samples of a sensor, whether it has stopped, and what was no fault of its own."""
    level, message = DiagnosticStatus.OK, "contributing"
    if sensor.accepted == 0:
        level, message = DiagnosticStatus.ERROR, "configured, but has contributed no sample"
    elif sensor.silent or topic.silence.too_long:
        level, message = DiagnosticStatus.ERROR, "has stopped"
    elif sensor.clipped or sensor.rejected or sensor.gaps or sensor.refused:
        found = [("at full scale", sensor.clipped), ("samples rejected", sum(sensor.rejected.values())), ("gaps", sensor.gaps)]
        found += [(f"ticks {reason}", count) for reason, count in sorted(sensor.refused.items())]
        level, message = DiagnosticStatus.WARN, ", ".join(f"{count} {what}" for what, count in found if count)
        if sensor.gaps and topic.not_taken:
            message += f"; no fault of the sensor: {topic.not_taken}"
    values: dict[str, object] = {
        "accepted": sensor.accepted,
        "rate_hz": sensor.rate_hz,
        "gaps": sensor.gaps,
        "longest_gap_s": sensor.longest_gap_s,
        "clipped": sensor.clipped,
        "ticks without sample": sensor.invalid_ticks,
        "residual ratio": sensor.residual_ratio,
    }
    values |= {f"rejected {reason}": count for reason, count in sorted(sensor.rejected.items())}
    return status(level, f"sensor {sensor.name}", message, sensor.name, values)
