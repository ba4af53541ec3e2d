"""Garments that are broken on purpose, each cause by itself, and whether they come back.

    python bench/breaking.py [--body F ...] [--outfit F ...] [--clip F ...] [--cause C ...]
        [--out DIR] [--pictures]

An avatar plays a clip through the clock of `cloth_node`. After a second something breaks (what a
limb does to a garment: when, in the second before that or the half after, the limb is nearest to
it); then the clip goes on as before. Names of bodies, clips and outfits as in `bench/worn.py`.

Of each cause a line: `back`, the time after the cause has ended from which no limb runs through a
garment (`pierced`, or at the joint of a limb) that does not without it; of the second from 0.5 s
on: frames with such a limb; longest edge, share of the area inside of the skin, distance of the
garments from where they are without the cause (95th percentile of the vertices); `jump` (see
`bench/jumps.py`) of all frames after the cause, in which garments are mended, too; `home`, the
same of the frames in which a garment was wound back or on its way; `plain`, the same as `jump` of
the same frames without the cause; what was counted.
"""

import argparse
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from causes import CAUSES, Cause
from jumps import JumpMeter
from worn import FRAME, found, outfit_file

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.retargeting import Retargeter
from garment_sim_ros.body.skinning import Skinner
from garment_sim_ros.colliders.fitting import fit_colliders
from garment_sim_ros.colliders.posing import ColliderPoser
from garment_sim_ros.contact.cores import Cores
from garment_sim_ros.contact.pierced import PiercedSoFar
from garment_sim_ros.errors import MessageError
from garment_sim_ros.garment.colours import garment_colour
from garment_sim_ros.garment.outfit import load_outfit
from garment_sim_ros.garment.outfit_file import read_outfit
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.mocap.clips import load_clip
from garment_sim_ros.mocap.sampling import ClipSampler
from garment_sim_ros.params import ClothNodeParameters
from garment_sim_ros.recording.metrics import GarmentMesh
from garment_sim_ros.recording.previews import Figure, Look, moments
from garment_sim_ros.ros.cloth_stepper import ClothStepper
from garment_sim_ros.sim.joint_links import JointLinks
from garment_sim_ros.sim.placement import rest_transforms
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.stamps import SECOND

_SHOWN = 20
"""Frames that are to be there before it breaks."""
BREAK, CALM, END = 1.0, 0.5, 1.5
"""When it breaks; how long after that garments are judged, and until when [s]."""


@dataclass
class Frames:
    """What a run showed, frame by frame."""

    number: list[int] = field(default_factory=list)
    garments: list[dict] = field(default_factory=list)
    through: list[set] = field(default_factory=list)
    edge: list[float] = field(default_factory=list)
    jump: list[float] = field(default_factory=list)
    goes_home: list[bool] = field(default_factory=list)
    counts: dict = field(default_factory=dict)


