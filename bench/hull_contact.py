"""Hulls and capsules in contact: what collisions of the dressed walk cost.

    python bench/hull_contact.py [--json]

T-shirt and short skirt on the walking mannequin: what they bring to their collisions in 30 steps
is collided again. Medians of processor time of one thread per step, for several collider sets, at
1 and 10 times the particles, with hulls of 40, 80 and 160 faces, and with the hulls of bodies of
1,000 to 10,000 vertices. F: three plain C sweeps over the springs of both garments, timed in the
same turns. ``culled``: the same without the shapes whose box the garment's box, with
all margins, does not touch; the results are the same bits, and how long both take tells what
knowing such shapes beforehand, for nothing, would save over rejecting them block by block.
"""

import argparse
import itertools
import json
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from garment_sim_ros.avatar import Avatar
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.skin import Body
from garment_sim_ros.collider_params import HullSettings
from garment_sim_ros.colliders.hulls.hulls import fit_hulls
from garment_sim_ros.contact.broad_phase import DIAGONAL
from garment_sim_ros.contact.collide import collide
from garment_sim_ros.contact.contacts import Contacts
from garment_sim_ros.contact.packed import PosedShapes, pose
from garment_sim_ros.contact.shapes import ColliderPoses, ColliderSet
from garment_sim_ros.contact.sides import Sides
from garment_sim_ros.garment.garment import Garment
from garment_sim_ros.garment.outfit import load_outfit
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.sim.solvers.relaxation import step as relaxation

sys.path.insert(0, str(Path(__file__).parent))
from drape import Unit
from hulls import collider_sets, median

_VERTICES = (1000, 3000, 10_000)
_TURNS = 12


def walked(outfits: Sequence[Garment], colliders: ColliderSet, body: Body) -> dict[str, list[Any]]:
    """What each garment brings to its collisions in 30 steps of the walk, after 1.5 s of it."""
    path = Avatar(body, colliders).play("walk", 60, seconds=100 / 60, repeat="loop")
    simulation = Simulation(outfits, colliders, solver="relaxation")
    brought: dict[str, list[Any]] = {name: [] for name in simulation.names}
    seen = itertools.cycle(simulation.names)

    def note(shapes, posed, sides, x, x_start, thickness, friction, contacts):  # type: ignore[no-untyped-def]
        if frame >= 90:
            still = PosedShapes(*(a.copy() for a in posed))
            step = (shapes, still, sides, x.copy(), x_start.copy(), thickness, friction)
            brought[next(seen)].append(step)
        return collide(shapes, posed, sides, x, x_start, thickness, friction, contacts)

    relaxation.collide = note
    frame = -1  # the first call puts them on
    for poses in path:
        simulation.step(poses, 1 / 60)
        frame += 1
    relaxation.collide = collide
    return brought


def again(steps: list[Any], times: int) -> float:
    """Median milliseconds of those collisions, each particle doubled so many times."""
    shapes, _, sides, x, *_ = steps[0]
    rng = np.random.default_rng(0)
    wide = Sides.of(np.repeat(np.arange(len(x)), times), sides.side.T)
    contacts = Contacts.room_for(times * len(x), len(shapes.kind))
    off = rng.normal(0, 0.003 if times > 1 else 0.0, (times * len(x), 3)).astype(np.float32)
    took = []
    for _, posed, _, x, x_start, thickness, friction in steps:
        work, before = np.repeat(x, times, axis=0) + off, np.repeat(x_start, times, axis=0)
        begin = time.thread_time()
        collide(shapes, posed, wide, work, before, thickness, friction, contacts)
        took.append(time.thread_time() - begin)
    return 1e3 * float(np.median(took))


def within_box(step: tuple[Any, ...]) -> tuple[Any, ...]:
    """One step of `walked` without the shapes that are not near the box of all particles."""
    shapes, posed, sides, x, x_start, thickness, friction = step
    low, high = x.min(axis=0), x.max(axis=0)
    margin = 0.125 * float((high - low).max()) + (1.0 + DIAGONAL) * thickness
    near = (posed.box[:, :3] - margin <= high) & (posed.box[:, 3:] + margin >= low)
    kept = np.flatnonzero(near.all(axis=1))
    per_shape = ("kind", "collider", "size", "hull", "bound", "box")
    fewer = shapes._replace(
        **{f: np.ascontiguousarray(getattr(shapes, f)[kept]) for f in per_shape}
    )
    return (
        fewer,
        PosedShapes(*(np.ascontiguousarray(a[kept]) for a in posed)),
        Sides(np.ascontiguousarray(sides.side[kept]), np.ascontiguousarray(sides.mixed[:, kept])),
        *(x, x_start, thickness, friction),
    )


