"""Photographs with their masks and cameras, undistorted and in the size of a fit."""

from __future__ import annotations

import math
import os
import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np

from ._limn import read_alpha, read_image
from .errors import InputError
from .photo_cameras import Camera, read_cameras

IMAGES = (".png", ".jpg", ".jpeg", ".exr")
_MOST_SAMPLES = 8  # a side, per pixel, of a photograph that is made smaller; not tuned
_BLACK = 0.002  # linear: below half of the least step of eight bits in sRGB, but for noise
_HOLE = 0.02  # of a mask's area: a smaller hole is filled
_CLIPPED = 0.995  # linear; a channel from here on says no more than that it is bright


@dataclass
class View:
    """A photograph as a fit uses it, by a pinhole with square pixels.

    image: linear radiance, premultiplied by the mask, (H, W, 3). mask: coverage, (H, W). known: 1
    where the photograph shows what the camera saw, (H, W): inside of its border, not clipped.
    focal and center in pixels; pose: camera to world, +X right, +Y down, +Z along the view.
    """

    name: str
    file: str
    image: Any
    mask: Any
    known: Any
    focal: float
    center: tuple[float, float]
    pose: Any

    @property
    def size(self) -> tuple[int, int]:
        """Width and height."""
        return self.mask.shape[1], self.mask.shape[0]

    def project(self, points: Any) -> tuple[Any, Any]:
        """Where (N, 3) points are in the image, (N, 2) in pixels, and their depths (N,)."""
        local = (points - self.pose[:3, 3]) @ self.pose[:3, :3]
        depth = local[:, 2]
        safe = np.where(depth > 0, depth, np.nan)
        return local[:, :2] / safe[:, None] * self.focal + np.array(self.center), depth

    def coverage(self, pixels: Any, outside: float = 0.0) -> Any:
        """The mask at (N, 2) places in pixels, bilinear; `outside` where there is no image."""
        return bilinear(self.mask, pixels, outside)


def bilinear(image: Any, pixels: Any, outside: float = 0.0) -> Any:
    """An (H, W) or (H, W, C) image at (..., 2) places; pixel (0, 0) has its center at 0.5, 0.5."""
    height, width = image.shape[:2]
    x, y = pixels[..., 0] - 0.5, pixels[..., 1] - 0.5
    inside = (x >= -0.5) & (y >= -0.5) & (x <= width - 0.5) & (y <= height - 0.5)
    x = np.clip(np.where(inside, x, 0), 0, width - 1)
    y = np.clip(np.where(inside, y, 0), 0, height - 1)
    x0, y0 = np.floor(x).astype(int), np.floor(y).astype(int)
    x1, y1 = np.minimum(x0 + 1, width - 1), np.minimum(y0 + 1, height - 1)
    u, v = x - x0, y - y0
    if image.ndim == 3:
        u, v, inside = u[..., None], v[..., None], inside[..., None]
    low = image[y0, x0] * (1 - u) + image[y0, x1] * u
    high = image[y1, x0] * (1 - u) + image[y1, x1] * u
    return np.where(inside, low * (1 - v) + high * v, outside)


def _first(paths: list[str]) -> str:
    return next((p for p in paths if os.path.isfile(p)), "")


def _image_file(base: str, name: str) -> str:
    """Where an image of the cameras' file is; "" for nowhere."""
    places = [os.path.join(base, p, name) for p in ("", "images", "input", "image", "rgb")]
    return _first([p + e for e in ("", *IMAGES) for p in places])


def _mask_file(base: str, image: str, camera: Camera) -> str:
    """A mask's file: as the cameras say, or of the image's name in a folder of masks."""
    if camera.mask:
        found = _first([os.path.join(base, camera.mask)])
        if not found:
            raise InputError(f"{camera.place}: error: no such mask: {camera.mask}")
        return found
    name = camera.image
    stem = os.path.splitext(name)[0]
    beside = os.path.splitext(image)[0]
    names = [name + ".png", *[stem + e for e in IMAGES]]
    short = [os.path.basename(n) for n in names]
    folders = [os.path.join(base, p) for p in ("masks", "mask")]
    paths = [os.path.join(f, n) for f in folders for n in dict.fromkeys([*names, *short])]
    return _first([*paths, *[beside + mark + e for mark in ("_mask", ".mask") for e in IMAGES]])


