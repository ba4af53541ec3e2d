"""`fit`: colliders for a body."""

import argparse
import colorsys
import json
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from garment_sim_ros.body.loaders import load_body
from garment_sim_ros.body.skin import Body
from garment_sim_ros.cli.staging import staged
from garment_sim_ros.colliders.capsules import fit_capsules, fit_spheres
from garment_sim_ros.colliders.description import save_colliders
from garment_sim_ros.colliders.ellipsoids import (
    MU_LIMB,
    MU_TORSO,
    SEGMENTATIONS,
    fit_ellipsoids,
    segment_body,
)
from garment_sim_ros.colliders.fit_report import fit_report
from garment_sim_ros.colliders.hull_report import hull_report
from garment_sim_ros.colliders.hulls import fit_hulls
from garment_sim_ros.colliders.mixed import fit_mixed
from garment_sim_ros.colliders.posing import ColliderPoser
from garment_sim_ros.colliders.segmentation import REGIONS
from garment_sim_ros.colliders.surfaces import surface
from garment_sim_ros.errors import ParameterError
from garment_sim_ros.geometry.shapes import ColliderSet
from garment_sim_ros.geometry.transforms import matrix_from_quaternion
from garment_sim_ros.params import HullSettings, declarations, validated
from garment_sim_ros.tradeoff.render import Camera, Surface, render

EXAMPLE = "garment-sim fit avatar.glb --out colliders.json --preview colliders.png"

_FRONT, _SIDE, _BACK = (2.5, 0.8, 0.2), (0.3, 2.6, 0.2), (-2.5, 0.8, 0.2)

