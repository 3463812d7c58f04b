"""Scenes as dictionaries, in the words of Mitsuba's load_dict, for limn's subset."""

from __future__ import annotations

import numbers
import os
import re
import tempfile
import warnings
from collections.abc import Mapping, Sequence
from typing import Any, overload
from xml.sax.saxutils import quoteattr

import numpy as np
import numpy.typing as npt

from ._limn import Scene, advice_on, load_placed, write_exr
from .errors import InputError
from .meshes import read_foreign, write_ply

# The element that each type is written as: the types that the reader of files knows.
TYPES = {
    "integrator": ["aov", "direct", "direct_projective", "direct_reparam", "moment", "path", "prb",
                   "prb_basic", "prb_projective", "prb_reparam", "prbvolpath", "ptracer", "volpath",
                   "volpathmis"],
    "sensor": ["perspective", "batch", "orthographic", "thinlens"],
    "film": ["hdrfilm"],
    "rfilter": ["box", "catmullrom", "gaussian", "lanczos", "mitchell", "tent"],
    "sampler": ["independent", "ldsampler", "multijitter", "orthogonal", "stratified"],
    "shape": ["bsplinecurve", "cube", "cylinder", "disk", "instance", "linearcurve", "obj", "ply",
              "rectangle", "serialized", "shapegroup", "sphere"],
    "bsdf": ["blendbsdf", "bumpmap", "conductor", "dielectric", "diffuse", "mask", "normalmap",
             "null", "plastic", "principled", "principledthin", "roughconductor",
             "roughdielectric", "roughplastic", "thindielectric", "twosided"],
    "emitter": ["area", "constant", "directional", "envmap", "point", "projector",
                "spot"],
    "texture": ["bitmap", "checkerboard", "mesh_attribute"],
    "spectrum": ["blackbody", "d65", "irregular", "rawconstant", "regular", "srgb", "uniform"],
}
_TAGS = {type_: tag for tag, types in TYPES.items() for type_ in types}
# What has parameters to be named.
_NAMED = {"shape", "bsdf", "emitter", "sensor"}
# Other names of a mesh's arrays.
_MESH_NAMES = {"positions": "vertices", "vertex_positions": "vertices",
               "normals": "vertex_normals", "texcoords": "vertex_texcoords"}
# What elements are in a dictionary.
_WORDS = {"rgb": '{"type": "rgb", "value": [...]}', "spectrum": '{"type": "spectrum", ...}',
          "float": "a number", "integer": "an integer", "boolean": "True or False",
          "string": "a string", "point": "three numbers", "transform": "a Transform"}

Three = Sequence[float] | npt.NDArray[Any]


def _three(v: float | Three) -> str:
    values = np.atleast_1d(np.asarray(v, dtype=float))
    return " ".join(repr(float(x)) for x in values.reshape(-1))


def _matrix(value: Any) -> npt.NDArray[Any] | None:
    """(4, 4) or (3, 3) numbers, also of Mitsuba's transforms; None of anything else."""
    matrix = getattr(value, "matrix", value)
    try:
        shape = np.shape(matrix)
    except ValueError:  # rows of several lengths
        return None
    if shape not in ((4, 4), (3, 3), (4, 4, 1), (3, 3, 1)):
        return None
    return np.asarray(matrix).reshape(shape[:2])


def _is_point(value: Any) -> bool:
    try:
        return np.shape(value) in ((3,), (3, 1))
    except ValueError:
        return False


def _pixels(image: Any, raw: bool) -> npt.NDArray[Any]:
    """Linear (H, W, 1 or 3) pixels of an array, or of Mitsuba's Bitmap. Bytes are sRGB unless raw."""
    array = np.asarray(image)
    if array.ndim == 2:
        array = array[:, :, None]
    if array.ndim != 3 or not 1 <= array.shape[2] <= 4 or array.dtype.kind not in "fu":
        raise InputError(f"pixels have shape (H, W, 1 to 4), not {array.shape} of {array.dtype}")
    array = array[:, :, : 3 if array.shape[2] > 2 else 1]  # without alpha
    if array.dtype.kind == "f":
        return array.astype(np.float32)
    encoded = array / np.iinfo(array.dtype).max
    is_srgb = getattr(image, "srgb_gamma", lambda: array.dtype == np.uint8)()
    if raw or not is_srgb:
        return encoded.astype(np.float32)
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    return linear.astype(np.float32)


def _unit(v: npt.NDArray[np.float64], wrong: str) -> npt.NDArray[np.float64]:
    length = np.linalg.norm(v)
    if length == 0:
        raise InputError(wrong)
    return v / length


