"""What a cloth node publishes of its garments, frame by frame."""

from collections import deque
from collections.abc import Mapping

from garment_sim_ros.lateness import LateFrames
from garment_sim_ros.params import ClothNodeParameters
from garment_sim_ros.recording.worn_watch import WornWatch
from garment_sim_ros.ros.cloth_stepper import ClothStepper
from garment_sim_ros.ros.dresser import Dressed
from garment_sim_ros.ros.garment_publishers import GarmentPublishers
from garment_sim_ros.ros.garment_quality import GarmentQuality, quality
from garment_sim_ros.ros.lifecycle import ManagedNode
from garment_sim_ros.ros.topics import QUALITY
from garment_sim_ros.stamps import SECOND

_KEPT_AGES = 10_000


class ClothFrames:
    """Publishes frames and counts them.

    Args:
        node: The node that publishes.

    Attributes:
        count: Frames published so far.
        late: Counts the late ones.
        ages: Time from the stamps of the latest ones until they were published [ms].
        step_ms: Time that the solver took for the frame that is published next [ms].
    """

    def __init__(self, node: ManagedNode) -> None:
        self._node = node
        self.count, self.late, self.step_ms = 0, LateFrames(), 0.0
        self.ages: deque[float] = deque(maxlen=_KEPT_AGES)
        self.release()

    def advertise(self) -> None:
        """Offer what does not depend on the garments."""
        self._quality = self._node.advertise(QUALITY)

    def release(self) -> None:
        """Let go of the garments; topics end by themselves."""
        self._topics: dict[str, GarmentPublishers] = {}
        self._qualities: list[GarmentQuality] = []

    def show(self, dressed: Dressed, p: ClothNodeParameters) -> None:
        """Publish from now on these garments."""
        self._watch: WornWatch = dressed.watch
        simulation = dressed.simulation
        self._qualities = [
            GarmentQuality(name, simulation, dressed.watch) for name in simulation.names
        ]
        for number, garment in enumerate(dressed.garments):
            if garment.name not in self._topics:
                self._topics[garment.name] = GarmentPublishers(self._node, garment.name, p)
            self._topics[garment.name].show(garment, number)

    def publish(self, stepper: ClothStepper, paced: Mapping[str, object]) -> None:
        """Publish a frame, unless there is none that may be shown.

        Args:
            stepper: Of the garments.
            paced: What else is told of the frame.
        """
        if stepper.time is None or stepper.is_behind:
            return
        shown = {
            name: self._topics[name].publish(stepper.simulation, stepper.time)
            for name in stepper.simulation.names
        }
        now = self._node.get_clock().now().nanoseconds
        self.late.published(now)
        self.ages.append(1e-6 * (now - stepper.time))
        self._watch.look(stepper.poses, shown)
        self.count += 1
        if self._quality.get_subscription_count():
            figures = {
                **{"step_ms": self.step_ms, "late_frames": self.late.count},
                **{"coarse_s": stepper.coarse / SECOND, "skipped_s": stepper.skipped / SECOND},
                **paced,
            }
            of_all = [q.status(figures, resets=stepper.resets) for q in self._qualities]
            self._quality.publish(quality(of_all, stepper.time))

    def figures(self) -> dict[str, object]:
        """What goes to diagnostics."""
        return {
            "frames": self.count,
            "late_frames": self.late.count,
            "step_ms": self.step_ms,
            "age_ms": self.ages[-1] if self.ages else 0.0,
            **self._watch.figures()._asdict(),
        }
