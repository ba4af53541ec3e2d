"""Exports: what is read back from every format is what the bag has."""

import json
import shutil
import struct
import subprocess
import sys

import numpy as np
import pytest
import trimesh
from rosbags.rosbag2 import StoragePlugin, Writer
from unit.test_recording import STORE, cloud, joints, message, topology

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.cli import main as cli
from garment_sim_ros.geometry.transforms import AXES_FROM_Y_UP
from garment_sim_ros.mocap.source_urdf import urdf_from_clip
from garment_sim_ros.mocap.walk import walk
from garment_sim_ros.recording.export.frames import read_frames
from garment_sim_ros.recording.export.shapes import normals_of, shapes_of

FRAMES = 40
PERIOD = 16_666_667
BODY = "mannequin:vertices=1200"
SIDE = 7
SHOWN = (0, FRAMES // 2, FRAMES - 1)

VALIDATE = """
const v = require('gltf-validator');
v.validateBytes(new Uint8Array(require('fs').readFileSync(process.argv[1])))
 .then(r => console.log(JSON.stringify(r.issues)));
"""


def cloth():
    """A flag that turns, walks and waves, shape [FRAMES, SIDE^2, 3], and its triangles."""
    u, w = np.meshgrid(np.linspace(0, 0.5, SIDE), np.linspace(0, 0.5, SIDE))
    u, w = u.ravel(), w.ravel()
    rng = np.random.default_rng(5)
    x = []
    for k in range(FRAMES):
        a, t = 0.1 * k, k / 60
        wave = 0.05 * np.sin(9 * u - 7 * t) + 0.002 * rng.standard_normal(len(u))
        flag = np.column_stack([u, wave, w])
        turn = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])
        x.append(flag @ turn.T + [t, 0.2, 1.0])
    corner = np.arange(SIDE * SIDE).reshape(SIDE, SIDE)
    a, b, c, d = (
        q.ravel() for q in (corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1])
    )
    triangles = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return np.array(x, np.float32), triangles.astype(np.int32)


X, TRIANGLES = cloth()


def written(path, names=("flag",), spoil=None):
    clip = walk()
    text = message("std_msgs/msg/String", data=urdf_from_clip(clip))
    messages = [("/robot_description", 1, text)]
    messages += [
        (f"/garments/{n}/topology", 1, topology(X[0].astype(float), TRIANGLES)) for n in names
    ]
    for k in range(FRAMES):
        stamp = 10**18 + k * PERIOD
        values = [np.interp(1e-9 * k * PERIOD, clip.times, v) for v in clip.values.T]
        messages.append(("/joint_states", stamp, joints(stamp, list(clip.rig.dofs.names), values)))
        x = X[k].copy()
        if k == spoil:
            x[3, 1] = np.nan
        messages += [(f"/garments/{n}/points", stamp, cloud(stamp, x, 12)) for n in names]
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections = {}
        for topic, arrival, content in messages:
            kind = content.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=STORE)
            writer.write(connections[topic], arrival, STORE.serialize_cdr(content, kind))
    return path


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    return written(tmp_path_factory.mktemp("recorded") / "bag")


@pytest.fixture(scope="module")
def truth(bag):
    """Vertices of each surface at the frames SHOWN, as the skinner and the bag have them."""
    frames = read_frames(bag, load_body(BODY))
    assert len(frames.times) == FRAMES
    return {s.name: np.array([s.at(k).copy() for k in SHOWN]) for s in frames.surfaces()}


def export(bag, out, *words, body=BODY):
    return cli.main(["export", str(bag), "--out", str(out), "--body", body, *words])


def z_up(x):
    return np.asarray(x, float) @ AXES_FROM_Y_UP.T


