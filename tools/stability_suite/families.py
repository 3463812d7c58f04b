"""The families: each a scene with a knob that is turned until something breaks, and what is true of
it. A new one is a function with its `@family` line: tests and the page loop over FAMILIES."""

from dataclasses import dataclass

import exr
import numpy as np

from . import meshes
from .program import DIFFERENCES as FINITE_DIFFERENCES
from .program import OURS
from .scene import Scene, Shape, diffuse, glossy, twosided

# Of differences: 5 % of a pixel on the table's film, in scene units. An edge is hardly blurred: a
# pixel's derivative changes only while an edge passes one of its corners. Not tuned; at 25 % the
# blur was called a bias.
STEP = 0.005


CLOSED_FORM = "closed form"


@dataclass
class Reference:
    """Where the truth comes from. scene: the same shape made otherwise, or None for the point's own.
    By a formula (closed_form.py), by differences with a step, or by a long run of adaptive. Its
    derivative times `factor` is the point's."""

    scene: Scene = None
    step: float = 0
    factor: float = 1
    closed_form: bool = False

    @property
    def method(self):
        return CLOSED_FORM if self.closed_form else FINITE_DIFFERENCES if self.step else OURS


@dataclass
class Family:
    name: str
    knob: str  # what the numbers are
    values: list
    make: object  # value: (scene, reference)
    what: str  # a sentence
    truth: str  # what the reference is
    why: str = ""  # shown where ours is not right: why

    def point(self, value):
        """(scene, reference)"""
        return self.make(value)


FAMILIES = []


def family(name, knob, values, what, truth, why=""):
    def register(make):
        FAMILIES.append(Family(name, knob, values, make, what, truth, why))
        return make

    return register


def find(name):
    return next(f for f in FAMILIES if f.name == name)


def floor(bsdf=None, z=0.0, half=8):
    return Shape("floor", meshes.level(0, 0, z, half), bsdf or diffuse(0.6))


def lamp(size=0.5, at=(1.0, -0.5, 3.0), power=12.0):
    """A square that shines down; power: radiance times area, whatever its size."""
    return Shape("lamp", meshes.level(*at, size, up=False), radiance=power / (2 * size) ** 2)


def table(mesh, bsdf=None, **more):
    """A thing above a diffuse floor under a square area light that is out of view."""
    return Scene([Shape("object", mesh, bsdf or diffuse(0.5)), floor(), lamp()], **more)


def by_differences(scene, step=STEP):
    return scene, Reference(step=step)


def by_formula(scene, clean=None, factor=1):
    """clean: the same scene around a convex body, where the formula is taken from."""
    return scene, Reference(scene=clean, factor=factor, closed_form=True)


DIFFERENCES = "Differences of the same scene with a small fixed step."
PLAIN = "The same shape as one clean mesh, by a long run of adaptive."
FORMULA = "Closed form (direct light alone: convex shadows and faces, clipped to pixels)."
FORMULA_OF_PLAIN = "Closed form of the same shape as one clean mesh (direct light alone)."
CLOSE = ("Edges within the rounding of positions are united; what is nearer than rays from the "
         "camera can tell is met in double precision, and viewers farther away are looked at from "
         "the edge.")
NARROW = ("The penumbra is narrow: few points of the picture lie in it, each with a derivative of "
          "one over its width (term direct). Differences blur it by their step.")
SET_UP = "Building the tree of edges takes longer than the run: it pays off in longer ones."


@family(
    "coincident", "gap between the faces' edges", [1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 0],
    "A box of six shapes whose edges lie in one place, or a gap apart; the camera moves.",
    "Up to a gap of 1e-4 the box as one clean mesh, by a long run of adaptive; beyond, "
    "differences.", CLOSE,
)
def coincident(gap):
    clean = table(meshes.prism(), parameter="sensor.translate.x")
    pieces = [Shape(f"face{i}", m) for i, m in enumerate(meshes.prism_quads(out=gap))]
    scene = Scene(pieces + clean.shapes[1:], parameter=clean.parameter)
    return (scene, Reference(clean)) if gap <= 1e-4 else by_differences(scene)


