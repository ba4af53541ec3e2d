"""Colliders for a body by the name of a method."""

from garment_sim_ros.body.skin import Body
from garment_sim_ros.contact.shapes import ColliderSet
from garment_sim_ros.params import ColliderOptions


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
    options = options or ColliderOptions()
    delta, thickness = options.delta, options.thickness
    # Each imports what only it needs: a fit that was kept needs none of it.
    if options.method == "hulls":
        from garment_sim_ros.colliders.hulls.hulls import fit_hulls

        return fit_hulls(body, options, thickness=thickness).colliders
    if options.method == "ellipsoids":
        from garment_sim_ros.colliders.ellipsoids.ellipsoid_binding import fit_ellipsoids

        return fit_ellipsoids(body, options, delta=delta, thickness=thickness)[0]
    if options.method == "sdf":
        from garment_sim_ros.colliders.signed_distance import fit_signed_distances

        return fit_signed_distances(
            body,
            options,
            delta=delta,
            merge=options.merge,
            bend=options.joints != "none",
            thickness=thickness,
        ).colliders
    if options.method == "mesh":
        from garment_sim_ros.colliders.exact_mesh import fit_mesh

        return fit_mesh(body, thickness=thickness)
    from garment_sim_ros.colliders.capsules.capsules import fit_capsules, fit_spheres

    fit = fit_capsules if options.method == "capsules" else fit_spheres
    return fit(body, delta=delta, thickness=thickness)
