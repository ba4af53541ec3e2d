"""The package tf2_msgs, made by ROS 2's own generators from its definition.

It is not on the package index; generators, headers and libraries of the messages that it is made
of come with `rclpy` from there. A compiler is needed.
"""

import ctypes
import importlib
import subprocess
import sys
import sysconfig
from pathlib import Path

import numpy as np

_DEFINITION = """#include "geometry_msgs/msg/TransformStamped.idl"
module tf2_msgs {
  module msg {
    struct TFMessage {
      sequence<geometry_msgs::msg::TransformStamped> transforms;
    };
  };
};
"""
_PACKAGE, _FILE = "tf2_msgs", "msg/TFMessage.idl"
_SUPPORTS = ("rosidl_typesupport_fastrtps_c", "rosidl_typesupport_introspection_c")
_LIBRARIES = (
    *("fastcdr", "rcutils", "rosidl_runtime_c", "rosidl_typesupport_c"),
    *("rosidl_typesupport_fastrtps_cpp", *_SUPPORTS),
    *(f"geometry_msgs__{part}" for part in ("rosidl_generator_c", "rosidl_generator_py")),
    *(f"geometry_msgs__{part}" for part in ("rosidl_typesupport_c", *_SUPPORTS)),
)


def generators():
    """The generators, by what they write.

    Raises:
        ImportError: One of them is not installed.
    """

    def from_package(package, name, *supports):
        given = {"typesupport_implementations": list(supports)} if supports else {}
        return getattr(importlib.import_module(f"{package}.cli"), name)(package, **given)

    return (
        from_package("rosidl_generator_c", "GenerateC"),
        from_package("rosidl_generator_py", "GeneratePython", "rosidl_typesupport_c"),
        from_package("rosidl_typesupport_c", "GenerateCTypesupport", *_SUPPORTS),
        from_package("rosidl_typesupport_fastrtps_c", "GenerateFastRTPSCTypesupport"),
        from_package("rosidl_typesupport_introspection_c", "GenerateIntrospectionCTypesupport"),
    )


def build(folder):
    """Write and compile the package; AMENT_PREFIX_PATH has to name the environment.

    Args:
        folder: Where. It has to be in PYTHONPATH and LD_LIBRARY_PATH of processes that use the
            package, and in `sys.path` of this one.

    Raises:
        OSError: There is no compiler.
        subprocess.CalledProcessError: It does not compile.
    """
    prefix, package = Path(sys.prefix), folder / _PACKAGE
    definition = folder / "definition" / _FILE
    definition.parent.mkdir(parents=True)
    definition.write_text(_DEFINITION)
    package.mkdir()
    for generator in generators():
        files = [f"{folder}/definition:{_FILE}"]
        generator.generate(_PACKAGE, files, [str(prefix / "share")], package)
    (package / "__init__.py").touch()
    headers = prefix / "include"
    folders = [
        folder,
        headers,
        *headers.iterdir(),
        np.get_include(),
        sysconfig.get_path("include"),
    ]
    objects = []
    for source in sorted(package.rglob("*.c*")):
        objects.append(folder / f"{source.name}.o")
        compiler = {".c": "gcc", ".cpp": "g++"}[source.suffix]
        command = [compiler, "-w", "-fPIC", "-c", source, "-o", objects[-1]]
        subprocess.run([*command, *(f"-I{f}" for f in folders)], check=True)
    suffix = sysconfig.get_config_var("EXT_SUFFIX")
    library = package / f"{_PACKAGE}_s__rosidl_typesupport_c{suffix}"
    linked = [f"-L{prefix}/lib", f"-Wl,-rpath,{prefix}/lib", *(f"-l{name}" for name in _LIBRARIES)]
    subprocess.run(["g++", "-shared", "-o", library, *objects, *linked], check=True)
    # ROS 2 opens a library for each support, by name; this one has both.
    for support in _SUPPORTS:
        name = f"lib{_PACKAGE}__{support}.so"
        named = ["-o", folder / name, f"-Wl,-soname,{name}", "-Wl,--no-as-needed"]
        subprocess.run(["g++", "-shared", *named, library], check=True)
        # A process that runs does not look at LD_LIBRARY_PATH again, but takes what it has.
        ctypes.CDLL(str(folder / name))