@family(
    "shared-face", "how far one box sinks into the other", [1e-1, 1e-2, 1e-4, 1e-6, 1e-8, 0],
    "A box stands on another one of the same plan, or sinks into it; at 0 they share a face. The "
    "camera moves.",
    "One tall box, by a long run of adaptive.", CLOSE,
)
def shared_face(depth):
    plain = table(meshes.prism(), parameter="sensor.translate.x")
    lower = Shape("lower", meshes.prism(0.25, 0.625))
    scene = plain.replaced("object", mesh=meshes.prism(0.625 - depth, 1.0))
    scene.shapes.insert(1, lower)
    return scene, Reference(plain)


@family(
    "tiles", "bricks along each side of the floor", [1, 2, 3, 8, 21],
    "The floor is of bricks, every other row a shape of its own; the camera moves.",
    "One floor, by a long run of adaptive.", CLOSE,
)
def tiles(count):
    plain = table(meshes.prism(), parameter="sensor.translate.x")
    rows = [meshes.join(*meshes.bricks(count, 8, first)) for first in (0, 1) if first < count]
    scene = plain.replaced("floor", mesh=rows[0])
    if count > 1:
        scene.shapes.insert(1, Shape("floor2", rows[1], plain.shape("floor").bsdf))
    return scene, Reference(plain)


@family(
    "t-junctions", "strips of each side", [1, 2, 3, 7, 16, 61],
    "A box whose sides are cut into strips that its lid and floor know nothing of.",
    FORMULA_OF_PLAIN, CLOSE,
)
def t_junctions(count):
    plain = table(meshes.prism(), parameter="object.translate.y", depth=2)
    return by_formula(plain.replaced("object", mesh=meshes.split_sides(count)), plain)


@family(
    "contact", "gap to the floor", [1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 0],
    "A box slides along the floor, at last on it.", FORMULA, NARROW,
)
def contact(gap):
    return by_formula(table(meshes.prism(gap, gap + 0.75), depth=2))


@family(
    "hair-gaps", "gap between two boxes", [1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 0],
    "Two boxes side by side, ever closer; the camera moves.",
    "Up to a gap of 1e-3 differences; beyond, one box, by a long run of adaptive.",
    "What is seen in the gap changes over its width, and hardly a sample falls into it, without "
    "which the radiance differences at its two sides do not cancel. Finite differences do not see "
    "the gap.",
)
def hair_gaps(gap):
    plain = table(meshes.block((0, 0, 0.5), (0.5, 0.25, 0.25)), parameter="sensor.translate.x",
                  eye=(0.4, -3.5, 2.5))
    half = 0.25 - gap / 4
    left = meshes.block((-0.5 + half, 0, 0.5), (half, 0.25, 0.25))
    right = meshes.block((0.5 - half, 0, 0.5), (half, 0.25, 0.25))
    scene = plain.replaced("object", mesh=left)
    scene.shapes.insert(1, Shape("other", right))
    return by_differences(scene) if gap >= 1e-3 else (scene, Reference(plain))


@family(
    "slivers", "width of strips along the edges", [1e-1, 1e-2, 1e-3, 1e-5, 1e-7],
    "A box with ever narrower triangles along all its edges.", PLAIN, CLOSE,
)
def slivers(width):
    plain = table(meshes.prism())
    return plain.replaced("object", mesh=meshes.slivers(width)), Reference(plain)


@family(
    "zero-area", "faces without area", [0, 1, 4, 16, 64, 256],
    "A box and faces whose three different corners lie on one of its edges.", PLAIN, CLOSE,
)
def zero_area(count):
    plain = table(meshes.prism())
    return plain.replaced("object", mesh=meshes.with_faces_without_area(count)), Reference(plain)


@family(
    "duplicates", "copies of every face", [0, 1, 3, 7, 15],
    "A box whose every face is there several times.", FORMULA_OF_PLAIN,
)
def duplicates(count):
    plain = table(meshes.prism(), depth=2)
    p, f = plain.shape("object").mesh
    return by_formula(plain.replaced("object", mesh=(p, np.tile(f, (count + 1, 1)))), plain)


@family(
    "non-manifold", "walls within", [0, 1, 3, 7, 15, 31],
    "A box with walls within, which nobody sees: edges of three and four faces.", PLAIN,
)
def non_manifold(count):
    plain = table(meshes.prism(), twosided(diffuse(0.5)))
    return plain.replaced("object", mesh=meshes.with_inner_walls(count)), Reference(plain)


