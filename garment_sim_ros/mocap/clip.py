"""A motion capture clip: a source skeleton and its channel values over time."""

from dataclasses import dataclass

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.anatomy import SourceReference
from garment_sim_ros.body.rig import Rig
from garment_sim_ros.errors import GeometryError

NamedVector = tuple[str, tuple[float, float, float]]


@dataclass(frozen=True, kw_only=True)
class Clip:
    """Channel values of a rig at increasing times.

    The rig keeps the *file's* axes (its channels turn about the file's x, y, z), in metres;
    `T_world_file` turns them to z up, x forward. It is the fixed joint at the root of the URDF
    that the player publishes.

    Attributes:
        name: Short name for logs and files.
        rig: Source skeleton; its channels are the names in `JointState`.
        times: Sample times from 0 [s], shape [f], strictly increasing.
        values: Channel values [rad or m], shape [f, d].
        T_world_file: Rigid transform from file axes to z up, shape [4, 4].
        reference: Channel values of a pose in which the body stands recognisably, for retargeting
            where the zero pose is no body pose, shape [d]; None if the zero pose will do.
        end_sites: Name of a joint and where its bone ends, in that joint's frame [m], for joints
            that end in the air: head, toes, fingers.
        hinges: Name of a joint of an upper arm or leg and the axis about which its elbow or knee
            bends, in that joint's frame.
        soles: Name of a foot's joint and what is up in its frame when it stands flat.
        ankle_height: World height of the ankle of a foot that stands on the ground [m]; None
            where the clip does not tell.
        loops: Whether the last sample continues into the first one without a seam.
        notes: What the loader assumed (unit, axes, skipped frames), one sentence each.
    """

    name: str
    rig: Rig
    times: FloatArray
    values: FloatArray
    T_world_file: FloatArray
    reference: FloatArray | None = None
    end_sites: tuple[NamedVector, ...] = ()
    hinges: tuple[NamedVector, ...] = ()
    soles: tuple[NamedVector, ...] = ()
    ankle_height: float | None = None
    loops: bool = False
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        f, d = len(self.times), len(self.rig.dofs)
        if self.values.shape != (f, d) or f == 0:
            raise GeometryError(f"clip values must have shape [{f} > 0, {d}]")
        if not (np.isfinite(self.values).all() and np.isfinite(self.times).all()):
            raise GeometryError("clip values and times must be finite")
        if (np.diff(self.times) <= 0.0).any():
            raise GeometryError("clip times must increase")

    @property
    def source_reference(self) -> SourceReference:
        """What retargeting needs beside the rig."""
        pose = {} if self.reference is None else dict(zip(self.rig.dofs.names, self.reference))
        return SourceReference(
            values={name: float(value) for name, value in pose.items()},
            end_sites={joint: np.array(offset) for joint, offset in self.end_sites},
            hinges={joint: np.array(axis) for joint, axis in self.hinges},
            soles={joint: np.array(axis) for joint, axis in self.soles},
            ankle_height=self.ankle_height,
        )

    @property
    def duration(self) -> float:
        """Length [s]."""
        return float(self.times[-1] - self.times[0])