class Glb:
    """A plain reader, float64, of what glTF says."""

    def __init__(self, path):
        data = path.read_bytes()
        size = struct.unpack("<I", data[12:16])[0]
        self.json = json.loads(data[20 : 20 + size])
        self.binary = data[28 + size :]

    def array(self, index):
        a = self.json["accessors"][index]
        kind = {5126: "<f4", 5123: "<u2", 5125: "<u4"}[a["componentType"]]
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}[a["type"]]
        if "bufferView" not in a:
            return np.zeros((a["count"], width))
        start = self.json["bufferViews"][a["bufferView"]]["byteOffset"]
        return np.frombuffer(self.binary, kind, a["count"] * width, start).reshape(-1, width)

    def moved(self, frame):
        """Local transform of each node at a frame, and weights of those that have some."""
        nodes = [dict(n) for n in self.json["nodes"]]
        animation = self.json["animations"][0]
        for c in animation["channels"]:
            sampler = animation["samplers"][c["sampler"]]
            rows = self.array(sampler["output"])
            if c["target"]["path"] == "weights":
                rows = rows.reshape(len(self.array(sampler["input"])), -1)
            nodes[c["target"]["node"]][c["target"]["path"]] = rows[frame]
        return nodes

    def surfaces(self, frame):
        nodes = self.moved(frame)
        world = {}

        def go(k, above):
            x, y, z, w = np.asarray(nodes[k].get("rotation", (0, 0, 0, 1)), float)
            T = np.eye(4)
            T[:3, :3] = np.eye(3) + 2 * np.array(
                [
                    [-y * y - z * z, x * y - z * w, x * z + y * w],
                    [x * y + z * w, -x * x - z * z, y * z - x * w],
                    [x * z - y * w, y * z + x * w, -x * x - y * y],
                ]
            )
            T[:3, 3] = nodes[k].get("translation", (0, 0, 0))
            world[k] = above @ T
            for child in nodes[k].get("children", ()):
                go(child, world[k])

        for root in self.json["scenes"][0]["nodes"]:
            go(root, np.eye(4))
        found = {}
        for k, node in enumerate(nodes):
            if "mesh" not in node:
                continue
            (primitive,) = self.json["meshes"][node["mesh"]]["primitives"]
            of = primitive["attributes"]
            x = self.array(of["POSITION"]).astype(float)
            for w, target in zip(node.get("weights", ()), primitive.get("targets", ())):
                x = x + float(w) * self.array(target["POSITION"])
            T = np.tile(world[k], (len(x), 1, 1))
            if "skin" in node:
                skin = self.json["skins"][node["skin"]]
                bind = self.array(skin["inverseBindMatrices"]).reshape(-1, 4, 4)
                bones = [world[j] @ b.T for j, b in zip(skin["joints"], bind.astype(float))]
                T = np.zeros((len(x), 4, 4))
                for s in range(sum(name.startswith("JOINTS") for name in of)):
                    bone, share = self.array(of[f"JOINTS_{s}"]), self.array(of[f"WEIGHTS_{s}"])
                    T += np.einsum("vk,vkij->vij", share, np.array(bones)[bone])
            found[node["name"]] = z_up(np.einsum("vij,vj->vi", T[:, :3, :3], x) + T[:, :3, 3])
        return found


@pytest.mark.parametrize("error", [0.5, 5.0])
def test_glb_has_body_and_garments_within_the_bound(bag, truth, tmp_path, capsys, error):
    assert export(bag, tmp_path / "a.glb", "--error", str(error), "--json") == 0
    told = json.loads(capsys.readouterr().out.splitlines()[-1])
    glb = Glb(tmp_path / "a.glb")
    for i, frame in enumerate(SHOWN):
        found = glb.surfaces(frame)
        assert np.abs(found["body"] - truth["body"][i]).max() < 1e-5
    worst = max(
        np.linalg.norm(glb.surfaces(k)["flag"] - X[k], axis=1).max() for k in range(FRAMES)
    )
    assert worst < 1e-3 * error
    assert 1e3 * worst == pytest.approx(told["error_mm"], abs=2e-3)
    assert told["targets"]["flag"] < FRAMES
    assert all(m["doubleSided"] for m in glb.json["materials"])
    times = glb.array(glb.json["animations"][0]["samplers"][0]["input"]).ravel()
    assert times == pytest.approx(np.arange(FRAMES) * 1e-9 * PERIOD, abs=1e-6)


def test_wider_bounds_make_smaller_files(bag, tmp_path):
    for error in ("0.5", "20"):
        assert export(bag, tmp_path / f"{error}.glb", "--error", error) == 0
    assert (tmp_path / "20.glb").stat().st_size < (tmp_path / "0.5.glb").stat().st_size


