"""Convex hulls with fewer triangles that still contain what they must.

Quadric-error triangle deletion after Sun et al. 2007, section 2.2: a triangle collapses to one new
vertex, at the best place that `hull_placement` allows. Edges collapse by the same code, and single
vertices move by it, which makes room for more deletions and polishes the result.
"""

from dataclasses import dataclass

import numpy as np

from garment_sim_ros.colliders.hulls.hull import Hull, convex_hull
from garment_sim_ros.colliders.hulls.hull_patch import (
    MAX_PATCH,
    face_neighbours,
    gather_link,
    gather_patch,
    replace_patch,
)
from garment_sim_ros.colliders.hulls.hull_placement import (
    MAX_CUTS,
    QUADRIC,
    VOLUME,
    Bounds,
    add_quadrics,
    fan_volume,
    place,
    quadric_error,
)
from garment_sim_ros.errors import ParameterError
from garment_sim_ros.geometry.ties import to_nanometres
from garment_sim_ros.jit import exact_kernel

_TRIANGLES_ONLY = 2
"""Above this multiple of the wanted number, whole triangles go at once: faster, and as good."""


@dataclass(frozen=True, kw_only=True)
class Simplification:
    """How far to go.

    Attributes:
        max_faces: Deletion stops at this number of triangles (the paper's floor), at least 4.
        outside: Farthest that the result may reach out of the planes of the hull that it must
            contain [m]; its own size at most.
        objective: `QUADRIC` stays close to the start, `VOLUME` takes all the slack there is.
        rounds: Most turns of deleting and polishing.
        triangles_only: Whether whole triangles are deleted, the cheapest first, and nothing else,
            as printed.
    """

    max_faces: int = 4
    outside: float = np.inf
    objective: int = QUADRIC
    rounds: int = 10
    triangles_only: bool = False


def simplify_hull(start: Hull, inner: Hull, how: Simplification) -> Hull:
    """A hull with fewer triangles than `start` that contains `inner`.

    Args:
        start: Contains `inner` (normally: is `inner` inflated).
        inner: What must stay inside; all its planes moved out by `how.outside` bound the result.
        how: Limits and objective.

    Raises:
        ParameterError: A floor below 4 triangles.
    """
    if how.max_faces < 4:
        raise ParameterError("max_faces", f"found {how.max_faces}", "allowed: 4 or more")
    best = _attempt(start, inner, how, how.objective)
    if (
        len(best.faces) > how.max_faces + 1 and not how.triangles_only
    ):  # stopped early: another placement may get further
        other = _attempt(start, inner, how, VOLUME if how.objective == QUADRIC else QUADRIC)
        if len(other.faces) < len(best.faces):
            best = other
    return best


def _attempt(start: Hull, inner: Hull, how: Simplification, objective: int) -> Hull:
    # Which of two equal triangles goes must not hang on the last digit: it does not where
    # vertices, place and size are rounded.
    size = float(to_nanometres(np.asarray(np.linalg.norm(np.ptp(start.vertices, axis=0)))))
    centre = to_nanometres(start.vertices.mean(axis=0))
    faces = start.faces.copy()
    count = len(start.vertices)
    x = np.empty((2 * count, 3))
    x[:count] = to_nanometres((start.vertices - centre) / size)
    quadrics = np.zeros((len(x), 10))
    add_quadrics(x, faces, quadrics)
    limits = inner.planes.copy()
    limits[:, 3] += min(how.outside, size) - limits[:, :3] @ centre
    limits[:, 3] /= size
    _simplify(
        x,
        count,
        quadrics,
        faces,
        face_neighbours(faces),
        Bounds(
            inner=np.ascontiguousarray((inner.vertices - centre) / size),
            limits=to_nanometres(limits),
            touching=np.full((3 * len(faces), 4), np.nan),
            objective=objective,
        ),
        how.max_faces,
        how.rounds,
        how.triangles_only,
    )
    used = np.unique(faces[faces[:, 0] >= 0])
    return convex_hull(x[used] * size + centre)