@family(
    "open", "share of the faces taken away", [0, 0.1, 0.3, 0.5, 0.7, 0.9],
    "A sphere of 320 faces of which ever more are missing: every edge of a hole is a border.",
    DIFFERENCES,
)
def open_mesh(share):
    p, f = meshes.icosphere((0, 0, 0.65), 0.45)
    kept = np.random.default_rng(3).random(len(f)) >= share
    return by_differences(table((p, f[kept]), twosided(diffuse(0.5))))


@family(
    "crossing", "blades", [1, 4, 16, 64],
    "Blades move through a block that stands still: the curves where they cross are edges, too.",
    DIFFERENCES, SET_UP,
)
def crossing(count):
    rng = np.random.default_rng(7)
    block = Shape("block", meshes.turned(meshes.block((0, 0, 0.45), (0.3, 0.3, 0.3)), 0.4),
                  diffuse(0.8))
    blades = []
    for k in range(count):
        z = 0.45 + 0.25 * ((k + 0.5) / count * 2 - 1)
        blade = meshes.block((0, 0, z), (0.5, 0.15, 0.12 / count))
        blades.append(meshes.turned(blade, 0.7 + (rng.uniform(-1, 1) if count > 1 else 0)))
    scene = table(meshes.join(*blades), diffuse(0.3))
    scene.shapes.insert(1, block)
    return by_differences(scene)


@family(
    "seams", "distance of the copies, in radii", [0, 2.4e-16, 1e-12, 1e-8, 1e-7, 1e-6],
    "A sphere of longitudes and latitudes whose first and last meridian differ by a rounding, as "
    "programs write it.",
    "The sphere without a seam, by a long run of adaptive.", CLOSE,
)
def seams(distance):
    at, radius = (0, 0, 0.65), 0.45
    plain = table(meshes.lathe_sphere(at, radius, None))
    return (plain.replaced("object", mesh=meshes.lathe_sphere(at, radius, distance)),
            Reference(plain))


@family(
    "scale", "size of the scene", [1e-10, 1e-6, 1e-3, 1, 1e3, 1e6, 1e10],
    "The same scene in ever smaller or larger units.",
    "Closed form of the scene at scale 1 (direct light alone), divided by the scale.",
)
def scale(size):
    plain = table(meshes.prism(), depth=2)
    return by_formula(plain.scaled(size), plain, 1 / size)


@family(
    "distance", "distance from the origin", [1, 8, 64, 1024, 8192, 131072],
    "The same scene ever farther away; all positions stay exact in float.",
    "Closed form of the scene at the origin (direct light alone).",
)
def distance(offset):
    plain = table(meshes.prism(), depth=2)
    return by_formula(plain.shifted(np.array([offset, offset, offset / 2])), plain)


@family(
    "small-lamps", "size of the light", [1, 1e-1, 1e-2, 1e-3, 1e-4],
    "An area light of constant power that shrinks to a point.", FORMULA, NARROW,
)
def small_lamps(size):
    scene = table(meshes.prism(), depth=2)
    scene.shapes[-1] = lamp(size / 2)
    return by_formula(scene)


@family(
    "near-mirrors", "alpha", [0.3, 0.1, 0.03, 0.01, 3e-3, 1e-3],
    "A box over a floor that becomes a mirror.", DIFFERENCES,
    "A tail: at 0.01 single samples hold 0.8 of the squares of interior and penumbra and half of "
    "those of direct, and a short run meets one of them or none.",
)
def near_mirrors(alpha):
    scene = table(meshes.prism())
    return by_differences(scene.replaced("floor", bsdf=glossy(alpha)))


SUN_SCALE = 100  # so that the file's half precision can hold the smallest sun


