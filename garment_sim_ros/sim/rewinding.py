"""Looks whether garments are still worn right, and keeps what they were like while they were.

What breaks a garment for good (a limb on the wrong side of it after a jump or a gap, a skirt
beside both legs) no contact can sort out: cloth is where contact holds it. A few looks in a second
tell such a garment from one that a limb is passing: at the cores of body parts that run through
its triangles, at what is through its openings, and at hems that stay rolled up. What a garment was
like while it was worn right is kept for a while, with the pose that it was worn in; `winding_back`
has what follows.
"""

from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import FloatArray, SingleArray
from garment_sim_ros.contact.pierced import PiercedSoFar
from garment_sim_ros.contact.shapes import ColliderPoses, ColliderSet
from garment_sim_ros.geometry.locality import near_together
from garment_sim_ros.sim.joint_links import JointLinks
from garment_sim_ros.sim.motion import to_file_order
from garment_sim_ros.sim.openings import Openings
from garment_sim_ros.sim.placement import Carried
from garment_sim_ros.sim.riding_up import RidingUp
from garment_sim_ros.sim.worn import Worn

_PERIOD = 1 / 15
"""Time between two looks [s]."""
_PATIENCE = 4
"""Looks with a limb in the cloth, less those without, after which it will not come out."""
_OFF = 3
"""The same where it is off the body: it falls as long as that is waited for."""
_ROLLED_UP = 8
"""The same where it rode up: it falls again in that time, if it is loose."""
_FALLS = 4
"""Looks since it was upside down in which it is not off the body: turned over, it falls again."""
_PULLED_AGAIN = 3
"""Looks from one try to pull it down to the next."""
_CALM = 0.5
"""Skin under a garment at rest is slower [m/s]."""
_KEPT = 15
"""States kept of a garment: one for each look that found nothing."""
_TO_TRY = (1, 4, -1)
"""Which of them are tried, in looks before the first that found something; the last is oldest."""
_WAIT, _LONGEST_WAIT = 0.2, 3.0
"""After a try the next one comes so much later, twice as long each time [s]."""
_NEAR, _FAR = 0.15, 0.3
"""Cloth nearer to the limb's core is wound back, beyond it is left, with a blend between [m]."""

_BEARS = 0.5
"""Strain of an overstretched edge."""


class Kept(NamedTuple):
    """A garment as it once was.

    Attributes:
        x: World positions of its vertices [m], shape [v, 3].
        poses: World poses of the colliders then.
    """

    x: SingleArray
    poses: ColliderPoses


@dataclass
class _Record:
    """What is known of one garment."""

    kept: deque[Kept]
    openings: Openings
    riding_up: RidingUp
    skin: Carried
    first: Kept | None = None
    count: int = 0
    is_off: bool = False
    upright: int = _FALLS
    up: int = 0
    is_calm: bool = False
    calm: int = 0
    tries: int = 0
    not_before: float = 0.0
    good_since: float = 0.0
    cores: tuple[int, ...] = field(default=())

    @property
    def is_broken(self) -> bool:
        """Whether a limb stays in it, or it stays off the body."""
        return self.count >= (_OFF if self.is_off else _PATIENCE)

    @property
    def is_rolled_up(self) -> bool:
        """Whether it stays rolled up, and is worn right otherwise."""
        return self.up >= _ROLLED_UP and not self.is_broken


