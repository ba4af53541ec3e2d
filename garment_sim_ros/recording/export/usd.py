"""USD: garments with time samples, the body as a skinned mesh on an animated skeleton."""

from pathlib import Path
from typing import Any

import numpy as np

from garment_sim_ros.arrays import AnyArray
from garment_sim_ros.body.kinematics import rest_transforms
from garment_sim_ros.body.skin import Body
from garment_sim_ros.errors import InputFileError
from garment_sim_ros.geometry.transforms import invert_transform, quaternion_from_matrix
from garment_sim_ros.recording.export.frames import SKIN_COLOUR, Frames, Progress, Surface


def write_usd(frames: Frames, path: Path, *, progress: Progress) -> dict[str, Any]:
    """Write a .usda, .usdc or .usd file: z up, metres, time codes in frames.

    Raises:
        InputFileError: The package usd-core is not installed.
    """
    try:
        from pxr import Usd, UsdGeom
    except ImportError:
        raise InputFileError(
            f"--out {path.name}",
            "USD needs the package usd-core",
            "install it with: pip install 'garment_sim_ros[usd]'",
        ) from None
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    codes = (frames.times * frames.rate).tolist()
    stage.SetTimeCodesPerSecond(frames.rate)
    stage.SetFramesPerSecond(frames.rate)
    stage.SetStartTimeCode(codes[0])
    stage.SetEndTimeCode(codes[-1])
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/avatar").GetPrim())
    UsdGeom.Scope.Define(stage, "/avatar/garments")
    for surface in frames.garments.values():
        points = _mesh(stage, f"/avatar/{surface.name}", surface, surface.at(0))
        extents = UsdGeom.Boundable(points.GetPrim()).CreateExtentAttr()
        for k, code in enumerate(progress(codes, f"writing {surface.name}", len(codes))):
            x = surface.at(k)
            points.GetPointsAttr().Set(_vec3(x), code)
            extents.Set(_vec3(np.stack([x.min(axis=0), x.max(axis=0)])), code)
    if frames.body is not None:
        _body(stage, frames, frames.body, codes)
    stage.Save()
    return {"error_mm": 0.0}


def _vec3(x: AnyArray) -> Any:
    from pxr import Vt

    return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(x, np.float32))


def _mesh(stage: Any, path: str, surface: Surface, x: AnyArray) -> Any:
    """A mesh that is seen from both sides and not subdivided."""
    from pxr import UsdGeom, Vt

    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateDoubleSidedAttr(True)
    counts = np.full(len(surface.triangles), 3, np.int32)
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(counts))
    corners = np.ascontiguousarray(surface.triangles.reshape(-1), np.int32)
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(corners))
    mesh.CreatePointsAttr(_vec3(x))
    mesh.CreateDisplayColorAttr(_vec3(np.array([surface.colour]) ** 2.2))
    return mesh


def _matrices(T: AnyArray) -> Any:
    """USD multiplies rows from the left."""
    from pxr import Vt

    return Vt.Matrix4dArray.FromNumpy(np.ascontiguousarray(np.swapaxes(T, 1, 2), np.float64))


def _body(stage: Any, frames: Frames, body: Body, codes: list[float]) -> None:
    from pxr import Gf, UsdGeom, UsdSkel, Vt

    rig, skin = body.rig, body.skin
    root = UsdSkel.Root.Define(stage, "/avatar/body")
    skeleton = UsdSkel.Skeleton.Define(stage, "/avatar/body/skeleton")
    motion = UsdSkel.Animation.Define(stage, "/avatar/body/skeleton/recorded")
    # A joint's token is its path; names need not be identifiers, so numbers stand beside them.
    tokens: list[str] = []
    for j, name in enumerate(rig.joint_names):
        own = f"j{j}_" + "".join(c if c.isascii() and c.isalnum() else "_" for c in name)
        parent = int(rig.parent[j])
        tokens.append(own if parent < 0 else f"{tokens[parent]}/{own}")
    skeleton.CreateJointsAttr(tokens)
    skeleton.CreateBindTransformsAttr(_matrices(invert_transform(skin.T_bone_bind)))
    skeleton.CreateRestTransformsAttr(_matrices(rig.T_parent_joint))
    motion.CreateJointsAttr(tokens)
    motion.CreateScalesAttr(Vt.Vec3hArray([Gf.Vec3h(1.0)] * len(rig)))
    above = np.maximum(rig.parent, 0)
    for k, code in enumerate(codes):
        T = frames.joints[k]
        local = np.where(rig.parent[:, None, None] < 0, T, invert_transform(T[above]) @ T)
        q = quaternion_from_matrix(local[:, :3, :3]).tolist()
        turns = Vt.QuatfArray([Gf.Quatf(w, x, y, z) for x, y, z, w in q])
        motion.CreateRotationsAttr().Set(turns, code)
        motion.CreateTranslationsAttr().Set(_vec3(local[:, :3, 3]), code)
    UsdSkel.BindingAPI.Apply(skeleton.GetPrim()).CreateAnimationSourceRel().AddTarget(
        motion.GetPath()
    )
    surface = Surface(
        name="body", triangles=skin.triangles, colour=SKIN_COLOUR, at=frames.joints.take
    )
    mesh = _mesh(stage, "/avatar/body/skin", surface, skin.vertices)
    binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    binding.CreateSkeletonRel().AddTarget(skeleton.GetPath())
    binding.CreateGeomBindTransformAttr(Gf.Matrix4d(1.0))
    width = skin.bone.shape[1]
    bones = np.ascontiguousarray(skin.bone.reshape(-1), np.int32)
    binding.CreateJointIndicesPrimvar(False, width).Set(Vt.IntArray.FromNumpy(bones))
    weights = np.ascontiguousarray(skin.weight.reshape(-1), np.float32)
    binding.CreateJointWeightsPrimvar(False, width).Set(Vt.FloatArray.FromNumpy(weights))
    reach = rest_transforms(rig)[:, :3, 3]
    UsdGeom.Boundable(root.GetPrim()).CreateExtentAttr(
        _vec3(np.stack([reach.min(axis=0), reach.max(axis=0)]))
    )