METHODS = ("capsule", "sphere", "ellipsoid", "hull", "auto")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("body", metavar="BODY", help="body file, or mannequin")
    parser.add_argument(
        "--method",
        choices=METHODS,
        default="hull",
        help="kind of collider; auto: for each part the tightest at equal run-time cost",
    )
    group = parser.add_argument_group("of the methods hull and auto")
    for name, declared in declarations(HullSettings).items():
        group.add_argument(
            f"--{name.replace('_', '-')}",
            type=declared.type,
            choices=declared.choices or None,
            default=declared.default,
            help=f"{declared.text} {declared.allowed}; default {declared.default}",
        )
    group = parser.add_argument_group("of the method ellipsoid")
    number: dict[str, Any] = {"metavar": "M", "type": float}
    group.add_argument(
        "--mu-torso", default=MU_TORSO, help="fit error that splits, torso [m]", **number
    )
    group.add_argument(
        "--mu-limb", default=MU_LIMB, help="fit error that splits, head, arms, legs [m]", **number
    )
    group.add_argument(
        "--mu", metavar="REGION=M", action="append", default=[], help="the same of one region"
    )
    group.add_argument("--sigma", default=1e-3, help="where k-means stops [m]", **number)
    group.add_argument("--max-ellipsoids", metavar="N", type=int, default=90, help="at most")
    group.add_argument(
        "--segmentation",
        choices=SEGMENTATIONS,
        default="auto",
        help="by the rig's joints where it has them, by the rig, by the surface alone, by the "
        "paper's constants, or the body as a whole",
    )
    parser.add_argument("--out", metavar="F.json", type=Path, required=True, help="result")
    group.add_argument(
        "--preview-regions", metavar="F.png", type=Path, help="picture of the segmentation"
    )
    parser.add_argument("--preview", metavar="F.png", type=Path, help="picture of skin and fit")


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Fit, report, draw."""
    body = load_body(args.body)
    colliders, told = _fit(body, args)
    for note in body.notes:
        print(f"assumed: {note}")
    report = {**fit_report(body, colliders), "assumed": list(body.notes), **told}
    with staged(args.out.parent) as stage:
        save_colliders(stage / args.out.name, colliders)
        text = json.dumps(report, indent=2) + "\n"
        (stage / args.out.with_suffix(".report.json").name).write_text(text)
    if args.preview:
        with staged(args.preview.parent, "--preview") as stage:
            _draw(body, colliders, stage / args.preview.name)
    if args.preview_regions:
        with staged(args.preview_regions.parent, "--preview-regions") as stage:
            _draw_regions(body, args.segmentation, stage / args.preview_regions.name)
    counts = ", ".join(f"{count} {kind}" for kind, count in report["colliders"].items())
    print(f"{args.out}: {counts}")
    print(
        f"skin outside {100 * report['outside_share']:.1f} % of the area, "
        f"at most {report['outside_mm_max']:.1f} mm; "
        f"colliders over the skin by {report['inside_mm_median']:.1f} mm (median), "
        f"{100 * report['volume_excess']:.1f} % more volume"
    )
    return {key: value for key, value in report.items() if key not in ("regions", "shapes")}


def _fit(body: Body, args: argparse.Namespace) -> tuple[ColliderSet, dict[str, Any]]:
    """Colliders by the method asked for, and what only that method reports."""
    if args.method == "hull":
        settings = {name: getattr(args, name) for name in declarations(HullSettings)}
        fit = fit_hulls(body, validated(HullSettings, settings))
        for shape in fit.shapes:
            if shape.kind != "hull":
                print(f"{shape.name}: {shape.kind}, {shape.note}")
        return fit.colliders, {"shapes": hull_report(fit)}
    if args.method == "auto":
        settings = {name: getattr(args, name) for name in declarations(HullSettings)}
        mixed, report = fit_mixed(
            body, validated(HullSettings, settings), segmentation=args.segmentation
        )
        for note in report["assumed"]:
            print(f"assumed: {note}")
        for name, part in report["parts"].items():
            figures = ", ".join(
                f"{kind} {part[kind]['mean_mm']:.1f} mm for {part[kind]['cost_ns']:.0f} ns"
                for kind in ("hull", "ellipsoid", "capsule")
            )
            print(f"{name}: {part['chosen']} ({figures})")
        return mixed, {"auto": report}
    if args.method != "ellipsoid":
        return {"capsule": fit_capsules, "sphere": fit_spheres}[args.method](body), {}
    mu_regions = {}
    for text in args.mu:
        region, _, value = text.partition("=")
        try:
            mu_regions[region] = float(value)
        except ValueError:
            raise ParameterError("--mu", f"found {text!r}", "allowed: REGION=M") from None
    colliders, report = fit_ellipsoids(
        body,
        mu_torso=args.mu_torso,
        mu_limb=args.mu_limb,
        mu_regions=mu_regions,
        sigma=args.sigma,
        max_ellipsoids=args.max_ellipsoids,
        segmentation=args.segmentation,
    )
    for note in report.get("segmentation", {}).get("assumed", ()):
        print(f"assumed: {note}")
    return colliders, {"ellipsoid_fit": report}


def _draw_regions(body: Body, segmentation: str, path: Path) -> None:
    """The skin from front and back, one colour per region; a triangle has that of most corners."""
    region = segment_body(body, segmentation).region[body.skin.triangles]
    of_triangle = np.where(region[:, 1] == region[:, 2], region[:, 1], region[:, 0])
    x = body.skin.vertices
    surfaces = [
        Surface(
            vertices=x,
            triangles=body.skin.triangles[of_triangle == i],
            # Golden section of the colour circle: neighbours differ.
            color=colorsys.hsv_to_rgb(0.381966 * i % 1.0, 0.5 + 0.25 * (i % 2), 0.8),
        )
        for i in range(len(REGIONS))
    ]
    _views([surfaces, surfaces], (_FRONT, _BACK), path)


def _views(
    figures: list[list[Surface]], directions: tuple[tuple[float, float, float], ...], path: Path
) -> None:
    """Figures side by side, each seen from its own direction."""
    x = np.concatenate([surface.vertices for surface in figures[-1]])
    target = 0.5 * (x.min(axis=0) + x.max(axis=0))
    size = float(np.ptp(x, axis=0).max())
    pictures = [
        render(
            surfaces,
            Camera(position=target + size * np.asarray(direction), target=target),
            480,
            760,
            floor=float(x[:, 2].min()),
        )
        for surfaces, direction in zip(figures, directions)
    ]
    Image.fromarray(np.concatenate(pictures, axis=1)).save(path)


def _draw(body: Body, colliders: ColliderSet, path: Path) -> None:
    """The skin, and the skin with its colliders from front and side."""
    T_world_bone = np.asarray(np.linalg.inv(body.skin.T_bone_bind), np.float64)
    poses = ColliderPoser(colliders, body).poses(T_world_bone)
    skin = Surface(
        vertices=body.skin.vertices, triangles=body.skin.triangles, color=(0.85, 0.7, 0.6)
    )
    fitted = [skin]
    for collider, position, orientation in zip(
        colliders.colliders, poses.position, poses.orientation
    ):
        if collider.kind != "frame":
            vertices, triangles = surface(collider)
            vertices = vertices @ matrix_from_quaternion(orientation).T + position
            color = colorsys.hsv_to_rgb(0.381966 * len(fitted) % 1.0, 0.6, 0.8)
            fitted.append(Surface(vertices=vertices, triangles=triangles, color=color))
    _views([[skin], fitted, fitted], (_FRONT, _FRONT, _SIDE), path)
