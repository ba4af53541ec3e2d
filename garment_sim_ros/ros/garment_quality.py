"""What is told of one garment in each frame."""

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from garment_sim_ros.recording.worn_watch import WornWatch
from garment_sim_ros.ros.status import status
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.sim.strain import StrainMeter
from garment_sim_ros.stamps import SECOND


class GarmentQuality:
    """Figures of one garment, for the topic `quality`.

    Args:
        name: The garment's name.
        simulation: Simulates it.
        watch: Looks whether it stays worn.
    """

    def __init__(self, name: str, simulation: Simulation, watch: WornWatch) -> None:
        self._name = name
        self._simulation = simulation
        self._watch = watch
        self._model = simulation.model(name)
        self._strain = StrainMeter(self._model)

    def status(self, figures: dict[str, object], *, resets: int) -> DiagnosticStatus:
        """One frame's status.

        Args:
            figures: What belongs to the frame and not to the garment.
            resets: Times all garments were put on anew.
        """
        health = self._simulation.health(self._name)
        if (model := self._simulation.model(self._name)) is not self._model:
            # Other vertices are simulated now.
            self._model, self._strain = model, StrainMeter(model)
        strain = self._strain.read(self._simulation.state(self._name))
        values: dict[str, object] = {
            **figures,
            **self._watch.figures(self._name)._asdict(),
            "pierced_by": len(self._watch.pierced_by(self._name)),
            "inside": self._watch.inside(self._name),
            "strain_p95": strain.p95,
            "strain_max": strain.largest,
            "contacts": health.contacts,
            "rms_speed": health.rms_speed,
            "max_speed": health.max_speed,
            "resets": health.resets + resets,
            "rewound": health.rewound + health.rewound_parts,
            "recovered": health.recovered,
            "held": health.held,
            "let_go": health.let_go,
            "tangled": health.tangled,
            "layer": self._simulation.layer(self._name),
        }
        well = health.resets == 0 and health.recovered == 0
        return status(self._name, values.items(), well=well)


def quality(statuses: list[DiagnosticStatus], stamp: int) -> DiagnosticArray:
    """The message of one frame, shown at a simulated time [ns]."""
    message = DiagnosticArray(status=statuses)
    message.header.stamp = Time(sec=stamp // SECOND, nanosec=stamp % SECOND)
    return message
