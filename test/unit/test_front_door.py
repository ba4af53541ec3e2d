"""The package from Python: public names, bodies, garments, simulation."""

import ast
import itertools
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import garment_sim_ros as gs
from garment_sim_ros.contact.packed import pack
from garment_sim_ros.garment.materials import PRESETS
from garment_sim_ros.geometry.topology import mesh_topology, vertex_normals
from garment_sim_ros.geometry.transforms import transform_from
from garment_sim_ros.mocap.clip_poses import retargeter
from garment_sim_ros.mocap.sampling import ClipSampler
from garment_sim_ros.params import RelaxationSettings

ROOT = Path(__file__).resolve().parents[2]
TURN = transform_from(np.array([0.3, -0.2, 0.5]), np.array([0.5, 0.5, 0.5, 0.5]))


@pytest.fixture(scope="module")
def avatar():
    return gs.Avatar.load("mannequin", method="capsules")


class TestNames:
    def test_all_can_be_had_and_are_listed(self):
        for name in gs.__all__:
            assert getattr(gs, name) is not None
        assert set(gs.__all__) <= set(dir(gs))
        with pytest.raises(AttributeError, match="no attribute 'Avatars'"):
            gs.Avatars  # noqa: B018

    def test_type_checkers_see_the_same_names_in_the_same_places(self):
        tree = ast.parse(Path(gs.__file__).read_text())
        guarded = next(n for n in tree.body if isinstance(n, ast.If)).body
        seen = {
            alias.name: node.module.removeprefix("garment_sim_ros.")
            for node in guarded
            for alias in node.names
        }
        assert seen == gs._MODULE_OF
        assert sorted(seen) == gs.__all__

    def test_importing_the_package_imports_nothing_else(self):
        code = """
import sys, garment_sim_ros
mine = [m for m in sys.modules if m.startswith("garment_sim_ros.")]
loaded = set(mine) - {"garment_sim_ros.version"}
assert not loaded and "numpy" not in sys.modules, loaded
garment_sim_ros.ParameterError
assert "numpy" not in sys.modules
"""
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr

    @pytest.mark.parametrize("folder", ["test", "bench", "examples"])
    def test_nobody_reaches_past_the_public_members_of_a_simulation(self, folder):
        private = re.compile(r"\b(simulation|sim|scene|one|moved)\._[a-z]|\._(worn|under)\b")
        found = [
            f"{path.name}:{number}: {line.strip()}"
            for path in sorted((ROOT / folder).rglob("*.py"))
            for number, line in enumerate(path.read_text().splitlines(), start=1)
            if private.search(line) and path.name != Path(__file__).name
        ]
        assert not found


