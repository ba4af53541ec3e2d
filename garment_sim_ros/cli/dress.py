"""`dress`: garments cut from patterns, sewn on a body and left to drape; or meshes fitted."""

import argparse
import re
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from PIL import Image

from garment_sim_ros.avatar import Avatar
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.cli.progress import Phases
from garment_sim_ros.cli.staging import staged
from garment_sim_ros.errors import GeometryError, InputFileError, ParameterError
from garment_sim_ros.garment.colours import garment_colour
from garment_sim_ros.garment.garment import Garment
from garment_sim_ros.garment.materials import PRESETS
from garment_sim_ros.garment.measures import Measures
from garment_sim_ros.garment.mesh import UNITS, UP_AXES
from garment_sim_ros.garment.outfit import load_outfit
from garment_sim_ros.garment.patterns.gates import of_mesh
from garment_sim_ros.garment.patterns.making import DRAFTS, Made, Model, make, worn_together
from garment_sim_ros.input_file import is_file
from garment_sim_ros.recording.dress_pictures import dressed_picture, stacked
from garment_sim_ros.recording.outfit_pictures import outfit_picture
from garment_sim_ros.recording.sewing_steps import steps_picture

EXAMPLE = "garment-sim dress --body mannequin --garment tshirt --out tshirt.yaml"

