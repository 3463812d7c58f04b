"""Steps that move a model towards photographs: shape, colours, gloss and sky together."""

from __future__ import annotations

import dataclasses
import math
import tempfile
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ._limn import LargeSteps, Scene, backward, render
from .photo_model import Model, edges_of, face_normals, scenes_of, sensor_pose, update
from .photo_views import View

# Weights of the priors beside the losses, whose gradients are made of one size first (see _Adam);
# not tuned: a tenth of a step where photographs say something, all of it where they say nothing.
_SMOOTH_COLOURS = 0.1
_SMOOTH_ROUGHNESS = 0.1
_SMOOTH_SKY = 0.1
_BRIGHTEST = 0.8  # base colour that the 98th percentile is given, see level()
_GIVEN = 0.01  # how much of its curvature a camera's given pose has; not tuned
_POSE = [f"sensor.{kind}.{axis}" for kind in ("rotate", "translate") for axis in "xyz"]


def posed(pose: Any, motion: Any) -> Any:
    """A pose (4, 4) turned about its pinhole by a vector [radians], then shifted; world axes."""
    angle = float(np.linalg.norm(motion[:3]))
    x, y, z = np.asarray(motion[:3]) / max(angle, 1e-300)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turn = np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross
    moved = pose.copy()
    moved[:3, :3] = turn @ pose[:3, :3]
    moved[:3, 3] = pose[:3, 3] + motion[3:]
    return moved


def _flow(view: View, far: float, units: Any) -> Any:
    """How the image of a plane in this distance moves by the six motions, (6, H, W, 2) [pixels]."""
    y, x = np.mgrid[: view.mask.shape[0], : view.mask.shape[1]] + 0.5
    local = np.stack([(x - view.center[0]) / view.focal, (y - view.center[1]) / view.focal,
                      np.ones_like(x)], -1).reshape(-1, 3) * far  # fmt: skip
    points = local @ view.pose[:3, :3].T + view.pose[:3, 3]
    here, tiny = view.project(points)[0], 1e-5
    moved = [dataclasses.replace(view, pose=posed(view.pose, tiny * a)).project(points)[0]
             for a in np.diag(units)]  # fmt: skip
    return ((np.stack(moved) - here) / tiny).reshape(6, *view.mask.shape, 2)


@dataclass
class Plan:
    """A stretch of steps that end after `seconds`, or after `steps` where they are given."""

    seconds: float
    steps: int | None = None
    step: float = 0.3  # of vertices at first, in hundredths of the diagonal; at last a tenth
    smoothing: float = 0.03  # how far a step spreads, over the diagonal
    photographs: bool = True  # or masks alone
    shape: bool = True  # or colours and light alone
    blur: float = 1.0  # texels of the sky that a step spreads over
    batch: int = 4  # views a step
    image_spp: int = 4  # of each of two images; an image costs a tenth of a gradient
    spp: int = 2  # of the gradient of photographs; masks have twice as many
    terms: tuple[str, ...] = ("interior", "camera")  # of photographs
    cameras: bool = False  # are refined, where shape is


@dataclass
class Progress:
    """What a fit reports of each step: its number, the losses, and how far it is, in [0, 1]."""

    step: int
    loss: float
    mask_loss: float
    fraction: float
    stage: str


class _Adam:
    """Steps of about 1 from gradients of any size (Kingma and Ba 2015), with a short memory."""

    def __init__(self, uniform: bool = False) -> None:
        self.uniform, self.count = uniform, 0
        self.first: Any = 0.0
        self.second: Any = 0.0

    def step(self, gradient: Any) -> Any:
        """The direction to leave along the negative of."""
        self.count += 1
        self.first = 0.9 * self.first + 0.1 * gradient
        self.second = 0.95 * self.second + 0.05 * gradient**2
        mean = self.first / (1 - 0.9**self.count)
        size = np.sqrt(self.second / (1 - 0.95**self.count))
        return mean / (np.max(size) + 1e-30) if self.uniform else mean / (size + 1e-30)


@dataclass
class Losses:
    """Of one view: unbiased estimates of the losses, and gradients by name."""

    photograph: float = 0.0
    mask: float = 0.0
    gradients: dict[str, Any] = field(default_factory=dict)
    exposure: tuple[float, float] = (0.0, 0.0)  # sums of target times image and of image squared


def pixel_weights(view: View) -> Any:
    """Weights of a photograph's pixels, (H, W): known, wholly object or background, by shot noise.

    A sensor's variance grows with brightness, so that a pixel counts by 1 / (brightness + 0.1).
    """
    whole = (view.mask <= 0.001) | (view.mask >= 0.999)
    # A pixel that touches the border of the mask is judged by the mask alone.
    near = np.zeros_like(whole)
    for axis in (0, 1):
        for shift in (1, -1):
            near |= abs(np.roll(view.mask, shift, axis) - view.mask) > 0.5
    weight = view.known * whole * ~near / (view.image.mean(axis=2) + 0.1)
    return weight / max(1e-9, weight.mean())


