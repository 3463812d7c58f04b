"""Cameras of photographs: COLMAP's text and binary models, and transforms.json."""

from __future__ import annotations

import json
import math
import os
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .errors import InputError


@dataclass
class Camera:
    """A camera and the photograph that it took.

    Camera space has +X to the right, +Y down and +Z along the view; pixel (0, 0) covers [0, 1]^2.
    """

    image: str  # as the file of cameras names it
    place: str  # where it does: for messages
    # Of the image that the numbers below are for, in pixels. 0, 0: the file's; 1, 0: they are in
    # units of its width.
    width: float
    height: float
    focal: tuple[float, float]
    center: tuple[float, float]  # NaN: the image's middle
    distortion: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)  # k1, k2, p1, p2, as OpenCV has them
    to_world: Any = field(default_factory=lambda: np.eye(4))
    mask: str = ""  # as the file of cameras names it


# COLMAP's models: number, name, parameters.
_MODELS = [
    (0, "SIMPLE_PINHOLE", 3), (1, "PINHOLE", 4), (2, "SIMPLE_RADIAL", 4), (3, "RADIAL", 5),
    (4, "OPENCV", 8), (5, "OPENCV_FISHEYE", 8), (6, "FULL_OPENCV", 12), (7, "FOV", 5),
    (8, "SIMPLE_RADIAL_FISHEYE", 4), (9, "RADIAL_FISHEYE", 5), (10, "THIN_PRISM_FISHEYE", 12),
]  # fmt: skip
_READ = ("SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV")


def _lens(model: str, p: list[float], place: str) -> dict[str, Any]:
    """Focal lengths, center and distortion of COLMAP's parameters."""
    if model not in _READ:
        raise InputError(
            f"{place}: error: the camera model {model} is not read (known: {', '.join(_READ)}); "
            "undistort the photographs first (colmap image_undistorter)"
        )
    counts = {name: count for _, name, count in _MODELS}
    if len(p) != counts[model]:
        raise InputError(f"{place}: error: {model} has {counts[model]} parameters, not {len(p)}")
    if model in ("PINHOLE", "OPENCV"):
        return {"focal": (p[0], p[1]), "center": (p[2], p[3]),
                "distortion": (*p[4:], *[0.0] * (8 - len(p)))}  # fmt: skip
    return {"focal": (p[0], p[0]), "center": (p[1], p[2]),
            "distortion": (*p[3:], *[0.0] * (7 - len(p)))}  # fmt: skip


def _world(quaternion: list[float], shift: list[float], place: str) -> Any:
    """Camera to world, of COLMAP's rotation (w, x, y, z) and translation from the world."""
    q = np.asarray(quaternion, float)
    size = float(np.linalg.norm(q))
    if not (size > 0 and np.isfinite(size) and np.isfinite(shift).all()):
        raise InputError(f"{place}: error: the pose is not finite, or its rotation is 0")
    w, x, y, z = q / size
    rotation = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip
    pose = np.eye(4)
    pose[:3, :3] = rotation.T
    pose[:3, 3] = -rotation.T @ np.asarray(shift, float)
    return pose


def _numbers(words: list[str], place: str) -> list[float]:
    try:
        return [float(w) for w in words]
    except ValueError:
        raise InputError(f"{place}: error: expected numbers, not {' '.join(words)!r}") from None


def _rows(file: str) -> Iterator[tuple[str, str]]:
    """(place, line) of each line that is no comment."""
    with open(file, encoding="utf-8", errors="replace") as stream:
        for number, line in enumerate(stream, 1):
            if not line.startswith("#"):
                yield f"{file}:{number}", line.strip()


def _text_cameras(file: str) -> dict[int, tuple[str, float, float, list[float]]]:
    cameras = {}
    for place, line in _rows(file):
        words = line.split()
        if not words:
            continue
        if len(words) < 5:
            raise InputError(f"{place}: error: expected CAMERA_ID MODEL WIDTH HEIGHT PARAMS")
        key, width, height, *numbers = _numbers([words[0], *words[2:]], place)
        cameras[int(key)] = (words[1], width, height, numbers)
    return cameras


