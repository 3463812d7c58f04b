"""Folders of photographs for tests: an egg on a grey background, by limn, in every layout."""

import json
import os
import struct
import zlib

import limn
import numpy as np

SIZE = 32
FOCAL = 40.0  # pixels
EYES = [(3, 1, 0), (0, 1.2, 3), (-3, 0.8, 0.3), (0.4, 1, -3), (2, -1.5, 2), (-2, -1.5, -2),
        (0.2, 3.2, 0.3), (-2, 1.5, 2)]  # fmt: skip
RADII = np.array([0.9, 0.6, 0.7])
MIDDLE = np.array([0.1, 0.3, -0.1])  # of the egg; cameras look at the origin


def pose_of(eye):
    """Camera to world: +X right, +Y down, +Z towards the origin."""
    z = -np.asarray(eye, float) / np.linalg.norm(eye)
    x = np.cross(z, [0, 1, 0])
    x /= np.linalg.norm(x)
    pose = np.eye(4)
    pose[:3] = np.stack([x, np.cross(z, x), z, np.asarray(eye, float)], 1)
    return pose


def photograph(pose, size=SIZE, focal=FOCAL):
    """(sRGB bytes, (H, W, 4)) of an egg by the light of two colours; alpha is coverage."""
    matrix = pose.copy()
    matrix[:3, :2] *= -1
    angle = np.degrees(2 * np.arctan(0.5 * size / focal))
    scene = limn.load_string(f"""<scene version="3.0.0">
      <integrator type="path"><boolean name="hide_emitters" value="true"/></integrator>
      <sensor type="perspective"><float name="fov" value="{angle}"/>
        <transform name="to_world"><matrix value="{' '.join(map(repr, map(float, matrix.ravel())))}"/>
        </transform><film type="hdrfilm"><integer name="width" value="{size}"/>
        <integer name="height" value="{size}"/><rfilter type="box"/></film></sensor>
      <shape type="sphere" id="egg"><transform name="to_world"><scale value="0.9,0.6,0.7"/>
        <translate value="0.1,0.3,-0.1"/></transform><bsdf type="diffuse" id="clay"><rgb name="reflectance" value="0.6,0.4,0.2"/>
        </bsdf></shape>
      <emitter type="constant"><rgb name="radiance" value="0.7,0.7,0.8"/></emitter>
      <emitter type="directional"><vector name="direction" value="-0.5,-1,-0.3"/>
        <rgb name="irradiance" value="1,0.9,0.8"/></emitter></scene>""")
    image = limn.render(scene, spp=64).value.astype(float)
    # Coverage: hits of 4 x 4 rays a pixel.
    fine = (np.arange(4 * size) + 0.5) / 4
    x, y = np.meshgrid(fine, fine)
    away = np.stack([(x - size / 2) / focal, (y - size / 2) / focal, np.ones_like(x)], -1)
    away = away.reshape(-1, 3) @ pose[:3, :3].T
    origin = (pose[:3, 3] - MIDDLE) / RADII
    along = away / RADII
    b, a, c = along @ origin, (along**2).sum(1), origin @ origin - 1
    hit = ((b * b > a * c) & (b < 0)).reshape(size, 4, size, 4).mean(axis=(1, 3))
    colour = np.where(hit[..., None] > 0, image / np.maximum(hit, 0.05)[..., None], 0.2)
    return np.concatenate([srgb(colour), hit[..., None]], -1)


def srgb(x):
    x = np.clip(x, 0, 1)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)


def write_png(file, pixels):
    """(H, W), (H, W, 3) or (H, W, 4) in [0, 1] as they are, eight bits."""
    data = np.round(np.clip(pixels, 0, 1) * 255).astype(np.uint8)
    data = data[..., None] if data.ndim == 2 else data
    rows = b"".join(b"\0" + row.tobytes() for row in data)

    def chunk(name, body):
        return (struct.pack(">I", len(body)) + name + body
                + struct.pack(">I", zlib.crc32(name + body)))  # fmt: skip

    head = struct.pack(">IIBBBBB", data.shape[1], data.shape[0], 8,
                       {1: 0, 3: 2, 4: 6}[data.shape[2]], 0, 0, 0)  # fmt: skip
    os.makedirs(os.path.dirname(file), exist_ok=True)
    with open(file, "wb") as stream:
        stream.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) +
                     chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))  # fmt: skip


def write_transforms(folder, poses, size=SIZE, focal=FOCAL, **more):
    frames = [{"file_path": f"images/{i}.png", "transform_matrix": (p @ np.diag([1, -1, -1, 1]))
               .tolist()} for i, p in enumerate(poses)]  # fmt: skip
    text = {"fl_x": focal, "fl_y": focal, "cx": size / 2, "cy": size / 2, "w": size, "h": size}
    (folder / "transforms.json").write_text(json.dumps({**text, **more, "frames": frames}))


def quaternion(rotation):
    """(w, x, y, z) of a rotation matrix."""
    m = rotation
    matrix = np.array([
        [m[0, 0] - m[1, 1] - m[2, 2], 0, 0, 0],
        [m[0, 1] + m[1, 0], m[1, 1] - m[0, 0] - m[2, 2], 0, 0],
        [m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], m[2, 2] - m[0, 0] - m[1, 1], 0],
        [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], np.trace(m)]]) / 3  # fmt: skip
    values, vectors = np.linalg.eigh(matrix)
    return vectors[[3, 0, 1, 2], values.argmax()]


def write_colmap(folder, poses, binary, model=("PINHOLE", 1, (FOCAL, FOCAL, SIZE / 2, SIZE / 2))):
    """A model in folder/sparse/0 of one camera; images are 0.png, 1.png, ... in images."""
    name, number, parameters = model
    place = folder / "sparse" / "0"
    place.mkdir(parents=True, exist_ok=True)
    rows = []
    for i, p in enumerate(poses):
        rotation = p[:3, :3].T
        rows.append((i + 1, *quaternion(rotation), *(-rotation @ p[:3, 3]), f"{i}.png"))
    if binary:
        (place / "cameras.bin").write_bytes(struct.pack(
            f"<QiiQQ{len(parameters)}d", 1, 7, number, SIZE, SIZE, *parameters))  # fmt: skip
        body = struct.pack("<Q", len(rows))
        for key, *numbers, image in rows:
            body += struct.pack("<i7di", key, *numbers, 7) + image.encode() + b"\0"
            body += struct.pack("<Q2dq", 1, 3.5, 4.5, -1)
        (place / "images.bin").write_bytes(body)
        return
    words = " ".join(map(repr, map(float, parameters)))
    (place / "cameras.txt").write_text(f"# cameras\n7 {name} {SIZE} {SIZE} {words}\n")
    lines = ["# images"]
    for key, *numbers, image in rows:
        # The line of points is empty in every other one.
        lines += [f"{key} {' '.join(repr(float(x)) for x in numbers)} 7 {image}",
                  "" if key % 2 else "3.5 4.5 -1"]  # fmt: skip
    (place / "images.txt").write_text("\n".join(lines) + "\n")
