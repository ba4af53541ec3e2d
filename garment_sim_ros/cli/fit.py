"""`fit`: colliders for a body."""

import argparse
import json
from pathlib import Path
from typing import Any

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.missing_bones import missing_bones_of
from garment_sim_ros.body.skin import Body
from garment_sim_ros.cli.staging import staged
from garment_sim_ros.collider_params import METHOD_ALIASES
from garment_sim_ros.colliders.description import save_colliders
from garment_sim_ros.colliders.fitting import METHODS, fitted
from garment_sim_ros.colliders.report.fit_report import fit_report
from garment_sim_ros.colliders.report.motion_report import SHOWS, motion_report
from garment_sim_ros.contact.shapes import ColliderSet
from garment_sim_ros.declaration import Declaration, in_yaml
from garment_sim_ros.mocap.clip_poses import clip_poses
from garment_sim_ros.mocap.clips import load_clip
from garment_sim_ros.params import ColliderOptions, declarations, idle, validated
from garment_sim_ros.recording.fit_pictures import draw_fit, draw_regions

EXAMPLE = "garment-sim fit avatar.glb --out colliders.json --preview colliders.png"

_CLIP_POSES = 30


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("body", metavar="BODY", help="body file, or mannequin")
    parser.add_argument(
        "--bone-names",
        metavar="F.yaml",
        default="",
        help="YAML file that maps humanoid bones to joints of the body; default: by name",
    )
    parser.add_argument(
        "--method",
        type=lambda name: METHOD_ALIASES.get(name, name),
        choices=tuple(METHODS),
        default=declarations(ColliderOptions)["method"].default,
        help="; ".join(f"{name}: {method.text}" for name, method in METHODS.items()),
    )
    for name, method in METHODS.items():
        if method.settings is None:
            continue
        group = parser.add_argument_group(f"of the method {name}")
        for own, declared in declarations(method.settings).items():
            _add(group, f"--{own.replace('_', '-')}", declared)
    parser.add_argument("--out", metavar="F.json", type=Path, required=True, help="collider file")
    parser.add_argument(
        "--clip",
        metavar="F",
        help="also report how far the skin leaves the colliders over a clip, see `demo`",
    )
    parser.add_argument(
        "--preview-regions",
        metavar="F.png",
        type=Path,
        help="picture of the regions that ellipsoids are fitted to",
    )
    parser.add_argument("--preview", metavar="F.png", type=Path, help="picture of skin and fit")


def _add(group: argparse._ArgumentGroup, flag: str, declared: Declaration) -> None:
    """One option of a parameter group."""
    default = in_yaml(declared.default)
    text = f"{declared.described} {declared.allowed}; default {default}".replace("%", "%%")
    if declared.type is bool:
        action = argparse.BooleanOptionalAction
        group.add_argument(flag, action=action, default=declared.default, help=text)
    elif flag == "--mu":
        group.add_argument(flag, metavar="REGION=M", action="append", default=[], help=text)
    else:
        group.add_argument(
            flag,
            type=declared.type,
            choices=declared.choices or None,
            default=declared.default,
            help=text,
        )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Fit, report, draw."""
    body = load_body(args.body, bone_names=args.bone_names)
    if missing := missing_bones_of(body, "--bone-names"):
        print(missing)
    options = _options(args)
    for line in idle(options):
        print(f"note: {line}")
    fit = fitted(body, options)
    colliders = fit.colliders
    for note in (*fit.missed, *fit.notes, *(f"assumed: {note}" for note in body.notes)):
        print(note)
    told = fit.report()
    report = {**fit_report(body, colliders), "assumed": list(body.notes)}
    for name, figures in told.pop("shapes", {}).items():
        report["shapes"][name] = {**figures, **report["shapes"].get(name, {})}
    report |= told
    if args.clip:
        report["motion"] = _over_clip(body, colliders, args.clip)
    with staged(args.out.parent) as stage:
        save_colliders(stage / args.out.name, colliders)
        text = json.dumps(report, indent=2) + "\n"
        (stage / args.out.with_suffix(".report.json").name).write_text(text)
    if args.preview:
        with staged(args.preview.parent, "--preview") as stage:
            draw_fit(body, colliders, stage / args.preview.name)
    if args.preview_regions:
        with staged(args.preview_regions.parent, "--preview-regions") as stage:
            draw_regions(body, options, stage / args.preview_regions.name)
    counts = ", ".join(f"{count} {kind}" for kind, count in report["colliders"].items())
    print(f"{args.out}: {counts}")
    print(
        f"skin outside {100 * report['outside_share']:.1f} % of the area, "
        f"at most {report['outside_mm_max']:.1f} mm; "
        f"colliders over the skin by {report['inside_mm_median']:.1f} mm (median), "
        f"{100 * report['volume_excess']:.1f} % more volume"
    )
    print(f"over the range of the joints: {_bare(report['range'])}")
    return {key: value for key, value in report.items() if key not in ("regions", "shapes")}


def _options(args: argparse.Namespace) -> ColliderOptions:
    """What the node would have as parameters."""
    names = (n for n in declarations(ColliderOptions) if hasattr(args, n))
    values = {name: getattr(args, name) for name in names}
    return validated(ColliderOptions, values | {"mu": " ".join(args.mu)})


def _over_clip(body: Body, colliders: ColliderSet, source: str) -> dict[str, Any]:
    """What `motion_report` says about a clip."""
    poses = clip_poses(load_clip(source), body, _CLIP_POSES)
    report = {"clip": source, **motion_report(body, colliders, poses)}
    for name, figures in (
        ("over the clip", report),
        ("  without refitting", report.get("static")),
    ):
        if figures:
            print(
                f"{name}: skin outside by {figures['outside_mm_mean']:.4f} mm on average, "
                f"at most {figures['outside_mm_max']:.1f} mm; {_bare(figures)}"
            )
    return report


def _bare(figures: dict[str, Any]) -> str:
    """How much skin is out of the colliders by so much that it shows through cloth, and where."""
    where = ", ".join(list(figures["bare_bones"])[:3])
    return (
        f"{100 * figures['bare_share']:.2f} % of the skin outside by more than "
        f"{1e3 * SHOWS:g} mm (mean; at most {100 * figures['bare_share_max']:.2f} %)"
        + (f", most at {where}" if where else "")
    )