class TestShapes:
    def test_names_are_made_unique_and_frames_come_first(self):
        colliders = gs.ColliderSet.of(
            gs.sphere(0.1), gs.sphere(0.2, bone="arm"), gs.box((1, 1, 1), name="floor")
        )
        names = [c.name for c in colliders.colliders]
        assert names == ["frame_world", "frame_arm", "sphere", "sphere_2", "floor"]

    @pytest.mark.parametrize("end", [(0.3, 0.1, -0.2), (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)])
    def test_a_capsule_runs_from_start_to_end(self, end):
        capsule = gs.capsule((0.1, 0.2, 0.3), end, 0.05, 0.08)
        T = transform_from(capsule.position, capsule.orientation)
        np.testing.assert_allclose(
            T @ [0, 0, capsule.geometry["length"], 1], [*end, 1.0], atol=1e-12
        )
        assert (capsule.geometry["radius0"], capsule.geometry["radius1"]) == (0.05, 0.08)

    def test_a_box_is_a_closed_hull_that_looks_outwards(self):
        box = gs.box((0.2, 0.4, 0.6))
        a, b, c = (box.geometry["vertices"][box.geometry["faces"][:, k]] for k in range(3))
        volume = np.einsum("fi,fi->", a, np.cross(b, c)) / 6.0
        assert volume == pytest.approx(0.2 * 0.4 * 0.6)
        assert len(mesh_topology(box.geometry["faces"]).edges) == 18

    def test_all_of_them_can_be_simulated(self):
        shapes = (
            gs.sphere(0.1),
            gs.capsule((0, 0, 0), (0, 0, 1), 0.1),
            gs.ellipsoid((0.1, 0.2, 0.3)),
            gs.box((1, 1, 1)),
        )
        assert len(pack(gs.ColliderSet.of(*shapes)).kind) == 4

    @pytest.mark.parametrize(
        ("make", "message"),
        [
            (lambda: gs.sphere(0.0), "radius: found 0 m"),
            (lambda: gs.capsule((0, 0, 0), (0, 0, 0), 0.1), "length: found 0 m"),
            (lambda: gs.ellipsoid((0.1, 0.1)), "found 2 of them; allowed: 3"),
            (lambda: gs.box((1.0, np.inf, 1.0)), "size: found inf m"),
            (lambda: gs.sphere(0.1, (0.0, np.nan, 0.0)), "position must be 3 finite"),
        ],
    )
    def test_measures_that_cannot_be(self, make, message):
        with pytest.raises(gs.GeometryError, match=message):
            make()

    def test_poses_are_those_of_the_bones(self):
        colliders = gs.ColliderSet.of(gs.sphere(0.1, (0.0, 0.0, 0.2), bone="arm"))
        still = colliders.poses()
        np.testing.assert_allclose(still.position, [[0, 0, 0], [0, 0, 0], [0, 0, 0.2]])
        moved = colliders.poses({"arm": TURN})
        np.testing.assert_allclose(moved.position[2], (TURN @ [0, 0, 0.2, 1])[:3])
        np.testing.assert_allclose(moved.orientation[2], [0.5, 0.5, 0.5, 0.5])
        np.testing.assert_allclose(colliders.poses({"arm": (1, 2, 3)}).position[1], [1, 2, 3])
        np.testing.assert_allclose(moved.position[0], 0.0)
        with pytest.raises(gs.MessageError, match="found 'leg'; allowed: arm, world"):
            colliders.poses({"leg": TURN})
        with pytest.raises(gs.MessageError, match=r"found shape \(3, 3\)"):
            colliders.poses({"arm": np.eye(3)})


class TestGarments:
    @pytest.mark.parametrize("upright", [False, True])
    def test_a_sheet_has_the_size_and_the_place_asked_for(self, upright):
        sheet = gs.Garment.sheet(0.5, 0.3, edge=0.05, at=(1.0, 2.0, 3.0), upright=upright)
        x = sheet.vertices
        assert x.shape == (77, 3)
        extent = [0.5, 0.0, 0.3] if upright else [0.5, 0.3, 0.0]
        np.testing.assert_allclose(np.ptp(x, axis=0), extent, atol=1e-12)
        np.testing.assert_allclose(x.mean(axis=0), [1.0, 2.0, 3.0])
        a, b, c = (x[sheet.triangles[:, k]] for k in range(3))
        twice = np.cross(b - a, c - a)
        assert twice.sum(axis=0) == pytest.approx([0, -0.3, 0] if upright else [0, 0, 0.3])
        assert (twice @ twice.sum(axis=0) > 0.0).all()
        assert sheet.material == PRESETS["cotton_jersey"].material

    def test_pins_by_name(self):
        def pinned(pins):
            sheet = gs.Garment.sheet(0.4, 0.2, edge=0.1, upright=True, pins=pins)
            return sheet.vertices[sheet.pins][:, [0, 2]].round(9).tolist()

        top = [[-0.2, 0.1], [-0.1, 0.1], [0.0, 0.1], [0.1, 0.1], [0.2, 0.1]]
        assert pinned("top") == top
        assert pinned("top corners") == [top[0], top[-1]]
        assert sorted(pinned("corners")) == [[-0.2, -0.1], [-0.2, 0.1], [0.2, -0.1], [0.2, 0.1]]
        assert pinned([7]) == [[0.0, 0.0]]
        with pytest.raises(gs.ParameterError, match="pins: found 'left'; allowed: vertices, or"):
            pinned("left")

    @pytest.mark.parametrize(
        ("wrong", "message"),
        [
            ({"width": 0.0}, "width: found 0.0; allowed: above 0 m"),
            ({"edge": float("nan")}, "edge: found nan"),
            ({"edge": 1e-5}, "edge: 1e-05 m gives 1e\\+10 vertices"),
            ({"material": "paper"}, "material: found 'paper'"),
            ({"pins": [999]}, "pins must lie in 0..35"),
        ],
    )
    def test_sheets_that_cannot_be(self, wrong, message):
        with pytest.raises(gs.GarmentSimError, match=message):
            gs.Garment.sheet(**{"width": 1.0, "height": 1.0, "edge": 0.2, **wrong})

    def test_from_arrays(self):
        square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
        garment = gs.Garment.from_mesh(
            square, [[0, 1, 2], [0, 2, 3]], name="cape", bone="chest", pins=[0, 1], layer=2
        )
        assert (garment.frames, garment.layer, garment.name) == (("chest",), 2, "cape")
        assert garment.pins.tolist() == [0, 1]
        fine = gs.Garment.from_mesh(square, [[0, 1, 2], [0, 2, 3]], edge=0.3)
        assert len(fine.vertices) > 20
        np.testing.assert_array_equal(fine.vertices[:4], square)
        apart = gs.Garment.from_mesh(square, [[0, 1, 2], [0, 2, 3]], self_collision=True)
        assert 0.0 < apart.self_collision < 1.0
        with pytest.raises(gs.GeometryError, match=r"triangles: found shape \(0,\)"):
            gs.Garment.from_mesh(square)

    def test_from_a_file(self, tmp_path):
        path = tmp_path / "square.obj"
        path.write_text("v 0 0 0\nv 10 0 0\nv 10 0 10\nv 0 0 10\nf 1 4 3 2\n")
        garment = gs.Garment.from_mesh(path, unit="cm", material={"friction": 0.9})
        assert np.ptp(garment.vertices, axis=0) == pytest.approx([0.1, 0.1, 0.0])
        assert garment.material.friction == 0.9
        with pytest.raises(gs.ParameterError, match="unit: found 'ell'; allowed: m, dm, cm"):
            gs.Garment.from_mesh(path, unit="ell")
        with pytest.raises(gs.ParameterError, match="triangles: found some beside"):
            gs.Garment.from_mesh(path, [[0, 1, 2]])


