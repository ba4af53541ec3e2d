"""Exports: what is read back from every format is what the bag has."""

import json
import shutil
import struct
import subprocess

import numpy as np
import pytest
import trimesh
from unit.test_recording import REST, avatar, cloud, joints, message, topology, write

from garment_sim_ros.body.loaders.gltf import load_gltf
from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.cli import main as cli
from garment_sim_ros.geometry.sheet import sheet_triangles
from garment_sim_ros.geometry.transforms import AXES_FROM_Y_UP
from garment_sim_ros.mocap.source_urdf import urdf_from_clip
from garment_sim_ros.mocap.walk import walk
from garment_sim_ros.recording.export.frames import read_frames
from garment_sim_ros.recording.export.shapes import normals_of, shapes_of

__all__ = ["write"]
