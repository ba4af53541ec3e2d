"""Pictures of a recorded motion: some moments side by side, and a looping animation."""

import math
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from garment_sim_ros.arrays import AnyArray
from garment_sim_ros.garment.colours import Colour
from garment_sim_ros.recording.render import (
    SKIN_COLOR,
    Camera,
    Surface,
    linear,
    render,
)

_AZIMUTH = math.radians(38.0)  # of the eye from where the body faces
_ELEVATION = 0.14  # of the eye above the target, over the distance
_MARGIN = 1.12  # of the picture around the figure
_PALETTE = 256
Picture = TypeVar("Picture")


@dataclass(frozen=True, kw_only=True)
class Figure:
    """A body and its garments at one instant.

    Attributes:
        skin: Skin vertices in the world [m], shape [v, 3].
        garments: Vertices of each garment in the world [m].
        root: Position of the body's root [m], shape [3].
        heading: Direction in which the body faces, about z [rad].
    """

    skin: AnyArray
    garments: tuple[AnyArray, ...]
    root: AnyArray
    heading: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Look:
    """What stays the same over a motion.

    Attributes:
        skin_triangles: Shape [t, 3].
        garment_triangles: Of each garment.
        garment_colours: Of each garment, see `garment_colour`.
        floor: Height of the floor [m].
    """

    skin_triangles: NDArray[np.int32]
    garment_triangles: tuple[NDArray[np.int32], ...]
    garment_colours: tuple[Colour, ...]
    floor: float = 0.0

    def surfaces(self, figure: Figure) -> list[Surface]:
        """Body and garments with their colours."""
        body = Surface(
            vertices=figure.skin, triangles=self.skin_triangles, color=SKIN_COLOR, gloss=0.15
        )
        return [body] + [
            Surface(vertices=x, triangles=t, color=linear(colour))
            for x, t, colour in zip(
                figure.garments, self.garment_triangles, self.garment_colours, strict=True
            )
        ]


def moments(
    figures: Sequence[Figure], look: Look, path: Path, *, size: tuple[int, int] = (480, 760)
) -> None:
    """Write the figures side by side, each seen from the same side of the body.

    Args:
        figures: From left to right.
        look: Meshes and colours.
        path: PNG file.
        size: Width and height of each [pixel].
    """
    width, height = size
    headings = np.array([f.heading for f in figures])
    centres = np.array([0.5 * (f.skin.min(axis=0) + f.skin.max(axis=0)) for f in figures])
    cameras = _cameras(figures, centres, headings, width / height)

    def draw(i: int) -> NDArray[np.uint8]:
        surfaces = look.surfaces(figures[i])
        return render(surfaces, cameras[i], width, height, floor=look.floor, quality=2)

    pictures = list(_in_parallel(draw, len(figures)))
    Image.fromarray(np.concatenate(pictures, axis=1)).save(path, optimize=True)


def animation(
    figures: Sequence[Figure],
    look: Look,
    path: Path,
    *,
    rate: float,
    size: tuple[int, int] = (480, 640),
    progress: Callable[[Iterable[Any], int], Iterable[Any]] = lambda items, total: items,
) -> None:
    """Write a looping GIF.

    Args:
        figures: One per picture.
        look: Meshes and colours.
        path: GIF file.
        rate: Pictures per second.
        size: Width and height [pixel].
        progress: Passes items on and shows how far it is, of a total.
    """
    width, height = size
    steady = np.full(len(figures), figures[0].heading)
    heights = [f.skin[:, 2] for f in figures]
    low = min(look.floor, *(float(z.min()) for z in heights))
    high = max(float(z.max()) for z in heights)
    centres = np.empty((len(figures), 3))
    centres[:, :2] = _smooth(np.array([f.root[:2] for f in figures]), round(0.25 * rate))
    centres[:, 2] = 0.5 * (low + high)
    cameras = _cameras(figures, centres, steady, width / height)

    def draw(i: int) -> Image.Image:
        surfaces = look.surfaces(figures[i])
        return Image.fromarray(render(surfaces, cameras[i], width, height, floor=look.floor))

    pictures = list(progress(_in_parallel(draw, len(figures)), len(figures)))
    # One palette for all pictures: nothing flickers, and still pixels compress to nothing.
    some = [pictures[i] for i in np.linspace(0, len(pictures) - 1, 6).astype(int)]
    sheet = Image.fromarray(np.concatenate([np.asarray(p) for p in some], axis=1))
    palette = sheet.quantize(_PALETTE, method=Image.Quantize.MEDIANCUT)
    indexed = [p.quantize(palette=palette, dither=Image.Dither.NONE) for p in pictures]
    indexed[0].save(
        path,
        save_all=True,
        append_images=indexed[1:],
        # GIF counts in hundredths of a second.
        duration=(10 * np.diff(np.round(100.0 / rate * np.arange(len(indexed) + 1)))).tolist(),
        loop=0,
        optimize=False,
    )


