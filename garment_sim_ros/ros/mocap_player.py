"""`mocap_player`: a clip as joint states, with the skeleton that they move."""

import sys

from builtin_interfaces.msg import Time
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

from garment_sim_ros.body.humanoid import load_humanoid_overrides
from garment_sim_ros.errors import ParameterError
from garment_sim_ros.mocap.clip import Clip
from garment_sim_ros.mocap.clips import load_clip
from garment_sim_ros.mocap.sampling import ClipSampler, rate_of
from garment_sim_ros.mocap.source_urdf import urdf_from_clip
from garment_sim_ros.params import MocapPlayerParameters
from garment_sim_ros.ros.diagnostics import Condition
from garment_sim_ros.ros.lifecycle import ManagedNode
from garment_sim_ros.ros.place import ALONE, Place
from garment_sim_ros.ros.process import run
from garment_sim_ros.ros.serialize import Joints
from garment_sim_ros.ros.shared import shared
from garment_sim_ros.ros.topics import CLOCK, JOINT_STATES, ROBOT_DESCRIPTION
from garment_sim_ros.stamps import SECOND

_LONGEST_STALL = 60 * SECOND
"""A stamp so far from the one before is of a clock that was set [ns]."""


def read_clip(source: str, *, bone_names: str) -> Clip:
    """A clip, with a file that names its bones, or none.

    Raises:
        InputFileError: A file cannot be used.
    """
    names = load_humanoid_overrides(bone_names) if bone_names else None
    return load_clip(source, humanoid_overrides=names)


class MocapPlayer(ManagedNode[MocapPlayerParameters]):
    """Plays on an absolute schedule: stamps are evenly spaced and do not drift."""

    def __init__(self, place: Place = ALONE) -> None:
        super().__init__("mocap_player", MocapPlayerParameters, place)
        self._sent = 0
        self._clip_time = 0.0
        self._stamp = 0
        self._holds = True
        self._is_early = False
        self._paused = False
        self.create_service(Trigger, "~/reset", self._reset)
        self.create_service(SetBool, "~/pause", self._pause)

    def prepare(self) -> None:
        """Load the clip.

        Raises:
            InputFileError: It cannot be used.
            ParameterError: The node would be its own clock's follower.
        """
        p = self.parameters
        self.check_clock(simulated=bool(self.get_parameter("use_sim_time").value))
        clip = shared(read_clip, p.clip, bone_names=p.bone_names)
        for note in clip.notes:
            self.get_logger().info(f"{clip.name}: {note}")
        repeat = ("carry" if p.travel else "loop") if p.loop else "once"
        self._rate = p.rate or rate_of(clip)
        self._sampler = ClipSampler(clip, repeat)
        self._message = Joints(clip.rig.dofs.names, p.frame_id)
        # Compiles what the timer will run, in the first round and in later ones.
        for rounds in (0.5, 1.5):
            self._message.fill(0, self._sampler.sample(rounds * clip.duration))
        self._urdf = urdf_from_clip(clip, p.frame_id)
        self._joints = self.advertise(JOINT_STATES)
        self._description = self.advertise(ROBOT_DESCRIPTION)
        self._clock_topic = self.advertise(CLOCK) if p.publish_clock else None
        self._clip_time = 0.0
        self.get_logger().info(
            f"plays {clip.name}: {clip.duration:.2f} s, {len(clip.rig.dofs)} channels, "
            f"{self._rate:.4g} Hz"
        )

    def start(self) -> None:
        """Publish the skeleton, then joint states from where the clip is."""
        self._holds = self._is_early = True
        self._description.publish(String(data=self._urdf))
        self._ticker = self.tick_at(self._rate, self._tick)

    def stop(self) -> None:
        """Keep the place in the clip."""
        self.stop_ticking()

    def check_clock(self, *, simulated: bool) -> None:
        """A clock cannot follow itself."""
        if simulated and self.parameters.publish_clock:
            raise ParameterError("use_sim_time", "found true", "allowed: false with publish_clock")

    def condition(self) -> Condition:
        """What is played."""
        wanted = self.parameters.wait_for_subscribers
        state = f"waits for {wanted} subscribers" if self._is_early and wanted else self.state
        return Condition(
            text="paused" if self._paused else state,
            values={"messages": self._sent, "clip_time_s": self._clip_time},
        )

    def _tick(self, due: int, ticks: int) -> None:
        wanted = self.parameters.wait_for_subscribers
        self._is_early = self._is_early and self._joints.get_subscription_count() < wanted
        if self._is_early:
            return
        period = self._ticker.period
        before = self._stamp
        if self._clock_topic is None:
            self._stamp = due
        else:
            # Time 0 would mean that there is no time yet.
            self._stamp += ticks * period
            self._clock_topic.publish(
                Clock(clock=Time(sec=self._stamp // SECOND, nanosec=self._stamp % SECOND))
            )
        passed = self._stamp - before
        if not 0 <= passed <= _LONGEST_STALL:
            passed = ticks * period  # the clock was set
        # The place in the clip is that of the stamp: after a stall both have moved on.
        if not (self._paused or self._holds):
            self._clip_time += self.parameters.speed * passed / SECOND
        self._holds = False
        self._joints.publish(
            self._message.fill(self._stamp, self._sampler.sample(self._clip_time))
        )
        self._sent += 1

    def _reset(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._clip_time = 0.0
        self._holds = True  # the next message shows the beginning
        response.success, response.message = True, "at the beginning of the clip"
        return response

    def _pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self._paused = bool(request.data)
        response.success = True
        response.message = "the body stands still" if self._paused else "playing"
        return response


def main(argv: list[str] | None = None) -> int:
    """Entry point of the executable."""
    return run("mocap_player", MocapPlayer, argv)


if __name__ == "__main__":
    sys.exit(main())
