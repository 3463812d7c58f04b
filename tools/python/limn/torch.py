"""Pictures of a scene as PyTorch tensors that know their gradient.

    v = torch.tensor(scene["ball.vertex_positions"], requires_grad=True)
    image = limn.torch.render(scene, {"ball.vertex_positions": v}, spp=16, seed=i)
    ((image - target) ** 2).mean().backward()       # v.grad

torch.tensor copies; torch.from_numpy would share the scene's memory, which must not change.
Naming limn.torch imports torch, `import limn` does not.
"""

from __future__ import annotations

import atexit
import weakref
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import torch

from . import Scene, backward as _backward, render as _render
from .motions import Motions, per_number

__all__ = ["pose", "render"]


# PyTorch never frees the graphs that are alive when Python ends. Scenes are taken out of them
# before, or nanobind would report a leak.
class _Held:
    def __init__(self, scene: Scene) -> None:
        self.scene: Scene | None = scene
        _all_held.add(self)


_all_held: weakref.WeakSet[_Held] = weakref.WeakSet()


@atexit.register
def _let_go() -> None:
    for held in list(_all_held):
        held.scene = None


class _Run(NamedTuple):
    """What `render` was called with, but for the tensors."""

    names: list[str]
    spp: int | None
    spp_grad: int | None
    seed: int
    threads: int


class _Render(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, scene: Scene, run: _Run, *tensors: Any) -> Any:
        # Through float64: numpy does not know bfloat16.
        numbers = {
            n: t.detach().to("cpu", torch.float64).numpy() for n, t in zip(run.names, tensors)
        }
        motions = Motions(scene, numbers)
        scene = motions.moved(scene)
        ctx.run = _Held(scene), run, motions
        ctx.save_for_backward(*tensors)
        return torch.from_numpy(_render(scene, run.spp, 2 * run.seed, threads=run.threads).value)

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, adjoint: Any) -> tuple[Any, ...]:
        held, run, motions = ctx.run
        wanted = [n for n, need in zip(run.names, ctx.needs_input_grad[2:]) if need]
        found = {}
        if wanted:
            found = _backward(held.scene, adjoint.cpu().numpy(), motions.needed(wanted),
                              spp=run.spp_grad, seed=2 * run.seed + 1, threads=run.threads)  # fmt: skip
        slopes = motions.slopes({n: estimate.value for n, estimate in found.items()})
        gradients = [
            _gradient(slopes[n], t) if n in slopes else None
            for n, t in zip(run.names, ctx.saved_tensors)
        ]
        return None, None, *gradients


def _gradient(value: Any, tensor: Any) -> Any:
    return torch.from_numpy(np.array(per_number(value, tuple(tensor.shape)))).to(tensor)


def _check(scene: Scene, values: Mapping[str, torch.Tensor]) -> None:
    if not isinstance(scene, Scene):
        raise TypeError(f"scene is a {type(scene).__name__}, not a limn.Scene (see limn.load)")
    if not isinstance(values, Mapping):
        raise TypeError(f"values is a {type(values).__name__}, not a mapping of names to tensors")
    for name, tensor in values.items():
        if not isinstance(tensor, torch.Tensor):
            raise TypeError(f'values["{name}"] is a {type(tensor).__name__}, not a torch.Tensor')
        if tensor.is_complex():
            raise TypeError(f'values["{name}"] is complex: parameters are real numbers')


def render(
    scene: Scene,
    values: Mapping[str, torch.Tensor],
    spp: int | None = None,
    spp_grad: int | None = None,
    seed: int = 0,
    threads: int = 0,
) -> torch.Tensor:
    """The image of `scene` with these values in place of its own: float32, (H, W, 3).

    values: tensors of the shapes that scene[name] has, of any real dtype and on any device (the
    image is on the CPU); one number sets all channels of a colour. The scene itself stays as it is.
    Of a parameter without a value (rotations, scales) it is the step by which it moves from where
    the scene has it; a shape is scaled first, then turned about its center (see Scene.move), then
    translated. Steps of rotate.x, .y and .z together are the axis of a rotation times its angle.
    spp, spp_grad: samples per pixel of the image and of its gradient; None: spp_grad as spp, spp as
    the scene says. The image has the seed 2 * seed, the gradient 2 * seed + 1: both are independent,
    so that the gradient is unbiased where the loss is linear in the image. For a squared difference
    render twice with seeds of their own and take ((a - target) * (b - target)).mean().
    """
    _check(scene, values)
    run = _Run(list(values), spp, spp if spp_grad is None else spp_grad, seed, threads)
    return _Render.apply(scene, run, *values.values())


def pose(
    positions: torch.Tensor, turn: torch.Tensor, shift: torch.Tensor | None = None
) -> torch.Tensor:
    """Positions (V, 3), turned about the center of their bounds and then moved by `shift`.

    turn: (3,), the axis of the rotation times its angle [radians]. Differentiable in all three, also
    where nothing turns.
    """
    x, y, z = turn
    zero = torch.zeros_like(x)
    cross = torch.stack([zero, -z, y, z, zero, -x, -y, x, zero]).reshape(3, 3)
    center = (positions.amin(0) + positions.amax(0)) / 2
    turned = (positions - center) @ torch.matrix_exp(cross).to(positions.dtype).T + center
    return turned if shift is None else turned + shift