def test_weights_lie_where_blender_keeps_them():
    shapes = shapes_of(X, 1e-3)
    assert shapes.weights.min() >= 0.0
    assert shapes.weights.max() <= 1.0
    made = shapes.base + np.tensordot(shapes.weights, shapes.targets, 1)
    made = np.einsum("fij,fvj->fvi", shapes.rotation, made) + shapes.centre[:, None]
    assert np.linalg.norm(made - X, axis=2).max() < 1e-3


def test_normals_turn_with_the_shape():
    shapes = shapes_of(X, 1e-4)
    base, turned = normals_of(X, TRIANGLES, shapes)
    assert np.linalg.norm(base, axis=1) == pytest.approx(1.0, abs=1e-5)
    for k in SHOWN:
        n = base + np.tensordot(shapes.weights[k, : len(turned)], turned, 1)
        n = n / np.linalg.norm(n, axis=1, keepdims=True) @ shapes.rotation[k].T
        mesh = trimesh.Trimesh(X[k], TRIANGLES, process=False)
        assert (n * mesh.vertex_normals).sum(axis=1).min() > 0.95


def test_a_surface_that_only_moves_rigidly_needs_no_targets():
    x = np.array([X[0] + [0.1 * k, 0, 0] for k in range(5)])
    assert len(shapes_of(x, 1e-3).targets) == 0


def test_validator_finds_nothing(bag, tmp_path):
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed")
    if subprocess.run([node, "-e", "require('gltf-validator')"], capture_output=True).returncode:
        pytest.skip("the npm package gltf-validator is not in NODE_PATH")
    assert export(bag, tmp_path / "a.glb") == 0
    words = [node, "-e", VALIDATE, str(tmp_path / "a.glb")]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    assert json.loads(done.stdout)["messages"] == []


@pytest.mark.parametrize("kind", ["obj", "ply"])
def test_sequences_have_every_frame(bag, truth, tmp_path, kind):
    assert export(bag, tmp_path / "out", "--format", kind) == 0
    turn = z_up if kind == "obj" else np.asarray
    for name, x in truth.items():
        assert len(list((tmp_path / "out" / name).iterdir())) == FRAMES
        for i, k in enumerate(SHOWN):
            mesh = trimesh.load(tmp_path / "out" / name / f"{k + 1:04d}.{kind}", process=False)
            assert turn(mesh.vertices) == pytest.approx(x[i], abs=1e-6)
    assert np.array_equal(mesh.faces, load_body(BODY).skin.triangles)


@pytest.mark.parametrize("kind", ["pc2", "mdd"])
def test_caches_have_every_frame_in_the_order_of_their_mesh(bag, truth, tmp_path, kind):
    assert export(bag, tmp_path / "out", "--format", kind) == 0
    for name, x in truth.items():
        data = (tmp_path / "out" / f"{name}.{kind}").read_bytes()
        if kind == "pc2":
            mark, version, count, start, rate, samples = struct.unpack_from("<12siiffi", data)
            assert (mark, version, start, rate) == (b"POINTCACHE2\0", 1, 0.0, 1.0)
            rows = np.frombuffer(data, "<f4", offset=32)
        else:
            samples, count = struct.unpack_from(">ii", data)
            times = np.frombuffer(data, ">f4", samples, 8)
            assert times == pytest.approx(np.arange(FRAMES) * 1e-9 * PERIOD, abs=1e-6)
            rows = np.frombuffer(data, ">f4", offset=8 + 4 * samples)
        assert samples == FRAMES
        rows = rows.reshape(samples, count, 3)
        assert z_up(rows[list(SHOWN)]) == pytest.approx(x, abs=1e-6)
        mesh = trimesh.load(tmp_path / "out" / f"{name}.obj", process=False)
        assert mesh.vertices == pytest.approx(rows[0], abs=1e-6)