class PhotoFit:
    """A model and the photographs that it is moved towards. seed: of the random numbers."""

    def __init__(self, model: Model, views: Sequence[View], seed: int = 0,
                 threads: int = 0) -> None:  # fmt: skip
        self.model, self.views = model, list(views)
        self.seed, self.threads = seed, threads
        self.weights = [pixel_weights(v) for v in self.views]
        self.random = np.random.default_rng(seed)
        self.steps = 0
        self.history: list[Progress] = []
        self.sums = {v.name: (0.0, 0.0) for v in self.views}
        # Of each camera, what it was turned by [radians], and shifted over the distance.
        self.moved: dict[str, Any] = {}

    def _seed(self) -> int:
        return int(self.random.integers(1 << 62))

    def _two_images(self, scene: Scene, spp: int) -> tuple[Any, Any]:
        """Two independent images."""
        return tuple(  # type: ignore[return-value]
            render(scene, spp=spp, seed=self._seed(), threads=self.threads).value.astype(float)
            for _ in range(2)
        )

    def _photograph(self, scene: Scene, i: int, plan: Plan, names: list[str],
                    found: Losses) -> None:  # fmt: skip
        view, weight = self.views[i], self.weights[i][..., None]
        exposure = self.model.exposures.get(view.name, 1.0)
        one, two = self._two_images(scene, plan.image_spp)
        mean = (one + two) / 2
        scale = weight / weight.size / 3
        found.photograph += float(
            (scale * (exposure * one - view.image) * (exposure * two - view.image)).sum()
        )
        found.exposure = self._sums(i, one, two)
        adjoint = 2 * exposure * scale * (exposure * mean - view.image)
        self._add(scene, adjoint, names, plan.spp, found, plan.terms)

    def _coverage(self, scene: Scene, i: int, plan: Plan, found: Losses) -> None:
        view = self.views[i]
        one, two = (image.mean(axis=2) for image in self._two_images(scene, plan.image_spp))
        scale = view.known / view.mask.size
        found.mask += float((scale * (one - view.mask) * (two - view.mask)).sum())
        residual = scale * ((one + two) / 2 - view.mask)
        adjoint = np.repeat(2 / 3 * residual[..., None], 3, axis=2)
        names = ["object.vertex_positions", *(_POSE if plan.cameras else [])]
        self._add(scene, adjoint, names, 2 * plan.spp, found, ("camera",))

    def _add(self, scene: Scene, adjoint: Any, names: list[str], spp: int, found: Losses,
             terms: Sequence[str]) -> None:  # fmt: skip
        slopes = backward(scene, adjoint, names, spp=spp, seed=self._seed(), terms=terms,
                          threads=self.threads)  # fmt: skip
        for name in names:
            value = np.asarray(slopes[name].value)
            found.gradients[name] = found.gradients.get(name, 0.0) + value

    def losses(self, lit: Scene, flat: Scene, i: int, plan: Plan, names: list[str]) -> Losses:
        """Of view i, with gradients: of the mask alone unless the plan has photographs."""
        found = Losses()
        lit, flat = lit.view(int(i)), flat.view(int(i))
        if plan.cameras:
            lit.sensor_to_world = flat.sensor_to_world = sensor_pose(self.views[i])
        if plan.shape:
            self._coverage(flat, i, plan, found)
        if plan.photographs:
            self._photograph(lit, i, plan, names, found)
        return found

    def run(self, plan: Plan, stage: str, tell: Callable[[Progress], object] | None = None) -> None:
        """Steps along the plan; Ctrl-C leaves the model as it was before a step."""
        with tempfile.TemporaryDirectory(prefix="limn_") as folder, warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of every step anew
            lit, flat = scenes_of(self.model, self.views, folder)
            mover = _Mover(self.model, plan)
            if plan.photographs:
                self._first_exposures(lit, plan.image_spp)
            names = ["object.vertex_color", "object.vertex_roughness", "material.specular"]
            names += ["sky.data"]
            names += ["object.vertex_positions"] if plan.shape else []
            names += _POSE if plan.cameras else []
            start, order = time.monotonic(), np.array([], int)
            done = 0
            while True:
                if plan.steps is None:
                    fraction = (time.monotonic() - start) / max(1e-9, plan.seconds)
                else:
                    fraction = done / plan.steps if plan.steps else 1.0
                if fraction >= 1:
                    return
                if len(order) < min(plan.batch, len(self.views)):
                    order = np.concatenate([order, self.random.permutation(len(self.views))])
                batch, order = order[: plan.batch], order[plan.batch :]
                all_losses = [self.losses(lit, flat, i, plan, names) for i in batch]
                self._learn_exposures(batch, all_losses)
                if plan.cameras:
                    for i, own in zip(batch, all_losses):
                        self._move_camera(i, own, plan, 10.0**-fraction)
                mover.move(all_losses, fraction)
                update(lit, flat, self.model)
                done, self.steps = done + 1, self.steps + 1
                progress = Progress(self.steps, float(np.mean([x.photograph for x in all_losses])),
                                float(np.mean([x.mask for x in all_losses])), fraction,
                                stage)  # fmt: skip
                self.history.append(progress)
                if tell:
                    tell(progress)

    def _move_camera(self, i: int, found: Losses, plan: Plan, shrink: float) -> None:
        """Half a Gauss-Newton step; curvature from the photograph (Lucas and Kanade 1981).

        What is in view is taken for flat there, in the distance of the model's middle. Motions
        that images do not tell apart, as those of the whole scene, stay near the given pose.
        """
        view = self.views[i]
        far = float(view.project(self.model.positions.mean(axis=0)[None])[1][0])
        units = np.array([1, 1, 1, far, far, far])
        flow = _flow(view, far, units)
        layers = [(view.mask[..., None], view.known[..., None] / view.mask.size)]
        if plan.photographs:
            weight = self.weights[i][..., None]
            layers.append((view.image, weight / weight.size / 3))
        matrix = np.zeros((6, 6))
        for image, weight in layers:
            slope = np.einsum("ahwk,khwc->ahwc", flow, np.stack(np.gradient(image, axis=(1, 0))))
            matrix += 2 * np.einsum("ahwc,bhwc->ab", weight * slope, slope)
        given = _GIVEN * np.trace(matrix) / 6
        slopes = np.array([float(found.gradients[n]) for n in _POSE]) * units
        moved = self.moved.setdefault(view.name, np.zeros(6))
        step = np.linalg.solve(matrix + given * np.eye(6), slopes + given * moved)
        self.moved[view.name] = moved - 0.5 * shrink * step
        view.pose = posed(view.pose, -0.5 * shrink * step * units)

    def _first_exposures(self, lit: Scene, spp: int) -> None:
        """Before a step could explain them by the light."""
        found = []
        for i in range(len(self.views)):
            one, two = self._two_images(lit.view(i), spp)
            found.append(Losses(exposure=self._sums(i, one, two)))
        self._learn_exposures(range(len(self.views)), found)

    def _sums(self, i: int, one: Any, two: Any) -> tuple[float, float]:
        """Of target times image and of image squared, inside of the mask: both unbiased."""
        view = self.views[i]
        inside = self.weights[i][..., None] * (view.mask[..., None] > 0.5)
        return (float((inside * view.image * (one + two) / 2).sum()),
                float((inside * one * two).sum()))  # fmt: skip

    def _learn_exposures(self, batch: Any, found: list[Losses]) -> None:
        """Least squares over the last steps; the mean of their logarithms stays 0."""
        for i, own in zip(batch, found):
            if own.exposure[1] > 0:
                old, name = self.sums[self.views[i].name], self.views[i].name
                self.sums[name] = (0.8 * old[0] + own.exposure[0], 0.8 * old[1] + own.exposure[1])
        known = {n: a / b for n, (a, b) in self.sums.items() if a > 0 and b > 0}
        if len(known) == len(self.views):
            middle = math.exp(np.mean([math.log(x) for x in known.values()]))
            self.model.exposures = {n: x / middle for n, x in known.items()}


