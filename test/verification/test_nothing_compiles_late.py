"""All that frames run is compiled before the first, whatever the scene has; nothing else is."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from garment_sim_ros.contact.shapes import Collider, ColliderSet
from garment_sim_ros.sim.warm_up import Features, Scene

pytest.importorskip("rclpy")

SCRIPT = Path(__file__).with_name("compiled_late.py")
SKIRT = {"name": "skirt", "generator": "short_skirt", "options": {"vertices": 300}}
SHIRT = {"name": "shirt", "generator": "tshirt", "options": {"vertices": 400}}
HELD = {**SKIRT, "max_distance": 0.1, "backstop": 0.02, "tethers": True}
SOFT = {**SKIRT, "attachment_stiffness": 100.0, "attachment_damping": 1.0}
OVER = {**SKIRT, "layer": 1, "self_collision": True}
WINDY = {"wind": [1.0, 0.0, 0.0], "root_linear_inertia": 0.5}


def scene(*garments, method="capsules", **asked):
    content = {"garments": list(garments), "colliders": {"method": method}}
    return {"outfit": content, **asked}


SCENES = {
    "plain": scene(SHIRT, SKIRT),
    "auto, detail": scene(SHIRT, HELD, auto=True, detail=0.3),
    "held": scene(HELD),
    "soft": scene(SOFT),
    "layers, self-collision, wind": scene(SHIRT, OVER, environment=WINDY),
    "held layers": scene(SHIRT, {**HELD, "layer": 1}, environment=WINDY),
    "relaxation": scene(SHIRT, {**HELD, "layer": 1}, solver="relaxation", environment=WINDY),
    "implicit": scene(SKIRT, solver="implicit"),
    "implicit, held, soft": scene(
        {**SOFT, "max_distance": 0.1, "backstop": 0.02}, solver="implicit", environment=WINDY
    ),
    "spheres": scene(SKIRT, method="spheres"),
    "ellipsoids": scene(SKIRT, method="ellipsoids"),
    "earliest": scene(
        SKIRT, method="ellipsoids", solver="relaxation", settings={"contact": "earliest"}
    ),
    "hulls": scene(SKIRT, method="hulls"),
    "sdf": scene(SKIRT, method="sdf"),
    "mesh": scene(SKIRT, method="mesh", solver="relaxation"),
    "bare skin": scene(SKIRT, bare=True),
}
QUICK = ("auto, detail", "layers, self-collision, wind", "bare skin")
"""What "plain" has is all in the first two."""


@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=() if n in QUICK else pytest.mark.slow) for n in SCENES],
)
def test_nothing_is_compiled_or_loaded_in_a_frame(name):
    words = [sys.executable, str(SCRIPT), json.dumps(SCENES[name])]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout.splitlines()[-1]) == []


def test_a_scene_tells_what_garments_and_colliders_have(cloth):
    vertices, triangles = cloth.grid(3, 3)
    ball = Collider(name="b", kind="sphere", bone="bone", geometry={"radius": 0.1})
    colliders: ColliderSet = cloth.colliders(ball)
    pinned = cloth.garment(vertices, triangles, pins=(0,))
    free = cloth.garment(vertices, triangles, name="free")
    assert Scene.of(colliders, (pinned, free, pinned)) == Scene(
        kinds=frozenset({"sphere"}),
        garments=frozenset({Features(), Features(pinned=False)}),
    )
