"""Whether garments are still worn, looked at while they move: see ``docs/worn.md``.

`pierced` is looked at in every frame. `inside` takes the distance of many points from the skin:
it is measured from time to time, in a thread of its own, and holds until it is measured again.
That takes longer than a frame may: it goes in pieces, each when a frame was just looked at.
"""

import threading
import time
import weakref
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, SingleArray
from garment_sim_ros.body.skin import Body, Skin
from garment_sim_ros.body.skinning import Skinner
from garment_sim_ros.colliders.skin_from_poses import SkinFromPoses
from garment_sim_ros.contact.kinds.hull import HULL
from garment_sim_ros.contact.pierced import PiercedSoFar
from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet
from garment_sim_ros.errors import GarmentSimError
from garment_sim_ros.garment.garment import Garment
from garment_sim_ros.geometry.locality import near_together
from garment_sim_ros.geometry.mesh_distance import MeshDistance
from garment_sim_ros.recording.metrics import GarmentMesh
from garment_sim_ros.stepping_back import step_back

_PERIOD = 0.5
"""Least time between two measurements of `inside` [s]."""
_REST = 30.0
"""Least such time per processor time of one; where several bodies are watched, of one of each."""
_PIECE = 1500
"""Points whose distance is taken at once."""
_PATIENCE = 0.1
"""Then a piece does not wait any longer for a frame [s]."""
_BIN = 5e-5
"""Shares of a garment's area are counted in steps of this."""


class Figures(NamedTuple):
    """How well garments are worn.

    Attributes:
        pierced: Share of the frames so far in which a body part ran through.
        inside_p99: Of what was measured so far, the 99th percentile; 0 before the first.
        inside_median: The median.
    """

    pierced: float
    inside_p99: float
    inside_median: float


class WornWatch:
    """Looks after the garments on one body.

    Args:
        colliders: The body's colliders.
        body: The body.
        garments: What it wears.
    """

    def __init__(self, colliders: ColliderSet, body: Body, garments: Sequence[Garment]) -> None:
        self._triangles = {g.name: near_together(g.vertices, g.triangles) for g in garments}
        self._pierced = PiercedSoFar(colliders, list(self._triangles))
        self._inside = _InsideSoFar(colliders, body, garments)

    def look(
        self,
        poses: ColliderPoses,
        positions: Mapping[str, SingleArray],
        *,
        measure: bool | None = None,
    ) -> None:
        """Look at one frame.

        Args:
            poses: World poses of the colliders.
            positions: World positions of each garment's vertices [m], shape [v, 3].
            measure: Whether to measure `inside` at once; from time to time, beside, where None.
        """
        self._pierced.add(poses, {n: (x, self._triangles[n]) for n, x in positions.items()})
        if measure is None:
            self._inside.offer(poses, positions)
        elif measure:
            self._inside.measure(poses, positions)

    def pierced_by(self, name: str) -> tuple[str, ...]:
        """Bones that run through a garment in the latest frame."""
        return self._pierced.now[name]

    def inside(self, name: str) -> float:
        """Share of a garment's area in the skin, as of the latest measurement."""
        return self._inside.latest[name]

    def figures(self, name: str | None = None) -> Figures:
        """Of one garment, or of all where None: each counts as much as any other."""
        p99, median = self._inside.quantiles(name)
        return Figures(self._pierced.share(name), p99, median)

    def wait(self) -> None:
        """Until the measurement under way has ended."""
        self._inside.wait()


