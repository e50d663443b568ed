# Copyright 2026 ride_estimation contributors
"""Executors the nodes may run on, and the main loop that ends cleanly on signals (docs/decisions/002-executor.md)."""

from __future__ import annotations

import gc
import signal
from collections.abc import Callable, Sequence
from types import FrameType

import rclpy
from rclpy.context import Context
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from ride_estimation.errors import ConfigurationError, RideEstimationError

#: names a user may choose
EXECUTORS: tuple[str, ...] = ("events", "single")

#: Finite on purpose: without a timeout the events executor of rclpy 7.1 spins in a busy loop that ignores signals.
WAIT_S = 0.2

#: what asks a node to leave
_SIGNALS = (signal.SIGINT, signal.SIGTERM)


def make_executor(name: str, context: Context | None = None) -> Executor:
    """Return the executor of that name; ``events`` falls back to ``single`` where this rclpy has none.

    Parameters
    ----------
    name
        One of :data:`EXECUTORS`.
    context
        The context of the nodes, None for the default one.
    """
    if name == "events":
        try:
            from rclpy.experimental.events_executor import EventsExecutor  # rclpy before 7.1.4 has none
        except ImportError:
            return SingleThreadedExecutor(context=context)
        return EventsExecutor(context=context)
    return SingleThreadedExecutor(context=context)


def _made(factory: Callable[[], Node], args: Sequence[str] | None) -> Node:
    """Return the node, made after the start of ROS."""
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    except (RuntimeError, ValueError) as error:  # arguments or a parameter file that cannot be read
        raise ConfigurationError(str(error), where="command line") from error
    return factory()


def run_node(factory: Callable[[], Node], executor_name: Callable[[Node], str], args: Sequence[str] | None = None) -> int:
    """Create a node, spin it until a signal, a shutdown or its attribute ``finished``, and leave; return ``exit_code``.

    A signal only ends the loop, between two callbacks: the context stays valid until the node is destroyed, so that nothing a
    callback publishes and nothing saved at the end fails because of it. (The handlers of rclpy take the context away in the
    middle of a callback.) While the node is being made a signal breaks off. SIGINT arrives twice under ``ros2 launch``, so
    signals are ignored while the node is destroyed. What is wrong on the command line or in a parameter file is one line and
    exit code 2.

    Parameters
    ----------
    factory
        Makes the node after ``rclpy.init``.
    executor_name
        Which executor the node wants.
    args
        Command line for rclpy, None for ``sys.argv``.
    """
    code = 0
    node: Node | None = None
    executor: Executor | None = None
    asked_to_leave: list[int] = []

    def leave(number: int, frame: FrameType | None) -> None:
        asked_to_leave.append(number)
        if node is None:
            raise KeyboardInterrupt

    for number in _SIGNALS:
        signal.signal(number, leave)
    try:
        node = _made(factory, args)
        # what was loaded until now stays: looking through all of it for garbage would hold up estimates for several blocks
        gc.collect()
        gc.freeze()
        executor = make_executor(executor_name(node))
        executor.add_node(node)
        while not asked_to_leave and rclpy.ok() and not getattr(node, "finished", False):
            executor.spin_once(timeout_sec=WAIT_S)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except RideEstimationError as error:
        get_logger("ride_estimation").error(str(error))
        code = 2
    except Exception:
        if not asked_to_leave or node is not None:
            raise
        # a compiler that was interrupted fails in its own ways
    finally:
        for number in _SIGNALS:
            signal.signal(number, signal.SIG_IGN)
        if executor is not None:
            executor.shutdown(timeout_sec=WAIT_S)
        if node is not None:
            code = int(getattr(node, "exit_code", 0))
            node.destroy_node()
        rclpy.try_shutdown()
    return code
