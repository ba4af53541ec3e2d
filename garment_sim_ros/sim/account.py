"""What a simulation models, and why: for logs and the command `info`."""

from typing import Any

import numpy as np

from garment_sim_ros.contact.sides import OPPOSED, PASSING, UNDER
from garment_sim_ros.sim.holds.skin_limits import SKIN_LIMITS
from garment_sim_ros.sim.simulation import Simulation


def account(simulation: Simulation) -> dict[str, Any]:
    """What is modelled.

    Args:
        simulation: Garments on colliders.

    Returns:
        ``models`` and ``leaves_out``, each a text for every effect with its reason; and for each
        of ``garments`` the numbers of vertices, triangles, pins, springs, and of shapes that are
        under all of it, against some of it, or passing it by, and ``limits``: what the solver does
        not take as the material has it.
    """
    environment = simulation.parameters.environment
    kinds = [c.kind for c in simulation.collider_set.colliders if c.is_met]
    shapes = ", ".join(f"{kinds.count(kind)} {kind}" for kind in sorted(set(kinds)))
    inertia = environment.root_linear_inertia, environment.root_angular_inertia
    effects = {
        "stretch, shear and bending": "always",
        "gravity": _unless(any(environment.gravity), "gravity is 0"),
        f"contact on {shapes} colliders": _unless(bool(kinds), "there are no shapes"),
        **_in_contact(simulation),
        **{
            limit.effect: _unless(
                any(key in simulation.skin_limits(name) for name in simulation.names),
                f"no garment has a {key}",
            )
            for key, limit in SKIN_LIMITS.items()
        },
        "tethers to pins": _unless(
            any(len(simulation.attached(name).pin) for name in simulation.names),
            "no garment has tethers",
        ),
        "soft attachments": _unless(
            any(len(simulation.attached(name).particle) for name in simulation.names),
            "no garment has an attachment_stiffness",
        ),
        "drag of air, still or a steady wind": _unless(
            any(simulation.model(n).material.air_drag > 0.0 for n in simulation.names),
            "no material has air drag",
        ),
        "wind on triangles": _unless(
            environment.wind_drag > 0.0 or environment.wind_lift > 0.0,
            "wind_drag and wind_lift are 0",
        ),
        "gusts": _unless(
            environment.gust > 0.0
            and (environment.wind_drag > 0.0 or environment.wind_lift > 0.0),
            "gust is 0" if environment.gust == 0.0 else "wind_drag and wind_lift are 0",
        ),
        "all of the body's own motion": _unless(
            inertia == (1.0, 1.0), f"{inertia[0]:g} of translation, {inertia[1]:g} of rotation"
        ),
        "cloth against itself": _unless(
            any(simulation.own_distance(name) for name in simulation.names),
            "no garment has self_collision",
        ),
    }
    return {
        "solver": simulation.solver,
        "solver_step_ms": round(1e3 * simulation.solver_step, 3),
        "models": [
            effect if why == "always" else f"{effect} ({why})"
            for effect, why in effects.items()
            if not why.startswith("no: ")
        ],
        "leaves_out": [
            f"{effect} ({why.removeprefix('no: ')})"
            for effect, why in effects.items()
            if why.startswith("no: ")
        ],
        "garments": {name: _garment(simulation, name) for name in simulation.names},
    }


def _in_contact(simulation: Simulation) -> dict[str, str]:
    """Friction and layers, which contact as printed does without."""
    layers = {simulation.layer(name) for name in simulation.names}
    friction = any(simulation.model(name).material.friction > 0.0 for name in simulation.names)
    settings = simulation.parameters.settings
    contact, response = (getattr(settings, k, "") for k in ("contact", "response"))
    printed = contact == "rays" or (contact == "earliest" and response != "surface")
    extras = getattr(settings, "extras", True)
    return {
        "friction": _unless(
            friction and not printed,
            "this contact has none" if printed else "no material has any",
        ),
        "contact between layers": _unless(
            len(layers) > 1 and extras,
            "all garments are in one layer" if extras else "extras is false",
        ),
    }


def _unless(wanted: bool, reason: str) -> str:
    return "always" if wanted else f"no: {reason}"


def _garment(simulation: Simulation, name: str) -> dict[str, Any]:
    model, sides = simulation.model(name), simulation.sides(name).side
    passing = (sides == PASSING).all(axis=1)
    return {
        "vertices": len(simulation[name].garment.vertices),
        "simulated": len(model),
        "triangles": len(simulation[name].triangles),
        "pinned": len(model) - model.free_count,
        "springs": len(model.springs),
        "layer": simulation.layer(name),
        "shapes_under": int((sides == UNDER).all(axis=1).sum()),
        "shapes_against_a_part": int(((sides == OPPOSED).any(axis=1) & ~passing).sum()),
        "shapes_passing": int(np.count_nonzero(passing)),
        "limits": list(simulation.limits(name)),
    }


def in_words(told: dict[str, Any]) -> list[str]:
    """The same as lines of text, for people."""
    lines = [
        f"{told['solver']}, steps of {told['solver_step_ms']:g} ms, models "
        + "; ".join(told["models"]),
        "left out, at no cost: " + "; ".join(told["leaves_out"]),
    ]
    for name, g in told["garments"].items():
        fewer = g["simulated"] < g["vertices"]
        of_them = f" {g['simulated']} of them simulated," if fewer else ""
        lines.append(
            f"{name}: {g['vertices']} vertices,{of_them} {g['pinned']} pinned, "
            f"{g['springs']} springs, layer {g['layer']}; {g['shapes_under']} shapes under it, "
            f"{g['shapes_against_a_part']} against a part of it, {g['shapes_passing']} pass it by"
        )
        lines.extend(f"{name}: limited: {limit}" for limit in g["limits"])
    return lines
