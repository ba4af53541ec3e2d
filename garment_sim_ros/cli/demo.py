"""`demo`: a dressed, moving avatar over real ROS 2, recorded, measured and drawn."""

import argparse
import json
import os
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from garment_sim_ros.cli.avatar_options import (
    add_avatar_options,
    check_files,
    check_worn,
    node_parameters,
    said_of_cloth,
)
from garment_sim_ros.cli.node_processes import NodeProcesses, own_network
from garment_sim_ros.cli.preset_options import choice_of
from garment_sim_ros.cli.progress import Waiting, progress
from garment_sim_ros.cli.staging import staged
from garment_sim_ros.errors import GarmentSimError, ParameterError

EXAMPLE = "garment-sim demo --body avatar.glb --clip dance.bvh --out out/dance"

_START_LIMIT = 180.0  # for the first cloth, once no node says that it is at work [s]
_WAIT = 0.1
_FEW_LATE = 0.05
"""Share of the frames that may be late without a word."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    add = parser.add_argument
    add("--seconds", metavar="S", type=float, default=8.0, help="seconds to record (default: 8)")
    add_avatar_options(parser)
    add(
        "--out",
        metavar="DIR",
        type=Path,
        default=Path("out/demo"),
        help="folder of bag, figures and pictures (default: out/demo)",
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Run, record, measure, draw."""
    began = time.monotonic()
    if not 1.0 <= args.seconds <= 3600.0:
        raise ParameterError("--seconds", f"found {args.seconds:g}", "allowed: 1 to 3600")
    check_files(args)
    nodes = node_parameters(args)
    check_worn(args)
    with staged(args.out) as stage:
        first_cloth = _record(nodes, args.seconds, stage, began)
        from garment_sim_ros.recording.evaluation import evaluate

        summary = evaluate(
            stage / "bag",
            args.body,
            args.outfit,
            frame_rate=nodes["cloth_node"]["rate"],
            pictures=stage,
            bone_names=args.body_bone_names,
            **_worn_with(args),
            progress=progress,
        )
        summary["first_cloth_s"] = round(first_cloth, 2)
        summary["preset"] = args.preset
        (stage / "summary.json").write_text(json.dumps(summary, indent=2) + "\n")
    print(_table(summary))
    if advice := advice_on(summary):
        print(advice)
    if summary["pictures"] != "drawn":
        print(summary["pictures"])
    print(f"written to {args.out}: {', '.join(sorted(os.listdir(args.out)))}")
    return summary


def _worn_with(args: argparse.Namespace) -> dict[str, Any]:
    """What holds the garments and how the skin follows its bones, where it is said."""
    said = said_of_cloth(choice_of(args))
    return {name: said[name] for name in ("attachments", "skinning") if name in said}


def _record(
    parameters: Mapping[str, Mapping[str, Any]], seconds: float, stage: Path, began: float
) -> float:
    """Record the running nodes into ``bag``; returns when the first cloth came [s]."""
    os.environ.update(own_network())
    with NodeProcesses(stage / "logs") as nodes:
        for node, given in parameters.items():
            nodes.start(node, given)
        try:
            # Only now, so that the nodes start while this loads.
            from garment_sim_ros.ros.recorder import Recorder
        except ImportError as error:
            raise GarmentSimError(
                f"rclpy: {error}; source ROS 2 or pip install 'garment_sim_ros[ros]'"
            ) from None
        with Recorder(stage / "bag") as recorder:
            with Waiting("starting") as waiting:
                idle_since = time.monotonic()
                while not recorder.first_cloth.wait(_WAIT):
                    nodes.check()
                    if work := nodes.at_work():
                        idle_since = time.monotonic()
                    if time.monotonic() - idle_since > _START_LIMIT:
                        raise GarmentSimError(
                            f"no cloth after {_START_LIMIT:g} s: {nodes.last_words('cloth_node')}"
                        )
                    waiting.show(work or nodes.last_words("cloth_node"))
            first_cloth = time.monotonic() - began
            for _ in progress(range(round(seconds / _WAIT)), "recording"):
                time.sleep(_WAIT)
                nodes.check()
                recorder.check()
        nodes.finish()
    return first_cloth


def advice_on(summary: dict[str, Any]) -> str:
    """What to do where many frames were late; empty where few were.

    Args:
        summary: What goes to ``summary.json``.
    """
    late, frames = summary["late_frames"], max(summary["frames"], 1)
    if late <= _FEW_LATE * frames:
        return ""
    cheaper = {"auto": "--preset fast", "fast": "--set cloth_node.rate=30"}
    less = cheaper.get(summary["preset"], "--preset auto or --preset fast")
    return (
        f"note: {late} frames were late or left out, {frames} came: this machine is slow, or "
        f"busy, for preset {summary['preset']}; {less} asks for less"
    )


def _table(summary: dict[str, Any]) -> str:
    """The closing table for people."""
    s = summary
    rows = [
        ("frames published", f"{s['frames']}"),
        ("rate held", f"{s['rate_hz']:.2f} Hz"),
        ("late frames", f"{s['late_frames']}"),
        ("solver per frame", f"{s['step_ms_median']:.2f} ms (p95 {s['step_ms_p95']:.2f} ms)"),
        (
            "penetration into the skin",
            f"p99 {_number(s['penetration_mm_p99'])} mm, deepest "
            f"{_number(s['penetration_mm_max'])} mm",
        ),
        (
            "still worn",
            f"pierced {_percent(s['pierced'], 2)} of the frames, inside "
            f"{_percent(s['inside_p99'])} of the cloth (p99)",
        ),
        ("gap to the skin", f"{_number(s['gap_mm_median'])} mm (median)"),
        ("stretch", f"p95 {_percent(s['strain_p95'])}, largest {_percent(s['strain_max'])}"),
        (
            "finite, resets, mended",
            f"{'yes' if s['finite'] else 'NO'}, {s['resets']}, {s['recovered']}",
        ),
    ]
    rows += [
        (
            name,
            f"{g['vertices']} vertices, {g['triangles']} triangles, "
            f"{100.0 * g['pinned_share']:.1f} % pinned",
        )
        for name, g in s["garments"].items()
    ]
    width = max(len(name) for name, _ in rows)
    return "\n".join(f"{name:<{width}}  {value}" for name, value in rows)


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"


def _percent(value: float | None, digits: int = 1) -> str:
    return "-" if value is None else f"{100.0 * value:.{digits}f} %"
