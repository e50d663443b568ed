# Copyright 2026 ride_estimation contributors
"""The estimator as a lifecycle node: read parameters, build the pipeline, convert in, observe, convert out, report.

Lifecycle: *configure* loads the vehicle and the saved state and creates the outputs; *activate* subscribes; *deactivate*
unsubscribes and keeps what was learned; *cleanup* forgets it. With ``autostart`` the first two happen by themselves.
"""

from __future__ import annotations

import functools
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Unpack

from diagnostic_msgs.msg import DiagnosticStatus
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import QoSRequestedIncompatibleQoSInfo, SubscriptionEventCallbacks
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile, qos_policy_name_from_kind
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.subscription import Subscription
from std_srvs.srv import Trigger

from ride_estimation.errors import RideEstimationError
from ride_estimation.estimation.common.settings import PipelineSettings
from ride_estimation.estimation.compile_ahead import compile_ahead
from ride_estimation.estimation.output import OutputBlock, ReportSchedule
from ride_estimation.io.estimate_messages import Frames
from ride_estimation.io.force_arrows import ForceArrows, static_transforms
from ride_estimation.io.state_file import restore_state, save_results
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.nodes import conversions, qos
from ride_estimation.nodes.backpressure import THIN, Load, LoadLevel
from ride_estimation.nodes.cdr import stamp_of_payload
from ride_estimation.nodes.diagnostics import Diagnostics
from ride_estimation.nodes.estimator_parameters import NAMES, PIPELINE_PARAMETERS, TABLE, pipeline_settings
from ride_estimation.nodes.executors import run_node
from ride_estimation.nodes.inputs import MESSAGE_CLASSES
from ride_estimation.nodes.intake import Intake, Take
from ride_estimation.nodes.node_health import NODE, TopicState, load_status
from ride_estimation.nodes.parameters import NodeOptions, declare, values, verdict
from ride_estimation.nodes.publishers import EstimatePublishers
from ride_estimation.nodes.session import Session
from ride_estimation.nodes.silence import LOOK_PERIOD_S
from ride_estimation.nodes.state_saver import SAVE_ERRORS, StateSaver
from ride_estimation.nodes.static_frames import publish_static_frames

#: period of the watch over topics and silence [s], steady clock; not in the data path
WATCH_PERIOD_S = 1.0

#: its kernels are compiled before the node is made
BUNDLED_VEHICLE = "truck_cab"


