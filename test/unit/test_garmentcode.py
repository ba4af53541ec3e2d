"""GarmentCode specifications: read as they are, and refused in one line."""

import copy
import json

import numpy as np
import pytest

from garment_sim_ros.errors import InputFileError
from garment_sim_ros.garment.patterns.garmentcode import read_garmentcode


def square(x0, z, clockwise=False):
    corners = [[x0, 0], [x0 + 40, 0], [x0 + 40, 50], [x0, 50]]
    if clockwise:
        corners = corners[::-1]
    return {
        "translation": [0, 90, z],
        "rotation": [0, 0, 0],
        "vertices": corners,
        "edges": [{"endpoints": [i, (i + 1) % 4]} for i in range(4)],
    }


def specification():
    return {
        "pattern": {
            "panels": {"front": square(-20, 20), "back": square(-20, -20, clockwise=True)},
            "stitches": [
                [{"panel": "front", "edge": 1}, {"panel": "back", "edge": 1}],
                [{"panel": "front", "edge": 3}, {"panel": "back", "edge": 3}],
            ],
        },
        "properties": {"units_in_meter": 100, "curvature_coords": "relative"},
    }


def write(tmp_path, content):
    path = tmp_path / "pattern.json"
    path.write_text(json.dumps(content))
    return path


@pytest.mark.parametrize(
    ("name", "panels", "stitches", "curved"),
    [
        ("shirt_mean_specification.json", 8, 18, 20),
        ("dress_pencil_specification.json", 6, 23, 20),
    ],
)
def test_shared_patterns_are_read_as_they_are(data_file, name, panels, stitches, curved):
    pattern = read_garmentcode(data_file("patterns", name))
    assert len(pattern.panels) == panels
    assert len(pattern.stitches) == stitches
    edges = [e for p in pattern.panels.values() for e in p.edges]
    assert sum(bool(e.controls) for e in edges) == curved
    for key, panel in pattern.panels.items():
        normal = panel.placement.T_world_panel[:3, 2]
        behind = "back" in key or "btorso" in key or key.endswith("_b")
        assert normal[0] == pytest.approx(-1.0 if behind else 1.0), key
        assert 0.4 < panel.placement.placed(panel.outline)[:, 2].mean() < 1.6


def test_units_axes_and_sides(tmp_path):
    pattern = read_garmentcode(write(tmp_path, specification()))
    front, back = (pattern.panels[n] for n in ("front", "back"))
    x = front.placement.placed(front.corners)
    assert x[:, 0] == pytest.approx(0.2)
    assert x[:, 2].min() == pytest.approx(0.9)
    assert np.ptp(x[:, 1]) == pytest.approx(0.4)
    assert back.placement.T_world_panel[:3, 2] == pytest.approx([-1.0, 0.0, 0.0])
    # Sewn edges lie across from each other, and run against each other.
    for stitch in pattern.stitches:
        ends = []
        for (seam,) in stitch.sides:
            panel = pattern.panels[seam.panel]
            edge = panel.edges[seam.edges[0]]
            ends.append(panel.placement.placed(panel.corners[[edge.start, edge.end]]))
        assert ends[0][:, 1:] == pytest.approx(ends[1][::-1, 1:])


def test_curves_of_all_kinds(tmp_path):
    content = specification()
    edges = content["pattern"]["panels"]["front"]["edges"]
    edges[0]["curvature"] = {"type": "quadratic", "params": [[0.5, 0.1]]}
    edges[2]["curvature"] = {"type": "circle", "params": [30, 0, 1]}
    content["pattern"]["panels"]["back"]["edges"][1]["curvature"] = [0.5, 0.1]
    pattern = read_garmentcode(write(tmp_path, content))
    front = pattern.panels["front"]
    assert front.curves[0][128, 1] == pytest.approx(0.02)  # half of 0.1 of 0.4 m, to the left
    top = front.curves[2]
    assert top[128, 1] == pytest.approx(0.5 + 0.3 - np.sqrt(0.3**2 - 0.2**2), rel=1e-3)
    back = pattern.panels["back"]
    assert back.curves[1][128, 1] != pytest.approx(0.5)


