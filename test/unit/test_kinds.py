"""Every kind of collider by its record, against its own surface; nobody else names one."""

import ast
from pathlib import Path

import numpy as np
import pytest

from garment_sim_ros.colliders.description import from_json, to_json
from garment_sim_ros.colliders.fitting import METHODS
from garment_sim_ros.colliders.report.surfaces import surface
from garment_sim_ros.contact.block import DISTANCE, ROWS, load_block
from garment_sim_ros.contact.cores import Cores
from garment_sim_ros.contact.distance import shape_distance, shape_distances
from garment_sim_ros.contact.kinds import KINDS
from garment_sim_ros.contact.packed import PosedShapes, pack, pose
from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet, frame_of
from garment_sim_ros.geometry.locality import BLOCK
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.jit import kernel
from garment_sim_ros.params import ColliderOptions, declarations

PACKAGE = Path(__file__).parents[2] / "garment_sim_ros"
SHAPES = [
    pytest.param((kind, geometry), id=variant)
    for kind in KINDS.values()
    if kind.shape is not None
    for variant, geometry in kind.variants.items()
]
FAR = np.float32(10.0)
POINTS = 4 * BLOCK


@kernel()
def distances(shapes, posed, x, found, out):
    """Signed distance of points [n, 3] to the first shape, and the way out of it."""
    for p in range(x.shape[0]):
        found[p], out[p, 0], out[p, 1], out[p, 2] = shape_distance(
            shapes, posed, 0, x[p, 0], x[p, 1], x[p, 2], FAR
        )


@kernel()
def block_distances(shapes, posed, x, block, cell, lane, found):
    """The same in blocks, shape [n] with n a multiple of `BLOCK`."""
    flat = x.reshape(-1)
    for begin in range(0, x.shape[0], BLOCK):
        load_block(flat, begin, begin + BLOCK, block)
        shape_distances(shapes, posed, 0, np.float32(0.01), block, cell, lane)
        for p in range(BLOCK):
            found[begin + p] = block[DISTANCE + p]


class Alone:
    """One shape by itself at the origin, its surface, and points all around it."""

    def __init__(self, kind, geometry):
        self.collider = Collider(name="one", kind=kind.name, bone="bone", geometry=geometry)
        self.set = ColliderSet(colliders=(self.collider, frame_of("bone")))
        self.shapes = pack(self.set)
        self.posed = PosedShapes.room_for(self.shapes)
        still = ColliderPoses.identity(2)
        pose(self.shapes, still, still, np.zeros(3), self.posed)
        self.vertices, self.triangles = surface(self.collider, directions=4000)
        self.mesh = MeshDistance(self.vertices, self.triangles)
        self.size = float(np.ptp(self.vertices, axis=0).max())
        low, high = self.vertices.min(axis=0), self.vertices.max(axis=0)
        rng = np.random.default_rng(5)
        self.points = rng.uniform(low - 0.3 * self.size, high + 0.3 * self.size, (POINTS, 3))
        self.height = self.mesh.signed_distance(self.points)[0]

    def distances(self, points):
        found = np.zeros(len(points), np.float32)
        out = np.zeros((len(points), 3), np.float32)
        distances(self.shapes, self.posed, points.astype(np.float32), found, out)
        return found, out


@pytest.fixture(params=SHAPES)
def alone(request):
    return Alone(*request.param)


