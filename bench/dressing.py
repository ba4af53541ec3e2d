"""Every pattern of our own on every human body: time and gates, as a table.

    python bench/dressing.py --body mannequin mh_female_young.glb [--garment tshirt] [--out F.md]
        [--pictures DIR]

Bodies without a folder are looked for in $GARMENT_SIM_DATA/bodies.
"""

import argparse
import os
import re
import time
from pathlib import Path

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.errors import GarmentSimError
from garment_sim_ros.garment.colours import garment_colour
from garment_sim_ros.garment.patterns.gates import LIMITS
from garment_sim_ros.garment.patterns.making import DRAFTS, Model, make
from garment_sim_ros.recording.dress_pictures import dressed_picture

BODIES = (
    "mannequin",
    "mannequin:height=1.45,build=0",
    "mannequin:height=1.45,build=1",
    "mannequin:height=1.70,build=0,sex=1",
    "mannequin:height=1.70,build=1",
    "mannequin:height=2.0,build=0",
    "mannequin:height=2.0,build=1,sex=1",
    "mh_female_young.glb",
    "CesiumMan.glb",
    "f_smpl_average_A40.obj",
    "m_smpl_average_A40.obj",
    "mh_proxy_female1605.obj",
)


def main() -> None:
    """Makes the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--body", nargs="+", default=BODIES)
    parser.add_argument("--garment", nargs="+", default=tuple(DRAFTS))
    parser.add_argument("--out", type=Path)
    parser.add_argument("--pictures", type=Path, help="folder for a picture of each")
    args = parser.parse_args()
    names = ", ".join(f"{n} (at most {limit:g})" for n, (limit, _) in LIMITS.items())
    head = ["body", "garment", "vertices / triangles", "s", *LIMITS, "beyond"]
    lines = [f"Limits: {names}.", "", _row(head), _row(["---"] * len(head))]
    for line in lines:
        print(line)
    for source in args.body:
        model = Model(load_body(_found(source)))
        for garment in args.garment:
            lines.append(_row(_made(source, garment, model, args.pictures)))
            print(lines[-1], flush=True)
    if args.out:
        args.out.write_text("\n".join(lines) + "\n")


def _made(source: str, garment: str, model: Model, pictures: Path | None) -> list[str]:
    start = time.perf_counter()
    try:
        made = make(garment, model)
    except GarmentSimError as error:
        return [source, garment, str(error), *[""] * (2 + len(LIMITS))]
    seconds = time.perf_counter() - start
    if pictures:
        name = re.sub(r"[^a-zA-Z0-9.]+", "_", f"{source}_{garment}")
        pictures.mkdir(parents=True, exist_ok=True)
        triangles = model.body.skin.triangles
        picture = dressed_picture([made], [garment_colour(0)], model.skin, triangles)
        picture.save(pictures / f"{name}.png")
    count = f"{len(made.sewn.vertices)} / {len(made.sewn.triangles)}"
    figures = [f"{value:.3g}" for value in made.gates.figures.values()]
    beyond = ", ".join(made.gates.failed)
    return [source, garment, count, f"{seconds:.0f}", *figures, beyond]


def _row(cells: list[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _found(source: str) -> str:
    data = Path(os.environ.get("GARMENT_SIM_DATA", "../shared/data")) / "bodies" / source
    return str(data) if data.is_file() else source


if __name__ == "__main__":
    main()
