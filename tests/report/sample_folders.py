"""Folders as `limn compare` and `limn reject` write them, made up from models with known slopes,
with all that a report has to cope with: missing and interrupted methods, null for what is
undefined, errors below the floor.
"""

import json
import os
import struct
import zlib

import numpy as np

SIZE = 48
SCALE = 2.0
TIMES = [1.0, 2.0, 4.0, 8.0]


def write_png(file, pixels):
    """pixels: H by W by 3 in [0, 1]."""
    data = np.clip(255 * pixels + 0.5, 0, 255).astype(np.uint8)
    rows = b"".join(b"\0" + row.tobytes() for row in data)

    def chunk(kind, content):
        return (
            struct.pack(">I", len(content))
            + kind
            + content
            + struct.pack(">I", zlib.crc32(kind + content))
        )

    header = struct.pack(">IIBBBBB", data.shape[1], data.shape[0], 8, 2, 0, 0, 0)
    with open(file, "wb") as out:
        out.write(
            b"\x89PNG\r\n\x1a\n"
            + chunk(b"IHDR", header)
            + chunk(b"IDAT", zlib.compress(rows))
            + chunk(b"IEND", b"")
        )


def signed(image):
    """H by W to colours: blue, white, red."""
    t = np.clip(image / SCALE, -1, 1)
    linear = np.stack([1 + np.minimum(t, 0), 1 - np.abs(t), 1 - np.maximum(t, 0)], axis=-1)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def derivative():
    y, x = np.mgrid[0:SIZE, 0:SIZE] / SIZE - 0.5
    r = np.hypot(x, y)
    return 2 * np.exp(-(((r - 0.3) / 0.04) ** 2)) * np.sign(y) + 0.4 * x


def summary(runs, time, bias):
    mine = [r for r in runs if r["time"] == time]
    line = {
        "time": time,
        "bias": bias,
        "terms": mine[0]["terms"],
        "peak_memory_bytes": max(r["peak_memory_bytes"] for r in mine),
    }
    for key in ("seconds", "setup_seconds", "spp", "rays", "mse", "relative_mse", "trimmed_mse"):
        line[key] = float(np.mean([r[key] for r in mine]))
    for key in ("mse", "relative_mse", "trimmed_mse"):
        values = [r[key] for r in mine]
        line[f"{key}_stderr"] = (
            float(np.std(values, ddof=1) / np.sqrt(len(values))) if len(values) > 1 else None
        )
    return line


def method(
    folder, name, random, times, error, floor=0.0, p=0.4, status="done", message="", ratio=1.0
):
    """error: mse at one second; it falls as 1 / time to `floor`."""
    runs = []
    for time in times:
        for repeat in range(3):
            mse = (error / time + floor) * float(random.lognormal(0, 0.12))
            runs.append(
                {
                    "time": time,
                    "repeat": repeat,
                    "seconds": time * 1.01,
                    "setup_seconds": 0.2,
                    "spp": 40 * time,
                    "rays": 2.1e6 * time,
                    "mse": mse,
                    "relative_mse": mse / 0.3,
                    "trimmed_mse": 0.4 * mse,
                    "terms": {"interior": 0.3 * time, "camera": 0.2 * time, "boundary": 0.4 * time, "direct": 0.05 * time},
                    "peak_memory_bytes": 123456789,
                }
            )
    noise = random.normal(0, np.sqrt(error / times[-1] + floor), (SIZE, SIZE))
    write_png(os.path.join(folder, f"{name}.png"), signed(derivative() + noise))
    write_png(os.path.join(folder, f"{name}_error.png"), signed(noise))
    bias = {"blocks": 64, "mean": 0.1, "deviation": 1.05, "largest": 2.9, "p": p}
    sweep = len(times) > 1
    return {
        "name": name,
        "description": f'what {name} is, with <angle brackets> & quotes "',
        "status": status,
        "message": message,
        "image": f"{name}.exr",
        "picture": f"{name}.png",
        "error_picture": f"{name}_error.png",
        "settings": {"step": 0.012, "found by": "pilot"} if name == "fd" else {},
        "runs": runs,
        "summary": [summary(runs, t, bias) for t in times],
        "slope": {"value": -1 + (0.4 if floor else 0.01), "stderr": 0.03} if sweep else None,
        "time_ratio": ratio,
        "time_ratio_stderr": 0.1 * ratio,
    }


def absent(name, message):
    return {
        "name": name,
        "description": "an outside method",
        "status": "missing",
        "message": message,
        "image": "",
        "picture": "",
        "error_picture": "",
        "settings": {},
        "runs": [],
        "summary": [],
        "slope": None,
        "time_ratio": None,
        "time_ratio_stderr": None,
    }


def comparison(folder, scene, parameter, times, methods):
    os.makedirs(folder)
    random = np.random.default_rng(len(scene))
    y, x = np.mgrid[0:SIZE, 0:SIZE] / SIZE
    write_png(os.path.join(folder, "image.png"), np.stack([x, y, 1 - x], axis=-1))
    write_png(os.path.join(folder, "reference.png"), signed(derivative()))
    made = [
        absent(**m) if "error" not in m else method(folder, random=random, times=times, **m)
        for m in methods
    ]
    data = {
        "kind": "compare",
        "command": f"limn compare {scene} --wrt {parameter} --methods forest,fd --time 8 --sweep",
        "scene": scene,
        "defines": {"alpha": "0.05", "width": SIZE},
        "parameter": parameter,
        "unit": "scene units",
        "width": SIZE,
        "height": SIZE,
        "seed": 7,
        "threads": 2,
        "repeats": 3,
        "times": times,
        "scale": SCALE,
        "error_scale": SCALE,
        "image": "image.png",
        "reference": {
            "image": "reference.exr",
            "picture": "reference.png",
            "method": "forest",
            "spp": 16384,
            "seconds": 812.5,
            "seed": 99,
            "cached": True,
            "file": "out/reference.exr",
            "mean_squared_error": 2.3e-4,
        },
        "methods": made,
    }
    with open(os.path.join(folder, "compare.json"), "w") as out:
        json.dump(data, out, indent=2)


