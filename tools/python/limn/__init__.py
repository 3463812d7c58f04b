"""Path tracing, and how its picture changes when the scene does.

    import limn
    scene = limn.load("scenes/demo.xml", width=128, height=96)
    image = limn.render(scene, spp=64)
    moved = limn.gradient(scene, "object.translate.y", spp=64)["object.translate.y"]
"""

from collections.abc import Mapping as _Mapping
from importlib import import_module as _import_module
from typing import TYPE_CHECKING as _TYPE_CHECKING

from . import _processor

__path__[:0] = _processor.choose()  # before what it checks for
from ._limn import (  # noqa: E402
    Baked,
    Check,
    ComparedMethod,
    Comparison,
    Estimate,
    FacesCheck,
    Fit,
    FitRecord,
    Loss,
    Mesh,
    Parameter,
    Parameters,
    Scene,
    TimeBudget,
    backward,
    bake,
    check,
    compare,
    coverage,
    gradient,
    image_loss,
    info,
    layers,
    load,
    load_string,
    mesh_distance,
    methods,
    read_alpha,
    read_exr,
    read_image,
    remesh,
    render,
    version as __version__,
    write_exr,
    write_png,
    write_signed_png,
)
from .dicts import Transform, load_dict
from .errors import InputError, NonFiniteError, UnknownParameterError
from .fits import fit
from .images import write_image
from .meshes import write_ply
from .parts import Part, merge, part
from .reconstruction import Reconstruction, reconstruct

__all__ = [
    "Baked",
    "Check",
    "ComparedMethod",
    "Comparison",
    "Estimate",
    "FacesCheck",
    "Fit",
    "FitRecord",
    "InputError",
    "Loss",
    "Mesh",
    "NonFiniteError",
    "Parameter",
    "Parameters",
    "Part",
    "Reconstruction",
    "Scene",
    "TimeBudget",
    "Transform",
    "UnknownParameterError",
    "backward",
    "bake",
    "check",
    "compare",
    "coverage",
    "fit",
    "gradient",
    "image_loss",
    "info",
    "layers",
    "load",
    "load_dict",
    "load_string",
    "merge",
    "mesh_distance",
    "methods",
    "part",
    "read_alpha",
    "read_exr",
    "read_image",
    "reconstruct",
    "remesh",
    "render",
    "write_exr",
    "write_image",
    "write_ply",
    "write_png",
    "write_signed_png",
]

_Mapping.register(Parameters)

# limn.torch and limn.jax import PyTorch and JAX when they are first named. Type checkers see none of
# this, or they would take any name for one of limn's.
if not _TYPE_CHECKING:

    def __getattr__(name: str) -> object:
        if name in ("jax", "torch"):
            return _import_module(f"{__name__}.{name}")
        if name == "load_file":
            raise AttributeError("limn has no load_file: limn.load reads files")
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
