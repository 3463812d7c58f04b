"""One small scene per feature that limn and Mitsuba 3 share, for compare_with_mitsuba.py."""
import itertools
import os

import mitsuba as mi
import numpy as np

SCENE = """<scene version="3.0.0">
  <integrator type="path">{integrator}</integrator>
  <sensor type="{camera}">
    {sensor}
    <transform name="to_world"><lookat origin="1.5,3,6" target="0.1,0.7,0" up="0,1,0"/></transform>
    <film type="hdrfilm"><string name="component_format" value="float32"/>
      <string name="pixel_format" value="rgb"/>{film}</film>
  </sensor>
  <shape type="rectangle" id="floor">
    <transform name="to_world"><rotate x="1" angle="-90"/><scale value="4"/></transform>
    {floor}
  </shape>
  {objects}
  {lights}
</scene>
"""

DEPTH = '<integer name="max_depth" value="{}"/><integer name="rr_depth" value="{}"/>'
FOV = '<float name="fov" value="40"/>'
SIZE = '<integer name="width" value="{}"/><integer name="height" value="{}"/>'
BOX = '<rfilter type="box"/>'
GREY = '<bsdf type="diffuse"><rgb name="reflectance" value="0.7,0.5,0.3"/></bsdf>'
CLAY = '<bsdf type="diffuse"><rgb name="reflectance" value="0.6,0.4,0.5"/></bsdf>'
GLOW = '<emitter type="area"><rgb name="radiance" value="2,3,1"/></emitter>'
CUBE = """<shape type="cube"><transform name="to_world"><scale value="0.6"/><rotate y="1" angle="30"/>
    <translate x="-1" y="0.8"/></transform><bsdf type="diffuse"/></shape>"""
LAMP = """<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="{angle}"/>
    <scale value="{size}"/><translate x="{x}" y="4"/></transform>
    <emitter type="area"><rgb name="radiance" value="{radiance}"/></emitter></shape>"""
ONE_LAMP = LAMP.format(angle=90, size=0.8, x=0, radiance="8,7,6")
VISIBLE_LAMP = """<shape type="rectangle"><transform name="to_world"><scale value="0.7"/>
    <translate x="1" y="1.2" z="-1"/></transform>
    <emitter type="area"><rgb name="radiance" value="3,2,1"/></emitter></shape>"""
CONSTANT = '<emitter type="constant"><rgb name="radiance" value="0.3,0.4,0.5"/></emitter>'
TILTED = '<transform name="to_world"><lookat origin="2,4,2" target="-0.5,0.4,0" up="0,1,0"/></transform>'
POINT = """<emitter type="point"><point name="position" value="1,3,2"/>
    <rgb name="intensity" value="30,20,10"/></emitter>"""
PLACED_POINT = """<emitter type="point"><rgb name="intensity" value="9"/><transform name="to_world">
    <rotate y="1" angle="30"/><translate x="1" y="2" z="-1"/></transform></emitter>"""
SPOT = f"""<emitter type="spot">{TILTED}<rgb name="intensity" value="60,40,20"/></emitter>"""
WIDE_SPOT = f"""<emitter type="spot">{TILTED}<rgb name="intensity" value="20,40,60"/>
    <float name="cutoff_angle" value="35"/><float name="beam_width" value="5"/></emitter>"""
DIRECTIONAL = """<emitter type="directional"><vector name="direction" value="1,-2,-0.5"/>
    <rgb name="irradiance" value="1,2,3"/></emitter>"""
TURNED_DIRECTIONAL = f"""<emitter type="directional">{TILTED}
    <rgb name="irradiance" value="3,2,1"/></emitter>"""
CONDUCTOR = """<bsdf type="roughconductor"><string name="distribution" value="{distribution}"/>
    <float name="alpha" value="{alpha}"/><rgb name="eta" value="0.2,0.92,1.1"/>
    <rgb name="k" value="3.9,2.4,2.1"/></bsdf>"""
COLOURED = """<rgb name="specular_reflectance" value="0.8,0.6,0.9"/>
    <rgb name="specular_transmittance" value="0.5,0.9,0.7"/>"""
ROUGH_GLASS = """<bsdf type="roughdielectric"><string name="distribution" value="{}"/>
    <float name="alpha" value="{}"/></bsdf>"""
