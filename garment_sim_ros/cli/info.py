"""`info`: what would be modelled for an avatar and its outfit, and why."""

import argparse
from typing import Any

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.missing_bones import missing_bones_of
from garment_sim_ros.colliders.fitting import fit_colliders
from garment_sim_ros.garment.outfit import load_outfit
from garment_sim_ros.garment.outfit_file import DEFAULT_OUTFIT, read_outfit
from garment_sim_ros.params import ClothNodeParameters
from garment_sim_ros.sim.account import account, in_words
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.sim.solvers import SOLVERS

EXAMPLE = "garment-sim info --body avatar.glb --outfit tshirt_short_skirt"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    default = ClothNodeParameters()
    add = parser.add_argument
    add("--body", metavar="F", default="mannequin", help="body file (default: mannequin)")
    add("--bone-names", metavar="F", default="", help="YAML file of the body's bones")
    add("--outfit", metavar="F", default=DEFAULT_OUTFIT, help=f"default: {DEFAULT_OUTFIT}")
    add("--solver", choices=tuple(SOLVERS), default=default.solver)
    add("--solver-step", metavar="S", type=float, help="[s]; default: the solver's")


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Load, make, tell."""
    body = load_body(args.body, bone_names=args.bone_names)
    if missing := missing_bones_of(body, "--bone-names"):
        print(missing)
    colliders = fit_colliders(body, read_outfit(args.outfit).colliders)
    outfit = load_outfit(args.outfit, body, colliders=colliders)
    told = account(
        Simulation(outfit.garments, colliders, solver=args.solver, solver_step=args.solver_step)
    )
    for line in (*outfit.notes, *in_words(told)):
        print(line)
    return {**told, "assumed": [*body.notes, *outfit.notes]}
