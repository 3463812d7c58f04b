"""The closed-form scenes: geometry, materials and the parameters to differentiate.

Coordinates are dyadic fractions, exact in single precision.
"""
import numpy as np

import closed_form_models as models
from closed_form_geometry import Bsdf, Camera, Light, Scene, Shape, unit

MOVES = ["translate.x", "translate.y", "translate.z", "rotate.x", "rotate.y", "rotate.z"]
SENSOR = [f"sensor.{m}" for m in MOVES] + ["sensor.fov"]
FLOOR_MOVES = ["floor.translate.y", "floor.rotate.x", "floor.rotate.z"]
FLOOR_RHO = [0.75, 0.5, 0.25]


def vector(*values):
    return np.array(values, dtype=float)


def moves_of(shape, *more):
    return [f"{shape}.{m}" for m in MOVES + ["scale"] + list(more)]


def parallelogram(corner, a, b):
    """One face, counter-clockwise seen from the side of a x b."""
    c, a, b = vector(*corner), vector(*a), vector(*b)
    return Shape(np.stack([c, c + a, c + a + b, c + b]), [[0, 1, 2, 3]])


def triangle(*corners):
    return Shape(vector(*corners).reshape(3, 3), [[0, 1, 2]])


def floor(kind="diffuse", alpha=0.0):
    """The rectangle [-8, 8]^2 at y = 0, normal +y."""
    shape = Shape(vector(-8, 0, 8, 8, 0, 8, 8, 0, -8, -8, 0, -8).reshape(4, 3), [[0, 1, 2, 3]])
    shape.writer = "floor"
    rho = vector(*FLOOR_RHO) if kind == "diffuse" else None
    shape.bsdf = Bsdf("floor_bsdf", kind, rho, alpha)
    return shape


def lamp(shape, radiance, name="lamp"):
    shape.emitter_id = f"{name}_emitter"
    shape.radiance = vector(*radiance)
    return shape


def floor_camera(size=(2, 2)):
    """Looks down at the floor around (0.75, 0, 0.25) and sees nothing else."""
    return Camera(vector(3, 3, 0.5), vector(0.75, 0, 0.25), vector(0, 1, 0), 4.0, *size)


def octahedron():
    vertices = vector(0.75, 1.5, 0.125, -0.625, 1.625, 0, 0.125, 2.25, 0.125, 0, 0.875, -0.125,
                      0.125, 1.5, 0.75, -0.125, 1.375, -0.625).reshape(6, 3)
    faces = [[2, 4, 0], [2, 1, 4], [2, 5, 1], [2, 0, 5], [3, 0, 4], [3, 4, 1], [3, 1, 5], [3, 5, 0]]
    return Shape(vertices, faces)


BOX_FACES = {"-x": [0, 4, 6, 2], "+x": [1, 3, 7, 5], "-y": [0, 1, 5, 4], "+y": [2, 6, 7, 3],
             "-z": [0, 2, 3, 1], "+z": [4, 5, 7, 6]}


def box(lower, upper, missing=()):
    """An axis-aligned box; corner k is upper along x, y, z where bits 0, 1, 2 of k are set."""
    bits = np.array([[k & 1, k >> 1 & 1, k >> 2 & 1] for k in range(8)])
    vertices = np.where(bits == 1, vector(*upper), vector(*lower))
    shape = Shape(vertices, [f for name, f in BOX_FACES.items() if name not in missing])
    shape.hole = [BOX_FACES[name] for name in missing]
    return shape


def hidden_sky(name, occluder, *more):
    scene = Scene(f"{name}.xml", floor_camera(), {"floor": floor(), "object": occluder}, 2,
                  vector(1, 0.5, 2))
    names = moves_of("object") + FLOOR_MOVES + SENSOR
    names += ["floor_bsdf.reflectance", "environment.radiance", *more]
    return scene, models.HiddenSky(), names