class TestSimulation:
    @staticmethod
    def scene(**options):
        colliders = gs.ColliderSet.of(gs.sphere(0.1))
        sheet = gs.Garment.sheet(0.3, 0.3, edge=0.05, at=(0, 0, 0.15))
        return gs.Simulation(sheet, colliders, **options)

    def test_steps_are_a_reset_and_advances(self):
        stepped, advanced = self.scene(), self.scene()
        still = advanced.collider_set.poses()
        paths = [still.copy() for _ in range(5)]
        for n, poses in enumerate(paths):
            poses.position[1] += [0.01 * n, 0.0, 0.0]
        for poses in paths:
            stepped.step(poses, dt=1 / 50)
        advanced.reset(paths[0])
        for start, end in itertools.pairwise(paths):
            advanced.advance(start, end, 1 / 50)
        np.testing.assert_array_equal(stepped["sheet"].positions, advanced.positions("sheet"))
        assert stepped.time == pytest.approx(0.08)

    def test_it_goes_on_from_where_the_colliders_are(self):
        """Whoever brought them there, and whatever becomes of the poses given."""
        for how in ("step", "advance", "transport", "reset"):
            simulation = self.scene()
            poses = simulation.collider_set.poses()
            simulation.step(poses)
            there = simulation.collider_set.poses({"world": (0.0, 0.0, 0.03)})
            if how == "step":
                simulation.step(there)
            elif how == "reset":
                simulation.reset(there)
            else:
                getattr(simulation, how)(poses, there)
            there.position[:] = np.nan
            simulation.step()
            assert np.isfinite(simulation["sheet"].positions).all()
            np.testing.assert_allclose(simulation.collider_state.start.position[1], [0, 0, 0.03])

    def test_poses_that_cannot_be_change_nothing(self):
        simulation = self.scene()
        simulation.step()
        before = simulation["sheet"].positions
        for poses, dt in ((gs.ColliderPoses.identity(7), 0.1), (None, 0.0), (None, np.nan)):
            with pytest.raises(gs.MessageError):
                simulation.step(poses, dt)
        np.testing.assert_array_equal(simulation["sheet"].positions, before)

    def test_a_garment_by_name(self):
        simulation = self.scene()
        sheet = simulation["sheet"]
        for _ in range(3):
            simulation.step()
        before, off = sheet.positions, sheet.worn.aside.off.copy()
        simulation.step(dt=1e-3)
        after = sheet.positions
        assert after is not before  # they stay as they are
        way = (after - sheet.worn.aside.off) - (before - off)
        np.testing.assert_allclose(sheet.velocities, way / 1e-3, atol=0.02)
        assert np.abs(sheet.velocities).max() > 0.03
        np.testing.assert_array_equal(after, simulation.positions("sheet"))
        normals = np.empty_like(after)
        vertex_normals(after, sheet.triangles, normals)
        np.testing.assert_array_equal(sheet.normals, normals)
        # The order of the garment's vertices, not of the particles.
        expected = (sheet.state.x + simulation.origin).astype(np.float32)
        expected += sheet.worn.aside.off[sheet.model.vertex]
        np.testing.assert_array_equal(after[sheet.model.vertex], expected)
        assert sheet.health is simulation.health("sheet")
        assert sheet.limits == simulation.limits("sheet")
        assert [garment.name for garment in simulation] == ["sheet"]
        assert len(simulation) == 1
        with pytest.raises(gs.ParameterError, match="garment: found 'shirt'; allowed: sheet"):
            simulation["shirt"]

    def test_presets(self):
        assert self.scene(preset="balanced").parameters == self.scene().parameters
        with pytest.raises(
            gs.ParameterError, match="preset: found 'best'; allowed: fast, balanced"
        ):
            self.scene(preset="best")

    def test_parameters_by_name(self):
        given = self.scene(wind=(1, 2, 3), sweeps=5, solver="relaxation").parameters
        assert given.environment == gs.Environment(wind=(1.0, 2.0, 3.0))
        assert given.settings == RelaxationSettings(sweeps=5)
        settings = RelaxationSettings(sweeps=7, restitution=0.5)
        both = self.scene(settings=settings, solver="relaxation", sweeps=2).parameters
        assert both.settings == RelaxationSettings(sweeps=2, restitution=0.5)
        with pytest.raises(
            gs.ParameterError, match="sweeps: found 0; allowed: a whole number from 1"
        ):
            self.scene(solver="relaxation", sweeps=0)
        with pytest.raises(gs.ParameterError, match=r"winds: unknown .* allowed: gravity, wind"):
            self.scene(winds=3)

    def test_garments_in_any_way(self):
        sheet = gs.Garment.sheet(0.3, 0.3, edge=0.1)
        colliders = gs.ColliderSet.of()
        outfit = gs.Outfit(name="one", garments=(sheet,), text="", colliders=gs.ColliderOptions())
        for given in (sheet, [sheet], (sheet,), outfit):
            assert gs.Simulation(given, colliders).names == ("sheet",)