_MESHES = (".obj", ".ply", ".glb", ".gltf")
_OF_MESHES = ("shortest_edge", "deviation", "unit", "up", "made_on")
_OF_NAMES = re.compile(r"[^a-z0-9_]+")
_PHASES = ("cutting", "sewing", "joining", "draping")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("--body", metavar="F", default="mannequin", help="body file, or mannequin")
    parser.add_argument(
        "--garment",
        metavar="G",
        action="append",
        required=True,
        help=(
            f"{', '.join(f'{n}: {d.text}' for n, d in DRAFTS.items())}; a GarmentCode pattern "
            "(.json); or a mesh (.obj, .ply, .glb); may be given again, in any order"
        ),
    )
    parser.add_argument("--out", metavar="F.yaml", type=Path, required=True, help="the outfit")
    parser.add_argument(
        "--fabric",
        choices=tuple(PRESETS),
        help="fabric of all garments; default: the draft's own, polyester for files",
    )
    parser.add_argument(
        "--edge-length",
        metavar="M",
        type=float,
        help="length of edges [m]; default: as the draft has it, 0.022 for files",
    )
    parser.add_argument(
        "--shortest-edge",
        metavar="M",
        type=float,
        help="mesh anew, with edges down to this length where a mesh bends [m]; default: edges of "
        "one length",
    )
    parser.add_argument(
        "--deviation",
        metavar="M",
        type=float,
        help="how far triangles may be from the mesh as it was, with --shortest-edge [m]",
    )
    parser.add_argument("--unit", choices=tuple(UNITS), help="unit of meshes; default: m")
    parser.add_argument("--up", choices=UP_AXES, help="up axis of meshes; default: y")
    parser.add_argument(
        "--made-on", metavar="F", help="body that meshes were made for; default: the wearer"
    )
    parser.add_argument(
        "--preview", metavar="F.png", type=Path, help="picture; default: --out with .png"
    )
    parser.add_argument(
        "--steps", metavar="F.png", type=Path, help="picture of the pieces flat, placed and sewn"
    )
    parser.add_argument(
        "--no-preview", action="store_true", help="draw no picture: drawing takes some seconds"
    )
    parser.add_argument(
        "--measures", action="store_true", help="also print the body's tape measurements"
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Cut, sew, drape, measure, write, draw."""
    if args.out.suffix not in (".yaml", ".yml"):
        raise ParameterError("--out", f"found {str(args.out)!r:.80}", "allowed: a .yaml file")
    names = _names(args.garment)
    if args.deviation is not None and args.shortest_edge is None:
        raise ParameterError("--deviation", "given without --shortest-edge", "allowed: with it")
    for option in _OF_MESHES:
        if getattr(args, option) is not None and not any(map(_is_mesh, names.values())):
            flag = f"--{option.replace('_', '-')}"
            raise ParameterError(flag, "given without a mesh", "allowed: with one")
    model = Model(load_body(args.body))
    if args.measures:
        _print_measures(model)
    made = _sewn(model, {n: s for n, s in names.items() if not _is_mesh(s)}, args)
    figures: dict[str, dict[str, Any]] = {}
    entries = []
    with staged(args.out.parent) as stage:
        for name, source in names.items():
            if name in made:
                file = f"{args.out.stem}_{name}.glb"
                made[name].write(stage / file)
                entry = {"name": name, "mesh": file, "material": made[name].material}
                figures[name] = _figures(name, made[name])
            else:
                entry, figures[name] = _fit_mesh(source, name, args, stage, model)
            entries.append(entry)
        text = yaml.safe_dump({"version": 1, "garments": entries}, sort_keys=False)
        (stage / args.out.name).write_text(text, encoding="utf-8")
        worn = _worn(model, stage / args.out.name, args.out)
        picture = args.preview or args.out.with_suffix(".png")
        if not args.no_preview:
            sheets = [dressed_picture(*_drawn(made, model))] if made else []
            if worn:
                sheets.append(outfit_picture(worn, model.skin, model.body.skin.triangles))
            if sheets:
                _save(stacked(sheets), picture, stage, "--preview")
        if made and args.steps:
            _save(steps_picture(*_drawn(made, model)), args.steps, stage, "--steps")
    failed = {n: g["failed"] for n, g in figures.items() if g["failed"]}
    print(f"{args.out}: {', '.join(names)}")
    for name, gates in failed.items():
        print(f"note: {name} is beyond the limits of {', '.join(gates)}")
    return {"outfit": str(args.out), "garments": figures, "passed": not failed}


def _sewn(model: Model, sources: dict[str, str], args: argparse.Namespace) -> dict[str, Made]:
    """Garments from patterns, as they hang over each other."""
    made = {}
    for name, source in sources.items():
        with Phases(name, _PHASES) as phases:
            made[name] = make(
                source, model, edge_length=args.edge_length, fabric=args.fabric, tell=phases.show
            )
    if len(made) > 1 and model.measures is not None:
        made = worn_together(made, model)
    return made


def _figures(name: str, made: Made) -> dict[str, Any]:
    """Sizes and gates of one garment, printed too."""
    count, triangles = len(made.sewn.vertices), len(made.sewn.triangles)
    print(f"{name}: {count} vertices, {triangles} triangles, {made.fabric}")
    for line in (*made.pieces.pattern.notes, *made.gates.lines()):
        print(f"  {line}")
    return {
        "vertices": count,
        "triangles": triangles,
        "panels": len(made.pieces.pattern.panels),
        **made.gates.figures,
        "failed": list(made.gates.failed),
    }


def _drawn(made: dict[str, Made], model: Model) -> tuple[Any, ...]:
    """What pictures of garments that were sewn show."""
    colours = [garment_colour(k) for k in range(len(made))]
    return [*made.values()], colours, model.skin, model.body.skin.triangles


def _worn(model: Model, written: Path, out: Path) -> tuple[Garment, ...]:
    """The garments as who plays the outfit gets them; none on a body without bones.

    Raises:
        InputFileError: They cannot be worn, as nothing holds them.
    """
    if model.measures is None:
        return ()
    try:
        return load_outfit(written, model.body).garments
    except InputFileError as error:
        raise InputFileError(out, f"cannot be worn: {error.problem}", error.allowed) from error


def _save(picture: Image.Image, path: Path, stage: Path, option: str) -> None:
    """Saves a picture, beside the outfit or elsewhere."""
    if path.parent.resolve() == stage.parent.resolve():
        picture.save(stage / path.name)
        return
    with staged(path.parent, option) as other:
        picture.save(other / path.name)


def _fit_mesh(
    source: str, name: str, args: argparse.Namespace, stage: Path, model: Model
) -> tuple[dict[str, Any], dict[str, Any]]:
    """A mesh repaired, refined and put outside of the colliders that it will be worn on."""
    avatar = Avatar.load(args.body)
    options: dict[str, Any] = {} if args.fabric is None else {"material": args.fabric}
    for option in ("edge_length", *_OF_MESHES):
        if (value := getattr(args, option)) is not None:
            options[option] = value
    if is_file(options.get("made_on", "")):
        options["made_on"] = str(Path(options["made_on"]).resolve())
    if "shortest_edge" in options:
        options["remesh"] = "curved"
    with model.doubted():
        outfit = avatar.dress(source, name=name, **options)
    for note in outfit.notes:
        print(note)
    garment = outfit.garments[0]
    file = f"{args.out.stem}_{name}.obj"
    _write_obj(stage / file, garment)
    print(f"{name}: {len(garment.vertices)} vertices, {len(garment.triangles)} triangles")
    skin = Measures(model.body).vertices  # at rest, as meshes are given
    figures = of_mesh(garment.vertices, garment.triangles, skin, model.body.skin.triangles)
    for line in figures.lines():
        print(f"  {line}")
    entry = {
        "name": name,
        "mesh": file,
        "options": {"up": "z", "edge_length": 100.0, "remesh": "never"},
        **({"material": args.fabric} if args.fabric else {}),
    }
    return entry, {
        "vertices": len(garment.vertices),
        "triangles": len(garment.triangles),
        **figures.figures,
        "failed": list(figures.failed),
    }


def _write_obj(path: Path, garment: Garment) -> None:
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in garment.vertices.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (garment.triangles + 1).tolist()]
    path.write_text("\n".join(lines) + "\n", encoding="ascii")


def _is_mesh(source: str) -> bool:
    return Path(source).suffix.lower() in _MESHES


def _names(sources: list[str]) -> dict[str, str]:
    """Sources by the names of their garments."""
    names: dict[str, str] = {}
    for source in sources:
        if source not in DRAFTS and not is_file(source):
            raise ParameterError(
                "--garment",
                f"found {source!r:.80}, which is no file",
                f"allowed: {', '.join(DRAFTS)}, a .json pattern, or a mesh",
            )
        stem = Path(source).stem.lower().removesuffix("_specification")
        name = _OF_NAMES.sub("_", stem).strip("_")[:60] or "garment"
        name = name if name[0].isalpha() else f"garment_{name}"
        if name in names:
            raise ParameterError("--garment", f"{name!r} is given twice", "allowed: once")
        names[name] = source
    return names


def _print_measures(model: Model) -> None:
    try:
        values = model.tape().named()
    except GeometryError as error:
        print(f"note: {error}")
        return
    print(", ".join(f"{name} {100.0 * np.round(v, 3):.1f} cm" for name, v in values.items()))
