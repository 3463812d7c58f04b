"""Meshes as files."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import numpy.typing as npt

from .errors import InputError


def write_ply(
    file: str | os.PathLike[str], positions: npt.ArrayLike, faces: npt.ArrayLike
) -> None:
    """Writes a mesh as binary PLY: (V, 3) positions as float32, (F, 3) indices of corners.

    limn.write_ply("found.ply", mesh.positions, mesh.faces) with mesh = scene.mesh("ball");
    limn.load and others read it.
    """
    points = np.asarray(positions, dtype="<f4")
    corners = np.asarray(faces)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError(f"positions have shape (V, 3), not {points.shape}")
    if corners.ndim != 2 or corners.shape[1] != 3 or corners.dtype.kind not in "iu":
        what = f"{corners.shape} of {corners.dtype}"
        raise InputError(f"faces have shape (F, 3) and are integers, not {what}")
    if corners.size and not (0 <= corners.min() and corners.max() < len(points)):
        raise InputError(f"faces name vertices {corners.min()} to {corners.max()} of {len(points)}")
    rows = np.empty(len(corners), dtype=[("count", "u1"), ("corners", "<u4", 3)])
    rows["count"], rows["corners"] = 3, corners
    # Under another name first: nobody reads half a file.
    path = os.fspath(file)
    if not isinstance(path, str):
        raise TypeError("file: a path is a str or an os.PathLike of one, not bytes")
    path = os.path.realpath(path)  # a link stays
    unfinished = f"{path}.{os.getpid()}.tmp"
    try:
        with open(unfinished, "wb") as stream:
            stream.write(_header(len(points), len(rows)) + points.tobytes() + rows.tobytes())
        os.replace(unfinished, path)
    finally:
        if os.path.exists(unfinished):
            os.remove(unfinished)


def read_foreign(file: str) -> tuple[Any, Any]:
    """Positions and faces of a file that trimesh reads (STL, glTF, OFF, ...)."""
    try:
        import trimesh
    except ImportError:
        raise InputError("such files are read by trimesh: pip install trimesh") from None
    if not os.path.isfile(file):
        raise InputError(f'no such file: "{file}"')
    try:
        mesh: Any = trimesh.load(file, force="mesh", process=False)
    except Exception as error:  # of many kinds, one or more for each format
        raise InputError(f"trimesh cannot read {file}: {error}") from None
    return mesh.vertices, mesh.faces


def _header(vertices: int, faces: int) -> bytes:
    return (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {vertices}\n"
        "property float x\nproperty float y\nproperty float z\n"
        f"element face {faces}\nproperty list uchar uint vertex_indices\n"
        "end_header\n"
    ).encode()
