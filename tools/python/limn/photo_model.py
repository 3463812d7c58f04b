"""What a reconstruction finds, and the scenes that show it as the photographs' cameras do."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ._limn import Scene, load_string, remesh, write_exr
from .photo_views import View

SKY = (16, 32)  # rows and columns of the sky's map


@dataclass
class Model:
    """A mesh with a colour and a roughness per vertex, and the sky.

    sky: radiance, (H, W, 3), as an envmap's texels. exposures: of the views, by their names: what
    the scene's radiance is multiplied by to be the photograph's.
    """

    positions: Any  # (V, 3), scene units
    faces: Any  # (F, 3)
    colours: Any  # (V, 3), linear base colours
    roughness: Any = 0.5  # (V,), or one number at first
    specular: float = 0.5
    sky: Any = field(default_factory=lambda: np.ones((*SKY, 3)))
    exposures: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.roughness = np.broadcast_to(np.asarray(self.roughness, float), len(self.positions))

    @property
    def diagonal(self) -> float:
        """Of the mesh's bounds [scene units]."""
        return float(np.linalg.norm(np.ptp(self.positions, axis=0)))

    def remeshed(self, faces: int) -> Model:
        """The same with about so many faces of one size; materials from the nearest vertices."""
        length = math.sqrt(4 / math.sqrt(3) * surface_area(self.positions, self.faces) / faces)
        positions, corners = remesh(self.positions, self.faces, length)
        return self.on(positions.astype(float), corners.astype(np.int64))

    def on(self, positions: Any, faces: Any) -> Model:
        """On another mesh, with the materials of the nearest vertices."""
        values = np.concatenate([self.colours, self.roughness[:, None]], axis=1)
        values = spread(self.positions, values, positions)
        return Model(positions, faces, values[:, :3], values[:, 3], self.specular, self.sky.copy(),
                     dict(self.exposures))  # fmt: skip