def convex_over_plane():
    scene, model, names = hidden_sky("convex_over_plane", octahedron())
    velocity = np.zeros((6, 3))
    velocity[4] = [0.5, -0.25, 1]
    scene.velocities["convex_over_plane_velocity.txt"] = velocity
    names.append("object.vertex_positions:convex_over_plane_velocity.txt")
    return scene, model, names


def triangle_over_plane():
    occluder = triangle(-0.5, 1.25, -0.5, 0.25, 1.5, 0.75, 0.75, 1, -0.25)
    occluder.hole = [[0, 2, 1]]
    scene, model, names = hidden_sky("triangle_over_plane", occluder)
    velocity = vector(0, 0, 0, 1, 0.5, 0, 0, 0, -1).reshape(3, 3)
    scene.velocities["triangle_over_plane_velocity.txt"] = velocity
    names.append("object.vertex_positions:triangle_over_plane_velocity.txt")
    return scene, model, names


def open_box_over_plane():
    return hidden_sky("open_box_over_plane",
                      box((-0.5, 1, -0.25), (0.25, 1.75, 0.75), missing=["-y"]))


def sideways_box_over_plane():
    return hidden_sky("sideways_box_over_plane",
                      box((-0.5, 1, -0.25), (0.25, 1.75, 0.75), missing=["+x"]))


def tilted_lamp():
    return lamp(parallelogram((-1, 2, -0.5), (1, 0.25, 0), (0, 0.125, 1)), (4, 2, 1))


LAMP_NAMES = (moves_of("lamp") + FLOOR_MOVES + SENSOR
              + ["floor_bsdf.reflectance", "lamp_emitter.radiance"])


def lamp_on_floor(name, shape):
    scene = Scene(f"{name}.xml", floor_camera(), {"floor": floor(), "lamp": shape}, 2)
    return scene, models.LampOnFloor(), LAMP_NAMES


def lamp_over_plane():
    return lamp_on_floor("lamp_over_plane", tilted_lamp())


def triangle_lamp_over_plane():
    return lamp_on_floor("triangle_lamp_over_plane", lamp(
        triangle(-1, 1.5, 0.75, -0.75, 2, -0.75, 0.25, 1.75, 0.25), (4, 2, 1)))


def half_hidden_lamp():
    screen = parallelogram((0.25, 1, -4), (-0.25, 0, 8), (-2, 0, 0))
    shapes = {"floor": floor(), "lamp": tilted_lamp(), "screen": screen}
    scene = Scene("half_hidden_lamp.xml", floor_camera(), shapes, 2)
    return scene, models.HalfHiddenLamp(), moves_of("screen") + LAMP_NAMES


def lamps_in_view(kind):
    camera = Camera(vector(0.625, 0.625, -3.9375), vector(0.375, 0.125, -0.1875), vector(0, 1, 0), 30,
                    4, 4, filter=kind)
    near = lamp(parallelogram((-0.5, -0.75, -0.25), (0.25, 1.25, 0.25), (1, -0.25, 0.5)),
                (3, 1, 0.5), "near")
    far = lamp(parallelogram((0, -0.5, 1), (0.125, 1.25, 0), (1.25, 0.25, -0.25)), (0.5, 2, 4),
               "far")
    scene = Scene(f"lamps_in_view_{kind}.xml", camera, {"near": near, "far": far}, 1,
                  vector(0.25, 0.5, 1))
    names = SENSOR + moves_of("near") + moves_of("far")
    names += ["near_emitter.radiance", "far_emitter.radiance", "environment.radiance"]
    return scene, models.LampsInView(), names


def lamps_behind_mask():
    """A veil before a part of both."""
    scene, _, names = lamps_in_view("box")
    mask = parallelogram((-0.15625, -1.0625, -0.96875), (-0.03125, 1, 0.125), (1.09375, 0.25, -0.21875))
    mask.bsdf = Bsdf("mask_bsdf", "mask", opacity=0.375)
    scene.name, scene.max_depth, scene.shapes = "lamps_behind_mask.xml", 2, {
        "mask": mask, **scene.shapes}
    return scene, models.LampsBehindMask(), names + moves_of("mask") + ["mask_bsdf.opacity"]


