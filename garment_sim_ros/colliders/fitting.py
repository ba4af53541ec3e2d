"""Colliders for a body by the name of a method: what nodes, commands and outfits fit with."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from garment_sim_ros.body.skin import Body
from garment_sim_ros.collider_params import (
    CAPSULES,
    ELLIPSOIDS,
    HULLS,
    MESH,
    SDF,
    SPHERES,
    EllipsoidSettings,
    HullSettings,
    SdfSettings,
)
from garment_sim_ros.contact import kinds
from garment_sim_ros.contact.kinds.ellipsoid import REFITTED
from garment_sim_ros.contact.shapes import ColliderSet
from garment_sim_ros.errors import ParameterError
from garment_sim_ros.params import ColliderOptions


@dataclass(frozen=True, kw_only=True)
class Fit:
    """A fit and what only its method tells about it.

    Attributes:
        colliders: Shapes, and one frame per major bone.
        notes: What people should know, one line each.
        missed: What was asked for and is not so, one line each.
        report: Makes the method's own figures; ``shapes`` among them are by collider.
    """

    colliders: ColliderSet
    notes: tuple[str, ...] = ()
    missed: tuple[str, ...] = ()
    report: Callable[[], dict[str, Any]] = dict


@dataclass(frozen=True, kw_only=True)
class Method:
    """A way to fit colliders.

    Attributes:
        text: What it makes, for people.
        fit: Fits a body.
        settings: The parameters that are its own; None where it has none.
        variants: Variants of colliders that it is sure to make, see `contact.kinds.kind.Kind`.
        covers_skin: Whether its shapes are to hold the skin, and what leaves them goes along with
            the set, see `colliders.bare_skin`.
    """

    text: str
    fit: Callable[[Body, ColliderOptions], Fit]
    settings: type[Any] | None = None
    variants: Callable[[ColliderOptions], set[str]]
    covers_skin: Callable[[ColliderOptions], bool] = lambda o: True


def fit_colliders(body: Body, options: ColliderOptions | None = None) -> ColliderSet:
    """What cloth on a body meets: shapes, and one frame per major bone.

    Args:
        body: Rig and skin.
        options: Method and its settings; capsules and spheres take only `delta`, signed distances
            also `merge` and whether there are `joints`, the mesh none.

    Raises:
        GeometryError: The body cannot be fitted.
        ParameterError: An option is out of range.
    """
    return fitted(body, options or ColliderOptions()).colliders


def fitted(body: Body, options: ColliderOptions) -> Fit:
    """The same with what the method tells about it.

    Args:
        body: Rig and skin.
        options: Method and its settings.

    Raises:
        GeometryError: The body cannot be fitted.
        ParameterError: An option is out of range.
    """
    method = options.method
    if method not in METHODS:
        raise ParameterError("method", f"found {method!r}", "allowed: " + ", ".join(METHODS))
    fit = METHODS[method].fit(body, options)
    if not METHODS[method].covers_skin(options):
        return fit
    from garment_sim_ros.colliders.bare_skin import with_bare_skin

    return replace(fit, colliders=with_bare_skin(body, fit.colliders))


# Each imports what only it needs: a fit that was kept needs none of it.


def _hulls(body: Body, options: ColliderOptions) -> Fit:
    from garment_sim_ros.colliders.hulls.hull_report import hull_report
    from garment_sim_ros.colliders.hulls.hulls import fit_hulls

    fit = fit_hulls(body, options, thickness=options.thickness)
    return Fit(
        colliders=fit.colliders,
        notes=tuple(
            f"{s.name}: {s.kind}, {s.note}" for s in fit.shapes if s.kind != kinds.HULL.name
        ),
        report=lambda: {"shapes": hull_report(fit)},
    )


def _grids(body: Body, options: ColliderOptions) -> Fit:
    from garment_sim_ros.colliders.signed_distance import fit_signed_distances

    fit = fit_signed_distances(
        body,
        options,
        delta=options.delta,
        merge=options.merge,
        bend=options.joints != "none",
        thickness=options.thickness,
    )
    return Fit(
        colliders=fit.colliders,
        notes=tuple(f"{grid.name}: {grid.note}" for grid in fit.shapes if grid.note),
        report=lambda: {"shapes": fit.report()},
    )


def _ellipsoids(body: Body, options: ColliderOptions) -> Fit:
    from garment_sim_ros.colliders.ellipsoids.ellipsoid_binding import fit_ellipsoids

    colliders, report = fit_ellipsoids(
        body, options, delta=options.delta, thickness=options.thickness
    )
    assumed = report.get("segmentation", {}).get("assumed", ())
    missed = []
    if over := report["over_mu"]:
        count = report["ellipsoids"]
        why = "max_ellipsoids" if count >= options.max_ellipsoids else "too few points to split"
        missed.append(
            f"{over} of {count} ellipsoids are over their threshold mu, by up to "
            f"{report['over_mu_mm_max']:.1f} mm: {why}"
        )
    return Fit(
        colliders=colliders,
        notes=tuple(f"assumed: {note}" for note in assumed),
        missed=tuple(missed),
        report=lambda: {"ellipsoid_fit": report},
    )


def _capsules(body: Body, options: ColliderOptions) -> Fit:
    from garment_sim_ros.colliders.capsules.capsules import fit_capsules

    return Fit(colliders=fit_capsules(body, delta=options.delta, thickness=options.thickness))


def _spheres(body: Body, options: ColliderOptions) -> Fit:
    from garment_sim_ros.colliders.capsules.capsules import fit_spheres

    return Fit(colliders=fit_spheres(body, delta=options.delta, thickness=options.thickness))


def _mesh(body: Body, options: ColliderOptions) -> Fit:
    from garment_sim_ros.colliders.exact_mesh import fit_mesh

    return Fit(colliders=fit_mesh(body, thickness=options.thickness))


METHODS: Mapping[str, Method] = {
    HULLS: Method(
        text="convex hulls of the skin of each bone, spheres and hulls at joints",
        fit=_hulls,
        settings=HullSettings,
        variants=lambda o: (
            {kinds.HULL.name} if o.joints == "none" else {kinds.HULL.name, kinds.SPHERE.name}
        ),
        covers_skin=lambda o: o.joints == "auto",
    ),
    CAPSULES: Method(
        text="tapered capsules", fit=_capsules, variants=lambda o: {kinds.CAPSULE.name}
    ),
    ELLIPSOIDS: Method(
        text="ellipsoids around regions of the skin",
        fit=_ellipsoids,
        settings=EllipsoidSettings,
        variants=lambda o: {kinds.ELLIPSOID.name, REFITTED} if o.refit else {kinds.ELLIPSOID.name},
        covers_skin=lambda o: False,
    ),
    SPHERES: Method(
        text="spheres in rows",
        fit=_spheres,
        variants=lambda o: {kinds.SPHERE.name},
        covers_skin=lambda o: False,
    ),
    SDF: Method(
        text="sampled signed distances",
        fit=_grids,
        settings=SdfSettings,
        variants=lambda o: {kinds.SDF.name},
    ),
    MESH: Method(
        text="the skin itself, exact and slow",
        fit=_mesh,
        variants=lambda o: {kinds.MESH.name},
        covers_skin=lambda o: False,
    ),
}
"""All methods, by the names that parameters, commands and outfits call them."""