def _encoded(linear: Any) -> Any:
    """sRGB's numbers of a linear image: masks in eight bits are no colours."""
    x = np.clip(linear, 0, 1)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)


def _read_mask(file: str) -> Any:
    """Coverage, (H, W): a mask's alpha channel if it is not opaque, else its brightness."""
    alpha = read_alpha(file)
    if alpha is not None and alpha.min() < 1:
        return np.clip(alpha, 0, 1)
    grey = read_image(file).mean(axis=2)
    return np.clip(grey, 0, 1) if file.lower().endswith(".exr") else _encoded(grey)


def _scaled(camera: Camera, file: str, width: int, height: int) -> Camera:
    """The camera for an image of this size, which may be a scaled copy of the camera's."""
    if camera.height:
        across, down = width / camera.width, height / camera.height
        if abs(across * camera.height - height) > 1.0 and abs(down * camera.width - width) > 1.0:
            raise InputError(
                f"{file}: error: has {width} x {height} pixels; its camera ({camera.place}) is for "
                f"{camera.width:g} x {camera.height:g}, which is another shape"
            )
        if across != 1 or down != 1:
            warnings.warn(
                f"{file}: has {width} x {height} pixels, not its camera's {camera.width:g} x "
                f"{camera.height:g}: taken for a scaled copy",
                stacklevel=2,
            )
    else:
        across = down = float(width) if camera.width else 1.0
    focal = (camera.focal[0] * across, camera.focal[1] * down)
    center = (camera.center[0] * across, camera.center[1] * down)
    center = (width / 2 if math.isnan(center[0]) else center[0],
              height / 2 if math.isnan(center[1]) else center[1])  # fmt: skip
    if not (focal[0] > 0 and focal[1] > 0):
        raise InputError(f"{camera.place}: error: the focal length is not above 0")
    return Camera(camera.image, camera.place, width, height, focal, center, camera.distortion,
                  camera.to_world)  # fmt: skip


def _distorted(camera: Camera, x: Any, y: Any) -> tuple[Any, Any]:
    """Where a point of the plane z = 1 falls, in pixels: OpenCV's radial-tangential model."""
    k1, k2, p1, p2 = camera.distortion
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + k2 * r2)
    u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    v = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    # Where the radius does not grow any more the model turns back: no light comes from there.
    grows = 1 + r2 * (3 * k1 + 5 * k2 * r2) > 0
    u, v = np.where(grows, u, np.nan), np.where(grows, v, np.nan)
    return camera.focal[0] * u + camera.center[0], camera.focal[1] * v + camera.center[1]