class _Mover:
    """Turns gradients into steps of a model."""

    def __init__(self, model: Model, plan: Plan) -> None:
        self.model, self.plan = model, plan
        edges = edges_of(model.faces)
        lengths = np.linalg.norm(np.diff(model.positions[edges], axis=1)[:, 0], axis=1)
        self.edges = edges
        weight = (plan.smoothing * model.diagonal / lengths.mean()) ** 2
        self.large = LargeSteps(model.positions, model.faces, weight)
        # Colours spread to the neighbours of a vertex and theirs, roughness three times as far:
        # highlights are few.
        self.small = LargeSteps(model.positions, model.faces, 1.0)
        self.wide = LargeSteps(model.positions, model.faces, 9.0)
        self.adams = {n: _Adam() for n in ("colours", "roughness", "specular")}
        self.adams["positions"] = _Adam(uniform=True)
        self.adams["sky"] = _Adam(uniform=True)
        self.sky_spread = _map_spread(model.sky.shape[0], model.sky.shape[1], plan.blur)

    def move(self, found: list[Losses], fraction: float) -> None:
        """fraction: of the plan that is done; steps get shorter to a tenth."""
        shrink = 10.0**-fraction

        def mean(name: str) -> Any:
            return np.mean([x.gradients[name] for x in found], axis=0)

        if self.plan.shape:
            self._move_positions(mean("object.vertex_positions"), shrink)
        if self.plan.photographs:
            self._move_colours(mean("object.vertex_color")[0], shrink)
            self._move_sky(mean("sky.data"), shrink)
            self._move_roughness(mean("object.vertex_roughness")[0].sum(axis=1), shrink)
            step = float(self.adams["specular"].step(mean("material.specular")))
            self.model.specular = min(max(self.model.specular - 0.02 * shrink * step, 0.0), 1.0)
            level(self.model)

    def _move_positions(self, gradient: Any, shrink: float) -> None:
        model = self.model
        direction = self.adams["positions"].step(self.large.solve(gradient))
        size = 0.01 * model.diagonal * self.plan.step * shrink
        change = self.large.solve(direction) * -size
        before = face_normals(model.positions, model.faces)
        # A face that turns over in one step goes through an area of 0.
        for _ in range(6):
            after = face_normals(model.positions + change, model.faces)
            turned = (after * before).sum(axis=1) <= 0.05 * (before**2).sum(axis=1)
            if not turned.any():
                break
            held = np.zeros(len(change), bool)
            held[model.faces[turned].reshape(-1)] = True
            change = np.where(held[:, None], 0.5 * change, change)
        else:
            return
        model.positions = model.positions + change

    def _variation(self, values: Any) -> Any:
        """The derivative of the total variation, rounded off, of (V, C) values; about 1."""
        prior = np.zeros_like(values)
        a, b = self.edges.T
        apart = values[a] - values[b]
        pull = apart / np.sqrt(apart**2 + 0.02**2)
        np.add.at(prior, a, pull)
        np.add.at(prior, b, -pull)
        return prior / 6

    def _move_colours(self, gradient: Any, shrink: float) -> None:
        model = self.model
        step = self.adams["colours"].step(self.small.solve(gradient))
        step = step + _SMOOTH_COLOURS * self._variation(model.colours)
        model.colours = np.clip(model.colours - 0.03 * shrink * step, 0.005, 0.995)

    def _move_roughness(self, gradient: Any, shrink: float) -> None:
        model = self.model
        smooth = self.wide.solve(np.repeat(gradient[:, None], 3, axis=1))[:, 0]
        step = self.adams["roughness"].step(smooth)
        step = step + _SMOOTH_ROUGHNESS * self._variation(model.roughness[:, None])[:, 0]
        model.roughness = np.clip(model.roughness - 0.04 * shrink * step, 0.08, 1.0)

    def _move_sky(self, gradient: Any, shrink: float) -> None:
        """By the logarithm of its texels, through (I + lambda L)^-1 as vertices are moved."""
        model, logs = self.model, np.log(self.model.sky)
        flat = (gradient * model.sky).reshape(-1, 3)
        step = self.sky_spread @ self.adams["sky"].step(self.sky_spread @ flat)
        rows = np.pad(logs, ((1, 1), (0, 0), (0, 0)), mode="edge")
        pull = 4 * logs - rows[2:] - rows[:-2] - np.roll(logs, 1, 1) - np.roll(logs, -1, 1)
        step = step.reshape(logs.shape) + _SMOOTH_SKY * pull
        model.sky = np.exp(np.clip(logs - 0.2 * shrink * step, -7, 7))