class TestAvatar:
    def test_a_body_with_colliders(self, avatar):
        kinds = {c.kind for c in avatar.colliders.colliders}
        assert kinds == {"frame", "capsule"}
        other = gs.Avatar.load("mannequin", colliders=avatar.colliders)
        assert other.colliders.revision == avatar.colliders.revision
        with pytest.raises(gs.ParameterError, match="mehtod: unknown, perhaps method; allowed"):
            gs.Avatar.load("mannequin", mehtod="hulls")
        with pytest.raises(gs.InputFileError, match="does not exist"):
            gs.Avatar.load("no_such_file.glb")

    def test_in_rest_the_colliders_are_where_the_skin_is(self, avatar):
        poses, skin = avatar.poses(), avatar.skin()
        np.testing.assert_allclose(skin, avatar.body.skin.vertices, atol=1e-6)
        assert poses.position[:, 2].min() > -0.1
        assert poses.position[:, 2].max() < skin[:, 2].max()

    def test_an_outfit_by_name_file_or_content(self, avatar, tmp_path):
        text = "version: 1\ngarments: [{name: kilt, generator: short_skirt, layer: 3}]\n"
        (tmp_path / "o.yaml").write_text(text)
        of_file = avatar.dress(tmp_path / "o.yaml").garments
        content = {"version": 1, "garments": [{"name": "kilt", "generator": "short_skirt"}]}
        of_content = avatar.dress(content).garments
        np.testing.assert_array_equal(of_file[0].vertices, of_content[0].vertices)
        assert (of_file[0].layer, of_content[0].layer) == (3, 0)
        assert [g.name for g in avatar.dress().garments] == ["skirt", "tshirt"]
        outfit = avatar.dress("tshirt_short_skirt")
        assert avatar.dress(outfit) is outfit
        with pytest.raises(gs.ParameterError, match="layer: given for an outfit; allowed: for on"):
            avatar.dress("tshirt_short_skirt", layer=1)
        with pytest.raises(gs.ParameterError, match="version: found None; allowed: 1"):
            avatar.dress({"garments": []})

    def test_one_garment_by_name(self, avatar):
        options = {"length": 0.2, "vertices": 300, "layer": 2, "material": "denim"}
        (skirt,) = avatar.dress("short_skirt", **options).garments
        assert (skirt.name, skirt.layer, len(skirt.vertices)) == ("short_skirt", 2, 300)
        assert skirt.material == PRESETS["denim"].material
        with pytest.raises(gs.ParameterError, match=r"short_skirt.*lenght: unknown"):
            avatar.dress("short_skirt", lenght=0.2)

    def test_a_mesh_is_put_on_the_body(self, avatar, tmp_path):
        """From a file, and from arrays: the same garment, that follows the body's bones."""
        (tube,) = avatar.dress("short_skirt", vertices=300).garments
        path = tmp_path / "My Tube.obj"
        lines = [f"v {x:.17g} {y:.17g} {z:.17g}" for x, y, z in tube.vertices]
        lines += ["f " + " ".join(str(v + 1) for v in t) for t in tube.triangles]
        path.write_text("\n".join(lines))
        (of_file,) = avatar.dress(path, up="z", edge_length=1.0, material="wool").garments
        assert of_file.name == "my_tube"
        plain = gs.Garment.from_mesh(tube.vertices, tube.triangles, name="mine", material="wool")
        assert plain.frames == ("world",)
        (of_arrays,) = avatar.dress(plain).garments
        np.testing.assert_allclose(of_arrays.vertices, of_file.vertices, atol=1e-9)
        assert of_arrays.material == of_file.material == PRESETS["wool"].material
        assert set(of_arrays.frames) <= set(avatar.body.rig.joint_names)
        assert of_arrays.pins.tolist() == of_file.pins.tolist() != []
        (free,) = avatar.dress(plain, attachments="none", name="free").garments
        assert (free.name, free.pins.size) == ("free", 0)
        # What follows the body already is left alone.
        assert avatar.dress(of_arrays).garments[0] is of_arrays

    def test_a_mesh_that_is_not_on_the_body(self, avatar):
        far = gs.Garment.sheet(0.2, 0.2, at=(5.0, 0.0, 1.0))
        with pytest.raises(gs.GarmentSimError, match="m away from mannequin"):
            avatar.dress(far)

    def test_a_clip_at_a_rate(self, avatar):
        clip = gs.load_clip("walk")
        played = list(avatar.play(clip, rate=30, seconds=0.5))
        assert len(played) == 16
        assert len(list(avatar.play(clip, rate=10))) == int(clip.duration * 10 + 1e-9) + 1
        first = retargeter(clip, avatar.body).world_joints(ClipSampler(clip).sample(0.0), 0.0)
        np.testing.assert_array_equal(played[0].position, avatar.poses(first).position)
        np.testing.assert_array_equal(next(avatar.joints(clip)), first)
        apart = [np.abs(b.position - a.position).max() for a, b in itertools.pairwise(played)]
        assert 0.0 < max(apart) < 0.3
        for wrong in ({"rate": 0.0}, {"rate": np.nan}, {"seconds": -1.0}, {"seconds": np.inf}):
            with pytest.raises(gs.ParameterError):
                avatar.play(clip, **wrong)
        with pytest.raises(gs.InputFileError):
            avatar.play("no_such_clip.bvh")

    def test_a_clip_with_y_up_moves_a_body_that_stands(self, avatar, data_file):
        poses = next(avatar.play(data_file("mocap", "deepmimic_walk.bvh")))
        at = {c.bone: p for c, p in zip(avatar.colliders.colliders, poses.position)}
        humanoid = avatar.body.humanoid
        assert at[humanoid["head"]][2] - at[humanoid["hips"]][2] > 0.4
