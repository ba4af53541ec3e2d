"""From a pattern's name or file, and a body, to a garment at rest on it."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray
from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.skin import Body
from garment_sim_ros.collider_params import SDF
from garment_sim_ros.colliders.fit_cache import cached_fit
from garment_sim_ros.colliders.posing import ColliderPoser
from garment_sim_ros.contact.shapes import ColliderPoses, ColliderSet
from garment_sim_ros.errors import GeometryError, InputFileError, ParameterError
from garment_sim_ros.garment.garment import Garment
from garment_sim_ros.garment.materials import PRESETS
from garment_sim_ros.garment.measures import Measures
from garment_sim_ros.garment.mesh_data import GarmentMesh
from garment_sim_ros.garment.outfit import make_outfit
from garment_sim_ros.garment.outfit_file import outfit_from
from garment_sim_ros.garment.patterns.checking import check
from garment_sim_ros.garment.patterns.drafts.dresses import sleeveless_dress, wide_dress
from garment_sim_ros.garment.patterns.drafts.skirts import long_skirt, short_skirt
from garment_sim_ros.garment.patterns.drafts.trousers import trousers
from garment_sim_ros.garment.patterns.drafts.tshirt import long_sleeved_shirt, tshirt
from garment_sim_ros.garment.patterns.garmentcode import read_garmentcode
from garment_sim_ros.garment.patterns.gates import Gates, gates
from garment_sim_ros.garment.patterns.parted import has_legs, parted
from garment_sim_ros.garment.patterns.pattern import Pattern
from garment_sim_ros.garment.patterns.pieces import Pieces, cut, edge_length_for
from garment_sim_ros.garment.patterns.place_checks import check_band, check_near, check_ways
from garment_sim_ros.garment.patterns.placing import placed_clear
from garment_sim_ros.garment.patterns.rolling import rolled_tubes
from garment_sim_ros.garment.patterns.sewing import DRAPING, Sewn, Tell, sew
from garment_sim_ros.garment.patterns.staying_up import check_up
from garment_sim_ros.garment.patterns.tape import Tape, measured
from garment_sim_ros.garment.patterns.tautness import tautest
from garment_sim_ros.garment.patterns.turning_over import facing_outwards, unfolded
from garment_sim_ros.garment.sewn_file import write_sewn
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.input_file import said_of
from garment_sim_ros.params import ColliderOptions, Material
from garment_sim_ros.sim.placement import find_frames
from garment_sim_ros.sim.simulation import Simulation

_OF_FILES = "polyester"
"""Fabric of patterns from files: woven, as patterns with darts are drafted for."""
_OF_TOPS = 0.004
"""Thickness that shirts are worn with [m]: bends at the shoulders leave some millimetres of skin
outside of hulls, and a skirt below stays below."""
EDGE_LENGTH = 0.022
"""Edge length of patterns from files [m]."""


@dataclass(frozen=True, kw_only=True)
class Draft:
    """A pattern of our own.

    Attributes:
        make: Drafts it from measurements.
        vertices: How many the sewn garment has, about.
        fabric: Name of its fabric.
        text: What it is.
        worn_thickness: Thickness that it is worn with [m]; 0: that of its fabric.
    """

    make: Callable[[Tape], Pattern]
    vertices: int
    fabric: str
    text: str
    worn_thickness: float = 0.0


DRAFTS: Mapping[str, Draft] = MappingProxyType(
    {
        "tshirt": Draft(
            make=tshirt,
            vertices=1503,
            fabric="cotton_jersey",
            text="T-shirt",
            worn_thickness=_OF_TOPS,
        ),
        "long_sleeved_shirt": Draft(
            make=long_sleeved_shirt,
            vertices=2000,
            fabric="cotton_jersey",
            text="shirt with long sleeves",
            worn_thickness=_OF_TOPS,
        ),
        "short_skirt": Draft(
            make=short_skirt, vertices=1687, fabric="polyester", text="short A-line skirt"
        ),
        "long_skirt": Draft(
            make=long_skirt, vertices=2235, fabric="polyester", text="long A-line skirt"
        ),
        "trousers": Draft(
            make=trousers, vertices=2400, fabric="cotton_twill", text="straight trousers"
        ),
        "sleeveless_dress": Draft(
            make=sleeveless_dress, vertices=2200, fabric="polyester", text="sleeveless shift dress"
        ),
        "wide_dress": Draft(
            make=wide_dress, vertices=2600, fabric="polyester", text="wide sleeveless dress"
        ),
    }
)
"""Patterns of our own by name; sizes of the first three are those of the first paper's figures."""


