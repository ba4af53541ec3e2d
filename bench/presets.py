"""What each preset costs and gives: the figures in the heads of ``config/presets``.

    python bench/presets.py [--preset fast balanced accurate] [--set NODE.PARAM=VALUE ...]
        [--body F] [--clip F ...] [--seconds 3] [--write]

A T-shirt and a short skirt of 1,503 and 1,687 vertices on the mannequin, or `--body`, at 60 frames
a second or the rate that a preset says: the built-in walk, and a cartwheel of the shared data
where it is there ($GARMENT_SIM_DATA), else the walk at twice the speed. Cost is processor time of
a frame of one thread, all contacts included, its median; all presets take turns, so that their
ratios hold on a busy machine. A ratio is that of the cost of a second.
Stretch of mesh edges and `inside` are taken 10 times a second after the first half second;
`pierced` is the share of all frames. Skin follows the bones as the preset says. Each ``--set`` is
measured beside the presets, as balanced but for what it says. ``--write`` puts the figures into
the heads of the presets' files.
"""

import argparse
import json
import os
import subprocess
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import garment_sim_ros as gs
from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.skin import Body
from garment_sim_ros.contact.pierced import PiercedMeter
from garment_sim_ros.contact.shapes import ColliderSet
from garment_sim_ros.declaration import validated
from garment_sim_ros.params import PRESETS, ClothNodeParameters, ColliderOptions, Environment
from garment_sim_ros.presets import Choice, chosen, preset_file
from garment_sim_ros.recording.metrics import ClothMeter, GarmentMesh
from garment_sim_ros.recording.own_sides import OwnSides
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.sim.solvers import SOLVERS, longest_step
from garment_sim_ros.tradeoff.sewn import sewn_on

RATE, MEASURED, SKIPPED = 60.0, 0.1, 0.5
OUTFIT = "tshirt_short_skirt"
PATTERN = "pattern:"
POINTS = [name for name in PRESETS if name != "auto"]
MARK = "#: "
"""What a line of a file's head begins with that this program writes."""


@dataclass
class Clip:
    """What is played, from where on, how fast."""

    name: str
    source: str
    begin: float = 0.0
    speed: float = 1.0


def clips(given: list[str]) -> list[Clip]:
    """The clips asked for; else the walk and a harder one."""
    if given:
        return [Clip(Path(name).stem, name) for name in given]
    cartwheel = Path(os.environ.get("GARMENT_SIM_DATA", "")) / "mocap" / "deepmimic_cartwheel.bvh"
    walk = Clip("walk", "walk")
    if cartwheel.is_file():
        return [walk, Clip("cartwheel", str(cartwheel))]
    return [walk, Clip("walk at twice the speed", "walk", speed=2.0)]


Change = Callable[[Body, ColliderSet], ColliderSet]


@cache
def dressed(
    body: str,
    outfit_json: str,
    options: ColliderOptions,
    attachments: str,
    skinning: str,
    change: Change | None = None,
) -> tuple[gs.Avatar, gs.Outfit]:
    """A body with colliders, or what `change` makes of them, and its outfit.

    ``pattern:`` and a name are one of our own sewing patterns.
    """
    outfit = json.loads(outfit_json)
    avatar = gs.Avatar.load(body, **vars(options))
    wearer = replace(avatar.body, skinning=skinning)
    colliders = change(wearer, avatar.colliders) if change else avatar.colliders
    avatar = gs.Avatar(wearer, colliders, attachments=attachments)
    if isinstance(outfit, str) and outfit.startswith(PATTERN):
        return avatar, sewn_on(avatar, outfit.removeprefix(PATTERN))
    return avatar, avatar.dress(outfit)


