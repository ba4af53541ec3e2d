"""What all nodes share: lifecycle, parameters and diagnostics."""

import dataclasses
import traceback
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, Generic, TypeVar

from rcl_interfaces.msg import SetParametersResult
from rclpy.lifecycle import (
    LifecycleNode,
    LifecyclePublisher,
    LifecycleState,
    TransitionCallbackReturn,
)
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher

from garment_sim_ros.errors import GarmentSimError, MessageError, ParameterError
from garment_sim_ros.going_first import how_it_goes
from garment_sim_ros.nodes import NODES
from garment_sim_ros.params import LifecycleParameters, idle
from garment_sim_ros.presets import preset_values
from garment_sim_ros.ros.diagnostics import Condition, Diagnostics, Rejections
from garment_sim_ros.ros.handover import HandingPublisher
from garment_sim_ros.ros.inputs import Input, Inputs
from garment_sim_ros.ros.interfaces import advertise, advertise_always
from garment_sim_ros.ros.memory import give_back
from garment_sim_ros.ros.parameters import NodeParameters, set_on
from garment_sim_ros.ros.place import ALONE, Place
from garment_sim_ros.ros.rclpy_internals import (
    Taken,
    activate,
    end_lifecycle,
    given_names,
    given_value,
    lifecycle_state,
)
from garment_sim_ros.ros.sources import Source
from garment_sim_ros.ros.ticker import Ticker, Waits
from garment_sim_ros.ros.topics import Topic
from garment_sim_ros.stepping_back import libraries_step_back

Group = TypeVar("Group")
Other = TypeVar("Other")

_OF_EVERY_NODE = ("use_sim_time", "start_type_description_service")
_OVERRIDES = "qos_overrides."
"""What `rclpy` declares by itself."""