def lamp_behind_mask():
    """The floor sees a part of the lamp through a veil."""
    mask = parallelogram((0, 0.625, 0.0625), (0.0625, 0.0625, 0.75), (0.75, 0.25, 0.125))
    scene, _, names = lamp_in_mirror()
    mask.bsdf = Bsdf("mask_bsdf", "mask", opacity=0.375)
    scene.name = "lamp_behind_mask.xml"
    scene.shapes = {"floor": scene.shapes["floor"], "mask": mask, "lamp": scene.shapes["lamp"]}
    names = moves_of("mask") + [n for n in names if not n.startswith("mirror")]
    return scene, models.LampBehindMask(), names + ["mask_bsdf.opacity"]


def square_in_mirror():
    """Two lamps behind the camera, in a flat mirror in front of it that shows a part of one."""
    camera = Camera(vector(0.625, 0.625, -3.9375), vector(0.375, 0.1875, -0.1875), vector(0, 1, 0),
                    30, 4, 4)
    mirror = parallelogram((-0.5, -0.71875, -0.21875), (-0.078125, 1.28125, 0.296875),
                           (1.546875, 0.296875, 0.140625))
    mirror.bsdf = Bsdf("mirror_bsdf", "mirror", vector(0.75, 0.5, 0.875))
    near = lamp(parallelogram((0.25, 0.6875, -4.125), (1, 0.125, -0.5), (0.0625, 1.6875, 0.25)),
                (3, 1, 0.5), "near")
    far = lamp(parallelogram((0.8125, 1.4375, -6.125), (2.5625, -0.0625, 0.5625),
                             (0.25, 1.875, 0.8125)), (0.5, 2, 4), "far")
    scene = Scene("square_in_mirror.xml", camera, {"mirror": mirror, "near": near, "far": far}, 2,
                  vector(0.25, 0.5, 1))
    names = SENSOR + moves_of("mirror") + moves_of("near") + moves_of("far")
    names += ["near_emitter.radiance", "far_emitter.radiance", "environment.radiance",
              "mirror_bsdf.specular_reflectance"]
    return scene, models.LampsInMirror(), names


def mirror_wedge():
    """A lamp in each of two mirrors that meet in a crease, which cuts their images."""
    scene, _, _ = square_in_mirror()
    bsdf = scene.shapes["mirror"].bsdf
    mirror = Shape(vector(0.4375, -0.6875, -0.3125, 0.5, 1.25, -0.25, -0.5, 1.3125, 0.125,
                          -0.5625, -0.625, 0.0625, 1.5625, -0.625, 0.0625,
                          1.625, 1.3125, 0.125).reshape(6, 3), [[0, 3, 2, 1], [0, 1, 5, 4]])
    mirror.bsdf = bsdf
    near = lamp(parallelogram((-2.125, 0.125, -2.9375), (0.0625, 1.125, 0.0625), (-0.6875, 0, 0.75)),
                (3, 1, 0.5), "near")
    far = lamp(parallelogram((3.5, 0.125, -2.25), (0.125, 1.25, 0), (-0.625, 0.0625, -0.8125)),
               (0.5, 2, 4), "far")
    scene.name = "mirror_wedge.xml"
    scene.shapes = {"mirror": mirror, "near": near, "far": far}
    names = moves_of("mirror") + ["near.translate.x", "near.rotate.z", "far.translate.y",
                                  "far.scale", "sensor.translate.x", "mirror_bsdf.specular_reflectance"]
    return scene, models.LampsInWedge(), names


