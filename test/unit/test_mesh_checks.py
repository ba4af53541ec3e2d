"""Meshes from files that are no garment of the body: refused in one line, or said what is odd."""

import numpy as np
import pytest

from garment_sim_ros.avatar import Avatar
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.errors import GeometryError, InputFileError
from garment_sim_ros.garment.measures import Measures
from garment_sim_ros.garment.mesh_checks import check_stretch
from garment_sim_ros.garment.mesh_data import GarmentMesh
from garment_sim_ros.garment.outfit import load_outfit
from garment_sim_ros.garment.polygon_files import read_polygons


@pytest.fixture(scope="module")
def body():
    return load_body("mannequin")


def tube(radius=0.22, rows=8, n=32):
    """A skirt without flare around the hips, y up: vertices [v, 3] and triangles [t, 3]."""
    angle = np.linspace(0.0, 2.0 * np.pi, n, endpoint=False)
    ring = np.stack([radius * np.sin(angle), 0.0 * angle, 0.8 * radius * np.cos(angle)], axis=1)
    v = np.concatenate([ring + np.array([0.0, y, 0.0]) for y in np.linspace(0.75, 1.05, rows)])
    i, j = np.divmod(np.arange((rows - 1) * n), n)
    a, b = i * n + j, i * n + (j + 1) % n
    return v, np.concatenate([np.stack([a, b, a + n], 1), np.stack([b, b + n, a + n], 1)])


def joined(*parts):
    count = np.cumsum([0, *(len(v) for v, _ in parts)])
    triangles = [t + n for (_, t), n in zip(parts, count, strict=False)]
    return np.concatenate([v for v, _ in parts]), np.concatenate(triangles)


def solid(v, t, rows=8, n=32):
    """Cloth with a thickness: an outside, an inside and rims."""
    j = np.arange(n)
    rims = []
    for first, turn in ((0, 1), ((rows - 1) * n, -1)):
        a, b = first + j, first + (j + 1) % n
        c, d = a + len(v), b + len(v)
        rims += [np.stack([a, c, b], 1)[:, ::turn], np.stack([b, c, d], 1)[:, ::turn]]
    v, t = joined((v, t), (v * [0.99, 1.0, 0.99], t[:, ::-1]))
    return v, np.concatenate([t, *rims])


def worn(tmp_path, body, v, t, options="{}"):
    lines = ["v {:.5f} {:.5f} {:.5f}".format(*x) for x in v.tolist()]
    lines += ["f {} {} {}".format(*corners) for corners in (t + 1).tolist()]
    (tmp_path / "skirt.obj").write_text("\n".join(lines))
    outfit = tmp_path / "outfit.yaml"
    text = f"{{name: skirt, mesh: skirt.obj, options: {options}}}"
    outfit.write_text(f"version: 1\ngarments: [{text}]\n")
    return load_outfit(outfit, body)


def test_a_plain_tube_is_worn_without_a_word(tmp_path, body):
    outfit = worn(tmp_path, body, *tube(), "{edge_length: 1}")
    assert outfit.notes == ()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda v, t: solid(v, t), "skirt.obj: is closed: it has no open edge"),
        (
            lambda v, t: joined((v, t), (v * [0.998, 1.0, 0.998], t[:, ::-1])),
            "skirt.obj: is two-sided: 896 of 896 triangles",
        ),
        (  # one rim is sewn, the other one left open
            lambda v, t: (lambda x, u: (x, np.delete(u, np.s_[-64:], axis=0)))(*solid(v, t)),
            "skirt.obj: is two-sided: 896 of 960 triangles",
        ),
        (lambda v, t: (100.0 * v, t), r"away from mannequin; .*\(with unit cm it is\)"),
        (lambda v, t: (1000.0 * v, t), r"\(with unit mm it is\)"),
        (lambda v, t: (v / 0.0254, t), r"\(with unit in it is\)"),
        (lambda v, t: (v[:, [2, 0, 1]], t), r"\(with up z it is\)"),
        (lambda v, t: (100.0 * v[:, [2, 0, 1]], t), r"\(with unit cm and up z it is\)"),
        (
            lambda v, t: (v + np.array([2.0, 0.0, 0.0]), t),
            r"\(is its unit or its up axis another one\?\)",
        ),
        (lambda v, t: (1e-3 * v, t), "is 0.00044 m long; allowed: a garment from 0.05 m on"),
        (
            lambda v, t: (v * [0.4, 1.0, 0.4], t),
            r"garment 'skirt' is in mannequin, not on it: .*another body\? name that: made_on",
        ),
    ],
)
def test_what_is_no_garment_of_the_body_is_refused(tmp_path, body, change, words):
    with pytest.raises(InputFileError, match=words) as error:
        worn(tmp_path, body, *change(*tube()))
    assert "\n" not in str(error.value)


