"""Options of commands that start an avatar's nodes, and the parameters that they stand for."""

import argparse
from pathlib import Path
from typing import Any

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.cli.preset_options import add_preset_options, choice_of, refuse_doubly_said
from garment_sim_ros.colliders.fit_cache import cached_fit
from garment_sim_ros.errors import InputFileError
from garment_sim_ros.garment.holds import AUTOMATIC
from garment_sim_ros.garment.outfit import load_outfit
from garment_sim_ros.garment.outfit_file import read_outfit
from garment_sim_ros.params import ClothNodeParameters, ColliderOptions, validated
from garment_sim_ros.presets import Choice

OUTFIT = "tshirt_short_skirt"
RATE = 60.0  # of the cloth [Hz]


def add_avatar_options(parser: argparse.ArgumentParser) -> None:
    """Declare them."""
    add = parser.add_argument
    add("--body", metavar="F", default="mannequin", help="body file (default: mannequin)")
    add("--body-bone-names", metavar="F", default="", help="YAML file of the body's bones")
    add("--bone-names", metavar="F", default="", help="YAML file of the clip's bones")
    add(
        "--clip",
        metavar="F",
        default="walk",
        help="BVH, glTF or rosbag2 (default: walk)",
    )
    add("--outfit", metavar="F", default=OUTFIT, help=f"outfit YAML (default: {OUTFIT})")
    add_preset_options(parser)


def check_files(args: argparse.Namespace) -> None:
    """See that the files are there.

    Raises:
        InputFileError: One is not.
    """
    for option in ("body", "body_bone_names", "bone_names", "clip", "outfit"):
        name = getattr(args, option).partition(":")[0]
        # A name without an ending may be a built-in one; the node that loads it knows.
        if Path(name).suffix and not Path(name).exists():
            raise InputFileError(
                f"--{option.replace('_', '-')} {name}", "does not exist", "allowed: a file"
            )


def check_worn(args: argparse.Namespace) -> None:
    """See that the body can wear an outfit from a file, before nodes wait for one that it can.

    The fit of its colliders is kept, for the nodes to find.

    Raises:
        GarmentSimError: It cannot; one line that names the file.
    """
    if not Path(args.outfit).suffix:
        return  # a built-in one
    choice = choice_of(args)
    body = load_body(args.body, bone_names=args.body_bone_names)
    usual = validated(ColliderOptions, choice.values("collider_node", ColliderOptions))
    colliders = cached_fit(body, read_outfit(args.outfit).colliders_on(usual), args.body)
    attachments = said_of_cloth(choice).get("attachments", AUTOMATIC)
    load_outfit(args.outfit, body, colliders=colliders, attachments=attachments)


def node_parameters(args: argparse.Namespace) -> dict[str, dict[str, Any]]:
    """What each node is started with.

    Raises:
        ParameterError: `--preset` or `--set` has something that is not allowed.
    """
    choice = choice_of(args)
    worn = {"body": args.body, "outfit": args.outfit, "body_bone_names": args.body_bone_names}
    nodes = {
        "cloth_node": {**worn, "rate": said_of_cloth(choice).get("rate", RATE)},
        "collider_node": {**worn, "bone_names": args.bone_names},
        "mocap_player": {"clip": args.clip, "bone_names": args.bone_names, "loop": True},
    }
    refuse_doubly_said(choice, nodes, args)
    return {node: {**own, **choice.given(node)} for node, own in nodes.items()}


def said_of_cloth(choice: Choice) -> dict[str, Any]:
    """What preset and `--set` say of `cloth_node`."""
    return choice.values("cloth_node", ClothNodeParameters)
