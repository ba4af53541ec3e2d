"""Asks the nodes of an avatar: their parameters, pause and reset; waits for nobody."""

import threading
import time
from collections.abc import Callable
from typing import Any

from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.client import Client
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.task import Future
from std_srvs.srv import SetBool, Trigger

from garment_sim_ros.declaration import checked
from garment_sim_ros.errors import GarmentSimError
from garment_sim_ros.nodes import NODES
from garment_sim_ros.stepping_back import SMALL, step_back
from garment_sim_ros.view.controls import CLOTH, COLLIDERS, SHOWN, Done

_BODY = ("body", "body_bone_names")
_PERIOD = 2.0
"""Between two times that the parameters are asked for [s]."""
_PATIENCE = 5.0
"""For an answer [s]."""
_SPIN = 0.1


class NodeClient:
    """Talks to `cloth_node` and `mocap_player` in a node's namespace.

    Args:
        node: The node that asks; nobody else spins it.
        context: Its context.
    """

    def __init__(self, node: Node, context: Context) -> None:
        self._node = node
        self._clients: dict[tuple[type, str], Client] = {}
        self._values: dict[str, dict[str, Any]] = {CLOTH: {}, COLLIDERS: {}}
        self._pending: list[tuple[float, Client, Future, Done]] = []
        self._lock = threading.RLock()
        self._asked = -_PERIOD
        self._ended = threading.Event()
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(node)
        self._thread = threading.Thread(target=self._spin, name="ask", daemon=True)
        self._thread.start()

    def values(self) -> dict[str, Any]:
        """Parameters of the cloth node as last heard."""
        with self._lock:
            return dict(self._values[CLOTH])

    def body(self) -> tuple[str, str] | None:
        """Body file and file of its bones' names, by who says so; None before any did."""
        with self._lock:
            for values in self._values.values():
                if values.get("body"):
                    return values["body"], values.get("body_bone_names", "")
        return None

    def set(self, name: str, value: Any, done: Done) -> None:
        """Set a parameter of the cloth node."""
        plain = list(value) if isinstance(value, tuple) else value
        request = SetParameters.Request(
            parameters=[
                ParameterMessage(
                    name=name, value=Parameter(name, value=plain).get_parameter_value()
                )
            ]
        )

        def answered(response: Any) -> None:
            result = response.results[0] if response.results else None
            right = result is not None and result.successful
            done("" if right else getattr(result, "reason", "") or "no answer")

        self._call(SetParameters, f"{CLOTH}/set_parameters", request, answered, done)

    def pause(self, node: str, on: bool, done: Done) -> None:
        """Pause a node, or let it go on."""
        self._call(
            SetBool,
            f"{node}/pause",
            SetBool.Request(data=on),
            lambda response: done("" if response.success else response.message or "refused"),
            done,
        )

    def reset(self, node: str, done: Done) -> None:
        """Reset a node."""
        self._call(
            Trigger,
            f"{node}/reset",
            Trigger.Request(),
            lambda response: done("" if response.success else response.message or "refused"),
            done,
        )

    def close(self) -> None:
        """End."""
        self._ended.set()
        self._thread.join()
        self._executor.shutdown()

    def _call(
        self,
        kind: type,
        name: str,
        request: Any,
        answered: Callable[[Any], None],
        done: Done,
    ) -> None:
        with self._lock:
            client = self._clients.get((kind, name))
            if client is None:
                client = self._clients[kind, name] = self._node.create_client(kind, name)
            if not client.service_is_ready():
                done(f"{name} is not there")
                return
            future = client.call_async(request)
            self._pending.append((time.monotonic() + _PATIENCE, client, future, done))

        def take(ready: Future) -> None:
            with self._lock:
                before = len(self._pending)
                self._pending = [p for p in self._pending if p[2] is not ready]
                if len(self._pending) == before:
                    return  # too late
            try:
                answered(ready.result())
            except Exception as error:  # an answer that is none
                done(f"{type(error).__name__}")

        future.add_done_callback(take)

    def _ask(self, node: str, names: tuple[str, ...]) -> None:
        def answered(response: Any) -> None:
            found: dict[str, Any] = {}
            declared = NODES[node].declared()
            for name, value in zip(names, response.values):
                try:
                    found[name] = checked(declared[name], parameter_value_to_python(value))
                except (GarmentSimError, ValueError):
                    continue
            with self._lock:
                self._values[node].update(found)

        request = GetParameters.Request(names=list(names))
        self._call(GetParameters, f"{node}/get_parameters", request, answered, lambda wrong: None)

    def _spin(self) -> None:
        step_back(SMALL)
        while not self._ended.is_set():
            try:
                self._executor.spin_once(timeout_sec=_SPIN)
            except ExternalShutdownException:
                return
            except Exception:
                # Whatever came, it is no reason to ask no more.
                self._ended.wait(_SPIN)
            now = time.monotonic()
            with self._lock:
                late = [p for p in self._pending if p[0] < now]
                self._pending = [p for p in self._pending if p[0] >= now]
            for _, client, future, done in late:
                client.remove_pending_request(future)
                done("no answer")
            if now - self._asked >= _PERIOD:
                self._asked = now
                self._ask(CLOTH, (*SHOWN, *_BODY))
                self._ask(COLLIDERS, _BODY)