class Wearer:
    """One preset on its own colliders, worn through a clip, or at rest where there is none."""

    def __init__(
        self,
        choice: Choice,
        clip: Clip | None,
        seconds: float,
        body: str,
        outfit: str | Mapping[str, Any] = OUTFIT,
        change: Change | None = None,
    ) -> None:
        options = validated(ColliderOptions, choice.values("collider_node", ColliderOptions))
        node = validated(ClothNodeParameters, choice.values("cloth_node", ClothNodeParameters))
        self.frame_time = 1.0 / node.rate
        how = options, node.attachments, node.skinning, change
        self.avatar, worn = dressed(body, json.dumps(outfit), *how)
        if clip is None:
            rest = rest_transforms(self.avatar.body.rig)
            self.joints = [rest] * (round(seconds * node.rate) + 1)
        else:
            self.joints = list(
                self.avatar.joints(
                    clip.source, node.rate / clip.speed, seconds=seconds * clip.speed
                )
            )
        colliders = self.avatar.colliders
        garments = worn.garments
        group = SOLVERS[choice.solver].settings
        self.simulation = Simulation(
            garments,
            colliders,
            environment=validated(Environment, choice.values("cloth_node", Environment)),
            solver=choice.solver,
            settings=validated(group, choice.values("cloth_node", group)),
            solver_step=longest_step(choice.solver, node.solver_step),
            detail=node.detail,
        )
        skin = self.avatar.body.skin
        meshes = {g.name: GarmentMesh.of(g) for g in garments}
        self.garments = garments
        self.meter = ClothMeter(
            skin.vertices, skin.triangles, meshes, OwnSides.of(garments, self.avatar.body)
        )
        self.pierced = PiercedMeter(colliders)
        self.poses = [self.avatar.poses(T).copy() for T in self.joints]
        self.times: list[float] = []
        self.next, self.due = 1, SKIPPED
        self.simulation.reset(self.poses[0])

    def until(self, time: float) -> None:
        """All frames up to a time of the clip [s]."""
        while self.next < len(self.poses) and self.next * self.frame_time <= time + 1e-9:
            self.frame(self.next)
            self.next += 1

    def frame(self, n: int) -> None:
        """From frame n - 1 to frame n."""
        began = time.thread_time()
        self.advance(n)
        self.times.append(time.thread_time() - began)
        x = {g.name: self.simulation.positions(g.name) for g in self.garments}
        self.pierced.add(self.poses[n], {g.name: (x[g.name], g.triangles) for g in self.garments})
        if n * self.frame_time >= self.due - 1e-9:
            self.due += MEASURED
            skin = self.avatar.skin(self.joints[n])
            self.meter.add(skin, {name: v.astype(float) for name, v in x.items()})

    def advance(self, n: int) -> None:
        """What of a frame is timed."""
        self.simulation.advance(self.poses[n - 1], self.poses[n], self.frame_time)

    def share_of_a_core(self) -> float:
        """Median cost of a frame over the time that it shows."""
        return float(np.median(self.times)) / self.frame_time

    def figures(self) -> dict[str, float]:
        """What came of it."""
        result = self.meter.result()
        health = [self.simulation.health(g.name) for g in self.garments]
        return {
            "ms": 1e3 * float(np.median(self.times)),
            "rate": 1.0 / self.frame_time,
            "ms_p95": 1e3 * float(np.percentile(self.times, 95)),
            "strain_p95": result["strain_p95"],
            "strain_max": result["strain_max"],
            "pierced": self.pierced.result().share,
            "inside_p99": result["inside_p99"],
            "gap_mm": result["gap_mm_median"],
            "resets": sum(h.resets + h.rewound + h.rewound_parts for h in health),
        }


def play(
    choices: dict[str, Choice], clip: Clip, seconds: float, body: str
) -> dict[str, dict[str, Any]]:
    """All presets through a clip, in turns; figures by preset, `ratio` over the second of them."""
    wearers = {name: Wearer(choice, clip, seconds, body) for name, choice in choices.items()}
    for n in range(1, round(seconds * RATE) + 1):
        for wearer in wearers.values():
            wearer.until(n / RATE)
    base = wearers.get("balanced") or next(iter(wearers.values()))
    return {
        name: w.figures() | {"ratio": w.share_of_a_core() / base.share_of_a_core()}
        for name, w in wearers.items()
    }


def in_words(clip: Clip, f: dict[str, Any]) -> str:
    """One clip's figures."""
    rate = "" if f["rate"] == RATE else f" of {1e3 / f['rate']:.0f} ms"
    return (
        f"{clip.name}: {f['ms']:.2f} ms a frame{rate} (p95 {f['ms_p95']:.2f}), "
        f"{f['ratio']:.2f} of balanced; stretch p95 {100 * f['strain_p95']:.1f} %, largest "
        f"{100 * f['strain_max']:.0f} %; pierced {100 * f['pierced']:.1f} %, inside p99 "
        f"{100 * f['inside_p99']:.2f} %; gap {f['gap_mm']:.1f} mm; mended {f['resets']}"
    )


def write(name: str, lines: list[str]) -> None:
    """Puts figures into the head of a preset's file."""
    path = preset_file(name)
    text = [line for line in path.read_text().splitlines() if not line.startswith(MARK)]
    place = next(i for i, line in enumerate(text) if not line.startswith("#"))
    text[place:place] = [MARK + line for line in lines]
    path.write_text("\n".join(text) + "\n")


def commit() -> str:
    """What was measured."""
    words = ["git", "-C", str(Path(__file__).parent), "rev-parse", "--short=7", "HEAD"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    return done.stdout.strip() or "no commit"


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--preset", nargs="+", default=POINTS, choices=POINTS)
    parser.add_argument("--set", nargs="+", default=[], action="append", metavar="N.P=V")
    parser.add_argument("--clip", nargs="*", default=[])
    parser.add_argument("--body", default="mannequin")
    parser.add_argument("--seconds", type=float, default=3.0)
    parser.add_argument("--write", action="store_true", help="into the presets' files")
    options = parser.parse_args()
    choices = {name: chosen(name) for name in options.preset}
    # Each --set is a setting of its own beside the presets.
    choices |= {" ".join(words): chosen("balanced", words) for words in options.set}
    told: dict[str, list[str]] = {name: [] for name in choices}
    for clip in clips(options.clip):
        for name, figures in play(choices, clip, options.seconds, options.body).items():
            told[name].append(in_words(clip, figures))
            print(f"{name}: {told[name][-1]}", flush=True)
    if options.write:
        how = f"python bench/presets.py --seconds {options.seconds:g} --write, at {commit()}:"
        for name in options.preset:
            write(name, [how, *told[name]])


if __name__ == "__main__":
    main()
