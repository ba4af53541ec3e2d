"""Making an outfit's simulation for a collider description, beside the node's own thread."""

import threading
from collections.abc import Callable
from dataclasses import dataclass

from garment_sim_ros.body.skin import Body
from garment_sim_ros.colliders.description import from_json
from garment_sim_ros.contact.shapes import ColliderSet
from garment_sim_ros.errors import GarmentSimError, MessageError
from garment_sim_ros.garment.garment import Garment
from garment_sim_ros.garment.outfit import Outfit, load_outfit
from garment_sim_ros.recording.worn_watch import WornWatch
from garment_sim_ros.ros.background import Background
from garment_sim_ros.ros.compiler import Compiler
from garment_sim_ros.sim.auto.pacer import details
from garment_sim_ros.sim.model import Parameters
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.sim.solvers import longest_step
from garment_sim_ros.sim.warm_up import Scene

DESCRIPTION = "collider_description"
_alone = threading.Lock()
"""One body after the other: what frames there are beside it are to be kept."""


@dataclass(frozen=True, kw_only=True)
class Dressed:
    """What one description led to.

    Attributes:
        revision: The description's.
        simulation: The garments on its colliders.
        garments: As they were made for them.
        watch: Looks whether they stay worn.
        notes: What was assumed or repaired.
    """

    revision: str
    simulation: Simulation
    watch: WornWatch
    garments: tuple[Garment, ...]
    notes: tuple[str, ...]


def dress(
    outfit: str,
    body: Body,
    colliders: ColliderSet,
    *,
    attachments: str,
    solver: str,
    solver_step: float,
    detail: float,
    parameters: Parameters,
    paced: bool = False,
) -> tuple[Outfit, Simulation]:
    """An outfit on the colliders that a body was described by.

    Args:
        outfit: Outfit file or name.
        body: The wearer.
        colliders: Its colliders.
        attachments: What holds the garments, as `load_outfit` takes it.
        solver: Name of the solver.
        solver_step: The step of the cloth's clock [s].
        detail: Share of each garment's vertices that are simulated.
        parameters: Outer forces and numerical parameters.
        paced: Whether the preset auto will change that share.

    Raises:
        GarmentSimError: One of them cannot be used, or they do not suit each other.
    """
    made = load_outfit(outfit, body, colliders=colliders, attachments=attachments)
    step = longest_step(solver, solver_step)
    simulation = Simulation(
        made.garments, colliders, solver=solver, solver_step=step, detail=detail
    )
    simulation.parameters = parameters
    for share in details(detail) if paced else ():
        simulation.prepare(share)
    return made, simulation


class Dresser:
    """Dresses a body; the latest description wins, those that come meanwhile are left out.

    Args:
        outfit: Outfit file or name.
        body: The wearer.
        frame_id: Frame that descriptions must be in.
        attachments: What holds the garments, as `load_outfit` takes it.
        solver: Name of the solver.
        solver_step: The step of the cloth's clock [s].
        detail: Share of each garment's vertices that are simulated.
        paced: Whether the preset auto will change that share.
        compiler: Compiles what the garments will run.
        parameters: Gives outer forces and numerical parameters, which must suit the colliders.
        after: A thread of an earlier dresser's to wait for, see `Background.retire`.
    """

    def __init__(
        self,
        outfit: str,
        body: Body,
        *,
        frame_id: str,
        attachments: str,
        solver: str,
        solver_step: float,
        detail: float,
        paced: bool,
        compiler: Compiler,
        parameters: Callable[[], Parameters],
        after: threading.Thread | None = None,
    ) -> None:
        self._outfit = outfit
        self._body = body
        self._frame_id = frame_id
        self._attachments = attachments
        self._solver = solver
        self._solver_step = solver_step
        self._detail, self._paced = detail, paced
        self._compiler = compiler
        self._parameters = parameters
        self._work = Background(self._make, DESCRIPTION, after)
        self._revision = ""

    def retire(self) -> threading.Thread | None:
        """Begin nothing more; see `Background.retire`."""
        return self._work.retire()

    def request(self, text: str) -> None:
        """Have an outfit made for a description."""
        self._work.request(text)

    @property
    def busy(self) -> bool:
        """Whether something is being made or waits to be."""
        return self._work.busy

    def result(self, *, longest: float = 0.0) -> Dressed | None:
        """What is ready, once; None where nothing is, or the description is the one in use.

        Args:
            longest: Time to wait for it [s].

        Raises:
            MessageError: The description cannot be used.
        """
        made = self._work.result(longest=longest)
        if made is not None:
            self._revision = made.revision
        return made

    def _make(self, text: str) -> Dressed | None:
        colliders = from_json(text)
        if colliders.revision == self._revision:
            return None
        if colliders.frame_id != self._frame_id:
            raise MessageError(
                "frame_id", f"found {colliders.frame_id!r}; allowed: {self._frame_id!r}"
            )
        try:
            with _alone:
                return self._dressed(colliders)
        except GarmentSimError as error:
            raise MessageError(DESCRIPTION, str(error)) from error

    def _dressed(self, colliders: ColliderSet) -> Dressed:
        parameters = self._parameters()
        outfit, simulation = dress(
            self._outfit,
            self._body,
            colliders,
            attachments=self._attachments,
            solver=self._solver,
            solver_step=self._solver_step,
            detail=self._detail,
            paced=self._paced,
            parameters=parameters,
        )
        # What the outfit did not tell of is compiled here and not in a frame.
        self._compiler.compile(Scene.of(colliders, outfit.garments), parameters)
        return Dressed(
            revision=colliders.revision,
            simulation=simulation,
            watch=WornWatch(colliders, self._body, outfit.garments),
            garments=outfit.garments,
            notes=outfit.notes,
        )
