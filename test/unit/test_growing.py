"""Hulls grow to the skin that bends out of them, and to nothing else."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.rig import Dofs, Rig
from garment_sim_ros.body.skin import Body, Skin
from garment_sim_ros.collider_params import HullSettings
from garment_sim_ros.colliders.hulls import growing
from garment_sim_ros.colliders.hulls.hulls import fit_hulls
from garment_sim_ros.colliders.random_poses import random_poses
from garment_sim_ros.colliders.report.motion_report import SHOWS, motion_report, range_report
from garment_sim_ros.contact.shapes import Collider, ColliderSet
from garment_sim_ros.geometry.transforms import invert_transform


def tube(blend, *, radius=0.05, half=0.3, around=24, rows=61):
    """A tube along z of two bones that meet in its middle; weights change over `blend` [m]."""
    angle = 2.0 * np.pi * np.arange(around) / around
    ring = np.column_stack([np.cos(angle), np.sin(angle)]) * radius
    z = np.linspace(-half, half, rows)
    x = np.concatenate([np.column_stack([ring, np.full(around, h)]) for h in z])
    a = np.arange((rows - 1) * around).reshape(rows - 1, around)
    b = np.roll(a, -1, axis=1)
    triangles = np.concatenate(
        [np.stack([a, b, a + around], -1), np.stack([b, b + around, a + around], -1)]
    ).reshape(-1, 3)
    upper = np.clip(0.5 + x[:, 2] / max(blend, 1e-9), 0.0, 1.0)
    T = np.tile(np.eye(4), (2, 1, 1))
    T[0, 2, 3], T[1, 2, 3] = -half, half
    rig = Rig(
        joint_names=("a", "b"),
        parent=np.array([-1, 0], np.int32),
        T_parent_joint=T,
        dofs=Dofs.none(),
    )
    skin = Skin(
        vertices=x,
        triangles=triangles.astype(np.int32),
        bone=np.tile(np.array([0, 1], np.int32), (len(x), 1)),
        weight=np.column_stack([1.0 - upper, upper]),
        T_bone_bind=invert_transform(rest_transforms(rig)),
    )
    return Body(name="tube", rig=rig, skin=skin)


def bare(body, colliders):
    return range_report(body, colliders)["bare_share"]


def without(monkeypatch, body):
    with monkeypatch.context() as patch:
        patch.setattr(growing, "_ROUNDS", 0)
        return fit_hulls(body).colliders


def test_less_skin_is_bare_and_hulls_still_hold_what_is_theirs(monkeypatch):
    body = tube(blend=0.25)
    before, fit = without(monkeypatch, body), fit_hulls(body)
    assert bare(body, before) > 0.01
    assert bare(body, fit.colliders) < 0.25 * bare(body, before)
    assert all(shape.outside == 0 for shape in fit.shapes)
    assert len(fit.colliders) == len(before)  # grown, not more
    at_rest = motion_report(body, fit.colliders, [rest_transforms(body.rig)])
    assert at_rest["outside_share"] == 0.0


def test_what_does_not_bend_stays_as_it_was(monkeypatch):
    """Skin that one bone moves, or a bone and one that goes with it, is in its hull already."""
    rigid = tube(blend=0.0)
    assert fit_hulls(rigid).colliders.revision == without(monkeypatch, rigid).revision
    alone = tube(blend=0.25)
    skin = dataclasses.replace(
        alone.skin, weight=np.column_stack([np.ones(len(alone.skin.vertices))] * 2) * [1.0, 0.0]
    )
    alone = dataclasses.replace(alone, skin=skin)
    assert fit_hulls(alone).colliders.revision == without(monkeypatch, alone).revision


@pytest.mark.parametrize("joints", ["none", "spheres"])
def test_fits_that_are_asked_for_as_printed_do_not_grow(monkeypatch, joints):
    body, settings = tube(blend=0.25), HullSettings(joints=joints)
    fit = fit_hulls(body, settings).colliders.revision
    monkeypatch.setattr(growing, "_ROUNDS", 0)
    assert fit == fit_hulls(body, settings).colliders.revision


def test_skin_far_from_all_hulls_is_left_outside(monkeypatch):
    """Else a strip of skin that hangs on a far bone would make a wing of the hull."""
    body = tube(blend=0.25)
    monkeypatch.setattr(growing, "_FAR", 0.0)
    assert fit_hulls(body).colliders.revision == without(monkeypatch, body).revision


@pytest.mark.parametrize(
    ("up", "ahead", "most"), [(15.0, 0.0, 0.013), (0.0, 15.0, 0.006), (0.0, -15.0, 0.004)]
)
def test_skin_about_collar_bones_is_covered(up, ahead, most):
    """Of hulls that grew over poses in which these do not turn, 0.6 to 1.5 % show."""
    body = load_body("mannequin")
    rest = rest_transforms(body.rig)
    pose = rest.copy()
    for side, out in (("left", 1.0), ("right", -1.0)):
        collar = body.rig.index(f"{side}Shoulder")
        turn = np.eye(4)
        about = np.radians([out * up, 0.0, -out * ahead])
        turn[:3, :3] = Rotation.from_rotvec(about).as_matrix()
        turn[:3, 3] = rest[collar, :3, 3] - turn[:3, :3] @ rest[collar, :3, 3]
        below = {collar}
        for joint, above in enumerate(body.rig.parent):
            if joint == collar or above in below:
                below.add(joint)
                pose[joint] = turn @ rest[joint]
    report = motion_report(body, fit_hulls(body).colliders, pose[None])
    assert report["bare_share"] < most


@pytest.mark.parametrize("most", [0.12, 1.0])
def test_arms_stay_thin_enough_for_their_sleeves(monkeypatch, data_file, most):
    """Skin of this body's back hangs on its upper arms."""
    body = load_body(data_file("bodies", "CesiumMan.glb"))
    upper = {body.humanoid[side + "UpperArm"] for side in ("left", "right")}

    def volumes(colliders):
        hulls = [c for c in colliders.colliders if c.name in upper]
        return np.array([ConvexHull(c.geometry["vertices"]).volume for c in hulls])

    before = volumes(without(monkeypatch, body))
    monkeypatch.setattr(growing, "_THICKER", most)
    thicker = volumes(fit_hulls(body).colliders) / before
    assert len(thicker) == 2
    assert (thicker.max() < 1.15) == (most < 1.0)


