"""Geometry behind the closed-form references: shapes, camera, motions, clipping, quadrature.

Conventions are limn's (and Mitsuba 3's): right-handed world, camera space with +X to the left of the
image, +Y up, +Z along the view; film positions in pixels, row 0 on top. Everything is double.
"""
import copy
from dataclasses import dataclass, field

import numpy as np


@dataclass
class Shape:
    """A polygon mesh. vertices: V by 3; faces: planar convex loops, counter-clockwise from outside."""

    vertices: np.ndarray
    faces: list
    bsdf: "Bsdf" = None
    emitter_id: str = ""
    radiance: np.ndarray = None  # 3, from the front of every face; None if no emitter
    writer: str = "obj"  # "obj", "split" (24-vertex style with normals), "floor" (a rectangle)
    face_normals: bool = True
    hole: list = field(default_factory=list)  # loops that would close an open convex mesh
    uv: list = None  # texture coordinates: for every face K by 2, affine over it
    texels: np.ndarray = None  # 2 by 2 by 3 [row, column], of 255: radiance, bilinear between them

    def face(self, k):
        return self.vertices[self.faces[k]]

    def center(self):
        return (self.vertices.min(axis=0) + self.vertices.max(axis=0)) / 2


@dataclass
class Bsdf:
    """kind: diffuse, ggx or beckmann (roughconductor with eta 0, k 1, so Fresnel = 1), mirror (a
    conductor with these), mask, of a black surface, or dielectric.

    colors: 2 by 3, of a checkerboard in the place of the reflectance; its squares are halves of uv.
    """

    id: str
    kind: str = "diffuse"
    reflectance: np.ndarray = None
    alpha: float = 0.0
    colors: np.ndarray = None
    opacity: float = 0.0
    eta: float = 1.0  # of a dielectric: inside over outside


@dataclass
class Camera:
    origin: np.ndarray
    target: np.ndarray
    up_hint: np.ndarray
    fov: float  # degrees, along x
    width: int
    height: int
    turn: np.ndarray = field(default_factory=lambda: np.eye(3))  # applied to the axes after lookat
    shift: np.ndarray = field(default_factory=lambda: np.zeros(3))
    filter: str = "box"
    half_width: float = 0.0  # of an orthographic film, in place of fov
    radius: float = 0.0  # of a thin lens
    focus: float = 1.0  # distance along the view of what is in focus
    at: tuple = (0.0, 0.0)  # a point of the lens, in radii along left and up

    def axes(self):
        """Rows: left, up, forward."""
        forward = unit(self.target - self.origin)
        left = unit(np.cross(self.up_hint, forward))
        return np.stack([left, np.cross(forward, left), forward]) @ self.turn.T

    def pinhole(self):
        offset = self.radius * (self.at[0] * self.axes()[0] + self.at[1] * self.axes()[1])
        return self.origin + self.shift + offset

    def size(self):
        """Of half the film [x, y]: at depth 1, or as it is if it is orthographic."""
        x = self.half_width or np.tan(np.radians(self.fov) / 2)
        return x * np.array([1, self.height / self.width])

    def directions(self, film):
        """film: N by 2 [pixels] -> N by 3 unit directions."""
        if self.half_width:
            return np.tile(self.axes()[2], (len(film), 1))
        xy = (1 - 2 * film / [self.width, self.height]) * self.size()
        xy = xy - self.radius / self.focus * np.array(self.at)
        return unit(np.column_stack([xy, np.ones(len(xy))]) @ self.axes())

    def project(self, points):
        """points: N by 3 in front of the pinhole -> N by 2 film positions [pixels]."""
        local = (points - self.pinhole()) @ self.axes().T
        if self.half_width:
            xy = local[:, :2]
        else:
            xy = local[:, :2] / local[:, 2:] + self.radius / self.focus * np.array(self.at)
        return (1 - xy / self.size()) / 2 * np.array([self.width, self.height])