class Model:
    """The body that garments are sewn on, with arms away from the trunk.

    Garments are sewn on sampled distances to the skin itself: hulls bridge armpits, and what is
    sewn around them would be stretched there for good. What it is worn on later may be others.

    Args:
        body: The body.
        colliders: What garments lie on; None: sampled distances to its skin.

    A body without bones is one shape then, whose core runs between its legs: see `for_legs`.

    Attributes:
        skin: Its skin [m], shape [v, 3].
        poses: Where the colliders are.
        distance: Distances to the skin.

    Raises:
        GeometryError: Colliders of another body.
    """

    def __init__(self, body: Body, colliders: ColliderSet | None = None) -> None:
        if colliders is None:
            colliders = cached_fit(body, ColliderOptions(method=SDF), None)
        self.body = body
        self.colliders = colliders
        self.measures: Measures | None = None
        T = rest_transforms(body.rig)
        measures = Measures(body)
        if measures.has_arms:
            measures = measures.with_arms_away()
            self.measures = measures
            T = measures.T_world_joint
        self.skin: FloatArray = measures.vertices
        self.poses: ColliderPoses = ColliderPoser(colliders, body).poses(T)
        self.distance = MeshDistance(self.skin, body.skin.triangles)

    def for_legs(self, material: Material) -> "Model":
        """The same to sew what has legs on, of a fabric: a body without bones, its legs parted."""
        if self.measures is not None:
            return self
        tape = self.tape()
        crotch, mid = tape.floor + tape.crotch, float(tape.waist.centre[1])
        room = max(self.colliders.thickness, material.thickness)
        return Model(self.body, parted(self.colliders, self.poses, crotch, mid, room))

    def tape(self) -> Tape:
        """Its measurements.

        Raises:
            GeometryError: It does not stand upright, or has no arms.
        """
        return measured(self.skin, self.body.skin.triangles, self.body.name)

    @contextmanager
    def doubted(self) -> Iterator[None]:
        """What is wrong with a garment is told together with what is wrong with the body.

        Patterns and meshes that fit nowhere on a body that lies down are not to blame.

        Raises:
            InputFileError: The garment's, and that the body cannot be measured.
        """
        try:
            yield
        except InputFileError as error:
            try:
                self.tape()
            except GeometryError as body:
                raise InputFileError(
                    error.path,
                    error.problem,
                    f"{error.allowed}; and the body cannot be measured: {body}",
                ) from error
            raise

    def garment(self, vertices: FloatArray, triangles: IntArray, material: Material) -> Garment:
        """A surface around it.

        The body stands still, so all of it is under the cloth: following one bone, no shape is
        opposed to any (`sim.sides`), as forearms would be to folds over a bent elbow.
        """
        bone = self.colliders.colliders[0].bone
        return Garment(
            name="sewn",
            vertices=vertices,
            triangles=triangles,
            material=material,
            frames=(bone,),
            T_world_frame_rest=find_frames("sewn", (bone,), self.colliders).world(self.poses),
            frame_index=np.zeros((len(vertices), 1), np.int32),
            frame_weight=np.ones((len(vertices), 1)),
            pins=np.zeros(0, np.int32),
            pin_frame=np.zeros(0, np.int32),
        )


@dataclass(frozen=True, kw_only=True)
class Made:
    """A garment that was made from a pattern.

    Attributes:
        name: Of the pattern.
        pieces: The cut pattern where it was placed.
        sewn: The garment at rest.
        fabric: Name of its fabric.
        gates: What it measures.
        worn_thickness: As of a `Draft`.
    """

    name: str
    pieces: Pieces
    sewn: Sewn
    fabric: str
    gates: Gates
    worn_thickness: float = 0.0

    @property
    def material(self) -> str | dict[str, str | float]:
        """Its fabric as an outfit file says it."""
        if not self.worn_thickness:
            return self.fabric
        return {"preset": self.fabric, "thickness": self.worn_thickness}

    @property
    def mesh(self) -> GarmentMesh:
        """Its surface at rest, and the panels that it was cut from."""
        sewn = self.sewn
        return GarmentMesh(vertices=sewn.vertices, triangles=sewn.triangles, flat=sewn.flat)

    def write(self, path: Path) -> None:
        """Writes it as a sewn garment, see `sewn_file`."""
        panel = self.pieces.panel[self.pieces.triangles[:, 0]]
        sewn = self.sewn
        names = tuple(self.pieces.pattern.panels)
        write_sewn(path, sewn.vertices, sewn.triangles, sewn.flat, panel, names)


