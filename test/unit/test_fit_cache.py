"""Fits are kept, read back bit for bit, and never trusted."""

import dataclasses

import numpy as np
import pytest

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.colliders import fit_cache
from garment_sim_ros.colliders.description import to_json
from garment_sim_ros.colliders.fit_cache import cached_fit, content_key, fit_key
from garment_sim_ros.colliders.fitting import fit_colliders
from garment_sim_ros.disk_cache import user_cache
from garment_sim_ros.errors import ParameterError
from garment_sim_ros.params import ColliderOptions

OPTIONS = ColliderOptions(method="spheres", delta=0.004)


@pytest.fixture(scope="module")
def body():
    return load_body("mannequin:vertices=1500")


@pytest.fixture(autouse=True)
def _own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


@pytest.fixture
def source(tmp_path):
    """The body's file, in a folder of its own."""
    file = tmp_path / "bodies" / "me.glb"
    file.parent.mkdir()
    file.write_bytes(b"x")
    return file


def kept(folder):
    return sorted(folder.glob("*.colliders")) if folder.exists() else []


def fit(body, source, options=OPTIONS):
    told = []
    return cached_fit(body, options, source, told.append), told


def test_a_fit_is_kept_beside_the_body_and_read_back_bit_for_bit(body, source):
    first, told = fit(body, source)
    (file,) = kept(source.parent)
    assert file.name.startswith("me.glb.spheres.")
    assert f"kept in {file}" in told[0]
    again, told = fit(body, source)
    assert told == [f"colliders read from {file}"]
    assert to_json(again) == to_json(first) == to_json(fit_colliders(body, OPTIONS))
    assert not kept(user_cache("colliders"))


@pytest.mark.parametrize("where", [None, "mannequin"])
def test_a_body_without_a_file_has_its_fit_in_the_users_cache(body, where):
    first, _ = fit(body, where)
    (file,) = kept(user_cache("colliders"))
    again, told = fit(body, where)
    assert told == [f"colliders read from {file}"]
    assert again.revision == first.revision


def test_a_folder_that_cannot_be_written_sends_it_to_the_users_cache(body, source, monkeypatch):
    import garment_sim_ros.colliders.fit_cache as module

    write = module._write

    def refuse(folder, name, text):
        if folder == source.parent:
            raise PermissionError(13, "read-only")
        write(folder, name, text)

    monkeypatch.setattr(module, "_write", refuse)
    fit(body, source)
    assert not kept(source.parent)
    assert len(kept(user_cache("colliders"))) == 1
    assert "read from" in fit(body, source)[1][0]
    monkeypatch.setattr(module, "_write", lambda *_: refuse(source.parent, "", ""))
    colliders, told = fit(body, source, ColliderOptions(method="spheres", delta=0.005))
    assert told == ["colliders fitted; nowhere to keep them"]
    assert len(colliders) > 10