def orthographic_mirror():
    """The same with the lamps where parallel rays meet both; the only pixel sees all of the mirror."""
    scene, model, names = square_in_mirror()
    scene.shapes["near"].vertices[:, 1] -= 0.125
    scene.shapes["far"].vertices += vector(-0.875, 0.25, 0)
    return scene, model, [n for n in names if not n.startswith("sensor.translate")]


def by_another_camera(made, name, names=None, **changes):
    """The scene with another camera. names: parameters, if not all."""
    scene, model, all_names = made
    names = names or all_names
    scene.name = f"{name}.xml"
    for field, value in changes.items():
        setattr(scene.camera, field, value)
    if scene.camera.half_width:
        return scene, model, [n for n in names if n != "sensor.fov"]
    return scene, models.ThroughLens(model), names + ["sensor.aperture_radius"]


def lamp_in_mirror():
    """The floor sees a part of the lamp in a mirror beside it, too."""
    mirror = parallelogram((-1.5, 0.125, 0), (0.125, 1.25, 0), (0.0625, 0.125, 2))
    mirror.bsdf = Bsdf("mirror_bsdf", "mirror", vector(0.75, 0.5, 0.875))
    shapes = {"floor": floor(), "mirror": mirror,
              "lamp": lamp(parallelogram((-0.75, 1.75, -0.75), (1, -0.75, 0), (0, 0.125, 1.75)),
                           (4, 2, 1))}
    scene = Scene("lamp_in_mirror.xml", floor_camera((1, 1)), shapes, 3)
    names = moves_of("mirror") + ["lamp.translate.x", "lamp.translate.y", "lamp.rotate.z",
                                  "floor.translate.y", "floor.rotate.x", "sensor.translate.x",
                                  "lamp_emitter.radiance", "mirror_bsdf.specular_reflectance"]
    return scene, models.LampInMirror(["mirror"]), names


def lamp_in_corner():
    """The floor sees a part of the lamp in a mirror, and in two one after the other, each of which cuts
    it. It sees nothing lit of itself in them: they stand high enough to show what is above it."""
    scene, _, _ = lamp_in_mirror()
    mirror = parallelogram((-1.5, 0.5, -1.5), (0.0625, 0.875, 0), (0.0625, 0.125, 3.5))
    other = parallelogram((-1.125, 0.375, -2.1875), (1.5, 0.0625, 0.125), (0.0625, 1, 0.0625))
    mirror.bsdf = Bsdf("mirror_bsdf", "mirror", vector(0.75, 0.5, 0.875))
    other.bsdf = Bsdf("other_bsdf", "mirror", vector(0.875, 0.75, 0.625))
    scene.name, scene.max_depth, scene.camera.fov = "lamp_in_corner.xml", 4, 0.25
    scene.shapes = {"floor": scene.shapes["floor"], "mirror": mirror, "other": other,
                    "lamp": scene.shapes["lamp"]}
    names = ["mirror.translate.x", "mirror.rotate.y", "mirror.scale", "other.translate.z",
             "other.rotate.x", "other.rotate.y", "lamp.translate.x", "lamp.rotate.z",
             "floor.translate.y", "floor.rotate.x", "sensor.translate.x",
             "mirror_bsdf.specular_reflectance", "other_bsdf.specular_reflectance"]
    return scene, models.LampInMirror(["mirror"], ["other", "mirror"]), names


