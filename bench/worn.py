"""Whether garments stay worn: bodies, clips and outfits, by the measures of `docs/worn.md`.

    python bench/worn.py [--clip F ...] [--body F ...] [--outfit F ...] [--variant V ...]
        [--out DIR] [--jobs N] [--pictures] [--seconds S] [--solver S] [--preset P]
        [--set NODE.PARAM=VALUE ...]

Simulated offline, so without overload but where a variant asks for it. Without options: the
mannequin at three heights and the bodies with a rig of the shared data, all its clips in full, the
built-in outfits and the shared meshes. An outfit is the name of a built-in one; a .yaml file, such
as `garment-sim dress --body F` writes for the same body; or a .obj of the shared data's folder of
garments, of which several joined by + are worn one over the other.

Every run is a line of `DIR/runs.jsonl`; what is there is not run again. `DIR/worn.md` is the
table. Pictures: of each run five moments at even distances, and those that are worst by `pierced`,
longest edge, jump, hems that hands lift.

Variants: `plain`, 60 poses a second; `2x`, at twice the speed; `15hz`, 15 poses a second;
`stalls`, in which the cloth does not step for 0.3 s in every 1.5 s: what is pierced is counted
from 0.5 s after each. The last two go through the node's clock. At 15 poses a second the body is
where the node has it: poses in between are interpolated.
"""

import argparse
import itertools
import json
import os
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jumps import LIES, JumpMeter
from lifted import LiftMeter
from overlaps import OverlapMeter
from worn_table import table

from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.retargeting import Retargeter
from garment_sim_ros.body.skinning import Skinner
from garment_sim_ros.cli.processes import over_processes
from garment_sim_ros.colliders.fitting import fit_colliders
from garment_sim_ros.colliders.posing import ColliderPoser
from garment_sim_ros.contact.pierced import PiercedMeter, PiercedSoFar
from garment_sim_ros.declaration import declarations, validated
from garment_sim_ros.errors import GarmentSimError, ParameterError
from garment_sim_ros.garment.colours import garment_colour
from garment_sim_ros.garment.outfit import load_outfit
from garment_sim_ros.garment.outfit_file import read_outfit
from garment_sim_ros.geometry.transforms import (
    interpolate_poses,
    quaternion_from_matrix,
    transform_from,
)
from garment_sim_ros.mocap.clips import load_clip
from garment_sim_ros.mocap.sampling import ClipSampler
from garment_sim_ros.params import PRESETS, ClothNodeParameters, ColliderOptions, Environment
from garment_sim_ros.presets import Choice, chosen
from garment_sim_ros.recording.metrics import ClothMeter, GarmentMesh
from garment_sim_ros.recording.own_sides import OwnSides
from garment_sim_ros.recording.previews import Figure, Look, moments
from garment_sim_ros.ros.cloth_stepper import ClothStepper
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.sim.solvers import SOLVERS
from garment_sim_ros.stamps import SECOND

FRAME = 1 / 60
STALL, STALL_EVERY = 0.3, 1.5
CALM = 0.5  # after a stall, in which a garment may come back [s]
DATA = Path(os.environ.get("GARMENT_SIM_DATA") or Path(__file__).parents[2] / "shared" / "data")
MANNEQUINS = tuple(f"mannequin:height={height}" for height in ("1.50", "1.75", "1.95"))
BODIES = (*MANNEQUINS, "mh_female_young.glb", "CesiumMan.glb")
MADE_ON = "mh_female_young.glb"
SHIRT = "tshirt_female.obj"
MESHES = (f"{SHIRT}+skirt_short_female.obj", f"{SHIRT}+skirt_long_female.obj")
OUTFITS = ("tshirt_short_skirt", "tshirt_long_skirt", *MESHES, "trousers_female.obj")
VARIANTS = ("plain", "2x", "15hz", "stalls")
KEY = ("body", "outfit", "clip", "variant", "solver", "preset", "set", "seconds")


@dataclass(frozen=True)
class Asked:
    """One run."""

    body: str
    outfit: str
    clip: str
    variant: str
    solver: str
    preset: str
    set: tuple[str, ...]
    seconds: float
    pictures: str

    def key(self) -> list:
        """What a line of the table is known by."""
        values = [getattr(self, name) for name in KEY]
        return [list(value) if isinstance(value, tuple) else value for value in values]


