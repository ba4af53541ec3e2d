"""A sewing pattern: panels, edges, stitches and where the panels start around the body.

Panels lie in a plane of their own, x across and y along the grain as drawn; z points out of the
cloth's right side. Their edges run counter-clockwise seen from there. Two edges that are sewn run
against each other, as in any surface with one outside, unless the stitch turns a piece over.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from garment_sim_ros.arrays import FloatArray
from garment_sim_ros.garment.patterns.curves import arc, bezier, lengths, signed_area

WAIST = "waist"
"""Label of edges that a band holds to the waist."""


@dataclass(frozen=True, kw_only=True)
class Arc:
    """An arc of a circle, as in `curves.arc`."""

    radius: float
    large: bool = False
    right: bool = False


@dataclass(frozen=True, kw_only=True)
class Edge:
    """An edge of a panel from one corner to another.

    Attributes:
        start: Index of the corner where it starts.
        end: Index of the corner where it ends.
        controls: Control points of a quadratic (1) or cubic (2) Bezier curve [m]; none: straight.
        arc: The arc that it is; None: none.
        label: What it is for, as "waist" or "hem".
    """

    start: int
    end: int
    controls: tuple[tuple[float, float], ...] = ()
    arc: Arc | None = None
    label: str = ""

    @property
    def flipped(self) -> "Edge":
        """That of a panel seen from behind: x changes its sign, and arcs their side."""
        arc = self.arc
        return replace(
            self,
            controls=tuple((-x, y) for x, y in self.controls),
            arc=None if arc is None else replace(arc, right=not arc.right),
        )

    @property
    def backwards(self) -> "Edge":
        """The same edge run through from its end."""
        arc = self.arc
        return replace(
            self,
            start=self.end,
            end=self.start,
            controls=self.controls[::-1],
            arc=None if arc is None else replace(arc, right=not arc.right),
        )


@dataclass(frozen=True, kw_only=True)
class Joint:
    """Where the limb that a panel is rolled around turns, as an arm does at its elbow.

    Attributes:
        y: Place along the panel's y [m]; what lies below is turned.
        turn: Axis of the turn in the panel's frame, as long as its angle [rad], shape [3].
    """

    y: float
    turn: FloatArray


@dataclass(frozen=True, kw_only=True)
class Placement:
    """Where a panel starts.

    Attributes:
        T_world_panel: From the panel's plane to the world in the body's rest pose, shape [4, 4].
        bend: Radius of a cylinder about the panel's y that it is rolled on, its inside inwards, x
            = 0 staying where it is [m]; infinite: it is flat.
        joint: Where that cylinder's axis turns; None: nowhere.
    """

    T_world_panel: FloatArray
    bend: float = np.inf
    joint: Joint | None = None

    @property
    def rolled(self) -> bool:
        """Whether it is around a limb."""
        return bool(np.isfinite(self.bend))

    def moved(self, by: FloatArray) -> "Placement":
        """The same elsewhere, by [m] in the world, shape [3]."""
        T = self.T_world_panel.copy()
        T[:3, 3] += by
        return replace(self, T_world_panel=T)

    def along(self, way: float) -> "Placement":
        """The same farther down the limb that it is around [m]; the limb's joint stays."""
        joint = self.joint and replace(self.joint, y=self.joint.y + way)
        return replace(self.moved(-way * self.T_world_panel[:3, 1]), joint=joint)

    def placed(self, flat: FloatArray) -> FloatArray:
        """Points of the panel [n, 2] in the world [m], shape [n, 3]."""
        x, y = np.asarray(flat, dtype=np.float64).T
        z = np.zeros_like(x)
        if self.rolled:
            angle = x / self.bend
            x, z = self.bend * np.sin(angle), self.bend * (np.cos(angle) - 1.0)
        local = np.stack([x, y, z], axis=1)
        if self.joint is not None:
            local = self._turned(local, self.joint)
        return local @ self.T_world_panel[:3, :3].T + self.T_world_panel[:3, 3]

    def _turned(self, local: FloatArray, joint: Joint) -> FloatArray:
        """Points whose part below the joint is turned; within a radius of it by less."""
        pivot = np.array([0.0, joint.y, -self.bend])
        share = np.clip(0.5 - 0.5 * (local[:, 1] - joint.y) / self.bend, 0.0, 1.0)
        turned = Rotation.from_rotvec(share[:, None] * joint.turn)
        moved: FloatArray = pivot + turned.apply(local - pivot)
        return moved