def _step_matrix(tag: str, attributes: Mapping[str, str]) -> npt.NDArray[np.float64]:
    """(4, 4) of one step of a Transform, as the reader of files makes it."""
    values = {k: np.array(v.split(), dtype=float) for k, v in attributes.items()}
    made = np.eye(4)
    if tag == "matrix":
        size = 3 if len(values["value"]) == 9 else 4
        made[:size, :size] = values["value"].reshape(size, size)
    elif tag == "translate":
        made[:3, 3] = values["value"]
    elif tag == "scale":
        made[:3, :3] = np.diag(np.broadcast_to(values["value"], 3))
    elif tag == "rotate":
        x, y, z = axis = _unit(values["value"], "rotate: the axis is zero")
        turn, cross = np.radians(values["angle"][0]), np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        made[:3, :3] = (np.cos(turn) * np.eye(3) + np.sin(turn) * cross
                        + (1 - np.cos(turn)) * np.outer(axis, axis))  # fmt: skip
    else:  # lookat
        ahead = _unit(values["target"] - values["origin"], "look_at: origin and target are equal")
        left = _unit(np.cross(values["up"], ahead), "look_at: up lies along the view")
        made[:3] = np.column_stack([left, np.cross(ahead, left), ahead, values["origin"]])
    return made


class Transform:
    """A transformation of space, made of steps as Mitsuba's ScalarTransform4f is.

        limn.Transform().translate([0, 1, 0]).rotate([0, 1, 0], 30)    # turns, then moves

    `a @ b` does b first; `a @ point` is where a point (3,) goes, or each row of (N, 3).
    """

    def __init__(self, matrix: npt.ArrayLike | None = None) -> None:
        """The identity, or a (4, 4) or (3, 3) matrix."""
        self._steps: tuple[tuple[str, dict[str, str]], ...] = ()
        if matrix is not None:
            values = np.asarray(matrix, dtype=float).reshape(-1)
            self._steps = (("matrix", {"value": _three(values)}),)

    @property
    def matrix(self) -> npt.NDArray[np.float64]:
        """(4, 4), from the space of what is transformed to the world, for columns."""
        product = np.eye(4)
        for tag, attributes in self._steps:
            product = _step_matrix(tag, attributes) @ product
        return product

    def inverse(self) -> Transform:
        """What undoes it."""
        return Transform(np.linalg.inv(self.matrix))

    def __repr__(self) -> str:
        return f"limn.Transform({self.matrix.tolist()})"

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> npt.NDArray[Any]:
        return np.asarray(self.matrix, dtype)

    @overload
    def __matmul__(self, first: Transform) -> Transform: ...

    @overload
    def __matmul__(self, first: npt.ArrayLike) -> npt.NDArray[np.float64]: ...

    def __matmul__(self, first: Transform | npt.ArrayLike) -> Transform | npt.NDArray[np.float64]:
        if not isinstance(first, Transform):
            points = np.asarray(first, dtype=float)
            if points.ndim not in (1, 2) or points.shape[-1] != 3:
                raise InputError(f"points have shape (3,) or (N, 3), not {points.shape}")
            moved = points @ self.matrix[:, :3].T + self.matrix[:, 3]
            return np.asarray(moved[..., :3] / moved[..., 3:])
        both = Transform()
        both._steps = first._steps + self._steps
        return both

    def _then(self, tag: str, **attributes: str) -> Transform:
        step = Transform()
        step._steps = ((tag, attributes),)
        return self @ step

    def translate(self, v: Three) -> Transform:
        """Moves by v [scene units]."""
        return self._then("translate", value=_three(v))

    def rotate(self, axis: Three, angle: float) -> Transform:
        """Turns about an axis through the origin [degrees]."""
        return self._then("rotate", value=_three(axis), angle=repr(float(angle)))

    def scale(self, v: float | Three) -> Transform:
        """Scales by one factor, or one for each axis."""
        return self._then("scale", value=_three(v))

    def look_at(self, origin: Three, target: Three, up: Three) -> Transform:
        """From a camera's space (+Z along the view, +Y up) to the world."""
        return self._then("lookat", origin=_three(origin), target=_three(target), up=_three(up))


def _checked(place: str, name: Any) -> str:
    """A name, which must not hold what stands for a scene's parameter."""
    if not isinstance(name, str):
        raise InputError(f"{place}: error: a name must be a word, not {type(name).__name__}")
    if "$" in name:
        raise InputError(f'{place}: error: "$" cannot be in the name "{name}"')
    return name