def sun_map(degrees):
    """Rows by columns: a dim sky and a round sun of this diameter, of the same power throughout."""
    height = int(min(1024, max(128, 2 ** np.ceil(np.log2(2 * 180 / degrees)))))
    theta = np.pi * np.arange(height) / (height - 1)
    phi = 2 * np.pi * (np.arange(2 * height) + 0.5) / (2 * height)
    d = np.stack(np.broadcast_arrays(np.sin(phi) * np.sin(theta)[:, None], np.cos(theta)[:, None],
                                     -np.cos(phi) * np.sin(theta)[:, None]), -1)
    towards = np.array([0.45, 0.8, 0.4])
    angle = np.arccos(np.clip(d @ (towards / np.linalg.norm(towards)), -1, 1))
    # Its rim half a texel soft, or it would come and go with the texels.
    texel = np.pi / height
    sun = np.clip((np.radians(degrees / 2) - angle) / texel + 0.5, 0, 1)
    weight = np.sin(theta)[:, None] * texel**2
    return 0.2 + 3 * sun / (sun * weight).sum()


@family(
    "sun", "its diameter in degrees", [10, 3, 1, 0.5, 0.2],
    "A box in the light of a map with a sun that shrinks.", DIFFERENCES,
    "Few edges stand before the sun, and a node of the tree says little about which; reading the "
    "map and preparing its sums takes a good part of a short run.",
)
def sun(degrees):
    scene = table(meshes.prism())
    scene.shapes.pop()
    file = "sky.exr"
    scene.files[file] = exr.rgb_bytes(sun_map(degrees) / SUN_SCALE)
    scene.extra = (f'<emitter type="envmap"><string name="filename" value="{file}"/>'
                   f'<float name="scale" value="{SUN_SCALE}"/><transform name="to_world">'
                   '<rotate x="1" angle="90"/></transform></emitter>')
    return by_differences(scene)


@family(
    "intricate", "parts", [1, 10, 100, 1000],
    "A cloud of ever more and smaller tetrahedra over a glossy floor.", DIFFERENCES,
    SET_UP + " What is left at 1000 parts is spread over all that edges do: 0.40 of the squared "
    "error is of the term camera, 0.29 of boundary, 0.23 of direct, 0.09 of penumbra.",
)
def intricate(count):
    p, f = meshes.scattered(count)
    scene = table((p + (0, 0, 0.7), f))
    return by_differences(scene.replaced("floor", bsdf=glossy(0.2)))


@family(
    "strings", "radius", [1e-1, 1e-2, 1e-3, 1e-4],
    "Three slanted strings over a floor; the camera has the middle one, a fiftieth of the table "
    "along each side.",
    "Differences of the same scene with a step of 6 % of a pixel; at 1e-4, of 20 %.",
    "Eighteen edges share the samples of the film, and the camera sees few of them.",
)
def strings(radius):
    rods = [meshes.rod((x - 0.075, -0.35, 0.25), (x + 0.075, 0.35, 0.95), radius)
            for x in (-0.3, 0, 0.3)]
    return by_differences(table(meshes.join(*rods), target=(0, 0, 0.6), fov=0.6),
                          1e-4 if radius > 3e-4 else 3.5e-4)


@family(
    "shells", "thickness", [1e-1, 1e-2, 1e-3, 1e-4, 1e-6],
    "A tray whose walls get thinner.", DIFFERENCES,
)
def shells(thickness):
    return by_differences(table(meshes.tray(thickness)))


@family(
    "grazing", "height of the camera in degrees", [45, 20, 10, 5, 2, 1],
    "A box on a glossy floor, seen ever more along it.", DIFFERENCES,
)
def grazing(degrees):
    angle = np.radians(degrees)
    scene = table(meshes.prism(), eye=(0.5, -4 * np.cos(angle), 4 * np.sin(angle)),
                  target=(0, 0, 0.2 * np.sin(angle)))
    return by_differences(scene.replaced("floor", bsdf=glossy(0.1)))


@family(
    "depth", "length of the paths", [2, 3, 4, 8, 16],
    "A box in a closed room with walls of reflectance 0.8.", DIFFERENCES,
    "Variance, and its tail: from 8 on the terms direct and boundary hold nearly all of the "
    "squared error, and one sample alone up to 0.8 of a term's. A pass of two samples per pixel, "
    "and the pilot before it, take longer than the run.",
)
def depth(length):
    p, f = meshes.room(2.0, 1)
    walls = Shape("walls", (p + (0, 0, 2), f), diffuse(0.8))
    scene = Scene([Shape("object", meshes.prism()), walls, lamp(0.5, (0.5, -0.3, 3.9), 6)],
                  depth=length, eye=(0.4, -1.9, 1.6), target=(0, 0, 0.5), fov=50)
    return by_differences(scene)


