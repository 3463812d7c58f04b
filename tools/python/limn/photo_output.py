"""What a reconstruction leaves: mesh, textures, sky, cameras, scene file and report."""

from __future__ import annotations

import base64
import html
import json
import math
import os
import struct
import tempfile
import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np

from ._limn import load, render, write_exr, write_png
from .photo_model import (
    VERTEX_MATERIAL,
    Model,
    ply_shape,
    scene_xml,
    scenes_of,
    vertex_normals,
    write_coloured_ply,
)
from .photo_views import View

_TEXELS = 512  # a side of the atlas; not tuned


def to_srgb(linear: Any) -> Any:
    """sRGB's transfer function of [0, 1]."""
    x = np.clip(linear, 0, 1)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)


def from_srgb(encoded: Any) -> Any:
    """The inverse of to_srgb()."""
    x = np.clip(encoded, 0, 1)
    return np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)


def psnr(image: Any, truth: Any, weight: Any) -> float:
    """Peak signal to noise [dB] of sRGB images, the mean over pixels with a weight."""
    error = (to_srgb(image) - to_srgb(truth)) ** 2
    mean = float((error.mean(axis=2) * weight).sum() / max(1e-9, weight.sum()))
    return -10 * math.log10(max(mean, 1e-12))


def unwrapped(positions: Any, faces: Any) -> tuple[Any, Any, Any] | None:
    """(vertex of each atlas vertex, faces of these, their u and v) by xatlas; None without it."""
    try:
        import xatlas
    except ImportError:
        return None
    atlas, pack = xatlas.Atlas(), xatlas.PackOptions()
    # Charts that touch would show each other's texels where lookups are bilinear.
    pack.resolution, pack.padding = _TEXELS, 2
    atlas.add_mesh(np.ascontiguousarray(positions, np.float32),
                   np.ascontiguousarray(faces, np.uint32))  # fmt: skip
    atlas.generate(xatlas.ChartOptions(), pack)
    vertices, corners, places = atlas[0]
    return vertices, np.asarray(corners, np.int64), np.asarray(places, float)


def baked(places: Any, faces: Any, colours: Any, size: int) -> Any:
    """A (size, size, 3) map of colours (V, 3) at u, v (V, 2); row 0 is v = 1. Gaps are filled."""
    image, done = np.zeros((size, size, 3)), np.zeros((size, size), bool)
    pixels = np.stack([places[:, 0], 1 - places[:, 1]], 1) * size - 0.5
    for face in faces:
        p = pixels[face]
        low = np.maximum(np.floor(p.min(axis=0)).astype(int), 0)
        high = np.minimum(np.ceil(p.max(axis=0)).astype(int), size - 1)
        across, along = p[1] - p[0], p[2] - p[0]
        area = across[0] * along[1] - across[1] * along[0]
        if abs(area) < 1e-12 or (high < low).any():
            continue
        x, y = np.meshgrid(np.arange(low[0], high[0] + 1), np.arange(low[1], high[1] + 1))
        b = ((x - p[0, 0]) * along[1] - (y - p[0, 1]) * along[0]) / area
        c = (across[0] * (y - p[0, 1]) - across[1] * (x - p[0, 0])) / area
        inside = (b >= -1e-9) & (c >= -1e-9) & (b + c <= 1 + 1e-9)
        weights = np.stack([1 - b - c, b, c], -1)[inside]
        image[y[inside], x[inside]] = weights @ colours[face]
        done[y[inside], x[inside]] = True
    for _ in range(8):  # what bilinear lookups reach beside the charts
        total, count = np.zeros_like(image), np.zeros(done.shape)
        for axis in (0, 1):
            for step in (1, -1):
                total += np.roll(image * done[..., None], step, axis)
                count += np.roll(done, step, axis)
        fill = ~done & (count > 0)
        image[fill] = total[fill] / count[fill][:, None]
        done |= fill
    return image


def write_obj(file: str, model: Model, atlas: tuple[Any, Any, Any] | None) -> None:
    """An OBJ with normals and sRGB colours of vertices, and texture coordinates of an atlas."""
    normals = vertex_normals(model.positions, model.faces)
    rows = np.concatenate([model.positions, to_srgb(model.colours)], axis=1)
    lines = ["# Made by limn.", "mtllib object.mtl"] if atlas else ["# Made by limn."]
    lines += ["v " + " ".join(f"{x:.7g}" for x in row) for row in rows]
    lines += ["vn " + " ".join(f"{x:.5g}" for x in row) for row in normals]
    if atlas is None:
        lines += [f"f {' '.join(f'{v}//{v}' for v in face + 1)}" for face in model.faces]
    else:
        vertices, faces, places = atlas
        lines += [f"vt {u:.7g} {v:.7g}" for u, v in places] + ["usemtl object"]
        own = np.asarray(vertices, np.int64) + 1
        lines += ["f " + " ".join(f"{own[v]}/{v + 1}/{own[v]}" for v in face) for face in faces]
    with open(file, "w", encoding="ascii") as stream:
        stream.write("\n".join(lines) + "\n")