def through_glass(name, glass, moves, max_depth, *faces):
    camera = Camera(vector(0.25, 3, -1.5), vector(0.25, -1, 0.25), vector(0, 1, 0), 40, 2, 1)
    near = lamp(parallelogram((-0.875, -1.25, 0), (0.125, 0.0625, 0.5), (0.75, -0.125, 0.0625)),
                (3, 1, 0.5), "near")
    angles = np.arange(8) * (np.pi / 4)
    center, a, b = vector(0.9375, -1.5, 0.375), vector(0.125, 0.0625, 0.375), vector(0.375, 0, -0.125)
    disc = np.round((center + np.outer(np.cos(angles), a) + np.outer(np.sin(angles), b)) * 256) / 256
    disc[:, 1] = np.round((center[1] + (disc - center) @ vector(0, 0, 0.125)) * 4096) / 4096
    far = lamp(Shape(disc, [list(range(8))]), (0.5, 2, 4), "far")
    glass.bsdf = Bsdf("glass_bsdf", "dielectric", eta=1.3125)
    scene = Scene(f"{name}.xml", camera, {"glass": glass, "near": near, "far": far}, max_depth)
    names = SENSOR + moves_of("near") + moves_of("far")
    names += ["near_emitter.radiance", "far_emitter.radiance", "glass_bsdf.eta"]
    names += [f"glass.{move}" for move in moves]
    return scene, models.LampsThroughGlass(*faces), names


def lamps_under_water():
    return through_glass("lamps_under_water",
                         parallelogram((-8, -0.25, -8), (0, 0.5, 16), (16, 0.25, 0)), MOVES, 2, 0)


def lamps_through_pane(name, height):
    return through_glass(name, box((-8, -height, -8), (8, height, 8)),
                         ["rotate.x", "rotate.z", "scale"], 3, 3, 2)


def crossing_in_view():
    camera = Camera(vector(0.375, 0.5, -3.9375), vector(0.5, 0.25, -0.1875), vector(0, 1, 0), 30, 4,
                    4)
    plane = lamp(parallelogram((-1, -1, 0.25), (0.25, 2.25, 0.125), (2.25, -0.25, 0.25)),
                 (0.5, 2, 4), "plane")
    cube = lamp(box((0.0625, -0.21875, 0), (0.65625, 0.375, 0.59375)), (3, 1, 0.5), "object")
    scene = Scene("crossing_in_view.xml", camera, {"plane": plane, "object": cube}, 1,
                  vector(0.25, 0.5, 1))
    names = SENSOR + moves_of("object") + moves_of("plane")
    names += ["object_emitter.radiance", "plane_emitter.radiance", "environment.radiance"]
    return scene, models.CrossingInView(), names


def crossing_over_plane():
    cube = lamp(box((-0.65625, 1.96875, -0.28125), (-0.375, 2.25, 0)), (1, 3, 8), "object")
    shapes = {"floor": floor(), "lamp": tilted_lamp(), "object": cube}
    scene = Scene("crossing_over_plane.xml", floor_camera(), shapes, 2)
    names = moves_of("object") + LAMP_NAMES + ["object_emitter.radiance"]
    return scene, models.CrossingLampsOnFloor(), names


def lamp_in_gloss(kind, alpha):
    scene = Scene(f"lamp_in_{kind}.xml", floor_camera(),
                  {"floor": floor(kind, alpha), "lamp": tilted_lamp()}, 2)
    names = [n for n in LAMP_NAMES if n != "floor_bsdf.reflectance"] + ["floor_bsdf.alpha"]
    return scene, models.LampInGloss(), names


def cube_in_sky(name, face_normals):
    cube = box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5))
    cube.bsdf = Bsdf("object_bsdf", "diffuse", vector(0.6, 0.6, 0.6))
    cube.writer, cube.face_normals = "split", face_normals
    camera = Camera(vector(1.6875, 0.9375, -2.9375), vector(0.3125, 0.125, 0.125), vector(0, 1, 0),
                    38, 4, 4)
    scene = Scene(f"{name}.xml", camera, {"object": cube}, 2, vector(1, 1, 1))
    names = moves_of("object") + SENSOR + ["object_bsdf.reflectance", "environment.radiance"]
    return scene, models.ConvexInView(), names


