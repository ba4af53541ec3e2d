"""Whether garments are worn right half a second after what makes clothes hard to simulate.

    python bench/stress.py [--body F ...] [--outfit F ...] [--clip F ...] [--variant V ...]
        [--seconds S] [--out DIR]

An avatar moves for a second, stops, and stands for 0.9 s, again and again; where a clip ends it is
played back and forth. Through the clock of `cloth_node`. Names of bodies, clips and outfits as in
`bench/worn.py`. Variants: `plain`; `2x`, at twice the speed; `15hz`, 15 poses a second; `stalls`,
in which the cloth does not step for the last 0.3 s of each motion; `busy`, on a machine that takes
1.5 times as long for a step as the step is, as one core does beside a busy one (always the same,
not measured).

Of each run a line: stops; `late`, those after which a limb runs through a garment (`pierced`) in
any frame shown from 0.5 s after the body stood; `back`, the longest time until none did;
`pierced`, share of all frames; `jump` (see `bench/jumps.py`) from one shown frame to the next,
where no more than two are missing between them; `kick`, the same in frames in which something was
mended and the next 0.3 s; counts.
"""

import argparse
import json
from pathlib import Path

import numpy as np
from breaking import Wearer
from jumps import JumpMeter
from worn import FRAME

from garment_sim_ros.colliders.skin_from_poses import SkinFromPoses
from garment_sim_ros.contact.pierced import PiercedSoFar
from garment_sim_ros.params import ClothNodeParameters
from garment_sim_ros.ros.cloth_stepper import ClothStepper
from garment_sim_ros.sim.simulation import Simulation
from garment_sim_ros.stamps import SECOND

MOVES, STANDS, EASE = 1.0, 0.9, 0.1
"""How long the body moves and stands, and how long it takes to start and to stop [s]."""
CALM = 0.5
STALL = 0.3
LOAD = 1.5
VARIANTS = ("plain", "2x", "15hz", "stalls", "busy")
BODIES = ("mannequin:height=1.75", "mh_female_young.glb", "CesiumMan.glb")
OUTFITS = ("tshirt_short_skirt", "tshirt_long_skirt", "trousers_female.obj")
CLIPS = (
    "deepmimic_spinkick.bvh",
    "rokoko_jesse_dance.bvh",
    "cmu_131_03_hop_spin.bvh",
    "deepmimic_cartwheel.bvh",
)


def clip_time(t: float, length: float, speed: float) -> float:
    """Time of the clip at a time of the play [s]; both begin with 0."""
    cycle, s = divmod(t, MOVES + STANDS)
    rise = min(s, EASE) ** 2 / (2 * EASE)
    fall = min(max(s - (MOVES - EASE), 0.0), EASE)
    steady = min(max(s - EASE, 0.0), MOVES - 2 * EASE)
    played = cycle * (MOVES - EASE) + rise + steady + fall - fall**2 / (2 * EASE)
    there = (speed * played) % (2 * length)
    return min(there, 2 * length - there)


class Machine:
    """A machine that takes some time for a step.

    Args:
        stepper: What it steps.
        load: Time for a step over the step's length; 0: none.
    """

    def __init__(self, stepper: ClothStepper, load: float) -> None:
        self._stepper = stepper
        self._load = load * SECOND
        self._free_at = 0.0

    def advance(self, now: int) -> bool:
        """Steps where it is free; whether the garments moved."""
        if now < self._free_at:
            return False
        stepper = self._stepper
        taken, simulation = 0.0, stepper.simulation
        kept = simulation.advance, simulation.advance_coarsely

        def count(step):
            def counted(*args):
                nonlocal taken
                _start, _end, dt, *times = args
                taken += dt / (times or [1])[0]
                step(*args)

            return counted

        simulation.advance, simulation.advance_coarsely = map(count, kept)
        try:
            moved = stepper.advance(stepper.target(now))
        finally:
            simulation.advance, simulation.advance_coarsely = kept
        self._free_at = now + taken * self._load
        return moved