def test_a_skirt_at_half_size_between_the_legs_is_refused(tmp_path, body):
    """It is hardly in the body: only its place tells."""
    v, t = tube(radius=0.22)
    half = 0.5 * v * [0.5, 1.0, 1.0], t
    with pytest.raises(
        InputFileError, match=r"open edge 0\.5\d m over the floor, where it is not"
    ):
        worn(tmp_path, body, *half)
    outfit = worn(tmp_path, body, v - [0.0, 0.3, 0.0], t)  # around both thighs: it was pulled down
    assert len(outfit.garments) == 1


def test_what_has_several_parts_is_judged_with_all_of_them(tmp_path, body):
    """Two rings beside the legs are no skirt; two stockings are around the legs together."""
    v, t = tube()
    half = 0.5 * v * [0.5, 1.0, 1.0]
    with pytest.raises(InputFileError, match="where it is not around mannequin"):
        worn(tmp_path, body, *joined((half, t), (half - [0.0, 0.2, 0.0], t)))
    measures = Measures(body)
    stockings = []
    for side in ("left", "right"):
        knee = measures.joint(f"{side}LowerLeg")
        ring = v - [0.0, v[:, 1].mean(), 0.0]
        stockings.append((ring * [0.4, 1.0, 0.5] + knee[[1, 2, 0]], t))
    (garment,) = worn(tmp_path, body, *joined(*stockings)).garments
    assert len(garment.marks["waist"]) > 0


@pytest.mark.parametrize("size", [0.7, 0.8])
def test_a_shirt_too_small_is_refused(tmp_path, data_file, size):
    """Not put on with the skin through it."""
    woman = load_body(data_file("bodies", "mh_female_young.glb"))
    polygons = read_polygons(data_file("garments", "tshirt_female.obj"))
    v = polygons.vertices
    middle = v.mean(axis=0)
    t = polygons.corners.reshape(-1, 4)
    quads = np.concatenate([t[:, [0, 1, 2]], t[:, [0, 2, 3]]])
    with pytest.raises(InputFileError, match=r"made for another body\? name that: made_on, or --"):
        worn(tmp_path, woman, (v - middle) * size + middle, quads)
    assert worn(tmp_path, woman, v, quads).garments


def test_a_shirt_that_is_left_in_the_skin_is_refused(data_file):
    """Hardly stretched, for it is in the body elsewhere: the wearer is of another size."""
    shirt = data_file("garments", "tshirt_female.obj")
    smaller = Avatar.load("mannequin:height=1.45,build=0", method="capsules")
    with pytest.raises(InputFileError, match=r"tshirt_female.obj: .* under the skin .* up to 1 %"):
        smaller.dress(shirt)
    made_on = str(data_file("bodies", "mh_female_young.glb"))
    assert smaller.dress(shirt, made_on=made_on).garments


def test_a_garment_that_must_grow_to_be_worn_is_refused():
    v, t = tube()
    given = GarmentMesh(vertices=v, triangles=t)
    check_stretch("skirt", given, 1.45 * v, "somebody")
    few = v.copy()
    few[:3] += 1.0  # a corner that is far out, as beside an arm
    check_stretch("skirt", given, few, "somebody")
    with pytest.raises(
        GeometryError, match=r"'skirt' is too small for somebody: .* be 1\.6 times"
    ):
        check_stretch("skirt", given, 1.6 * v, "somebody")


def test_what_the_refusal_advises_works(tmp_path, body):
    v, t = tube()
    outfit = worn(tmp_path, body, 100.0 * v[:, [2, 0, 1]], t, "{unit: cm, up: z}")
    (garment,) = outfit.garments
    np.testing.assert_allclose(garment.vertices[:, 2].min(), 0.75, atol=1e-3)


def test_a_lining_on_the_same_side_is_no_second_side(tmp_path, body):
    v, t = tube()
    outfit = worn(tmp_path, body, *joined((v, t), (v * [1.05, 1.0, 1.05], t)))
    assert len(outfit.garments) == 1


def test_a_part_that_nothing_holds_is_told(tmp_path, body):
    v, t = tube()
    pocket = 0.2 * v + np.array([0.0, 0.7, 0.25]), t
    notes = " ".join(worn(tmp_path, body, *joined((v, t), pocket)).notes)
    assert "1 of its 2 parts are attached to nothing, the first at (0.25, 0.00, 0.88) m" in notes


def test_a_hole_is_no_waist(tmp_path, body):
    v, t = tube()
    v[:, 1] += 0.5 * v[:, 2]  # higher in front: the hole there is above the middle of the rim
    torn = np.delete(t, 5 * 32, axis=0)
    (garment,) = worn(tmp_path, body, v, torn, "{remesh: never, edge_length: 1}").garments
    assert len(garment.marks["waist"]) == 32
