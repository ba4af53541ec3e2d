"""Feet are drawn into a long skirt where the body crouches; it is worn all the same."""

import numpy as np
import pytest

import garment_sim_ros as gs


@pytest.mark.parametrize(
    ("body", "clip"),
    [
        ("mannequin:height=1.5", "deepmimic_jump.bvh"),
        # A kick turns the trunk: a way from hull to hull left the waist band.
        ("mannequin:height=1.75", "deepmimic_spinkick.bvh"),
    ],
)
def test_a_long_skirt_that_is_worn_is_not_wound_back(data_file, body, clip):
    avatar = gs.Avatar.load(body)
    outfit = avatar.dress("tshirt_long_skirt")
    simulation = gs.Simulation(outfit, avatar.colliders)
    skirt = next(g for g in outfit.garments if "skirt" in g.name)
    hem = np.argsort(skirt.vertices[:, 2])[:40]
    feet = [k for k, c in enumerate(avatar.colliders.colliders) if c.bone.endswith("Foot")]
    drawn_in = 0
    for poses in avatar.play(gs.load_clip(data_file("mocap", clip)), rate=60):
        simulation.step(poses, dt=1 / 60)
        lowest = simulation[skirt.name].positions[hem, 2].max()
        drawn_in += bool(poses.position[feet, 2].min() > lowest)
    if "jump" in clip:
        assert drawn_in > 5
    for name in simulation.names:
        health = simulation[name].health
        assert (health.came_off, health.rewound, health.not_rewound) == (0, 0, 0)
