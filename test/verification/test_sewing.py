"""Panels sewn on a body: they close around it, keep their lengths, and come to rest."""

from dataclasses import replace

import numpy as np
import pytest
from simple_patterns import tube

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.errors import GeometryError, InputFileError
from garment_sim_ros.garment.materials import PRESETS, material_from
from garment_sim_ros.garment.patterns import sewing
from garment_sim_ros.garment.patterns.gates import LIMITS, gates
from garment_sim_ros.garment.patterns.ironing import ironed, self_intersections
from garment_sim_ros.garment.patterns.making import DRAFTS, Model, make
from garment_sim_ros.garment.patterns.parted import has_legs
from garment_sim_ros.garment.patterns.pieces import cut
from garment_sim_ros.garment.patterns.placing import CLEARANCE, placed_clear
from garment_sim_ros.garment.patterns.sewing import sew
from garment_sim_ros.geometry.topology import boundary_loops, non_manifold_edges
from garment_sim_ros.params import Material
from garment_sim_ros.sim.simulation import Simulation


@pytest.fixture(scope="module")
def model():
    return Model(load_body("mannequin"))


@pytest.fixture(scope="module")
def tshirt(model):
    return make("tshirt", model)


@pytest.fixture(scope="module")
def skirt(model):
    return make("short_skirt", model)


def test_a_t_shirt_passes_all_gates(tshirt):
    assert not tshirt.gates.failed, tshirt.gates.lines()
    assert set(tshirt.gates.figures) == set(LIMITS)


def test_a_skirt_passes_all_gates(skirt):
    assert not skirt.gates.failed, skirt.gates.lines()


@pytest.mark.parametrize(
    ("wearer", "garment"),
    [
        ("mannequin:height=2.0,build=1,sex=1", "short_skirt"),
        ("mannequin", "long_sleeved_shirt"),
    ],
)
def test_seams_close_on_the_particles_and_not_where_they_are_shown(wearer, garment):
    made = make(garment, Model(load_body(wearer)))
    assert max(made.sewn.gaps) < 1e-4
    assert not made.gates.failed, made.gates.lines()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "garment"),
    [
        ("mh_female_young.glb", "long_sleeved_shirt"),  # bent arms
        ("CesiumMan.glb", "trousers"),  # legs close to each other
        ("mh_proxy_female1605.obj", "trousers"),  # no bones
    ],
)
def test_limbs_are_dressed_whatever_they_are_like(name, garment, data_file):
    model = Model(load_body(data_file("bodies", name)))
    made = make(garment, model)
    assert not made.gates.failed, made.gates.lines()
    # No patch of skin shows, as small as it may be.
    depth = -model.distance.signed_distance(made.sewn.vertices)[0]
    assert depth.max() < 1e-3


def test_sizes_are_those_of_the_first_paper(tshirt, skirt):
    for made, vertices, triangles in ((tshirt, 1503, 2908), (skirt, 1687, 3264)):
        assert len(made.sewn.vertices) == pytest.approx(vertices, rel=0.05)
        assert len(made.sewn.triangles) == pytest.approx(triangles, rel=0.05)


def test_a_t_shirt_has_four_openings_where_it_should(tshirt, model):
    t, x = tshirt.sewn.triangles, tshirt.sewn.vertices
    assert not len(non_manifold_edges(t))
    loops = sorted(boundary_loops(t), key=lambda loop: x[loop, 2].mean())
    assert len(loops) == 4
    tape = model.tape()
    hem, *cuffs, neck = (x[loop].mean(axis=0) for loop in loops)
    assert tape.crotch < hem[2] < tape.waist.height
    assert sorted(np.sign(c[1]) for c in cuffs) == [-1.0, 1.0]
    assert abs(neck[1]) < 0.02
    assert abs(neck[2] - tape.neck_base.height) < 0.06


def test_a_t_shirt_hangs_the_same_on_both_sides(tshirt):
    x = tshirt.sewn.vertices
    assert abs(x[:, 1].max() + x[:, 1].min()) < 0.01
    assert abs(np.median(x[:, 1])) < 0.02


def test_panels_start_clear_of_the_body(tshirt, model):
    gap = model.distance.signed_distance(tshirt.sewn.placed)[0]
    assert gap.min() > 0.009
    flat = tshirt.pieces.panel < 2
    assert gap[flat].min() >= CLEARANCE - 1e-6


def test_shirts_are_worn_thicker_than_their_fabric(tshirt, skirt):
    """As an outfit file says it, which reads as the fabric but for that."""
    assert skirt.material == "polyester"
    assert tshirt.fabric == "cotton_jersey"
    jersey = PRESETS["cotton_jersey"].material
    assert jersey.thickness < 0.004
    assert material_from(tshirt.material) == replace(jersey, thickness=0.004)


def test_what_was_sewn_rests_where_it_is_put_on(tshirt, model):
    garment = replace(
        model.garment(tshirt.sewn.vertices, tshirt.sewn.triangles, Material()),
        flat=tshirt.sewn.flat,
    )
    simulation = Simulation(garment, model.colliders)
    simulation.reset(model.poses)
    for _ in range(30):
        simulation.advance(model.poses, model.poses, 1 / 60)
    assert simulation["sewn"].health.rms_speed < 0.02
    assert np.abs(simulation["sewn"].positions - tshirt.sewn.vertices).max() < 0.15


def moved(pattern, by, turned=()):
    """A pattern whose panels start elsewhere; those named look the other way."""
    panels = {}
    for name, panel in pattern.panels.items():
        T = panel.placement.T_world_panel.copy()
        T[:3, 3] += by
        if name in turned:
            T = T @ np.diag([-1.0, 1.0, -1.0, 1.0])
            T[1, 3] *= -1.0
        panels[name] = replace(panel, placement=replace(panel.placement, T_world_panel=T))
    return replace(pattern, panels=panels)