def pattern_for(source: str | Path, model: Model) -> tuple[Pattern, str, int]:
    """A pattern by the name of a draft or from a file.

    Returns:
        The pattern, the name of its fabric, and how many vertices it is to have, 0: as many as
        `EDGE_LENGTH` gives.

    Raises:
        InputFileError: The file cannot be used.
        ParameterError: Neither.
        GeometryError: The body cannot be measured, or is of proportions that make no pattern.
    """
    draft = DRAFTS.get(str(source))
    if draft is not None:
        pattern = draft.make(model.tape())
        check(pattern)
        return pattern, draft.fabric, draft.vertices
    if Path(source).suffix.lower() == ".json":
        return read_garmentcode(source), _OF_FILES, 0
    raise ParameterError(
        "garment", f"found {str(source)[:80]!r}", f"allowed: {', '.join(DRAFTS)}, or a .json file"
    )


def make(
    source: str | Path,
    model: Model,
    *,
    edge_length: float | None = None,
    fabric: str | None = None,
    tell: Tell = lambda phase, share: None,
) -> Made:
    """Makes a garment.

    Args:
        source: The name of a draft, or a GarmentCode file.
        model: The body.
        edge_length: Length of edges [m]; None: as the draft has it, `EDGE_LENGTH` for files.
        fabric: Name of its fabric; None: as the draft has it, `_OF_FILES` for files.
        tell: Is told the phase and how far it is.

    Raises:
        InputFileError: The file cannot be used.
        ParameterError: An unknown garment or fabric, or an edge length that is not allowed.
        GeometryError: The body cannot be dressed in it; the message names the panel or seam.
    """
    if fabric is not None and fabric not in PRESETS:
        raise ParameterError("fabric", f"found {fabric[:60]!r}", f"allowed: {', '.join(PRESETS)}")
    tell("cutting", 0.0)
    pattern, usual, vertices = pattern_for(source, model)
    told = nullcontext() if str(source) in DRAFTS else said_of(source)
    fabric = fabric or usual
    skin, triangles, name = model.skin, model.body.skin.triangles, model.body.name
    with model.doubted(), told:
        check_near(pattern, model.distance, skin, name)
        pattern = unfolded(facing_outwards(pattern, model.distance))
        pattern = rolled_tubes(pattern, skin, triangles, name)
        if edge_length is None:
            edge_length = edge_length_for(pattern, vertices) if vertices else EDGE_LENGTH
        pieces = cut(pattern, edge_length)
        if has_legs(pieces, skin):
            model = model.for_legs(PRESETS[fabric].material)
        tell("cutting", 1.0)
        pieces, placed = placed_clear(pieces, model.distance, name)
        check_ways(pieces, placed, model.distance, name)
        check_band(pieces, placed, skin, triangles, name)
        sewn = sew(pieces, placed, model, PRESETS[fabric].material, tell=tell)
        if not np.isfinite(sewn.vertices).all():
            raise GeometryError(f"pattern {pattern.name!r}: it did not hold together as sewn")
        check_up(pieces, sewn, skin)
    return Made(
        name=pattern.name,
        pieces=pieces,
        sewn=sewn,
        fabric=fabric,
        gates=_measured(pieces, sewn, model),
        worn_thickness=DRAFTS[str(source)].worn_thickness if str(source) in DRAFTS else 0.0,
    )


def _measured(pieces: Pieces, sewn: Sewn, model: Model) -> Gates:
    found = gates(sewn, model.skin, model.body.skin.triangles, model.colliders, model.poses)
    return replace(found, taut=tautest(pieces, sewn, float(model.skin[:, 2].min())))


def worn_together(made: Mapping[str, Made], model: Model) -> dict[str, Made]:
    """Garments that were sewn one by one, as they hang over each other.

    They are put on as an outfit is, in the layers that they lie in, and come to rest: a shirt,
    which is wide at its hem, hangs over a skirt, whichever was sewn first.

    Args:
        made: The garments by name.
        model: The body, of which the bones are known.

    Raises:
        GeometryError: The body lacks bones that an outfit needs.
    """
    entries = [
        {"name": name, "mesh": "sewn", "material": m.fabric, "self_collision": True}
        for name, m in made.items()
    ]
    outfit = make_outfit(
        outfit_from({"version": 1, "garments": entries}),
        model.body,
        colliders=model.colliders,
        meshes={name: m.mesh for name, m in made.items()},
        as_cut=True,
    )
    simulation = Simulation(outfit, model.colliders, **DRAPING)
    simulation.reset(model.poses)
    together = {}
    for name, m in made.items():
        view = simulation[name]
        x, shown = (np.asarray(of, np.float64) for of in (view.simulated, view.positions))
        sewn = replace(m.sewn, vertices=x, shown=shown)
        together[name] = replace(m, sewn=sewn, gates=_measured(m.pieces, sewn, model))
    return together
