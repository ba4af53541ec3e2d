"""The figures of both papers beside ours: what the tables of ``docs/papers.md`` hold.

    python bench/papers.py [--parts hull fall walk counts stand] [--seconds 3] [--data DIR]

Sun et al. 2007: ``hull``, Fig. 8 a to d: triangles and lists of the outer map of the model that
`bench/hulls.py` makes; ``fall``, Fig. 8 e and f: a cloth of 2,500 particles on it (`falling.py`),
with contact as printed and as by default; ``walk``, Figs. 9 and 10: the preset sun2007 on a body
of 1,425 vertices, a T-shirt and a short skirt in the built-in walk, and a long skirt in a dance of
the shared data (else the walk), at steps of 0.033 and 0.33 s. Gong et al. 2018: ``counts``, Fig.
8: ellipsoids around a man and a woman of the shared data ($GARMENT_SIM_DATA) with one ellipsoid to
a region, with one threshold and with two; ``stand``, Figs. 9 and 10: a sewn wide dress, and a
tight T-shirt, in gravity and wind on a body that stands, with hits as printed, with the plain
response from the centre and as by default. Frames a second are those of one thread of this
processor's time.
"""

import argparse
import os
import sys
from pathlib import Path

import numpy as np

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.colliders.ellipsoids.ellipsoids import ellipsoids_around
from garment_sim_ros.colliders.hulls.hull import convex_hull, inflate_vertices
from garment_sim_ros.colliders.hulls.hull_simplify import Simplification, simplify_hull
from garment_sim_ros.contact.papers.outer_map import outer_map
from garment_sim_ros.geometry.obb import oriented_box
from garment_sim_ros.params import ColliderOptions
from garment_sim_ros.presets import chosen, collider_options
from garment_sim_ros.tradeoff.scenes import SCENES
from garment_sim_ros.tradeoff.waisted_limb import DELTA, waisted_limb

sys.path.insert(0, str(Path(__file__).parent))
from falling import fall
from presets import PATTERN, Clip, Wearer

BODY = "mannequin:vertices=1425"
SHORT, LONG = "tshirt_short_skirt", "tshirt_long_skirt"
DRESS, TIGHT = f"{PATTERN}wide_dress", SCENES["tight"].wear


def hull(_: argparse.Namespace) -> None:
    """Fig. 8 a to d of the first paper."""
    points, _ = waisted_limb()
    inner = convex_hull(points)
    start = inflate_vertices(inner, DELTA)
    for name, alone in (("triangles alone, as printed", True), ("as by default", False)):
        for outside in (np.inf, 3 * DELTA):
            how = Simplification(max_faces=4, outside=outside, triangles_only=alone)
            least = len(simplify_hull(start, inner, how).faces)
            print(f"hull, {name}: {len(inner.faces)} faces, at least {least} at {outside:g} m")
    how = Simplification(max_faces=116, triangles_only=True)
    simple = simplify_hull(start, inner, how)
    local = oriented_box(simple.vertices, simple.faces).local(simple.vertices)
    length = np.diff(outer_map(local, simple.faces, kind="cylinder").start)
    print(
        f"outer map of {len(simple.faces)} faces: {len(length)} cells, longest list "
        f"{length.max()}, mean {length.mean():.1f}"
    )


def drop(_: argparse.Namespace) -> None:
    """Fig. 8 e and f of the first paper."""
    for contact in ("rays", "union"):
        f = fall(240, contact)
        print(
            f"fall, contact {contact}: {f['steps_per_second']} steps a second, "
            f"{f['step_in_F']} F, collision {100 * f['collision_share']:.0f} %, penetration "
            f"{f['penetration_mm']}"
        )


def told(name: str, wearer: Wearer, seconds: float) -> None:
    """Plays a scene and prints what came of it."""
    wearer.until(seconds)
    f = wearer.figures()
    depth = wearer.meter.result()["penetration_mm_p99"]
    print(
        f"{name}: {1e3 / f['ms']:.0f} frames/s of {wearer.frame_time:.3g} s ({f['ms']:.2f} ms); "
        f"stretch p95 {100 * f['strain_p95']:.0f} %, largest {100 * f['strain_max']:.0f} %; "
        f"pierced {100 * f['pierced']:.0f} %, inside p99 {100 * f['inside_p99']:.1f} %; "
        f"penetration p99 {depth:.1f} mm; resets {f['resets']}",
        flush=True,
    )


def walk(options: argparse.Namespace) -> None:
    """Figs. 9 and 10 of the first paper."""
    slow = ["cloth_node.solver_step=0.33", "cloth_node.rate=3.0303030303"]
    dance = options.data / "mocap" / SCENES["dance"].clip
    danced = Clip(dance.stem, str(dance)) if dance.is_file() else Clip("walk", "walk")
    for name, words, outfit, clip in (
        ("Fig. 9, T-shirt and short skirt, 0.033 s", [], SHORT, Clip("walk", "walk")),
        (f"Fig. 10, {danced.name}, T-shirt and long skirt, 0.033 s", [], LONG, danced),
        (f"Fig. 10, {danced.name}, T-shirt and long skirt, 0.33 s", slow, LONG, danced),
    ):
        seconds = options.seconds * (3 if words else 1)
        wearer = Wearer(chosen("sun2007", words), clip, seconds, BODY, outfit)
        told(name, wearer, seconds)


def counts(options: argparse.Namespace) -> None:
    """Fig. 8 of the second paper."""
    printed = collider_options("gong2018")
    for name, sex in (("m_smpl_average_A40.obj", "male"), ("mh_female_young.glb", "female")):
        body = load_body(options.data / "bodies" / name)
        for how, asked in (
            ("one ellipsoid to a region", {"mu_torso": 1.0, "mu_limb": 1.0}),
            ("the same threshold, 12 mm", {"mu_torso": 0.012, "mu_limb": 0.012}),
            ("two thresholds, 18 and 12 mm", {}),
        ):
            asked = {**printed, "sex": sex, **asked}
            r = ellipsoids_around(body, ColliderOptions(**asked)).report()
            print(
                f"{name}, {how}: {r['ellipsoids']} ellipsoids, mean error "
                f"{r['mean_error_mm']:.1f} mm, {r['over_mu']} over their threshold",
                flush=True,
            )


def stand(options: argparse.Namespace) -> None:
    """Figs. 9 and 10 of the second paper."""
    plain = ["cloth_node.contact=rays", "cloth_node.response=surface"]
    wind = [f"cloth_node.{k}" for k in ("wind_drag=1.2", "wind_lift=0.4", "gust=1.0")]
    for figure, outfit in (("Fig. 9, wide dress", DRESS), ("Fig. 10, tight shirt", TIGHT)):
        for how, preset, words in (
            ("reflection", "gong2018", []),
            ("from the centre", "gong2018", plain),
            ("balanced", "balanced", wind),
        ):
            wearer = Wearer(chosen(preset, words), None, options.seconds, BODY, outfit)
            told(f"{figure}, standing in wind, {how}", wearer, options.seconds)


PARTS = {"hull": hull, "fall": drop, "walk": walk, "counts": counts, "stand": stand}


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--parts", nargs="+", default=list(PARTS), choices=PARTS)
    parser.add_argument("--seconds", type=float, default=3.0)
    data = os.environ.get("GARMENT_SIM_DATA", "../shared/data")
    parser.add_argument("--data", type=Path, default=Path(data))
    options = parser.parse_args()
    for part in options.parts:
        PARTS[part](options)


if __name__ == "__main__":
    main()