class _Writer:
    """XML with one element a line, and for each line what it came from.

    Files are in `folder`; meshes and images of the dictionary become files in `scratch`.
    """

    def __init__(self, folder: str, scratch: str) -> None:
        self.folder, self.scratch = folder, scratch
        self.lines: list[str] = []
        self.places: list[str] = []
        self.files: dict[str, str] = {}  # the place of each mesh and image
        self.errors: list[str] = []

    def line(self, place: str, text: str) -> None:
        self.lines.append(text)
        self.places.append(place)

    def element(self, place: str, tag: str, end: str = "/", **attributes: str) -> None:
        words = "".join(f" {k}={quoteattr(v)}" for k, v in attributes.items())
        self.line(place, f"<{tag}{words}{end}>")

    def object(self, place: str, name: str, what: Mapping[str, Any]) -> None:
        if what.get("type") == "mesh":
            what = self.mesh(place, what)
        kind = what.get("type")
        if not isinstance(kind, str):
            raise InputError(f'{place}: error: expected a word for "type", not {kind!r}')
        if kind == "ref":
            self.element(place, "ref", id=_checked(f"{place}.id", what.get("id", "")))
            return
        if kind in ("rgb", "spectrum"):
            self.element(place, kind, name=name, **self.colour(place, kind, what))
            return
        if kind in ("bitmap", "envmap") and ("bitmap" in what or "data" in what):
            what = self.image(place, what)
        if kind not in _TAGS:
            known = ", ".join(sorted([*_TAGS, "mesh", "ref", "rgb"]))
            hint = '; "mesh" reads STL, glTF, ...' if "filename" in what else ""
            raise InputError(f'{place}: error: unknown type "{kind}" (known: {known}{hint})'
                             + advice_on(kind))
        tag = _TAGS[kind]
        attributes = {"type": kind}
        if tag in ("spectrum", "texture"):
            attributes["name"] = name
        if tag in _NAMED:
            own = what.get("id", place.removeprefix("dict."))
            attributes["id"] = _checked(f"{place}.id", own)
        self.element(place, tag, "", **attributes)
        self.entries(place, what, ("type", "id"))
        self.line(place, f"</{tag}>")

    def entries(self, place: str, what: Mapping[str, Any], known: Sequence[str]) -> None:
        """All but the known ones. Errors of each are kept, so that one call reports all."""
        for key, value in what.items():
            if key in known:
                continue
            try:
                if place == "dict" and not isinstance(value, (Mapping, bool)):
                    raise InputError(f"dict.{key}: error: expected a dictionary with a type")
                self.value(f"{place}.{key}", _checked(f"{place}.{key}", key), value)
            except InputError as error:
                self.errors.append(str(error))

    def mesh(self, place: str, what: Mapping[str, Any]) -> dict[str, Any]:
        """The same shape with a mesh that limn reads: of a file, or of arrays."""
        names: dict[str, str] = {}
        for k in what:
            other = names.setdefault(_MESH_NAMES.get(k, k), k)
            if other != k:
                raise InputError(f"{place}: error: {other} and {k} are names of the same array")
        what = {name: what[k] for name, k in names.items()}
        own = [k for k in what if k.startswith(("vertex_", "face_")) and k != "face_normals"]
        rest = {k: v for k, v in what.items() if k not in ("vertices", "faces", "filename", *own)}
        file = what.get("filename")
        if (file is None) != ("vertices" in what and "faces" in what):
            raise InputError(f"{place}: error: give vertices and faces, or a filename")
        if file is not None and own:
            raise InputError(f"{place}.{own[0]}: error: attributes go with vertices and faces")
        if isinstance(file, str) and file.lower().endswith((".obj", ".ply")):
            return {**rest, "type": file.lower()[-3:], "filename": file}
        path = os.path.join(self.scratch, f"{len(self.files)}.ply")
        self.files[path] = place
        try:
            if file is None:
                write_ply(path, what["vertices"], what["faces"], **{k: what[k] for k in own})
            else:
                points, faces, found, dropped = read_foreign(os.path.join(self.folder, file))
                write_ply(path, points, faces, **found)
                if dropped:
                    warnings.warn(f"{place}: warning: {file} has {', '.join(dropped)}, which limn "
                                  "does not take", stacklevel=2)
        except (TypeError, ValueError) as error:
            raise InputError(f"{place}: error: {error}") from None
        return {**rest, "type": "ply", "filename": path}

    def colour(self, place: str, kind: str, what: Mapping[str, Any]) -> dict[str, str]:
        """Attributes of an rgb or spectrum element: of numbers, pairs (wavelength, value), a file."""
        if kind == "spectrum" and "filename" in what:
            return {"filename": os.fspath(what["filename"])}
        value = what.get("value", ())
        try:
            if kind == "rgb" or np.size(value) == 1:
                return {"value": value if isinstance(value, str) else _three(value)}
            pairs = value if isinstance(value, str) else ", ".join(
                f"{float(at)!r}:{float(v)!r}" for at, v in value)
            return {"value": pairs}
        except (TypeError, ValueError):
            known = ("one number, or pairs of a wavelength and a number" if kind == "spectrum"
                     else "one or three numbers")
            raise InputError(
                f"{place}.value: error: expected {known}, not {value!r}"
            ) from None

    def image(self, place: str, what: Mapping[str, Any]) -> dict[str, Any]:
        """The same texture or map with a file that limn reads, of pixels."""
        rest = {k: v for k, v in what.items() if k not in ("bitmap", "data")}
        path = os.path.join(self.scratch, f"{len(self.files)}.exr")
        self.files[path] = place
        try:
            write_exr(path, _pixels(what.get("bitmap", what.get("data")), bool(what.get("raw"))))
        except (TypeError, ValueError) as error:
            raise InputError(f"{place}: error: {error}") from None
        return {**rest, "filename": path}

    def value(self, place: str, name: str, value: Any) -> None:
        if isinstance(value, Mapping):
            self.object(place, name, value)
        elif isinstance(value, Transform):
            self.element(place, "transform", "", name=name)
            for tag, attributes in value._steps:
                self.element(place, tag, **attributes)
            self.line(place, "</transform>")
        elif isinstance(value, str):
            self.element(place, "string", name=name, value=value.replace("$", r"\$"))
        elif isinstance(value, (bool, np.bool_)):
            self.element(place, "boolean", name=name, value="true" if value else "false")
        elif isinstance(value, numbers.Integral):
            self.element(place, "integer", name=name, value=str(int(value)))
        elif isinstance(value, numbers.Real):
            self.element(place, "float", name=name, value=repr(float(value)))
        elif (matrix := _matrix(value)) is not None:
            self.value(place, name, Transform(matrix))
        elif isinstance(value, os.PathLike):
            self.value(place, name, os.fspath(value))
        elif _is_point(value):
            self.element(place, "point", name=name, value=_three(value))
        else:
            raise InputError(
                f"{place}: error: expected a number, a string, three numbers, a Transform, a (4, 4) or "
                f"(3, 3) array, or a dictionary with a type, not {type(value).__name__}"
            )


