"""Garments on moving avatars in real time, over ROS 2 or from Python.

```python
import garment_sim_ros as gs

avatar = gs.Avatar.load("mannequin")
simulation = gs.Simulation(avatar.dress("tshirt_short_skirt"), avatar.colliders)
for poses in avatar.play(gs.load_clip("walk"), rate=60):
    simulation.step(poses, dt=1 / 60)
    x = simulation["tshirt"].positions
```

Names are imported when they are first used.
"""

import importlib
from typing import TYPE_CHECKING, Any

from garment_sim_ros.version import VERSION

if TYPE_CHECKING:
    from garment_sim_ros.avatar import Avatar
    from garment_sim_ros.body.loaders.load import load_body
    from garment_sim_ros.contact.plain_shapes import box, capsule, ellipsoid, hull, sphere
    from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet
    from garment_sim_ros.errors import (
        GarmentSimError,
        GeometryError,
        InputFileError,
        MessageError,
        ParameterError,
    )
    from garment_sim_ros.garment.garment import Garment
    from garment_sim_ros.garment.outfit import Outfit, load_outfit
    from garment_sim_ros.mocap.clip import Clip
    from garment_sim_ros.mocap.clips import load_clip
    from garment_sim_ros.params import ColliderOptions, Environment, Material
    from garment_sim_ros.sim.garment_view import GarmentView
    from garment_sim_ros.sim.simulation import Simulation

__version__ = VERSION

_MODULE_OF = {
    "Avatar": "avatar",
    "Clip": "mocap.clip",
    "Collider": "contact.shapes",
    "ColliderOptions": "params",
    "ColliderPoses": "contact.shapes",
    "ColliderSet": "contact.shapes",
    "Environment": "params",
    "Garment": "garment.garment",
    "GarmentSimError": "errors",
    "GarmentView": "sim.garment_view",
    "GeometryError": "errors",
    "InputFileError": "errors",
    "Material": "params",
    "MessageError": "errors",
    "Outfit": "garment.outfit",
    "ParameterError": "errors",
    "Simulation": "sim.simulation",
    "box": "contact.plain_shapes",
    "capsule": "contact.plain_shapes",
    "ellipsoid": "contact.plain_shapes",
    "hull": "contact.plain_shapes",
    "load_body": "body.loaders.load",
    "load_clip": "mocap.clips",
    "load_outfit": "garment.outfit",
    "sphere": "contact.plain_shapes",
}
"""Where the public names are."""

__all__ = [
    "Avatar",
    "Clip",
    "Collider",
    "ColliderOptions",
    "ColliderPoses",
    "ColliderSet",
    "Environment",
    "Garment",
    "GarmentSimError",
    "GarmentView",
    "GeometryError",
    "InputFileError",
    "Material",
    "MessageError",
    "Outfit",
    "ParameterError",
    "Simulation",
    "box",
    "capsule",
    "ellipsoid",
    "hull",
    "load_body",
    "load_clip",
    "load_outfit",
    "sphere",
]


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(f"{__name__}.{_MODULE_OF[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