def run(wearer: Wearer, variant: str) -> dict:
    """One clip."""
    names = [g.name for g in wearer.garments]
    simulation = Simulation(wearer.garments, wearer.colliders)
    every = 4 if variant == "15hz" else 1
    delay = every * FRAME if variant == "15hz" else 0.0
    stepper = ClothStepper.with_parameters(simulation, ClothNodeParameters(), delay=delay)
    machine = Machine(stepper, LOAD if variant == "busy" else 0.0)
    pierced, jumps = PiercedSoFar(wearer.colliders, names), JumpMeter(wearer.body.skin.vertices)
    skin = SkinFromPoses(wearer.colliders, wearer.body)
    triangles = {g.name: g.triangles for g in wearer.garments}
    back: dict[int, float] = {}
    frames = through = mended = shown_at = 0
    mended_at, jump, kick = -1.0, 0.0, 0.0
    for n, poses in enumerate(wearer.path):
        now, t = round(n * FRAME * SECOND), n * FRAME
        cycle, phase = divmod(t, MOVES + STANDS)
        if n % every == 0:
            stepper.add(now, poses, now)
        if variant == "stalls" and MOVES - STALL <= phase < MOVES:
            continue
        if not machine.advance(now) or stepper.is_behind:
            continue
        x = {name: simulation.positions(name).copy() for name in names}
        pierced.add(stepper.poses, {name: (x[name], triangles[name]) for name in names})
        frames, is_through = frames + 1, any(pierced.now.values())
        through += is_through
        if phase >= MOVES:
            back[int(cycle)] = phase - MOVES + FRAME if is_through else back.get(int(cycle), 0.0)
        if n - shown_at > 3:
            jumps.forget()
        shown_at = n
        far = jumps.add(skin.vertices(stepper.poses), x)
        count = sum(h.resets + h.rewound + h.rewound_parts for h in map(simulation.health, names))
        mended_at = t if count != mended else mended_at
        mended, jump = count, max(jump, far)
        kick = max(kick, far) if mended_at >= 0.0 and t - mended_at <= 0.3 else kick
    health = [simulation.health(name) for name in names]
    return {
        "stops": len(back),
        "late": sum(s > CALM for s in back.values()),
        "back_s": round(max(back.values(), default=0.0), 2),
        "pierced": round(through / max(frames, 1), 4),
        "jump_cm": round(100 * jump, 1),
        "kick_cm": round(100 * kick, 1),
        **{k: sum(getattr(h, k) for h in health) for k in ("resets", "rewound", "rewound_parts")},
        "put_on": stepper.resets,
        "coarse_s": round(stepper.coarse / SECOND, 2),
        "skipped_s": round(stepper.skipped / SECOND, 2),
    }


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--body", nargs="*", default=list(BODIES))
    parser.add_argument("--outfit", nargs="*", default=list(OUTFITS))
    parser.add_argument("--clip", nargs="*", default=list(CLIPS))
    parser.add_argument("--variant", nargs="*", default=list(VARIANTS), choices=VARIANTS)
    parser.add_argument("--seconds", type=float, default=4 * (MOVES + STANDS))
    parser.add_argument("--out", type=Path, default=Path("out/stress"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    key = ("body", "outfit", "clip", "variant", "seconds")
    file = options.out / "runs.jsonl"
    rows = [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []
    done = {tuple(row[k] for k in key) for row in rows}
    for body in options.body:
        for outfit in options.outfit:
            for clip in options.clip:
                wearers: dict[float, Wearer] = {}
                for variant in options.variant:
                    asked = (body, outfit, clip, variant, options.seconds)
                    if asked in done:
                        continue
                    speed = 2.0 if variant == "2x" else 1.0
                    if speed not in wearers:
                        wearers[speed] = Wearer(
                            body,
                            outfit,
                            clip,
                            options.out,
                            options.seconds,
                            lambda t, length, speed=speed: clip_time(t, length, speed),
                        )
                    row = dict(zip(key, asked, strict=True))
                    row |= run(wearers[speed], variant)
                    rows.append(row)
                    with file.open("a") as out:
                        out.write(json.dumps(row) + "\n")
                    print(", ".join(f"{k} {v}" for k, v in row.items()), flush=True)
    print(table(rows))


def table(rows: list[dict]) -> str:
    """Markdown: a line for each variant and body."""
    lines = [
        "| variant | body | stops | late | back, longest | pierced, mean | jump | kick |"
        " wound back, whole + part | put on | coarse, skipped |",
        "|---" * 11 + "|",
    ]
    for variant in VARIANTS:
        for body in sorted({row["body"] for row in rows}):
            some = [r for r in rows if (r["variant"], r["body"]) == (variant, body)]
            if not some:
                continue
            total = {
                k: sum(r[k] for r in some) for k in some[0] if not isinstance(some[0][k], str)
            }
            most = {k: max(r[k] for r in some) for k in ("back_s", "jump_cm", "kick_cm")}
            cells = [
                variant,
                body.removesuffix(".glb"),
                str(total["stops"]),
                str(total["late"]),
                f"{most['back_s']:.2f} s",
                f"{100 * np.mean([r['pierced'] for r in some]):.1f} %",
                f"{most['jump_cm']:.0f} cm",
                f"{most['kick_cm']:.0f} cm",
                f"{total['rewound']} + {total['rewound_parts']}",
                str(total["put_on"]),
                f"{total['coarse_s']:.1f}, {total['skipped_s']:.1f} s",
            ]
            lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
