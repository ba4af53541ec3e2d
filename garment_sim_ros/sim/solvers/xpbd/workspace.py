"""What an `xpbd` step keeps of a garment, and what its kernels are given."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from garment_sim_ros.arrays import FloatArray, IntArray, SingleArray
from garment_sim_ros.sim.elasticity import hinges
from garment_sim_ros.sim.model import ClothModel
from garment_sim_ros.sim.solvers.xpbd.coarse import (
    CoarseLevel,
    Threads,
    coarse_level,
    prepare_cells,
)
from garment_sim_ros.sim.solvers.xpbd.given import Given, Planes
from garment_sim_ros.sim.solvers.xpbd.hanging import lag
from garment_sim_ros.sim.solvers.xpbd.hinges import prepare_hinges
from garment_sim_ros.sim.solvers.xpbd.order import in_fours
from garment_sim_ros.sim.solvers.xpbd.prepared import Prepared, Triangles
from garment_sim_ros.sim.solvers.xpbd.stretch import (
    Shapes,
    Springs,
    bands_of,
    springs_of,
    triangles_of,
)
from garment_sim_ros.sim.state import Workspace

_SWING = 0.45
"""The farthest that hinges, by themselves, may swing from one pass to the next [rad], where passes
are several sub-steps apart: with more, hems curl and flutter."""
_STIFFEST = np.pi / 3
"""The same where they have a pass in every sub-step, together with the edges."""


@dataclass(kw_only=True)
class XpbdWorkspace(Workspace):
    """Scratch arrays, and what the material makes of the mesh.

    Attributes:
        springs: All edges, as springs.
        bands: Those that elastic bands run along; None until triangles are asked for.
        shapes: All triangles; likewise.
        extent: Of the garment at rest, the largest [m].
        lag: Stretch that uneven masses add, see `hanging.lag` [1/m].
        hinge_weight: Weights of the hinges' curvature, shape [h, 4].
        hinge_stiffness: Their stiffnesses [N/m], shape [h].
        hinge_rate: Angular frequencies at which they swing by themselves [1/s], shape [h].
        prepared: What the sub-steps need, for one length of them.
        coarse: A coarse level of the edges, for the same, where it is asked for.
        threads: What it is made of; None where there is none.
        prepared_for: That length [s], the rate of damping [1/s], whether there is a coarse level,
            and whether triangles act instead of springs.
        bent_for: Time between passes over the hinges [s] and rate of damping [1/s] that the hinges
            are prepared for.
        bend_every: Sub-steps for each pass over the hinges, see `prepare`.
        place: Points of the planes in which particles touch shapes [m], shape [free, 3].
        shift: How far those move in a sub-step [m], shape [free, 3].
        second: Planes of shapes that particles touched before, see `xpbd.second_planes`.
        before: Scratch: shape that each particle touched before a search, shape [free].
        x_end: Positions at the end of the last step [m], shape [n, 3].
        wide_v: Scratch: velocities as fours, flat [m/s], shape [4 n].
        low: What these are short of by rounding [m], shape [3 free].
        push_all: Velocity that outer forces and bending add in a sub-step [m/s], shape [3 free].
        x_search: Positions at the last search for contacts [m], shape [n, 3].
        x_coast: Those that they coast to until the next one [m], shape [n, 3].
        flags: See `solvers.xpbd.given.Particles`, shape [2].
        known: Whether the contacts of the step before still held when this one began.
        has_planes: Whether the last sub-step began with planes of a search.
        given: What the kernels are given; None before the first step.
        all_given: The same by sub-steps for each search: steps in parts have several in turn.
        code: Machine code of the kernels of `sub_steps`, in order, and of `shorten_longest`; None
            before the first step.
    """

    springs: Springs
    bands: Springs | None
    shapes: Shapes | None
    extent: float
    lag: float
    hinge_weight: FloatArray
    hinge_stiffness: FloatArray
    hinge_rate: FloatArray
    prepared: Prepared
    coarse: CoarseLevel
    threads: Threads | None
    prepared_for: tuple[float, float, bool, bool]
    bent_for: tuple[float, float]
    bend_every: int
    place: SingleArray
    shift: SingleArray
    second: Planes
    before: IntArray
    x_end: SingleArray
    wide_v: SingleArray
    low: SingleArray
    push_all: SingleArray
    x_search: SingleArray
    x_coast: SingleArray
    flags: IntArray
    known: bool
    has_planes: bool
    given: Given | None
    all_given: dict[int, Given]
    code: tuple[Callable[..., Any], ...] | None

    @classmethod
    def room_for(cls, model: ClothModel, shapes: int) -> "XpbdWorkspace":
        """Arrays for a garment and a number of collider shapes."""
        springs, weight = springs_of(model), model.inverse_mass
        bending = hinges(model.rest, model.particle_triangles, model.material, model.corners)
        used = np.flatnonzero(
            (weight[bending.particles].sum(axis=1) > 0.0) & (bending.stiffness > 0.0)
        )
        used = used[in_fours(bending.particles[used])[0]]
        lightness = (weight[bending.particles[used]] * bending.weight[used] ** 2).sum(axis=1)
        return cls(
            **vars(Workspace.room_for(model, shapes)),
            springs=springs,
            bands=None,
            shapes=None,
            extent=float(np.ptp(model.rest, axis=0).max()),
            lag=lag(model),
            hinge_weight=np.ascontiguousarray(bending.weight[used]),
            hinge_stiffness=np.ascontiguousarray(bending.stiffness[used]),
            hinge_rate=np.sqrt(bending.stiffness[used] * lightness),
            prepared=Prepared(
                edges=springs.ready,
                springs=springs.ready,
                triangles=Triangles.none(),
                hinge_particles=np.ascontiguousarray(bending.particles[used]),
                hinges=np.zeros((len(used), 8), np.float32),
            ),
            coarse=CoarseLevel.none(),
            threads=None,
            prepared_for=(0.0, 0.0, False, False),
            bent_for=(0.0, 0.0),
            bend_every=1,
            place=np.zeros((model.free_count, 3), np.float32),
            shift=np.zeros((model.free_count, 3), np.float32),
            second=Planes.room_for(model.free_count),
            before=np.full(model.free_count, -1, np.int32),
            x_end=np.full((len(model), 3), np.nan, np.float32),
            wide_v=np.zeros(4 * len(model), np.float32),
            low=np.zeros(3 * model.free_count, np.float32),
            push_all=np.zeros(3 * model.free_count, np.float32),
            x_search=np.zeros((len(model), 3), np.float32),
            x_coast=np.zeros((len(model), 3), np.float32),
            flags=np.zeros(2, np.int32),
            known=False,
            has_planes=False,
            given=None,
            all_given={},
            code=None,
        )

    def prepare(
        self,
        model: ClothModel,
        dt: float,
        rate: float,
        search_every: int,
        coarse: bool = False,
        triangles: bool = False,
    ) -> None:
        """Fills `prepared` and `coarse` for sub-steps, unless they are.

        What a pass over the hinges gives them acts until the next one. What edges and contact do
        meanwhile it does not know: against these it is an explicit force, and stiff hinges would
        shake. They have passes more often, up to one in every sub-step, together with the edges.
        Where even that is too seldom, single hinges are taken as the stiffest for which it is not.
        The clamp keeps at least half of the bending resistance. Without it, sequential full
        corrections make some hinges oscillate.

        Args:
            model: The garment.
            dt: Sub-step [s].
            rate: Of damping [1/s].
            search_every: Sub-steps for each search for contacts; hinges that are not stiff have a
                pass as often; a whole number of passes fits between two of them.
            coarse: Whether there shall be a coarse level.
            triangles: Whether triangles act instead of springs.
        """
        if self.prepared_for != (dt, rate, coarse, triangles):
            self._prepare_stretch(model, dt, rate, coarse, triangles)
            self.prepared_for = (dt, rate, coarse, triangles)
        fastest = float(self.hinge_rate.max(initial=0.0))
        divisors = (n for n in range(search_every, 1, -1) if search_every % n == 0)
        self.bend_every = next((n for n in divisors if n * dt * fastest <= _SWING), 1)
        time = dt * self.bend_every
        if self.bent_for == (time, rate):
            return
        ready = self.prepared
        swing = np.maximum(time * self.hinge_rate, _STIFFEST)
        prepare_hinges(
            ready.hinge_particles,
            self.hinge_weight,
            self.hinge_stiffness * (_STIFFEST / swing) ** 2,
            model.inverse_mass,
            1.0 / (1.0 + time * rate),
            time,
            ready.hinges,
        )
        self.bent_for = (time, rate)

    def _prepare_stretch(
        self, model: ClothModel, dt: float, rate: float, coarse: bool, triangles: bool
    ) -> None:
        """What acts along the cloth, see `prepare`."""
        keep = 1.0 / (1.0 + dt * rate)
        self.springs.prepare(model.inverse_mass, keep, dt)
        if triangles != self.prepared_for[3]:
            self._take(model, triangles)
        if triangles:
            assert self.bands is not None
            assert self.shapes is not None
            self.bands.prepare(model.inverse_mass, keep, dt)
            self.shapes.prepare(model.inverse_mass, keep, dt)
        if coarse != self.prepared_for[2]:
            edges = self.springs.ready.particles.reshape(-1, 2).astype(np.int32)
            level = coarse_level(model, edges) if coarse else None
            self.coarse, self.threads = level or (CoarseLevel.none(), None)
        if self.threads is not None:
            prepare_cells(self.coarse, self.threads, keep, dt)

    def _take(self, model: ClothModel, triangles: bool) -> None:
        """Has triangles, with bands, or springs act."""
        if not triangles:
            self.prepared = self.prepared._replace(
                springs=self.springs.ready, triangles=Triangles.none()
            )
            return
        if self.bands is None or self.shapes is None:
            self.bands, self.shapes = bands_of(model), triangles_of(model)
        self.prepared = self.prepared._replace(
            springs=self.bands.ready, triangles=self.shapes.ready
        )
