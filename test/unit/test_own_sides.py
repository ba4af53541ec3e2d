"""Cloth on the wrong side of a limb, on shapes where the answer is known."""

import numpy as np
import pytest

from garment_sim_ros.body.rig import Dofs, Rig
from garment_sim_ros.body.skin import Body, Skin
from garment_sim_ros.garment.garment import Garment
from garment_sim_ros.recording.metrics import ClothMeter, GarmentMesh
from garment_sim_ros.recording.own_sides import OwnSides

AROUND = 32
THIN, WIDE = 0.05, 0.1
"""Radius of the limb and of the tube that is worn on it [m]."""
LIMB = np.linspace(0.3, -0.9, 121)
"""How far along the limb, downwards, its rings are [m]; its root is at the top."""
CUTS = (-0.3, -0.55)
"""Where its joints are: a straight upper part, a bend, a lower part."""


def rings(middles, along, radius):
    """Vertices of rings in the plane of `along` and y, shape [k * AROUND, 3]."""
    angle = 0.1 + np.linspace(0.0, 2.0 * np.pi, AROUND, endpoint=False)
    across = np.stack([along[:, 2], 0.0 * along[:, 0], -along[:, 0]], axis=1)
    out = np.cos(angle)[None, :, None] * across[:, None] + np.sin(angle)[None, :, None] * [0, 1, 0]
    return (middles[:, None] + radius * out).reshape(-1, 3)


def faces(count):
    """Triangles of so many rings, outward where the first is at the top."""
    i = np.arange(count * AROUND).reshape(count, AROUND)
    a, b = i[:-1], i[1:]
    c, d = np.roll(b, -1, axis=1), np.roll(a, -1, axis=1)
    quads = [np.stack([a, c, b], -1).reshape(-1, 3), np.stack([a, d, c], -1).reshape(-1, 3)]
    return np.concatenate(quads).astype(np.int32)


def straight(z, radius, aside=None):
    """A tube along z, each ring so far aside [m]."""
    middles = np.stack([np.zeros_like(z) if aside is None else aside, 0 * z, z], axis=1)
    return rings(middles, np.tile([0.0, 0.0, -1.0], (len(z), 1)), radius)


def folded_limb():
    """The limb down to its bend, 0.25 m to the side, and up again."""
    middles, along = [], []
    for z in LIMB:
        if z > CUTS[0]:
            middles.append([0.0, 0.0, z])
            along.append([0.0, 0.0, -1.0])
        else:
            s = min((CUTS[0] - z) / 0.25, 1.0)
            rise = max(CUTS[1] - z, 0.0)
            middles.append([0.125 * (1 - np.cos(np.pi * s)), 0.0, CUTS[0] + rise])
            middles[-1][2] -= 0.125 * np.sin(np.pi * s)
            along.append([np.sin(np.pi * s), 0.0, -np.cos(np.pi * s)])
    return rings(np.array(middles), np.array(along), THIN)


@pytest.fixture(scope="module")
def wearer():
    """The limb, and what it wears from 0.2 m above its root to its end."""
    number = (np.repeat(LIMB, AROUND)[:, None] < CUTS).sum(axis=1)
    skin = Skin(
        vertices=straight(LIMB, THIN),
        triangles=faces(len(LIMB)),
        bone=number[:, None].astype(np.int32),
        weight=np.ones((len(number), 1)),
        T_bone_bind=np.tile(np.eye(4), (3, 1, 1)),
    )
    rig = Rig(
        joint_names=("a", "b", "c"),
        parent=np.array([-1, 0, 1], np.int32),
        T_parent_joint=np.tile(np.eye(4), (3, 1, 1)),
        dofs=Dofs.none(),
    )
    body = Body(name="limb", rig=rig, skin=skin)
    worn = straight(np.linspace(0.2, -0.85, 43), WIDE)
    return body, Garment.from_mesh(worn, faces(43), name="leg", bone="a")


def deepest(wearer, skin, cloth):
    """Most penetration [mm] of the garment at some place around the posed limb."""
    body, garment = wearer
    mesh = {"leg": GarmentMesh.of(garment)}
    meter = ClothMeter(skin, body.skin.triangles, mesh, OwnSides.of([garment], body))
    meter.add(skin, {"leg": cloth})
    return meter.result()["penetration_mm_max"]


def test_a_garment_as_it_is_put_on_is_on_its_own_side(wearer):
    assert deepest(wearer, wearer[0].skin.vertices, wearer[1].vertices) == 0.0


def test_cloth_beside_its_limb_penetrates_by_its_distance(wearer):
    # Above the joint around it, below 0.25 m aside: the wall that looks at the limb is 100 mm from
    # it, and up to where it turns by 60 degrees 163 mm.
    z = np.linspace(0.2, -0.85, 43)
    aside = 0.25 * np.clip((-0.25 - z) / 0.1, 0.0, 1.0)
    beside = straight(z, WIDE, aside)
    assert 100.0 < deepest(wearer, wearer[0].skin.vertices, beside) < 175.0
    # Only the end of the limb, beyond the middle of its last joint.
    end = straight(z, WIDE, 0.25 * np.clip((-0.74 - z) / 0.03, 0.0, 1.0))
    assert 100.0 < deepest(wearer, wearer[0].skin.vertices, end) < 175.0
    # Only as far aside as the tube is wider than the limb is worn.
    loose = straight(z, WIDE, 0.15 * aside)
    assert deepest(wearer, wearer[0].skin.vertices, loose) == 0.0


def test_a_limb_that_leaves_through_the_opening_may_lie_beside_the_cloth(wearer):
    """A skirt on a raised thigh: the shin is out of it and hangs before it."""
    ridden_up = straight(np.linspace(0.2, -0.25, 43), WIDE)
    assert deepest(wearer, folded_limb(), ridden_up) == 0.0
    # A longer one it leaves through the wall, and is beside it from there to where skin of the
    # straight part, 50 mm from the wall, is nearer.
    torn_through = straight(np.linspace(0.2, -0.5, 43), WIDE)
    assert 40.0 < deepest(wearer, folded_limb(), torn_through) < 50.0


def test_a_hem_that_is_turned_up_is_on_its_own_side(wearer):
    # A flared hem that is thrown upwards: what was its outside looks at the limb.
    z = np.linspace(0.2, -0.3, 43)
    radius = np.where(z > -0.2, WIDE, WIDE + 2.0 * (-0.2 - z))
    height = np.where(z > -0.2, z, -0.2 - 2.0 * (z + 0.2))
    skirt = np.concatenate([straight(h[None], r) for h, r in zip(height, radius, strict=True)])
    assert deepest(wearer, wearer[0].skin.vertices, skirt) == 0.0


def test_cloth_in_the_limb_counts_by_its_depth_whatever_side_it_is_of(wearer):
    thin = straight(np.linspace(0.2, -0.85, 43), 0.03)
    assert deepest(wearer, wearer[0].skin.vertices, thin) == pytest.approx(20.0, abs=0.5)
