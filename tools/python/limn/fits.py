"""Fits in one call: see limn.fit."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from ._limn import Fit, FitRecord, Scene


def fit(
    scene: Scene,
    target: Any,
    names: str | Sequence[str],
    steps: int = 300,
    callback: Callable[[FitRecord], object] | None = None,
    **options: Any,
) -> Fit:
    """Moves parameters towards a target for some steps: Fit(scene, target, names, ...).run(steps).

    options: those of limn.Fit; callback(record) after each step. What came of it is in the
    `scenes`, `values` and `history` of what is returned. To keep what Ctrl-C leaves, make a
    limn.Fit and call its run().
    """
    made = Fit(scene, target, names, **options)
    made.run(steps, callback)
    return made
