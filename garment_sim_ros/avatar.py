"""An avatar: a body with its fitted colliders, to be dressed and to be moved."""

import dataclasses
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.skin import Body
from garment_sim_ros.body.skinning import Skinner
from garment_sim_ros.colliders.description import load_colliders
from garment_sim_ros.colliders.fit_cache import cached_fit
from garment_sim_ros.colliders.fitting import fit_colliders
from garment_sim_ros.colliders.posing import ColliderPoser
from garment_sim_ros.contact.shapes import WORLD, ColliderPoses, ColliderSet
from garment_sim_ros.errors import ParameterError
from garment_sim_ros.garment.garment import Garment
from garment_sim_ros.garment.generators import GENERATORS
from garment_sim_ros.garment.mesh import GarmentMesh
from garment_sim_ros.garment.outfit import Outfit, load_outfit, make_outfit
from garment_sim_ros.garment.outfit_file import GARMENT_KEYS, outfit_from
from garment_sim_ros.mocap.clip import Clip
from garment_sim_ros.mocap.clip_poses import retargeter
from garment_sim_ros.mocap.clips import load_clip
from garment_sim_ros.mocap.sampling import ClipSampler
from garment_sim_ros.params import ColliderOptions, Material, declarations, validated
from garment_sim_ros.presets import collider_options, worn_with

_MESHES = (".obj", ".ply", ".glb", ".gltf")
_OF_NAMES = re.compile(r"[^a-z0-9_]+")


