"""`fit`: colliders for a body."""

import argparse
import colorsys
import json
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.missing_bones import missing_bones_of
from garment_sim_ros.body.skin import Body
from garment_sim_ros.cli.staging import staged
from garment_sim_ros.colliders.capsules.capsules import fit_capsules, fit_spheres
from garment_sim_ros.colliders.description import save_colliders
from garment_sim_ros.colliders.ellipsoids.ellipsoid_binding import fit_ellipsoids
from garment_sim_ros.colliders.ellipsoids.ellipsoids import segment_body
from garment_sim_ros.colliders.ellipsoids.thresholds import REGIONS
from garment_sim_ros.colliders.exact_mesh import fit_mesh
from garment_sim_ros.colliders.hulls.hull_report import hull_report
from garment_sim_ros.colliders.hulls.hulls import fit_hulls
from garment_sim_ros.colliders.mixed import fit_mixed
from garment_sim_ros.colliders.posing import ColliderPoser
from garment_sim_ros.colliders.report.fit_report import fit_report
from garment_sim_ros.colliders.report.motion_report import motion_report
from garment_sim_ros.colliders.report.surfaces import surface
from garment_sim_ros.colliders.signed_distance import fit_signed_distances
from garment_sim_ros.contact.shapes import ColliderSet
from garment_sim_ros.declaration import Declaration
from garment_sim_ros.geometry.transforms import matrix_from_quaternion
from garment_sim_ros.mocap.clip_poses import clip_poses
from garment_sim_ros.mocap.clips import load_clip
from garment_sim_ros.params import (
    EllipsoidSettings,
    HullSettings,
    SdfSettings,
    declarations,
    validated,
)
from garment_sim_ros.recording.render import Camera, Surface, render

EXAMPLE = "garment-sim fit avatar.glb --out colliders.json --preview colliders.png"

_FRONT, _SIDE, _BACK = (2.5, 0.8, 0.2), (0.3, 2.6, 0.2), (-2.5, 0.8, 0.2)
_WIDTH, _HEIGHT = 480, 760  # of one view [pixels]

_CLIP_POSES = 30

METHODS = ("capsule", "sphere", "ellipsoid", "hull", "sdf", "auto", "mesh")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("body", metavar="BODY", help="body file, or mannequin")
    parser.add_argument(
        "--bone-names",
        metavar="F.yaml",
        default="",
        help="humanoid bone to joint of the body, where names do not tell",
    )
    parser.add_argument(
        "--method",
        choices=METHODS,
        default="hull",
        help="kind of collider; sdf: sampled signed distances; auto: for each part the "
        "tightest at equal run-time cost; mesh: the skin itself, exact and slow",
    )
    for title, settings in (
        ("of the methods hull and auto; delta, merge and joints of sdf, too", HullSettings),
        ("of the method sdf", SdfSettings),
        ("of the method ellipsoid", EllipsoidSettings),
    ):
        group = parser.add_argument_group(title)
        for name, declared in declarations(settings).items():
            _add(group, f"--{name.replace('_', '-')}", declared)
    parser.add_argument("--out", metavar="F.json", type=Path, required=True, help="result")
    parser.add_argument(
        "--clip",
        metavar="F",
        help="also report how far the skin leaves the colliders over a clip (BVH, rosbag2, walk)",
    )
    group.add_argument(
        "--preview-regions", metavar="F.png", type=Path, help="picture of the segmentation"
    )
    parser.add_argument("--preview", metavar="F.png", type=Path, help="picture of skin and fit")


def _add(group: argparse._ArgumentGroup, flag: str, declared: Declaration) -> None:
    """One option of a parameter group."""
    text = f"{declared.text} {declared.allowed}; default {declared.default}".replace("%", "%%")
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
    colliders, told = _fit(body, args)
    for note in body.notes:
        print(f"assumed: {note}")
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
    if args.method == "sdf":
        hull = validated(
            HullSettings, {name: getattr(args, name) for name in declarations(HullSettings)}
        )
        grids = fit_signed_distances(
            body,
            SdfSettings(voxel=args.voxel),
            delta=hull.delta,
            merge=hull.merge,
            bend=hull.joints != "none",
        )
        for grid in grids.shapes:
            if grid.note:
                print(f"{grid.name}: {grid.note}")
        return grids.colliders, {"shapes": grids.report()}
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
        fits = {"capsule": fit_capsules, "sphere": fit_spheres, "mesh": fit_mesh}
        return fits[args.method](body), {}
    values = {name: getattr(args, name) for name in declarations(EllipsoidSettings)}
    ellipsoids = validated(EllipsoidSettings, values | {"mu": " ".join(args.mu)})
    colliders, report = fit_ellipsoids(body, ellipsoids)
    for note in report.get("segmentation", {}).get("assumed", ()):
        print(f"assumed: {note}")
    return colliders, {"ellipsoid_fit": report}


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
                f"at most {figures['outside_mm_max']:.1f} mm"
            )
    return report


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
    *across, up = np.ptp(x, axis=0)
    size = float(max(up, max(across) * _HEIGHT / _WIDTH))  # arms stretched out fit, too
    pictures = [
        render(
            surfaces,
            Camera(position=target + size * np.asarray(direction), target=target),
            _WIDTH,
            _HEIGHT,
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
        if collider.kind not in ("frame", "mesh"):
            vertices, triangles = surface(collider)
            vertices = vertices @ matrix_from_quaternion(orientation).T + position
            color = colorsys.hsv_to_rgb(0.381966 * len(fitted) % 1.0, 0.6, 0.8)
            fitted.append(Surface(vertices=vertices, triangles=triangles, color=color))
    _views([[skin], fitted, fitted], (_FRONT, _FRONT, _SIDE), path)