def _map_spread(rows: int, columns: int, texels: float) -> Any:
    """(I + lambda L)^-1 over an envmap's texels: what spreads a step over so many of them."""
    index = np.arange(rows * columns).reshape(rows, columns)
    pairs = np.concatenate([np.stack([index[1:], index[:-1]], -1).reshape(-1, 2),
                            np.stack([index, np.roll(index, 1, 1)], -1).reshape(-1, 2)])  # fmt: skip
    matrix = np.eye(rows * columns)
    for a, b in (pairs.T, pairs.T[::-1]):
        np.add.at(matrix, (a, a), texels**2)
        np.add.at(matrix, (a, b), -(texels**2))
    return np.linalg.inv(matrix)


def level(model: Model) -> None:
    """Fixes what photographs cannot tell: whether the light is bright or the object.

    The sky is grey in the mean over its sphere, and the 98th percentile of base colours is 0.8.
    """
    rows = model.sky.shape[0]
    solid = np.sin((np.arange(rows) + 0.5) / rows * np.pi)[:, None, None]
    mean = (model.sky * solid).sum(axis=(0, 1)) / (solid.sum() * model.sky.shape[1])
    tint = mean / mean.mean()
    colours = model.colours * tint
    bright = _BRIGHTEST / max(1e-6, float(np.percentile(colours.max(axis=1), 98)))
    # A twentieth of the way: steps are not disturbed.
    change = (tint * bright) ** 0.05
    model.colours = np.clip(model.colours * change, 0.005, 0.995)
    model.sky = model.sky / change
