"""Where a node lives: in a process of its own, or beside others in one."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from rclpy.context import Context
from rclpy.parameter import Parameter

from garment_sim_ros.ros.handover import Handover

_WITHOUT = {"start_type_description_service": False}
"""Of nodes that come and go: this service of rclpy 7.1 leaves 105 KiB of each node behind."""


@dataclass(frozen=True, kw_only=True)
class Place:
    """A node's surroundings.

    Attributes:
        context: Its context; None: that of the process, and the command line is the node's.
        namespace: Its namespace, without a command line.
        parameters: Its parameters, without a command line.
        handover: Topics that it shares with others of its process; None: none.
        origin: A time of the grid that it ticks on [ns]; None: as it comes.
    """

    context: Context | None = None
    namespace: str = ""
    parameters: Mapping[str, Any] = field(default_factory=dict)
    handover: Handover | None = None
    origin: int | None = None

    def options(self) -> dict[str, Any]:
        """What `rclpy` is told."""
        if self.context is None:
            return {}
        return {
            "context": self.context,
            "namespace": self.namespace,
            "use_global_arguments": False,
            "parameter_overrides": [
                Parameter(name, value=list(value) if isinstance(value, tuple) else value)
                for name, value in {**_WITHOUT, **self.parameters}.items()
            ],
        }


ALONE = Place()
"""In a process of its own."""