def _resampled(camera: Camera, layers: Any, size: int) -> tuple[Any, Any, float, Any]:
    """Layers (H, W, C) as a pinhole sees them, what is known of each pixel, focal and center."""
    width, height = int(camera.width), int(camera.height)
    scale = min(1.0, size / max(width, height))
    w, h = max(1, round(width * scale)), max(1, round(height * scale))
    focal = camera.focal[0] * w / width
    center = (camera.center[0] * w / width, camera.center[1] * h / height)
    samples = min(_MOST_SAMPLES, math.ceil(1 / scale - 1e-9))
    total, known = np.zeros((h, w, layers.shape[2])), np.zeros((h, w))
    for i in range(samples * samples):
        shift = (np.array([i % samples, i // samples]) + 0.5) / samples
        x, y = np.meshgrid(np.arange(w) + shift[0], np.arange(h) + shift[1])
        places = np.stack(_distorted(camera, (x - center[0]) / focal, (y - center[1]) / focal), -1)
        inside: Any = ((places >= 0) & (places <= [width, height])).all(axis=-1)
        total += bilinear(layers, np.where(inside[..., None], places, -1.0))
        known += inside
    every = samples * samples
    return total / np.maximum(known, 1)[..., None], known == every, focal, center


def _holes(mask: Any) -> list[Any]:
    """The parts of the background that do not reach the border, each as (H, W) booleans."""
    free: Any = np.pad(mask < 0.5, 1, constant_values=True)
    label: Any = np.where(free, np.arange(free.size).reshape(free.shape), -1)
    while True:
        spread: Any = label.copy()
        for axis in (0, 1):
            for step in (1, -1):
                spread = np.maximum(spread, np.where(free, np.roll(label, step, axis), -1))
        # Far: along rows and columns at once, by the label of the one that is named.
        spread = np.where(free, np.maximum(spread, spread.reshape(-1)[np.maximum(spread, 0)]), -1)
        if (spread == label).all():
            break
        label = spread
    outer = label[0, 0]
    return [(label == k)[1:-1, 1:-1] for k in np.unique(label) if k >= 0 and k != outer]


def _mended(mask: Any, file: str) -> Any:
    """The mask without small holes; each hole is reported."""
    area = float(mask.sum())
    for hole in _holes(mask):
        rows, columns = np.nonzero(hole)
        small = hole.sum() < _HOLE * area
        what = "filled" if small else "taken for an opening of the object"
        warnings.warn(
            f"{file}: the mask has a hole of {hole.sum()} pixels around column "
            f"{int(columns.mean())}, row {int(rows.mean())} of {mask.shape[1]} x {mask.shape[0]}: "
            f"{what}",
            stacklevel=2,
        )
        if small:
            mask = np.where(hole, 1.0, mask)
    return mask


def _load(base: str, camera: Camera, size: int) -> View | None:
    """A view, or None, with a warning, for a photograph that says nothing."""
    file = _image_file(base, camera.image)
    if not file:
        warnings.warn(f"{camera.place}: no such photograph: {camera.image}", stacklevel=2)
        return None
    image = read_image(file)
    image = np.repeat(image, 3, axis=2) if image.shape[2] == 1 else image
    if not np.isfinite(image).all():
        raise InputError(f"{file}: error: has pixels that are not finite")
    height, width = image.shape[:2]
    camera = _scaled(camera, file, width, height)
    mask_file = _mask_file(base, file, camera)
    mask = _read_mask(mask_file) if mask_file else read_alpha(file)
    source = mask_file or file
    if mask is None:
        raise InputError(
            f"{file}: error: has no mask: give it an alpha channel, or put "
            f"masks/{os.path.splitext(camera.image)[0]}.png (white: object) into the folder"
        )
    if mask.shape != (height, width):
        raise InputError(
            f"{source}: error: the mask has {mask.shape[1]} x {mask.shape[0]} pixels, its photograph "
            f"{width} x {height}"
        )
    clipped: Any = (image >= _CLIPPED).any(axis=2) & (not file.lower().endswith(".exr"))
    layers = np.concatenate([image * mask[..., None], mask[..., None], clipped[..., None]], axis=2)
    pixels, known, focal, center = _resampled(camera, layers, size)
    given = np.clip(pixels[..., 3], 0, 1)
    mask = _mended(given, source)
    # A hole that is filled may be a true one, and its colours are gone: other views tell.
    known = known & (pixels[..., 4] == 0) & (mask == given)
    if not (mask > 0.5).any() or (mask[known] > 0.5).all():
        what = "empty" if not (mask > 0.5).any() else "white everywhere"
        warnings.warn(f"{source}: the mask is {what}: the view is left out", stacklevel=2)
        return None
    if pixels[..., :3][mask > 0.5].mean() < _BLACK:
        warnings.warn(f"{file}: the photograph is black: the view is left out", stacklevel=2)
        return None
    return View(camera.image, file, pixels[..., :3], mask, known, focal, center, camera.to_world)


def read_views(folder: str, size: int) -> list[View]:
    """All views of a folder, the longer side of each at most `size` pixels.

    Warns of views that are left out and of masks with holes; raises limn.InputError where fewer
    than three views are left.
    """
    cameras, source = read_cameras(folder)
    base = os.path.dirname(source) if os.path.isfile(source) else folder
    views = [v for v in (_load(base, c, size) for c in cameras) if v is not None]
    if len(views) < 3:
        raise InputError(
            f"{source}: error: {len(views)} usable photographs of {len(cameras)}: at least 3 are "
            "needed"
        )
    return sorted(views, key=lambda v: v.name)