class ManagedNode(LifecycleNode, Generic[Group]):
    """A lifecycle node that says what is wrong with it.

    Subclasses override `prepare`, `start`, `stop`, `release`, `condition` and, where parameters
    may be set while the node runs, `parameters_changed`.

    Args:
        name: The node's name.
        group: Its parameters.
        place: Where it lives.

    Attributes:
        card: What there is to know of it beforehand.
        parameters: Their values now.
        autostart: Whether it configures and activates itself.
        preset: Name of its preset.
        rejections: What it rejected.
        failure: Why configuring failed, None if it did not.
        ticker: Makes the node's calls at a fixed rate, None where there are none.
        inputs: What it takes in, in this order.
        realtime_priority: Of the thread that it works in, see `going_first`; 0: none.
    """

    realtime_priority = 0

    _groups: tuple[NodeParameters[Any], ...] = ()
    _usual: Mapping[str, Any] = MappingProxyType({})

    def __init__(self, name: str, group: type[Group], place: Place = ALONE) -> None:
        super().__init__(name, **place.options())
        self._place = place
        self.card = NODES[name]
        self._told: set[str] = set()
        common = self.declare(LifecycleParameters).values
        self.autostart, self.preset = common.autostart, common.preset
        solver = given_value(self, "solver")
        self._usual = preset_values(self.preset, name, solver=str(solver or ""))
        self._group_parameters = self.declare(group, on_change=self.parameters_changed)
        self.rejections = Rejections(self.get_logger().warning, self.get_logger().error)
        self.failure: GarmentSimError | None = None
        self.ticker: Ticker | None = None
        self.inputs: list[Input] = []
        self._waits: Inputs | None = None
        self._advertised: list[Publisher] = []
        self._diagnostics = Diagnostics(self, self.rejections, self._condition)
        self.add_on_set_parameters_callback(self._check_clock)
        self.add_post_set_parameters_callback(self._take_clock)

    @property
    def parameters(self) -> Group:
        """Values of the node's parameters."""
        return self._group_parameters.values

    def declare(
        self,
        group: type[Other],
        *,
        check: Callable[[Other], None] | None = None,
        on_change: Callable[[Other], None] | None = None,
    ) -> NodeParameters[Other]:
        """Declare a group of parameters; those that the node's card says may be set later."""
        made = NodeParameters(
            self,
            group,
            usual=self._usual,
            dynamic=self.card.section(group).live,
            check=check,
            on_change=on_change,
        )
        self._groups = (*self._groups, made)
        return made

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """As the base class does, for values in any spelling."""
        plain, refusal = set_on(self, self._groups, parameter_list)
        if refusal:
            return SetParametersResult(successful=False, reason=refusal)
        return super().set_parameters_atomically(plain)

    def set_parameters(self, parameter_list: list[Parameter]) -> list[SetParametersResult]:
        """One after the other."""
        return [self.set_parameters_atomically([parameter]) for parameter in parameter_list]

    def idle(self) -> list[str]:
        """What was set and does nothing, a sentence each; see `declaration.idle`."""
        return [line for group in self._groups for line in idle(group.values, group.usual)]

    def tell_idle(self) -> None:
        """Warn, once each, of parameters that do nothing."""
        known = {*(name for group in self._groups for name in group.names), *_OF_EVERY_NODE}
        solver = getattr(self.parameters, "solver", "")
        unknown = [
            self.card.unknown(name, solver)
            for name in given_names(self)
            if name not in known and not name.startswith(_OVERRIDES)
        ]
        for line in (*unknown, *self.idle()):
            if line not in self._told:
                self._told.add(line)
                self.get_logger().warning(line)

    def prepare(self) -> None:
        """Load what is needed and make publishers and subscriptions."""

    def start(self) -> None:
        """Begin to work."""

    def stop(self) -> None:
        """Pause work; `start` may follow."""

    def release(self) -> None:
        """Let go of what `prepare` loaded; topics end by themselves."""

    def tick_at(
        self,
        rate: float,
        callback: Callable[[int, int], None],
        work_ahead: Callable[[int], object] | None = None,
    ) -> Ticker:
        """Begin to call back at a fixed rate [Hz]; see `Ticker`."""
        self.ticker = Ticker(self, rate, callback, self._place.origin, work_ahead)
        return self.ticker

    def stop_ticking(self) -> None:
        """Call back no more."""
        if self.ticker is not None:
            self.ticker.destroy()
            self.ticker = None

    def take_inputs(self) -> None:
        """Use the messages that have come."""
        for i in self.inputs:
            i.take_all()

    @property
    def mostly(self) -> Waits | None:
        """What `spin` waits for."""
        if self.ticker is not None:
            return None if self.ticker.is_simulated else self.ticker
        if self._waits is None and self.inputs:
            self._waits = Inputs(self, self.inputs)
        return self._waits

    def check_clock(self, *, simulated: bool) -> None:
        """See whether the node may follow a simulated time.

        Raises:
            ParameterError: It may not.
        """

    def parameters_changed(self, parameters: Group) -> None:
        """Take over parameters that were set."""

    def attend(self) -> None:
        """Take over what was made beside the node's thread."""

    @property
    def has_description(self) -> bool:
        """Whether the node has what latched messages tell, so that it can do without a new one."""
        return True

    def reject(self, what: str, error: MessageError) -> None:
        """Count and log that a message on the topic `what` cannot be used."""
        latched = any(i.topic.name == what and i.topic.latched for i in self.inputs)
        self.rejections.add(what, error, severe=latched and not self.has_description)

    def condition(self) -> Condition:
        """How the node is, for its diagnostics."""
        return Condition(text=self.state)

    @property
    def state(self) -> str:
        """Name of the lifecycle state."""
        return lifecycle_state(self)

    def advertise(
        self, topic: Topic, garment: str = "", *, keep_all: bool = False
    ) -> LifecyclePublisher | HandingPublisher:
        """A publisher, silent while the node is not active, that ends with what `prepare` made."""
        publisher = advertise(self, topic, garment, keep_all=keep_all)
        if self.state == "active":
            # Only those that are there beforehand are activated with the node.
            activate(publisher)
        self._advertised.append(publisher)
        handover = self._place.handover
        if handover is not None and topic in handover:
            return HandingPublisher(publisher, topic, handover)
        return publisher

    def advertise_always(self, topic: Topic, garment: str = "") -> Publisher:
        """A publisher that does not depend on the state; it ends with what `prepare` made."""
        publisher = advertise_always(self, topic, garment)
        self._advertised.append(publisher)
        return publisher

    def take_in(
        self,
        topic: Topic,
        take: Callable[[Taken], object],
        *,
        source: Source | None = None,
        always: bool = False,
        keep_all: bool = False,
        room: int = 0,
    ) -> Input:
        """Have serialized messages taken, and counted where `take` rejects them.

        Args:
            topic: The topic.
            take: Uses a message; may raise `MessageError`.
            source: Which publisher is followed; None: all of them.
            always: Whether to take them while the node is not active: latched ones do not come
                again.
            keep_all: Whether none may be lost.
            room: Messages that may come between two calls of `take_inputs`.
        """

        def when_active(message: Taken) -> None:
            if always or self.state == "active":
                take(message)

        made = Input(
            self,
            topic,
            when_active,
            rejected=self.reject,
            source=source,
            room=room,
            keep_all=keep_all,
            handover=self._place.handover,
        )
        self.inputs.append(made)
        self._waits = None
        return made

    def destroy_node(self) -> None:
        """End the node; nothing of it is left on the network."""
        super().destroy_node()
        end_lifecycle(self)

    def _condition(self) -> Condition:
        """The node's own, and what is wrong with its time or its inputs."""
        condition = self.condition()
        if self.realtime_priority:
            values = {**condition.values, "scheduling": how_it_goes()}
            condition = dataclasses.replace(condition, values=values)
        simulated = bool(self.get_parameter("use_sim_time").value)
        if simulated and self.state == "active" and not self.get_clock().now().nanoseconds:
            return dataclasses.replace(condition, text="waits for /clock", well=False)
        for i in self.inputs:
            conflict = i.conflict()
            if conflict:
                self.rejections.tell(f"conflict.{i.topic.name}", conflict)
                condition = dataclasses.replace(
                    condition, text=f"{condition.text}; {conflict}", well=False
                )
        return condition

    def _check_clock(self, parameters: Sequence[Parameter]) -> SetParametersResult:
        for p in parameters:
            if p.name == "use_sim_time":
                try:
                    if not isinstance(p.value, bool):
                        raise ParameterError(
                            p.name, f"found {p.value!r}", "allowed: true or false"
                        )
                    self.check_clock(simulated=p.value)
                except ParameterError as error:
                    return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _take_clock(self, parameters: Sequence[Parameter]) -> None:
        for p in parameters:
            if p.name == "use_sim_time" and self.ticker is not None:
                self.ticker.follow_clock(simulated=bool(p.value))

    def _undo(self) -> None:
        """Forget what `prepare` and all after it made."""
        self.release()
        for i in self.inputs:
            i.destroy()
        self.inputs, self._waits = [], None
        for publisher in self._advertised:
            if isinstance(publisher, LifecyclePublisher):
                self.destroy_lifecycle_publisher(publisher)
            else:
                self.destroy_publisher(publisher)
        self._advertised.clear()
        give_back()

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Prepare; a file or parameter that is not allowed leaves the node unconfigured."""
        self.failure = None
        self.get_logger().info(f"preset {self.preset}")
        self.tell_idle()
        try:
            self.prepare()
        except GarmentSimError as error:
            self.failure = error
            if not self.autostart:  # else it is the process's last line
                self.get_logger().error(f"not configured: {error}")
            self._undo()
            return TransitionCallbackReturn.FAILURE
        except Exception:
            self._tell_defect()
            return TransitionCallbackReturn.ERROR
        return super().on_configure(state)

    def _tell_defect(self) -> None:
        """Log the error under way: rclpy would drop it without a word."""
        if self.context.ok():  # at the end of the process it is none
            self.get_logger().fatal(traceback.format_exc())

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Begin to work."""
        result = super().on_activate(state)
        for i in self.inputs:
            i.excuse()
        try:
            self.start()
        except Exception:
            self._tell_defect()
            return TransitionCallbackReturn.ERROR
        libraries_step_back()
        return result

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Pause work."""
        self.stop()
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Forget everything that configuring made."""
        result = super().on_cleanup(state)
        self._undo()
        return result

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop and forget everything."""
        if state.label == "active":
            self.stop()
        result = super().on_shutdown(state)
        self._undo()
        return result
