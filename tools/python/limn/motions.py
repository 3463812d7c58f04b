"""Steps of a scene's motions."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from ._limn import Scene
from .errors import InputError

_MOTION = re.compile(r"\.(scale|(rotate|translate)\.[xyz])$")
_ORDER = {"scale": 0, "rotate": 1, "translate": 2}


def _moves_shape(scene: Scene, name: str) -> bool:
    return ".translate." in name and name.rsplit(".", 2)[0] in scene.shapes


def per_number(slope: Any, shape: tuple[int, ...]) -> Any:
    """A derivative in the shape of what was given: one number sets all channels of a colour."""
    slope = np.asarray(slope)
    return (slope if slope.size == np.prod(shape) else slope.sum()).reshape(shape)


def check_names(scene: Scene, names: Iterable[str]) -> None:
    """InputError for what has no derivative."""
    for name in names:
        scene[name]  # if it is known
        if name not in scene.parameters:  # ID.to_world
            raise InputError(f'"{name}" has no derivative: give translate, rotate or scale, or '
                             "vertex_positions that pose() has turned")


def _cross_with(w: Any) -> Any:
    x, y, z = w
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def _rotation(w: Any) -> tuple[Any, Any]:
    """R = exp([w]x), and J with dR = [J dw]x R: the left Jacobian of SO(3)."""
    angle = float(np.linalg.norm(w))
    k = _cross_with(w)
    if angle < 1e-4:  # series, exact to rounding
        a, b, c = 1 - angle**2 / 6, 0.5 - angle**2 / 24, 1 / 6
    else:
        a, b = np.sin(angle) / angle, (1 - np.cos(angle)) / angle**2
        c = (angle - np.sin(angle)) / angle**3
    return np.eye(3) + a * k + b * k @ k, np.eye(3) + b * k + c * k @ k


def _angles(rotation: Any) -> tuple[float, float, float]:
    """x, y and z with rotation = Rz Ry Rx."""
    r = rotation
    level = np.hypot(r[0, 0], r[1, 0])
    if level < 1e-9:  # y is a right angle: turns about x and z do the same
        return np.arctan2(-r[1, 2], r[1, 1]), np.arctan2(-r[2, 0], level), 0.0
    return np.arctan2(r[2, 1], r[2, 2]), np.arctan2(-r[2, 0], level), np.arctan2(r[1, 0], r[0, 0])


class Motions:
    """What is given for the parameters of a scene: values, and steps of motions.

    A shape of the size z (1 at first) is scaled by 1 + s / z about its pivot c (Scene.move), turned
    about an axis through c, then translated by t: p = c + t + (1 + s / z) R (p0 - c). The moved
    scene has the pivot c + t and knows the size, so that its slopes are those of the steps. Steps of
    rotate about several axes are one rotation vector w [radians], R = exp([w]x).
    """

    def __init__(self, scene: Scene, numbers: Mapping[str, Any]) -> None:
        self.numbers = dict(numbers)
        self.steps: dict[str, float] = {}
        check_names(scene, self.numbers)
        for name, value in self.numbers.items():
            start: Any = scene[name]
            if start is not None and not _moves_shape(scene, name):
                continue
            if scene.parameters[name].shape != () or not _MOTION.search(name):
                raise InputError(f'parameter "{name}" has no value to give')
            if value.size != 1:
                raise InputError(f'parameter "{name}" takes one number, not {value.shape}')
            self.steps[name] = float(value.reshape(())) - (start or 0.0)
        self._check()

    @staticmethod
    def split(name: str) -> tuple[str, str]:
        """The object and the kind of its motion."""
        owner, kind = name.removesuffix(".scale"), "scale"
        if owner == name:
            owner, kind, _ = name.rsplit(".", 2)
        return owner, kind

    def _check(self) -> None:
        for owner in {self.split(n)[0] for n in self.steps}:
            if f"{owner}.vertex_positions" in self.numbers:
                raise InputError(f"{owner}: vertex positions and a motion of the same shape")

    def _turns(self) -> dict[str, Any]:
        """Rotation vectors of what turns about more than one axis."""
        turns: dict[str, Any] = {}
        for name, step in self.steps.items():
            owner, kind = self.split(name)
            if kind == "rotate":
                turns.setdefault(owner, {})["xyz".index(name[-1])] = step
        return {owner: np.array([of.get(k, 0.0) for k in range(3)])
                for owner, of in turns.items() if len(of) > 1}  # fmt: skip

    def moved(self, scene: Scene) -> Scene:
        """A copy of the scene with all that is given."""
        scene = scene.copy()
        for name, value in self.numbers.items():
            if name not in self.steps:
                scene[name] = value
        steps = dict(self.steps)
        for owner, w in self._turns().items():
            for axis, angle in zip("xyz", _angles(_rotation(w)[0])):
                steps[f"{owner}.rotate.{axis}"] = angle
        for name in sorted(steps, key=lambda n: (_ORDER[self.split(n)[1]], n)):
            scene.move(name, steps[name])
        return scene

    def needed(self, wanted: Iterable[str]) -> list[str]:
        """The derivatives of the moved scene from which those of the steps follow."""
        names = list(wanted)
        for owner in self._turns():
            axes = [f"{owner}.rotate.{axis}" for axis in "xyz"]
            if any(name in names for name in axes):
                names += [name for name in axes if name not in names]
        return names

    def slopes(self, found: Mapping[str, Any]) -> dict[str, Any]:
        """Of the numbers, from the moved scene's derivatives."""
        slopes = dict(found)
        for owner, w in self._turns().items():
            axes = [f"{owner}.rotate.{axis}" for axis in "xyz"]
            if axes[0] in found:
                about = np.array([float(found[name]) for name in axes])
                slopes.update(zip(axes, _rotation(w)[1].T @ about))
        return slopes
