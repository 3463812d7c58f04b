"""Steps of a scene's motions, and the slopes of a loss with respect to them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from ._limn import Scene, backward
from .errors import InputError

_MOTION = re.compile(r"\.(scale|(rotate|translate)\.[xyz])$")
_ORDER = {"scale": 0, "rotate": 1, "translate": 2}


def _moves_shape(scene: Scene, name: str) -> bool:
    return ".translate." in name and name.rsplit(".", 2)[0] in scene.shapes


def per_number(slope: Any, shape: tuple[int, ...]) -> Any:
    """A derivative in the shape of what was given: one number sets all channels of a colour."""
    slope = np.asarray(slope)
    return (slope if slope.size == np.prod(shape) else slope.sum()).reshape(shape)


def _center(scene: Scene, shape: str) -> Any:
    positions = scene.mesh(shape).positions.astype(np.float64)
    return (positions.min(axis=0) + positions.max(axis=0)) / 2


class Motions:
    """What is given for the parameters of a scene: values, and steps of motions.

    A shape is scaled by 1 + s about the center c of its bounds, turned about an axis through c, then
    translated by t: p = c + t + (1 + s) R (p0 - c). In the moved scene limn's
    own rotation and scale are about c', the center of its bounds. Those about c + t differ by
    translations: e x (p - c - t) = e x (p - c') + e x (c' - c - t), and likewise of scales.
    """

    def __init__(self, scene: Scene, numbers: Mapping[str, Any]) -> None:
        self.numbers = dict(numbers)
        self.steps: dict[str, float] = {}
        for name, value in self.numbers.items():
            start: Any = scene[name]
            if start is not None and not _moves_shape(scene, name):
                continue
            if scene.parameters[name].shape != () or not _MOTION.search(name):
                raise InputError(f'parameter "{name}" has no value to give')
            if value.size != 1:
                raise InputError(f'parameter "{name}" takes one number, not {value.shape}')
            self.steps[name] = float(value.reshape(())) - (start or 0.0)
        self.centers = {s: _center(scene, s) for s in scene.shapes if self._of(s)}
        self._check()

    def _of(self, owner: str) -> list[str]:
        return [n for n in self.steps if self.split(n)[0] == owner]

    @staticmethod
    def split(name: str) -> tuple[str, str, int]:
        """The object, the kind of its motion, and the axis."""
        if name.endswith(".scale"):
            return name[: -len(".scale")], "scale", 0
        owner, kind, axis = name.rsplit(".", 2)
        return owner, kind, "xyz".index(axis)

    def _check(self) -> None:
        for owner in {self.split(n)[0] for n in self.steps}:
            turns = [n for n in self._of(owner) if self.split(n)[1] == "rotate"]
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

    def names_for(self, wanted: list[str]) -> list[str]:
        """What limn.backward is to differentiate, so that `slope` knows all of these."""
        names = list(wanted)
        for name in wanted:
            owner = self.split(name)[0] if name in self.steps else None
            if owner in self.centers:
                names += [f"{owner}.translate.{axis}" for axis in "xyz"]
        return list(dict.fromkeys(names))

    def backward(self, scene: Scene, adjoint: Any, wanted: list[str], spp: int | None, seed: int,
                 threads: int) -> dict[str, Any]:
        """The derivatives with respect to what was given; scene: the one that came out."""
        slopes = backward(scene, adjoint, self.names_for(wanted), spp=spp, seed=seed,
                          threads=threads)
        return {n: self.slope(n, slopes, scene) for n in wanted}

    def slope(self, name: str, slopes: Mapping[str, Any], scene: Scene) -> Any:
        slope = slopes[name].value
        owner, kind, axis = self.split(name) if name in self.steps else ("", "", 0)
        if owner not in self.centers or kind == "translate":
            return slope
        shift = [self.steps.get(f"{owner}.translate.{k}", 0.0) for k in "xyz"]
        off = _center(scene, owner) - self.centers[owner] - shift
        along = np.array([float(slopes[f"{owner}.translate.{k}"].value) for k in "xyz"])
        if kind == "rotate":
            return slope + np.dot(np.cross(np.eye(3)[axis], off), along)
        return (slope + np.dot(off, along)) / (1 + self.steps[name])
