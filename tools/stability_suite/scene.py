"""Scenes as text: a subset of Mitsuba's XML with meshes beside it. Everything is kept as numbers,
so that a scene can be scaled and moved as a whole."""

import copy
import hashlib
import os
from dataclasses import dataclass, field

import numpy as np


def diffuse(reflectance):
    return f'<bsdf type="diffuse"><rgb name="reflectance" value="{reflectance:.9g}"/></bsdf>'


def glossy(alpha, reflectance=0.9):
    return (f'<bsdf type="roughconductor"><string name="distribution" value="ggx"/>'
            f'<float name="alpha" value="{alpha:.9g}"/>'
            f'<rgb name="specular_reflectance" value="{reflectance:.9g}"/></bsdf>')


def twosided(bsdf):
    return f'<bsdf type="twosided">{bsdf}</bsdf>'


@dataclass
class Shape:
    name: str
    mesh: tuple
    bsdf: str = diffuse(0.5)
    radiance: float = 0
    normals: np.ndarray = None  # one for each vertex; None: flat

    def obj(self):
        positions, faces = self.mesh
        lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in positions.astype(float).tolist()]
        if self.normals is not None:
            lines += [f"vn {x!r} {y!r} {z!r}" for x, y, z in self.normals.astype(float).tolist()]
            lines += ["f " + " ".join(f"{i + 1}//{i + 1}" for i in face) for face in faces]
        else:
            lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces]
        return "\n".join(lines) + "\n"

    def xml(self):
        look = (f'<emitter type="area"><rgb name="radiance" value="{self.radiance:.9g}"/></emitter>'
                if self.radiance else self.bsdf)
        flat = "true" if self.normals is None else "false"
        return (f'<shape type="obj" id="{self.name}">'
                f'<string name="filename" value="{self.name}.obj"/>'
                f'<boolean name="face_normals" value="{flat}"/>{look}</shape>')


@dataclass
class Scene:
    shapes: list
    parameter: str = "object.translate.x"
    eye: tuple = (0.5, -3.5, 2.5)
    target: tuple = (0.0, 0.0, 0.25)
    up: tuple = (0.0, 0.0, 1.0)
    fov: float = 30
    near: float = 0.125
    far: float = 1024
    depth: int = 3
    extra: str = ""  # further elements
    files: dict = field(default_factory=dict)  # name: bytes, beside the scene

    def shape(self, name):
        return next(s for s in self.shapes if s.name == name)

    def replaced(self, name, **changes):
        """A copy in which one shape is another."""
        scene = copy.deepcopy(self)
        for key, value in changes.items():
            setattr(scene.shape(name), key, value)
        return scene

    def scaled(self, factor):
        scene = copy.deepcopy(self)
        for s in scene.shapes:
            s.mesh = (s.mesh[0] * factor, s.mesh[1])
        scene.eye = tuple(factor * np.array(self.eye))
        scene.target = tuple(factor * np.array(self.target))
        scene.near, scene.far = factor * self.near, factor * self.far
        return scene

    def shifted(self, offset):
        scene = copy.deepcopy(self)
        for s in scene.shapes:
            s.mesh = (s.mesh[0] + offset, s.mesh[1])
        scene.eye = tuple(offset + np.array(self.eye))
        scene.target = tuple(offset + np.array(self.target))
        return scene

    def xml(self, resolution):
        def triple(v):
            return ", ".join(f"{float(x)!r}" for x in v)

        shapes = "\n  ".join(s.xml() for s in self.shapes)
        return f"""<scene version="3.0.0">
  <integrator type="path">
    <integer name="max_depth" value="{self.depth}"/><integer name="rr_depth" value="1000"/>
  </integrator>
  <sensor type="perspective">
    <float name="fov" value="{self.fov!r}"/>
    <float name="near_clip" value="{self.near!r}"/><float name="far_clip" value="{self.far!r}"/>
    <transform name="to_world">
      <lookat origin="{triple(self.eye)}" target="{triple(self.target)}" up="{triple(self.up)}"/>
    </transform>
    <film type="hdrfilm">
      <integer name="width" value="{resolution}"/><integer name="height" value="{resolution}"/>
      <string name="pixel_format" value="luminance"/>
      <string name="component_format" value="float32"/><rfilter type="box"/>
    </film>
  </sensor>
  {shapes}
  {self.extra}
</scene>
"""

    def content(self, resolution):
        """{file name: bytes}, all that limn reads."""
        content = {"scene.xml": self.xml(resolution).encode(), **self.files}
        content.update({f"{s.name}.obj": s.obj().encode() for s in self.shapes})
        return content

    def identity(self, resolution):
        digest = hashlib.sha256(self.parameter.encode())
        for name, data in sorted(self.content(resolution).items()):
            digest.update(name.encode() + b"\0" + len(data).to_bytes(8, "little") + data)
        return digest.hexdigest()

    def write(self, folder, resolution):
        """Returns the scene's file."""
        os.makedirs(folder, exist_ok=True)
        for name, data in self.content(resolution).items():
            with open(os.path.join(folder, name), "wb") as out:
                out.write(data)
        return os.path.join(folder, "scene.xml")
