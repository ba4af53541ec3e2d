"""The kind ``bare_skin``: skin that leaves the shapes, which cloth is shown over.

Cloth does not meet it; see `sim.over_skin`. It follows the frames of its set as the kind ``mesh``
does, and has the same entries.
"""

from garment_sim_ros.contact.kinds.kind import Kind
from garment_sim_ros.contact.kinds.mesh import MESH

BARE_SKIN = Kind(
    name="bare_skin",
    code=7,
    keys=MESH.keys,
    is_bare=True,
    variants={"bare_skin": MESH.variants["mesh"]},
)
