"""What holds a garment: attachments to bones, elastic bands, limits; and where on it they are."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

AUTOMATIC = "auto"
ARMS = "arms"
NONE = "none"


@dataclass(frozen=True, kw_only=True)
class Place:
    """Some of a garment's vertices, told in one of these ways; the others are None.

    Attributes:
        vertices: Their indices in the garment's order.
        rule: A name of `places.RULES`, as "waist".
        loop: Number of an open edge, 0 for the highest.
        band: Heights over the soles from which to which [m], as the garment is put on.
        colour: A painted colour, red, green and blue from 0 to 1.
        group: Name of a group of the mesh's file.
    """

    vertices: tuple[int, ...] | None = None
    rule: str | None = None
    loop: int | None = None
    band: tuple[float, float] | None = None
    colour: tuple[float, float, float] | None = None
    group: str | None = None

    @property
    def by_number(self) -> bool:
        """Whether it depends on the order of the file's vertices."""
        return self.vertices is not None

    def __str__(self) -> str:
        if self.vertices is not None:
            return f"{len(self.vertices)} vertices"
        if self.rule is not None:
            return self.rule
        if self.loop is not None:
            return f"loop {self.loop}"
        if self.band is not None:
            return f"band {self.band[0]:g} to {self.band[1]:g} m"
        if self.colour is not None:
            red, green, blue = (round(255 * c) for c in self.colour)
            return f"colour #{red:02x}{green:02x}{blue:02x}"
        return f"group {self.group}"


@dataclass(frozen=True, kw_only=True)
class Attachment:
    """Vertices that follow a bone.

    Attributes:
        bone: Joint name, or humanoid bone name; empty: that which most of the cloth there follows
            as skin, of each part that hangs together its own.
        place: Which vertices.
        name: What pictures and messages call it; empty: by its bone and place.
        stiffness: Of the spring that holds each [N/m]; infinite: rigid; None: as the garment's.
        damping: Of that spring [N s/m]; None: as the garment's.
    """

    place: Place
    bone: str = ""
    name: str = ""
    stiffness: float | None = None
    damping: float | None = None

    @property
    def title(self) -> str:
        """Its name, or its place and bone."""
        return self.name or (f"{self.place} on {self.bone}" if self.bone else str(self.place))


@dataclass(frozen=True, kw_only=True)
class Elastic:
    """An elastic band sewn to a garment.

    Attributes:
        place: Where: it runs along all edges between these vertices.
        tension: What it pulls with where the cloth is as long as it was cut [N].
        slack: Share of that length at which it pulls no more.
        name: What pictures and messages call it; empty: by its place.
    """

    place: Place
    tension: float
    slack: float = 0.8
    name: str = ""

    @property
    def title(self) -> str:
        """Its name, or its place."""
        return self.name or f"elastic {self.place}"


@dataclass(frozen=True, kw_only=True)
class VertexDistance:
    """A distance that some vertices may be away.

    Attributes:
        distance: The distance [m].
        vertices: Vertex indices in the garment's order; None: all.
    """

    distance: float
    vertices: tuple[int, ...] | None = None


@dataclass(frozen=True, kw_only=True)
class Holds:
    """What holds a garment beside its pins.

    Attributes:
        skin_limits: Limits of how vertices lie to their places as skin, by the names in
            `sim.holds.skin_limits`, later entries first. What hangs from the shoulders has a
            ``max_distance`` of a tenth of a metre, on a person of 1.65 m, where none is given.
        tethers: Part of its way over the cloth that a vertex may be farther from its pins; None:
            no tethers.
        stiffness: Of the springs of attachments that name none [N/m]; infinite: they are pins.
        damping: Likewise [N s/m].
        elastic: Its elastic bands.
    """

    skin_limits: Mapping[str, tuple[VertexDistance, ...]] = field(default_factory=dict)
    tethers: float | None = None
    stiffness: float = np.inf
    damping: float = 0.0
    elastic: tuple[Elastic, ...] = ()