def culled(steps: list[Any], rounds: int = 30) -> dict[str, float]:
    """Median milliseconds per step with all shapes and with those within the garment's box."""
    variants = {"all shapes": steps, "within its box": [within_box(s) for s in steps]}
    contacts = Contacts.room_for(len(steps[0][3]), len(steps[0][0].kind))
    took: dict[str, list[float]] = {name: [] for name in variants}
    results: dict[str, list[Any]] = {}
    for _ in range(rounds):
        for name, ones in variants.items():
            work = [s[3].copy() for s in ones]
            begin = time.thread_time()
            for s, x in zip(ones, work):
                collide(s[0], s[1], s[2], x, s[4], s[5], s[6], contacts)
            took[name].append(time.thread_time() - begin)
            results[name] = work
    one, other = results.values()
    assert all(np.array_equal(a, b) for a, b in zip(one, other))
    left = np.mean([len(s[0].kind) for s in variants["within its box"]])
    return {name: 1e3 * float(np.median(t)) / len(steps) for name, t in took.items()} | {
        "shapes": len(steps[0][0].kind),
        "shapes within its box": float(left),
    }


def contact() -> dict[str, Any]:
    """Milliseconds of collision per step: T-shirt and skirt on the walking mannequin."""
    results: dict[str, dict[str, float]] = {}
    body = load_body("mannequin")
    sets = collider_sets(body)
    sets["14 hulls and spheres"] = fit_hulls(
        body, HullSettings(merge=0.032, split=1.0, joints="spheres")
    ).colliders
    for faces in (40, 80, 160):
        sets[f"hull, {faces} faces"] = fit_hulls(body, HullSettings(max_faces=faces)).colliders
    for count in _VERTICES:
        finer = load_body(f"mannequin:vertices={count}")
        sets[f"body of {len(finer.skin.vertices)} vertices"] = fit_hulls(finer).colliders
    outfits = load_outfit("tshirt_short_skirt", body).garments
    steps = {name: walked(outfits, colliders, body) for name, colliders in sets.items()}
    # The clock of a busy machine drifts: in turns, so that ratios stay.
    took: dict[tuple[str, str], list[float]] = {}
    simulation = Simulation(outfits, sets["hull"], solver="relaxation")
    with tempfile.TemporaryDirectory() as folder:
        units = [Unit(simulation, folder, garment.name) for garment in outfits]
    sweeps = []
    for turn in range(_TURNS):
        sweeps.append(1e3 * sum(unit.measure(10) for unit in units))
        for name, brought in steps.items():
            for garment, ones in brought.items():
                for times in (1, 10) if name == "hull" else (1,):
                    once = again(ones, times)
                    if turn:  # the first one warms up
                        took.setdefault((name, f"{garment} x {times}"), []).append(once)
    for name, colliders in sets.items():
        row = {key: float(np.median(v)) for (n, key), v in took.items() if n == name}
        row["both"] = sum(v for k, v in row.items() if k.endswith(" x 1"))
        row["in F"] = row["both"] / float(np.median(sweeps))
        shapes, posed = next(iter(steps[name].values()))[0][:2]
        still = ColliderPoses.identity(len(colliders))
        row["posing"] = 1e3 * median(
            30, lambda s=shapes, p=still, q=posed: pose(s, p, p, np.zeros(3), q)
        )
        kinds = [c.kind for c in colliders.colliders]
        results[name] = row
        print(
            f"{name} ({kinds.count('hull')} hulls, {kinds.count('sphere')} spheres, "
            f"{kinds.count('capsule')} capsules): "
            + "; ".join(f"{k} {v:.3f}{'' if k == 'in F' else ' ms'}" for k, v in row.items())
        )
    print(f"F: {float(np.median(sweeps)):.3f} ms")
    for garment, ones in steps["hull"].items():
        results[f"{garment} culled"] = culled(ones)
        print(f"{garment}: {results[f'{garment} culled']}")
    return results


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--json", action="store_true", help="print one JSON object last")
    options = parser.parse_args()
    results = contact()
    fine, coarse = results["hull, 160 faces"]["both"], results["hull, 80 faces"]["both"]
    print(f"twice the faces: {fine / coarse:.2f} times the cost")
    row = results["hull"]
    for name in [k.removesuffix(" x 1") for k in row if k.endswith(" x 1")]:
        ratio = row[f"{name} x 10"] / row[f"{name} x 1"]
        print(f"{name}, 10 times the particles: {ratio:.1f} times the cost")
    if options.json:
        print(json.dumps(results))


if __name__ == "__main__":
    main()
