"""Arrays as the values of parameters."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np


class Array(np.ndarray):
    """The value of a parameter, which cannot be written. `scene[name] += x` makes a new array, which
    Python then assigns to the scene. What is computed from one is a plain array or number."""

    def __array_wrap__(self, a: Any, context: Any = None, return_scalar: bool = False) -> Any:
        return np.asarray(a) if a.ndim else a[()]

    def __setitem__(self, key: Any, value: Any) -> None:
        if not self.flags.writeable:
            raise ValueError("the value of a parameter is read-only: copy it "
                             "(a = scene[name].copy()), change that, then scene[name] = a")
        super().__setitem__(key, value)

    def __reduce_ex__(self, protocol: Any) -> Any:
        return np.array(self).__reduce_ex__(protocol)


def _in_place(name: str) -> Callable[[Any, Any], Any]:
    new, same = (getattr(np.ndarray, f"__{start}{name}__") for start in ("", "i"))
    return lambda self, other: (same if self.flags.writeable else new)(self, other)


for _name in ("add", "sub", "mul", "truediv", "floordiv", "mod", "pow", "matmul"):
    setattr(Array, f"__i{_name}__", _in_place(_name))
