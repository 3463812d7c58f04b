"""Forward derivatives along directions of parameters that are in memory."""

import pickle
import re

import limn
import numpy as np
import pytest
from test_scene import same
from test_texels import sky  # noqa: F401

RNG = np.random.default_rng(5)
VERTICES = RNG.normal(size=(6, 3))
VERTICES[4] = VERTICES[0]  # its copy


def equal(a, b):
    return same(a.value, b.value) and same(a.stderr, b.stderr)


@pytest.mark.parametrize("arguments", [
    {"spp": 16}, {"spp": 8, "method": "fd"}, {"spp": 8, "method": "blurred"},
    {"spp": 4, "terms": ["camera"]},
])
def test_a_field_of_vertices_has_the_bits_of_its_file(folder, arguments):
    flat = '<boolean name="face_normals" value="true"/>'
    text = (folder / "scene.xml").read_text().replace('<ref id="metal"/>', f'<ref id="clay"/>{flat}')
    text = re.sub('type="sphere".*\n.*center.*', """type="rectangle" id="ball"><transform name="to_world">
        <rotate x="1" angle="80"/><translate x="2" y="4"/></transform>""", text)
    scene = limn.load_string(text, folder)
    np.savetxt(folder / "field.txt", VERTICES, fmt="%.17g")
    name = "tent.vertex_positions"
    found = limn.gradient(scene, {name: VERTICES}, **arguments)
    assert list(found) == [name] and np.any(found[name].value)
    by_file = limn.gradient(scene, f"{name}:{folder / 'field.txt'}", **arguments)
    assert equal(found[name], next(iter(by_file.values())))


@pytest.mark.parametrize("method", ["adaptive", "fd"])
def test_a_field_of_texels_has_the_bits_of_its_file(folder, sky, method):  # noqa: F811
    scene, texels = sky
    change = RNG.normal(size=texels.shape).astype(np.float32)
    limn.write_exr(folder / "change.exr", change)
    by_file = limn.gradient(scene, f"sky.data:{folder / 'change.exr'}", 4, method=method)
    found = limn.gradient(scene, {"sky.data": change}, 4, method=method)["sky.data"]
    assert np.any(found.value) and equal(found, next(iter(by_file.values())))


def test_displacements_go_along_normals(scene):
    far = RNG.normal(size=4)
    lifted = np.outer(far, [0, 1, 0])
    found = limn.gradient(scene, {"floor.displacement": far}, 4)["floor.displacement"].value
    name = "floor.vertex_positions"
    same_way = limn.gradient(scene, {name: lifted}, 4)[name].value
    assert np.any(found) and np.allclose(found, same_way, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("method", ["adaptive", "fd"])
def test_colours_and_numbers_have_directions_too(scene, method):
    name, arguments = "clay.reflectance", {"spp": 4, "method": method}
    if method == "fd":
        arguments["step"] = 0.01
    grey = limn.gradient(scene, name, **arguments)[name]
    red, green = (limn.gradient(scene, f"{name}.{c}", **arguments)[f"{name}.{c}"] for c in "rg")
    assert equal(limn.gradient(scene, {name: [1, 0, 0]}, **arguments)[name], red)
    assert equal(limn.gradient(scene, {name: 1.0}, **arguments)[name], grey)
    mixed = limn.gradient(scene, {name: (2, -0.5, 0), "metal.alpha": 1.0}, **arguments)
    wanted = 2 * red.value - 0.5 * green.value
    assert np.allclose(mixed[name].value, wanted, rtol=1e-3, atol=1e-4 * abs(wanted).max())
    both = limn.gradient(scene, [name, "metal.alpha"], **arguments)["metal.alpha"]
    turned = mixed["metal.alpha"]
    assert equal(turned, both)
    assert turned.value.dtype == np.float32 and turned.is_derivative


def test_parts_of_a_direction_join(scene):
    wanted = limn.gradient(scene, {"tent.vertex_positions": VERTICES}, spp=6)
    parts = [limn.part((k, 2), limn.gradient, scene, {"tent.vertex_positions": VERTICES}, spp=6)
             for k in (1, 2)]
    joined = limn.merge(pickle.loads(pickle.dumps(parts)), scene)  # noqa: S301
    assert equal(joined["tent.vertex_positions"], wanted["tent.vertex_positions"])
    red, green = (limn.part((k, 2), limn.gradient, scene, {"clay.reflectance": along}, spp=4)
                  for k, along in ((1, [1, 0, 0]), (2, [0, 1, 0])))
    with pytest.raises(limn.InputError, match="parameters"):
        limn.merge([red, green], scene)


def test_parts_keep_the_directions_that_they_were_made_with(scene):
    along = {"tent.vertex_positions": VERTICES.copy()}
    wanted = limn.gradient(scene, along, spp=4)
    parts = [limn.part((k, 2), limn.gradient, scene, along, spp=4) for k in (1, 2)]
    along["tent.vertex_positions"][:] = 0
    joined = limn.merge(parts, scene)
    assert equal(joined["tent.vertex_positions"], wanted["tent.vertex_positions"])


def test_directions_are_read_before_their_scene(scene):
    class Changing:
        def __array__(self, dtype=None, copy=None):
            scene.set_mesh("tent", VERTICES[:3], [[0, 1, 2]])
            return np.ones((6, 3))

    with pytest.raises(limn.InputError, match=r"has shape \(3, 3\), not \(6, 3\)"):
        limn.gradient(scene, {"tent.vertex_positions": Changing()}, 1)


TORN = VERTICES + np.eye(6)[:, :3]


@pytest.mark.parametrize("name, direction, text", [
    ("tent.vertex_positions", VERTICES[:5], r'"tent.vertex_positions" has shape \(6, 3\), not \(5, 3\)'),
    ("tent.vertex_positions", VERTICES * np.inf, '"tent.vertex_positions" is not finite'),
    ("tent.vertex_positions", TORN, 'vertices 0 and 4 .* of "tent" are at the same position'),
    ("tent.displacement", np.arange(6), "vertices 0 and 4 "),
    ("tent.displacement", np.ones((6, 3)), r"has shape \(6,\), not \(6, 3\)"),
    ("clay.reflectance", [1, 2], r"has shape \(3,\), not \(2,\)"),
    ("ball.scale", [1, 2], '"ball.scale" must be 1, as it is one number'),
    ("ball.scale", np.nan, '"ball.scale" must be 1'),
    ("tent.vertex_positions", np.full((6, 3), 1e300), "not finite in single precision"),
    ("bell.scale", 1, "ball.scale"),
])
def test_directions_that_are_none(scene, name, direction, text):
    with pytest.raises(limn.InputError, match=text):
        limn.gradient(scene, {name: direction}, 1)


def test_names_of_directions_are_words(scene):
    with pytest.raises(TypeError, match="names must be"):
        limn.gradient(scene, {1: 2.0}, 1)
    with pytest.raises(limn.InputError, match="at least one parameter"):
        limn.gradient(scene, {}, 1)
