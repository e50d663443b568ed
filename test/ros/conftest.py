# Copyright 2026 ride_estimation contributors
"""Each ROS test has its own context and its own domain; nothing sleeps, waits end on a condition or a deadline."""

from __future__ import annotations

import fcntl
import itertools
import os
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

rclpy = pytest.importorskip("rclpy", reason="ROS is not installed (pip install -e '.[ros]')")

from rclpy.context import Context  # noqa: E402
from rclpy.executors import Executor  # noqa: E402
from rclpy.node import Node  # noqa: E402

from ride_estimation.nodes.executors import make_executor  # noqa: E402

#: Longer than the 20 s after which DDS forgets a participant that left while it was being discovered: until then its half-known
#: services make those of the same name look incomplete.
DEADLINE_S = 40.0
#: longest wait of one spin
WAIT_S = 0.01


#: every test begins its search one domain further: participants of the test before may still be leaving theirs
_turn = itertools.count(os.getpid() * 7)


@pytest.fixture
def domain() -> Iterator[int]:
    """Own a DDS domain for the length of a test, also against other processes on this machine; 99 and 100 are of benchmarks."""
    for _ in range(98):
        number = 1 + next(_turn) % 98
        lock = (Path(tempfile.gettempdir()) / f"ride_estimation_domain_{number}.lock").open("w")
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            lock.close()
            continue
        try:
            yield number
        finally:
            lock.close()
        return
    raise RuntimeError("no free DDS domain between 1 and 98")


class Ros:
    """One context with one executor and the nodes of a test.

    Parameters
    ----------
    domain
        DDS domain.
    executor
        Name of the executor.
    """

    def __init__(self, domain: int, executor: str) -> None:
        self.context = Context()
        rclpy.init(context=self.context, args=[], domain_id=domain)
        self.executor: Executor = make_executor(executor, self.context)
        self.nodes: list[Node] = []
        self._others: list[Node] = []

    def participant(self, name: str) -> Node:
        """Return a node that is a participant of its own in the same domain, as one of another process would be."""
        other = Context()
        rclpy.init(context=other, args=[], domain_id=self.context.get_domain_id())
        self._others.append(Node(name, context=other, use_global_arguments=False))
        return self._others[-1]

    def add(self, node: Node) -> Node:
        """Put a node on the executor."""
        self.executor.add_node(node)
        self.nodes.append(node)
        return node

    def until(self, condition: Callable[[], bool], deadline_s: float = DEADLINE_S) -> None:
        """Spin until the condition holds; fail when waiting for it took too long.

        Only waiting counts. A handler runs inside the spin, and configuring compiles half a minute where no kernel is cached:
        its answer is on the way when the spin returns. On a busy machine a wait takes longer than was asked for.
        """
        waited = 0.0
        while not condition():
            if waited > deadline_s:
                raise AssertionError(f"condition did not hold within {deadline_s} s of waiting")
            began = time.monotonic()
            self.executor.spin_once(timeout_sec=WAIT_S)
            waited += min(time.monotonic() - began, WAIT_S)

    def call(self, service: str, kind: type, request: object | None = None) -> object:
        """Call a service and return its response."""
        client_node = next((n for n in self.nodes if n.get_name() == "caller"), None)
        if client_node is None:
            client_node = self.add(Node("caller", context=self.context, use_global_arguments=False))
        client = client_node.create_client(kind, service)
        try:
            self.until(client.service_is_ready)
        except AssertionError as error:
            known = [n for n, _ in client_node.get_service_names_and_types()], client_node.get_node_names()
            raise AssertionError(f"{service} is not ready; services and nodes known: {known}") from error
        future = client.call_async(kind.Request() if request is None else request)
        self.until(future.done)
        client_node.destroy_client(client)
        return future.result()

    def close(self) -> None:
        """Destroy everything: of the participants in one process only the first 32 are ever found."""
        for node in self.nodes:
            self.executor.remove_node(node)
            node.destroy_node()
        self.executor.shutdown()
        self.context.try_shutdown()
        for node in self._others:
            node.destroy_node()
            node.context.try_shutdown()


@pytest.fixture(params=["single", "events"])
def ros(request: pytest.FixtureRequest, domain: int) -> Iterator[Ros]:
    """Return a context per executor the node may run on."""
    world = Ros(domain, request.param)
    yield world
    world.close()


@pytest.fixture
def ros_single(domain: int) -> Iterator[Ros]:
    """Return a context on the default executor of rclpy."""
    world = Ros(domain, "single")
    yield world
    world.close()