class Avatar:
    """A body and what cloth on it meets.

    Args:
        body: Rig and skin.
        colliders: Shapes on its bones.
        attachments: What holds garments of which nothing is said, see `dressing.dressed`.

    Attributes:
        body: As given.
        colliders: As given.
        attachments: As given.

    Raises:
        GeometryError: A collider's bone is not a joint of the body's rig.
    """

    def __init__(self, body: Body, colliders: ColliderSet, *, attachments: str = "auto") -> None:
        self.body = body
        self.colliders = colliders
        self.attachments = attachments
        self._poser = ColliderPoser(colliders, body)
        self._skinner: Skinner | None = None

    @classmethod
    def load(
        cls,
        source: str | Path = "mannequin",
        *,
        colliders: str | Path | ColliderSet | None = None,
        bone_names: Mapping[str, str | None] | None = None,
        cache: bool = True,
        preset: str | None = None,
        **options: Any,
    ) -> "Avatar":
        """A body with colliders fitted to it.

        Args:
            source: A .glb, .gltf, .vrm, .urdf, .obj or .ply file; or ``mannequin``, with options
                as in ``mannequin:height=1.8``.
            colliders: Colliders of this body, or a file that `fit` wrote; None fits some.
            bone_names: Humanoid bone to joint name, where names of joints do not tell.
            cache: Whether to keep the fit, beside the body's file or in the user's cache folder,
                and to use one that was kept.
            preset: Name of a preset, see `presets`, for what `options` do not say, and for what
                holds garments and how the skin follows its bones.
            options: How to fit, see `params.ColliderOptions`, as ``method="capsules"``.

        Raises:
            InputFileError: A file cannot be used.
            GeometryError: The body cannot be fitted.
            ParameterError: An unknown option or preset, or a value that is not allowed.
        """
        how = validated(ColliderOptions, {**collider_options(preset), **options})
        attachments, skinning = worn_with(preset)
        body = load_body(source, humanoid_overrides=bone_names)
        body = dataclasses.replace(body, skinning=skinning)
        if colliders is None:
            colliders = cached_fit(body, how, source) if cache else fit_colliders(body, how)
        elif not isinstance(colliders, ColliderSet):
            colliders = load_colliders(colliders)
        return cls(body, colliders, attachments=attachments)

    def dress(
        self,
        wear: str | Path | Mapping[str, Any] | Garment | GarmentMesh | Outfit = "",
        **options: Any,
    ) -> Outfit:
        """Garments made for this body in its rest pose, let out to fit over its colliders.

        Args:
            wear: An outfit: a .yaml file, the name of a built-in one, or what such a file says.
                Or one garment: a mesh file, the name of a built-in one, one in its place on the
                body, or a sewing pattern (.json), which is cut, sewn and draped.
                Empty: a T-shirt over a short skirt.
            options: Of one garment, as an outfit file has them: `name`, `material`, `layer`,
                `attachments`, `self_collision` ... and those of a built-in garment (`length`) or
                of a mesh file (`unit`, `up`, `edge_length`) or of a pattern (`edge_length`).

        Raises:
            InputFileError: A file cannot be used.
            GeometryError: The body lacks bones or skin that a garment needs.
            ParameterError: An option is unknown or not allowed.
        """
        if isinstance(wear, Garment) and wear.frames != (WORLD,):
            wear = Outfit(name=wear.name, garments=(wear,), text="", colliders=ColliderOptions())
        if isinstance(wear, Garment | GarmentMesh):
            return self._dress_in_mesh(wear, options)
        if isinstance(wear, str | Path) and Path(wear).suffix.lower() == ".json":
            return self._dress_in_pattern(wear, options)
        source = "outfit"
        if isinstance(wear, str | Path):
            generator = str(wear) in GENERATORS
            if generator or Path(wear).suffix.lower() in _MESHES:
                of = {"generator": str(wear)} if generator else {"mesh": str(wear)}
                name = _OF_NAMES.sub("_", Path(wear).stem.lower()).strip("_")
                source = str(wear)
                wear = {"version": 1, "garments": [_entry({"name": name} | of, options)]}
                options = {}
        if options:
            known = ", ".join(sorted(options))
            raise ParameterError(known, "given for an outfit", "allowed: for one garment")
        if isinstance(wear, Outfit):
            return wear
        if isinstance(wear, Mapping):
            return make_outfit(outfit_from(wear, source=source), self.body, **self._ways)
        from garment_sim_ros.garment.outfit_file import DEFAULT_OUTFIT

        return load_outfit(wear or DEFAULT_OUTFIT, self.body, **self._ways)

    @property
    def _ways(self) -> dict[str, Any]:
        """How garments are put on: what they lie on and what holds them."""
        return {"colliders": self.colliders, "attachments": self.attachments}

    def _dress_in_pattern(self, source: str | Path, options: Mapping[str, Any]) -> Outfit:
        """One garment sewn from a pattern file; `edge_length` is an option of it."""
        from garment_sim_ros.garment.patterns.making import Model, make

        asked = dict(options)
        fabric = asked.get("material", "cotton_jersey")
        made = make(
            source,
            Model(self.body),
            edge_length=asked.pop("edge_length", None),
            fabric=fabric if isinstance(fabric, str) else None,
        )
        name = _OF_NAMES.sub("_", made.name.lower()).strip("_")
        return self._dress_in_mesh(made.mesh, {"name": name, "material": made.fabric} | asked)

    def _dress_in_mesh(self, wear: Garment | GarmentMesh, options: Mapping[str, Any]) -> Outfit:
        """One garment whose surface is where it belongs on the body."""
        known: dict[str, Any] = {"name": "garment"}
        if isinstance(wear, Garment):
            known = {
                "name": wear.name,
                "material": {n: getattr(wear.material, n) for n in declarations(Material)},
                "layer": wear.layer,
                "self_collision": wear.self_collision or False,
                "attachments": "auto",
            }
            wear = GarmentMesh(vertices=wear.vertices, triangles=wear.triangles)
        entry = _entry(known | {"mesh": "mesh"}, options)
        return make_outfit(
            outfit_from({"version": 1, "garments": [entry]}),
            self.body,
            **self._ways,
            meshes={entry["name"]: wear},
        )

    def poses(self, T_world_joint: FloatArray | None = None) -> ColliderPoses:
        """World poses of the colliders, new ones.

        Args:
            T_world_joint: World transforms of the rig's joints, shape [n, 4, 4]; the rest pose
                where None.
        """
        T = rest_transforms(self.body.rig) if T_world_joint is None else T_world_joint
        return self._poser.poses(T)

    def skin(self, T_world_joint: FloatArray | None = None) -> FloatArray:
        """World positions of the skin's vertices [m], shape [v, 3]; arguments as for `poses`."""
        if self._skinner is None:
            self._skinner = Skinner.of(self.body)
        T = rest_transforms(self.body.rig) if T_world_joint is None else T_world_joint
        return self._skinner.vertices(T).copy()

    def play(
        self,
        clip: Clip | str | Path = "walk",
        rate: float = 60.0,
        *,
        seconds: float | None = None,
        repeat: str = "once",
    ) -> Iterator[ColliderPoses]:
        """World poses of the colliders over a clip, for `Simulation.step`.

        Args:
            clip: The motion, or what `load_clip` takes.
            rate: Poses per second [Hz].
            seconds: Length [s]; that of the clip where None.
            repeat: What follows after the clip's end: once, loop or carry, see `ClipSampler`.

        Yields:
            New poses for each 1 / rate seconds, the first for the clip's start.

        Raises:
            InputFileError: The clip cannot be used.
            GeometryError: The clip's skeleton or the body has no known hips.
            ParameterError: A rate or length that is not positive; another word.
        """
        return map(self.poses, self.joints(clip, rate, seconds=seconds, repeat=repeat))

    def joints(
        self,
        clip: Clip | str | Path = "walk",
        rate: float = 60.0,
        *,
        seconds: float | None = None,
        repeat: str = "once",
    ) -> Iterator[FloatArray]:
        """World transforms of the body's joints over a clip; arguments and errors as for `play`.

        Yields:
            New transforms, shape [n, 4, 4].
        """
        if not isinstance(clip, Clip):
            clip = load_clip(clip)
        length = clip.duration if seconds is None else seconds
        for name, value in (("rate", rate), ("seconds", length)):
            if not 0.0 <= value < np.inf or (name == "rate" and value == 0.0):
                raise ParameterError(name, f"found {value!r}", "allowed: above 0, finite")
        to_body, sampler = retargeter(clip, self.body), ClipSampler(clip, repeat)
        count = int(np.floor(length * rate + 1e-9)) + 1
        times = (n / rate for n in range(count))
        return (to_body.world_joints(sampler.sample(t), t).copy() for t in times)


def _entry(known: Mapping[str, Any], options: Mapping[str, Any]) -> dict[str, Any]:
    """One garment as an outfit file has it; what is no key of a garment is an option of it."""
    asked = dict(options)
    if isinstance(asked.get("material"), Material):
        asked["material"] = dataclasses.asdict(asked["material"])
    keys = {key: asked.pop(key) for key in GARMENT_KEYS if key in asked}
    entry = {**known, **keys}
    if asked:
        entry["options"] = {**entry.get("options", {}), **asked}
    return entry
