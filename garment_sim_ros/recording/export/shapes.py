"""A moving surface as few shapes: one rigid motion, and a base with weighted targets.

Frame by frame the rigid motion that brings the surface closest to one frame is taken out. What is
left is put together from the principal components of all frames. These make the *mean* error
small; a bound for the largest one takes three times as many. So vertices and frames with large
errors get more weight, and the components are computed anew, a few times; only then one takes more
of them.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.geometry.topology import vertex_normals

_ROUNDS = 4
_GROWTH = 1.1
_NORMALS = 64
"""Shapes that also turn normals; shading asks for less than shape does."""


@dataclass(frozen=True, kw_only=True)
class Shapes:
    """Frame k is ``rotation[k] @ (base + weights[k] @ targets) + centre[k]``.

    Attributes:
        base: All weights 0, a shape that never was [m], shape [v, 3], float32.
        targets: What a weight of 1 adds [m], shape [n, v, 3], float32.
        weights: Between 0 and 1, shape [m, n], float32.
        rotation: Shape [m, 3, 3].
        centre: [m], shape [m, 3].
        error: Largest distance of a vertex from where it was recorded [m].
    """

    base: Any
    targets: Any
    weights: Any
    rotation: FloatArray
    centre: FloatArray
    error: float


def shapes_of(positions: Any, bound: float) -> Shapes:
    """Few shapes for a moving surface.

    Args:
        positions: [m], shape [m, v, 3].
        bound: How far a vertex may be from its recorded place, at most [m].
    """
    x = np.asarray(positions, np.float64)
    rotation, centre = _rigid(x)
    local = np.einsum("fji,fvj->fvi", rotation, x - centre[:, None])
    base = local.mean(axis=0).astype(np.float32)
    moved = (local - base).reshape(len(x), -1)
    # Rounding to float32 takes a part of the bound.
    targets, weights = _components(moved, 0.98 * bound)
    # Blender cuts weights off below 0 and above 1.
    least = weights.min(axis=0)
    span = weights.max(axis=0) - least
    span[span == 0.0] = 1.0
    base = (base + (least @ targets).reshape(-1, 3)).astype(np.float32)
    weights = ((weights - least) / span).astype(np.float32)
    targets = (targets * span[:, None]).reshape(-1, x.shape[1], 3).astype(np.float32)
    made = base + np.tensordot(weights.astype(float), targets.astype(float), 1)
    return Shapes(
        base=base,
        targets=targets,
        weights=weights,
        rotation=rotation,
        centre=centre,
        error=float(np.sqrt(((made - local) ** 2).sum(axis=2)).max()),
    )


def normals_of(positions: Any, triangles: IntArray, shapes: Shapes) -> tuple[Any, Any]:
    """Unit normals of the base, and what the first targets add to them, by least squares.

    Their sum has not the length 1; viewers make it so.

    Returns:
        Shapes [v, 3] and [at most `_NORMALS`, v, 3], float32.
    """
    normals = np.zeros(np.shape(positions))
    for x, normal in zip(np.asarray(positions, np.float64), normals):
        vertex_normals(x, triangles, normal)
    normals = np.einsum("fji,fvj->fvi", shapes.rotation, normals)
    mean = normals.mean(axis=0)
    weights = shapes.weights[:, :_NORMALS].astype(np.float64)
    middle = weights.mean(axis=0)
    rest = (normals - mean).reshape(len(normals), -1)
    turned = np.linalg.lstsq(weights - middle, rest, rcond=None)[0].reshape(-1, *mean.shape)
    base = mean - np.tensordot(middle, turned, 1)
    length = np.linalg.norm(base, axis=1, keepdims=True)
    base[length[:, 0] < 1e-3] = [0.0, 0.0, 1.0]
    length[length < 1e-3] = 1.0
    base, turned = base / length, turned / length
    return base.astype(np.float32), turned.astype(np.float32)


def _rigid(x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Rotation and centre of each frame, closest to the middle frame by least squares."""
    centre = x.mean(axis=1)
    own = x - centre[:, None]
    U, _, Vt = np.linalg.svd(np.einsum("fvi,vj->fij", own, own[len(x) // 2]))
    U[:, :, 2] *= np.linalg.det(U @ Vt)[:, None]
    return U @ Vt, centre


def _components(moved: FloatArray, bound: float) -> tuple[FloatArray, FloatArray]:
    """Rows [n, 3 v] and weights [m, n] whose product is nowhere further from `moved` than that."""
    frames, width = len(moved), moved.shape[1]
    of_vertex, of_frame = np.ones(width // 3), np.ones(frames)
    n, rounds = _first_guess(moved, bound), 0
    while True:
        if n == 0:
            rows, weights = np.zeros((0, width)), np.zeros((frames, 0))
        else:
            rows, weights = _weighted(moved, n, np.repeat(of_vertex, 3), of_frame)
        error = np.linalg.norm((moved - weights @ rows).reshape(frames, -1, 3), axis=2)
        if error.max() <= bound or n >= min(frames, width):
            return rows, weights
        rounds += 1
        of_vertex *= np.sqrt(1e-6 + error.max(axis=0) / error.max())
        of_frame *= np.sqrt(1e-6 + error.max(axis=1) / error.max())
        of_vertex /= of_vertex.max()
        of_frame /= of_frame.max()
        if rounds % _ROUNDS == 0:
            n = min(int(n * _GROWTH) + 1, frames, width)
            if n == min(frames, width):
                of_vertex[:], of_frame[:] = 1.0, 1.0


def _first_guess(moved: FloatArray, bound: float) -> int:
    """So many components that the root mean square of the distances is a fifth of the bound."""
    values = np.linalg.eigvalsh(moved @ moved.T)
    left = np.cumsum(np.maximum(values, 0.0))[::-1]
    return int((left > (0.2 * bound) ** 2 * (moved.size / 3)).sum())


def _weighted(
    moved: FloatArray, n: int, of_column: FloatArray, of_frame: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """The first components where columns and frames count more or less."""
    wide = moved * of_column
    heavy = wide * of_frame[:, None]
    _, vectors = np.linalg.eigh(heavy @ heavy.T)
    rows, _ = np.linalg.qr((vectors[:, ::-1][:, :n].T @ heavy).T)
    return rows.T / of_column, wide @ rows
