"""`export`: a recorded avatar as an animated file, a sequence of meshes or point caches."""

import argparse
from pathlib import Path
from typing import Any

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.cli.progress import progress
from garment_sim_ros.cli.staging import staged
from garment_sim_ros.errors import InputFileError, ParameterError
from garment_sim_ros.recording.export.frames import Frames, read_frames
from garment_sim_ros.recording.export.glb import write_glb
from garment_sim_ros.recording.export.mdd import write_mdd
from garment_sim_ros.recording.export.obj import write_obj_sequence
from garment_sim_ros.recording.export.pc2 import write_pc2
from garment_sim_ros.recording.export.ply import write_ply_sequence
from garment_sim_ros.recording.export.usd import write_usd

EXAMPLE = "garment-sim export out/demo/bag --out walk.glb"

_FOLDERS = {
    "obj": write_obj_sequence,
    "ply": write_ply_sequence,
    "pc2": write_pc2,
    "mdd": write_mdd,
}
_USD = (".usda", ".usdc", ".usd")
_NO_BODY = "none"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    add = parser.add_argument
    add("bag", metavar="BAG", type=Path, help="rosbag2 folder")
    add(
        "--out",
        metavar="F",
        type=Path,
        required=True,
        help="a .glb, .usda, .usdc or .usd file, or a folder",
    )
    add(
        "--body",
        metavar="F",
        default="mannequin",
        help="the body that was recorded (default: mannequin); none leaves it out",
    )
    add("--bone-names", metavar="F", default="", help="YAML file of the body's bones")
    add("--format", choices=tuple(_FOLDERS), help="of the files in a folder (default: obj)")
    add("--rate", metavar="HZ", type=float, help="frames in a second; default: as recorded")
    add(
        "--error",
        metavar="MM",
        type=float,
        default=2.0,
        help="how far garments in a GLB may be from the recording (default: 2)",
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Read, pose, write."""
    kind = _kind(args.out, args.format)
    for option, value, least, most in (
        ("--rate", 60.0 if args.rate is None else args.rate, 0.1, 1000.0),
        ("--error", args.error, 0.01, 100.0),
    ):
        if not least <= value <= most:
            raise ParameterError(option, f"found {value:g}", f"allowed: {least:g} to {most:g}")
    body = None
    if args.body != _NO_BODY:
        body = load_body(args.body, bone_names=args.bone_names)
    frames = read_frames(args.bag, body, rate=args.rate, progress=progress)
    try:
        if kind in _FOLDERS:
            with staged(args.out) as stage:
                told = _FOLDERS[kind](frames, stage, progress=progress)
                size = sum(f.stat().st_size for f in stage.rglob("*") if f.is_file())
        else:
            with staged(args.out.parent) as stage:
                told = _write_file(frames, kind, stage / args.out.name, args.error)
                size = (stage / args.out.name).stat().st_size
    except OSError as error:
        raise InputFileError(
            f"--out {args.out}", error.strerror or str(error), "needed: room to write into"
        ) from None
    return _told(args.out, frames, kind, size, told)


def _kind(out: Path, chosen: str | None) -> str:
    """Format of the output: ``glb``, ``usd`` or a key of `_FOLDERS`."""
    suffix = out.suffix.lower()
    is_file = suffix == ".glb" or suffix in _USD
    if out.is_dir() or not suffix:
        if is_file:
            raise InputFileError(f"--out {out}", "is a folder", "allowed: a file's name")
        return chosen or "obj"
    if not is_file:
        raise InputFileError(
            f"--out {out}",
            f"has the ending {suffix}",
            "allowed: .glb, .usda, .usdc, .usd, or none",
        )
    if chosen:
        raise ParameterError("--format", f"found {chosen} beside {out}", "allowed: with a folder")
    return "usd" if suffix in _USD else "glb"


def _write_file(frames: Frames, kind: str, path: Path, error: float) -> dict[str, Any]:
    if kind == "glb":
        return write_glb(frames, path, bound=1e-3 * error, progress=progress)
    return write_usd(frames, path, progress=progress)


def _told(out: Path, frames: Frames, kind: str, size: int, told: dict[str, Any]) -> dict[str, Any]:
    count, seconds = len(frames.times), float(frames.times[-1])
    print(f"{out}: {count} frames, {seconds:.2f} s, {1e-6 * size:.1f} MB")
    if told.get("targets"):
        shapes = ", ".join(f"{n} {name}" for name, n in told["targets"].items())
        print(f"garments within {told['error_mm']:.2f} mm of the recording; targets: {shapes}")
    if kind in ("obj", "ply", "pc2") and frames.uneven:
        print("note: frames are missing in the recording, so times drift; --rate evens them")
    return {
        "frames": count,
        "seconds": round(seconds, 6),
        "rate_hz": round(frames.rate, 3),
        "bytes": size,
        "garments": list(frames.garments),
        "body": frames.body is not None,
        **told,
    }