@dataclass
class Frames:
    """What is kept of a run's frames, for pictures."""

    number: list[int] = field(default_factory=list)
    garments: list[tuple] = field(default_factory=list)
    bad: dict[str, tuple[float, int]] = field(default_factory=dict)

    def worst(self, what: str, value: float) -> None:
        """Remembers the latest frame if it is the worst by some measure."""
        if value > self.bad.get(what, (0.0, 0))[0]:
            self.bad[what] = (value, len(self.number) - 1)


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
    for mesh in meshes:
        kind = "polyester" if "skirt" in mesh.stem or "trousers" in mesh.stem else "cotton_jersey"
        lines += [f"  - name: {mesh.stem.split('_')[0]}", f"    mesh: {mesh}"]
        lines += [f"    material: {kind}"]
        lines += [f"    options: {{made_on: {found(MADE_ON, 'bodies')}}}"]
    path = folder / (name.replace("/", "_") + ".yaml")
    path.write_text("\n".join(lines) + "\n")
    return str(path)


def plain(simulation: Simulation, path: list, _: float) -> Iterator[tuple[int, bool]]:
    """Steps from frame to frame; yields each one's number, and whether it is calm."""
    simulation.reset(path[0])
    for n, (start, end) in enumerate(itertools.pairwise(path), start=1):
        simulation.advance(start, end, FRAME)
        yield n, True


def by_the_node(simulation: Simulation, path: list, every: int) -> Iterator[tuple[int, bool]]:
    """The same through the node's clock: poses every so many frames, or with stalls (0)."""
    delay = 0.0 if every == 0 else every * FRAME
    stepper = ClothStepper.with_parameters(simulation, ClothNodeParameters(), delay=delay)
    last_stall = -1.0
    for n, poses in enumerate(path):
        t = n * FRAME
        stamp = round(t * SECOND)
        if n % max(every, 1) == 0:
            stepper.add(stamp, poses, stamp)
        if every == 0 and t % STALL_EVERY > STALL_EVERY - STALL:
            last_stall = t
            continue
        if stepper.has_poses:
            stepper.advance(stepper.target(stamp))
            at = round(stepper.time / SECOND / FRAME)
            if n and at < len(path):
                yield at, t - last_stall > CALM or last_stall < 0.0


