"""Colliders at joints: what covers the skin that bends.

The rigid regions' hulls fit in the bind pose; when a joint turns, a wedge opens on its outer side.
Sun et al. 2007, section 3.1, put a sphere about the joint that contains the flexible vertices.
About a hip or in the trunk that would stand off the body by centimetres. Ours lies just under the
skin of the bind pose and turns by half the joint's rotation, as skin does that both bones move
alike; of all such spheres it is the one that leaves least of the wedge open. Where centimetres are
left, as in the flat trunk and where weights change over a long way, hulls join it: each of the
skin in a band of weights, turning by the band's middle weight. Far from the joint such a hull
would stand off like a wing, so that what it closes is weighed against that.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.skin import Body
from garment_sim_ros.colliders.hulls.convex_parts import split
from garment_sim_ros.colliders.hulls.hull import Hull, convex_hull
from garment_sim_ros.colliders.range_of_motion import joint_rotations
from garment_sim_ros.colliders.regions import Regions, skin_normals
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.geometry.ties import first_least, to_nanometres
from garment_sim_ros.geometry.transforms import invert_transform
from garment_sim_ros.jit import exact_kernel

SHARE = 0.5
"""Share of the joint's rotation that a joint's sphere takes part in."""
_BANDS = ((0.25, 0.75), (0.05, 0.45), (0.55, 0.95), (0.4, 0.6), (0.1, 0.3), (0.7, 0.9))
"""Weights of the lower bone between which skin belongs to one hull of a joint."""
_COVERED = 0.008
"""Skin that leaves the colliders by less than this needs no further one [m]."""
_OVER = 0.003
"""How far a joint's sphere may stand over the skin nearest to it [m]."""
_ENOUGH = 0.4
"""A sphere is worth it if it leaves at most this share of the squared gaps open."""
_FAT = 0.25
"""What a square of standing over the skin counts against a square of gap closed."""
_GAIN = 0.1
"""A hull is worth it if its gain is at least this share of the squared gaps."""
_EQUAL = 1e-6
"""Hulls whose gains differ by this share of what is enough are equally good."""
_SAMPLES = 120
"""Most skin points that are moved through a joint's range."""
_CENTRES = 15
"""Skin points towards which a sphere's centre is looked for."""


@dataclass(frozen=True)
class Joint:
    """A joint between a region and the one above it, in the bind pose.

    Attributes:
        region: The lower region.
        centre: The joint's position [m], shape [3].
        depth: Distance from there to the nearest skin [m], negative outside the body.
        points: Skin points that both sides move [m], shape [n, 3].
        normal: Unit normals of the skin there, shape [n, 3].
        weight: Weight of the lower side at each, shape [n].
        rotations: Rotations through the joint's range, shape [k, 3, 3].
        below: Regions that the joint turns.
    """

    region: int
    centre: FloatArray
    depth: float
    points: FloatArray
    normal: FloatArray
    weight: FloatArray
    rotations: FloatArray
    below: frozenset[int]


