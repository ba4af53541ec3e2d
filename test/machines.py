"""Runs the tests as other machines would: other processors, other Pythons, the oldest versions.

`make test-machines` calls it: the tests that depend on arithmetic, not those of nodes, one run
after the other, each in one process. Interpreters and settings that are not there are skipped and
named. Each run makes its fits anew; only compiled code is shared, which differs by itself.
"""

import argparse
import ast
import os
import re
import shutil
import subprocess
import sys
from itertools import chain
from pathlib import Path

import numpy as np

REPOSITORY = Path(__file__).resolve().parents[1]
PYTHONS = ("3.10", "3.11", "3.12", "3.13")
TESTS = ("test/unit", "test/property", "test/verification")


def vector_extensions() -> str:
    """What numpy finds of this processor beyond its baseline, as it is switched off."""
    found = np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])
    return " ".join(found)


def processors() -> dict[str, dict[str, str]]:
    """Settings that make libraries compute as on other processors, by name."""
    return {
        "this-processor": {},
        "kernels-for-any-processor": {"NUMBA_CPU_NAME": "generic"},
        "numpy-without-extensions": {"NPY_DISABLE_CPU_FEATURES": vector_extensions()},
        "blas-of-haswell": {"OPENBLAS_CORETYPE": "Haswell"},
        "blas-of-prescott": {"OPENBLAS_CORETYPE": "Prescott"},
    }


def interpreter(version: str) -> str | None:
    """Path of a Python of this version: on the path, or a ready one of pyenv's."""
    found = [shutil.which(f"python{version}")]
    pyenv = Path(os.environ.get("PYENV_ROOT") or Path.home() / ".pyenv") / "versions"
    found += [str(path) for path in sorted(pyenv.glob(f"{version}.*/bin/python"))]
    question = "import sys, venv, ensurepip; print('%d.%d' % sys.version_info[:2])"
    for path in filter(None, found):
        answer = subprocess.run([path, "-c", question], capture_output=True, text=True)
        if answer.stdout.strip() == version:
            return path
    return None


def lower_limits() -> list[str]:
    """The lowest version of each requirement in setup.py, as a constraint of pip's."""
    lists = [
        ast.literal_eval(line.value)
        for line in ast.parse((REPOSITORY / "setup.py").read_text()).body
        if isinstance(line, ast.Assign) and ast.unparse(line.targets[0]) in ("REQUIRES", "TEST")
    ]
    found = re.findall(r"^([\w.-]+)>=(\d+)([\d.]*)", "\n".join(chain(*lists)), re.MULTILINE)
    return [f"{name}=={first}{rest or '.0'}.*" for name, first, rest in found]


def environment(folder: Path, python: str, limits: list[str]) -> Path | None:
    """A virtual environment with the package in it; its Python, or None where it fails."""
    stamp = folder / ".installed"
    path = folder / "bin" / "python"
    wanted = (REPOSITORY / "setup.py").read_text()
    if not (stamp.exists() and stamp.read_text() == wanted):
        subprocess.run([python, "-m", "venv", "--clear", folder], check=True, env=outside())
        command = [path, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
        if limits:
            constraints = folder / "constraints.txt"
            constraints.write_text("\n".join(limits) + "\n")
            command += ["--constraint", constraints]
        command += ["--editable", f"{REPOSITORY}[ros,{'test' if limits else 'dev'}]"]
        if subprocess.run(command, env=outside()).returncode:
            return None
        stamp.write_text(wanted)
    return path


def fresh_cache(folder: Path) -> Path:
    """A cache of files with nothing but compiled code in it, that of the user."""
    shutil.rmtree(folder, ignore_errors=True)
    user = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    kernels = user / "garment_sim_ros" / "kernels"
    kernels.mkdir(parents=True, exist_ok=True)
    (folder / "garment_sim_ros").mkdir(parents=True)
    (folder / "garment_sim_ros" / "kernels").symlink_to(kernels.absolute())
    return folder


def outside() -> dict[str, str]:
    """The environment without what this interpreter's own ROS libraries put into it.

    Libraries from the package index make it start anew with their folders on the loader's path and
    a mark that it has been done, which another interpreter would take for its own.
    """
    kept = {k: v for k, v in os.environ.items() if k != "_ROS_WHEELS_BOOTSTRAP_COMPLETE"}
    own = Path(sys.prefix).resolve()
    folders = filter(None, kept.pop("LD_LIBRARY_PATH", "").split(os.pathsep))
    if others := [f for f in folders if not Path(f).resolve().is_relative_to(own)]:
        kept["LD_LIBRARY_PATH"] = os.pathsep.join(others)
    return kept


def main() -> int:
    """Run all, or those that are asked for; 1 where one of them failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", metavar="NAME", action="append", help="run only this one")
    parser.add_argument("--folder", type=Path, default=REPOSITORY / ".machines")
    parser.add_argument("--list", action="store_true", help="names, nothing else")
    args, tests = parser.parse_known_args()
    runs: dict[str, tuple[str | None, list[str], dict[str, str]]] = {
        name: (sys.executable, [], settings) for name, settings in processors().items()
    }
    for version in PYTHONS:
        runs[f"python{version}"] = (interpreter(version), [], {})
    oldest = next(filter(None, map(interpreter, PYTHONS)), None)
    runs["oldest-versions"] = (oldest, lower_limits(), {})
    if args.list:
        print("\n".join(runs))
        return 0
    results = {}
    for name, (python, limits, settings) in runs.items():
        if args.only and name not in args.only:
            continue
        if python is None:
            results[name] = "skipped: there is no such Python on this machine"
            continue
        if "" in settings.values():
            results[name] = "skipped: this processor has no such extensions"
            continue
        print(f"== {name} {settings or ''}", flush=True)
        path: Path | None = Path(python)
        if python != sys.executable:
            path = environment(args.folder / name, python, limits)
        if path is None:
            results[name] = "FAILED: its versions cannot be installed"
            continue
        cache = fresh_cache(args.folder / "caches" / name)
        done = subprocess.run(
            [path, "-m", "pytest", *(tests or TESTS)],
            cwd=REPOSITORY,
            env={**outside(), **settings, "XDG_CACHE_HOME": str(cache)},
        )
        results[name] = "passed" if done.returncode == 0 else "FAILED"
    print("\n".join(f"{name:28}{result}" for name, result in results.items()))
    return int(any(result.startswith("FAILED") for result in results.values()))


if __name__ == "__main__":
    sys.exit(main())
