"""Writes the closed-form scenes as Mitsuba 3 XML with OBJ meshes and PNG textures."""
import os
import struct
import zlib

import numpy as np

from closed_form_geometry import loop_normal


def numbers(values):
    return ",".join(f"{v:.9g}" for v in np.atleast_1d(values))


def rgb(name, values):
    return f'<rgb name="{name}" value="{numbers(values)}"/>'


def obj_text(shape):
    """A "split" shape repeats each face's corners and gives the face's normal."""
    lines = []
    if shape.uv is not None:
        lines += ["v " + " ".join(f"{x:.9g}" for x in v) for v in shape.vertices]
        lines += [f"vt {u:.9g} {v:.9g}" for uv in shape.uv for u, v in uv]
        first = 1
        for face in shape.faces:
            lines.append("f " + " ".join(f"{k + 1}/{first + m}" for m, k in enumerate(face)))
            first += len(face)
        return "\n".join(lines) + "\n"
    if shape.writer != "split":
        lines += ["v " + " ".join(f"{x:.9g}" for x in v) for v in shape.vertices]
        lines += ["f " + " ".join(str(k + 1) for k in face) for face in shape.faces]
        return "\n".join(lines) + "\n"
    for face in shape.faces:
        lines += ["v " + " ".join(f"{x:.9g}" for x in shape.vertices[k]) for k in face]
    for face in shape.faces:
        n = loop_normal(shape.vertices[face]) + 0.0
        lines.append("vn " + " ".join(f"{x:.9g}" for x in n))
    first = 1
    for k, face in enumerate(shape.faces):
        lines.append("f " + " ".join(f"{first + m}//{k + 1}" for m in range(len(face))))
        first += len(face)
    return "\n".join(lines) + "\n"


def write_png(texels, path):
    """8-bit rgb: height by width by 3."""
    height, width = texels.shape[:2]
    rows = b"".join(b"\0" + row.astype(np.uint8).tobytes() for row in texels)
    chunks = [(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)),
              (b"IDAT", zlib.compress(rows)), (b"IEND", b"")]
    with open(path, "wb") as out:
        out.write(b"\x89PNG\r\n\x1a\n")
        for kind, data in chunks:
            out.write(struct.pack(">I", len(data)) + kind + data
                      + struct.pack(">I", zlib.crc32(kind + data)))


def emitter_xml(shape, texture_file):
    if shape.texels is None:
        return (f'    <emitter type="area" id="{shape.emitter_id}">'
                f'{rgb("radiance", shape.radiance)}</emitter>\n')
    return (f'    <emitter type="area" id="{shape.emitter_id}"><texture name="radiance" type="bitmap">\n'
            f'      <string name="filename" value="{texture_file}"/><boolean name="raw" value="true"/>'
            f'</texture></emitter>\n')


def bsdf_xml(bsdf):
    if bsdf.colors is not None:
        colors = "".join(rgb(f"color{k}", color) for k, color in enumerate(bsdf.colors))
        return (f'  <bsdf type="diffuse" id="{bsdf.id}">\n    <texture name="reflectance" '
                f'type="checkerboard">{colors}</texture>\n  </bsdf>\n')
    if bsdf.kind == "diffuse":
        return (f'  <bsdf type="diffuse" id="{bsdf.id}">'
                f'{rgb("reflectance", bsdf.reflectance)}</bsdf>\n')
    if bsdf.kind == "mirror":
        return (f'  <bsdf type="conductor" id="{bsdf.id}">\n    <rgb name="eta" value="0"/>'
                f'<rgb name="k" value="1"/>{rgb("specular_reflectance", bsdf.reflectance)}\n  </bsdf>\n')
    if bsdf.kind == "dielectric":
        return (f'  <bsdf type="dielectric" id="{bsdf.id}"><float name="int_ior" value="{bsdf.eta:.12g}"/>'
                f'<float name="ext_ior" value="1"/></bsdf>\n')
    if bsdf.kind == "mask":
        return (f'  <bsdf type="mask" id="{bsdf.id}"><float name="opacity" value="{bsdf.opacity:.9g}"/>\n'
                f'    <bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>\n  </bsdf>\n')
    return (f'  <bsdf type="roughconductor" id="{bsdf.id}">\n'
            f'    <rgb name="eta" value="0"/><rgb name="k" value="1"/>\n'
            f'    <string name="distribution" value="{bsdf.kind}"/>'
            f'<float name="alpha" value="{bsdf.alpha:.9g}"/>\n  </bsdf>\n')