@exact_kernel(inner=True)
def _removed_quadric(quadrics, removed):
    """Sum over the distinct vertices in `removed`."""
    total = quadrics[removed[0]].copy()
    if removed[1] != removed[0]:
        total += quadrics[removed[1]]
    if removed[2] != removed[0] and removed[2] != removed[1]:
        total += quadrics[removed[2]]
    return total


@exact_kernel(inner=True)
def _evaluate(x, quadrics, faces, neighbours, bounds, seed, removed, scratch, planes, v):
    """Cost of replacing the vertices `removed` by the best one, which goes into v.

    Returns:
        (cost, patch size, outline size); infinite cost where it is not possible.
    """
    patch, link, outer = scratch[0], scratch[1], scratch[2]
    count = gather_patch(faces, neighbours, seed, removed, patch)
    if count < 0:
        return np.inf, 0, 0
    edges = gather_link(faces, neighbours, removed, patch, count, link, outer)
    if edges == 0:
        return np.inf, 0, 0
    quadric = _removed_quadric(quadrics, removed)
    guess = np.zeros(3)
    for k in range(3):
        guess += x[removed[k]] / 3.0
    if not place(x, quadric, faces, bounds, link, outer, edges, guess, planes, v):
        return np.inf, 0, 0
    if bounds.objective == QUADRIC:
        return quadric_error(quadric, v), count, edges
    before = 0.0
    for k in range(count):
        a, b, c = x[faces[patch[k], 0]], x[faces[patch[k], 1]], x[faces[patch[k], 2]]
        before += (
            a[0] * (b[1] * c[2] - b[2] * c[1])
            + a[1] * (b[2] * c[0] - b[0] * c[2])
            + a[2] * (b[0] * c[1] - b[1] * c[0])
        ) / 6.0
    return fan_volume(x, link, edges, v) - before, count, edges


@exact_kernel(inner=True)
def _candidate(faces, f, i, removed):
    """Vertices that candidate i of face f removes: an edge (0 to 2) or the triangle (3)."""
    removed[0] = faces[f, i % 3]
    removed[1] = faces[f, (i + 1) % 3]
    removed[2] = faces[f, (i + 2) % 3] if i == 3 else removed[0]


@exact_kernel(inner=True)
def _renew_costs(
    x, quadrics, faces, neighbours, bounds, most, with_edges, touched, costs, scratch, planes
):
    """Costs of the candidates at touched vertices that take away `most` triangles at most."""
    removed = np.empty(3, dtype=np.int32)
    v = np.empty(3)
    for f in range(faces.shape[0]):
        if faces[f, 0] < 0:
            continue
        if not (touched[faces[f, 0]] or touched[faces[f, 1]] or touched[faces[f, 2]]):
            continue
        for i in range(4):
            costs[f, i] = np.inf
            if i < 3 and (neighbours[f, i] < f or not with_edges):
                continue
            if (2 if i < 3 else 4) > most:
                continue
            _candidate(faces, f, i, removed)
            cost, _, _ = _evaluate(
                x, quadrics, faces, neighbours, bounds, f, removed, scratch, planes, v
            )
            costs[f, i] = cost if i < 3 else 0.5 * cost


@exact_kernel(inner=True)
def _cheapest(costs):
    """The least cost, and the triangle and number of its candidate."""
    best = np.inf
    best_f = best_i = 0
    for f in range(costs.shape[0]):
        for i in range(4):
            if costs[f, i] < best:
                best, best_f, best_i = costs[f, i], f, i
    return best, best_f, best_i


