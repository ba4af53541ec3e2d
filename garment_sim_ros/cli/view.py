"""`view`: a page in the browser that shows a running avatar, or a recorded one."""

import argparse
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from garment_sim_ros.errors import GarmentSimError, ParameterError

EXAMPLE = "garment-sim view out/demo/bag"

_NO_BODY = "none"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    add = parser.add_argument
    add("bag", metavar="BAG", type=Path, nargs="?", help="rosbag2 folder; without: what runs now")
    add("--namespace", metavar="NS", default="", help="of the running avatar (default: none)")
    add(
        "--body",
        metavar="F",
        help="body file, or none to leave the body out; default: the body of the running "
        "cloth_node, with BAG mannequin",
    )
    add("--bone-names", metavar="F", default="", help="YAML file of the body's bones")
    add("--frame-id", metavar="ID", default="world", help="of a running avatar (default: world)")
    add("--host", metavar="H", default="127.0.0.1", help="default: 127.0.0.1, this machine alone")
    add("--port", metavar="N", type=int, default=8080, help="default: 8080; 0: any that is free")
    add("--rate", metavar="HZ", type=float, default=30.0, help="of the page (default: 30)")
    add("--seconds", metavar="S", type=float, help="end after so long; default: at Ctrl-C")


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Serve the page."""
    for option, value, least, most in (
        ("--port", args.port, 0, 65535),
        ("--rate", args.rate, 1.0, 120.0),
        ("--seconds", 1.0 if args.seconds is None else args.seconds, 0.0, 1e9),
    ):
        if not least <= value <= most:
            raise ParameterError(option, f"found {value:g}", f"allowed: {least:g} to {most:g}")
    if args.bag is not None and args.namespace:
        raise ParameterError("--namespace", "found with a bag", "allowed: without one")
    try:
        import viser  # noqa: F401
    except ImportError as error:
        raise GarmentSimError(
            f"viser: {error}; needed: pip install 'garment_sim_ros[view]'"
        ) from None
    return _serve_bag(args) if args.bag is not None else _serve_live(args)


def _serve_bag(args: argparse.Namespace) -> dict[str, Any]:
    from garment_sim_ros.view.history import ERRORS
    from garment_sim_ros.view.opening import Opening
    from garment_sim_ros.view.page import Page
    from garment_sim_ros.view.playback import Playback
    from garment_sim_ros.view.session import Session

    def add_playing(playback: Playback) -> None:
        session.slowly.append(session.panel.add_playing(playback))
        errors = [playback.errors(key) for key in ERRORS]
        longest = max(errors, key=lambda rows: len(rows[0]))[0]
        values = [v if len(v) else np.zeros(len(longest)) for _, v in errors]
        session.panel.add_graphs()(playback.rates(), (longest, *values))

    page = Page(args.host, args.port)
    try:
        body = "mannequin" if args.body is None else args.body
        body = "" if body == _NO_BODY else body
        opening = Opening(args.bag, body, args.bone_names, add_playing)
        session = Session(page, opening, args.rate)
        session.before = opening.advance
        session.panel.add_looks()
        return _serve(args, page, session.run, lambda: session.frames)
    finally:
        page.close()


def _serve_live(args: argparse.Namespace) -> dict[str, Any]:
    try:
        from garment_sim_ros.ros.live_source import LiveSource
    except ImportError as error:
        raise GarmentSimError(
            f"rclpy: {error}; source ROS 2 or pip install 'garment_sim_ros[ros]'"
        ) from None
    from garment_sim_ros.view.page import Page
    from garment_sim_ros.view.session import Session

    page = Page(args.host, args.port)
    try:
        with LiveSource(args.namespace, args.frame_id) as source:
            source.set_body(args.body, args.bone_names, none=_NO_BODY)
            session = Session(page, source, args.rate)
            session.panel.add_looks()
            session.slowly.append(session.panel.add_controls(source.nodes))
            draw = session.panel.add_graphs()
            session.slowly.append(lambda: draw(*source.graphs()))
            return _serve(args, page, session.run, lambda: session.frames)
    finally:
        page.close()


def _serve(
    args: argparse.Namespace,
    page: Any,
    serve: Callable[[Callable[[], bool]], None],
    frames: Callable[[], int],
) -> dict[str, Any]:
    """Until Ctrl-C, or as long as asked for."""
    result = {"url": page.url}
    if args.json:
        print(json.dumps(result), flush=True)
    else:
        print(f"{page.url}  (Ctrl-C ends)", flush=True)
    end = None if args.seconds is None else time.monotonic() + args.seconds
    serve(lambda: end is not None and time.monotonic() >= end)
    return {**result, "frames": frames(), "refused": dict(page.doors.refused)}