def as_known(joints: list, every: int) -> list:
    """The motion that a node knows of, which is told every so many of these transforms."""
    if every < 2:
        return joints
    told = [(T[:, :3, 3], quaternion_from_matrix(T[:, :3, :3])) for T in joints[::every]]
    known = []
    for n in range(len(joints)):
        before, after = told[n // every], told[min(n // every + 1, len(told) - 1)]
        position, orientation = np.empty_like(before[0]), np.empty_like(before[1])
        interpolate_poses(*before, *after, n % every / every, position, orientation)
        known.append(transform_from(position, orientation))
    return known


def run(asked: Asked) -> dict:
    """Plays one clip and gives the figures."""
    choice = choice_of(asked.preset, asked.solver, asked.set)
    body = load_body(found(asked.body, "bodies"))
    clip = load_clip(found(asked.clip, "mocap"))
    retargeter = Retargeter(
        clip.rig, body, T_world_source=clip.T_world_file, reference=clip.source_reference
    )
    with tempfile.TemporaryDirectory() as folder:
        source = outfit_file(asked.outfit, Path(folder))
        options = validated(ColliderOptions, choice.values("collider_node", ColliderOptions))
        options = read_outfit(source).colliders_on(options)
        colliders = fit_colliders(body, options)
        garments = load_outfit(source, body, colliders=colliders).garments
    poser, skinner = ColliderPoser(colliders, body), Skinner(body.skin)
    speed = 2.0 if asked.variant == "2x" else 1.0
    begin, length = float(clip.times[0]), float(clip.times[-1] - clip.times[0]) / speed
    sampler = ClipSampler(clip)
    count = max(2, int(min(asked.seconds or length, length) / FRAME))
    joints = [
        retargeter.world_joints(sampler.sample(begin + n * FRAME * speed), n * FRAME).copy()
        for n in range(count)
    ]
    steps = {"15hz": (by_the_node, 4), "stalls": (by_the_node, 0)}
    play, every = steps.get(asked.variant, (plain, 1))
    joints = as_known(joints, every)
    path = [poser.poses(T).copy() for T in joints]
    simulation = Simulation(garments, colliders, **choice.given("cloth_node"))
    meshes = {g.name: GarmentMesh.of(g) for g in garments}
    skin = (body.skin.vertices, body.skin.triangles)
    meter = ClothMeter(*skin, meshes, OwnSides.of(garments, body))
    overlaps = OverlapMeter(*skin, meshes)
    pierced, jumps = PiercedMeter(colliders), JumpMeter(body.skin.vertices)
    lying, lifts = JumpMeter(body.skin.vertices, LIES), LiftMeter(body, simulation)
    live = PiercedSoFar(colliders, [g.name for g in garments])
    calm_frames = calm_pierced = 0
    kept, times, edges = Frames(), [], []
    began = time.thread_time()
    for n, calm in play(simulation, path, every):
        times.append(time.thread_time() - began)
        x = {g.name: simulation.positions(g.name) for g in garments}
        posed = {g.name: (x[g.name], g.triangles) for g in garments}
        pierced.add(path[n], posed)
        live.add(path[n], posed)
        through = sum(map(len, live.now.values()))
        calm_frames += calm
        calm_pierced += calm and through > 0
        kept.number.append(n)
        kept.garments.append(tuple(a.astype(np.float32) for a in x.values()))
        worst = max(float(meshes[k].strain(v.astype(float)).max()) for k, v in x.items())
        edges.append(worst)
        surface = skinner.vertices(joints[n])
        if kept.number[-2:-1] != [n - 1]:
            jumps.forget()
            lying.forget()
        kept.worst("jump", jumps.add(surface, x))
        lying.add(surface, x)
        kept.worst("edge", worst)
        kept.worst("lifted", lifts.add(surface, x, path[n]))
        kept.worst("pierced", through)
        if len(kept.number) % 6 == 0:
            exact = {k: v.astype(float) for k, v in x.items()}
            meter.add(surface, exact)
            overlaps.add(surface, exact)
        began = time.thread_time()
    result = pierced.result()
    if asked.pictures:
        draw(asked, kept, joints, skinner, body, garments)
    figures = {k: v for k, v in meter.result().items() if not k.startswith("gap")}
    figures["strain_max"] = round(max(edges), 3)
    figures["inside_once_p99"] = round(overlaps.p99, 4)
    return {
        **dict(zip(KEY, asked.key())),
        "frames": result.frames,
        "pierced": round(result.share, 4),
        "pierced_calm": round(calm_pierced / max(calm_frames, 1), 4),
        **figures,
        "jump_cm": round(100 * jumps.largest, 1),
        "jump_frames": jumps.frames,
        "jump_lying_cm": round(100 * lying.largest, 1),
        "jump_lying_frames": lying.frames,
        "lifted": round(lifts.frames / max(len(edges), 1), 4),
        "lifted_most": round(lifts.largest, 3),
        "resets": sum(simulation.health(g.name).resets for g in garments),
        "let_go": max(simulation.health(g.name).let_go for g in garments),
        "ms_median": round(1e3 * float(np.median(times)), 2),
        "by_bone": result.by_bone,
    }


def draw(asked: Asked, kept: Frames, joints: list, skinner: Skinner, body, garments) -> None:
    """A sheet: moments at even distances, and the worst ones."""
    hips = body.humanoid.get("hips")
    root = body.rig.index(hips) if hips else 0
    forward = rest_transforms(body.rig)[root, 0, :3]  # in rest pose bodies face along x

    def figure(k: int) -> Figure:
        T = joints[kept.number[k]]
        facing = T[root, :3, :3] @ forward
        return Figure(
            skin=skinner.vertices(T).copy(),
            garments=tuple(np.asarray(x, float) for x in kept.garments[k]),
            root=T[root, :3, 3].copy(),
            heading=float(np.arctan2(facing[1], facing[0])),
        )

    even = [int((i + 0.5) / 5 * len(kept.number)) for i in range(5)]
    worst = [kept.bad.get(what, (0.0, 0))[1] for what in ("pierced", "edge", "jump", "lifted")]
    look = Look(
        skin_triangles=body.skin.triangles,
        garment_triangles=tuple(g.triangles for g in garments),
        garment_colours=tuple(garment_colour(n) for n in range(len(garments))),
        floor=float(min(skinner.vertices(joints[kept.number[k]])[:, 2].min() for k in even)),
    )
    # Bodies and clips may be paths, which would lead out of the folder.
    name = "_".join(Path(part).name for part in asked.key()[:4])
    for ending in (".obj", ".glb", ".bvh"):
        name = name.replace(ending, "")
    path = Path(asked.pictures) / f"{name}.png"
    path.parent.mkdir(parents=True, exist_ok=True)
    moments([figure(k) for k in even + worst], look, path, size=(200, 320))


def choice_of(preset: str, solver: str, words: Sequence[str]) -> Choice:
    """A preset with a solver, and single values for the simulation or the colliders.

    Raises:
        ParameterError: A word that is not allowed.
    """
    choice = chosen(preset, [f"cloth_node.solver={solver}", *words])
    if choice.solver != solver:
        raise ParameterError("--set cloth_node.solver", "is beside --solver", "allowed: --solver")
    used = {
        "collider_node": declarations(ColliderOptions),
        "cloth_node": {*declarations(SOLVERS[solver].settings), *declarations(Environment)}
        | {"solver", "solver_step", "detail"},
    }
    for node, single in choice.single.items():
        for name in single:
            if name not in used.get(node, ()):
                raise ParameterError(
                    f"--set {node}.{name}", "does nothing here", "allowed: others"
                )
    return choice


def row_of(asked: Asked) -> dict[str, object]:
    """What came of a run; a run that cannot be made is a row, too."""
    try:
        return run(asked)
    except Exception as error:
        return {**dict(zip(KEY, asked.key())), "error": f"{type(error).__name__}: {error}"}


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--clip", nargs="*")
    parser.add_argument("--body", nargs="*", default=BODIES)
    parser.add_argument("--outfit", nargs="*", default=OUTFITS)
    parser.add_argument("--variant", nargs="*", default=["plain"], choices=VARIANTS)
    parser.add_argument("--solver", default="xpbd", choices=tuple(SOLVERS))
    of_levels = [name for name in PRESETS if name != "auto"]
    parser.add_argument("--preset", default="balanced", choices=of_levels)
    parser.add_argument(
        "--set", nargs="+", action="extend", default=[], metavar="NODE.PARAM=VALUE"
    )
    parser.add_argument("--seconds", type=float, default=0.0, help="0: the whole clip")
    parser.add_argument("--out", type=Path, default=Path("out/worn"))
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--pictures", nargs="?", const="", help="folder; DIR/pictures without")
    options = parser.parse_args()
    clips = options.clip or sorted(p.name for p in (DATA / "mocap").glob("*.bvh")) or ["walk"]
    try:
        choice_of(options.preset, options.solver, options.set)
    except GarmentSimError as error:
        parser.error(str(error))
    options.out.mkdir(parents=True, exist_ok=True)
    file = options.out / "runs.jsonl"
    lines = file.read_text().splitlines() if file.exists() else []
    rows = [{"set": [], **json.loads(line)} for line in lines]
    rows = [row for row in rows if "error" not in row]  # tried anew where they are asked for
    done = [[row[name] for name in KEY] for row in rows]
    here = {None: "", "": str(options.out / "pictures")}
    how = (tuple(options.set), options.seconds, here.get(options.pictures, options.pictures))
    asked = [
        Asked(*of, options.solver, options.preset, *how)
        for of in itertools.product(options.body, options.outfit, clips, options.variant)
    ]
    left = [a for a in asked if a.key() not in done]
    with file.open("a") as out, closing(over_processes(row_of, left, options.jobs)) as made:
        for _, row in made:
            rows.append(row)
            out.write(json.dumps(row) + "\n")
            out.flush()
            print(", ".join(f"{k} {v}" for k, v in row.items()), flush=True)
            (options.out / "worn.md").write_text(table(rows))
    print(table(rows))
    failed = [row for row in rows if "error" in row]
    for row in failed:
        print(f"failed: {row['body']} {row['outfit']} {row['clip']}: {row['error']}")
    raise SystemExit(bool(failed))


if __name__ == "__main__":
    main()
