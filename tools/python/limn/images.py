"""Images as files by their endings, and in notebooks."""

from __future__ import annotations

import os
import tempfile
from typing import Any

import numpy as np
import numpy.typing as npt

from ._limn import Estimate, write_exr, write_png, write_signed_png
from .errors import InputError


def write_image(file: str | os.PathLike[str], image: npt.ArrayLike) -> None:
    """Writes (H, W, 3), (H, W, 1) or (H, W) pixels: .exr as floats, .png as limn.write_png does,
    and an Estimate of a derivative to .png as limn.write_signed_png does."""
    ending = os.path.splitext(os.fspath(file))[1]
    if ending == ".exr":
        write_exr(file, image)
    elif ending == ".png":
        _write_picture(file, image)
    else:
        raise InputError(f'{os.fspath(file)}: error: unknown ending "{ending}" (known: .exr, .png)')


def _write_picture(file: str | os.PathLike[str], image: npt.ArrayLike) -> None:
    if isinstance(image, Estimate) and image.is_derivative:
        write_signed_png(file, image)
    else:
        write_png(file, image)


def _png(image: npt.ArrayLike) -> bytes:
    with tempfile.TemporaryDirectory(prefix="limn_") as folder:
        file = os.path.join(folder, "image.png")
        _write_picture(file, image)
        with open(file, "rb") as stream:
            return stream.read()


def _repr_png(estimate: Estimate) -> bytes | None:
    """What a notebook shows; None for what is no image."""
    return _png(estimate) if len(estimate.shape) == 3 else None


setattr(Estimate, "_repr_png_", _repr_png)


class Picture(np.ndarray):
    """An array of radiance that notebooks show."""

    def _repr_png_(self) -> bytes | None:
        if self.ndim != 3 or self.shape[2] > 3 or self.size == 0:
            return None
        shown = self.shown()
        if shown.shape[2] == 2:
            shown = np.concatenate([shown, np.zeros_like(shown[:, :, :1])], axis=2)
        return _png(shown)

    def shown(self) -> npt.NDArray[Any]:
        """What it is as radiance."""
        return np.asarray(self)


class Layer(Picture):
    """One of limn.layers: notebooks show it from black at its least to white at its largest value."""

    def shown(self) -> npt.NDArray[Any]:
        values = np.asarray(self)
        least, most = values.min(), values.max()
        return np.asarray((values - least) / (most - least or 1))