@pytest.mark.parametrize(
    "damage",
    [
        lambda text: "",
        lambda text: text[: len(text) // 2],
        lambda text: text.replace("0.", "1.", 1),
        lambda text: text.replace('"version":1', '"version":2'),
        lambda text: "0" * 64 + text[64:],
        lambda text: "\x00\xff" * 100,
        lambda text: text.partition("\n")[0] + "\n[]",
        lambda text: text.partition("\n")[0] + "\n" + "[" * 100_000,
        lambda text: text + "}",
    ],
)
def test_a_damaged_file_is_told_of_fitted_again_and_mended(body, source, damage):
    first, _ = fit(body, source)
    (file,) = kept(source.parent)
    file.write_text(damage(file.read_text()), encoding="latin-1")
    again, told = fit(body, source)
    assert again.revision == first.revision
    assert "is not used" in told[0]
    assert "kept in" in told[1]
    assert "read from" in fit(body, source)[1][0]


def test_anything_that_matters_changes_the_key(body, monkeypatch):
    skin = body.skin
    moved = skin.vertices.copy()
    moved[7, 1] = np.nextafter(moved[7, 1], 1.0)
    weight = skin.weight[:, ::-1]
    keys = [
        fit_key(body, OPTIONS),
        fit_key(body, dataclasses.replace(OPTIONS, delta=0.005)),
        fit_key(body, dataclasses.replace(OPTIONS, thickness=0.005)),
        fit_key(body, dataclasses.replace(OPTIONS, method="capsules")),
        fit_key(dataclasses.replace(body, humanoid={}), OPTIONS),
        *(
            fit_key(dataclasses.replace(body, skin=dataclasses.replace(skin, **change)), OPTIONS)
            for change in (
                {"vertices": moved},
                {"triangles": skin.triangles[:-1]},
                {"weight": weight, "bone": skin.bone},
            )
        ),
    ]
    import garment_sim_ros.colliders.fit_cache as module

    monkeypatch.setattr(module, "code_digest", lambda *folders: "other code")
    keys.append(fit_key(body, OPTIONS))
    assert len(set(keys)) == len(keys)
    assert fit_key(dataclasses.replace(body, name="b", notes=("n",)), OPTIONS) == keys[-1]


def test_old_fits_make_room(body, source):
    for k in range(6):
        fit(body, source, ColliderOptions(method="spheres", delta=0.001 * k))
    other = source.with_name("me.glb.capsules.0.colliders")
    other.write_text("of another method")
    fit(body, source, ColliderOptions(method="spheres", delta=0.01))
    assert len(kept(source.parent)) == 5
    assert other.exists()


@pytest.mark.parametrize("method", ["hulls", "capsules", "ellipsoids", "spheres"])
def test_every_method_fits(body, method):
    kind = method.removesuffix("s")
    colliders = fit_colliders(body, ColliderOptions(method=method, thickness=0.003))
    kinds = [c.kind for c in colliders.colliders]
    assert kinds.count(kind) >= 14
    assert kinds.count("frame") >= 14
    assert colliders.thickness == 0.003


def test_settings_are_checked(body, source):
    with pytest.raises(ParameterError, match="max_faces"):
        fit(body, source, ColliderOptions(max_faces=2))


def test_the_default_mannequins_hulls_come_with_the_package():
    """They are those that the code fits, but for what another processor rounds otherwise."""
    body = load_body("mannequin")
    shipped = fit_cache.SHIPPED.read_text().split("\n", 1)
    assert shipped[0] == content_key(body, ColliderOptions())
    read, told = fit(body, "mannequin", ColliderOptions())
    assert to_json(read) == shipped[1]
    assert not told
    assert not kept(user_cache("colliders"))
    fitted = fit_colliders(body, ColliderOptions())
    assert [c.name for c in read.colliders] == [c.name for c in fitted.colliders]
    directions = np.random.default_rng(0).normal(size=(100, 3))
    for one, other in zip(read.colliders, fitted.colliders, strict=True):
        if one.kind == "hull":
            points = [np.asarray(c.geometry["vertices"]) for c in (one, other)]
            extents = [(x @ directions.T).max(axis=0) for x in points]
            # A simplified hull may be any between the skin and `reach` times `delta` outside:
            # where two triangles are equally good another processor takes the other one.
            apart = np.abs(extents[0] - extents[1])
            assert np.percentile(apart, 95.0) < 1e-3, one.name
            assert apart.max() < ColliderOptions().delta, one.name


def test_another_body_or_option_has_other_hulls():
    body = load_body("mannequin")
    _, told = fit(body, "mannequin", ColliderOptions(delta=0.02))
    assert "fitted" in told[0]


def test_hulls_of_the_package_that_are_damaged_are_fitted(monkeypatch, tmp_path):
    damaged = tmp_path / "hulls"
    damaged.write_text(fit_cache.SHIPPED.read_text()[:-100])
    monkeypatch.setattr(fit_cache, "SHIPPED", damaged)
    _, told = fit(load_body("mannequin"), "mannequin", ColliderOptions())
    assert "fitted" in told[0]
