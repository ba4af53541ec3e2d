"""The garments of a simulation by their names, and what is known of each."""

from collections.abc import Iterator

from garment_sim_ros.arrays import FloatArray, SingleArray
from garment_sim_ros.contact.sides import Sides
from garment_sim_ros.errors import ParameterError
from garment_sim_ros.geometry.topology import vertex_normals
from garment_sim_ros.sim.cast import Cast
from garment_sim_ros.sim.colliders import ColliderState
from garment_sim_ros.sim.garment_view import GarmentView
from garment_sim_ros.sim.health import Health
from garment_sim_ros.sim.holds.tethers import Attached
from garment_sim_ros.sim.layers.pair import LayerPair
from garment_sim_ros.sim.model import ClothModel
from garment_sim_ros.sim.state import State


class ByName:
    """What a `Simulation` tells of its garments; nothing here changes it."""

    _cast: Cast
    _casts: dict[float, Cast]
    _view: dict[str, GarmentView]
    _colliders: ColliderState

    def __getitem__(self, name: str) -> GarmentView:
        """A garment by its name.

        Raises:
            ParameterError: There is no such garment.
        """
        if name not in self._view:
            raise ParameterError("garment", f"found {name!r}", f"allowed: {', '.join(self.names)}")
        return self._view[name]

    def __iter__(self) -> Iterator[GarmentView]:
        return iter(self._view.values())

    def __len__(self) -> int:
        return len(self._view)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the garments."""
        return tuple(self._cast.worn)

    def model(self, name: str) -> ClothModel:
        """Particles and springs of a garment, of as many vertices as are simulated."""
        return self._cast.worn[name].model

    def state(self, name: str) -> State:
        """Motion of what is simulated of a garment, in its model's order, relative to `origin`."""
        return self._cast.worn[name].state

    def sides(self, name: str) -> Sides:
        """On which side of a garment's free particles the shapes are."""
        return self._cast.worn[name].workspace.sides

    def layer(self, name: str) -> int:
        """The layer that a garment is worn in."""
        return self._cast.worn[name].garment.layer

    def over(self, name: str) -> tuple[LayerPair, ...]:
        """How a garment meets each of those that it is worn over."""
        return tuple(pair for _, pair in self._cast.under[name])

    def skin_limits(self, name: str) -> tuple[str, ...]:
        """Names of the limits that hold a garment near its place as skin."""
        return tuple(self._cast.worn[name].garment.skin_limits)

    def attached(self, name: str) -> Attached:
        """Tethers and soft attachments of a garment."""
        return self._cast.worn[name].workspace.attached

    def limits(self, name: str) -> tuple[str, ...]:
        """What the solver does not take as a garment's material has it, in words."""
        return self._cast.worn[name].workspace.limits

    def own_distance(self, name: str) -> float | None:
        """The distance that parts of a garment keep from each other [m]; None without."""
        return self._cast.worn[name].garment.self_collision

    def health(self, name: str) -> Health:
        """Counts and readings of a garment."""
        return self._cast.worn[name].health

    @property
    def collider_state(self) -> ColliderState:
        """The colliders in the latest step."""
        return self._colliders

    @property
    def origin(self) -> FloatArray:
        """World position that the states' positions are relative to [m], shape [3]."""
        return self._colliders.origin

    def positions(self, name: str, out: SingleArray | None = None) -> SingleArray:
        """World positions of a garment's vertices in file order [m], shape [v, 3].

        They are as shown: over the shapes between particles, too, with round creases (`aside`),
        and for some tenths of a second on the way where it was wound back. `state` is what is
        simulated.

        Without `out`, an array that the next call for this garment overwrites.
        """
        worn = self._cast.worn[name]
        out = worn.x_world if out is None else out
        return worn.shown(self._colliders.origin, out)

    def normals(self, name: str, out: SingleArray | None = None) -> SingleArray:
        """Unit normals of a garment's vertices in file order, shape [v, 3].

        Without `out`, an array that the next call for this garment overwrites.
        """
        worn = self._cast.worn[name]
        out = worn.normal if out is None else out
        vertex_normals(self.positions(name), worn.triangles, out)
        return out