def write_mtl(file: str, model: Model) -> None:
    """The material of write_obj(), with Blender's and others' entry for roughness."""
    with open(file, "w", encoding="ascii") as stream:
        stream.write(
            "newmtl object\nKd 1 1 1\nmap_Kd albedo.png\n"
            f"Ks {model.specular * 0.08:.4f} {model.specular * 0.08:.4f} "
            f"{model.specular * 0.08:.4f}\nPr 1\nmap_Pr roughness.png\n"
        )


def write_glb(file: str, model: Model) -> None:
    """Binary glTF 2.0: positions, normals, linear colours; of the roughness, the mean."""
    arrays = [model.positions, vertex_normals(model.positions, model.faces), model.colours]
    parts = [np.asarray(a, "<f4").tobytes() for a in arrays]
    parts.append(np.asarray(model.faces, "<u4").tobytes())
    starts = np.cumsum([0, *map(len, parts)])
    buffers = [{"buffer": 0, "byteOffset": int(s), "byteLength": len(p)}
               for s, p in zip(starts, parts)]  # fmt: skip
    vertex = {"componentType": 5126, "count": len(model.positions), "type": "VEC3"}
    accessors: list[dict[str, Any]] = [{"bufferView": k, **vertex} for k in range(3)]
    accessors[0]["min"], accessors[0]["max"] = (
        np.asarray(f(model.positions, axis=0), "<f4").tolist() for f in (np.min, np.max))
    accessors.append({"bufferView": 3, "componentType": 5125, "count": model.faces.size,
                      "type": "SCALAR"})  # fmt: skip
    primitive = {"attributes": {"POSITION": 0, "NORMAL": 1, "COLOR_0": 2}, "indices": 3,
                 "material": 0}  # fmt: skip
    rough = {"metallicFactor": 0, "roughnessFactor": float(model.roughness.mean())}
    head = json.dumps({
        "asset": {"version": "2.0", "generator": "limn"}, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "object"}], "meshes": [{"primitives": [primitive]}],
        "materials": [{"pbrMetallicRoughness": rough}], "accessors": accessors,
        "bufferViews": buffers, "buffers": [{"byteLength": int(starts[-1])}],
    }).encode()  # fmt: skip
    head += b" " * (-len(head) % 4)
    body = b"".join(parts)
    with open(file, "wb") as stream:
        stream.write(struct.pack("<4sII", b"glTF", 2, 28 + len(head) + len(body)))
        for kind, chunk in ((b"JSON", head), (b"BIN\0", body)):
            stream.write(struct.pack("<I4s", len(chunk), kind) + chunk)


def write_cameras(file: str, views: Sequence[View], model: Model) -> None:
    """The cameras as fitted, undistorted: a transforms.json, with the exposures."""
    frames = []
    for v in views:
        width, height = v.size
        pose = v.pose.copy()
        pose[:3, 1:3] *= -1
        frames.append({
            "file_path": os.path.abspath(v.file), "w": width, "h": height, "fl_x": v.focal,
            "fl_y": v.focal, "cx": v.center[0], "cy": v.center[1],
            "exposure": model.exposures.get(v.name, 1.0), "transform_matrix": pose.tolist(),
        })  # fmt: skip
    with open(file, "w", encoding="utf-8") as stream:
        json.dump({"camera_model": "PINHOLE", "frames": frames}, stream, indent=1)


def write_model(folder: str, model: Model, views: Sequence[View]) -> list[str]:
    """All files but report and errors; their names. With xatlas there are maps."""
    def inside(name: str) -> str:
        return os.path.join(folder, name)

    atlas = unwrapped(model.positions, model.faces)
    names = ["object.obj", "object.ply", "object.glb", "sky.exr", "cameras.json", "scene.xml"]
    write_coloured_ply(inside("object.ply"), model)
    write_glb(inside("object.glb"), model)
    write_exr(inside("sky.exr"), model.sky)
    write_cameras(inside("cameras.json"), views, model)
    write_obj(inside("object.obj"), model, atlas)
    material, shape = VERTEX_MATERIAL, ply_shape("object.ply")
    if atlas is not None:
        vertices, faces, places = atlas
        write_png(inside("albedo.png"), baked(places, faces, model.colours[vertices], _TEXELS))
        grey = np.repeat(model.roughness[vertices, None], 3, axis=1)
        write_png(inside("roughness.png"), from_srgb(baked(places, faces, grey, _TEXELS)))
        write_mtl(inside("object.mtl"), model)
        material = "".join(
            f'<texture type="bitmap" name="{name}"><string name="filename" value="{png}.png"/>'
            f'<boolean name="raw" value="{raw}"/></texture>'
            for name, png, raw in (("base_color", "albedo", "false"),
                                   ("roughness", "roughness", "true"))
        )  # fmt: skip
        shape = shape.replace('type="ply"', 'type="obj"').replace("object.ply", "object.obj")
        names += ["albedo.png", "roughness.png", "object.mtl"]
    with open(inside("scene.xml"), "w", encoding="utf-8") as stream:
        stream.write(scene_xml(model, views, material, shape))
    return names


