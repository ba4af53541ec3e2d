"""Real nodes in processes of their own, and a probe that talks to them."""

import contextlib
import json
import queue
import re
import signal
import threading
import time
from collections import defaultdict
from collections.abc import Callable
from typing import Any, ClassVar

from ros_input.nursery import started

_PATIENCE = 180.0
"""How long a condition may take to come true on a busy machine, not counting the time in which a
node says that it compiles or fits [s]."""
_ANSWER = 2.0
"""After how long a question that may be asked twice is asked again [s]."""
_AT_WORK = re.compile(r": \d+ s so far$")


def wait_until(condition: Callable[[], Any], what: str, limit: float = _PATIENCE) -> Any:
    """Returns what `condition` gives once that is true."""
    began = time.monotonic()
    while time.monotonic() < max(began, NodeProcess.last_at_work) + limit:
        value = condition()
        if value:
            return value
        time.sleep(0.01)
    said = "".join(f"\n{node.name} said:\n{node.output[-2000:]}" for node in NodeProcess.all)
    raise AssertionError(f"after {limit:g} s still not: {what}{said}")


class NodeProcess:
    """One of our nodes as a process, which `begin` starts: a function of module and words."""

    all: ClassVar[list["NodeProcess"]] = []  # those that have not been ended
    last_at_work = 0.0  # when one of them last said so

    def __init__(
        self,
        name: str,
        namespace: str,
        *,
        begin: Callable[[str, list[str]], Any] = started,
        **parameters: Any,
    ) -> None:
        words = ["--ros-args", "-r", f"__ns:={namespace}"]
        for key, value in parameters.items():
            words += ["-p", f"{key}:={json.dumps(value)}"]  # JSON is YAML
        self.name = name
        self.full_name = f"{namespace}/{name}"
        self._process = begin(f"garment_sim_ros.ros.{name}", words)
        self._lines: list[str] = []
        NodeProcess.all.append(self)
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self._lines.append(line)
            if _AT_WORK.search(line.rstrip()):
                NodeProcess.last_at_work = time.monotonic()

    @property
    def output(self) -> str:
        """What it wrote so far."""
        return "".join(self._lines)

    @property
    def pid(self) -> int:
        return self._process.pid

    @property
    def is_running(self) -> bool:
        return self._process.poll() is None

    def send(self, number: signal.Signals) -> None:
        self._process.send_signal(number)

    def wait(self) -> int:
        """Its exit code."""
        code: int = self._process.wait(_PATIENCE)
        self._reader.join(_PATIENCE)
        return code

    def end(self) -> None:
        NodeProcess.all.remove(self)
        if self.is_running:
            self._process.kill()
        self._process.wait()