def slice_picture(file, hit, wrong):
    y, x = np.mgrid[0:SIZE, 0:SIZE] / SIZE - 0.5
    r = np.hypot(x, y)
    pixels = np.full((SIZE, SIZE, 3), 0.85)
    pixels[r < wrong] = [0.95, 0.56, 0.17]
    pixels[r < hit] = [0.18, 0.44, 0.72]
    write_png(file, pixels)


def variant(folder, name, hit_rate, wrong, missed=0):
    slices = []
    for i in range(2):
        slice_picture(os.path.join(folder, f"{name}_slice_{i}.png"), 0.2, wrong)
        slices.append(
            {
                "picture": f"{name}_slice_{i}.png",
                "true_reject": 1500,
                "true_accept": 400,
                "false_accept": int(2000 * wrong),
                "missed": missed,
                "points": 1900 + int(2000 * wrong) + missed,
            }
        )
    depths = [
        {"depth": d, "nodes_tested": 4**d, "accepted": 2**d, "false_accepts": int(wrong * 2**d)}
        for d in range(7)
    ]
    return {
        "name": name,
        "description": f"about {name}",
        "slices": slices,
        "reached_per_silhouette": 1.3 * (1 + wrong),
        "hit_rate": hit_rate,
        "hit_rate_stderr": 0.004,
        "by_depth": depths,
    }


def rejection(folder, mesh, missed=0):
    os.makedirs(folder)
    variants = [
        variant(folder, "forest", 0.91, 0.22),
        variant(folder, "forest:axes=any", 0.66, 0.3),
        variant(folder, "li2019", 0.31, 0.45, missed),
    ]
    data = {
        "kind": "reject",
        "command": f"limn reject {mesh} -o {folder}",
        "mesh": mesh,
        "edges": 104340,
        "seed": 3,
        "variants": variants,
        "node": {"depth": 4, "edges": 310},
    }
    with open(os.path.join(folder, "reject.json"), "w") as out:
        json.dump(data, out, indent=2)


def fitting(folder, status="done"):
    """A fit of two views, with losses below zero at its end."""
    os.makedirs(folder, exist_ok=True)
    steps = list(range(0, 50, 5))
    pictures = {s: [f"step_{s:05}_view_{v}.png" for v in (0, 1)] for s in steps}
    for s in steps:
        for v, name in enumerate(pictures[s]):
            write_png(os.path.join(folder, name), np.full((4, 8, 3), (s + v) / 60))
    targets = ["view_0_target.png", "view_1_target.png"]
    for name in targets:
        write_png(os.path.join(folder, name), np.full((4, 8, 3), 0.9))
    loss = [0.1 * 0.8**s - 2e-5 for s in range(45)]
    view = {"scene": "scenes/room.xml", "defines": {}, "target": "t.exr", "mask": ""}
    data = {
        "kind": "fit",
        "status": status,
        "arguments": {
            "views": [view, view],
            "parameters": ["ball.vertex_positions", "clay.reflectance"],
            "loss": "l2",
            "method": "adaptive",
            "optimiser": "adam-uniform",
            "steps": 45,
        },
        "steps": 45,
        "scalars": [{"name": "clay.reflectance", "unit": "", "value": 0.61234}],
        "targets": targets,
        "warnings": [],
        "history": [
            {"step": s, "loss": v, "stderr": 1e-4 if s else None, "halvings": s // 44, "seconds": 1,
             "sigma": 0.1 if s < 9 else 0, "values": {"clay.reflectance": 0.5 + s / 400}}
            for s, v in enumerate(loss)
        ],
        "snapshots": [
            {
                "step": s,
                "pictures": pictures[s],
                "meshes": [
                    {
                        "shape": "ball",
                        "crossings": s,
                        "inside_out": None if s else 0,
                        "chamfer": 0.1 / (1 + s),
                        "hausdorff_95": 0.2,
                        "hausdorff": 0.3,
                        "normal_angle": 60.0 - s,
                    }
                ],
            }
            for s in steps
        ],
    }
    with open(os.path.join(folder, "fit.json"), "w") as stream:
        json.dump(data, stream)
    return folder


def write_samples(folder):
    """Returns the folders made: two comparisons and a rejection."""
    folders = [os.path.join(folder, name) for name in ("mirror", "shadow", "bunny")]
    comparison(
        folders[0],
        "scenes/mirror.xml",
        "object.translate.y",
        TIMES,
        [
            {"name": "forest", "error": 0.02},
            {"name": "li2019", "error": 0.9, "ratio": 45.0},
            {"name": "uniform", "error": 1.8, "ratio": 90.0},
            {"name": "forest:axes=any", "error": 0.03, "ratio": 1.5},
            {"name": "fd", "error": 0.3, "floor": 0.05, "p": 1e-9, "ratio": 17.0},
            {"name": "mitsuba", "message": "Mitsuba is not installed: pip install mitsuba==3.9.1"},
        ],
    )
    comparison(
        folders[1],
        "scenes/shadow.xml",
        "object.rotate.x",
        TIMES[:1],
        [
            {"name": "li2019", "error": 0.4},
            {"name": "forest", "error": 0.1, "ratio": 0.25},
            {
                "name": "brute",
                "error": 3.0,
                "ratio": 7.5,
                "status": "interrupted",
                "message": "Ctrl-C after one repeat",
            },
        ],
    )
    rejection(folders[2], "meshes/bunny.ply")
    return folders