class Wearer:
    """An avatar that plays a clip again and again.

    Args:
        body: A body, see `bench/worn.py`.
        outfit: An outfit.
        clip: A clip.
        folder: Where outfits of meshes are written.
        seconds: How much is played.
        clip_time: Time of the clip at a time of the play [s]; None: the clip as it is.
    """

    def __init__(
        self,
        body: str,
        outfit: str,
        clip: str,
        folder: Path,
        seconds: float = BREAK + END + 1.2,
        clip_time: Callable[[float, float], float] | None = None,
    ) -> None:
        self.body = load_body(found(body, "bodies"))
        mocap = load_clip(found(clip, "mocap"))
        retargeter = Retargeter(
            mocap.rig,
            self.body,
            T_world_source=mocap.T_world_file,
            reference=mocap.source_reference,
        )
        source = outfit_file(outfit, folder)
        self.colliders = fit_colliders(self.body, read_outfit(source).colliders)
        self.garments = load_outfit(source, self.body, colliders=self.colliders).garments
        sampler = ClipSampler(mocap)
        begin, length = float(mocap.times[0]), float(mocap.times[-1] - mocap.times[0])
        count = int((seconds if clip_time else min(seconds, length)) / FRAME)
        times = [clip_time(n * FRAME, length) if clip_time else n * FRAME for n in range(count)]
        self.joints = [
            retargeter.world_joints(sampler.sample(begin + t), n * FRAME).copy()
            for n, t in enumerate(times)
        ]
        poser = ColliderPoser(self.colliders, self.body)
        self.path = [poser.poses(T).copy() for T in self.joints]
        self.skinner = Skinner(self.body.skin)
        self.meshes = {g.name: GarmentMesh.of(g) for g in self.garments}
        self.simulation = Simulation(self.garments, self.colliders)
        self.links = JointLinks(self.colliders, rest_transforms(self.garments, self.colliders))
        self.stepper: ClothStepper
        self.shown: list[dict] = []

    def begin(self, cause: Cause, without: Frames) -> float:
        """When a cause acts [s]: where a limb does it, when it is nearest to the garment."""
        if cause.limb is None:
            return BREAK
        bone, garment = cause.limb
        cores = Cores.of(self.colliders)
        name = self.body.humanoid.get(bone, bone)
        mine = [k for k, b in enumerate(cores.bone) if b in (bone, name)]
        near: dict[int, float] = {}
        for n, x in zip(without.number, without.garments, strict=True):
            if 0.0 <= n * FRAME <= BREAK + 0.5 and n >= _SHOWN:
                middle = cores.posed(self.path[n])[mine].mean(axis=1)
                of = next(points for key, points in x.items() if garment in key)
                near[n] = float(np.linalg.norm(of[:, None] - middle, axis=2).min())
        return min(near, key=near.__getitem__) * FRAME

    def play(self, cause: Cause | None, begin: float = BREAK) -> Frames:
        """One run."""
        simulation = self.simulation = Simulation(self.garments, self.colliders)
        self.stepper = stepper = ClothStepper.with_parameters(
            simulation,
            ClothNodeParameters(),
            delay=0.0,
            on_teleport=cause.on_teleport if cause else "reset",
        )
        frames, jumps = Frames(), JumpMeter(self.body.skin.vertices)
        pierced = PiercedSoFar(self.colliders, [g.name for g in self.garments])
        self.shown = []
        for n, poses in enumerate(self.path):
            now, since = round(n * FRAME * SECOND), n * FRAME - begin
            acts = cause is not None and -1e-6 < since < cause.lasts - 1e-6
            if cause and cause.state and abs(since) < 1e-6:
                cause.state(self)
            sent = cause.poses(poses, n) if acts and cause.poses else poses
            if not acts or cause.sends:
                try:
                    stepper.add(now, sent, now)
                except MessageError as error:
                    print("  rejected:", error.reason)
            if acts and (cause.every == 0 or n % cause.every):
                continue
            try:
                stepper.advance(stepper.target(now))
            except MessageError as error:
                print("  refused:", error.reason)
                continue
            if stepper.is_behind:
                continue
            self._look(n, frames, jumps, pierced)
        frames.counts = self._counts()
        return frames

    def _look(self, n: int, frames: Frames, jumps: JumpMeter, pierced: PiercedSoFar) -> None:
        x = {g.name: self.simulation.positions(g.name).copy() for g in self.garments}
        self.shown.append(x)
        at = round(self.stepper.time / SECOND / FRAME)
        at = min(at, len(self.path) - 1)
        pierced.add(self.stepper.poses, {g.name: (x[g.name], g.triangles) for g in self.garments})
        if frames.number and at - frames.number[-1] > 1:
            jumps.forget()
        frames.number.append(at)
        frames.garments.append(x)
        through = {(k, b) for k, bones in pierced.now.items() for b in bones}
        for g in self.garments:
            links = self.links.through(x[g.name], g.triangles, self.stepper.poses)
            through |= {(g.name, f"joint {link}") for link in links.tolist()}
        frames.through.append(through)
        frames.jump.append(jumps.add(self.skinner.vertices(self.joints[at]), x))
        frames.goes_home.append(any(self.simulation[k].worn.on_its_way.left > 0.0 for k in x))
        frames.edge.append(
            max(float(self.meshes[k].strain(v.astype(float)).max()) for k, v in x.items())
        )

    def _counts(self) -> dict[str, int]:
        health = [self.simulation.health(g.name) for g in self.garments]
        names = ("resets", "recovered", "rewound", "rewound_parts", "not_rewound")
        counts = {k: sum(getattr(h, k, 0) for h in health) for k in names}
        counts["put_on"] = self.stepper.resets
        return counts

    def inside(self, frame: int, x: Mapping) -> float:
        """Largest share of a garment's area that is inside of the skin."""
        skin = self.skinner.vertices(self.joints[frame])
        distance = MeshDistance(skin, self.body.skin.triangles)
        return max(
            mesh.inside(distance.signed_distance(mesh.samples(x[name].astype(float)))[0])
            for name, mesh in self.meshes.items()
        )