def test_a_panel_that_faces_the_body_is_called_mirrored(model):
    pattern = moved(tube(width=0.4, other=0.3, height=0.3), [0.0, -0.2, 0.9])
    with pytest.raises(GeometryError, match="panel 'back' is mirrored"):
        placed_clear(cut(pattern, 0.04), model.distance, "mannequin")


def test_a_tube_too_narrow_for_the_body_is_not_called_done(model):
    """It closes beside the body, wound up."""
    pattern = moved(tube(width=0.1, other=0.3, height=0.3), [0.0, -0.05, 0.9], turned=("back",))
    pieces, placed = placed_clear(cut(pattern, 0.04), model.distance, "mannequin")
    with pytest.raises(
        GeometryError, match=r"pattern 'tube' runs through itself where it is sewn, .* too narrow"
    ):
        sew(pieces, placed, model, Material())


@pytest.mark.parametrize(
    ("rms", "sinks", "words"),
    [
        (0.4, 0.4, ""),
        (0.6, 0.4, "pattern 'tube' does not come to rest: it moves at 0.6 m/s"),
        (0.4, 0.6, "pattern 'tube': panel 'back' falls off the body at 0.6 m/s"),
    ],
)
def test_what_falls_or_quivers_is_refused_by_name(rms, sinks, words):
    """The back sinks as fast as that, less where it is sewn to the front, which stays."""
    pieces = cut(tube(), 0.1)
    sinking = np.zeros(pieces.welded.max() + 1)
    sinking[pieces.welded[pieces.panel == 1]] = sinks
    sinking[pieces.welded[pieces.panel == 0]] = 0.0
    of_back = sinking[pieces.welded[pieces.panel == 1]]
    sinking *= sinks / of_back.mean()
    if not words:
        sewing._check_worn(pieces, rms, sinking)
        return
    with pytest.raises(GeometryError, match=words):
        sewing._check_worn(pieces, rms, sinking)


@pytest.mark.parametrize("per_metre", [40, 33])
def test_a_pattern_in_another_unit_is_refused_before_it_is_cut(
    model, data_file, tmp_path, per_metre
):
    text = data_file("patterns", "dress_pencil_specification.json").read_text()
    path = tmp_path / "large.json"
    path.write_text(text.replace('"units_in_meter": 100', f'"units_in_meter": {per_metre}'))
    phases = []
    with pytest.raises(InputFileError, match=r"panel '.*' (reaches up to|is) \d.*another unit"):
        make(path, model, tell=lambda phase, share: phases.append((phase, share)))
    assert phases == [("cutting", 0.0)]


def test_self_intersections_are_found(tshirt):
    x, t = tshirt.sewn.vertices.copy(), tshirt.sewn.triangles
    assert not len(self_intersections(x, t))
    low = np.argmin(x[:, 2])
    x[low] += [-0.4 * np.sign(x[low, 0]), 0.0, 0.15]  # a corner of the hem through the back
    assert len(self_intersections(x, t))


def test_what_is_tucked_into_itself_is_laid_smooth(tshirt):
    x, t = tshirt.sewn.vertices.copy(), tshirt.sewn.triangles
    under = np.argmin(np.linalg.norm(x - x[tshirt.pieces.welded[_corner(tshirt)]], axis=1))
    near = np.linalg.norm(x - x[under], axis=1) < 0.05
    x[near] += [0.0, -0.12 * np.sign(x[under, 1]), 0.06]  # an armpit through the trunk's front
    assert len(self_intersections(x, t))
    smooth = ironed(x, t)
    assert not len(self_intersections(smooth, t))
    still = np.linalg.norm(x - x[under], axis=1) > 0.3
    assert np.array_equal(smooth[still], x[still])


def _corner(made):
    """A vertex of the front's underarm point."""
    front = made.pieces.pattern.panels["front"]
    own = np.flatnonzero(made.pieces.panel == 0)
    return own[np.argmin(np.linalg.norm(made.pieces.flat[own] - front.corners[2], axis=1))]


@pytest.mark.parametrize(
    ("figure", "spoil"),
    [
        ("stretch_p95", lambda s: replace(s, vertices=1.2 * s.vertices)),
        ("penetration_mm_p99", lambda s: replace(s, vertices=s.vertices * [0.8, 0.8, 1.0])),
        ("pierced", lambda s: replace(s, vertices=s.vertices + np.array([0.0, 0.2, 0.0]))),
        ("seam_gap_mm", lambda s: replace(s, gaps=(0.001,))),
        ("speed_mm_s", lambda s: replace(s, rms_speed=0.02)),
    ],
)
def test_each_gate_closes_on_what_it_is_for(tshirt, model, figure, spoil):
    spoiled = spoil(tshirt.sewn)
    found = gates(spoiled, model.skin, model.body.skin.triangles, model.colliders, model.poses)
    assert figure in found.failed
    assert any(line.startswith("FAIL " + figure) for line in found.lines())


@pytest.mark.parametrize("name", sorted(DRAFTS))
def test_legs_are_told_from_sleeves_and_skirts_without_labels(model, name):
    pattern = DRAFTS[name].make(model.tape())
    bare = {
        n: replace(panel, edges=tuple(replace(e, label="") for e in panel.edges))
        for n, panel in pattern.panels.items()
    }
    pieces = cut(replace(pattern, panels=bare), 0.04)
    assert has_legs(pieces, model.skin) is (name == "trousers")


def test_drafts_are_named_and_made(model):
    for name, draft in DRAFTS.items():
        pattern = draft.make(model.tape())
        assert pattern.name == name