class _InsideSoFar:
    """Measures `inside` of frames as they are offered, when there is time."""

    def __init__(self, colliders: ColliderSet, body: Body, garments: Sequence[Garment]) -> None:
        _watched.add(self)
        self._colliders, self._body, self._worn = colliders, body, garments
        self.latest = dict.fromkeys((g.name for g in garments), 0.0)
        bins = round(1.0 / _BIN) + 1
        self._counts = {g.name: np.zeros(bins, np.int64) for g in garments}
        self._quantiles: dict[str | None, tuple[float, float]] = {}
        self._thread: threading.Thread | None = None
        self._turn = threading.Event()
        self._not_before = 0.0
        self._skin: SkinFromPoses | None = None

    def offer(self, poses: ColliderPoses, positions: Mapping[str, SingleArray]) -> None:
        """Measure a frame unless another is being measured, or was lately."""
        self._turn.set()
        if self._thread is not None and self._thread.is_alive():
            return
        if time.monotonic() < self._not_before:
            return
        copies = {name: x.astype(np.float64) for name, x in positions.items()}
        # A daemon: the end of the process does not wait for it.
        self._thread = threading.Thread(
            target=self._measure_beside, args=(poses.copy(), copies), daemon=True
        )
        self._not_before = np.inf
        self._thread.start()

    def measure(self, poses: ColliderPoses, positions: Mapping[str, SingleArray]) -> None:
        """Measure a frame at once, in the caller's thread."""
        self._measure(poses, {name: x.astype(np.float64) for name, x in positions.items()}, 0.0)

    def quantiles(self, name: str | None) -> tuple[float, float]:
        """99th percentile and median of one garment, or of all where None."""
        found = self._quantiles.get(name)
        if found is None:
            counts = self._counts
            shares = counts[name] if name else np.sum(list(counts.values()), axis=0)
            found = self._quantiles[name] = _quantile(shares, 0.99), _quantile(shares, 0.5)
        return found

    def wait(self) -> None:
        """Until the measurement under way has ended, whether frames come or not."""
        while self._thread is not None and self._thread.is_alive():
            self._turn.set()
            self._thread.join(1e-3)

    def _measure_beside(self, poses: ColliderPoses, positions: Mapping[str, FloatArray]) -> None:
        step_back()
        self._measure(poses, positions, _PATIENCE)

    def _measure(
        self, poses: ColliderPoses, positions: Mapping[str, FloatArray], patience: float
    ) -> None:
        began = time.thread_time()
        try:
            self._begin()
            assert self._skin is not None
            self._distance.refit(self._skin.vertices(poses))
            for name, x in positions.items():
                if not np.isfinite(x).all():
                    continue
                mesh = self._meshes[name]
                share = mesh.inside(self._distances(mesh.samples(x), patience))
                self._counts[name][round(share / _BIN)] += 1
                self.latest[name] = share
            self._quantiles = {}
        except GarmentSimError:
            return  # A body without a skin to be inside of: not measured again.
        rest = _REST * len(_watched) * (time.thread_time() - began)
        self._not_before = time.monotonic() + max(_PERIOD, rest)

    def _distances(self, points: FloatArray, patience: float) -> FloatArray:
        """Signed distances from the skin [m], shape [n]; a piece after each frame.

        Frames are waited for at most for some time [s].
        """
        pieces = []
        for first in range(0, len(points), _PIECE):
            self._turn.wait(patience)
            self._turn.clear()
            pieces.append(self._distance.signed_distance(points[first : first + _PIECE])[0])
        return np.concatenate(pieces)

    def _begin(self) -> None:
        """What measuring needs, made in its thread when it is first needed."""
        if self._skin is None:
            skin = self._body.skin
            self._meshes = {g.name: GarmentMesh.of(g) for g in self._worn}
            self._distance = MeshDistance(skin.vertices, skin.triangles)
            self._skin = SkinFromPoses(self._colliders, self._body)


_watched: weakref.WeakSet[_InsideSoFar] = weakref.WeakSet()


def _quantile(counts: NDArray[np.int64], share: float) -> float:
    """The value that a share of what was counted does not exceed, in steps of the bins."""
    total = int(counts.sum())
    return 0.0 if total == 0 else _BIN * int(np.searchsorted(counts.cumsum(), share * total))


def warm_up() -> None:
    """Compile, or load from the cache, what looking at a frame runs."""
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], dtype=np.int32)
    faces.setflags(write=False)  # as those of garments are
    hull = {"vertices": corners, "faces": faces}
    colliders = ColliderSet(
        colliders=tuple(Collider(name=n, kind=HULL.name, bone=n, geometry=hull) for n in "ab")
    )
    poses = ColliderPoses.identity(2)
    PiercedSoFar(colliders, ["scrap"]).add(poses, {"scrap": (corners.astype(np.float32), faces)})
    skin = Skin(
        vertices=corners,
        triangles=faces,
        bone=np.zeros((4, 1), np.int32),
        weight=np.ones((4, 1)),
        T_bone_bind=np.eye(4)[None],
    )
    distance = MeshDistance(corners, faces)
    distance.refit(Skinner(skin).vertices(np.eye(4)[None]))
    distance.signed_distance(corners)
