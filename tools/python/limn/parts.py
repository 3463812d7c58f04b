"""Runs in parts, for any machines: see limn.part."""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from ._limn import PartWriter, Scene, backward, gradient, read_parts, render
from .errors import InputError

_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "backward": backward,
    "gradient": gradient,
    "render": render,
}


@dataclass(frozen=True)
class Part:
    """Part `k` of `n` of a run: what it computes, and the sums of its batches. It pickles."""

    k: int
    n: int
    function: str
    arguments: tuple[Any, ...] = field(repr=False)
    keywords: dict[str, Any] = field(repr=False)
    data: bytes = field(repr=False)


def part(
    of: tuple[int, int],
    function: Callable[..., Any],
    scene: Scene,
    *arguments: Any,
    threads: int = 0,
    progress: Callable[[float], object] | None = None,
    **keywords: Any,
) -> Part:
    """Part k of n, `of` = (k, n) with k from 1, of function(scene, ...), by itself.

        parts = [limn.part((k, 3), limn.gradient, scene, "ball.translate.x", spp=64)
                 for k in (1, 2, 3)]
        limn.merge(parts, scene)    # the very bits of limn.gradient(scene, ...)

    function: limn.render, limn.gradient or limn.backward, with its own arguments but for `seconds`.
    Parts are shares of the samples, in whole batches. They pickle, so that another process can make
    them; what comes before samples (edges, a pilot) every part does again, with the same outcome.
    """
    if _FUNCTIONS.get(function.__name__) is not function:
        raise InputError(f"{function.__name__}: parts are made of {', '.join(_FUNCTIONS)}")
    writer = PartWriter(*of)
    function(scene, *arguments, threads=threads, progress=progress, _store=writer, **keywords)
    given = copy.deepcopy((arguments, keywords))  # a later change would be one of the run
    return Part(*of, function.__name__, *given, writer.bytes())


def merge(parts: Sequence[Part], scene: Scene, threads: int = 0) -> Any:
    """Joins all parts of a run, in any order: what the run gives as a whole, to the bit.

    scene: that of the parts. Raises limn.InputError that says which part is missing, there twice,
    or of another run.
    """
    reader = read_parts([p.data for p in parts])
    first = parts[0]
    run = _FUNCTIONS[first.function]
    return run(scene, *first.arguments, threads=threads, _store=reader, **first.keywords)
