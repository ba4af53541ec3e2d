"""Garments that stay through each other on a body at rest are worn again as they were put on.

What wild motion leaves entangled, as a skirt that was thrown over a shirt and caught there, the
order of layers cannot sort out: it says nothing of what is folded. A person would pull it
straight.
"""

from collections.abc import Mapping

import numpy as np

from garment_sim_ros.arrays import SingleArray
from garment_sim_ros.contact.shapes import ColliderPoses
from garment_sim_ros.sim.layers.pair import LayerPair
from garment_sim_ros.sim.rewinding import Rewinding
from garment_sim_ros.sim.winding_back import carried, set_out
from garment_sim_ros.sim.worn import Worn

_LOOKS = 4
"""Looks in a row that find them through each other on a body at rest, 0.27 s, before they are
wound back; after each try twice as many."""
_MOST_IN_VAIN, _MOST = 64, 960
"""At most so many after a try in vain, 4.3 s: another pose may allow it; and after another one,
64 s: what wind blew through the other garment it blows there again."""
_CLEAN = 30
"""After so many looks that find nothing, 2 s, it is as if there had been no try."""
_CROSSED = 0.005
"""Edges that run through the other garment, as a share of those of the smaller one."""
_TANGLED = 0.001
"""Particles that stay through the other garment, as a share of both garments'."""
_STRETCHED = 0.01
"""Share of a garment's edges that may be overstretched there: on a body at rest soon none are."""
_BETTER = 0.5
"""They are wound back to what has at most this share of their crossings."""

Pairs = dict[str, list[tuple[Worn, LayerPair]]]
"""Of each garment those that it is worn over, and how it meets them."""


class Entangled:
    """Two garments, one worn over the other.

    Args:
        pair: Parts them.
        inner: The one under the other.
        outer: The one over it.
    """

    def __init__(self, pair: LayerPair, inner: Worn, outer: Worn) -> None:
        self._pair, self._worn = pair, (inner, outer)
        springs = [worn.model.springs for worn in self._worn]
        self._crossed = _CROSSED * min(len(s.rest_length) - s.bending for s in springs)
        self._tangled = _TANGLED * (len(inner.model) + len(outer.model))
        self.begin()

    def begin(self) -> None:
        """They were put on."""
        self._count = self._clean = 0
        self._patience = _LOOKS

    def look(self, rewinding: Rewinding, time: float, poses: ColliderPoses) -> None:
        """Looks when `rewinding` just did; winds both back if they stay through each other.

        Args:
            rewinding: Looks after the garments.
            time: Time simulated [s].
            poses: World poses of the colliders.
        """
        if rewinding.looked < time:
            return
        pair = self._pair
        is_through = pair.crossings > self._crossed or sum(pair.tangled) > self._tangled
        self._clean = 0 if is_through else self._clean + 1
        if self._clean > _CLEAN:
            self._patience = _LOOKS
        is_calm = all(rewinding.is_calm(worn.garment.name) for worn in self._worn)
        self._count = self._count + 1 if is_through and is_calm else 0
        if self._count < self._patience:
            return
        self._count = 0
        good = [_as_put_on(worn, rewinding, poses) for worn in self._worn]
        is_well = all(_is_well(w, x, rewinding, poses) for w, x in zip(self._worn, good))
        is_better = is_well and pair.crossings_at(*good) <= _BETTER * pair.crossings
        self._patience = min(2 * self._patience, _MOST if is_better else _MOST_IN_VAIN)
        if is_better:
            for worn, x in zip(self._worn, good):
                _wind_back(worn, x, rewinding, poses)
            pair.forget()


def _as_put_on(worn: Worn, rewinding: Rewinding, poses: ColliderPoses) -> SingleArray:
    """A garment as it was put on, taken along as skin [m], shape [v, 3]."""
    return carried(worn, rewinding.first(worn.garment.name), poses)


def _is_well(worn: Worn, x: SingleArray, rewinding: Rewinding, poses: ColliderPoses) -> bool:
    """Whether it may be put there [m], shape [v, 3]."""
    return rewinding.is_well(worn, x, poses, _STRETCHED)


def _wind_back(worn: Worn, x: SingleArray, rewinding: Rewinding, poses: ColliderPoses) -> None:
    """Puts a garment where it is to be [m], shape [v, 3]; it is shown on its way there."""
    seen, v = worn.seen(rewinding.origin), rewinding.skin_velocity(worn)
    worn.wind_back(x.astype(np.float64), v, np.ones(len(x)), rewinding.origin)
    set_out(rewinding, worn, seen, poses)
    worn.health.entangled += 1


def pairs_of(worn: Mapping[str, Worn]) -> Pairs:
    """How garments meet those that they are worn over."""
    return {
        name: [
            (inner, LayerPair(inner, outer))
            for inner in worn.values()
            if inner.garment.layer < outer.garment.layer
        ]
        for name, outer in worn.items()
    }


def entangled_of(worn: Mapping[str, Worn], under: Pairs) -> list[Entangled]:
    """What looks after each of these pairs."""
    return [Entangled(pair, inner, worn[name]) for name in worn for inner, pair in under[name]]
