"""Hardly any skin shows through a skirt over knees and shins that run."""

import numpy as np
import pytest

import garment_sim_ros as gs
from garment_sim_ros.colliders.skin_from_poses import SkinFromPoses
from garment_sim_ros.recording.metrics import ClothMeter, GarmentMesh


@pytest.mark.parametrize(
    ("body", "detail", "most"),
    [
        ("mannequin", 1.0, 0.0005),
        ("mannequin", 0.25, 0.008),
        ("mh_female_young.glb", 1.0, 0.0005),
    ],
)
def test_hardly_any_skin_shows_through_a_skirt(data_file, body, detail, most):
    avatar = gs.Avatar.load(str(data_file("bodies", body)) if body.endswith("glb") else body)
    outfit = avatar.dress("tshirt_long_skirt")
    simulation = gs.Simulation(outfit, avatar.colliders, detail=detail)
    skin = SkinFromPoses(avatar.colliders, avatar.body)
    meshes = {g.name: GarmentMesh.of(g) for g in outfit.garments}
    shown, simulated = (
        ClothMeter(avatar.body.skin.vertices, avatar.body.skin.triangles, meshes) for _ in range(2)
    )
    for n, poses in enumerate(
        avatar.play(gs.load_clip(data_file("mocap", "deepmimic_run.bvh")), rate=60)
    ):
        simulation.step(poses, dt=1 / 60)
        if n % 3 == 0:
            x = {name: simulation.positions(name).astype(np.float64) for name in meshes}
            off = {name: simulation[name].worn.aside.off for name in meshes}
            vertices = skin.vertices(poses)
            shown.add(vertices, x)
            simulated.add(vertices, {name: x[name] - off[name] for name in meshes})
    before, after = (meter.result()["skin_shows_p99"] for meter in (simulated, shown))
    assert after < most
    assert after < 0.5 * before
