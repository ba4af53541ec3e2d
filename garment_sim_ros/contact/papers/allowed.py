"""Which colliders the papers' contact methods know."""

from garment_sim_ros.contact.kinds.ellipsoid import ELLIPSOID
from garment_sim_ros.contact.kinds.hull import HULL
from garment_sim_ros.contact.kinds.sphere import SPHERE
from garment_sim_ros.contact.shapes import ColliderSet
from garment_sim_ros.errors import ParameterError

_KNOWN = {"earliest": (SPHERE, ELLIPSOID), "rays": (SPHERE, ELLIPSOID, HULL)}
_WORDS = {
    "earliest": "with ellipsoids and spheres (fit --method ellipsoids)",
    "rays": "with hulls, ellipsoids and spheres",
}


def check_contact(contact: str, colliders: ColliderSet) -> None:
    """Whether a contact method is possible with colliders; others than the papers' always are.

    Raises:
        ParameterError: Colliders of a kind that it does not know.
    """
    if contact not in _KNOWN:
        return
    known = _KNOWN[contact]
    others = {c.kind for c in colliders.colliders if c.is_met and c.record not in known}
    if others:
        raise ParameterError(
            "contact",
            f"found {contact!r} with {', '.join(sorted(others))} colliders",
            f"allowed: {_WORDS[contact]}",
        )