def _text_images(file: str) -> Iterator[tuple[str, int, list[float], str]]:
    """(place, camera, pose, name): a line each, and after it one of points, which may be empty."""
    rows = _rows(file)
    for place, line in rows:
        if not line:
            continue
        words = line.split(maxsplit=9)
        if len(words) < 10:
            raise InputError(
                f"{place}: error: expected IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME"
            )
        numbers = _numbers(words[1:9], place)
        yield place, int(numbers[7]), numbers[:7], words[9]
        next(rows, None)


class _Bytes:
    """A binary file from its start; InputError where it ends too early."""

    def __init__(self, file: str) -> None:
        self.file, self.at = file, 0
        with open(file, "rb") as stream:
            self.data = stream.read()

    def take(self, form: str) -> tuple[Any, ...]:
        size = struct.calcsize("<" + form)
        self.skip(size)
        return struct.unpack_from("<" + form, self.data, self.at - size)

    def skip(self, size: int) -> None:
        if self.at + size > len(self.data):
            raise InputError(f"{self.file}: error: the file is truncated or no COLMAP model")
        self.at += size

    def text(self) -> str:
        end = self.data.find(b"\0", self.at)
        if end < 0:
            raise InputError(f"{self.file}: error: the file is truncated or no COLMAP model")
        word = self.data[self.at : end].decode("utf-8", "replace")
        self.at = end + 1
        return word


def _binary_cameras(file: str) -> dict[int, tuple[str, float, float, list[float]]]:
    data, cameras = _Bytes(file), {}
    models = {number: (name, count) for number, name, count in _MODELS}
    for _ in range(data.take("Q")[0]):
        key, number, width, height = data.take("iiQQ")
        if number not in models:
            raise InputError(f"{file}: error: unknown camera model {number}")
        name, count = models[number]
        cameras[key] = (name, float(width), float(height), list(data.take(f"{count}d")))
    return cameras


def _binary_images(file: str) -> Iterator[tuple[str, int, list[float], str]]:
    data = _Bytes(file)
    for _ in range(data.take("Q")[0]):
        pose = list(data.take("i7d")[1:])
        key = data.take("i")[0]
        name = data.text()
        data.skip(24 * data.take("Q")[0])
        yield file, key, pose, name


def read_colmap(folder: str) -> list[Camera]:
    """The cameras of a COLMAP model: cameras.bin and images.bin, or the same as .txt."""
    binary = os.path.exists(os.path.join(folder, "images.bin"))
    ending = "bin" if binary else "txt"
    files = [os.path.join(folder, f"{name}.{ending}") for name in ("cameras", "images")]
    for file in files:
        if not os.path.exists(file):
            raise InputError(f"{file}: error: no such file; the other half of the model is there")
    lenses = _binary_cameras(files[0]) if binary else _text_cameras(files[0])
    cameras = []
    for place, key, pose, name in (_binary_images if binary else _text_images)(files[1]):
        if key not in lenses:
            raise InputError(f"{place}: error: {name} has camera {key}, which {files[0]} lacks")
        model, width, height, numbers = lenses[key]
        cameras.append(Camera(name, place, width, height, **_lens(model, numbers, files[0]),
                              to_world=_world(pose[:4], pose[4:], place)))  # fmt: skip
    return cameras


def _pose(frame: dict[str, Any], place: str) -> Any:
    """Camera to world in OpenCV's axes, of OpenGL's (+Y up, +Z backward)."""
    try:
        rows = np.asarray(frame["transform_matrix"], float)
    except (KeyError, TypeError, ValueError):
        raise InputError(f"{place}: error: has no transform_matrix of numbers") from None
    if rows.shape not in ((3, 4), (4, 4)) or not np.isfinite(rows).all():
        raise InputError(f"{place}: error: transform_matrix is not 4 x 4 finite numbers")
    pose = np.eye(4)
    pose[:3] = rows[:3]
    sizes = np.linalg.norm(pose[:3, :3], axis=0)
    if not (sizes > 0).all():
        raise InputError(f"{place}: error: transform_matrix has an axis of length 0")
    axes = pose[:3, :3] / sizes
    if abs(axes.T @ axes - np.eye(3)).max() > 1e-3 or np.linalg.det(axes) < 0:
        raise InputError(f"{place}: error: transform_matrix is no rotation: sheared or mirrored")
    pose[:3, :3] = axes * [1, -1, -1]
    return pose


