"""The visual hull of masks: a first shape, and a test of whether cameras and masks agree."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from .errors import InputError
from .photo_views import View

_COARSE = 48  # cells a side of the grid that checks cameras; not tuned
_AGREES = 0.85  # share of a mask that the hull covers where its camera is right: sampling leaves .95


def _rotated(pose: Any, *axes: float) -> Any:
    turned = pose.copy()
    turned[:3, :3] = pose[:3, :3] * axes
    return turned


# What is wrong with cameras, mostly: (what to tell, the pose as it would be right).
_MISTAKES: list[tuple[str, Callable[[Any], Any]]] = [
    ("upside down: they agree after half a turn about the view", lambda p: _rotated(p, -1, -1, 1)),
    ("turned the wrong way about: they agree with +Y and +Z reversed (OpenCV's axes for OpenGL's)",
     lambda p: _rotated(p, 1, -1, -1)),
    ("those of the world seen by the camera: they agree when inverted", np.linalg.inv),
]  # fmt: skip


def bounds_of(views: Sequence[View]) -> tuple[Any, float]:
    """Center and half side of a cube around the object: where the masks' middles meet."""
    matrix, right = np.zeros((3, 3)), np.zeros(3)
    for v in views:
        rows, columns = np.nonzero(v.mask > 0.5)
        middle = np.array([columns.mean() + 0.5, rows.mean() + 0.5])
        local = np.append((middle - v.center) / v.focal, 1.0)
        along = v.pose[:3, :3] @ (local / np.linalg.norm(local))
        across = np.eye(3) - np.outer(along, along)
        matrix += across
        right += across @ v.pose[:3, 3]
    center = np.linalg.lstsq(matrix, right, rcond=None)[0]
    sizes = []
    for v in views:
        rows, columns = np.nonzero(v.mask > 0.5)
        pixels, depth = v.project(center[None])
        if depth[0] <= 0:
            continue
        away = np.hypot(columns + 0.5 - pixels[0, 0], rows + 0.5 - pixels[0, 1]).max()
        sizes.append(away / v.focal * depth[0])
    if not sizes:
        raise InputError("the cameras look away from where their views meet")
    return center, 1.1 * float(np.median(sizes))


def _grid(center: Any, half: float, cells: int) -> Any:
    """Centers of cells, (cells^3, 3), the last axis fastest."""
    line = (np.arange(cells) + 0.5) / cells * 2 - 1
    return np.stack(np.meshgrid(line, line, line, indexing="ij"), -1).reshape(-1, 3) * half + center


def _inside(view: View, points: Any) -> Any:
    """The mask at (N, 3) points; beside the image the object is only if it reaches the border."""
    m = view.mask
    cut = max(m[0].max(), m[-1].max(), m[:, 0].max(), m[:, -1].max()) > 0.5
    pixels, depth = view.project(points)
    return np.where(depth > 0, view.coverage(np.nan_to_num(pixels, nan=-1e9), float(cut)), 0.0)


def _covered(view: View, points: Any, cell: float) -> float:
    """The share of a mask that cells at (N, 3) points cover, by blocks as large as cells."""
    pixels, depth = view.project(points)
    pixels = pixels[depth > 0]
    if not len(pixels):
        return 0.0
    block = max(1.0, 1.5 * cell * view.focal / float(np.median(depth[depth > 0])))
    width, height = (int(np.ceil(s / block)) for s in view.size)
    at = np.floor(pixels / block).astype(int)
    at = at[((at >= 0) & (at < [width, height])).all(axis=1)]
    hit = np.zeros((height, width), bool)
    hit[at[:, 1], at[:, 0]] = True
    rows, columns = np.nonzero(view.mask > 0.5)
    return float(hit[(rows / block).astype(int), (columns / block).astype(int)].mean())


def _agreement(views: Sequence[View]) -> Any:
    """Of each view, the share of its mask that the hull of all covers."""
    try:
        center, half = bounds_of(views)
    except InputError:
        return np.zeros(len(views))
    points = _grid(center, half, _COARSE)
    inside = np.ones(len(points), bool)
    for v in views:
        inside[inside] = _inside(v, points[inside]) >= 0.5
    return np.array([_covered(v, points[inside], 2 * half / _COARSE) for v in views])


def _with_pose(view: View, pose: Any) -> View:
    return View(view.name, view.file, view.image, view.mask, view.known, view.focal, view.center,
                pose)  # fmt: skip


