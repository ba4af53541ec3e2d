"""From a bag to its figures and pictures."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.skin import Body
from garment_sim_ros.errors import InputFileError
from garment_sim_ros.garment.colours import garment_colour
from garment_sim_ros.garment.garment import Garment
from garment_sim_ros.garment.outfit import load_outfit
from garment_sim_ros.recording.bags import Recording, read_recording
from garment_sim_ros.recording.previews import Figure, Look, animation, film_indices, moments
from garment_sim_ros.recording.render import RenderingUnavailableError
from garment_sim_ros.recording.summary import figures, summarize

_FILM_RATE = 20.0
Progress = Callable[[Iterable[Any], str, int], Iterable[Any]]


def evaluate(
    bag: Path,
    body: str,
    outfit: str,
    *,
    frame_rate: float,
    pictures: Path,
    bone_names: str = "",
    attachments: str = "auto",
    skinning: str = "linear",
    progress: Progress = lambda items, text, total: items,
) -> dict[str, Any]:
    """Measure and draw what was recorded.

    Args:
        bag: A rosbag2 folder.
        body: The avatar, as `load_body` takes it.
        outfit: What it wore, as `load_outfit` takes it.
        frame_rate: At which frames were due [Hz].
        pictures: Folder for ``preview.png`` and ``preview.gif``.
        bone_names: File that names the avatar's bones, as `load_body` takes it.
        attachments: What held it, as `load_outfit` takes it.
        skinning: How the avatar's skin follows its bones, one of `body.skinning.METHODS`.
        progress: Passes items on and shows how far it is: a text, and of a total.

    Returns:
        See `summarize`; ``pictures`` is ``drawn`` or says why there are none.

    Raises:
        InputFileError: The bag, body or outfit cannot be used.
    """
    recording = read_recording(bag)
    avatar = replace(load_body(body, bone_names=bone_names), skinning=skinning)
    colliders = None if recording.colliders is None else recording.colliders.colliders
    # Over the colliders of the run: panels were let out over them.
    garments = load_outfit(outfit, avatar, colliders=colliders, attachments=attachments).garments
    shown = figures(recording, avatar)
    if len(shown) < 2:
        raise InputFileError(
            bag,
            f"has {len(shown)} frames of all garments",
            "needed: 2 or more, from a longer recording",
        )
    summary = summarize(
        recording,
        avatar,
        garments,
        progress(shown, "measuring", len(shown)),
        frame_rate=frame_rate,
    )
    try:
        _draw(recording, avatar, garments, shown, pictures, progress)
        summary["pictures"] = "drawn"
    except RenderingUnavailableError as error:
        summary["pictures"] = str(error)
    return summary


def _draw(
    recording: Recording,
    body: Body,
    garments: Sequence[Garment],
    shown: Sequence[Figure],
    folder: Path,
    progress: Progress,
) -> None:
    place = {garment.name: number for number, garment in enumerate(garments)}
    look = Look(
        skin_triangles=body.skin.triangles,
        garment_triangles=tuple(t.triangles for t in recording.garments.values()),
        garment_colours=tuple(garment_colour(place.get(name, 0)) for name in recording.garments),
    )
    times = 1e-9 * (recording.stamp - recording.stamp[0])
    at = ((np.arange(4) + 0.5) / 4 * len(shown)).astype(int)
    moments([shown[i] for i in at], look, folder / "preview.png")
    film = film_indices(shown, times, rate=_FILM_RATE, shortest=3.0, longest=5.0)
    animation(
        [shown[i] for i in film],
        look,
        folder / "preview.gif",
        rate=_FILM_RATE,
        progress=lambda items, total: progress(items, "drawing", total),
    )