def test_the_distance_is_0_at_the_surface_and_its_direction_leads_out(alone):
    corners = alone.vertices[alone.triangles[:: max(len(alone.triangles) // 500, 1)]]
    points = alone.vertices[np.unique(alone.triangles)]
    found, _ = alone.distances(points)
    assert np.abs(found).max() < 0.02 * alone.size
    middle = corners.mean(axis=1)
    found, out = alone.distances(middle)
    assert np.abs(found).max() < 0.02 * alone.size
    assert np.abs(np.linalg.norm(out, axis=1) - 1.0).max() < 1e-4
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert ((normal * out).sum(axis=1) > 0.0).mean() > 0.99


def test_the_distance_tells_inside_from_outside_and_is_no_more_than_the_true_one(alone):
    found, _ = alone.distances(alone.points)
    clear = np.abs(alone.height) > 0.02 * alone.size
    assert ((found < 0.0) == (alone.height < 0.0))[clear].all()
    assert (found[clear] <= alone.height[clear] + 0.02 * alone.size).all()


def test_distances_of_blocks_are_lower_bounds(alone):
    found = np.zeros(POINTS, np.float32)
    block = np.zeros(ROWS * BLOCK, np.float32)
    cell, lane = np.zeros(BLOCK, np.int32), np.zeros(BLOCK + 1, np.int32)
    x = alone.points.astype(np.float32)
    block_distances(alone.shapes, alone.posed, x, block, cell, lane, found)
    exact, _ = alone.distances(alone.points)
    # A hull's own is less than the true distance, and its box may be farther than that.
    assert (found <= np.maximum(exact, alone.height) + 1e-4 * alone.size).all()


def test_a_record_in_double_precision_says_the_same(alone):
    kind = alone.collider.record
    if kind.shape.distance is not None:
        found, _ = alone.distances(alone.points)
        exact = kind.shape.distance(alone.collider.geometry, alone.points)
        assert np.abs(found - exact).max() < 1e-4 * alone.size
    if kind.shape.radii is not None:
        scaled = alone.vertices / kind.shape.radii(alone.collider.geometry)
        assert np.allclose(np.linalg.norm(scaled, axis=1), 1.0)


def test_the_inscribed_ball_fits(alone):
    kind = alone.collider.record
    radius = kind.shape.inscribed_radius(alone.collider.geometry)
    low, high = alone.vertices.min(axis=0), alone.vertices.max(axis=0)
    axes = [np.linspace(a, b, 21) for a, b in zip(low, high)]
    inside = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    assert 0.0 < radius <= -alone.mesh.signed_distance(inside)[0].min() + 0.02 * alone.size


def test_the_bounds_hold_the_shape(alone):
    start, axis = alone.posed.bound[0, :3], alone.posed.bound[0, 3:6]
    length, radius = alone.posed.bound[0, 6:]
    t = np.clip((alone.vertices - start) @ axis, 0.0, length)
    away = np.linalg.norm(alone.vertices - start - t[:, None] * axis, axis=1)
    assert away.max() <= radius + 1e-5 * alone.size
    box = alone.posed.box[0]
    assert (alone.vertices.min(axis=0) >= box[:3] - 1e-5 * alone.size).all()
    assert (alone.vertices.max(axis=0) <= box[3:] + 1e-5 * alone.size).all()
    assert (box[3:] - box[:3]).max() < 2.0 * alone.size


def test_cores_are_no_less_deep_in_the_surface_than_they_say(alone):
    cores = Cores.of(alone.set)
    for (a, b), depth in zip(cores.ends, cores.depth):
        along = a + np.linspace(0.0, 1.0, 50)[:, None] * (b - a)
        height = alone.mesh.signed_distance(along)[0]
        assert depth <= -height.max() + 0.01 * alone.size


@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
def test_descriptions_carry_it(kind):
    frame = frame_of("bone")
    for geometry in kind.variants.values():
        if kind.is_frame:
            continue
        carried = {k: np.asarray(v) for k, v in geometry.items()}
        one = Collider(name="one", kind=kind.name, bone="bone", geometry=carried)
        colliders = ColliderSet(colliders=(frame, one))
        back = from_json(to_json(colliders))
        assert back.revision == colliders.revision
        assert set(back.colliders[1].geometry) <= {*kind.keys, *kind.optional}


def test_names_and_codes_are_unique():
    assert len({kind.code for kind in KINDS.values()}) == len(KINDS)
    assert all(name == kind.name for name, kind in KINDS.items())
    variants = [variant for kind in KINDS.values() for variant in kind.variants]
    assert len(set(variants)) == len(variants)
    for kind in KINDS.values():
        assert all(kind.variant_of(g) == variant for variant, g in kind.variants.items())


def test_the_table_of_methods_has_all_that_may_be_asked_for():
    assert tuple(METHODS) == declarations(ColliderOptions)["method"].choices
    variants = {variant for kind in KINDS.values() for variant in kind.variants}
    assert all(method.variants(ColliderOptions()) <= variants for method in METHODS.values())


OTHER_MEANINGS = {
    "__init__.py": {"sphere", "capsule", "ellipsoid", "hull"},  # public functions that make some
    "avatar.py": {"mesh"},  # of a garment
    "cli/dress.py": {"mesh"},
    "body/loaders/gltf_marks.py": {"mesh"},  # glTF's own word
    "body/loaders/gltf_scene.py": {"mesh"},
    "body/loaders/gltf_skeleton.py": {"mesh"},
    "body/loaders/mesh_file.py": {"mesh"},  # trimesh's
    "body/loaders/urdf_visuals.py": {"sphere", "capsule", "mesh"},  # URDF's tags
    "collider_params.py": {"sdf", "mesh"},  # names of methods, once
    "colliders/bare_skin.py": {"frame"},  # an entry of a skin's geometry
    "colliders/exact_mesh.py": {"frame"},  # an entry of a skin's geometry
    "contact/mesh/skinned.py": {"frame"},
    "contact/papers/outer_map.py": {"sphere"},  # a kind of map
    "mocap/gltf_clip.py": {"mesh"},  # glTF's
    "garment/outfit_file.py": {"mesh"},  # of a garment
    "garment/patterns/making.py": {"mesh"},
    "garment/sewn_file.py": {"mesh"},  # glTF's own word
    "recording/export/glb.py": {"mesh"},  # glTF's own word
    "stability/cells.py": {"mesh"},
    "stability/dressed.py": {"frame"},  # of a clip
    "tradeoff/scenes.py": {"sphere"},  # the public function that makes one
}
"""Words that name a kind of collider in `contact/kinds`, and something else in these files."""


def test_kinds_are_named_in_their_own_files_only():
    found = {}
    for path in PACKAGE.rglob("*.py"):
        file = path.relative_to(PACKAGE).as_posix()
        texts = {
            n.value for n in ast.walk(ast.parse(path.read_text())) if isinstance(n, ast.Constant)
        }
        named = {text for text in texts if isinstance(text, str)} & set(KINDS)
        if named and not file.startswith("contact/kinds/"):
            found[file] = named
    assert found == OTHER_MEANINGS, "ask the record: collider.record, collider.shape, HULL.name"
