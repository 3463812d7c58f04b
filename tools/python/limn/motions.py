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


class Motions:
    """What is given for the parameters of a scene: values, and steps of motions.

    A shape of the size z (1 at first) is scaled by 1 + s / z about its pivot c (Scene.move), turned
    about an axis through c, then translated by t: p = c + t + (1 + s / z) R (p0 - c). The moved
    scene has the pivot c + t and knows the size, so that its slopes are those of the steps.
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
            turns = [n for n in self.steps if self.split(n) == (owner, "rotate")]
            if len(turns) > 1:
                raise InputError(f"{' and '.join(turns)}: rotations about one axis at a time")
            if f"{owner}.vertex_positions" in self.numbers:
                raise InputError(f"{owner}: vertex positions and a motion of the same shape")

    def moved(self, scene: Scene) -> Scene:
        """A copy of the scene with all that is given."""
        scene = scene.copy()
        for name, value in self.numbers.items():
            if name not in self.steps:
                scene[name] = value
        for name in sorted(self.steps, key=lambda n: _ORDER[self.split(n)[1]]):
            scene.move(name, self.steps[name])
        return scene