def draw(wearer: Wearer, frames: Frames, begin: float, ended: float, path: Path) -> None:
    """A sheet: before it breaks, and some moments after the cause has ended."""

    def figure(time: float) -> Figure:
        k = int(np.argmin(np.abs(np.array(frames.number) * FRAME - time)))
        T = wearer.joints[frames.number[k]]
        root = wearer.body.rig.index(wearer.body.humanoid["hips"])
        return Figure(
            skin=wearer.skinner.vertices(T).copy(),
            garments=tuple(np.asarray(x, float) for x in frames.garments[k].values()),
            root=T[root, :3, 3].copy(),
            heading=0.6,
        )

    look = Look(
        skin_triangles=wearer.body.skin.triangles,
        garment_triangles=tuple(g.triangles for g in wearer.garments),
        garment_colours=tuple(garment_colour(n) for n in range(len(wearer.garments))),
        floor=float(wearer.skinner.vertices(wearer.joints[0])[:, 2].min()),
    )
    after = (0.0, 0.1, 0.2, 0.3, 0.35, 0.4, 0.5, 1.0)
    times = [begin - 0.05, *(ended + t for t in after)]
    path.parent.mkdir(parents=True, exist_ok=True)
    moments([figure(t) for t in times], look, path, size=(220, 320))


def judge(wearer: Wearer, cause: Cause, without: Frames, picture: Path | None) -> dict:
    """The line of one cause."""
    begin = wearer.begin(cause, without)
    frames = wearer.play(cause, begin)
    ended = begin + cause.lasts
    if picture is not None:
        draw(wearer, frames, begin, ended, picture)
    at = {n: k for k, n in enumerate(without.number)}
    last_bad, bad, off, edge, inside, jump, plain, home = 0.0, 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k, n in enumerate(frames.number):
        since = n * FRAME - ended
        if since < -1e-6 or since > END or n not in at:
            continue
        same = without.garments[at[n]]
        through = frames.through[k] - without.through[at[n]]
        if through:
            last_bad = since + FRAME
        if since > 1.5 * FRAME:
            jump, plain = max(jump, frames.jump[k]), max(plain, without.jump[at[n]])
            # The last frame of a way is one in which it has ended.
            home = max(home, frames.jump[k]) if any(frames.goes_home[k - 1 : k + 1]) else home
        if since < CALM:
            continue
        bad += bool(through)
        edge = max(edge, frames.edge[k])
        away = [np.linalg.norm(x - same[g], axis=1) for g, x in frames.garments[k].items()]
        off = max(off, float(np.percentile(np.concatenate(away), 95)))
        if n % 10 == 0:
            inside = max(inside, wearer.inside(n, frames.garments[k]))
    return {
        "back_s": round(last_bad, 2),
        "bad_frames": bad,
        "edge": round(edge, 2),
        "inside_%": round(100 * inside, 2),
        "off_cm": round(100 * off, 1),
        "jump_cm": round(100 * jump, 1),
        "home_cm": round(100 * home, 1),
        "plain_cm": round(100 * plain, 1),
        **frames.counts,
        "skipped_s": round(wearer.stepper.skipped / SECOND, 2),
    }


def main() -> None:
    """Breaks and prints."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--body", nargs="*", default=["mannequin:height=1.75"])
    parser.add_argument("--outfit", nargs="*", default=["tshirt_long_skirt"])
    parser.add_argument("--clip", nargs="*", default=["cmu_14_14_jumping_jacks_30fps.bvh"])
    parser.add_argument("--cause", nargs="*", default=list(CAUSES), choices=list(CAUSES))
    parser.add_argument("--out", type=Path, default=Path("out/breaking"))
    parser.add_argument("--pictures", action="store_true")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    with (options.out / "lines.jsonl").open("a") as out:
        for body in options.body:
            for outfit in options.outfit:
                for clip in options.clip:
                    wearer = Wearer(body, outfit, clip, options.out)
                    without = wearer.play(None)
                    for name in options.cause:
                        picture = (
                            options.out
                            / f"{Path(body).name.removesuffix('.glb')}_{outfit}_{name}.png"
                        )
                        line = judge(
                            wearer, CAUSES[name], without, picture if options.pictures else None
                        )
                        line = {"cause": name, **line}
                        words = ", ".join(f"{k} {v}" for k, v in line.items())
                        print(f"{body} {outfit} {clip}: {words}", flush=True)
                        row = {"body": body, "outfit": outfit, "clip": clip, **line}
                        out.write(json.dumps(row) + "\n")


if __name__ == "__main__":
    main()