def test_what_bends_is_skin_of_triangles_between_parts_that_turn():
    """A vertex of no triangle would make hulls grow to nothing that is seen."""
    body = tube(blend=0.25)
    astray = dataclasses.replace(
        body.skin,
        vertices=np.vstack([body.skin.vertices, [[0.06, 0.0, 0.0]]]),
        bone=np.vstack([body.skin.bone, [[0, 1]]]),
        weight=np.vstack([body.skin.weight, [[0.5, 0.5]]]),
    )
    bends = growing._bending(dataclasses.replace(body, skin=astray), random_poses(body, 8))
    inside = np.flatnonzero(np.abs(body.skin.vertices[:, 2]) < 0.124)
    np.testing.assert_array_equal(bends, inside)


def ball_body(radius, **weights):
    """Skin that is a ball about the joint of the second of two bones."""
    body = tube(blend=0.1)
    n, m = 20, 40
    polar, turn = np.pi * (np.arange(n) + 0.5) / n, 2.0 * np.pi * np.arange(m) / m
    x = np.stack(
        [
            np.outer(np.sin(polar), np.cos(turn)),
            np.outer(np.sin(polar), np.sin(turn)),
            np.outer(np.cos(polar), np.ones(m)),
        ],
        axis=-1,
    ).reshape(-1, 3)
    a = np.arange((n - 1) * m).reshape(n - 1, m)
    b = np.roll(a, -1, axis=1)
    triangles = np.concatenate([np.stack([a, a + m, b], -1), np.stack([b, a + m, b + m], -1)])
    skin = Skin(
        vertices=radius * x,
        triangles=triangles.reshape(-1, 3).astype(np.int32),
        bone=np.where(x[:, 2:] > 0.0, 1, 0).astype(np.int32),
        weight=np.ones((len(x), 1)),
        T_bone_bind=body.skin.T_bone_bind,
    )
    return dataclasses.replace(body, skin=skin)


@pytest.mark.parametrize(("short", "share"), [(0.0015, 0.0), (0.0025, 1.0)])
def test_bare_is_skin_outside_by_more_than_cloth_keeps_off(short, share):
    body = ball_body(0.1)
    ball = Collider(name="ball", kind="sphere", bone="b", geometry={"radius": 0.1 - short})
    colliders = ColliderSet(colliders=(ball,))
    for report in (
        motion_report(body, colliders, [rest_transforms(body.rig)]),
        range_report(body, colliders),  # all turn about the ball's middle
    ):
        assert report["bare_share"] == pytest.approx(share)
        assert report["bare_share_max"] == pytest.approx(share)
        assert sum(report["bare_bones"].values()) == pytest.approx(share, abs=1e-4)
    assert SHOWS == 0.002


def test_bare_is_the_mean_over_poses_and_says_at_which_bone():
    """Half of the skin is 5 mm outside, in one of two poses, at the bone that moved away."""
    body = ball_body(0.1)
    ball = Collider(
        name="ball", kind="sphere", bone="a", position=[0.0, 0.0, 0.3], geometry={"radius": 0.101}
    )
    rest = rest_transforms(body.rig)
    apart = rest.copy()
    apart[1, :3, 3] += [0.0, 0.0, 0.005]
    report = motion_report(body, ColliderSet(colliders=(ball,)), [rest, apart])
    # Outside by more than 2 mm is what is steeper than 3 mm of 5: a cap of height 0.1 (1 - 0.6).
    assert report["bare_share_max"] == pytest.approx(0.5 * 0.4, abs=0.03)
    assert report["bare_share"] == pytest.approx(0.5 * report["bare_share_max"], rel=1e-3)
    assert list(report["bare_bones"]) == ["b"]
    assert report["bare_bones"]["b"] == pytest.approx(report["bare_share"], rel=1e-3)