def rendered(model: Model, views: Sequence[View], spp: int, threads: int = 0) -> list[Any]:
    """The model as the views see it, times their exposures: linear, (H, W, 3) each."""
    with tempfile.TemporaryDirectory(prefix="limn_") as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        lit = scenes_of(model, views, folder)[0]
        return [
            render(lit.view(i), spp=spp, threads=threads).value * model.exposures.get(v.name, 1.0)
            for i, v in enumerate(views)
        ]


def _picture(image: Any, zoom: int) -> str:
    """An <img> that holds the picture itself."""
    with tempfile.TemporaryDirectory(prefix="limn_") as folder:
        file = os.path.join(folder, "picture.png")
        write_png(file, np.repeat(np.repeat(image, zoom, axis=0), zoom, axis=1))
        with open(file, "rb") as stream:
            data = base64.b64encode(stream.read()).decode("ascii")
    return f'<img src="data:image/png;base64,{data}" alt="">'


def _curve(values: Any, title: str) -> str:
    """A curve over steps, on a logarithmic scale, as SVG; what is not above 0 is left out."""
    x: Any = np.arange(len(values))
    width = max(1, len(values) // 100)
    smooth = np.convolve(values, np.ones(width) / width, mode="valid") if len(values) else values
    x, keep = x[: len(smooth)] + width / 2, np.asarray(smooth) > 0
    if keep.sum() < 2:
        return f"<p>{title}: too few steps for a curve.</p>"
    logs = np.log10(np.asarray(smooth)[keep])
    low, high = float(logs.min()), max(float(logs.max()), float(logs.min()) + 1e-6)
    points = " ".join(
        f"{60 + 520 * a / max(1, len(values)):.1f},{10 + 150 * (high - b) / (high - low):.1f}"
        for a, b in zip(x[keep], logs)
    )
    return (
        f'<figure><svg width="600" height="190"><polyline points="{points}" fill="none" '
        f'stroke="#14508c" stroke-width="1.5"/><text x="0" y="16">{10**high:.2g}</text>'
        f'<text x="0" y="160">{10**low:.2g}</text><text x="60" y="182">step 0</text>'
        f'<text x="580" y="182" text-anchor="end">{len(values)}</text></svg>'
        f"<figcaption>{title}</figcaption></figure>"
    )


_STYLE = """body{font-family:sans-serif;max-width:900px;margin:2em auto}img{image-rendering:pixelated}
table{border-collapse:collapse}td,th{padding:3px 8px;text-align:left;vertical-align:top}
svg text{font-size:11px}"""


def write_report(file: str, model: Model, views: Sequence[View], held: Sequence[View],
                 history: Sequence[Any], figures: dict[str, Any],
                 pictures: Sequence[Any]) -> None:  # fmt: skip
    """report.html: each view beside its photograph, curves, figures, and what is assumed."""
    rows = []
    for view, image in zip([*held, *views], pictures):
        zoom = max(1, 192 // max(view.size))
        difference = np.abs(to_srgb(image) - to_srgb(view.image)) * view.known[..., None]
        name = html.escape(view.name) + (" (held out)" if view in held else "")
        rows.append(
            f"<tr><td>{name}<br>{figures['views'][view.name]['psnr']:.1f} dB<br>exposure "
            f"{model.exposures.get(view.name, 1.0):.3f}</td><td>{_picture(view.image, zoom)}</td>"
            f"<td>{_picture(image, zoom)}</td><td>{_picture(difference, zoom)}</td></tr>"
        )
    facts = "".join(
        f"<tr><th>{html.escape(str(k))}</th><td>{html.escape(str(x))}</td></tr>"
        for k, x in figures.items()
        if k != "views"
    )
    photographs = [h.loss for h in history if h.stage != "shape from masks"]
    text = (
        f"<!DOCTYPE html><html><head><meta charset='utf-8'><title>Reconstruction</title><style>"
        f"{_STYLE}</style></head><body><h1>Reconstruction</h1><table>{facts}</table>"
        "<p>Photographs cannot tell bright light from a bright object: the sky's mean is grey, and "
        "the 98th percentile of base colours is 0.8. Losses are unbiased estimates, so single ones "
        "may be below zero.</p>"
        + _curve([h.mask_loss for h in history], "Loss of masks, over steps")
        + _curve(photographs, "Loss of photographs, over the steps that have it")
        + "<table><tr><th>view</th><th>photograph</th><th>limn</th><th>difference</th></tr>"
        + "".join(rows)
        + f"</table><h2>Sky</h2>{_picture(model.sky / max(1e-9, model.sky.mean()) * 0.4, 8)}"
        "</body></html>"
    )
    with open(file, "w", encoding="utf-8") as stream:
        stream.write(text)
