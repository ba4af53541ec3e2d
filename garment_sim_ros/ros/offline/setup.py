"""What a simulation without nodes is made with, and its text in the recording."""

import dataclasses
import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from garment_sim_ros.declaration import declarations, validated
from garment_sim_ros.errors import InputFileError, ParameterError
from garment_sim_ros.params import (
    ClothNodeParameters,
    ColliderNodeParameters,
    Environment,
    MocapPlayerParameters,
)
from garment_sim_ros.sim.model import Parameters
from garment_sim_ros.sim.solvers import SOLVERS
from garment_sim_ros.version import VERSION

_VERSION = 2
_PIECE = 2**20
JOINTS, POSES = "joint_states", "collider_poses"


@dataclasses.dataclass(frozen=True, kw_only=True)
class Setup:
    """Parameters as the nodes have them.

    Attributes:
        player: Of `mocap_player`.
        collider: Of `collider_node`.
        cloth: Of `cloth_node`.
        forces: Outer forces, and the solver's own parameters.
        begins_with: What is worked out anew: from joint_states on, or from collider_poses.
        markers: Whether there are markers for people who look.
        files: SHA-256 of each file that was read, by the option that named it.
    """

    player: MocapPlayerParameters
    collider: ColliderNodeParameters
    cloth: ClothNodeParameters
    forces: Parameters
    begins_with: str = JOINTS
    markers: bool = False
    files: Mapping[str, str] = dataclasses.field(default_factory=dict)

    @classmethod
    def of(
        cls,
        nodes: Mapping[str, Mapping[str, Any]],
        *,
        begins_with: str = JOINTS,
        markers: bool = False,
        files: Mapping[str, str] | None = None,
    ) -> "Setup":
        """From parameters by node, as a parameter file of the nodes has them.

        Raises:
            ParameterError: One is unknown or not allowed.
        """
        if begins_with not in (JOINTS, POSES):
            raise ParameterError(
                "begins_with", f"found {begins_with!r}", f"allowed: {JOINTS}, {POSES}"
            )
        of_cloth = dict(nodes.get("cloth_node", {}))
        solver = of_cloth.get("solver", declarations(ClothNodeParameters)["solver"].default)
        cloth = {k: of_cloth.pop(k) for k in declarations(ClothNodeParameters) if k in of_cloth}
        outer = {k: of_cloth.pop(k) for k in declarations(Environment) if k in of_cloth}
        # Each message of poses is simulated up to, as live with the same setting.
        checked = validated(ClothNodeParameters, {**cloth, "step_on": "poses"})
        return cls(
            player=validated(MocapPlayerParameters, nodes.get("mocap_player", {})),
            collider=validated(ColliderNodeParameters, nodes.get("collider_node", {})),
            cloth=checked,
            forces=Parameters(
                environment=validated(Environment, outer),
                settings=validated(SOLVERS[solver].settings, of_cloth),
            ),
            begins_with=begins_with,
            markers=markers,
            files=dict(files or {}),
        )

    @property
    def text(self) -> str:
        """All of it as JSON, the same for the same values."""
        return json.dumps(
            {
                "version": _VERSION,
                "package": VERSION,
                "begins_with": self.begins_with,
                "markers": self.markers,
                "files": dict(self.files),
                "parameters": {
                    "mocap_player": dataclasses.asdict(self.player),
                    "collider_node": dataclasses.asdict(self.collider),
                    "cloth_node": {
                        **dataclasses.asdict(self.cloth),
                        **dataclasses.asdict(self.forces.environment),
                        **dataclasses.asdict(self.forces.settings),
                    },
                },
            },
            sort_keys=True,
        )

    @classmethod
    def from_text(cls, text: str, path: object) -> "Setup":
        """What a recording says that it was made with.

        Args:
            text: From `text`.
            path: The recording, for messages.

        Raises:
            InputFileError: It is not such a text.
        """
        try:
            told = json.loads(text)
            if told["version"] != _VERSION:
                raise ValueError(f"version {told['version']!r}")
            return cls.of(
                {str(node): dict(values) for node, values in told["parameters"].items()},
                begins_with=told["begins_with"],
                markers=bool(told["markers"]),
                files={str(k): str(v) for k, v in told["files"].items()},
            )
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            raise InputFileError(
                path,
                f"does not say what it was simulated with ({type(error).__name__}: {error})",
                "allowed: what simulate wrote",
            ) from None


def fingerprint(source: str) -> str:
    """SHA-256 of a file, or of all files of a folder; empty for what is built in."""
    path = Path(source)
    if not path.exists():
        return ""
    files = sorted(p for p in path.iterdir() if p.is_file()) if path.is_dir() else [path]
    digest = hashlib.sha256()
    try:
        for file in files:
            if not file.is_file():
                raise InputFileError(source, "is no regular file", "allowed: a file or a folder")
            digest.update(f"{file.name}\0{file.stat().st_size}\0".encode())
            with file.open("rb") as opened:
                while piece := opened.read(_PIECE):
                    digest.update(piece)
    except OSError as error:
        raise InputFileError(source, error.strerror or str(error), "allowed: a file") from None
    return digest.hexdigest()
