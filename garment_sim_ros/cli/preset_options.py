"""Options `--preset` and `--set` of commands."""

import argparse
from collections.abc import Mapping

from garment_sim_ros.errors import ParameterError
from garment_sim_ros.params import PRESETS, LifecycleParameters
from garment_sim_ros.presets import Choice, chosen


def add_preset_options(parser: argparse.ArgumentParser) -> None:
    """Declare them."""
    default = LifecycleParameters().preset
    parser.add_argument(
        "--preset",
        metavar="P",
        default=default,
        help=f"set of parameters: {', '.join(PRESETS)} (default: {default})",
    )
    parser.add_argument(
        "--set",
        metavar="NODE.PARAM=VALUE",
        action="append",
        default=[],
        help="a single parameter, which wins over the preset; may be repeated",
    )


def choice_of(args: argparse.Namespace) -> Choice:
    """What was asked for.

    Raises:
        ParameterError: A name or value that is not allowed.
    """
    return chosen(args.preset, args.set)


def refuse_doubly_said(
    choice: Choice, nodes: Mapping[str, Mapping[str, object]], args: argparse.Namespace
) -> None:
    """See that `--set` gives nothing that an option gives.

    Args:
        choice: What `--set` gives.
        nodes: By node: what options give.
        args: The options.

    Raises:
        ParameterError: It does.
    """
    for node, own in nodes.items():
        for name in choice.single[node]:
            if name in own and hasattr(args, name):
                option = f"--{name.replace('_', '-')}"
                raise ParameterError(
                    f"--set {node}.{name}", "has an option of its own", f"allowed: {option}"
                )
