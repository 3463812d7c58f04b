"""Arrays as the values of parameters."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np


class Array(np.ndarray):
    """The value of a parameter, which cannot be written. `scene[name] += x` makes a new array, which
    Python then assigns to the scene."""


def _in_place(name: str) -> Callable[[Any, Any], Any]:
    new, same = (getattr(np.ndarray, f"__{start}{name}__") for start in ("", "i"))
    return lambda self, other: (same if self.flags.writeable else new)(self, other)


for _name in ("add", "sub", "mul", "truediv", "pow", "matmul"):
    setattr(Array, f"__i{_name}__", _in_place(_name))
