"""The derivative of a scene whose image follows from a formula: a convex body above a matt floor
under a square area light, direct light alone. No random number enters.

From one point of the light the body's shadow on the floor is a convex polygon, and so are its
outline and its faces on the film: a pixel's radiance is a sum of integrals of smooth functions over
intersections of convex polygons. What is left is the mean over the light, by Gauss-Legendre nodes.
The derivative is a central difference of that, whose step is far below a pixel.
"""

import numpy as np

from .statistics import Estimate

STEP = 1e-5  # of the difference, in scene units: 1e-4 of a pixel of the suite's film
NODES = 8  # of the light along each side
# A rule of degree 4 on a triangle (Strang and Fix 1973): barycentric coordinates and weights.
_A, _B = 0.445948490915965, 0.091576213509771
_CORNERS = np.array([p for a in (_A, _B)
                     for p in ((a, a, 1 - 2 * a), (a, 1 - 2 * a, a), (1 - 2 * a, a, a))])
_WEIGHTS = np.repeat([0.223381589678011, 0.109951743655322], 3)


class _Camera:
    def __init__(self, scene, resolution):
        self.eye = np.array(scene.eye, float)
        self.forward = _unit(np.array(scene.target) - self.eye)
        self.left = _unit(np.cross(scene.up, self.forward))
        self.above = np.cross(self.forward, self.left)
        self.scale = np.tan(np.radians(scene.fov) / 2)
        self.resolution = resolution

    def film(self, points):
        """In pixels, from the upper left."""
        away = points - self.eye
        depth = (away @ self.forward * self.scale)[..., None]
        sides = np.stack([away @ self.left, away @ self.above], -1) / depth
        return self.resolution * (0.5 - 0.5 * sides)

    def points(self, film, corner, normal):
        """Where the rays through places on the film meet a plane."""
        sides = (1 - 2 * film / self.resolution) * self.scale
        away = self.forward + sides[..., :1] * self.left + sides[..., 1:] * self.above
        return self.eye + away * (((corner - self.eye) @ normal) / (away @ normal))[..., None]


def _unit(v):
    return v / np.linalg.norm(v)


def _hull(points):
    """Convex, its corners in the order in which x turns to y."""
    points = sorted(map(tuple, points))

    def half(sequence):
        chain = []
        for p in sequence:
            while len(chain) > 1 and _turn(chain[-2], chain[-1], p) <= 0:
                chain.pop()
            chain.append(p)
        return chain[:-1]

    return np.array(half(points) + half(points[::-1]))


def _turn(a, b, c):
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _clipped(polygons, convex):
    """Sutherland and Hodgman 1974, many at a time. polygons: N by K corners, which may repeat."""
    for a, b in zip(convex, np.roll(convex, -1, axis=0)):
        inward = np.array([a[1] - b[1], b[0] - a[0]])
        height = (polygons - a) @ inward
        following, height_there = np.roll(polygons, -1, 1), np.roll(height, -1, 1)
        inside, there = height >= 0, height_there >= 0
        share = np.where(inside != there, height, 0) / np.where(
            inside != there, height - height_there, 1)
        n, k = height.shape
        corners = np.stack([polygons, polygons + share[..., None] * (following - polygons)], 2)
        kept = np.stack([inside, inside != there], 2).reshape(n, 2 * k)
        count = kept.sum(1)
        order = np.argsort(~kept, axis=1, kind="stable")
        # What is missing repeats the last corner; of nothing, one point is left.
        place = np.minimum(np.arange(max(count.max(), 1)), np.maximum(count - 1, 0)[:, None])
        chosen = np.take_along_axis(order, place, 1)
        polygons = np.take_along_axis(corners.reshape(n, 2 * k, 2), chosen[..., None], 1)
    return polygons


def _within(polygons, convex, value):
    """_integrals() of each polygon's part within a convex one."""
    low, high = convex.min(0), convex.max(0)
    met = ((polygons.min(1) < high) & (polygons.max(1) > low)).all(1)
    result = np.zeros(len(polygons))
    result[met] = _integrals(_clipped(polygons[met], convex), value)
    return result