def checked(views: list[View], source: str) -> list[View]:
    """The views whose cameras and masks agree; warns of those that do not, by their files.

    source: the file of the cameras, for limn.InputError where none agree.
    """
    views, most = list(views), max(1, len(views) // 4)
    for left in range(most, -1, -1):
        agrees = _agreement(views)
        if agrees.min() >= _AGREES:
            return views
        for what, mend in _MISTAKES:
            if _agreement([_with_pose(v, mend(v.pose)) for v in views]).min() >= _AGREES:
                raise InputError(f"{source}: error: the cameras are {what}")
        if left == 0 or len(views) < 4:
            break
        without = [_agreement(views[:i] + views[i + 1 :]).mean() for i in range(len(views))]
        worst = int(np.argmax(without))
        view = views.pop(worst)
        why = "its camera or its mask is wrong"
        for what, mend in _MISTAKES:
            if _agreement([*views, _with_pose(view, mend(view.pose))]).min() >= _AGREES:
                why = "its camera is " + what.replace("they agree", "it agrees")
                break
        warnings.warn(
            f"{view.file}: contradicts the other views (all masks together leave "
            f"{agrees.mean():.0%} of themselves, without it {without[worst]:.0%}), and is left "
            f"out: {why}",
            stacklevel=2,
        )
    raise InputError(
        f"{source}: error: cameras and masks do not agree: what is inside of all masks covers only "
        f"{agrees.mean():.0%} of them; check poses, axes and that each mask is of its photograph"
    )


# The six tetrahedra of a cube around its diagonal from corner 0 to corner 7, corners by bits z, y, x.
_TETRAHEDRA = np.array([[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7],
                        [0, 5, 1, 7]])  # fmt: skip
# By how many of four corners, sorted with those inside first, are inside: triangles of pairs.
_CUTS = {
    1: [[(0, 1), (0, 2), (0, 3)]],
    2: [[(0, 2), (0, 3), (1, 3)], [(0, 2), (1, 3), (1, 2)]],
    3: [[(3, 0), (3, 1), (3, 2)]],
}


def marching_tetrahedra(values: Any) -> tuple[Any, Any]:
    """The surface where (X, Y, Z) values are 0, those above 0 inside: positions in cells, faces.

    Closed where the border is outside, and manifold: each cell is cut as six tetrahedra. Faces are
    counter-clockwise from outside.
    """
    shape = np.array(values.shape)
    flat = np.where(values == 0, np.float64(1e-9), values).reshape(-1)
    index = np.arange(flat.size).reshape(shape)
    n = shape - 1
    corners = np.stack([index[x : x + n[0], y : y + n[1], z : z + n[2]].reshape(-1)
                        for x in (0, 1) for y in (0, 1) for z in (0, 1)], 1)  # fmt: skip
    inside = flat[corners] > 0
    corners = corners[inside.any(axis=1) & ~inside.all(axis=1)]
    four = corners[:, _TETRAHEDRA].reshape(-1, 4)
    inside = flat[four] > 0
    four = np.take_along_axis(four, np.argsort(~inside, axis=1, kind="stable"), 1)
    count = inside.sum(axis=1)
    where = np.stack(np.unravel_index(np.arange(flat.size), tuple(shape)), -1).astype(float)
    pieces = []
    for inner, triangles in _CUTS.items():
        own = four[count == inner]
        outward = where[own[:, inner:]].mean(axis=1) - where[own[:, :inner]].mean(axis=1)
        for triangle in triangles:
            ends = np.stack([own[:, list(pair)] for pair in triangle], 1)  # (n, 3, 2)
            middle = where[ends].mean(axis=2)
            normal = np.cross(middle[:, 1] - middle[:, 0], middle[:, 2] - middle[:, 0])
            back = (normal * outward).sum(axis=1) < 0
            ends[back] = ends[back][:, ::-1]
            pieces.append(ends)
    ends = np.sort(np.concatenate(pieces), axis=2).reshape(-1, 2)
    edges, faces = np.unique(ends, axis=0, return_inverse=True)
    a, b = flat[edges[:, 0]], flat[edges[:, 1]]
    t = np.clip(a / (a - b), 0.05, 0.95)[:, None]  # no face without an area
    return where[edges[:, 0]] * (1 - t) + where[edges[:, 1]] * t, faces.reshape(-1, 3)


def largest_piece(positions: Any, faces: Any) -> tuple[Any, Any, float]:
    """The connected part of a mesh with the most faces, and its share of them."""
    label = np.arange(len(positions))
    while True:
        least = label[faces].min(axis=1)
        lower = label.copy()
        np.minimum.at(lower, faces.reshape(-1), np.repeat(least, 3))
        lower = lower[lower]
        if (lower == label).all():
            break
        label = lower
    names, counts = np.unique(label[faces[:, 0]], return_counts=True)
    own = faces[label[faces[:, 0]] == names[counts.argmax()]]
    used, corners = np.unique(own, return_inverse=True)
    return positions[used], corners.reshape(-1, 3), float(counts.max() / counts.sum())


def visual_hull(views: Sequence[View], cells: int) -> tuple[Any, Any]:
    """The mesh of what is inside of all masks: positions (V, 3) and faces (F, 3)."""
    center, half = bounds_of(views)
    for resolution in (_COARSE, cells):
        points = _grid(center, half, resolution)
        field = np.full(len(points), 0.5)
        for v in views:
            near = np.nonzero(field > -0.5)[0]  # others are as far outside as they get
            field[near] = np.minimum(field[near], _inside(v, points[near]) - 0.5)
        inside = points[field > 0]
        if not len(inside):
            raise InputError("nothing is inside of all masks")
        if resolution != cells:
            low, high = inside.min(axis=0), inside.max(axis=0)
            center, half = (low + high) / 2, float((high - low).max()) / 2 + 3 * half / resolution
    solid = np.pad(field.reshape(cells, cells, cells), 1, constant_values=-0.5)
    positions, faces = marching_tetrahedra(solid)
    positions, faces, share = largest_piece(positions, faces)
    if share < 0.95:
        warnings.warn(
            f"the masks show more than one piece: the largest, {share:.0%} of the hull's surface, "
            "is kept",
            stacklevel=2,
        )
    return (positions - 0.5) / cells * 2 * half - half + center, faces