def receiver_in_view():
    receiver = parallelogram((-0.5, 0, -0.5), (0.125, 0.25, 1), (1, 0.125, -0.125))
    receiver.bsdf = Bsdf("receiver_bsdf", "diffuse", vector(0.875, 0.75, 0.5))
    camera = Camera(vector(0.125, 2.5, -2.0625), vector(0.3125, -0.125, -0.25), vector(0, 1, 0), 39,
                    4, 4)
    shapes = {"receiver": receiver,
              "lamp": lamp(parallelogram((-1, 2.5, -0.25), (1, 0.25, 0), (0, 0.125, 1)), (4, 2, 1))}
    scene = Scene("receiver_in_view.xml", camera, shapes, 2)
    names = moves_of("receiver") + moves_of("lamp") + SENSOR
    names += ["receiver_bsdf.reflectance", "lamp_emitter.radiance"]
    return scene, models.ReceiverInView(), names


def wedge_in_gloss():
    wedge = Shape(vector(-0.125, 2, -0.75, 0, 2.125, 0.75, -1, 2.75, -0.75, -0.875, 2.875, 0.75,
                         0.75, 2.875, -0.75, 0.875, 3, 0.75).reshape(6, 3),
                  [[0, 1, 3, 2], [0, 4, 5, 1]])
    wedge.bsdf = Bsdf("wedge_bsdf", "diffuse", vector(0.75, 0.5, 0.25))
    shapes = {"floor": floor("ggx", 0.375), "wedge": wedge,
              "lamp": lamp(parallelogram((-3, 1, -0.5), (0, 0, 1), (0.75, -0.125, 0)), (16, 8, 4))}
    scene = Scene("wedge_in_gloss.xml", floor_camera(), shapes, 3)
    names = moves_of("wedge") + LAMP_NAMES + ["wedge_bsdf.reflectance", "floor_bsdf.alpha"]
    return scene, models.WedgeInGloss(), [n for n in names if n != "floor_bsdf.reflectance"]


def moves_of_light(light):
    names = [f"lamp.{light.power_name()}"]
    names += [f"lamp.{m}" for m in MOVES if light.position is not None and m.startswith("t")]
    names += [f"lamp.{m}" for m in MOVES if light.direction is not None and m.startswith("r")]
    return names + (["lamp.cutoff_angle", "lamp.beam_width"] if light.kind == "spot" else [])


def sharp_shadow(name, light):
    """The light and the corner of the triangle that shades the middle of the view are in line."""
    occluder = triangle(0.296875, 1.25, -0.046875, -1.0625, 1.5, -0.25, 0.1875, 1.5, -2)
    scene = Scene(f"{name}.xml", floor_camera(), {"floor": floor(), "object": occluder}, 2,
                  lights={"lamp": light})
    names = moves_of("object") + moves_of_light(light) + FLOOR_MOVES + SENSOR
    return scene, models.SharpShadow(), names + ["floor_bsdf.reflectance"]


ABOVE = (-0.5, 4, -0.5)  # a light there shades the middle of the view by that corner


def shadow_of_spot(name, cutoff, beam):
    axis = unit(vector(0.5, -4, 0.5))
    return sharp_shadow(name, Light("spot", vector(64, 32, 16), vector(*ABOVE), axis, cutoff, beam))


def shadow_in_gloss():
    """A spot beside the floor lights a panel above it past a small triangle; it misses the floor."""
    panel = parallelogram((-1.5, 2, -1.25), (3, 0.5, 0), (0, 0.125, 2.5))
    panel.bsdf = Bsdf("panel_bsdf", "diffuse", vector(0.75, 0.5, 0.25))
    occluder = triangle(-1.5, 1.25, -0.25, -1.25, 1.375, 0.25, -1.5625, 1.625, 0)
    occluder.bsdf = Bsdf("object_bsdf", "diffuse", vector(0, 0, 0))
    position = vector(-3, 0.5, 0)
    light = Light("spot", vector(64, 32, 16), position, unit(vector(2.625, 1.75, 0)), 38, 34)
    scene = Scene("shadow_in_gloss.xml", floor_camera((1, 1)),
                  {"floor": floor("ggx", 0.375), "object": occluder, "panel": panel}, 3,
                  lights={"lamp": light})
    names = ["object.translate.x", "object.translate.y", "object.rotate.z", "object.scale",
             "lamp.translate.x", "lamp.translate.z", "lamp.rotate.z", "lamp.intensity",
             "panel.translate.y", "panel.rotate.x", "floor.translate.y", "floor.rotate.x",
             "sensor.translate.x", "sensor.rotate.y", "panel_bsdf.reflectance", "floor_bsdf.alpha"]
    return scene, models.SharpShadowInGloss(), names