def _integrals(polygons, value):
    """Of value(places on the film) over each polygon."""
    a, b, c = polygons[:, :1], polygons[:, 1:-1], polygons[:, 2:]
    if b.shape[1] == 0:
        return np.zeros(len(polygons))
    e, f = b - a, c - a
    area = 0.5 * (e[..., 0] * f[..., 1] - e[..., 1] * f[..., 0])
    corners = np.stack(np.broadcast_arrays(a, b, c), 2)  # N, triangles, 3, 2
    places = np.einsum("qc,ntcx->ntqx", _CORNERS, corners)
    return np.einsum("nt,q,ntq->n", area, _WEIGHTS, value(places))


def _reflectance(shape):
    return float(shape.bsdf.split('value="')[1].split('"')[0])


def _pixels(resolution):
    y, x = np.divmod(np.arange(resolution**2), resolution)
    square = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], float)
    return np.stack([x, y], -1)[:, None] + square


class _Image:
    """One scene, from points of its lamp."""

    def __init__(self, scene, resolution):
        self.camera = _Camera(scene, resolution)
        body, floor = scene.shape("object"), scene.shape("floor")
        positions, faces = body.mesh
        self.corners = positions
        self.level = floor.mesh[0][0, 2]
        self.floor_share, self.body_share = _reflectance(floor) / np.pi, _reflectance(body) / np.pi
        pixels = _pixels(resolution)
        outline = _hull(self.camera.film(positions))
        self.pixels, self.behind = pixels, _clipped(pixels, outline)
        self.faces = []
        for face in faces:
            x = positions[face]
            normal = _unit(np.cross(x[1] - x[0], x[2] - x[0]))
            if normal @ (self.camera.eye - x[0]) > 0:
                part = _clipped(pixels, _hull(self.camera.film(x)))
                self.faces.append((part, x[0], normal))

    def lit_by(self, lamp):
        """Mean radiances of the pixels under a point of a lamp that shines down; its radiance times
        its area is 1."""
        up = np.array([0.0, 0, 1])

        def light(corner, normal, share):
            def value(film):
                way = lamp - self.camera.points(film, corner, normal)
                squared = (way**2).sum(-1)
                return share * np.maximum(way @ normal, 0) * (way @ up) / squared**2

            return value

        on_floor = light(np.array([0, 0, self.level]), up, self.floor_share)
        down = (lamp[2] - self.level) / (lamp[2] - self.corners[:, 2:])
        shadow = _hull(self.camera.film(lamp + (self.corners - lamp) * down))
        image = _integrals(self.pixels, on_floor) - _integrals(self.behind, on_floor)
        image -= _within(self.pixels, shadow, on_floor)
        image += _within(self.behind, shadow, on_floor)
        for part, corner, normal in self.faces:
            image += _integrals(part, light(corner, normal, self.body_share))
        return image


def _moved(scene, parameter, distance):
    name, _, axis = parameter.split(".")
    step = distance * np.eye(3)["xyz".index(axis)]
    if name == "sensor":
        moved = scene.replaced("floor")
        moved.eye, moved.target = tuple(scene.eye + step), tuple(scene.target + step)
        return moved
    positions, faces = scene.shape(name).mesh
    return scene.replaced(name, mesh=(positions + step, faces))


def _derivative(scene, resolution, nodes):
    corners = scene.shape("lamp").mesh[0]
    power = scene.shape("lamp").radiance * np.prod(np.ptp(corners, axis=0)[:2])
    places, weights = np.polynomial.legendre.leggauss(nodes)
    low, span = corners.min(0), np.ptp(corners, axis=0)
    ahead, back = (_Image(_moved(scene, scene.parameter, s * STEP), resolution) for s in (1, -1))
    total = 0
    for u, wu in zip(places, weights):
        for v, wv in zip(places, weights):
            lamp = low + span * [0.5 + 0.5 * u, 0.5 + 0.5 * v, 0]
            total = total + 0.25 * wu * wv * (ahead.lit_by(lamp) - back.lit_by(lamp))
    return (power * total / (2 * STEP)).reshape(resolution, resolution)


def derivative(scene, resolution):
    """Of a scene made by families.table() around a convex body, of max_depth 2, by its parameter: a
    translation of the object or the sensor. Its error falls at least with the square of the nodes
    (kinks, where a shadow's edge passes a pixel's corner): a third of the change from half as
    many."""
    assert scene.depth == 2
    mean = _derivative(scene, resolution, NODES)
    return Estimate(mean, ((mean - _derivative(scene, resolution, NODES // 2)) / 3) ** 2)
