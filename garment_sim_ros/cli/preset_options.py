"""Options `--preset` and `--set` of commands."""

import argparse

from garment_sim_ros.params import PRESETS, LifecycleParameters
from garment_sim_ros.presets import Choice, chosen


def add_preset_options(parser: argparse.ArgumentParser) -> None:
    """Declare them."""
    default = LifecycleParameters().preset
    parser.add_argument(
        "--preset",
        metavar="P",
        default=default,
        help=f"{', '.join(PRESETS)} (default: {default})",
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