@pytest.mark.parametrize("suffix", ["usda", "usdc"])
def test_usd_has_time_samples(bag, truth, tmp_path, suffix):
    pxr = pytest.importorskip("pxr", reason="usd-core is not installed")
    from pxr import Usd, UsdGeom, UsdSkel

    assert pxr
    assert export(bag, tmp_path / f"a.{suffix}") == 0
    stage = Usd.Stage.Open(str(tmp_path / f"a.{suffix}"))
    root, skeleton = UsdSkel.Root.Get(stage, "/avatar/body"), "/avatar/body/skeleton"
    cache = UsdSkel.Cache()
    cache.Populate(root, Usd.PrimDefaultPredicate)
    query = cache.GetSkelQuery(UsdSkel.Skeleton.Get(stage, skeleton))
    skin = stage.GetPrimAtPath("/avatar/body/skin")
    for i, k in enumerate(SHOWN):
        flag = UsdGeom.Mesh.Get(stage, "/avatar/garments/flag")
        assert np.array(flag.GetPointsAttr().Get(float(k))) == pytest.approx(X[k], abs=1e-6)
        assert flag.GetDoubleSidedAttr().Get()
        points = UsdGeom.Mesh(skin).GetPointsAttr().Get()
        moved = query.ComputeSkinningTransforms(float(k))
        cache.GetSkinningQuery(skin).ComputeSkinnedPoints(moved, points, float(k))
        assert np.array(points) == pytest.approx(truth["body"][i], abs=1e-5)


def refused(words, capsys, tmp_path):
    before = sorted(tmp_path.rglob("*"))
    capsys.readouterr()
    assert words() == 2
    text = capsys.readouterr().err
    assert text.startswith("error: ")
    assert text.count("\n") == 1
    assert sorted(tmp_path.rglob("*")) == before
    return text


def test_usd_without_its_package_is_one_line(bag, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "pxr", None)
    text = refused(lambda: export(bag, tmp_path / "new" / "a.usda"), capsys, tmp_path)
    assert "garment_sim_ros[usd]" in text


def test_rate_evens_the_frames(bag):
    frames = read_frames(bag, None, rate=30.0)
    assert frames.times == pytest.approx(np.arange(len(frames.times)) / 30.0, abs=1e-8)
    for k in (0, 5):
        assert frames.positions["flag"][k] == pytest.approx(X[2 * k], abs=1e-4)


def test_a_bag_without_garments_has_its_body(tmp_path, capsys):
    bag = written(tmp_path / "bag", names=())
    assert export(bag, tmp_path / "a.glb") == 0
    assert set(Glb(tmp_path / "a.glb").surfaces(3)) == {"body"}
    text = refused(lambda: export(bag, tmp_path / "b.glb", body="none"), capsys, tmp_path)
    assert "has no garments" in text


def test_garments_without_a_body(bag, tmp_path):
    assert export(bag, tmp_path / "a.glb", body="none") == 0
    assert set(Glb(tmp_path / "a.glb").surfaces(3)) == {"flag"}


def test_a_bag_cut_short_leaves_nothing(tmp_path, capsys):
    bag = written(tmp_path / "bag")
    file = next(bag.glob("*.mcap"))
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    refused(lambda: export(bag, tmp_path / "new" / "a.glb"), capsys, tmp_path)


def test_names_that_lead_out_of_the_folder_are_refused(tmp_path, capsys):
    bag = written(tmp_path / "bag", names=("..",))
    text = refused(lambda: export(bag, tmp_path / "new", body="none"), capsys, tmp_path)
    assert "named '..'" in text


def test_frames_that_are_not_finite_are_refused(tmp_path, capsys):
    bag = written(tmp_path / "bag", spoil=7)
    text = refused(lambda: export(bag, tmp_path / "a.glb"), capsys, tmp_path)
    assert "not finite" in text


@pytest.mark.parametrize(
    ("out", "words"),
    [
        ("a.fbx", []),
        ("a.glb", ["--format", "obj"]),
        ("a.glb", ["--error", "0"]),
        ("a.glb", ["--error", "nan"]),
        ("a.glb", ["--rate", "0"]),
        ("a.glb", ["--rate", "inf"]),
    ],
)
def test_options_that_do_not_fit_are_refused(bag, tmp_path, capsys, out, words):
    refused(lambda: export(bag, tmp_path / out, *words), capsys, tmp_path)


def test_a_full_disk_leaves_nothing(bag, tmp_path, monkeypatch, capsys):
    from garment_sim_ros.glb_writer import GlbWriter

    def full(self, path):
        path.write_bytes(b"half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(GlbWriter, "write", full)
    text = refused(lambda: export(bag, tmp_path / "new" / "a.glb"), capsys, tmp_path)
    assert "No space left" in text
