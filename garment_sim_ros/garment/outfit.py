"""Outfits: the garments of a file made for one body."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from types import MappingProxyType

import numpy as np

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.skin import Body
from garment_sim_ros.contact.shapes import ColliderSet
from garment_sim_ros.errors import GeometryError, InputFileError
from garment_sim_ros.garment.carrying_over import carried_over
from garment_sim_ros.garment.dressing import dressed
from garment_sim_ros.garment.evening import evened, is_uneven
from garment_sim_ros.garment.garment import Garment
from garment_sim_ros.garment.generators import GENERATORS
from garment_sim_ros.garment.holds import AUTOMATIC, Holds
from garment_sim_ros.garment.layering import Cut, layers_of, with_room
from garment_sim_ros.garment.measures import Measures
from garment_sim_ros.garment.mesh import GarmentMesh, load_garment_mesh
from garment_sim_ros.garment.mesh_checks import check_place, check_sheet, loose_parts
from garment_sim_ros.garment.outfit_file import ANEW, GarmentEntry, OutfitFile, read_outfit
from garment_sim_ros.input_file import said_of
from garment_sim_ros.params import ColliderOptions, idle
from garment_sim_ros.sim.self_collision.garment import own_distance


@dataclass(frozen=True, kw_only=True)
class Outfit:
    """What one body wears.

    Attributes:
        name: Short name for logs and files.
        garments: In the order of the file.
        text: The outfit file's text.
        colliders: What the file asks them to lie on.
        notes: What was repaired or assumed, one sentence each.
    """

    name: str
    garments: tuple[Garment, ...]
    text: str
    colliders: ColliderOptions
    notes: tuple[str, ...] = ()


def load_outfit(
    source: str | Path,
    body: Body,
    *,
    colliders: ColliderSet | None = None,
    attachments: str = AUTOMATIC,
) -> Outfit:
    """An outfit made for a body in its rest pose.

    Args:
        source: A .yaml file, or the name of a built-in outfit.
        body: The wearer.
        colliders: What the garments will lie on; they are let out to fit over it. None where only
            the skin matters.
        attachments: What "auto" stands for in the file, see `dressing.dressed`.

    Raises:
        InputFileError: The file, or a mesh that it names, cannot be used.
        GeometryError: The body lacks bones or skin that a garment needs.
    """
    return make_outfit(read_outfit(source), body, colliders=colliders, attachments=attachments)


def make_outfit(
    file: OutfitFile,
    body: Body,
    *,
    colliders: ColliderSet | None = None,
    meshes: Mapping[str, GarmentMesh] = MappingProxyType({}),
    attachments: str = AUTOMATIC,
    as_cut: bool = False,
) -> Outfit:
    """An outfit that was read, made for a body in its rest pose.

    Args:
        file: The outfit.
        body: The wearer.
        colliders: As for `load_outfit`.
        meshes: Surfaces of garments by name, in the place of their files.
        attachments: As for `load_outfit`.
        as_cut: Whether panels keep their sizes; else they are let out over colliders and over
            other garments.

    Raises:
        InputFileError: A mesh that the outfit names cannot be used.
        GeometryError: The body lacks bones or skin that a garment needs.
    """
    measures = Measures(body)
    cuts, notes = [], []
    for entry in file.garments:
        if entry.attachments == AUTOMATIC:
            entry = replace(entry, attachments=attachments)
        made = meshes.get(entry.name)
        cut, remarks = _make(file.source, entry, measures, colliders, made)
        cuts.append(cut)
        notes += [f"{entry.name}: {remark}" for remark in remarks]
        holds = entry.holds
        if holds.damping and holds.stiffness == math.inf and isinstance(entry.attachments, str):
            notes.append(
                f"{entry.name}: attachment_damping: found {holds.damping:g}, which does "
                "nothing; it acts with an attachment_stiffness"
            )
    cuts, found = _layered(file, cuts)
    cuts, let = with_room(cuts, colliders)
    garments = [cut.garment if as_cut else cut.let_out() for cut in cuts]
    notes += [*found, *let, *(f"colliders: {remark}" for remark in idle(file.colliders))]
    return Outfit(
        name=file.name,
        garments=tuple(garments),
        text=file.text,
        colliders=file.colliders,
        notes=tuple(notes),
    )


def _layered(file: OutfitFile, cuts: list[Cut]) -> tuple[list[Cut], list[str]]:
    """Garments in the layers that the file names, or in those that they lie in at rest."""
    layers = [entry.layer for entry in file.garments]
    notes = []
    if all(layer is None for layer in layers):
        layers = [*layers_of(cuts)]
        if any(layers):
            found = ", ".join(f"{c.garment.name} {n}" for c, n in zip(cuts, layers, strict=True))
            notes.append(f"layers as they lie on the body: {found}")
    return [
        replace(cut, garment=replace(cut.garment, layer=layer or 0))
        for cut, layer in zip(cuts, layers, strict=True)
    ], notes


def _made_on(source: str, name: str) -> Body:
    """The body that a garment was made for, by its name in an outfit.

    Raises:
        InputFileError: It cannot be used.
    """
    file = Path(source).parent / name
    return load_body(file if file.is_file() else name)


def _names_vertices(entry: GarmentEntry) -> bool:
    """Whether an entry tells vertices by their number in the file."""
    distances = chain.from_iterable(entry.holds.skin_limits.values())
    placed = [e.place for e in entry.holds.elastic]
    if not isinstance(entry.attachments, str):
        placed += [a.place for a in entry.attachments]
    return any(d.vertices is not None for d in distances) or any(p.by_number for p in placed)


def _from_file(
    source: str, entry: GarmentEntry, measures: Measures
) -> tuple[GarmentMesh, FloatArray | None]:
    """The surface of a file as an outfit asks for it, and its rest shape where that is given.

    Raises:
        InputFileError: It cannot be used, or is nowhere near the body that it was made for.
    """
    assert entry.mesh is not None
    o = entry.options
    mesh = load_garment_mesh(entry.mesh, unit=o.unit, up=o.up)
    made_on = _made_on(source, o.made_on) if o.made_on else None
    with said_of(entry.mesh):
        check_sheet(mesh)
        check_place(mesh, Measures(made_on) if made_on else measures, o.unit, o.up)
    if mesh.flat is not None and o.remesh in ANEW:
        raise InputFileError(
            source,
            f"garment {entry.name!r}: remesh: {entry.mesh.name} was cut from flat panels",
            "allowed: auto or never; `garment-sim dress` cuts it anew",
        )
    if o.remesh in ANEW or (
        o.remesh == "auto" and mesh.flat is None and is_uneven(mesh) and not _names_vertices(entry)
    ):
        mesh = evened(mesh, o.sizes())
    else:
        mesh = load_garment_mesh(entry.mesh, unit=o.unit, up=o.up, edge_length=o.edge_length)
    given = mesh.vertices if o.rest == "given" and mesh.flat is None else None
    if made_on:
        mesh = carried_over(mesh, made_on, measures.body)
    return mesh, given


def _make(
    source: str,
    entry: GarmentEntry,
    measures: Measures,
    colliders: ColliderSet | None,
    mesh: GarmentMesh | None,
) -> tuple[Cut, tuple[str, ...]]:
    given, from_file = None, False
    if mesh is not None:
        pass
    elif entry.generator is not None:
        mesh, measures = GENERATORS[entry.generator].make(measures, entry.options)
    else:
        mesh, given = _from_file(source, entry, measures)
        from_file = True
    if mesh.flat is not None and measures.has_arms:
        measures = measures.with_arms_away()  # as it was sewn
    try:
        garment, notes = dressed(
            *(entry.name, mesh, measures, entry.material, entry.attachments, colliders),
            holds=entry.holds,
        )
    except GeometryError as error:
        if entry.mesh is None and isinstance(entry.attachments, str) and entry.holds == Holds():
            raise  # nothing that the file says: it is the body that does not fit
        problem, _, allowed = str(error).partition("; ")
        if repr(entry.name) not in problem:
            problem = f"garment {entry.name!r}: {problem}"
        raise InputFileError(source, problem, allowed) from error
    apart = entry.self_collision
    if apart is True:
        apart = own_distance(garment.vertices, garment.triangles, garment.material)
    garment = replace(garment, self_collision=apart or None, rest=given)
    if from_file:
        held = [garment.pins, *([garment.soft.vertices] if garment.soft else [])]
        notes += loose_parts(garment.vertices, garment.triangles, np.concatenate(held))
    sewn = None if mesh.flat is None else mesh.vertices
    return Cut(garment=garment, measures=measures, sewn=sewn), (*mesh.notes, *notes)
