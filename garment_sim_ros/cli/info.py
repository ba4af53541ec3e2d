"""`info`: what would be modelled for an avatar and its outfit, and why."""

import argparse
from pathlib import Path
from typing import Any

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.missing_bones import missing_bones_of
from garment_sim_ros.cli.preset_options import add_preset_options
from garment_sim_ros.cli.staging import staged
from garment_sim_ros.colliders.fit_cache import cached_fit
from garment_sim_ros.garment.measures import Measures
from garment_sim_ros.garment.outfit import load_outfit
from garment_sim_ros.garment.outfit_file import DEFAULT_OUTFIT, read_outfit
from garment_sim_ros.params import (
    ClothNodeParameters,
    ColliderOptions,
    Environment,
    validated,
)
from garment_sim_ros.presets import Choice, chosen
from garment_sim_ros.recording.outfit_pictures import outfit_picture
from garment_sim_ros.sim.account import account, in_words
from garment_sim_ros.sim.auto.own_front import own_levels
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.sim.solvers import SOLVERS, longest_step

EXAMPLE = "garment-sim info --body avatar.glb --outfit tshirt_short_skirt"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    add = parser.add_argument
    add("--body", metavar="F", default="mannequin", help="body file (default: mannequin)")
    add("--bone-names", metavar="F", default="", help="YAML file of the body's bones")
    add("--outfit", metavar="F", default=DEFAULT_OUTFIT, help=f"default: {DEFAULT_OUTFIT}")
    add_preset_options(parser)
    add("--solver", choices=tuple(SOLVERS), help="default: the preset's")
    add(
        "--preview",
        metavar="F.png",
        type=Path,
        help="draw the outfit as it is put on, and what holds it, by name",
    )
    add("--solver-step", metavar="S", type=float, help="[s]; default: the preset's or node's")


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Load, make, tell."""
    choice = _choice(args)
    body = load_body(args.body, bone_names=args.bone_names)
    if missing := missing_bones_of(body, "--bone-names"):
        print(missing)
    usual = validated(ColliderOptions, choice.values("collider_node", ColliderOptions))
    colliders = cached_fit(body, read_outfit(args.outfit).colliders_on(usual), args.body)
    group = SOLVERS[choice.solver].settings
    node = validated(ClothNodeParameters, choice.values("cloth_node", ClothNodeParameters))
    outfit = load_outfit(*(args.outfit, body), colliders=colliders, attachments=node.attachments)
    told = account(
        Simulation(
            outfit.garments,
            colliders,
            environment=validated(Environment, choice.values("cloth_node", Environment)),
            settings=validated(group, choice.values("cloth_node", group)),
            solver=choice.solver,
            solver_step=longest_step(choice.solver, node.solver_step),
            detail=node.detail,
        )
    )
    own = own_levels()
    if choice.preset == "auto":
        told["front"] = {
            "levels": {level.name: round(level.cost, 3) for level in own.levels},
            "costs": own.told,
        }
    if args.preview is not None:
        measures = Measures(body)
        measures = measures.with_arms_away() if measures.has_arms else measures
        with staged(args.preview.parent, "--preview") as stage:
            picture = outfit_picture(outfit.garments, measures.vertices, body.skin.triangles)
            picture.save(stage / args.preview.name)
    for line in (*outfit.notes, *in_words(told)):
        print(line)
    if "front" in told:
        levels = ", ".join(f"{level.name} {level.cost:.2f}" for level in own.levels)
        print(f"auto moves between {levels} of balanced's time; {own.told}")
    return {**told, "preset": choice.preset, "assumed": [*body.notes, *outfit.notes]}


def _choice(args: argparse.Namespace) -> Choice:
    """What is to run: `--solver` and `--solver-step` are short for what `--set` can say, too."""
    short = {"solver": args.solver, "solver_step": args.solver_step}
    words = [f"cloth_node.{k}={v}" for k, v in short.items() if v is not None]
    return chosen(args.preset, [*args.set, *words])