BUBBLE = '<string name="int_ior" value="air"/><string name="ext_ior" value="water"/>'
TRANSPARENT = {
    "conductor": '<bsdf type="conductor"><string name="material" value="Cu"/></bsdf>',
    "dielectric": '<bsdf type="dielectric"/>',
    "coloured dielectric": f'<bsdf type="dielectric">{COLOURED}</bsdf>',
    "bubble": f'<bsdf type="dielectric">{BUBBLE}</bsdf>',
    "thindielectric": f'<bsdf type="thindielectric">{COLOURED}</bsdf>',
    "plastic": '<bsdf type="plastic"><rgb name="diffuse_reflectance" value="0.7,0.5,0.3"/></bsdf>',
    "nonlinear plastic": '<bsdf type="plastic"><boolean name="nonlinear" value="true"/></bsdf>',
    "ggx glass": ROUGH_GLASS.format("ggx", 0.2),
    "beckmann glass": ROUGH_GLASS.format("beckmann", 0.4),
    "rough bubble": f'<bsdf type="roughdielectric">{BUBBLE}</bsdf>',
    "mask": f'<bsdf type="mask"><float name="opacity" value="0.3"/>{CLAY}</bsdf>',
    "null": '<bsdf type="null"/>',
    "blendbsdf": f'<bsdf type="blendbsdf"><float name="weight" value="0.3"/>{CLAY}'
                 + CONDUCTOR.format(distribution="ggx", alpha=0.2) + "</bsdf>",
}
MESH = """<shape type="obj"><string name="filename" value="{file}"/>
    <boolean name="face_normals" value="{flat}"/><transform name="to_world"><scale value="{scale}"/>
    <translate x="0.8" y="0.9"/></transform>{bsdf}</shape>"""


def write_sphere(file, rings, columns, normals=False):
    """A coarse unit sphere, without normals or with the sphere's own; the vertices are shared."""
    lines = ["v 0 1 0"]
    for i, j in itertools.product(range(1, rings), range(columns)):
        a, b = np.pi * i / rings, 2 * np.pi * j / columns
        lines.append(f"v {np.sin(a) * np.sin(b)} {np.cos(a)} {np.sin(a) * np.cos(b)}")
    lines.append("v 0 -1 0")
    last = 2 + (rings - 1) * columns
    at = lambda i, j: 2 + (i - 1) * columns + j % columns
    for j in range(columns):
        lines += [f"f 1 {at(1, j)} {at(1, j + 1)}",
                  f"f {last} {at(rings - 1, j + 1)} {at(rings - 1, j)}"]
        for i in range(1, rings - 1):
            lines += [f"f {at(i, j)} {at(i + 1, j)} {at(i + 1, j + 1)}",
                      f"f {at(i, j)} {at(i + 1, j + 1)} {at(i, j + 1)}"]
    if normals:
        lines = [f"f {' '.join(f'{v}//{v}' for v in line.split()[1:])}" if line[0] == "f" else
                 f"{line}\n{line.replace('v', 'vn')}" for line in lines]
    with open(file, "w") as out:
        out.write("\n".join(lines) + "\n")


def write_octahedron(file):
    """A PLY file; its vertices have the normals of their faces."""
    corners = []
    for x, y, z in itertools.product((1, -1), repeat=3):
        face = np.diag([x, y, z])[::x * y * z]
        corners += [[*corner, x, y, z] for corner in face]
    kinds = "".join(f"property float {n}\n" for n in ("x", "y", "z", "nx", "ny", "nz"))
    lines = [f"ply\nformat ascii 1.0\nelement vertex 24\n{kinds}element face 8\n"
             "property list uchar int vertex_index\nend_header"]
    lines += [" ".join(map(str, corner)) for corner in corners]
    lines += [f"3 {i} {i + 1} {i + 2}" for i in range(0, 24, 3)]
    with open(file, "w") as out:
        out.write("\n".join(lines) + "\n")