@dataclass
class Light:
    """kind: point, spot or directional. direction: unit, in which the light travels."""

    kind: str
    power: np.ndarray  # 3: intensity, of a directional light irradiance
    position: np.ndarray = None
    direction: np.ndarray = None
    cutoff_angle: float = 20.0  # degrees, as is
    beam_width: float = 15.0

    def power_name(self):
        return "irradiance" if self.kind == "directional" else "intensity"

    def through(self, x):
        """The directions, not normalised, in which light passes through x (N by 3)."""
        return x - self.position if self.kind != "directional" else self.direction + 0 * x

    def arriving(self, x):
        """Unit directions from x to the light (N by 3), and the irradiance across them (N by 3)."""
        w = self.through(x)
        r = np.linalg.norm(w, axis=1, keepdims=True)
        power = self.power / r**2 if self.kind != "directional" else self.power + 0 * x
        if self.kind == "spot":
            angle = np.degrees(np.arccos((w / r) @ self.direction))
            ramp = (self.cutoff_angle - angle) / (self.cutoff_angle - self.beam_width)
            flat = angle <= self.beam_width
            assert np.all(flat) or not np.any(flat), "the rim of the beam crosses the view"
            assert np.all(ramp > 0) or np.all(ramp < 0), "the rim of the cone crosses the view"
            power = power * (1.0 if flat[0] else np.maximum(ramp, 0)[:, None])
        return -w / r, power


@dataclass
class Scene:
    """name: of the XML file; shapes and lights by id; environment: radiance (3) or None."""

    name: str
    camera: Camera
    shapes: dict
    max_depth: int
    environment: np.ndarray = None
    lights: dict = field(default_factory=dict)
    velocities: dict = field(default_factory=dict)  # FILE -> V by 3 velocity field


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def rotation(axis, angle):
    """Right-handed rotation by `angle` radians about world axis 0, 1 or 2."""
    c, s = np.cos(angle), np.sin(angle)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    m = np.eye(3)
    m[i, i], m[i, j], m[j, i], m[j, j] = c, -s, s, c
    return m


def moved(scene, name, step):
    """A copy of the scene with the parameter called `name` (limn's names) moved by `step`."""
    scene = copy.deepcopy(scene)
    owner, what, *rest = name.split(".", 2)
    axis = "xyz".find(rest[0]) if rest else -1
    if owner == "sensor":
        move_camera(scene.camera, what, axis, step)
    elif owner in scene.lights:
        move_light(scene.lights[owner], what, axis, step)
    elif what in ("reflectance", "specular_reflectance", "alpha", "opacity", "eta"):
        bsdf = next(s.bsdf for s in scene.shapes.values() if s.bsdf and s.bsdf.id == owner)
        if rest:  # color0 or color1
            bsdf.colors[int(rest[0][-1])] += step
        else:
            field_name = what.removeprefix("specular_")
            setattr(bsdf, field_name, getattr(bsdf, field_name) + step)
    elif what == "radiance":
        if owner == "environment":
            scene.environment = scene.environment + step
        for shape in scene.shapes.values():
            if shape.emitter_id == owner:
                shape.radiance = shape.radiance + step
    else:
        move_shape(scene, scene.shapes[owner], name.split(".", 1)[1], axis, step)
    return scene


def move_camera(camera, what, axis, step):
    if what in ("fov", "aperture_radius", "focus_distance"):
        field_name = {"aperture_radius": "radius", "focus_distance": "focus"}.get(what, what)
        setattr(camera, field_name, getattr(camera, field_name) + step)
    elif what == "translate":
        camera.shift[axis] += step
    elif what == "rotate":
        camera.turn = rotation(axis, step) @ camera.turn
    else:
        raise ValueError(what)


def move_light(light, what, axis, step):
    if what == "translate":
        light.position = light.position + step * np.eye(3)[axis]
    elif what == "rotate":
        light.direction = rotation(axis, step) @ light.direction
    elif what == light.power_name():
        light.power = light.power + step
    else:
        setattr(light, what, getattr(light, what) + step)


def shadow_on_plane(light, points, loop):
    """Where light through the points (N by 3) meets the plane of `loop`."""
    w, normal = light.through(points), loop_normal(loop)
    s = (loop[0] - points) @ normal / (w @ normal)
    assert np.all(s > 0), "the plane lies before what should shade it"
    return points + s[:, None] * w