@family(
    "normals", "their tilt in degrees", [0, 15, 30, 45, 60, 75, 85],
    "A box whose normals, from its file, lean away from those of its faces.", DIFFERENCES,
)
def normals(tilt):
    p, f = meshes.prism()
    corners, faces, leaning = [], [], []
    rng = np.random.default_rng(11)
    for face in f:
        flat = np.cross(p[face[1]] - p[face[0]], p[face[2]] - p[face[0]])
        flat /= np.linalg.norm(flat)
        for vertex in face:
            side = np.cross(flat, rng.normal(size=3))
            side /= np.linalg.norm(side)
            angle = np.radians(tilt)
            leaning.append(np.cos(angle) * flat + np.sin(angle) * side)
            corners.append(p[vertex])
        faces.append([len(corners) - 3, len(corners) - 2, len(corners) - 1])
    scene = table((np.array(corners), np.array(faces)))
    return by_differences(scene.replaced("object", normals=np.array(leaning)))


@family(
    "in-plane", "step between them", [1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 0],
    "A slab slides along another: ever more nearly flush, so that each lies in the other's plane.",
    DIFFERENCES,
)
def in_plane(step):
    still = Shape("slab", meshes.block((0.5, 0, 0.25), (0.5, 0.6, 0.25)), diffuse(0.5))
    moving = meshes.block((-0.375, 0, 0.25 + step / 2), (0.375, 0.4, 0.25 + step / 2))
    scene = table(moving, diffuse(0.7), parameter="object.translate.y")
    scene.shapes.insert(1, still)
    return by_differences(scene)


@family(
    "inside", "squares along each wall", [1, 2, 4, 8, 16, 32],
    "The mesh is the room around camera, light and block: every point is in it, or on its planes.",
    "The room of six squares, by a long run of adaptive.",
    "Every wall moves, and with it the light on it: the whole picture is noise of the term direct, "
    "which holds 0.94 of the squared error.",
)
def inside(splits):
    def scene(count):
        p, f = meshes.room(2.0, count)
        return Scene([Shape("object", (p + (0, 0, 2), f), diffuse(0.5)),
                      Shape("block", meshes.prism(), diffuse(0.5)), lamp(0.5, (0.5, -0.3, 3.5), 6)],
                     eye=(0.4, -1.9, 1.6), target=(0, 0, 0.5), fov=70)

    return scene(splits), Reference(scene(1))


@family(
    "camera", "distance to an edge in the middle of the view", [1, 1e-1, 1e-2, 1e-3, 1e-4],
    "The camera comes up to a box's upright edge, which moves.", DIFFERENCES,
)
def camera(gap):
    # The edge of the prism at its second corner but one, at the height of the camera.
    x, y = meshes.CORNERS[3]
    eye = np.array([x, y - gap, 0.625])
    scene = table(meshes.prism(), eye=tuple(eye), target=tuple(eye + (0.02, 1, 0.01)), fov=50,
                  near=gap / 16)
    return by_differences(scene, STEP * gap)


@family(
    "tearing", "width of the band that tears", [1e-1, 1e-2, 1e-4, 1e-6, 0],
    "A plate, one half of which moves along the other; between them the velocity falls over a band "
    "that narrows. At 0 the halves are two shapes.",
    DIFFERENCES,
)
def tearing(width):
    def plate(left, right):
        return meshes.quad((left, -0.4, 0.6), (right, -0.4, 0.6), (right, 0.4, 0.6),
                           (left, 0.4, 0.6))

    look = twosided(diffuse(0.5))
    if width == 0:
        scene = table(plate(-0.5, 0), look, parameter="object.translate.y")
        scene.shapes.insert(1, Shape("rest", plate(0, 0.5), look))
        return by_differences(scene)
    edges = [-0.5, -width / 2, width / 2, 0.5]
    p, f = meshes.join(*(plate(a, b) for a, b in zip(edges, edges[1:])))
    velocities = np.zeros((len(p), 3))
    velocities[:, 1] = p[:, 0] < 0
    scene = table((p, f), look, parameter="object.vertex_positions:velocities.txt")
    scene.files["velocities.txt"] = "".join(
        f"{x!r} {y!r} {z!r}\n" for x, y, z in velocities.tolist()).encode()
    return by_differences(scene)
