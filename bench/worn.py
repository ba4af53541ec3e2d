"""Whether garments stay worn: bodies, clips and outfits, by the measures of `docs/worn.md`.

    python bench/worn.py [--clip F ...] [--body F ...] [--outfit F ...] [--seconds 6] [--json]

Simulated offline at 60 frames a second, so without overload. Without options: the mannequin and
the bodies with a rig of the shared data, all its clips, the built-in outfits. A .obj as outfit is
a mesh of the shared data's folder of garments; several joined by + are worn one over the other.
"""

import argparse
import itertools
import json
import os
import tempfile
import time
from pathlib import Path

import numpy as np

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.retargeting import Retargeter
from garment_sim_ros.body.skinning import Skinner
from garment_sim_ros.colliders.fitting import fit_colliders
from garment_sim_ros.colliders.posing import ColliderPoser
from garment_sim_ros.contact.pierced import PiercedMeter
from garment_sim_ros.garment.outfit import load_outfit
from garment_sim_ros.mocap.clips import load_clip
from garment_sim_ros.mocap.sampling import ClipSampler
from garment_sim_ros.recording.metrics import ClothMeter, GarmentMesh
from garment_sim_ros.sim.simulation import Simulation

FRAME = 1 / 60
DATA = Path(os.environ.get("GARMENT_SIM_DATA") or Path(__file__).parents[2] / "shared" / "data")
BODIES = ("mannequin", "mh_female_young.glb", "CesiumMan.glb")
OUTFITS = ("tshirt_short_skirt", "tshirt_long_skirt")


def found(name: str, folder: str) -> str:
    """The path of a name of the shared data, or the name itself."""
    path = DATA / folder / name
    return str(path) if path.is_file() else name


def outfit_file(name: str, folder: Path) -> str:
    """An outfit, of mesh files where the name ends so."""
    if not name.endswith(".obj"):
        return name
    meshes = [Path(found(part, "garments")).resolve() for part in name.split("+")]
    lines = ["version: 1", "garments:"]
    for layer, mesh in enumerate(meshes):
        kind = "polyester" if "skirt" in mesh.stem or "trousers" in mesh.stem else "cotton_jersey"
        lines += [f"  - name: {mesh.stem.split('_')[0]}", f"    mesh: {mesh}"]
        lines += [f"    material: {kind}", f"    layer: {layer}"]
    path = folder / (name.replace("/", "_") + ".yaml")
    path.write_text("\n".join(lines) + "\n")
    return str(path)


def run(body_name: str, clip_name: str, outfit: str, seconds: float, solver: dict) -> dict:
    """Plays one clip and gives the figures."""
    body, clip = load_body(found(body_name, "bodies")), load_clip(found(clip_name, "mocap"))
    retargeter = Retargeter(
        clip.rig, body, T_world_source=clip.T_world_file, reference=clip.source_reference
    )
    colliders = fit_colliders(body)
    with tempfile.TemporaryDirectory() as folder:
        source = outfit_file(outfit, Path(folder))
        garments = load_outfit(source, body, colliders=colliders).garments
    poser, skinner = ColliderPoser(colliders, body), Skinner(body.skin)
    length = min(seconds, float(clip.times[-1] - clip.times[0]))
    sampler = ClipSampler(clip)
    joints = [
        retargeter.world_joints(sampler.sample(float(clip.times[0]) + n * FRAME)).copy()
        for n in range(max(2, int(length / FRAME)))
    ]
    path = [poser.poses(T).copy() for T in joints]
    simulation = Simulation(garments, colliders, **solver)
    simulation.reset(path[0])
    meshes = {g.name: GarmentMesh.from_rest(g.vertices, g.triangles) for g in garments}
    meter = ClothMeter(body.skin.vertices, body.skin.triangles, meshes)
    pierced = PiercedMeter(colliders)
    times = []
    for n, (start, end) in enumerate(itertools.pairwise(path), start=1):
        begin = time.thread_time()
        simulation.advance(start, end, FRAME)
        times.append(time.thread_time() - begin)
        x = {g.name: simulation.positions(g.name) for g in garments}
        pierced.add(end, {g.name: (x[g.name], g.triangles) for g in garments})
        if n % 6 == 0:
            meter.add(
                skinner.vertices(joints[n]).copy(), {k: v.astype(float) for k, v in x.items()}
            )
    result = pierced.result()
    return {
        "body": Path(body_name).stem,
        "clip": Path(clip_name).stem,
        "outfit": outfit,
        "frames": result.frames,
        "pierced": round(result.share, 4),
        **{k: v for k, v in meter.result().items() if not k.startswith("gap")},
        "resets": sum(simulation.health(g.name).resets for g in garments),
        "let_go": max(simulation.health(g.name).let_go for g in garments),
        "ms_median": round(1e3 * float(np.median(times)), 2),
        "by_bone": result.by_bone,
    }


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--clip", nargs="*")
    parser.add_argument("--body", nargs="*", default=BODIES)
    parser.add_argument("--outfit", nargs="*", default=OUTFITS)
    parser.add_argument("--solver", default="xpbd")
    parser.add_argument("--seconds", type=float, default=6.0)
    parser.add_argument("--json", action="store_true", help="print one JSON object a run")
    options = parser.parse_args()
    clips = options.clip or sorted(p.name for p in (DATA / "mocap").glob("*.bvh")) or ["walk"]
    for body, outfit, clip in itertools.product(options.body, options.outfit, clips):
        try:
            row = run(body, clip, outfit, options.seconds, {"solver": options.solver})
        except Exception as error:  # a run that cannot be made is a row, too
            row = {"body": body, "clip": clip, "outfit": outfit, "error": str(error)}
        if options.json:
            print(json.dumps(row), flush=True)
            continue
        figures = [f"{k} {v}" for k, v in row.items() if k not in ("body", "clip", "outfit")]
        print(f"{row['body']} {row['outfit']} {row['clip']}: {', '.join(figures)}", flush=True)


if __name__ == "__main__":
    main()