COLORS = [[0.875, 0.5, 0.125], [0.125, 0.25, 0.75]]


def board(shape, uv):
    """A checkerboard; uv: of every face."""
    shape.bsdf = Bsdf("board_bsdf", colors=vector(*np.ravel(COLORS)).reshape(2, 3))
    shape.uv = [vector(*np.ravel(corners)).reshape(-1, 2) for corners in uv]
    return shape


def boards_in_view(name, vertices, faces, uv):
    camera = Camera(vector(0.125, 2.5, -2.0625), vector(0.3125, -0.125, -0.25), vector(0, 1, 0), 39,
                    4, 4)
    shape = board(Shape(vector(*np.ravel(vertices)).reshape(-1, 3), faces), uv)
    scene = Scene(f"{name}.xml", camera, {"board": shape}, 2, vector(1, 1, 1))
    names = moves_of("board") + SENSOR + ["environment.radiance"]
    return scene, models.BoardInView(), names + [f"board_bsdf.reflectance.color{k}" for k in (0, 1)]


def board_in_sky():
    corner, a, b = vector(-0.5, 0, -0.5), vector(0.125, 0.25, 1), vector(1, 0.125, -0.125)
    return boards_in_view("board_in_sky", [corner, corner + a, corner + a + b, corner + b],
                          [[0, 1, 2, 3]], [[[0, 0.4375], [1, 0.9375], [0.75, 1.9375], [-0.25, 1.4375]]])


def seam_in_sky():
    """Three boards in one plane. Squares end exactly at the first's borders and at its common edge
    with the second; the edge of the second and the third is a seam."""
    o, a = vector(-0.5625, 0, -0.5), vector(0.125, 0.25, 1)
    b = vector(0.375, 0.046875, -0.046875) * (33 / 32)
    vertices = [o + k * b + side * a for k in range(4) for side in (0, 1)]
    faces = [[2 * k, 2 * k + 1, 2 * k + 3, 2 * k + 2] for k in range(3)]

    def uv(u, v):
        return [[u, v], [u, v + 1], [u + 0.5, v + 1], [u + 0.5, v]]

    return boards_in_view("seam_in_sky", vertices, faces,
                          [uv(0, 0), uv(0.5, 0), uv(0.25, 0.125)])


def board_in_gloss():
    shape = board(parallelogram((-1, 2.75, -0.75), (1, -0.625, 0.0625), (0.125, 0.125, 1.5)),
                  [[[0.125, 0.25], [0.75, 0.375], [0.625, 1.125], [0, 1]]])
    shapes = {"floor": floor("ggx", 0.375), "board": shape,
              "lamp": lamp(parallelogram((-3, 1, -0.5), (0, 0, 1), (0.75, -0.125, 0)), (16, 8, 4))}
    scene = Scene("board_in_gloss.xml", floor_camera((1, 1)), shapes, 3)
    names = ["board.translate.x", "board.translate.y", "board.rotate.z", "board.scale",
             "lamp.translate.x", "floor.translate.y", "floor.rotate.x", "sensor.translate.x",
             "board_bsdf.reflectance.color0", "board_bsdf.reflectance.color1"]
    return scene, models.BoardInGloss(), names