def face_normals(positions: Any, faces: Any) -> Any:
    """Cross products of the faces' edges, (F, 3): normals as long as twice the area."""
    a, b, c = (positions[faces[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def vertex_normals(positions: Any, faces: Any) -> Any:
    """Unit normals, (V, 3): means over faces, by area."""
    total = np.zeros_like(positions, dtype=float)
    for k in range(3):
        np.add.at(total, faces[:, k], face_normals(positions, faces))
    return total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-300)


def surface_area(positions: Any, faces: Any) -> float:
    """Of a mesh, in square scene units."""
    return float(np.linalg.norm(face_normals(positions, faces), axis=1).sum() / 2)


def edges_of(faces: Any) -> Any:
    """Each edge once, (E, 2)."""
    pairs = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    return np.unique(np.sort(pairs, axis=1), axis=0)


def spread(places: Any, values: Any, points: Any, count: int = 4) -> Any:
    """Values at (N, 3) points from those of the nearest places, by inverse squared distance."""
    found = []
    for part in np.array_split(points, max(1, len(points) // 256)):
        apart = ((part[:, None] - places[None]) ** 2).sum(axis=2)
        near = np.argpartition(apart, min(count, len(places) - 1), axis=1)[:, :count]
        weight = 1 / (np.take_along_axis(apart, near, 1) + 1e-12 * apart.mean())
        weight /= weight.sum(axis=1, keepdims=True)
        found.append((weight[..., None] * values[near]).sum(axis=1))
    return np.concatenate(found)


def write_coloured_ply(file: str, model: Model) -> None:
    """A binary PLY; limn and Mitsuba read vertex_color (linear) and vertex_roughness."""
    fields = [(name, "<f4") for name in ("x", "y", "z", "r", "g", "b", "roughness_x")]
    vertices = np.empty(len(model.positions), dtype=fields)
    columns = [*model.positions.T, *model.colours.T, model.roughness]
    for (name, _), values in zip(fields, columns):
        vertices[name] = values
    rows = np.empty(len(model.faces), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    rows["count"], rows["corners"] = 3, model.faces
    head = "".join(f"property float {name}\n" for name, _ in fields)
    with open(file, "wb") as stream:
        stream.write(
            f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n{head}"
            f"element face {len(rows)}\nproperty list uchar int vertex_indices\n"
            "end_header\n".encode()
        )
        stream.write(vertices.tobytes() + rows.tobytes())


def _words(numbers: Any) -> str:
    return " ".join(repr(float(x)) for x in np.ravel(numbers))


def sensor_pose(view: View) -> Any:
    """As scene files have it, (4, 4): Mitsuba's camera has +X to the left and +Y up."""
    return view.pose * [-1, -1, 1, 1]


def sensor_xml(view: View, number: int) -> str:
    """A view as a sensor of a scene file."""
    width, height = view.size
    angle = math.degrees(2 * math.atan(0.5 * width / view.focal))
    offset = (0.5 - view.center[0] / width, 0.5 - view.center[1] / height)
    return f"""  <sensor type="perspective" id="view_{number}">
    <string name="fov_axis" value="x"/><float name="fov" value="{angle!r}"/>
    <float name="principal_point_offset_x" value="{offset[0]!r}"/>
    <float name="principal_point_offset_y" value="{offset[1]!r}"/>
    <float name="near_clip" value="{_near(view)!r}"/><float name="far_clip" value="1e8"/>
    <transform name="to_world"><matrix value="{_words(sensor_pose(view))}"/></transform>
    <film type="hdrfilm">
      <integer name="width" value="{width}"/><integer name="height" value="{height}"/>
      <rfilter type="box"/>
    </film>
    <sampler type="independent"><integer name="sample_count" value="64"/></sampler>
  </sensor>
"""


def _near(view: View) -> float:
    """A near plane that no object of any unit is in front of, by the camera's distance."""
    return 1e-4 * max(1e-3, float(np.linalg.norm(view.pose[:3, 3])))


def scene_xml(model: Model, views: Sequence[View], material: str, mesh: str) -> str:
    """The scene file; material: textures of base_color and roughness; mesh: the shape."""
    sensors = "".join(sensor_xml(v, i) for i, v in enumerate(views))
    return f"""<scene version="3.0.0">
  <integrator type="path">
    <integer name="max_depth" value="3"/><boolean name="hide_emitters" value="true"/>
  </integrator>
{sensors}  <bsdf type="principled" id="material">
    {material}
    <float name="specular" value="{model.specular!r}"/>
  </bsdf>
  {mesh}
  <emitter type="envmap" id="sky"><string name="filename" value="sky.exr"/></emitter>
</scene>
"""


VERTEX_MATERIAL = "".join(
    f'<texture type="mesh_attribute" name="{name}"><string name="name" value="vertex_{of}"/>'
    "</texture>"
    for name, of in (("base_color", "color"), ("roughness", "roughness"))
)


def ply_shape(file: str, inside: str = '<ref id="material"/>') -> str:
    """A shape "object" of a PLY file."""
    return (
        f'<shape type="ply" id="object"><string name="filename" value="{file}"/>{inside}</shape>'
    )


def scenes_of(model: Model, views: Sequence[View], folder: str) -> tuple[Scene, Scene]:
    """(the object under its sky, its coverage as light), a sensor for each view; writes files."""
    write_coloured_ply(os.path.join(folder, "object.ply"), model)
    write_exr(os.path.join(folder, "sky.exr"), model.sky)
    lit = load_string(scene_xml(model, views, VERTEX_MATERIAL, ply_shape("object.ply")), folder)
    sensors = "".join(sensor_xml(v, i) for i, v in enumerate(views))
    glow = (
        '<bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>'
        '<emitter type="area"><rgb name="radiance" value="1"/></emitter>'
    )
    flat = load_string(
        '<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="1"/>'
        f'</integrator>{sensors}{ply_shape("object.ply", glow)}</scene>', folder
    )  # fmt: skip
    return lit, flat


def update(lit: Scene, flat: Scene, model: Model) -> None:
    """Sets what a step has changed."""
    for scene in (lit, flat):
        scene["object.vertex_positions"] = model.positions
    lit["object.vertex_color"] = model.colours[None]
    lit["object.vertex_roughness"] = np.repeat(model.roughness[None, :, None], 3, axis=2)
    lit["material.specular"] = model.specular
    lit["sky.data"] = model.sky
