"""Meshes as files."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import numpy.typing as npt

from .errors import InputError


# What the numbers of these are called in PLY; of other attributes NAME_0, NAME_1, NAME_2.
_PROPERTIES = {"vertex_normals": ("nx", "ny", "nz"), "vertex_texcoords": ("u", "v"),
               "vertex_color": ("r", "g", "b"), "face_color": ("r", "g", "b")}


def write_ply(
    file: str | os.PathLike[str],
    positions: npt.ArrayLike,
    faces: npt.ArrayLike,
    **attributes: npt.ArrayLike,
) -> None:
    """Writes a mesh as binary PLY: (V, 3) positions as float32, (F, 3) indices of corners.

    limn.write_ply("found.ply", mesh.positions, mesh.faces) with mesh = scene.mesh("ball");
    limn.load and others read it. attributes: vertex_normals (V, 3), vertex_texcoords (V, 2),
    vertex_NAME (V, 1 or 3) and face_NAME (F, 1 or 3), as float32; vertex_color is a colour, linear.
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
    vertices = _table({"x": points[:, 0], "y": points[:, 1], "z": points[:, 2]},
                      attributes, "vertex_", len(points))
    rows = _table({"count": np.full(len(corners), 3, "u1"), "corners": corners.astype("<u4")},
                  attributes, "face_", len(corners))
    if wrong := [n for n in attributes if not n.startswith(("vertex_", "face_"))]:
        raise InputError(f"{wrong[0]}: attributes are called vertex_NAME or face_NAME")
    # Under another name first: nobody reads half a file.
    path = os.fspath(file)
    if not isinstance(path, str):
        raise TypeError("file: a path is a str or an os.PathLike of one, not bytes")
    path = os.path.realpath(path)  # a link stays
    unfinished = f"{path}.{os.getpid()}.tmp"
    try:
        with open(unfinished, "wb") as stream:
            stream.write(_header(vertices, rows) + vertices.tobytes() + rows.tobytes())
        os.replace(unfinished, path)
    finally:
        if os.path.exists(unfinished):
            os.remove(unfinished)


def read_foreign(file: str) -> tuple[Any, Any, dict[str, Any], list[str]]:
    """Of a file that trimesh reads (STL, glTF, OFF, ...): positions, faces, attributes as write_ply
    takes them, and in words what the file has besides."""
    try:
        import trimesh
    except ImportError:
        raise InputError("such files are read by trimesh: pip install trimesh") from None
    if not os.path.isfile(file):
        raise InputError(f'no such file: "{file}"')
    try:
        loaded: Any = trimesh.load(file, process=False)
        parts: list[Any] = [(np.eye(4), loaded)]
        if isinstance(loaded, trimesh.Scene):
            placed = [loaded.graph[node] for node in loaded.graph.nodes_geometry]
            parts = [(matrix, loaded.geometry[name]) for matrix, name in placed]
        meshes = [(m, g) for m, g in parts if isinstance(g, trimesh.Trimesh) and len(g.faces)]
        if not meshes:
            raise ValueError("no triangles are in it")
        linear = file.lower().endswith((".gltf", ".glb"))
        return _joined(meshes, linear, others=len(parts) - len(meshes))
    except Exception as error:  # of many kinds, one or more for each format
        raise InputError(f"trimesh cannot read {file}: {error}") from None


def _joined(meshes: list[Any], linear: bool, others: int) -> tuple[Any, Any, dict[str, Any], list[str]]:
    """One mesh of all, each with its matrix. Attributes that only some have are dropped."""
    from .photo_output import from_srgb  # which needs this module

    positions, faces, count = [], [], 0
    found: dict[str, list[Any]] = {name: [] for name in _PROPERTIES if name.startswith("vertex_")}
    materials = False
    for matrix, mesh in meshes:
        positions.append(mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3])
        flipped = np.linalg.det(matrix[:3, :3]) < 0
        faces.append(np.asarray(mesh.faces)[:, ::-1 if flipped else 1] + count)
        count += len(mesh.vertices)
        # Those of the file; trimesh makes up others when asked.
        if "vertex_normals" in getattr(getattr(mesh, "_cache", None), "cache", ()):
            found["vertex_normals"].append(mesh.vertex_normals @ np.linalg.inv(matrix[:3, :3]))
        if getattr(mesh.visual, "uv", None) is not None:  # whose v grows upwards
            found["vertex_texcoords"].append(mesh.visual.uv * [1, -1] + [0, 1])
        if mesh.visual.kind == "vertex":
            colours = mesh.visual.vertex_colors[:, :3] / 255
            found["vertex_color"].append(colours if linear else from_srgb(colours))
        materials |= mesh.visual.kind in ("texture", "face")
    whole = {n: np.concatenate(v) for n, v in found.items() if len(v) == len(meshes)}
    dropped = [f"{n} of some parts" for n, v in found.items() if v and n not in whole]
    dropped += ["materials and colours of faces"] * materials + ["what is no mesh"] * (others > 0)
    return np.concatenate(positions), np.concatenate(faces), whole, dropped


def _table(columns: dict[str, Any], attributes: dict[str, Any], kind: str, count: int) -> Any:
    """The rows of a PLY element: its own columns, then those of the attributes of its kind."""
    for name, given in attributes.items():
        if not name.startswith(kind):
            continue
        values = np.atleast_1d(np.asarray(given, dtype="<f4"))
        values = values.reshape(len(values), -1)
        each = values.shape[1]
        called = _PROPERTIES.get(name, [f"{name.removeprefix(kind)}_{k}" for k in range(each)])
        known = (len(called),) if name in _PROPERTIES else (1, 3)
        if len(values) != count or each not in known:
            wanted = " or ".join(map(str, known))
            raise InputError(f"{name} has shape ({count}, {wanted}), not {np.shape(given)}")
        columns.update({column: values[:, k] for k, column in enumerate(called)})
    rows = np.empty(count, [(n, c.dtype.str, c.shape[1:]) for n, c in columns.items()])
    for name, column in columns.items():
        rows[name] = column
    return rows


def _header(vertices: Any, faces: Any) -> bytes:
    def floats(table: Any) -> str:
        own = [n for n in table.dtype.names if n not in ("count", "corners")]
        return "".join(f"property float {name}\n" for name in own)

    return (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n{floats(vertices)}"
        f"element face {len(faces)}\nproperty list uchar uint vertex_indices\n{floats(faces)}"
        "end_header\n"
    ).encode()