def textured_lamp():
    shape = parallelogram((-1, 2, -0.5), (1, 0.25, 0), (0, 0.125, 1))
    shape.emitter_id = "lamp_emitter"
    shape.uv = [vector(0.25, 0.25, 0.75, 0.25, 0.75, 0.75, 0.25, 0.75).reshape(4, 2)]
    shape.texels = vector(255, 0, 64, 32, 255, 0, 0, 128, 255, 128, 16, 0).reshape(2, 2, 3)
    scene = Scene("textured_lamp.xml", floor_camera((1, 1)), {"floor": floor(), "lamp": shape}, 2)
    names = ["lamp.translate.x", "lamp.translate.y", "lamp.rotate.y", "lamp.rotate.z", "lamp.scale",
             "floor.translate.y", "floor.rotate.x", "sensor.translate.x", "floor_bsdf.reflectance"]
    return scene, models.RampOnFloor(), names


SCENES = {
    "convex_over_plane": convex_over_plane,
    "lamp_over_plane": lamp_over_plane,
    "triangle_lamp_over_plane": triangle_lamp_over_plane,
    "half_hidden_lamp": half_hidden_lamp,
    "lamps_in_view_box": lambda: lamps_in_view("box"),
    "lamps_in_view_tent": lambda: lamps_in_view("tent"),
    "lamps_in_view_gaussian": lambda: lamps_in_view("gaussian"),
    "square_in_mirror": square_in_mirror,
    "square_in_mirror_orthographic": lambda: by_another_camera(
        orthographic_mirror(), "square_in_mirror_orthographic", half_width=1.0625, width=1,
        height=1),
    "square_in_mirror_thinlens": lambda: by_another_camera(
        square_in_mirror(), "square_in_mirror_thinlens",
        ["sensor.translate.x", "sensor.rotate.y", "mirror.translate.z", "mirror.rotate.y",
         "near.translate.x", "near.rotate.z", "far.translate.y", "far.scale",
         "mirror_bsdf.specular_reflectance"], radius=0.0625, focus=3.5, width=1, height=1),
    "mirror_wedge": mirror_wedge,
    "lamp_in_mirror": lamp_in_mirror,
    "lamp_in_corner": lamp_in_corner,
    "lamps_behind_mask": lamps_behind_mask,
    "lamp_behind_mask": lamp_behind_mask,
    "lamps_under_water": lamps_under_water,
    "lamps_through_pane": lambda: lamps_through_pane("lamps_through_pane", 0.5),
    "lamps_through_thin_pane": lambda: lamps_through_pane("lamps_through_thin_pane", 1 / 64),
    "crossing_in_view": crossing_in_view,
    "crossing_over_plane": crossing_over_plane,
    "lamp_in_ggx": lambda: lamp_in_gloss("ggx", 0.1),
    "lamp_in_beckmann": lambda: lamp_in_gloss("beckmann", 0.3),
    "cube_in_sky": lambda: cube_in_sky("cube_in_sky", True),
    "split_cube_in_sky": lambda: cube_in_sky("split_cube_in_sky", False),
    "receiver_in_view": receiver_in_view,
    "triangle_over_plane": triangle_over_plane,
    "open_box_over_plane": open_box_over_plane,
    "sideways_box_over_plane": sideways_box_over_plane,
    "wedge_in_gloss": wedge_in_gloss,
    "shadow_of_point": lambda: sharp_shadow(
        "shadow_of_point", Light("point", vector(64, 32, 16), vector(*ABOVE))),
    "shadow_of_directional": lambda: sharp_shadow(
        "shadow_of_directional",
        Light("directional", vector(4, 2, 1), direction=unit(vector(1.25, -4, 0.75)))),
    "shadow_of_spot": lambda: shadow_of_spot("shadow_of_spot", 30, 20),
    "shadow_in_falloff": lambda: shadow_of_spot("shadow_in_falloff", 30, 1),
    "shadow_in_gloss": shadow_in_gloss,
    "board_in_sky": board_in_sky,
    "seam_in_sky": seam_in_sky,
    "board_in_gloss": board_in_gloss,
    "textured_lamp": textured_lamp,
}
