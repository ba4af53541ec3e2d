"""Hull colliders of whole bodies: everything contained, degenerate regions, joints."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.rig import Dofs, Rig
from garment_sim_ros.body.skin import Body, Skin
from garment_sim_ros.body.skinning import skin_vertices
from garment_sim_ros.collider_params import HullSettings
from garment_sim_ros.colliders.description import from_json, to_json
from garment_sim_ros.colliders.hulls.hull import Hull
from garment_sim_ros.colliders.hulls.hull_report import hull_report
from garment_sim_ros.colliders.hulls.hulls import fit_hulls
from garment_sim_ros.colliders.posing import ColliderPoser
from garment_sim_ros.colliders.regions import region_surface, skin_regions
from garment_sim_ros.errors import GeometryError, ParameterError
from garment_sim_ros.geometry.transforms import invert_transform, matrix_from_quaternion
from garment_sim_ros.geometry.triangles import vertex_areas


def union_height(colliders, poses, points):
    """Least signed distance to planes or spheres of all shapes."""
    best = np.full(len(points), np.inf)
    for c, position, q in zip(colliders.colliders, poses.position, poses.orientation):
        local = (points - position) @ matrix_from_quaternion(q)
        if c.kind == "hull":
            height = Hull(c.geometry["vertices"], c.geometry["faces"]).height(local)
        elif c.kind == "sphere":
            height = np.linalg.norm(local, axis=1) - c.geometry["radius"]
        elif c.kind == "capsule":
            z = np.clip(local[:, 2], 0.0, c.geometry["length"])
            off = np.linalg.norm(local - z[:, None] * [0, 0, 1], axis=1)
            height = off - c.geometry["radius0"]
        else:
            continue
        best = np.minimum(best, height)
    return best


def bind_poses(body, colliders):
    return ColliderPoser(colliders, body).poses(invert_transform(body.skin.T_bone_bind))


@pytest.fixture(scope="module")
def mannequin():
    return load_body("mannequin:vertices=1500")


@pytest.mark.parametrize(
    "source",
    [
        "mannequin",
        "bodies/mh_female_young.glb",
        "bodies/CesiumMan.glb",
        "urdf/human_1m65.urdf",
        pytest.param("bodies/m_smpl_average_A40.obj", marks=pytest.mark.slow),
        pytest.param("bodies/mh_proxy_female1605.obj", marks=pytest.mark.slow),
    ],
)
def test_no_skin_is_outside(data_file, source):
    body = load_body(source if source == "mannequin" else data_file(*source.split("/")))
    fit = fit_hulls(body)
    assert all(shape.outside == 0 for shape in fit.shapes)
    assert len(fit.shapes) == sum(c.kind != "frame" for c in fit.colliders.colliders)
    # Triangle centres as well as vertices: the cuts between regions leave no slit.
    x = body.skin.vertices
    points = np.vstack([x, x[body.skin.triangles].mean(axis=1)])
    height = union_height(fit.colliders, bind_poses(body, fit.colliders), points)
    assert height.max() < 1e-9
    assert np.median(height) > -0.015  # not by being fat
    assert from_json(to_json(fit.colliders)).revision == fit.colliders.revision


@pytest.mark.parametrize(
    "settings",
    [
        {"placement": "volume", "max_faces": 20},
        {"inflation": "planes"},
        {"merge": 0.05, "split": 1.0},
        {"joints": "spheres"},
        {"delta": 0.0, "joints": "none"},
        {"delta": 0.05},
        {"max_faces": 4, "reach": 100.0},
    ],
)
def test_settings_keep_the_skin_inside(mannequin, settings):
    body = mannequin
    fit = fit_hulls(body, HullSettings(**settings))
    assert all(shape.outside == 0 for shape in fit.shapes)
    heights = union_height(fit.colliders, bind_poses(body, fit.colliders), body.skin.vertices)
    assert heights.max() < 1e-9


@pytest.mark.parametrize(
    "settings",
    [{"delta": -0.001}, {"delta": 0.5}, {"max_faces": 3}, {"placement": "best"}, {"merge": 2.0}],
)
def test_settings_out_of_range_are_refused(mannequin, settings):
    with pytest.raises(ParameterError):
        fit_hulls(mannequin, HullSettings(**settings))


def test_merging_and_splitting_change_the_count(mannequin):
    body = mannequin
    counts = [
        sum(shape.kind == "hull" for shape in fit_hulls(body, HullSettings(**s)).shapes)
        for s in (
            {"merge": 0.06, "split": 1.0, "joints": "none"},
            {"split": 1.0, "joints": "none"},
            {"split": 0.001, "joints": "none"},
        )
    ]
    assert counts[0] < counts[1] == 20 < counts[2]  # 18 major bones and the toes


def test_regions_cover_the_surface_exactly(mannequin):
    body = mannequin
    regions = skin_regions(body)
    areas = [
        np.linalg.norm(np.cross(s[:, 1] - s[:, 0], s[:, 2] - s[:, 0]), axis=1).sum() / 2
        for s in (region_surface(body.skin, regions, m) for m in range(len(regions)))
    ]
    assert sum(areas) == pytest.approx(
        vertex_areas(body.skin.vertices, body.skin.triangles).sum(), rel=1e-9
    )


def two_bones(vertices, triangles, second):
    """A body whose vertices in `second` belong to bone b at (0, 0, 1)."""
    T = np.tile(np.eye(4), (2, 1, 1))
    T[1, 2, 3] = 1.0
    rig = Rig(
        joint_names=("a", "b"),
        parent=np.array([-1, 0], np.int32),
        T_parent_joint=T,
        dofs=Dofs.none(),
    )
    skin = Skin(
        vertices=vertices,
        triangles=triangles,
        bone=np.asarray(second, np.int32)[:, None],
        weight=np.ones((len(vertices), 1)),
        T_bone_bind=invert_transform(rest_transforms(rig)),
    )
    return Body(name="two", rig=rig, skin=skin)


def test_flat_and_tiny_regions_become_capsules_with_a_note():
    rng = np.random.default_rng(0)
    flat = np.column_stack([rng.uniform(0, 0.3, (60, 2)), np.zeros(60)])
    one = np.array([[0, 0, 1.0], [0.2, 0, 1.0], [0, 0.1, 1.0]])
    triangles = np.array([[i, i + 1, i + 2] for i in range(0, 60, 3)] + [[60, 61, 62]])
    body = two_bones(np.vstack([flat, one]), triangles, [0] * 60 + [1] * 3)
    fit = fit_hulls(body)
    assert {shape.kind for shape in fit.shapes} == {"capsule"}
    assert all("no hull" in shape.note for shape in fit.shapes)
    heights = union_height(fit.colliders, bind_poses(body, fit.colliders), body.skin.vertices)
    assert heights.max() <= 1e-12


def test_a_body_without_triangles_is_refused():
    body = two_bones(np.eye(3), np.zeros((0, 3), np.int32), [0, 0, 1])
    with pytest.raises(GeometryError, match="no triangles"):
        fit_hulls(body)


def replaced(body, **skin):
    return dataclasses.replace(body, skin=dataclasses.replace(body.skin, **skin))


def bad_bodies(body):
    """Skins that no loader should let through, by what is wrong with them."""
    skin = body.skin
    t, v = skin.triangles, len(skin.vertices)
    doubled = {
        "bone": np.vstack([skin.bone, skin.bone]),
        "weight": np.vstack([skin.weight, skin.weight]),
    }
    apart = np.vstack([skin.vertices, skin.vertices + np.array([0.0, 0.0, 3.0])])
    crossing = np.vstack([skin.vertices, skin.vertices + np.array([0.0, 0.05, 0.01])])
    return {
        "open": replaced(body, triangles=t[::2]),
        "non-manifold": replaced(body, triangles=np.vstack([t, t[:300], t[:100, [0, 2, 1]]])),
        "no area": replaced(body, triangles=np.vstack([t, t[:200, [0, 0, 1]]])),
        "inside-out": replaced(body, triangles=t[:, ::-1]),
        "two pieces": replaced(body, vertices=apart, triangles=np.vstack([t, t + v]), **doubled),
        "cutting itself": replaced(
            body, vertices=crossing, triangles=np.vstack([t, t + v]), **doubled
        ),
        "one triangle": replaced(body, triangles=t[:1]),
        "unused vertices": replaced(body, triangles=t[: len(t) // 2]),
    }


@pytest.mark.parametrize(
    "wrong",
    [
        *("open", "non-manifold", "no area", "inside-out", "two pieces", "cutting itself"),
        *("one triangle", "unused vertices"),
    ],
)
def test_bad_skins_are_contained_and_what_was_done_is_told(mannequin, wrong):
    body = bad_bodies(mannequin)[wrong]
    fit = fit_hulls(body)
    used = np.unique(body.skin.triangles)
    heights = union_height(fit.colliders, bind_poses(body, fit.colliders), body.skin.vertices)
    assert heights[used].max() < 1e-9
    assert all(shape.outside == 0 for shape in fit.shapes)
    notes = [shape.note for shape in fit.shapes if shape.kind == "capsule"]
    assert all("no hull" in note for note in notes)
    assert (wrong == "one triangle") == (len(notes) == len(fit.shapes))
    report = hull_report(fit)
    assert len(report) == len(fit.shapes)


@pytest.mark.parametrize("delta", [0.0, 0.05])
def test_a_delta_of_nothing_or_larger_than_a_limb_is_kept_and_told(mannequin, delta):
    """Without slack nothing is simplified; a finger thick and 5 cm inflated is just fat.

    So where vertices stay near the inflated hull; least volume takes the clearance back.
    """
    settings = HullSettings(delta=delta, joints="none", placement="quadric")
    fit = fit_hulls(mannequin, settings)
    for shape in fit.shapes:
        assert shape.outside == 0
        if delta == 0.0:
            assert shape.faces == shape.faces_before
            assert "no delta" in shape.note
        else:
            assert shape.faces <= 90
            assert shape.clearance_min <= shape.clearance_mean
            assert shape.clearance_mean > 0.02
            thin = shape.volume > 3.0 * shape.volume_before
            assert thin == ("much thicker" in shape.note)


def test_a_floor_below_4_is_refused_and_4_is_met_where_the_reach_allows(mannequin):
    with pytest.raises(ParameterError, match=r"max_faces: found 3; allowed: .* from 4"):
        fit_hulls(mannequin, HullSettings(max_faces=3))
    fit = fit_hulls(mannequin, HullSettings(max_faces=4, reach=100.0, joints="none"))
    faces = [shape.faces for shape in fit.shapes]
    assert min(faces) >= 4
    assert np.median(faces) < 12
    for shape in fit.shapes:
        assert (shape.faces > 5) == ("stopped at" in shape.note)


def test_joint_colliders_cover_bent_elbows_and_knees():
    body = load_body("mannequin:vertices=3000")
    left_out = {}
    for joints in ("none", "auto"):
        fit = fit_hulls(body, HullSettings(joints=joints))
        poser = ColliderPoser(fit.colliders, body)
        T = rest_transforms(body.rig)
        worst = 0.0
        for name, axis, angle in (
            ("leftLowerLeg", [0, 1, 0], 1.6),
            ("rightUpperLeg", [0, -1, 0], 1.2),
        ):
            top = body.rig.index(body.humanoid[name])
            below = {top}
            for j in range(top + 1, len(body.rig)):
                if int(body.rig.parent[j]) in below:
                    below.add(j)
            turn = np.eye(4)
            turn[:3, :3] = Rotation.from_rotvec(np.array(axis) * angle).as_matrix()
            there = np.eye(4)
            there[:3, 3] = T[top, :3, 3]
            posed = T.copy()
            posed[sorted(below)] = (there @ turn @ invert_transform(there)) @ T[sorted(below)]
            x = skin_vertices(body.skin, posed)
            worst = max(worst, union_height(fit.colliders, poser.poses(posed), x).max())
        left_out[joints] = worst
    assert left_out["none"] > 0.01
    assert left_out["auto"] < 0.6 * left_out["none"]
