"""Scenes that all cloth simulators get, as plain arrays in one file each.

Lengths are in m, masses in kg, times in s; z is up. A file holds `vertices` [v, 3] (rest shape
and start), `triangles` [t, 3], `mass` [v], `pins` (vertices that ride on the shape), the numbers
below, the pose of the shape's frame at each frame, `position` [n + 1, 3] and `orientation`
[n + 1, 4] (x, y, z, w), and what F is measured on: the springs of the cloth, `spring_*`.
"""

from pathlib import Path

import numpy as np
from drape import MATERIAL, RADIUS
from springs import grid

from garment_sim_ros.params import Material
from garment_sim_ros.sim.model import build_model

FRAME = 1 / 60
FRAMES = 180
SHEET_NUMBERS = {"shape": "sphere", "radius": RADIUS, "length": 0.0}
LIMB = {"shape": "capsule", "radius": 0.05, "length": 0.5}
"""A capsule about its frame's z axis, its centre at the origin; length between the end points."""
SWING, BEATS = 1.1, 1.0
"""How far the limb swings to each side [rad], and how often [Hz]."""
TUBE = {"radius": 0.075, "length": 0.45, "around": 32, "along": 31}
PIVOT = np.array([0.0, 0.0, 1.5])


def tube() -> tuple[np.ndarray, np.ndarray]:
    """A tube around the limb at rest, its first ring at the top: vertices and triangles."""
    around, along = TUBE["around"], TUBE["along"]
    angle = 2.0 * np.pi * np.arange(around) / around
    ring = TUBE["radius"] * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=-1)
    heights = PIVOT[2] - 0.05 - np.linspace(0.0, TUBE["length"], along)
    vertices = np.concatenate([ring + np.array([0.0, 0.0, z]) for z in heights])
    index = np.arange(around * along).reshape(along, around)
    a, d = index[:-1], index[1:]
    b, c = np.roll(a, -1, axis=1), np.roll(d, -1, axis=1)
    triangles = np.concatenate([np.stack(q, -1).reshape(-1, 3) for q in ((a, d, c), (a, c, b))])
    return vertices, triangles.astype(np.int32)


def swinging() -> tuple[np.ndarray, np.ndarray]:
    """Poses of the limb: a pendulum about the y axis that is set going within half a second."""
    t = FRAME * np.arange(FRAMES + 1)
    begun = np.clip(2.0 * t, 0.0, 1.0)
    angle = SWING * np.sin(2.0 * np.pi * BEATS * t) * begun**2 * (3.0 - 2.0 * begun)
    zero = np.zeros_like(t)
    orientation = np.stack([zero, np.sin(angle / 2.0), zero, np.cos(angle / 2.0)], axis=-1)
    down = np.stack([-np.sin(angle), zero, -np.cos(angle)], axis=-1)
    return PIVOT + 0.5 * LIMB["length"] * down, orientation


def scene(name: str) -> dict[str, object]:
    """The arrays of a scene."""
    still = np.zeros((FRAMES + 1, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (FRAMES + 1, 1))
    numbers, (position, orientation) = SHEET_NUMBERS, still
    pins: list[int] = []
    if name == "limb":
        vertices, triangles = tube()
        numbers, (position, orientation) = LIMB, swinging()
        pins = list(range(TUBE["around"]))
    else:
        vertices, triangles = grid(50)
        vertices = vertices - [0.5, 0.5, 0.0] + np.array([0.0, 0.0, RADIUS + 0.05])
        if name == "hung":
            pins, position = [0, 49], still[0] - [0.0, 0.0, 100.0]
            vertices = vertices + np.array([0.0, 0.0, 1.0])
    model = build_model(name, vertices, triangles, Material(areal_density=MATERIAL.areal_density))
    springs = model.springs
    corners = vertices[triangles]
    sides = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = 0.5 * np.linalg.norm(np.cross(*sides), axis=1)
    mass = np.zeros(len(vertices))
    np.add.at(mass, triangles.ravel(), np.repeat(MATERIAL.areal_density * area / 3.0, 3))
    return {
        "vertices": vertices,
        "triangles": triangles,
        "mass": mass,
        "pins": np.array(pins, np.int64),
        "frame": FRAME,
        "frames": FRAMES,
        "gravity": 9.81,
        "density": MATERIAL.areal_density,
        "stretch": MATERIAL.stretch_stiffness_warp,
        "shear": MATERIAL.shear_stiffness,
        "bending": MATERIAL.bending_stiffness,
        "friction": MATERIAL.friction,
        "position": position,
        "orientation": orientation,
        "spring_x": np.ascontiguousarray(vertices[model.vertex], np.float32),
        "spring_particles": springs.particles,
        "spring_rest": springs.rest_length,
        "spring_share": springs.share,
        **numbers,
    }


SCENES = {
    "drape": "a sheet of 1 m x 1 m (2,500 vertices) falls on a sphere of radius 0.3 m",
    "hung": "the same sheet, held flat by two corners, is let go",
    "limb": "a tube (992 vertices) around a capsule that swings by 63 degrees to each side once a "
    "second; its upper ring rides on the capsule",
}


def write(name: str, folder: Path) -> Path:
    """A scene's file in `folder`."""
    path = folder / f"{name}.npz"
    np.savez(path, **scene(name))
    return path