class Probe:
    """A node of the test's: publishes, subscribes, calls services; spins in a thread."""

    def __init__(self, namespace: str) -> None:
        import rclpy
        from rclpy.context import Context
        from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
        from rclpy.signals import SignalHandlerOptions

        self._rclpy = rclpy
        self._context = Context()
        rclpy.init(context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self.node = rclpy.create_node("probe", namespace=namespace, context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._received: dict[str, list[Any]] = defaultdict(list)
        self._subscriptions: dict[str, Any] = {}
        self._publishers: dict[str, Any] = {}
        self._diagnostics: dict[str, Any] = {}
        from diagnostic_msgs.msg import DiagnosticArray

        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._note, 50)

        def spin() -> None:
            with contextlib.suppress(ExternalShutdownException):
                self._executor.spin()

        self._thread = threading.Thread(target=spin, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._executor.shutdown()
        self._thread.join()
        self.node.destroy_node()
        self._rclpy.shutdown(context=self._context)

    def listen(
        self, topic: Any, garment: str = "", *, raw: bool = False, depth: int = 5000
    ) -> str:
        """Collect messages of a topic of `ros.topics`; returns the key for `received`."""
        from rclpy.qos import QoSProfile

        profile = topic.profile()
        profile = QoSProfile(
            depth=depth, reliability=profile.reliability, durability=profile.durability
        )
        name = topic.name.format(garment)
        self._subscriptions[name] = self.node.create_subscription(
            topic.type, name, self._received[name].append, profile, raw=raw
        )
        return name

    def is_matched(self, name: str) -> bool:
        """Whether a topic that is listened to has a publisher, and that one this reader."""
        return bool(self._subscriptions[name].get_publisher_count())

    def received(self, name: str) -> list[Any]:
        return self._received[name]

    def next(self, name: str, count: int = 1) -> list[Any]:
        """The next `count` messages from now on."""
        start = len(self._received[name])
        wait_until(
            lambda: len(self._received[name]) >= start + count, f"{count} messages on {name}"
        )
        return self._received[name][start : start + count]

    def silent_while(self, name: str, meanwhile: Callable[[], Any]) -> bool:
        """Whether nothing came on a topic between the begin and the end of `meanwhile`.

        To be waited for where a publisher has just stopped: topics come one by one, so what was
        published before may come after a status or an answer that tells of the stop.
        """
        count = len(self._received[name])
        meanwhile()
        return len(self._received[name]) == count

    def publish(self, topic: Any, message: Any) -> None:
        """Publish on a topic of `ros.topics`, after its reader has been found."""
        if topic.name not in self._publishers:
            publisher = self.node.create_publisher(topic.type, topic.name, topic.profile())
            wait_until(publisher.get_subscription_count, f"a reader of {topic.name}")
            self._publishers[topic.name] = publisher
        self._publishers[topic.name].publish(message)

    def destroy(self, publisher: Any) -> None:
        """End a publisher of the node's, in the thread that spins.

        From another thread its events may go while that one is about to wait for them: it ends.
        """
        done = self._executor.create_task(self.node.destroy_publisher, publisher)
        wait_until(done.done, "a publisher to end")

    def _note(self, message: Any) -> None:
        for status in message.status:
            self._diagnostics[status.name] = status

    def diagnostics(self, node: NodeProcess) -> Any:
        """The latest status of a node, None before the first."""
        return self._diagnostics.get(node.full_name)

    def value(self, node: NodeProcess, key: str) -> float:
        """A number from a node's diagnostics, 0 where there is none."""
        status = self.diagnostics(node)
        values = {} if status is None else {v.key: v.value for v in status.values}
        return float(values.get(key, 0))

    def call(self, kind: Any, name: str, request: Any) -> Any:
        """Call a service of a lifecycle node, once."""
        client = self._client(kind, name)
        self._meet(name.rpartition("/")[0])
        result = self._answers(client, request).get(timeout=_PATIENCE).result()
        self.node.destroy_client(client)
        return result

    def _meet(self, node: str) -> None:
        """Waits until a node has found the clients made so far.

        Until then what they ask may stay without an answer: they know the service before it knows
        them. A node finds them in the order in which they were made, so an answer to one more,
        which may ask twice, tells of all.
        """
        from lifecycle_msgs.srv import GetState

        client = self._client(GetState, f"{node}/get_state")

        def is_answered() -> bool:
            try:
                self._answers(client, GetState.Request()).get(timeout=_ANSWER)
            except queue.Empty:
                return False
            return True

        wait_until(is_answered, f"{node} answers")
        self.node.destroy_client(client)

    def _client(self, kind: Any, name: str) -> Any:
        client = self.node.create_client(kind, name)
        assert client.wait_for_service(timeout_sec=_PATIENCE), f"no service {name}"
        return client

    @staticmethod
    def _answers(client: Any, request: Any) -> "queue.SimpleQueue[Any]":
        answers: queue.SimpleQueue[Any] = queue.SimpleQueue()
        client.call_async(request).add_done_callback(answers.put)
        return answers

    def publishers_of(self, name: str) -> list[Any]:
        """What is known of the publishers of a topic."""
        full = self.node.resolve_topic_name(name)
        return wait_until(
            lambda: self.node.get_publishers_info_by_topic(full), f"a publisher of {full}"
        )