@pytest.mark.parametrize(
    ("edge", "params"),
    [(0, [[0.3, 0.1], [0.8, -0.1]]), (1, [0.5, -0.1]), (2, [30, False, False]), (3, None)],
)
def test_another_hand_writes_the_same_pattern_otherwise(tmp_path, edge, params):
    """An edge that runs back, keys of other programs, words where there is nothing."""
    content = specification()
    front = content["pattern"]["panels"]["front"]
    front["edges"][0]["curvature"] = {"type": "cubic", "params": [[0.2, 0.1], [0.7, -0.1]]}
    front["edges"][1]["curvature"] = {"type": "quadratic", "params": [[0.5, 0.1]]}
    front["edges"][2]["curvature"] = {"type": "circle", "params": [30, 0, 1]}
    other = copy.deepcopy(content)
    panel = other["pattern"]["panels"]["front"]
    panel["edges"][edge]["endpoints"].reverse()
    if params is not None:
        panel["edges"][edge]["curvature"]["params"] = params
    panel["edges"][3]["curvature"] = None
    panel.pop("rotation")
    panel["colour"] = [1, 2, 3]
    other["pattern"]["panels"]["back"]["edges"][0]["curvature"] = {}
    other["pattern"]["panel_order"] = ["back", "front"]
    other["properties"] = {"normalized_edge_loops": False}
    other["parameters"] = {"length": {"value": 1}}
    for stitch in other["pattern"]["stitches"]:
        stitch.append(None)
    one = read_garmentcode(write(tmp_path, content))
    two = read_garmentcode(write(tmp_path, other))
    for name, panel in one.panels.items():
        again = two.panels[name]
        assert np.array([*panel.lengths]) == pytest.approx(again.lengths, rel=1e-9)
        placed = [np.sort(p.placement.placed(p.outline), axis=0) for p in (panel, again)]
        assert placed[0] == pytest.approx(placed[1], abs=1e-9)
        assert again.placement.T_world_panel == pytest.approx(panel.placement.T_world_panel)
    assert [str(s) for s in two.stitches] == [str(s) for s in one.stitches]
    assert not any(s.turned for s in two.stitches)


def test_stitches_of_several_edges_and_turned_ones(tmp_path):
    content = specification()
    content["pattern"]["stitches"] = [
        [
            [{"panel": "front", "edge": 1}, {"panel": "front", "edge": 2}],
            {"panel": "back", "edge": 1},
        ],
        [{"panel": "front", "edge": 3}, {"panel": "back", "edge": [3]}, "right_wrong"],
    ]
    pattern = read_garmentcode(write(tmp_path, content))
    assert len(pattern.stitches[0].sides[0]) == 2
    assert not pattern.stitches[0].turned
    assert pattern.stitches[1].turned


def put(content, path, value):
    *way, last = path
    for key in way:
        content = content[key]
    if value is None:
        del content[last]
    else:
        content[last] = value


FRONT = ("pattern", "panels", "front")
ARC = {"type": "circle"}


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        (("pattern",), None, "'pattern'"),
        (("properties", "units_in_meter"), 0, "units_in_meter"),
        (("properties", "units_in_meter"), 1, "'front'.*centimetres read as metres"),
        ((*FRONT, "vertices"), [[0, 0]], "'front' edge 0"),
        ((*FRONT, "vertices", 1), [0, "a"], "'front' vertices"),
        ((*FRONT, "vertices", 1), [1e9, 0], "'front' vertices"),
        ((*FRONT, "vertices", 1), [-20, 0], "'front' edge 0 has no length"),
        ((*FRONT, "edges", 1, "endpoints"), [1, 9], "'front' edge 1"),
        ((*FRONT, "edges", 1, "endpoints"), [1, 3], "'front'"),
        ((*FRONT, "edges", 1, "endpoints"), [1, 1], "'front' edge 1 has no length"),
        ((*FRONT, "edges", 1, "curvature"), {"type": "spline", "params": []}, "spline"),
        (
            (*FRONT, "edges", 1, "curvature"),
            ARC | {"params": [19.9, 0, 0]},
            "'front' edge 1.*radius",
        ),
        (
            (*FRONT, "edges", 1, "curvature"),
            ARC | {"params": [-30, 0, 0]},
            "'front' edge 1.*radius",
        ),
        (
            (*FRONT, "edges", 1, "curvature"),
            ARC | {"params": [1e300, 0, 0]},
            "'front' edge 1.*radius",
        ),
        ((*FRONT, "translation"), [0, 0], "'front' translation"),
        (("pattern", "stitches", 0, 1), {"panel": "cape", "edge": 0}, "no panel 'cape'"),
        (("pattern", "stitches", 0, 1), {"panel": "back", "edge": 7}, "'back' has no edge 7"),
        (("pattern", "stitches", 0, 1), {"panel": "front", "edge": 1}, "sewn to itself"),
        (("pattern", "stitches", 0), [{"panel": "back", "edge": 0}], "stitch 0"),
        (
            ("pattern", "stitches", 0, 1),
            {"panel": "back", "edge": 1.0},
            "'back' is no whole number",
        ),
        (
            ("pattern", "stitches", 0, 1),
            {"panel": "back", "edge": 3},
            "'back' edge 3 is sewn 2 times",
        ),
    ],
)
def test_what_is_wrong_is_said_in_one_line(tmp_path, path, value, words):
    content = copy.deepcopy(specification())
    put(content, path, value)
    with pytest.raises(InputFileError, match=words) as caught:
        read_garmentcode(write(tmp_path, content))
    assert "\n" not in str(caught.value)
    assert "pattern.json" in str(caught.value)


def test_not_json(tmp_path):
    path = tmp_path / "pattern.json"
    path.write_text("{'pattern'")
    with pytest.raises(InputFileError, match="JSON"):
        read_garmentcode(path)
