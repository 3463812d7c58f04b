"""Images of a scene as JAX arrays that know their gradient.

    def loss(vertices):
        image = limn.jax.render(scene, {"ball.vertex_positions": vertices}, spp=16, seed=i)
        return ((image - target) ** 2).mean()

    slope = jax.grad(loss)(scene["ball.vertex_positions"])

Naming limn.jax imports jax, `import limn` does not.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.linalg import expm

from . import Scene, backward as _reverse, render as _render
from .motions import Motions, check_names, per_number

__all__ = ["pose", "render"]

_Shape: Any = jax.ShapeDtypeStruct  # which has no types


# What is no array: JAX takes calls with equal fields for the same.
@dataclass(frozen=True)
class _Call:
    scene: Scene
    spp: int | None
    spp_grad: int | None
    threads: int

    def motions(self, values: Mapping[str, Any]) -> Motions:
        return Motions(self.scene, {n: np.asarray(v, dtype=np.float64) for n, v in values.items()})

    def image(self, values: Mapping[str, Any], seed: Any) -> Any:
        moved = self.motions(values).moved(self.scene)
        return _render(moved, self.spp, 2 * int(seed), threads=self.threads).value

    def slopes(self, values: Mapping[str, Any], seed: Any, adjoint: Any) -> dict[str, Any]:
        motions = self.motions(values)
        found = _reverse(motions.moved(self.scene), np.asarray(adjoint), motions.needed(values),
                         spp=self.spp_grad, seed=2 * int(seed) + 1, threads=self.threads)
        slopes = motions.slopes({n: estimate.value for n, estimate in found.items()})
        return {n: per_number(slopes[n], v.shape).astype(v.dtype) for n, v in values.items()}


@partial(jax.custom_vjp, nondiff_argnums=(0,))
def _image(call: _Call, values: dict[str, Any], seed: Any) -> Any:
    shape = _Shape((call.scene.height, call.scene.width, 3), jnp.float32)
    return jax.pure_callback(call.image, shape, values, seed, vmap_method="sequential")


def _forward(call: _Call, values: dict[str, Any], seed: Any) -> Any:
    return _image(call, values, seed), (values, seed)


def _backward(call: _Call, kept: Any, adjoint: Any) -> Any:
    values, seed = kept
    shapes = {n: _Shape(v.shape, v.dtype) for n, v in values.items()}
    found = jax.pure_callback(call.slopes, shapes, values, seed, adjoint, vmap_method="sequential")
    return found, np.zeros(np.shape(seed), jax.dtypes.float0)


_image.defvjp(_forward, _backward)


def render(
    scene: Scene,
    values: Mapping[str, Any],
    spp: int | None = None,
    spp_grad: int | None = None,
    seed: Any = 0,
    threads: int = 0,
) -> Any:
    """The image of `scene` with these values in place of its own: float32, (H, W, 3).

    values, samples and seeds are those of limn.torch.render. `seed` may be traced, so that a
    function under jax.jit takes another one at each call; the scene is a constant of the function
    and must not change between its calls. jax.grad gives gradients with respect to all values; there
    are no forward and no second derivatives.
    """
    if not isinstance(scene, Scene):
        raise TypeError(f"scene is a {type(scene).__name__}, not a limn.Scene (see limn.load)")
    check_names(scene, values)
    arrays = {name: jnp.asarray(value, dtype=float) for name, value in values.items()}
    call = _Call(scene, spp, spp if spp_grad is None else spp_grad, threads)
    return _image(call, arrays, jnp.asarray(seed))


def pose(positions: Any, turn: Any, shift: Any = (0, 0, 0)) -> Any:
    """Positions (V, 3), turned about the center of their bounds and then moved by `shift`.

    turn: (3,), the axis of the rotation times its angle [radians]. Differentiable in all three, also
    where nothing turns.
    """
    x, y, z = jnp.asarray(turn, dtype=float)
    zero = jnp.zeros_like(x)
    rotation = expm(jnp.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]))
    center = (positions.min(axis=0) + positions.max(axis=0)) / 2
    return (positions - center) @ rotation.T + center + jnp.asarray(shift, dtype=float)