@dataclass(frozen=True, kw_only=True)
class Panel:
    """A flat piece of cloth.

    Attributes:
        name: Unique in its pattern.
        corners: Its corners [m], shape [n, 2].
        edges: Its outline, each edge starting where the one before ends.
        placement: Where it starts.
        grain: Direction of the warp in its plane, shape [2].
        label: The body part that it covers, as "body", "arm" or "leg"; empty: not told.
        clockwise: Whether its file draws it clockwise, which puts its right side backwards.
        folded: Whether its stitches fold it over, as a lapel, so that its outside faces the body.
    """

    name: str
    corners: FloatArray
    edges: tuple[Edge, ...]
    placement: Placement
    grain: tuple[float, float] = (0.0, 1.0)
    label: str = ""
    clockwise: bool = False
    folded: bool = False

    @cached_property
    def curves(self) -> tuple[FloatArray, ...]:
        """Each edge as a fine polyline [m], shape [n, 2]."""
        return tuple(self._curve(edge) for edge in self.edges)

    @cached_property
    def lengths(self) -> FloatArray:
        """Length of each edge [m], shape [e]."""
        return np.array([lengths(curve)[-1] for curve in self.curves])

    @property
    def outline(self) -> FloatArray:
        """The whole outline as a fine closed polygon, its first point once [m], shape [n, 2]."""
        return np.concatenate([curve[:-1] for curve in self.curves])

    @property
    def area(self) -> float:
        """Its area [m^2]; below 0 where it runs clockwise."""
        return signed_area(self.outline)

    @property
    def outwards(self) -> FloatArray:
        """Unit vector away from the body where it starts, shape [3]."""
        normal: FloatArray = self.placement.T_world_panel[:3, 2]
        return -normal if self.folded else normal

    def shifted(self, x: float) -> "Panel":
        """The same, drawn so much farther along x [m], its placement as it is."""
        by = np.array([x, 0.0])
        edges = (replace(e, controls=tuple((u + x, v) for u, v in e.controls)) for e in self.edges)
        return replace(self, corners=self.corners + by, edges=tuple(edges))

    def _curve(self, edge: Edge) -> FloatArray:
        start, end = self.corners[edge.start], self.corners[edge.end]
        if edge.arc is not None:
            a = edge.arc
            return arc(start, end, a.radius, large=a.large, right=a.right)
        if not edge.controls:
            return np.stack([start, end])
        return bezier(np.array([start, *edge.controls, end]))


@dataclass(frozen=True, kw_only=True)
class Seam:
    """One side of a stitch: an edge, or some that follow each other.

    Attributes:
        panel: The panel's name.
        edges: Indices of its edges, in the order of its outline.
    """

    panel: str
    edges: tuple[int, ...]

    def __str__(self) -> str:
        numbers = ", ".join(map(str, self.edges))
        return f"{self.panel!r} edge{'s' if len(self.edges) > 1 else ''} {numbers}"


@dataclass(frozen=True, kw_only=True)
class Stitch:
    """Two sides that are sewn together; the longer one is eased in evenly.

    Attributes:
        sides: Both.
        turned: Whether they run the same way: one of the pieces is turned over there.
    """

    sides: tuple[tuple[Seam, ...], tuple[Seam, ...]]
    turned: bool = False

    def __str__(self) -> str:
        return " to ".join(" and ".join(map(str, side)) for side in self.sides)


@dataclass(frozen=True, kw_only=True)
class Pattern:
    """Panels and how they are sewn together.

    Attributes:
        name: For messages and files.
        panels: By their names.
        stitches: What is sewn.
        notes: What was assumed, one sentence each.
    """

    name: str
    panels: dict[str, Panel]
    stitches: tuple[Stitch, ...]
    notes: tuple[str, ...] = field(default=())

    @property
    def area(self) -> float:
        """Of all panels [m^2]."""
        return sum(panel.area for panel in self.panels.values())


def loop(corners: FloatArray, **of_edge: Mapping[str, object]) -> tuple[Edge, ...]:
    """Edges of a closed outline through all corners in order, straight unless told otherwise.

    Args:
        corners: Shape [n, 2].
        of_edge: Of the edge from corner i: ``e<i>={"controls": ..., "label": ...}``.
    """
    n = len(corners)
    return tuple(
        Edge(start=i, end=(i + 1) % n, **of_edge.get(f"e{i}", {}))  # type: ignore[arg-type]
        for i in range(n)
    )