def _in_parallel(draw: Callable[[int], Picture], count: int) -> Iterator[Picture]:
    """Pictures in order; ray casting and array arithmetic leave Python's lock."""
    threads = ThreadPoolExecutor(min(8, os.cpu_count() or 1))
    try:
        yield from threads.map(draw, range(count))
    finally:
        threads.shutdown(cancel_futures=True)


def film_indices(
    figures: Sequence[Figure],
    times: AnyArray,
    *,
    rate: float,
    shortest: float,
    longest: float,
) -> NDArray[np.intp]:
    """Which figures make a film that jumps least where it starts again.

    Args:
        figures: Of the whole motion.
        times: When each was [s], from 0, increasing, shape [n].
        rate: Pictures per second.
        shortest: Length of the film, if there is so much [s].
        longest: Length of the film [s].
    """
    wanted = np.arange(max(2, int(min(longest, times[-1]) * rate))) / rate
    indices = np.searchsorted(0.5 * (times[1:] + times[:-1]), wanted)  # the nearest ones
    ends = np.arange(min(len(indices) - 1, round(shortest * rate)), len(indices))

    def shape(figure: Figure) -> AnyArray:
        return figure.skin[::8] - np.append(figure.root[:2], 0.0)

    start = shape(figures[indices[0]])
    jumps = [np.square(shape(figures[indices[k]]) - start).sum() for k in ends]
    return indices[: ends[int(np.argmin(jumps))]]


def _smooth(values: AnyArray, half_width: int) -> AnyArray:
    """Means over a window of neighbours with soft ends, shape [n, k]."""
    padded = np.pad(values, ((half_width, half_width), (0, 0)), mode="edge")
    window = np.hanning(2 * half_width + 3)[1:-1]
    window /= window.sum()
    return np.stack([np.convolve(column, window, "valid") for column in padded.T], axis=1)


def _cameras(
    figures: Sequence[Figure], centres: AnyArray, headings: AnyArray, aspect: float
) -> list[Camera]:
    """Cameras at one distance, from which every figure is seen whole.

    Args:
        figures: What must stay within the picture.
        centres: What each camera looks at [m], shape [n, 3].
        headings: Direction that each camera takes for the body's front [rad], shape [n].
        aspect: Width over height of the picture.
    """
    angles = headings + _AZIMUTH
    ways = np.column_stack([np.cos(angles), np.sin(angles), np.full(len(angles), _ELEVATION)])
    distance = 0.0
    for figure, centre, way in zip(figures, centres, ways):
        camera = Camera(position=way, target=np.zeros(3))
        right, up, forward = (axis * _MARGIN for axis in camera.axes())
        half = math.tan(0.5 * camera.field_of_view)
        seen = figure.skin - centre
        far = np.maximum(np.abs(seen @ right) / aspect, np.abs(seen @ up)) / half - seen @ forward
        distance = max(distance, float(far.max()) / float(np.linalg.norm(way)))
    return [Camera(position=c + distance * way, target=c) for c, way in zip(centres, ways)]
