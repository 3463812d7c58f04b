"""From photographs to an object: see limn.reconstruct."""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ._limn import LargeSteps, load_string
from .errors import InputError
from .photo_cameras import read_cameras
from .photo_fit import PhotoFit, Plan, Progress
from .photo_hull import checked, visual_hull
from .photo_model import Model, ply_shape, scenes_of, vertex_normals, write_coloured_ply
from .photo_output import psnr, rendered, write_model, write_report
from .photo_views import View, bilinear, read_views

# (stage, share of the time, of the faces, what it does: see Plan); not tuned
_STAGES: list[tuple[str, float, float, dict[str, Any]]] = [
    ("shape from masks", 0.12, 0.4, {"step": 0.5, "smoothing": 0.05, "photographs": False}),
    ("light", 0.16, 0.4, {"shape": False, "blur": 3.0}),
    ("shape and light", 0.24, 0.6, {"step": 0.3, "smoothing": 0.03, "blur": 1.5}),
    ("details", 0.32, 1.0, {"step": 0.15, "smoothing": 0.015, "blur": 0.7}),
]
_ERRORS = 0.06  # share of the time for each of the two fits that error bars take


@dataclass
class Reconstruction:
    """What limn.reconstruct found; all of it is in the files of `folder`, too."""

    model: Model
    views: list[View]  # that the model was fitted to
    held_out: list[View]  # that it was not
    history: list[Progress]  # of all steps
    figures: dict[str, Any]  # "views": PSNR [dB] by name; seconds, steps, ...
    errors: dict[str, Any]  # per vertex, standard errors: "position" (V,), "colour" (V, 3)
    folder: str


def first_colours(model: Model, views: Sequence[View]) -> Any:
    """Per vertex the mean of what the photographs show where it is in view, (V, 3)."""
    total, weight = np.zeros_like(model.positions), np.zeros(len(model.positions))
    with tempfile.TemporaryDirectory(prefix="limn_") as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        scene = scenes_of(model, views, folder)[0]
    for v in views:
        pixels, depth = v.project(model.positions)
        origin = v.pose[:3, 3]
        away = model.positions - origin
        far = np.linalg.norm(away, axis=1)
        hit = scene.intersect(np.tile(origin, (len(away), 1)), away / far[:, None])
        seen = (hit["t"] > far - 0.01 * model.diagonal) & (depth > 0)
        pixels = np.nan_to_num(pixels, nan=-1.0)
        alpha = v.coverage(pixels)
        own = seen * (alpha > 0.9) * bilinear(v.known.astype(float), pixels)
        shown = bilinear(v.image, pixels) / np.maximum(alpha, 0.1)[:, None]
        total += own[:, None] * shown / model.exposures.get(v.name, 1.0)
        weight += own
    middle = total.sum(axis=0) / max(float(weight.sum()), 1e-9)
    return np.clip((total + 0.1 * middle) / (weight + 0.1)[:, None], 0.01, 0.95)


def first_light(model: Model) -> None:
    """A smooth grey sky that explains how brightness follows normals, and colours without it.

    Second-order spherical harmonics of irradiance, by least squares over vertices as if all had one
    colour, and the radiance that makes it (Ramamoorthi and Hanrahan 2001).
    """
    def harmonics(d: Any) -> Any:
        x, y, z = np.moveaxis(d, -1, 0)
        return np.stack([np.ones_like(x), x, y, z, x * y, y * z, x * z, x * x - y * y,
                         3 * z * z - 1], -1)  # fmt: skip

    normals = vertex_normals(model.positions, model.faces)
    shown = model.colours.mean(axis=1)
    basis = harmonics(normals)
    damp = 0.05 * len(basis) * np.diag([0.0] + [1.0] * 8)
    found = np.linalg.solve(basis.T @ basis + damp, basis.T @ (shown / shown.mean()))
    irradiance = np.maximum(basis @ found, 0.2)
    rows, columns = model.sky.shape[:2]
    polar = ((np.arange(rows) + 0.5) / rows * np.pi)[:, None]
    around = ((np.arange(columns) + 0.5) / columns * 2 * np.pi)[None]
    directions = np.stack([np.sin(around) * np.sin(polar), np.cos(polar) + 0 * around,
                           -np.cos(around) * np.sin(polar)], -1)  # fmt: skip
    radiance = harmonics(directions) @ (found / ([1] + [2 / 3] * 3 + [1 / 4] * 5))
    model.sky = np.repeat(np.maximum(radiance, 0.15)[..., None], 3, axis=2)
    model.colours = np.clip(model.colours / irradiance[:, None], 0.01, 0.95)


