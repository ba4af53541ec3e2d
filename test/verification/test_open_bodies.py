"""Garments on bodies that are open where a game leaves out what is not seen."""

import dataclasses
import itertools

import numpy as np
import pytest

import garment_sim_ros as gs
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.colliders.fitting import fit_colliders
from garment_sim_ros.contact.pierced import PiercedMeter
from garment_sim_ros.garment.generators import GENERATORS
from garment_sim_ros.garment.measures import Measures
from garment_sim_ros.geometry.topology import boundary_loops, vertex_normals

SIDES = ("left", "right")
EXTREMITIES = ("neck", "head", *(f"{s}{part}" for s in SIDES for part in ("Hand", "Foot")))
CUTS = {
    "neck": ("neck", "head"),
    "wrists": ("leftHand", "rightHand"),
    "ankles": ("leftFoot", "rightFoot"),
    "all": EXTREMITIES,
}
OPENINGS = {"neck": 1, "wrists": 2, "ankles": 2, "all": 5}
FILES = (
    *("mannequin", "bodies/mh_female_young.glb", "bodies/CesiumMan.glb"),
    *("bodies/makehuman/base.obj", "urdf/human_1m65.urdf"),
)


def without(body, bones):
    """The body without the skin that follows some bones."""
    gone = Measures(body).share(*(b for b in bones if b in body.humanoid)) > 0.5
    used, triangles = np.unique(
        body.skin.triangles[~gone[body.skin.triangles].any(axis=1)], return_inverse=True
    )
    skin = dataclasses.replace(
        body.skin,
        vertices=body.skin.vertices[used],
        triangles=triangles.reshape(-1, 3).astype(np.int32),
        bone=body.skin.bone[used],
        weight=body.skin.weight[used],
    )
    return dataclasses.replace(body, skin=skin)


@pytest.mark.parametrize(
    "cut", [pytest.param(c, marks=() if c == "all" else pytest.mark.slow) for c in CUTS]
)
@pytest.mark.parametrize("file", FILES)
def test_every_garment_on_a_body_that_is_cut_open(data_file, file, cut):
    body = load_body(file if file == "mannequin" else data_file(*file.split("/")))
    body = without(body, CUTS[cut])
    if not file.endswith(".urdf"):  # its parts are closed, each by itself
        assert len(boundary_loops(body.skin.triangles)) == OPENINGS[cut]
    measures = Measures(body)
    for name, openings in (("short_skirt", 2), ("long_skirt", 2), ("tshirt", 4)):
        mesh, _ = GENERATORS[name].make(measures, GENERATORS[name].options())
        assert len(boundary_loops(mesh.triangles)) == openings


def shells(body, groups, scale):
    """The body cut into open shells, each scaled about its middle: below 1 with gaps."""
    own = np.zeros(len(body.skin.vertices), int)
    for number, bones in enumerate(groups, start=1):
        own[Measures(body).share(*(b for b in bones if b in body.humanoid)) > 0.5] = number
    parts, first = [], 0
    for number in range(len(groups) + 1):
        triangles = body.skin.triangles[(own[body.skin.triangles] == number).all(axis=1)]
        used, index = np.unique(triangles, return_inverse=True)
        x = body.skin.vertices[used]
        middle = x.mean(axis=0)
        parts.append((used, middle + scale * (x - middle), index.reshape(-1, 3) + first))
        first += len(used)
    return with_skin(body, parts)


def doubled(body, distance):
    """The body under a second shell, as a jacket over the skin."""
    normal = np.empty_like(body.skin.vertices)
    vertex_normals(body.skin.vertices, body.skin.triangles, normal)
    every = np.arange(len(normal))
    over = body.skin.vertices + distance * normal
    inner, outer = body.skin.triangles, body.skin.triangles + len(normal)
    return with_skin(body, [(every, body.skin.vertices, inner), (every, over, outer)])


def with_skin(body, parts):
    used, vertices, triangles = (list(column) for column in zip(*parts))
    used = np.concatenate(used)
    skin = dataclasses.replace(
        body.skin,
        vertices=np.concatenate(vertices),
        triangles=np.concatenate(triangles).astype(np.int32),
        bone=body.skin.bone[used],
        weight=body.skin.weight[used],
    )
    return dataclasses.replace(body, skin=skin)


LIMBS = (
    ("neck", "head"),
    tuple(f"{s}{part}" for s in SIDES for part in ("UpperArm", "LowerArm", "Hand")),
    tuple(f"{s}{part}" for s in SIDES for part in ("UpperLeg", "LowerLeg", "Foot", "Toes")),
)
SEVERAL = {
    "cut": lambda body: shells(body, LIMBS, 1.0),
    "apart": lambda body: shells(body, LIMBS, 0.98),
    "overlapping": lambda body: shells(body, LIMBS, 1.03),
    "a jacket": lambda body: doubled(body, 0.01),
    "inner walls": lambda body: doubled(body, -0.01),
}


@pytest.mark.parametrize("variant", SEVERAL)
def test_a_shirt_on_a_body_of_several_shells(variant):
    body = SEVERAL[variant](load_body("mannequin:vertices=1500"))
    generator = GENERATORS["tshirt"]
    mesh, _ = generator.make(Measures(body), generator.options())
    assert len(boundary_loops(mesh.triangles)) == 4


@pytest.mark.parametrize("variant", ["without extremities", "apart"])
def test_garments_stay_on_an_open_body_that_walks(variant):
    body = load_body("mannequin:vertices=1500")
    body = (
        without(body, EXTREMITIES) if variant == "without extremities" else SEVERAL[variant](body)
    )
    avatar = gs.Avatar(body, fit_colliders(body))
    outfit = avatar.dress("tshirt_short_skirt")
    simulation = gs.Simulation(outfit, avatar.colliders)
    meter = PiercedMeter(avatar.colliders)
    for poses in itertools.islice(avatar.play(gs.load_clip("walk"), rate=60), 45):
        simulation.step(poses, dt=1 / 60)
        meter.add(
            poses, {g.name: (simulation[g.name].positions, g.triangles) for g in outfit.garments}
        )
    assert meter.result().pierced == 0
    for garment in outfit.garments:
        assert simulation[garment.name].health.resets == 0
        assert np.isfinite(simulation[garment.name].positions).all()
