"""Collider kinds: a file and a record for each, and the table of all."""

from collections.abc import Mapping

from garment_sim_ros.contact.kinds.bare_skin import BARE_SKIN
from garment_sim_ros.contact.kinds.capsule import CAPSULE
from garment_sim_ros.contact.kinds.ellipsoid import ELLIPSOID
from garment_sim_ros.contact.kinds.frame import FRAME
from garment_sim_ros.contact.kinds.hull import HULL
from garment_sim_ros.contact.kinds.kind import Kind
from garment_sim_ros.contact.kinds.mesh import MESH
from garment_sim_ros.contact.kinds.sdf import SDF
from garment_sim_ros.contact.kinds.sphere import SPHERE

KINDS: Mapping[str, Kind] = {
    kind.name: kind
    for kind in (
        SPHERE,
        CAPSULE,
        ELLIPSOID,
        HULL,
        SDF,
        MESH,
        FRAME,
        BARE_SKIN,
    )
}
"""All kinds by name."""
