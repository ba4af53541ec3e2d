"""A sewing pattern of our own on a body; sewing takes a minute, so that it is done once."""

import hashlib

from garment_sim_ros.avatar import Avatar
from garment_sim_ros.disk_cache import Arrays, array_digest, cached_arrays, code_digest
from garment_sim_ros.garment.mesh_data import GarmentMesh
from garment_sim_ros.garment.outfit import Outfit
from garment_sim_ros.garment.patterns.making import DRAFTS, Model, make

_CODE = ("body", "colliders", "contact", "garment", "geometry", "sim")
"""Packages of which a sewn garment depends."""


def sewn_on(avatar: Avatar, pattern: str) -> Outfit:
    """A garment that is cut, sewn and draped on a body, and worn on its colliders.

    The sewn surface is kept in the user's cache, for this code and this body.

    Args:
        avatar: The body with its colliders.
        pattern: Name of one of `making.DRAFTS`.

    Raises:
        GeometryError: The body cannot be dressed in it.
    """
    skin = avatar.body.skin
    parts = (code_digest(*_CODE), array_digest(skin.vertices, skin.triangles), pattern)
    key = hashlib.sha256("".join(parts).encode()).hexdigest()

    def sewn() -> Arrays:
        made = make(pattern, Model(avatar.body)).sewn
        return {"vertices": made.vertices, "triangles": made.triangles, "flat": made.flat}

    kept = cached_arrays("sewn", key, sewn)
    mesh = GarmentMesh(vertices=kept["vertices"], triangles=kept["triangles"], flat=kept["flat"])
    return avatar.dress(mesh, name=pattern, material=DRAFTS[pattern].fabric)