def shape_xml(name, shape, mesh_file):
    if mesh_file:
        head = (f'  <shape type="obj" id="{name}">\n'
                f'    <string name="filename" value="{mesh_file}"/>'
                f'<boolean name="face_normals" value="{str(shape.face_normals).lower()}"/>\n')
        if shape.uv is not None:
            head += '    <boolean name="flip_tex_coords" value="false"/>\n'
    else:
        head = (f'  <shape type="rectangle" id="{name}">\n    <transform name="to_world">'
                f'<scale value="8"/><rotate x="1" angle="-90"/></transform>\n')
    body = f'    <ref id="{shape.bsdf.id}"/>\n' if shape.bsdf else ""
    if shape.emitter_id:
        body += emitter_xml(shape, mesh_file.replace(".obj", ".png"))
    return head + body + "  </shape>\n"


def light_xml(name, light):
    text = f'  <emitter type="{light.kind}" id="{name}">{rgb(light.power_name(), light.power)}'
    if light.kind == "directional":
        return text + f'<vector name="direction" value="{digits(light.direction)}"/></emitter>\n'
    if light.kind == "point":
        return text + f'<point name="position" value="{digits(light.position)}"/></emitter>\n'
    target = light.position + light.direction
    return (f'{text}\n    <float name="cutoff_angle" value="{light.cutoff_angle:.15g}"/>'
            f'<float name="beam_width" value="{light.beam_width:.15g}"/>\n'
            f'    <transform name="to_world"><lookat origin="{digits(light.position)}" '
            f'target="{digits(target)}" up="0,1,0"/></transform></emitter>\n')


def digits(values):
    return ",".join(f"{v:.17g}" for v in values)


def sensor_xml(camera):
    axes, origin = camera.axes(), camera.pinhole()
    moved = np.any(camera.shift != 0) or np.any(camera.turn != np.eye(3))
    target = origin + 4 * axes[2] if moved else camera.target
    up = axes[1] if moved else camera.up_hint
    kind = "orthographic" if camera.half_width else "thinlens" if camera.radius else "perspective"
    text, scale = f'  <sensor type="{kind}">\n', ""
    if camera.half_width:
        scale = f'<scale x="{camera.half_width:.12g}" y="{camera.half_width:.12g}"/>'
    else:
        text += f'    <string name="fov_axis" value="x"/><float name="fov" value="{camera.fov:.12g}"/>\n'
    if camera.radius:
        text += (f'    <float name="aperture_radius" value="{camera.radius:.12g}"/>'
                 f'<float name="focus_distance" value="{camera.focus:.12g}"/>\n')
    return (text + f'    <float name="near_clip" value="0.01"/><float name="far_clip" value="1000"/>\n'
            f'    <transform name="to_world">{scale}<lookat origin="{numbers(origin)}" '
            f'target="{numbers(target)}" up="{numbers(up)}"/></transform>\n'
            f'    <sampler type="independent">'
            f'<integer name="sample_count" value="$spp"/></sampler>\n'
            f'    <film type="hdrfilm"><integer name="width" value="{camera.width}"/>'
            f'<integer name="height" value="{camera.height}"/>\n'
            f'      <string name="pixel_format" value="rgb"/>'
            f'<string name="component_format" value="float32"/>\n'
            f'      <boolean name="sample_border" value="true"/>'
            f'<rfilter type="{camera.filter}"/></film>\n'
            f'  </sensor>\n')


def write_scene(scene, folder, moved=False):
    """Writes the XML, the meshes and the velocity fields. Returns the XML's path.

    moved: the floor may have left its place, so it is written as a mesh as well.
    """
    text = (f'<scene version="3.0.0">\n  <default name="spp" value="1024"/>\n'
            f'  <integrator type="path"><integer name="max_depth" value="{scene.max_depth}"/>'
            f'<integer name="rr_depth" value="1000"/></integrator>\n')
    text += sensor_xml(scene.camera)
    for shape in scene.shapes.values():
        text += bsdf_xml(shape.bsdf) if shape.bsdf else ""
    stem = scene.name[:-len(".xml")]
    for name, shape in scene.shapes.items():
        mesh_file = "" if shape.writer == "floor" and not moved else f"{stem}_{name}.obj"
        if mesh_file:
            with open(os.path.join(folder, mesh_file), "w") as out:
                out.write(obj_text(shape))
            if shape.texels is not None:
                write_png(shape.texels, os.path.join(folder, mesh_file.replace(".obj", ".png")))
        text += shape_xml(name, shape, mesh_file)
    if scene.environment is not None:
        text += (f'  <emitter type="constant" id="environment">'
                 f'{rgb("radiance", scene.environment)}</emitter>\n')
    for name, light in scene.lights.items():
        text += light_xml(name, light)
    path = os.path.join(folder, scene.name)
    with open(path, "w") as out:
        out.write(text + "</scene>\n")
    for name, field in scene.velocities.items():
        with open(os.path.join(folder, name), "w") as out:
            out.writelines(" ".join(f"{x:.9g}" for x in v) + "\n" for v in field)
    return path