class EstimatorNode(LifecycleNode):
    """Estimates CG motion, loads, mount parameters and mount forces from the topics of a vehicle file.

    Parameters
    ----------
    options
        See :class:`NodeOptions`.
    """

    def __init__(self, **options: Unpack[NodeOptions]) -> None:
        super().__init__("estimator", namespace="ride", **options)
        self._session: Session | None = None
        self._outputs: EstimatePublishers | None = None
        self._frames: Publisher | None = None
        self._subscriptions_by_topic: dict[str, tuple[str, Subscription]] = {}
        self._types_changed = False
        self._active = False
        self._fault = ""
        self._schedule = ReportSchedule()
        self._reported_since_watch = False
        self._saved_ns: int | None = None
        self._saver = StateSaver()
        self._save_problem_said = ""
        self._load = Load()
        self._load_said = LoadLevel.KEEPS_UP
        declare(self, TABLE)
        pipeline_settings(values(self, TABLE))
        depth = int(self.get_parameter("input_depth").value)
        self._intake = Intake(self._load, stamp_of_payload, depth, self._follow_load)
        self.add_on_set_parameters_callback(self._judge_parameters)
        self.add_post_set_parameters_callback(self._apply_parameters)
        self._diagnostics = Diagnostics(self)
        self.create_service(Trigger, "~/reset", self._serve_reset)
        self.create_service(Trigger, "~/save_parameters", self._serve_save)
        if self.get_parameter("autostart").value and self.trigger_configure() == TransitionCallbackReturn.SUCCESS:
            self.trigger_activate()
        # begins now, so that publishers that are there already have been heard when it is first said who is not
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._watch_timer = self.create_timer(WATCH_PERIOD_S, self.watch, clock=steady)
        self._looked_s = time.monotonic()
        self._look_timer = self.create_timer(LOOK_PERIOD_S, self.look, clock=steady)

    @property
    def session(self) -> Session | None:
        """Return what was built by configure, None before."""
        return self._session

    @property
    def subscriptions(self) -> Iterator[Subscription]:
        """Return what the executor waits for: no inputs while the node is behind, they are looked for then."""
        ours = [s for _, s in self._subscriptions_by_topic.values()] if self._intake.behind else []
        return (s for s in super().subscriptions if s not in ours)

    @property
    def fault(self) -> str:
        """Return why the node could not be configured, empty where it could."""
        return self._fault

    # ---- lifecycle ----

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Load vehicle and saved state, create outputs; a mistake in them is one message and FAILURE."""
        given = values(self, TABLE)
        try:
            vehicle = load_vehicle(str(given["vehicle"]))
            session = Session(vehicle, pipeline_settings(given))
            state_file = Path(str(given["state_file"])).expanduser()
            if given["state_file"] and state_file.exists():
                restore_state(state_file, session.pipeline)
                self.get_logger().info(f"continuing from {state_file}")
            elif given["state_file"]:
                self.get_logger().warning(f"state_file {state_file} does not exist yet; starting from the vehicle file")
            session.warm_up()
        except RideEstimationError as error:
            return self._cannot_configure(str(error))
        frames = Frames(str(given["cg_frame"]), str(given["vehicle_frame"]), str(given["mount_frame_prefix"]))
        profile = qos.output(int(given["output_depth"]))
        try:
            arrows = ForceArrows(vehicle, session.body.name, session.mount_names, frames)
            self._outputs = EstimatePublishers(self._new_publisher, session.mount_names, frames, profile, arrows)
        except qos.REFUSED as error:
            return self._cannot_configure(str(error))
        if given["publish_tf"]:
            self._frames = publish_static_frames(self, static_transforms(vehicle, session.body.name, frames))
        self._fault = ""
        self._session = session
        self.get_logger().info(f"vehicle {vehicle.name!r}: {len(vehicle.sensors)} sensors on {len(session.topics)} topics")
        return super().on_configure(state)

    def _cannot_configure(self, why: str) -> TransitionCallbackReturn:
        self._fault = why
        self.get_logger().error(why)
        return TransitionCallbackReturn.FAILURE

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Subscribe to the inputs."""
        result = super().on_activate(state)
        self._active = result == TransitionCallbackReturn.SUCCESS
        if self._session is not None:
            self._session.listen()
        self._follow_topics()
        return result

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Unsubscribe; what was learned stays and is saved."""
        self._unsubscribe()
        self._save_at_the_end()
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Forget vehicle and estimates, destroy the outputs."""
        result = super().on_cleanup(state)
        self._tear_down()
        return result

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Save what was learned and leave like cleanup."""
        self._unsubscribe()
        self._save_at_the_end()
        result = super().on_shutdown(state)
        self._tear_down()
        return result

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Go back to unconfigured after a failed transition."""
        self._tear_down()
        return TransitionCallbackReturn.SUCCESS

    def _unsubscribe(self) -> None:
        self._active = False
        self._intake.close_all()
        for _, subscription in self._subscriptions_by_topic.values():
            self.destroy_subscription(subscription)
        self._subscriptions_by_topic.clear()

    def _tear_down(self) -> None:
        self._unsubscribe()
        if self._outputs is not None:
            for publisher in self._outputs.all:
                self.destroy_lifecycle_publisher(publisher)
        if self._frames is not None:
            self.destroy_publisher(self._frames)
        self._frames = None
        self._outputs = None
        self._session = None
        self._schedule = ReportSchedule()

    def _new_publisher(self, message: type, topic: str, profile: QoSProfile, options: QoSOverridingOptions) -> object:
        return self.create_lifecycle_publisher(message, topic, profile, qos_overriding_options=options)

    # ---- parameters ----

    def _judge_parameters(self, proposed: list[Parameter]) -> SetParametersResult:
        answer = verdict(TABLE, proposed)
        if answer.successful:
            given = values(self, TABLE)
            given |= {p.name: p.value for p in proposed if p.name in given}
            try:
                pipeline_settings(given)
            except RideEstimationError as error:
                return SetParametersResult(successful=False, reason=str(error))
        return answer

    def _apply_parameters(self, changed: list[Parameter]) -> None:
        own = [parameter for parameter in changed if parameter.name in NAMES]
        if own:
            self.get_logger().info("changed: " + ", ".join(f"{parameter.name} is {parameter.value}" for parameter in own))
        if self._session is not None and {p.name for p in own} & {p.name for p in PIPELINE_PARAMETERS}:
            self._session.change_settings(pipeline_settings(values(self, TABLE)))

    # ---- inputs ----

    def _follow_topics(self) -> None:
        """Subscribe to every input with the type its publishers offer, also when they come back with another one."""
        if self._session is None or not self._active:
            return
        for name, topic in self._session.topics.items():
            state = self._session.states[name]
            publishers = self.get_publishers_info_by_topic(name)  # the types of the topic would contain the own subscription's
            state.publishers = len(publishers)
            state.offered = tuple(sorted({publisher.topic_type for publisher in publishers}))
            self._intake.take_note_of_publishers(name, len(publishers))
            if not publishers:
                state.incompatible_qos = ""
            state.type_name = topic.choose(state.offered, state.type_name)
            type_name, subscription = self._subscriptions_by_topic.get(name, ("", None))
            if subscription is not None and type_name != state.type_name:
                del self._subscriptions_by_topic[name]
                self._intake.close(name)
                self.destroy_subscription(subscription)
                self._types_changed = True  # the middleware keeps the old type until the executor has let go of it
            elif subscription is None and state.type_name:
                self._subscribe(name, state)

    def _subscribe(self, topic: str, state: TopicState) -> None:
        def mismatch(info: QoSRequestedIncompatibleQoSInfo) -> None:
            policy = str(qos_policy_name_from_kind(info.last_policy_kind))
            if policy != state.incompatible_qos:
                self.get_logger().error(f"topic {topic}: a publisher does not match: incompatible {policy}")
            state.incompatible_qos = policy

        try:
            subscription = self.create_subscription(
                MESSAGE_CLASSES[state.type_name],
                topic,
                functools.partial(self._arrived, topic, state),
                qos.sensor_input(int(self.get_parameter("input_depth").value)),
                event_callbacks=SubscriptionEventCallbacks(incompatible_qos=mismatch),
                qos_overriding_options=qos.overridable(),
                raw=True,
            )
        except qos.REFUSED as error:  # this process uses the topic with another type, for example
            state.not_subscribed = str(error)
        else:
            state.not_subscribed = ""
            self._subscriptions_by_topic[topic] = (state.type_name, subscription)
            self._intake.open(
                topic, _waiting_messages(subscription, state), functools.partial(self.receive, topic, state.type_name)
            )

    def _arrived(self, topic: str, state: TopicState, payload: bytes) -> None:
        """Take a live message from the executor."""
        state.arrived += 1
        self._intake.arrived(topic, payload)

    def receive(self, topic: str, type_name: str, payload: bytes) -> tuple[OutputBlock, ...]:
        """Handle one serialized message: observe it, publish what became ready, report when a period is over.

        Live subscriptions and lockstep replay both come through here.

        Parameters
        ----------
        topic, type_name
            Where it came from and what it is.
        payload
            CDR bytes.
        """
        if self._session is None:
            return ()
        return self._publish(self._session.receive(topic, type_name, payload))

    def finish(self) -> tuple[OutputBlock, ...]:
        """Publish what is left at the end of a recorded run."""
        return () if self._session is None else self._publish(self._session.pipeline.finish())

    # ---- outputs ----

    def _publish(self, blocks: tuple[OutputBlock, ...]) -> tuple[OutputBlock, ...]:
        session, outputs = self._session, self._outputs
        if session is None or outputs is None:
            return ()
        every = int(self.get_parameter("publish_every").value) * (THIN if self._load.thinned else 1) if blocks else 1
        for block in blocks:
            outputs.publish_ticks(block, session.ticks_to_publish(block.publishable(), every))
        if blocks:
            self._report_if_due(session, outputs, int(blocks[-1].stamp_ns[-1]))
        return blocks

    def _report_if_due(self, session: Session, outputs: EstimatePublishers, now_ns: int) -> None:
        """Publish parameters once per period of data time and diagnostics a block later: no force waits for both."""
        period_ns = round(float(self.get_parameter("diagnostics_period").value) * 1e9)
        due = self._schedule.due(now_ns, period_ns)
        if due == "diagnostics":
            self._reported_since_watch = True
            self._publish_diagnostics()
        elif due == "parameters":
            outputs.publish_parameters(now_ns, session.body, session.pipeline.loads.inertia, session.pipeline.parameters())

    def _publish_diagnostics(self) -> None:
        self._diagnostics.publish(self._statuses())

    def _statuses(self) -> Iterable[DiagnosticStatus]:
        if self._session is None:
            level = DiagnosticStatus.ERROR if self._fault else DiagnosticStatus.WARN
            yield conversions.status(level, "estimator node", self._fault or "not configured", NODE, {})
            return
        if not self._active:
            yield conversions.status(DiagnosticStatus.WARN, "estimator node", "not active", NODE, {})
        yield load_status(self._load)
        for name, topic in self._session.states.items():
            topic.lost, topic.left_out = self._load.lost[name], self._load.left_out[name]
        if self._saver.problem:
            yield conversions.status(DiagnosticStatus.WARN, "saved state", self._saver.problem, NODE, {})
        yield from self._session.statuses()

    def watch(self) -> None:
        """Look at topics and types, and tell the health when no data do: nothing must fail in silence."""
        self._follow_topics()
        self._load.measure(time.monotonic(), time.process_time())
        if not self._reported_since_watch:
            self._publish_diagnostics()
        self._reported_since_watch = False
        self._save_if_due()

    def look(self) -> None:
        """Tell at once when inputs or estimates stop or come back, or messages begin to wait or to be lost.

        Goes on with messages that wait, and subscribes where the type of a topic has changed.
        """
        self._intake.work()
        if self._types_changed:
            self._types_changed = False
            self._follow_topics()
        now = time.monotonic()
        passed, self._looked_s = now - self._looked_s, now
        limit = float(self.get_parameter("input_timeout").value)
        if self._session is not None and self._active and self._session.look(passed, limit):
            self._publish_diagnostics()

    def _follow_load(self) -> None:
        """Tell the executor for what to wait, and at once how the node keeps up: no other callback comes before."""
        if self.executor is not None:
            self.executor.wake()
        if self._load.level != self._load_said:
            self._load_said = self._load.level
            self._publish_diagnostics()

    def destroy_node(self) -> None:
        """Save what was learned and leave."""
        self._save_at_the_end()
        super().destroy_node()
        # the base class leaves it, and it keeps the node and its participant visible to others until both are collected
        self._state_machine.destroy_when_not_in_use()

    # ---- saved state ----

    def _save_if_due(self) -> None:
        """Begin to save to ``state_file`` once per interval of the steady clock; the thread of the saver writes."""
        interval_ns = round(float(self.get_parameter("save_interval").value) * 1e9)
        now = Clock(clock_type=ClockType.STEADY_TIME).now().nanoseconds
        if self._saved_ns is None:
            self._saved_ns = now
        path = self._state_path()
        if self._session is not None and path is not None and now - self._saved_ns >= interval_ns:
            self._saved_ns = now
            self._saver.begin(path, self._session.pipeline)
        self._say_save_problem()

    def _save_at_the_end(self) -> None:
        """Save to ``state_file`` and return when it is done."""
        path = self._state_path()
        if self._session is not None and path is not None:
            self._saver.complete(path, self._session.pipeline)
            self._say_save_problem()

    def _state_path(self) -> Path | None:
        """Return where the state is saved, None where it is not."""
        path = str(self.get_parameter("state_file").value)
        return Path(path).expanduser() if path and float(self.get_parameter("save_interval").value) else None

    def _say_save_problem(self) -> None:
        """Log a save that failed, once until one succeeds; diagnostics say it all the time."""
        problem = self._saver.problem
        if problem and not self._save_problem_said:
            self.get_logger().warning(f"state {problem}")
        self._save_problem_said = problem

    # ---- services ----

    def _serve_reset(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self._session is None:
            response.message = "not configured: nothing to reset"
            return response
        self._session.pipeline.reset("requested by the service reset")
        response.success, response.message = True, "estimates start again from the vehicle file"
        self._publish_diagnostics()
        return response

    def _serve_save(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self._session is None:
            response.message = "not configured: nothing to save"
            return response
        folder = Path(str(self.get_parameter("save_directory").value)).expanduser()
        try:
            files = save_results(folder, self._session.pipeline)
        except SAVE_ERRORS as error:
            response.message = f"not saved: {error}"
            self.get_logger().warning(response.message)
            return response
        response.success, response.message = True, "saved " + " and ".join(str(file) for file in files)
        self.get_logger().info(response.message)
        return response


def _waiting_messages(subscription: Subscription, state: TopicState) -> Take:
    """Return what takes the next message that waits for a subscription, as the executors of rclpy do."""

    def take() -> tuple[bytes, int] | None:
        with subscription.handle:
            taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
        if taken is None:
            return None
        state.arrived += 1
        return taken[0], taken[1]["publication_sequence_number"] or 0

    return take


def prepared(make: Callable[[], Node]) -> Node:
    """Compile the kernels, then make the node: it appears in the graph when it can answer.

    The first start after an installation compiles for a while; a manager that asks the node to configure would wait for that, and
    give up. The bundled vehicle needs nearly the same kernels as any other.
    """
    compile_ahead(get_logger("ride_estimation").info)
    Session(load_vehicle(BUNDLED_VEHICLE), PipelineSettings()).warm_up()
    return make()


def main(args: Sequence[str] | None = None, make: Callable[[], Node] = EstimatorNode) -> int:
    """Run the node until a signal."""
    return run_node(lambda: prepared(make), lambda node: str(node.get_parameter("executor").value), args)


if __name__ == "__main__":
    sys.exit(main())