def _number(own: dict[str, Any], name: str, default: float | None, place: str) -> float:
    value = own.get(name, default)
    if isinstance(value, (int, float)) and math.isfinite(value):
        return float(value)
    raise InputError(f"{place}: error: {name} is missing or not a number")


def _frame(own: dict[str, Any], place: str) -> Camera:
    """own: the frame's entries before those of the whole file."""
    name = own.get("file_path")
    if not isinstance(name, str) or not name:
        raise InputError(f"{place}: error: has no file_path")
    place = f"{place} ({name})"
    model = own.get("camera_model", "OPENCV")
    further = [k for k in ("k3", "k4", "k5", "k6") if own.get(k)]
    if model not in _READ or own.get("is_fisheye") or further:
        what = f"distortion {further[0]}" if further else f"the camera model {model}"
        raise InputError(f"{place}: error: {what} is not read (known: {', '.join(_READ)})")
    width, height = (_number(own, k, 0.0, place) for k in ("w", "h"))
    focal = [_number(own, k, 0.0, place) for k in ("fl_x", "fl_y")]
    if not focal[0]:
        angle = _number(own, "camera_angle_x", 0.0, place)
        if not 0 < angle < math.pi:
            raise InputError(f"{place}: error: has neither fl_x nor camera_angle_x")
        width, height = (width, height) if width and height else (1.0, 0.0)
        focal[0] = 0.5 * width / math.tan(angle / 2)
    middle = (width / 2, height / 2) if height else (math.nan, math.nan)
    center = tuple(_number(own, k, None, place) if k in own else middle[i]
                   for i, k in enumerate(("cx", "cy")))  # fmt: skip
    distortion = tuple(_number(own, k, 0.0, place) for k in ("k1", "k2", "p1", "p2"))
    mask = own.get("mask_path") or ""
    return Camera(name, place, width, height, (focal[0], focal[1] or focal[0]),
                  (center[0], center[1]), distortion, _pose(own, place), str(mask))  # fmt: skip


def read_transforms(file: str) -> list[Camera]:
    """The cameras of a transforms.json, as radiance fields use it."""
    try:
        with open(file, encoding="utf-8") as stream:
            read = json.load(stream)
    except (OSError, ValueError) as error:
        raise InputError(f"{file}: error: cannot be read as JSON: {error}") from None
    frames = read.get("frames") if isinstance(read, dict) else None
    if not isinstance(frames, list) or not all(isinstance(f, dict) for f in frames):
        raise InputError(f"{file}: error: has no list of frames")
    return [_frame({**read, **f}, f"{file}: frame {i}") for i, f in enumerate(frames)]


def _places(folder: str) -> list[str]:
    """Where a COLMAP model may lie: sparse/0 before sparse/1."""
    places = [os.path.join(folder, p) for p in
              ("", "sparse/0", "sparse", "colmap/sparse/0", "colmap", "distorted/sparse/0")]
    return [p for p in places
            if any(os.path.exists(os.path.join(p, "images" + e)) for e in (".bin", ".txt"))]


def read_cameras(folder: str) -> tuple[list[Camera], str]:
    """The cameras that a folder describes, and the file or folder that does."""
    if not os.path.isdir(folder):
        raise InputError(f"{folder}: error: no such folder")
    for name in ("transforms.json", "transforms_train.json"):
        file = os.path.join(folder, name)
        if os.path.exists(file):
            return read_transforms(file), file
    places = _places(folder)
    if places:
        return read_colmap(places[0]), places[0]
    raise InputError(
        f"{folder}: error: has no cameras: neither transforms.json nor a COLMAP model (images.bin "
        "or images.txt in it, in sparse/0 or in sparse)"
    )