@exact_kernel()
def _delete(
    x, count, quadrics, faces, neighbours, bounds, max_faces, triangles_only, scratch, planes
):
    """Delete the cheapest edge or triangle until none is left to delete.

    Costs are kept per candidate and renewed around each deletion; the cheapest is evaluated once
    more before it is carried out, so that only the order can suffer from an old cost.

    Returns:
        The number of vertices ever made, and whether anything was deleted.
    """
    alive = 0
    for f in range(faces.shape[0]):
        alive += faces[f, 0] >= 0
    costs = np.full((faces.shape[0], 4), np.inf)
    touched = np.ones(x.shape[0], dtype=np.bool_)
    removed = np.empty(3, dtype=np.int32)
    v = np.empty(3)
    any_done = False
    with_edges = not triangles_only and alive <= _TRIANGLES_ONLY * max_faces
    while alive > max_faces:
        if not (with_edges or triangles_only) and alive <= _TRIANGLES_ONLY * max_faces:
            with_edges = True
            touched[:] = True
        _renew_costs(
            x, quadrics, faces, neighbours, bounds, alive - max_faces, with_edges, touched, costs,
            scratch, planes,
        )  # fmt: skip
        touched[:] = False
        done = False
        while not done:
            best, f, i = _cheapest(costs)
            if best == np.inf:
                if with_edges or triangles_only:
                    return count, any_done
                with_edges = True
                touched[:] = True
                break
            costs[f, i] = np.inf
            if alive - (2 if i < 3 else 4) < max_faces:
                continue
            _candidate(faces, f, i, removed)
            cost, patch_size, edges = _evaluate(
                x, quadrics, faces, neighbours, bounds, f, removed, scratch, planes, v
            )
            share = 1.0 if i < 3 else 0.5
            if share * cost > best + 1e-3 * abs(best) + 1e-15:
                costs[f, i] = share * cost
                continue
            x[count] = v
            quadrics[count] = _removed_quadric(quadrics, removed)
            replace_patch(
                faces, neighbours, scratch[0], patch_size, scratch[1], scratch[2], edges, count
            )
            for k in range(edges, patch_size):
                costs[scratch[0, k], :] = np.inf
            _forget(bounds.touching, scratch[0], patch_size)
            touched[count] = True
            count += 1
            alive -= patch_size - edges
            done = True
            any_done = True
    return count, any_done


@exact_kernel()
def _forget(touching, patch, count):
    """The half-spaces of faces that have changed."""
    for k in range(count):
        touching[3 * patch[k] : 3 * patch[k] + 3] = np.nan


@exact_kernel()
def _polish(x, count, quadrics, faces, neighbours, bounds, scratch, planes):
    """Move every vertex to its best allowed place, one after the other."""
    face_of = np.full(count, -1, dtype=np.int32)
    for f in range(faces.shape[0]):
        if faces[f, 0] >= 0:
            for c in range(3):
                face_of[faces[f, c]] = f
    removed = np.empty(3, dtype=np.int32)
    v = np.empty(3)
    for vertex in range(count):
        if face_of[vertex] < 0:
            continue
        removed[:] = vertex
        before = quadric_error(quadrics[vertex], x[vertex]) if bounds.objective == QUADRIC else 0.0
        cost, patch_size, _ = _evaluate(
            x, quadrics, faces, neighbours, bounds, np.int64(face_of[vertex]), removed, scratch,
            planes, v,
        )  # fmt: skip
        if cost < before:
            x[vertex] = v
            _forget(bounds.touching, scratch[0], patch_size)


@exact_kernel()
def _simplify(x, count, quadrics, faces, neighbours, bounds, max_faces, rounds, triangles_only):
    """Delete and polish in turns: polishing makes room for more deletions."""
    scratch = np.empty((3, MAX_PATCH), dtype=np.int32)
    planes = np.empty((3 * MAX_PATCH + MAX_CUTS, 4))
    for _ in range(rounds):
        count, deleted = _delete(
            x, count, quadrics, faces, neighbours, bounds, max_faces, triangles_only, scratch,
            planes,
        )  # fmt: skip
        if triangles_only:
            break
        for _ in range(3):
            _polish(x, count, quadrics, faces, neighbours, bounds, scratch, planes)
        if not deleted:
            break