def load_dict(scene: Mapping[str, Any], folder: str = "") -> Scene:
    """Reads a scene from a dictionary, as Mitsuba's load_dict does, for limn's subset.

        limn.load_dict({
            "type": "scene",
            "sensor": {"type": "perspective", "fov": 40,
                       "to_world": limn.Transform().look_at([0, 1, 4], [0, 0, 0], [0, 1, 0]),
                       "film": {"type": "hdrfilm", "width": 64, "height": 64}},
            "ball": {"type": "sphere", "bsdf": {"type": "diffuse",
                     "reflectance": {"type": "rgb", "value": [0.7, 0.5, 0.3]}}},
            "sky": {"type": "constant"},
        })

    Keys are the names of shapes, materials and lights; those inside others have names with a dot
    ("ball.bsdf.reflectance"), unless they say "id". {"type": "ref", "id": ...} names one that stands
    before. {"type": "mesh", "vertices": (V, 3), "faces": (F, 3)} is a shape of arrays, with the
    attributes of write_ply ("vertex_color", ...); with a "filename" in their place it is one of a
    file, of STL, glTF and other formats if trimesh is installed, with their normals, texture
    coordinates and colours of vertices. Files are looked for in `folder`.
    Raises limn.InputError with the place: dict.ball.bsdf.
    """
    if not isinstance(scene, Mapping) or scene.get("type") != "scene":
        kind = scene.get("type") if isinstance(scene, Mapping) else None
        inside = f'"name": {{"type": "{kind}", ...}}, ' if kind in (*_TAGS, "mesh") else ""
        raise InputError(f'dict: error: expected {{"type": "scene", {inside}...}}')
    with tempfile.TemporaryDirectory(prefix="limn_") as scratch:
        return _load(scene, _Writer(os.fspath(folder), scratch))


def _load(scene: Mapping[str, Any], writer: _Writer) -> Scene:
    writer.line("dict", '<scene version="3.0.0">')
    writer.entries("dict", scene, ("type",))
    if writer.errors:
        raise InputError("\n".join(writer.errors))
    writer.line("dict", "</scene>")

    def placed(text: str) -> str:
        for file, place in writer.files.items():
            text = text.replace(file, place)
        text = re.sub("must be given as .*", lambda m: re.sub(
            r"<(\w+)>", lambda tag: _WORDS.get(tag[1], tag[0]), m[0]), text)
        return re.sub(
            r"[^\s\"]*string:(\d+)(:\d+)?", lambda m: writer.places[int(m.group(1)) - 1], text
        )

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            read = load_placed("\n".join(writer.lines), writer.folder, writer.places)
        except InputError as error:
            raise type(error)(placed(str(error))) from None
    for warning in caught:
        warnings.warn(placed(str(warning.message)), stacklevel=3)
    return read
