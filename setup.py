"""The package for pip (with or without ROS on the machine) and for colcon (ament_python)."""

from glob import glob

from setuptools import find_packages, setup

NAME = "garment_sim_ros"

# Lower limits are the versions of Ubuntu 24.04, on which ROS 2 Jazzy runs.
REQUIRES = [
    "backports.zstd>=1.0",
    "defusedxml>=0.7",
    "embreex>=2.17; platform_machine == 'x86_64'",  # no wheels elsewhere; only renders need it
    "llvmlite>=0.43",  # what numba 0.60 has
    "numba>=0.60",
    "numpy>=1.26",
    "pillow>=10.2",
    "pyyaml>=6.0",
    "rosbags>=0.11",
    "scipy>=1.11",
    "tqdm>=4.66",
    "trimesh>=4.5",
]

# The real rclpy from the package index, for machines without ROS.
ROS = [
    "ros-jazzy-rclpy",
    "ros-rclpy[fastrtps]==7.1.6",
    "ros-jazzy-common-interfaces",
]
TEST = ["hypothesis>=6.98", "networkx>=2.8", "psutil>=5.9", "pytest>=8", "pytest-xdist>=3.5"]
CHECK = ["import-linter~=2.12", "mypy~=2.4.0", "ruff~=0.17.0"]  # their rules change with versions
DOCS = ["pdoc~=16.0"]
VIEW = ["viser~=1.1.1"]  # no rosdep key: optional, found at run time
DRACO = ["DracoPy>=1.7"]  # no rosdep key: optional, found at run time
MACHINES = ["distributed>=2024.8"]  # no rosdep key: optional, found at run time
USD = ["usd-core>=24.8"]  # no rosdep key: optional, found at run time

setup(
    name=NAME,
    version="0.1.0",
    description="Dresses a moving avatar in real time and publishes the cloth over ROS 2.",
    maintainer="garment_sim_ros maintainers",
    maintainer_email="maintainers@example.org",
    license="Apache-2.0",
    python_requires=">=3.10",
    packages=find_packages(include=[NAME, f"{NAME}.*"]),
    package_data={NAME: ["**/*.json", "**/*.npz", "**/*.yaml", "**/*.colliders"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/config", sorted(glob("config/*.*"))),
        (f"share/{NAME}/config/presets", sorted(glob("config/presets/*.yaml"))),
        (f"share/{NAME}/launch", sorted(glob("launch/*.py"))),
    ],
    zip_safe=False,
    install_requires=REQUIRES,
    extras_require={
        "ros": ROS,
        "test": TEST,
        "docs": DOCS,
        "draco": DRACO,
        "machines": MACHINES,
        "usd": USD,
        "view": VIEW,
        "dev": TEST + CHECK + DOCS + DRACO + VIEW + MACHINES,
    },
    entry_points={
        "console_scripts": [
            "garment-sim = garment_sim_ros.cli.main:main",
            "mocap_player = garment_sim_ros.ros.mocap_player:main",
            "collider_node = garment_sim_ros.ros.collider_node:main",
            "cloth_node = garment_sim_ros.ros.cloth_node:main",
        ]
    },
)