def write_sky(file, width, height):
    """A smooth sky with one bright spot, different in every direction."""
    y, x = np.mgrid[0:height, 0:width]
    sky = np.stack([0.3 + 0.2 * np.sin(2 * np.pi * x / width), 0.4 + 0.3 * y / height,
                    0.5 + 0.2 * np.cos(4 * np.pi * x / width)], axis=-1)
    sky[height // 4, width // 3] = [40, 30, 20]
    mi.Bitmap(sky.astype(np.float32)).write(file)


def scene(folder, name, **parts):
    defaults = {"integrator": DEPTH.format(3, 1000), "camera": "perspective", "sensor": FOV,
                "film": SIZE.format(48, 48) + BOX, "floor": GREY, "objects": CUBE,
                "lights": ONE_LAMP + CONSTANT}
    file = os.path.join(folder, name.replace(" ", "_") + ".xml")
    with open(file, "w") as out:
        out.write(SCENE.format(**{**defaults, **parts}))
    return file


def cases(folder):
    """(name, parts of the scene, limn's shading)."""
    sky = os.path.join(folder, "sky.exr")
    write_sky(sky, 32, 16)
    envmap = f"""<emitter type="envmap"><string name="filename" value="{sky}"/>
        <float name="scale" value="1.5"/><transform name="to_world"><rotate x="1" angle="50"/>
        <rotate z="1" angle="25"/><rotate y="1" angle="20"/></transform></emitter>"""
    yield from sensors_and_films()
    yield from materials(envmap)
    yield from kinds_of_light(envmap)
    yield from shapes_of_all_kinds(folder, envmap)


def sensors_and_films():
    yield "base", {}, "continuous"
    for depth in (1, 2, 4, 5):
        yield f"max_depth {depth}", {"integrator": DEPTH.format(depth, 1000),
                                     "objects": CUBE + VISIBLE_LAMP}, "continuous"
    yield "roulette", {"integrator": DEPTH.format(-1, 2)}, "continuous"
    yield "roulette default", {"integrator": ""}, "continuous"
    for text in ('<rfilter type="tent"/>', '<rfilter type="tent"><float name="radius" value="1.7"/></rfilter>',
                 '<rfilter type="gaussian"/>',
                 '<rfilter type="gaussian"><float name="stddev" value="0.8"/></rfilter>', BOX):
        for border in ("true", "false"):
            kind = text.split('"')[1] + (text.split('value="')[1][:3] if "value" in text else "")
            film = SIZE.format(24, 24) + f'<boolean name="sample_border" value="{border}"/>' + text
            yield f"filter {kind} border {border}", {"film": film}, "continuous"
    yield "filter gaussian 8 x 8", {"film": SIZE.format(8, 8) + '<rfilter type="gaussian"/>'}, "continuous"
    crop = "".join(f'<integer name="crop_{n}" value="{v}"/>' for n, v in
                   (("offset_x", 9), ("offset_y", 4), ("width", 24), ("height", 16)))
    yield "crop", {"film": SIZE.format(64, 40) + crop + BOX}, "continuous"
    yield "crop gaussian", {"film": SIZE.format(64, 40) + crop}, "continuous"
    for axis, size in itertools.product(("x", "y", "diagonal", "smaller", "larger"),
                                        ((56, 32), (32, 56))):
        sensor = FOV + f'<string name="fov_axis" value="{axis}"/>'
        yield f"fov_axis {axis} {size[0]}", {"sensor": sensor, "film": SIZE.format(*size) + BOX}, "continuous"
    yield "principal point", {"sensor": FOV + '<float name="principal_point_offset_x" value="0.1"/>'
                              '<float name="principal_point_offset_y" value="-0.2"/>'}, "continuous"
    yield "focal length", {"sensor": '<string name="focal_length" value="40mm"/>'}, "continuous"
    yield "clip planes", {"sensor": FOV + '<float name="near_clip" value="5.5"/>'
                          '<float name="far_clip" value="7.5"/>'}, "continuous"
    for radius, focus in ((0.2, 5), (0.5, 9), (1.5, 3)):
        lens = (f'<float name="aperture_radius" value="{radius}"/>'
                f'<float name="focus_distance" value="{focus}"/><float name="near_clip" value="5"/>')
        yield f"thinlens {radius}", {"camera": "thinlens", "sensor": FOV + lens}, "continuous"
    yield "thinlens focus", {"camera": "thinlens", "sensor": FOV +
                             '<float name="aperture_radius" value="0.1"/>'}, "continuous"


def materials(envmap):
    for distribution, alpha in itertools.product(("ggx", "beckmann"), (0.05, 0.2, 0.6)):
        bsdf = CONDUCTOR.format(distribution=distribution, alpha=alpha)
        yield f"{distribution} {alpha} envmap", {"floor": bsdf, "lights": envmap}, "continuous"
        yield f"{distribution} {alpha} lamp", {"floor": bsdf, "lights": ONE_LAMP + CONSTANT,
                                               "objects": CUBE + VISIBLE_LAMP}, "continuous"
    yield "default conductor", {"floor": '<bsdf type="roughconductor"/>'}, "continuous"
    yield "envmap diffuse", {"lights": envmap}, "continuous"
    yield "twosided", {"objects": CUBE.replace("rotate y", "rotate x"), "floor":
                       f'<bsdf type="twosided">{CONDUCTOR.format(distribution="ggx", alpha=0.3)}{GREY}</bsdf>',
                       "sensor": FOV, "lights": VISIBLE_LAMP.replace('y="1.2"', 'y="-1.5"') + envmap}, "continuous"


def kinds_of_light(envmap):
    for name, lights in (("point", POINT), ("placed point", PLACED_POINT), ("spot", SPOT),
                         ("wide spot", WIDE_SPOT), ("directional", DIRECTIONAL),
                         ("turned directional", TURNED_DIRECTIONAL),
                         ("delta lights and others", POINT + SPOT + DIRECTIONAL + ONE_LAMP + envmap)):
        yield name, {"lights": lights}, "continuous"
        yield f"{name} gloss", {"lights": lights, "floor": CONDUCTOR.format(
            distribution="ggx", alpha=0.2)}, "continuous"
    yield "two lamps", {"lights": LAMP.format(angle=90, size=0.5, x=-1, radiance="8,1,1") +
                        LAMP.format(angle=70, size=0.3, x=2, radiance="1,9,30")}, "continuous"
    yield "hide_emitters", {"integrator": DEPTH.format(3, 1000) +
                            '<boolean name="hide_emitters" value="true"/>',
                            "objects": CUBE + VISIBLE_LAMP}, "continuous"


def shapes_of_all_kinds(folder, envmap):
    sphere, smooth, octahedron = (os.path.join(folder, name) for name in
                                  ("sphere.obj", "smooth.obj", "octahedron.ply"))
    write_sphere(sphere, 5, 8)
    write_sphere(smooth, 5, 8, normals=True)
    write_octahedron(octahedron)
    shapes = {kind: f'<shape type="{kind}">' for kind in ("rectangle", "disk", "cube", "sphere")}
    for kind, file in (("obj", sphere), ("obj with normals", smooth),
                       ("ply with normals", octahedron)):
        shapes[kind] = f"""<shape type="{kind[:3]}"><string name="filename" value="{file}"/>"""
    for (kind, start), flip in itertools.product(shapes.items(), ("false", "true")):
        kinds = [("x", "", CLAY), ("z", "", CLAY)]
        # Light of interpolated normals differs by up to a percent, mirrored or not.
        kinds += [] if kind.startswith("obj") else [("x", " lamp", GLOW)]
        for axis, of, on in kinds:
            mirrored = f"""{start}<boolean name="flip_normals" value="{flip}"/>
                <transform name="to_world"><scale {axis}="-1"/><scale value="0.9"/><rotate y="1" angle="15"/>
                <translate x="0.3" y="1" z="0.5"/></transform>{on}</shape>"""
            yield f"mirrored {kind}{of} {axis} flip {flip}", {"objects": mirrored}, \
                "mitsuba" if kind.startswith("obj") else "continuous"
    for kind, bsdf in (("diffuse", GREY), ("twosided", f'<bsdf type="twosided">{GREY}</bsdf>'),
                       ("ggx", CONDUCTOR.format(distribution="ggx", alpha=0.15))):
        mesh = MESH.format(file=sphere, flat="false", scale=0.8, bsdf=bsdf)
        yield f"smooth {kind}", {"objects": CUBE + mesh, "lights": ONE_LAMP + envmap}, \
            "mitsuba"
    for kind, bsdf in TRANSPARENT.items():
        cube = CUBE.replace('<bsdf type="diffuse"/>', bsdf)
        mesh = MESH.format(file=sphere, flat="false", scale=0.8, bsdf=bsdf)
        yield f"{kind} cube", {"objects": cube + VISIBLE_LAMP, "lights": CONSTANT}, "continuous"
        yield f"{kind} ball", {"objects": mesh, "lights": envmap}, "mitsuba"
    flat = MESH.format(file=sphere, flat="true", scale=0.8, bsdf=GREY)
    yield "flat sphere", {"objects": flat, "lights": envmap}, "continuous"


def suite(folder):
    for name, parts, shading in cases(folder):
        yield name, scene(folder, name, **parts), shading
