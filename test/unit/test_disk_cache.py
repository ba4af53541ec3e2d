"""Arrays are made once, and a broken cache only costs time."""

import numpy as np
import pytest

from garment_sim_ros import disk_cache


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "garment_sim_ros" / "things"


def made(calls, value=1.0):
    def make():
        calls.append(value)
        return {"a": np.full((2, 3), value), "b": np.arange(4, dtype=np.int32)}

    return make


def test_second_time_comes_from_the_cache_as_it_was(cache):
    calls = []
    first = disk_cache.cached_arrays("things", "key", made(calls))
    second = disk_cache.cached_arrays("things", "key", made(calls))
    assert calls == [1.0]
    assert first.keys() == second.keys()
    for name, array in first.items():
        assert second[name].dtype == array.dtype
        assert np.array_equal(second[name], array)
    assert [f.suffix for f in cache.iterdir()] == [".npz"]


def test_another_key_is_another_thing(cache):
    calls = []
    disk_cache.cached_arrays("things", "one", made(calls, 1.0))
    other = disk_cache.cached_arrays("things", "two", made(calls, 2.0))
    assert other["a"][0, 0] == 2.0
    assert calls == [1.0, 2.0]


@pytest.mark.parametrize("damage", [b"", b"not a zip", b"PK\x03\x04 cut off"])
def test_a_damaged_file_is_made_anew(cache, damage):
    calls = []
    disk_cache.cached_arrays("things", "key", made(calls))
    (file,) = cache.iterdir()
    file.write_bytes(damage)
    assert disk_cache.cached_arrays("things", "key", made(calls))["a"][0, 0] == 1.0
    disk_cache.cached_arrays("things", "key", made(calls))
    assert len(calls) == 2


def test_pickles_are_not_loaded(cache):
    calls = []
    disk_cache.cached_arrays("things", "key", made(calls))
    (file,) = cache.iterdir()
    np.savez(file, a=np.array([{}], dtype=object))
    assert disk_cache.cached_arrays("things", "key", made(calls))["a"].dtype == np.float64


def test_a_folder_that_cannot_be_made_costs_only_time(tmp_path, monkeypatch):
    blocked = tmp_path / "file"
    blocked.write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(blocked))
    calls = []
    for _ in range(2):
        assert disk_cache.cached_arrays("things", "key", made(calls))["b"].tolist() == [0, 1, 2, 3]
    assert len(calls) == 2


def test_the_oldest_go(cache, monkeypatch):
    monkeypatch.setattr(disk_cache, "_KEPT", 3)
    for n in range(6):
        disk_cache.cached_arrays("things", str(n), made([]))
    assert len(list(cache.iterdir())) == 3