class Rewinding:
    """Looks after the garments of one body.

    Args:
        colliders: The body's colliders.
        worn: Its garments by name.
        T_world_rest: Where the colliders are at rest, shape [n, 4, 4]; NaN where not known.
        origin: World position that their states are relative to [m], shape [3], as it moves.

    Attributes:
        looked: When it looked last [s].
    """

    def __init__(
        self,
        colliders: ColliderSet,
        worn: Mapping[str, Worn],
        origin: FloatArray,
        T_world_rest: FloatArray,
    ) -> None:
        self._worn = worn
        self.origin = origin
        self._limbs = PiercedSoFar(colliders, list(worn))
        self._links = JointLinks(colliders, T_world_rest)
        self._triangles = {
            n: near_together(w.garment.vertices, w.model.triangles) for n, w in worn.items()
        }
        self._records = {
            n: _Record(
                deque(maxlen=_KEPT),
                Openings(colliders, T_world_rest, w.model.triangles),
                RidingUp(w.garment),
                Carried(w.garment),
            )
            for n, w in worn.items()
        }
        self.looked, self._next, self._gravity = 0.0, 0.0, np.zeros(3)
        self._at = ColliderPoses.identity(len(colliders))
        self._then = self._at

    def begin(self, poses: ColliderPoses) -> None:
        """The garments were put on: what they are now is good, and time begins anew."""
        self.looked, self._next = 0.0, _PERIOD
        self._at = self._then = poses.copy()
        for name, worn in self._worn.items():
            kept, old = Kept(self.positions(worn), poses.copy()), self._records[name]
            old.openings.begin(kept.x, poses)
            self._records[name] = _Record(
                deque(maxlen=_KEPT), old.openings, old.riding_up, old.skin, first=kept
            )

    def take_over(self, before: "Rewinding", carry: Callable[[str, Kept], Kept]) -> None:
        """Goes on where what looked after the same garments, with other vertices, was.

        Args:
            before: What looked after them.
            carry: What it kept of a garment, by name, as it is with the vertices of this one.
        """
        self.looked, self._next, self._gravity = before.looked, before._next, before._gravity
        self._at, self._then = before._at, before._then
        self._limbs = before._limbs  # knows which parts of the body are neighbours
        for name, record in before._records.items():
            own = self._records[name]
            first = own.first
            if record.first is not None and (
                first is None or first.poses is not record.first.poses
            ):
                # Put on anew since this was last there: what is carried once is kept as it is.
                first = carry(name, record.first)
                own.openings.begin(first.x, first.poses)
            self._records[name] = replace(
                record,
                kept=deque((carry(name, kept) for kept in record.kept), maxlen=_KEPT),
                openings=own.openings,
                riding_up=own.riding_up,
                skin=own.skin,
                first=first,
            )

    def look(
        self, time: float, poses: ColliderPoses, gravity: tuple[float, ...]
    ) -> tuple[str, ...]:
        """Looks, if it is time to.

        Args:
            time: Time simulated since `begin` [s].
            poses: World poses of the colliders.
            gravity: Of the world [m/s^2], three of them.

        Returns:
            Garments that limbs stay in, that are off the body, or that stay rolled up.
        """
        if time < self._next:
            return ()
        self.looked, self._next, self._gravity = time, time + _PERIOD - 1e-6, np.array(gravity)
        posed = {name: self.positions(worn) for name, worn in self._worn.items()}
        self._find(posed, poses)
        broken = []
        for name, record in self._records.items():
            record.cores = self._through(name, posed[name], poses)
            T = self._worn[name].frames.world(poses)
            hung = record.riding_up.look(posed[name], T, self._gravity)
            record.upright = 0 if hung.upside_down else record.upright + 1
            record.is_off = record.upright > _FALLS and record.openings.lost(posed[name], poses)
            rode_up = record.upright > _FALLS and hung.rode_up
            record.up = record.up + 1 if rode_up else 0
            moved = record.skin.at(T - self._worn[name].frames.world(self._at))
            record.is_calm = float(np.linalg.norm(moved, axis=1).max()) < _CALM * _PERIOD
            if record.up:
                record.calm = record.calm + 1 if record.is_calm else 0
            if record.cores or record.is_off:
                record.count, record.good_since = min(record.count + 1, _PATIENCE), time
            elif record.count:
                record.count -= 1
            elif np.isfinite(posed[name]).all():
                record.kept.append(Kept(posed[name], poses.copy()))
            if time - record.good_since > 2.0:
                record.tries = 0
            if record.is_rolled_up or (record.is_broken and time >= record.not_before):
                broken.append(name)
                health = self._worn[name].health
                health.came_off += record.is_broken and record.is_off
                health.caught += record.is_broken and not record.is_off
                health.rode_up += record.is_rolled_up
        self._then, self._at = self._at, poses.copy()
        return tuple(broken)

    def first(self, name: str) -> Kept:
        """A garment as it was put on."""
        first = self._records[name].first
        assert first is not None
        return first

    def is_calm(self, name: str) -> bool:
        """Whether the skin under a garment was at rest at the last look."""
        return self._records[name].is_calm

    def tried(self, name: str, time: float) -> None:
        """A garment was wound back, or nothing was found that it could be wound back to."""
        record = self._records[name]
        if record.is_rolled_up:
            record.up -= _PULLED_AGAIN
            return
        wait = min(_WAIT * 2.0**record.tries, _LONGEST_WAIT)
        record.tries, record.count, record.not_before = record.tries + 1, 0, time + wait

    def candidates(self, name: str) -> Iterator[Kept]:
        """What a garment may be wound back to, newest first; older at once after each try."""
        record = self._records[name]
        kept = [] if record.is_rolled_up else list(record.kept)
        for back in _TO_TRY[min(record.tries, len(_TO_TRY)) :]:
            if kept:
                yield kept[0 if back < 0 else max(len(kept) - back, 0)]
        if record.first is not None:
            yield record.first

    def may_replay(self, name: str) -> bool:
        """Whether a try may take as long as to let the body move with the garment on.

        One that is rolled up is worn all the same, and the next step may roll it up again: it
        waits for a pose that it can be carried to, or for a body at rest, then longer and longer.
        """
        record = self._records[name]
        nth = record.calm // _PULLED_AGAIN
        return not record.is_rolled_up or (nth > 0 and nth & (nth - 1) == 0)

    def is_well(self, worn: Worn, x: SingleArray, poses: ColliderPoses, bears: float) -> bool:
        """Whether a garment may be put somewhere.

        Args:
            worn: The garment.
            x: Its vertices [m], shape [v, 3].
            poses: World poses of the colliders.
            bears: Share of its edges that may be overstretched.
        """
        if not np.isfinite(x).all() or overstretched(worn, x) > bears:
            return False
        name = worn.garment.name
        if self._records[name].is_rolled_up and self._rode_up(name, x, poses):
            return False
        self._find({name: x}, poses)
        is_off = self._records[name].openings.lost(x, poses)
        return not (is_off or self._through(name, x, poses))

    def skin_velocity(self, worn: Worn) -> SingleArray:
        """How fast a garment would move as skin [m/s], in the order of its model, shape [n, 3]."""
        then, now = worn.frames.world(self._then), worn.frames.world(self._at)
        v = self._records[worn.garment.name].skin.at(now - then) / _PERIOD
        return v[worn.model.vertex].astype(np.float32)

    def part(self, name: str, x: SingleArray, good: SingleArray) -> NDArray[np.float64]:
        """How much of each vertex is to be wound back where a part is enough, shape [v].

        Args:
            name: The garment.
            x: Its vertices as they are [m], shape [v, 3].
            good: Where they would be wound back to [m], shape [v, 3].
        """
        if self._records[name].is_off or not self._records[name].cores:
            return np.ones(len(x))
        ends = self._limbs.posed_cores(self._at)[list(self._records[name].cores)]
        away = np.full(len(x), np.inf)
        for start, end in ends:
            for points in (x, good):
                away = np.minimum(away, _distance(points, start, end - start))
        share = np.clip((_FAR - away) / (_FAR - _NEAR), 0.0, 1.0)
        weight: NDArray[np.float64] = share * share * (3.0 - 2.0 * share)
        return weight

    def _through(self, name: str, x: SingleArray, poses: ColliderPoses) -> tuple[int, ...]:
        """The cores that run through a garment, or next to joints that do, as just found."""
        links = self._links
        found = set(self._limbs.cores_now[name])
        for k in links.through(x, self._triangles[name], poses).tolist():
            if not self._limbs.is_pressed(links.cores[k].tolist(), links.at[k].tolist()):
                found.update(links.cores[k].tolist())
        return tuple(sorted(found))

    def _rode_up(self, name: str, x: SingleArray, poses: ColliderPoses) -> bool:
        T = self._worn[name].frames.world(poses)
        return self._records[name].riding_up.look(x, T, self._gravity).rode_up

    def _find(self, posed: Mapping[str, SingleArray], poses: ColliderPoses) -> None:
        self._limbs.add(poses, {n: (x, self._triangles[n]) for n, x in posed.items()})

    def positions(self, worn: Worn) -> SingleArray:
        """World positions of a garment's vertices [m], shape [v, 3], a new array."""
        x = np.empty((len(worn.model), 3), np.float32)
        to_file_order(worn.state.x, worn.model.vertex, self.origin, x)
        return x


def overstretched(worn: Worn, x: SingleArray) -> float:
    """Share of the edges of a garment that are too long with its vertices at x [m]."""
    springs, vertex = worn.model.springs, worn.model.vertex
    a, b = vertex[springs.particles.reshape(-1, 2)[springs.bending :]].T
    longest = (1.0 + _BEARS) * springs.rest_length[springs.bending :]
    return float(np.mean(np.linalg.norm(x[a] - x[b], axis=1) > longest))


def _distance(x: SingleArray, start: FloatArray, way: FloatArray) -> NDArray[np.float64]:
    """Distance of points from a segment [m], shape [v]."""
    to = x - start
    s = np.clip(to @ way / max(float(way @ way), 1e-12), 0.0, 1.0)
    away: NDArray[np.float64] = np.linalg.norm(to - s[:, None] * way, axis=1)
    return away