def move_shape(scene, shape, what, axis, step):
    center = shape.center()
    if what.startswith("vertex_positions:"):
        shape.vertices = shape.vertices + step * scene.velocities[what.split(":")[1]]
    elif what.startswith("translate"):
        shape.vertices[:, axis] += step
    elif what.startswith("rotate"):
        shape.vertices = center + (shape.vertices - center) @ rotation(axis, step).T
    elif what == "scale":
        shape.vertices = center + (shape.vertices - center) * (1 + step)
    else:
        raise ValueError(what)


def loop_normal(loop):
    """Unit normal of a planar convex loop, towards the side from which it is counter-clockwise."""
    return unit(np.cross(loop[1] - loop[0], loop[2] - loop[0]))


def mirrored(points, loop):
    """The images of points (N by 3) in the plane of `loop`."""
    normal = loop_normal(loop)
    return points - 2 * ((points - loop[0]) @ normal)[:, None] * normal


def through_layers(eye, points, planes, indices):
    """Unit directions (N by 3) in which an eye sees points (N by 3) through parallel planes (loops, from
    the eye on), behind which media have these indices; 1 before the first.

    The tangent u in the thinnest medium makes the sum of h tan(theta) the distance across: bisection,
    then Newton's method."""
    normal = loop_normal(planes[0]) * np.sign(np.dot(planes[0][0] - eye, loop_normal(planes[0])))
    depth = [0 * points[:, 0]] + [np.dot(p[0] - eye, normal) + 0 * points[:, 0] for p in planes]
    heights = np.diff(np.stack(depth + [(points - eye) @ normal]), axis=0)
    assert np.all(heights > 0)
    across = (points - eye) - np.outer((points - eye) @ normal, normal)
    distance = np.linalg.norm(across, axis=1)
    ratios = min([1, *indices]) / np.array([1, *indices])[:, None]

    def tangents(u):
        return ratios * u / np.sqrt(1 + (1 - ratios**2) * u**2)

    low, high = 0 * distance, distance / heights[np.argmax(ratios[:, 0])]
    for _ in range(50):
        middle = (low + high) / 2
        below = np.sum(heights * tangents(middle), axis=0) < distance
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    u = (low + high) / 2
    for _ in range(3):
        slope = np.sum(heights * ratios / (1 + (1 - ratios**2) * u**2)**1.5, axis=0)
        u = u + (distance - np.sum(heights * tangents(u), axis=0)) / slope
    return unit(normal + across * (tangents(u)[0] / distance)[:, None])


def along_layers(direction, points, planes, indices):
    """Points (N by 3), carried back along parallel rays of this direction to the first of the planes."""
    normal = loop_normal(planes[0]) * np.sign(np.dot(direction, loop_normal(planes[0])))
    for plane, index in reversed(list(zip(planes, indices))):
        across = (direction - np.dot(direction, normal) * normal) / index
        way = across / np.sqrt(1 - np.dot(across, across)) + normal
        points = points - np.outer((points - plane[0]) @ normal, way)
    return points


def hit_plane(camera, film, loop):
    """Where the camera's rays through `film` (N by 2) meet the plane of `loop`: N by 3."""
    normal, origin, d = loop_normal(loop), camera.pinhole(), camera.directions(film)
    t = np.dot(loop[0] - origin, normal) / (d @ normal)
    assert np.all(t > 0)
    return origin + t[:, None] * d


def clip(polygon, normal, offset):
    """The part of a convex polygon (K by D) where x.normal >= offset (Sutherland-Hodgman 1974)."""
    if len(polygon) == 0:
        return polygon
    d = polygon @ normal - offset
    out = []
    for k in range(len(polygon)):
        m = (k + 1) % len(polygon)
        if d[k] >= 0:
            out.append(polygon[k])
        if (d[k] >= 0) != (d[m] >= 0):
            out.append(polygon[k] + (polygon[m] - polygon[k]) * (d[k] / (d[k] - d[m])))
    return np.array(out) if len(out) >= 3 else np.zeros((0, polygon.shape[1]))


