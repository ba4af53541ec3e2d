"""Attachments and elastic bands that an outfit lists, on one garment."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.sparse.csgraph import connected_components

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.body.major_bones import major_bones
from garment_sim_ros.errors import GeometryError
from garment_sim_ros.garment.attachments import Binding
from garment_sim_ros.garment.holds import Attachment, Elastic, Holds
from garment_sim_ros.garment.measures import Measures
from garment_sim_ros.garment.mesh_data import GarmentMesh
from garment_sim_ros.garment.places import loops_from_above, vertices_at
from garment_sim_ros.geometry.connectivity import adjacency
from garment_sim_ros.geometry.topology import edge_table
from garment_sim_ros.sim.elastic import ElasticEdges

_ALONG = 0.7
"""Edges of a band are those whose direction across it is at most this, as a cosine."""


def listed_pins(
    name: str,
    mesh: GarmentMesh,
    measures: Measures,
    binding: Binding,
    attachments: Sequence[Attachment],
    holds: Holds,
    upper: bool,
) -> tuple[IntArray, IntArray, FloatArray, Binding, dict[str, IntArray]]:
    """Attached vertices, their frames, stiffness and damping [p, 2], the binding, and their names.

    Args:
        name: The garment's name.
        mesh: The garment as it is put on.
        measures: The body, in that pose.
        binding: The frames that it follows; those that attachments need are added.
        attachments: What the outfit lists.
        holds: Stiffness and damping of those that name none.
        upper: Whether it hangs from the shoulders.

    Raises:
        GeometryError: An unknown bone, a place that the garment does not have, or a vertex that
            is attached twice; the message names the attachment.
    """
    bones = major_bones(measures.body)
    pins: list[int] = []
    pin_frame: list[int] = []
    springs: list[tuple[float, float]] = []
    marks: dict[str, IntArray] = {}
    for attachment in attachments:
        what = f"garment {name!r}: attachment {attachment.title!r}"
        found = vertices_at(attachment.place, mesh, measures, upper, what)
        twice = sorted({*found.tolist()} & {*pins}) or len(np.unique(found)) < len(found)
        if twice:
            raise GeometryError(f"{what}: attached vertices are listed twice; allowed: once")
        marks[_free(attachment.title, marks)] = found
        pins += found.tolist()
        if attachment.bone:
            joint = measures.body.humanoid.get(attachment.bone, attachment.bone)
            owner = int(bones.owner[measures.body.rig.index(joint)])
            frame = bones.names[owner]
            if frame not in binding.frames:
                T = measures.T_world_joint[bones.joint[owner]]
                binding = replace(
                    binding,
                    frames=(*binding.frames, frame),
                    T_world_frame=np.concatenate([binding.T_world_frame, T[None]]),
                )
            pin_frame += [binding.frames.index(frame)] * len(found)
        else:
            pin_frame += _own_frames(mesh, binding, found)
        a = attachment
        springs += [
            (
                holds.stiffness if a.stiffness is None else a.stiffness,
                holds.damping if a.damping is None else a.damping,
            )
        ] * len(found)
    spring = np.array(springs, dtype=np.float64).reshape(-1, 2)
    return np.array(pins, np.int32), np.array(pin_frame, np.int32), spring, binding, marks


def _own_frames(mesh: GarmentMesh, binding: Binding, vertices: IntArray) -> list[int]:
    """The frame of each of these vertices, the same for those that hang together."""
    near = adjacency(mesh.triangles, len(mesh.vertices))[vertices][:, vertices]
    count, part = connected_components(near, directed=False)
    frame = [binding.heaviest(vertices[part == k]) for k in range(count)]
    return [frame[k] for k in part]


def listed_bands(
    name: str, mesh: GarmentMesh, measures: Measures, bands: Sequence[Elastic], upper: bool
) -> tuple[ElasticEdges | None, dict[str, IntArray]]:
    """The edges that elastic bands run along, None without any; and their vertices by name.

    Arguments as those of `listed_pins`.

    Raises:
        GeometryError: A place that the garment does not have, or one without edges.
    """
    if not bands:
        return None, {}
    edges = edge_table(mesh.triangles)[0]
    found, tension, slack = [], [], []
    marks: dict[str, IntArray] = {}
    for band in bands:
        what = f"garment {name!r}: elastic band {band.title!r}"
        vertices = vertices_at(band.place, mesh, measures, upper, what)
        chosen, rows = _runs(mesh, edges, vertices)
        if not len(chosen):
            raise GeometryError(f"{what}: no edges run along it; allowed: a ring of edges")
        marks[_free(band.title, marks)] = vertices
        found.append(chosen)
        tension.append(np.full(len(chosen), band.tension / rows))
        slack.append(np.full(len(chosen), band.slack))
    together = ElasticEdges(
        edges=np.concatenate(found),
        tension=np.concatenate(tension),
        slack=np.concatenate(slack),
    )
    return together, marks


def _runs(mesh: GarmentMesh, edges: IntArray, vertices: IntArray) -> tuple[IntArray, float]:
    """Edges along a band through these vertices, shape [b, 2], and how many rows they make."""
    inside = np.zeros(len(mesh.vertices), bool)
    inside[vertices] = True
    for loop in loops_from_above(mesh):
        # Of an open edge itself only: across its corners run others between its vertices.
        if set(loop.tolist()) == set(vertices.tolist()):
            return np.stack([loop, np.roll(loop, -1)], axis=1), 1.0
    own = edges[inside[edges].all(axis=1)]
    if not len(own):
        return own, 1.0
    x = mesh.vertices[vertices]
    middle = x.mean(axis=0)
    across = np.linalg.svd(x - middle, full_matrices=False)[2][-1]
    way = mesh.vertices[own[:, 1]] - mesh.vertices[own[:, 0]]
    length = np.linalg.norm(way, axis=1)
    along = np.abs(way @ across) <= _ALONG * length
    out = x - middle
    radius = float(np.linalg.norm(out - np.outer(out @ across, across), axis=1).mean())
    return own[along], max(1.0, float(length[along].sum()) / max(2.0 * np.pi * radius, 1e-9))


def _free(title: str, taken: dict[str, IntArray]) -> str:
    """A title that no other has."""
    names = [title, *(f"{title} ({k})" for k in range(2, len(taken) + 2))]
    return next(name for name in names if name not in taken)