def joints(
    body: Body, regions: Regions, skin: MeshDistance, flexible: float = 0.001
) -> list[Joint]:
    """All joints about which skin bends.

    Args:
        body: Rig and skin.
        regions: Its regions.
        skin: The skin in the bind pose.
        flexible: Weight of the lesser side of a joint from which on skin bends with it.
    """
    normal = skin_normals(body.skin)
    found = []
    for m in range(len(regions)):
        if regions.parent[m] < 0:
            continue
        below = {m}
        for k in range(m + 1, len(regions)):
            if int(regions.parent[k]) in below:
                below.add(k)
        weight = regions.weight[:, sorted(below)].sum(axis=1)
        bends = np.flatnonzero((weight > flexible) & (weight < 1.0 - flexible))
        own = body.skin.vertices[regions.owner == m]
        if len(bends) == 0 or len(own) == 0:
            continue
        centre = invert_transform(body.skin.T_bone_bind[regions.first[m]])[:3, 3]
        along = own.mean(axis=0) - centre
        length = float(np.linalg.norm(along))
        along = along / length if length > 1e-6 else np.array([0.0, 0.0, 1.0])
        bends = bends[:: max(1, len(bends) // _SAMPLES)]
        found.append(
            Joint(
                region=m,
                centre=centre,
                depth=-float(skin.signed_distance(centre[None])[0][0]),
                points=body.skin.vertices[bends],
                normal=normal[bends],
                weight=weight[bends],
                rotations=joint_rotations(regions.human[m], along),
                below=frozenset(below),
            )
        )
    return found


def gaps(joint: Joint, hulls: list[tuple[int, Hull]]) -> tuple[FloatArray, FloatArray]:
    """Skin points through a joint's range, and how far they leave the regions' hulls.

    Args:
        joint: The joint; it alone turns, and skin follows by linear blending.
        hulls: Region and hull, all in the bind pose.

    Returns:
        Positions relative to the joint [m], shape [k, n, 3], and their distances to the nearest
        hull's planes, negative inside [m], shape [k, n].
    """
    posed = turned_skin(joint)
    height = np.full(posed.shape[:2], np.inf)
    low, high = joint.points.min(axis=0) - 0.05, joint.points.max(axis=0) + 0.05
    for region, hull in hulls:
        if (hull.vertices.min(axis=0) > high).any() or (hull.vertices.max(axis=0) < low).any():
            continue
        seen = posed @ joint.rotations if region in joint.below else posed
        at = np.ascontiguousarray(seen + joint.centre).reshape(-1, 3)
        _lower_to_hull(at, hull.planes, height.reshape(-1))
    return posed, height


def turned_skin(joint: Joint) -> FloatArray:
    """Skin points through a joint's range, relative to the joint [m], shape [k, n, 3].

    The joint alone turns, and skin follows by linear blending.
    """
    arm = joint.points - joint.centre
    turned = arm @ np.swapaxes(joint.rotations, 1, 2)
    w = joint.weight[:, None]
    posed: FloatArray = (1.0 - w) * arm + w * turned
    return posed


def holding_radius(joint: Joint) -> float:
    """Radius of the sphere about the joint that contains all skin that bends with it [m].

    Turned about the joint it stays as far away, blended linearly it only comes nearer.
    """
    return float(np.linalg.norm(joint.points - joint.centre, axis=1).max())


@dataclass(frozen=True)
class BandHull:
    """A hull of skin that both sides of a joint move about alike.

    Attributes:
        hull: The hull in the bind pose.
        share: Share of the joint's rotation that it takes part in.
        height: Distances to it, like those of `gaps`.
        over: How far the skin that it is made of lifts it over where that skin is, shape [k, n].
    """

    hull: Hull
    share: float
    height: FloatArray
    over: FloatArray


def band_hulls(body: Body, regions: Regions, joint: Joint, posed: FloatArray) -> list[BandHull]:
    """Hulls for bands of weights.

    Args:
        body: Rig and skin.
        regions: Its regions.
        joint: The joint.
        posed: As from `gaps`.
    """
    weight = regions.weight[:, sorted(joint.below)].sum(axis=1)
    skin = np.column_stack([body.skin.vertices, weight])[body.skin.triangles]
    skin = skin[(skin[..., 3].max(axis=1) > 0.0) & (skin[..., 3].min(axis=1) < 1.0)]
    found = []
    for low, high in _BANDS:
        _, corners, _ = split(skin, skin[..., 3] - low)
        corners, _, _ = split(corners, corners[..., 3] - high)
        try:
            hull = convex_hull(to_nanometres(corners[..., :3].reshape(-1, 3)))
        except GeometryError:  # too little skin
            continue
        share = 0.5 * (low + high)
        turn = np.swapaxes(_turned(joint.rotations, share), 1, 2)
        lifted = (joint.points - joint.centre) @ turn - posed
        over = np.einsum("kni,kni->kn", lifted, joint.normal @ turn)
        over[:, (joint.weight < low) | (joint.weight > high)] = 0.0
        found.append(BandHull(hull, share, turned_height(joint, posed, hull, share), over))
    return found


def choose_hulls(height: FloatArray, hulls: list[BandHull]) -> list[BandHull]:
    """Those hulls, best first, that close much of the gaps and hardly stand over the skin.

    Args:
        height: As from `gaps`, or what a sphere leaves of it.
        hulls: The candidates.
    """
    enough = _GAIN * open_gaps(height)
    candidates = list(hulls)
    chosen = []
    while candidates and not is_covered(height):
        gain = [
            open_gaps(height) - open_gaps(np.minimum(height, c.height)) - _FAT * open_gaps(c.over)
            for c in candidates
        ]
        best = first_least(np.negative(gain), _EQUAL * enough)
        if gain[best] < enough:
            break
        chosen.append(candidates.pop(best))
        height = np.minimum(height, chosen[-1].height)
    return chosen


def covering_sphere(
    joint: Joint, posed: FloatArray, height: FloatArray, skin: MeshDistance
) -> tuple[FloatArray, float, FloatArray]:
    """The half-turning sphere in the skin that leaves least of the gaps open.

    Args:
        joint: The joint.
        posed: As from `gaps`.
        height: As from `gaps`.
        skin: The skin in the bind pose.

    Returns:
        Centre in the bind pose [m], shape [3], radius [m], and distances to the sphere, shape
        [k, n].
    """
    both = (joint.weight > 0.02) & (joint.weight < 0.98)
    points = joint.points[both] if both.any() else joint.points
    arm = points[:: max(1, len(points) // _CENTRES)] - joint.centre
    offset = np.concatenate([np.zeros((1, 3)), 0.25 * arm, 0.5 * arm, 0.75 * arm])
    depth = -skin.signed_distance(offset + joint.centre)[0]
    deep = depth >= 0.3 * depth.max()
    seen = posed @ _turned(joint.rotations, SHARE)
    best = (np.inf, offset[0], 0.0, height)
    for at, radius in zip(offset[deep], np.maximum(depth[deep], 0.0) + _OVER):
        distance = np.linalg.norm(seen - at, axis=-1) - radius
        left = open_gaps(np.minimum(height, distance))
        if left < best[0]:
            best = (left, at, float(radius), distance)
    return best[1] + joint.centre, best[2], best[3]


def turned_height(joint: Joint, posed: FloatArray, hull: Hull, share: float) -> FloatArray:
    """Distances to the planes of a hull that turns by `share`, like those of `gaps`."""
    seen = seen_turned(joint, posed, share)
    height = np.full(posed.shape[:2], np.inf)
    _lower_to_hull(seen.reshape(-1, 3), hull.planes, height.reshape(-1))
    return height


def seen_turned(joint: Joint, posed: FloatArray, share: float) -> FloatArray:
    """Points of `turned_skin` in the bind pose of what turns by a share of the joint."""
    seen: FloatArray = posed @ _turned(joint.rotations, share) + joint.centre
    return seen


def _turned(rotations: FloatArray, share: float) -> FloatArray:
    """Rotations by a share of the angle."""
    return Rotation.from_rotvec(share * Rotation.from_matrix(rotations).as_rotvec()).as_matrix()


def is_covered(height: FloatArray) -> bool:
    """Whether what sticks out is not worth a collider."""
    return height.size == 0 or float(height.max()) <= _COVERED


def open_gaps(height: FloatArray) -> float:
    """Sum of the squares of what sticks out [m^2]."""
    return float(np.square(np.maximum(height, 0.0)).sum())


def is_worth_it(height: FloatArray, own: FloatArray) -> bool:
    """Whether a sphere with the distances `own` closes most of the gaps."""
    return open_gaps(np.minimum(height, own)) <= _ENOUGH * open_gaps(height)


@exact_kernel()
def _lower_to_hull(points, planes, height):
    """Take the smaller of each height and that over a hull's planes."""
    for p in range(points.shape[0]):
        most = -np.inf
        for f in range(planes.shape[0]):
            above = (
                planes[f, 0] * points[p, 0]
                + planes[f, 1] * points[p, 1]
                + planes[f, 2] * points[p, 2]
                - planes[f, 3]
            )
            most = max(most, above)
            if most >= height[p]:
                break
        height[p] = min(height[p], most)