def clip_box(polygon, lower, upper):
    """A convex planar polygon clipped to lower <= (x, y) <= upper."""
    for axis in (0, 1):
        normal = np.eye(2)[axis]
        polygon = clip(clip(polygon, normal, lower[axis]), -normal, -upper[axis])
    return polygon


def squares(shape, k):
    """The squares of a checkerboard on face k of a shape: (loop, which colour) of each."""
    loop, uv = shape.face(k), np.asarray(shape.uv[k], dtype=float)
    to_space = np.linalg.lstsq(np.column_stack([uv, np.ones(len(uv))]), loop, rcond=None)[0]
    first, end = np.floor(2 * uv.min(axis=0)), np.ceil(2 * uv.max(axis=0))
    found = []
    for i in range(int(first[0]), int(end[0])):
        for j in range(int(first[1]), int(end[1])):
            part = clip_box(uv, np.array([i, j]) / 2, np.array([i + 1, j + 1]) / 2)
            if len(part):
                found.append((np.column_stack([part, np.ones(len(part))]) @ to_space,
                              0 if i % 2 == j % 2 else 1))
    return found


def ramp(shape, x):
    """The radiance of a lamp with texels at points x (N by 3) of face 0: uv in [1/4, 3/4]^2."""
    loop, uv = shape.face(0), np.asarray(shape.uv[0], dtype=float)
    along = np.stack([loop[1] - loop[0], loop[3] - loop[0]], axis=1)
    st = np.linalg.lstsq(along, (x - loop[0]).T, rcond=None)[0].T
    u, v = (2 * (uv[0] + st @ np.stack([uv[1] - uv[0], uv[3] - uv[0]])) - 0.5).T[:, :, None]
    t = shape.texels / 255
    return (1 - v) * ((1 - u) * t[0, 0] + u * t[0, 1]) + v * ((1 - u) * t[1, 0] + u * t[1, 1])


def clip_convex(polygon, clipper):
    """The intersection of two convex planar polygons of any orientation."""
    center = clipper.mean(axis=0)
    for a, b in zip(clipper, np.roll(clipper, -1, axis=0)):
        normal = np.array([a[1] - b[1], b[0] - a[0]])
        normal = normal * np.sign(np.dot(center - a, normal))
        polygon = clip(polygon, normal, np.dot(a, normal))
    return polygon


def gauss(n):
    """Gauss-Legendre on [0, 1]: nodes and weights that sum to 1."""
    x, w = np.polynomial.legendre.leggauss(n)
    return (x + 1) / 2, w / 2


def square_rule(n):
    """Nodes (n^2 by 2) and weights of the tensor rule on the unit square."""
    x, w = gauss(n)
    u, v = np.meshgrid(x, x, indexing="ij")
    return np.stack([u.ravel(), v.ravel()], axis=1), np.outer(w, w).ravel()


def loop_rule(loop, n):
    """Nodes (M by D) and weights with sum = area, over a planar convex loop (K by D, D = 2 or 3).

    A parallelogram takes the tensor rule; any other loop is fanned into triangles, each with the
    rule of the square collapsed at one corner (Duffy 1982).
    """
    uv, w = square_rule(n)
    u, v = uv[:, :1], uv[:, 1:]
    if len(loop) == 4 and np.allclose(loop[0] + loop[2], loop[1] + loop[3], rtol=0, atol=1e-12):
        a, b = loop[1] - loop[0], loop[3] - loop[0]
        return loop[0] + u * a + v * b, w * span(a, b)
    nodes, weights = [], []
    for k in range(1, len(loop) - 1):
        a, b = loop[k] - loop[0], loop[k + 1] - loop[0]
        nodes.append(loop[0] + u * (a + v * (b - a)))
        weights.append(w * u[:, 0] * span(a, b))
    return np.concatenate(nodes), np.concatenate(weights)


def span(a, b):
    """Area of the parallelogram of two vectors (2D or 3D)."""
    return np.sqrt(max(np.dot(a, a) * np.dot(b, b) - np.dot(a, b) ** 2, 0.0))
