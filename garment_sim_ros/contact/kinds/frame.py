"""The kind ``frame``: a place on a bone that attachments, skins and refitted shapes move with."""

from garment_sim_ros.contact.kinds.kind import Kind

FRAME = Kind(name="frame", code=6, keys=(), variants={"frame": {}})