def _offsets(model: Model, other: Model) -> Any:
    """Along the normals to the nearest surface of another model, (V,) [scene units].

    At most a twentieth of the diagonal, which is also taken where a normal meets nothing.
    """
    far = 0.05 * model.diagonal
    with tempfile.TemporaryDirectory(prefix="limn_") as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        write_coloured_ply(os.path.join(folder, "object.ply"), other)
        scene = load_string('<scene version="3.0.0"><sensor type="perspective"/>'
                            f'{ply_shape("object.ply", "")}</scene>', folder)  # fmt: skip
    normals = vertex_normals(model.positions, model.faces)
    # From outside and from inside, so that a surface at the vertex itself is met as well.
    ways = []
    for sign in (1.0, -1.0):
        start = model.positions - sign * far * normals
        hit = scene.intersect(start, sign * normals)["t"]
        ways.append(sign * (np.where(hit < 2 * far, hit, 2 * far) - far))
    return np.where(abs(ways[0]) < abs(ways[1]), ways[0], ways[1])


def _refitted(model: Model, views: list[View], seconds: float, steps: int | None, seed: int,
              threads: int) -> Model:  # fmt: skip
    """What these views show: their own hull and steps; light and gloss begin as the model's."""
    positions, faces = visual_hull(views, _cells(views))
    found = model.on(positions, faces).remeshed(len(model.faces) // 3)
    for share, stage in ((0.4, _STAGES[0]), (0.6, _STAGES[2])):
        fit = PhotoFit(found, views, seed, threads)
        fit.run(Plan(share * seconds, None if steps is None else steps // 2, **stage[3]), "errors")
    return found


def _errors(model: Model, views: Sequence[View], seconds: float, steps: int | None, seed: int,
            threads: int) -> dict[str, Any]:  # fmt: skip
    """Standard errors by two fits, each without another quarter of the views.

    The jackknife: without d of n views an estimate is off by sqrt(d / (n - d)) standard errors
    (Shao and Wu 1989), hull and all. Squares are means over the nearest neighbours: a single one
    says little.
    """
    mesh = LargeSteps(model.positions, model.faces, 0.5)
    position: Any = 0.0
    colour: Any = 0.0
    roughness: Any = 0.0
    for k in range(2):
        kept = [v for i, v in enumerate(views) if i % 4 != 2 * k]
        other = _refitted(model, kept, seconds, steps, seed + k + 1, threads)
        scale = len(kept) / (len(views) - len(kept)) / 2
        position = position + scale * _offsets(model, other) ** 2
        shown = other.on(model.positions, model.faces)
        colour = colour + scale * (shown.colours - model.colours) ** 2
        roughness = roughness + scale * (shown.roughness - model.roughness) ** 2
    both = mesh.solve(np.stack([position, roughness, roughness], 1))
    return {"position": np.sqrt(np.maximum(both[:, 0], 0)),
            "colour": np.sqrt(np.maximum(mesh.solve(colour), 0)),
            "roughness": np.sqrt(np.maximum(both[:, 1], 0))}  # fmt: skip


def _write_errors(file: str, errors: dict[str, Any]) -> None:
    summary = {
        "about": "standard errors per vertex of object.ply: position along the normal [scene "
        "units], colour [linear], roughness; from two refits, each without another quarter of the "
        "views",
        **{k: np.round(v, 7).tolist() if isinstance(v, np.ndarray) else v
           for k, v in errors.items()},
    }  # fmt: skip
    with open(file, "w", encoding="utf-8") as stream:
        json.dump(summary, stream)


def _hold_out(views: list[View], count: int | None) -> tuple[list[View], list[View]]:
    """(used, held out): by default the last one of eight views or more."""
    count = int(len(views) >= 8) if count is None else count
    if count < 0 or len(views) - count < 3:
        raise InputError(f"hold_out: {count} of {len(views)} views: at least 3 must be left")
    return views[: len(views) - count], views[len(views) - count :]


def _cells(views: Sequence[View]) -> int:
    """Cells a side of the hull's grid: a cell is a pixel."""
    sides = [max(np.ptp(np.nonzero(v.mask > 0.5), axis=1)) for v in views]
    return int(np.clip(np.median(sides), 24, 96))


def _most_faces(views: Sequence[View], minutes: float) -> int:
    """As fine as the photographs, which take many views to resolve, and as the time allows.

    Half of the faces face away, and five are seen in each pixel. A step's time grows with faces;
    with 4000 a minute there is time for about a hundred steps.
    """
    areas = [float(v.mask.sum()) for v in views]
    return int(np.clip(10 * np.mean(areas), 800, min(20000, max(800, 4000 * minutes))))


@dataclass
class _Request:
    """What `reconstruct` was called with, as its stages need it."""

    minutes: float
    refine_cameras: bool
    steps: list[int | None]  # of each stage
    seed: int
    threads: int
    tell: Callable[[Progress], object] | None


def _fitted(model: Model, used: list[View], most: int, request: _Request,
            history: list[Progress]) -> tuple[Model, bool]:  # fmt: skip
    """The model after all stages, and whether Ctrl-C ended them; may move the views' cameras."""
    moved: dict[str, Any] = {}
    for (stage, share, faces, how), count in zip(_STAGES, request.steps):
        model = model.remeshed(int(most * faces))
        if stage == "light":
            model.colours = first_colours(model, used)
            first_light(model)
        fit = PhotoFit(model, used, request.seed, request.threads)
        fit.history, fit.steps, fit.moved = history, len(history), moved
        refine = request.refine_cameras and how.get("shape", True)
        try:
            seconds = 60 * request.minutes * share
            fit.run(Plan(seconds, count, cameras=refine, **how), stage, request.tell)
        except KeyboardInterrupt:
            return fit.model, True
        model = fit.model
    return model, False


def reconstruct(
    folder: str | os.PathLike[str],
    out: str | os.PathLike[str],
    minutes: float = 15.0,
    *,
    size: int = 128,
    hold_out: int | None = None,
    faces: int | None = None,
    refine_cameras: bool = False,
    steps: Sequence[int] | None = None,
    seed: int = 0,
    threads: int = 0,
    tell: Callable[[Progress], object] | None = None,
) -> Reconstruction:
    """Shape, colours, gloss and light of an object, from photographs with masks and cameras.

    folder: holds transforms.json, or a COLMAP model (text or binary; in it, in sparse or in
    sparse/0) and images. Masks (white: object) are alpha channels, or files masks/NAME.png. Lens
    distortion is undone; each photograph has an exposure of its own.

    out: receives object.obj (vertex colours; with xatlas also albedo.png), object.ply, sky.exr,
    scene.xml, cameras.json, errors.json and report.html.

    minutes: what the fit may take; steps: of its four stages, in its place. size: photographs are
    made smaller, to so many pixels on the longer side. hold_out: so many of the last views are kept
    for judging alone (default: 1 if there are 8). faces: of the mesh (default: ten for each of the
    object's pixels, at most 4000 a minute). refine_cameras: poses are fitted, too.
    tell(progress): after each step. Ctrl-C ends the fit; what it has found is written.

    The sky's mean is grey, and the 98th percentile of colours is 0.8: photographs do not distinguish
    bright light from a bright object. Raises limn.InputError that names the file; warns of
    photographs that are left out and of masks with holes.
    """
    folder, out = os.fspath(folder), os.fspath(out)
    if not (minutes > 0 and size >= 8 and (faces is None or faces >= 100)):
        raise InputError("minutes must be above 0, size at least 8, and faces at least 100")
    start = time.monotonic()
    views = checked(read_views(folder, size), read_cameras(folder)[1])
    used, held = _hold_out(views, hold_out)
    os.makedirs(out, exist_ok=True)
    positions, corners = visual_hull(used, _cells(used))
    model = Model(positions, corners, np.full((len(positions), 3), 0.5))
    history: list[Progress] = []
    count: list[int | None] = [None] * len(_STAGES) if steps is None else list(steps)
    if len(count) != len(_STAGES):
        raise InputError(f"steps: {len(count)} numbers for {len(_STAGES)} stages")
    request = _Request(minutes, refine_cameras, count, seed, threads, tell)
    model, stopped = _fitted(model, used, faces or _most_faces(used, minutes), request, history)
    write_model(out, model, views)
    errors: dict[str, Any] = {}
    if not stopped:
        try:
            errors = _errors(model, used, 60 * minutes * _ERRORS, count[-1], seed, threads)
            _write_errors(os.path.join(out, "errors.json"), errors)
        except KeyboardInterrupt:
            warnings.warn("interrupted: errors.json is not written", stacklevel=2)
    figures = _report(out, model, used, held, history, threads, time.monotonic() - start)
    return Reconstruction(model, used, held, history, figures, errors, out)


def _fit_exposure(view: View, image: Any) -> float:
    """By least squares: a held-out view's exposure is not known."""
    inside = view.known * (view.mask > 0.5)
    return float((inside[..., None] * view.image * image).sum()
                 / max(1e-9, (inside[..., None] * image**2).sum()))  # fmt: skip


def _report(out: str, model: Model, used: list[View], held: list[View], history: list[Progress],
            threads: int, seconds: float) -> dict[str, Any]:  # fmt: skip
    shown = [*held, *used]
    pictures = rendered(model, shown, 64, threads)
    for k, v in enumerate(held):
        model.exposures[v.name] = _fit_exposure(v, pictures[k])
        pictures[k] = pictures[k] * model.exposures[v.name]
    views = {v.name: {"psnr": psnr(p, v.image, v.known), "held_out": v in held,
                      "exposure": model.exposures.get(v.name, 1.0)}
             for v, p in zip(shown, pictures)}  # fmt: skip
    figures = {
        "PSNR, fitted views [dB]": round(float(np.mean([views[v.name]["psnr"] for v in used])), 2),
        "roughness (mean)": round(float(model.roughness.mean()), 3),
        "specular": round(model.specular, 3),
        "faces": len(model.faces),
        "steps": len(history),
        "seconds": round(seconds, 1),
        "views": views,
    }
    if held:
        mean = np.mean([views[v.name]["psnr"] for v in held])
        figures = {"PSNR, held-out views [dB]": round(float(mean), 2), **figures}
    write_report(os.path.join(out, "report.html"), model, used, held, history, figures, pictures)
    return figures


def _teller(minutes: float) -> Callable[[Progress], None]:
    """Prints a line every ten seconds."""
    start = last = time.monotonic()

    def tell(progress: Progress) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last < 10:
            return
        last = now
        losses = f"masks {progress.mask_loss:.4g}"
        if progress.stage != "shape from masks":
            losses += f", photographs {progress.loss:.4g}"
        print(f"{now - start:5.0f} s of about {60 * minutes:.0f}: {progress.stage}, step "
              f"{progress.step}: {losses}", flush=True)  # fmt: skip

    return tell


def main(words: Sequence[str]) -> int:
    """limn reconstruct: an exit status."""
    parser = argparse.ArgumentParser(
        prog="limn reconstruct",
        description="Shape, colours, gloss and light of an object, from photographs with masks "
        "(alpha channels, or masks/NAME.png) and cameras (transforms.json or a COLMAP model).",
    )
    parser.add_argument("folder", metavar="FOLDER", help="photographs, masks and cameras")
    parser.add_argument("-o", "--output", required=True, metavar="OUT",
                        help="folder for the results (created if missing)")  # fmt: skip
    parser.add_argument("--minutes", type=float, default=15.0, metavar="M",
                        help="minutes for the fit (default: 15)")  # fmt: skip
    parser.add_argument("--size", type=int, default=128, metavar="PIXELS",
                        help="longer side of the reduced photographs (default: 128)")  # fmt: skip
    parser.add_argument("--hold-out", type=int, metavar="N",
                        help="number of last views, by name, held out of the fit (default: 1 if there are 8)")  # fmt: skip
    parser.add_argument("--faces", type=int, metavar="N",
                        help="faces of the mesh (default: by the photographs and the time)")  # fmt: skip
    parser.add_argument("--refine-cameras", action="store_true", help="fit the cameras' poses, too")
    parser.add_argument("--seed", type=int, default=0, help="seed of the random numbers (default: 0)")
    parser.add_argument("--threads", type=int, default=0, help="number of threads (default: all cores)")
    given = parser.parse_args(words)
    warnings.showwarning = lambda message, *_: print(f"warning: {message}", file=sys.stderr)
    try:
        found = reconstruct(given.folder, given.output, given.minutes, size=given.size,
                            hold_out=given.hold_out, faces=given.faces, seed=given.seed,
                            refine_cameras=given.refine_cameras,
                            threads=given.threads, tell=_teller(given.minutes))  # fmt: skip
    except (InputError, OSError) as error:
        print(error, file=sys.stderr)
        return 2
    for name, value in found.figures.items():
        if name != "views":
            print(f"{name:28} {value}")
    print(f"{'report':28} {os.path.join(found.folder, 'report.html')}")
    return 0
