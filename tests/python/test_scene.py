"""Scenes, their parameters and meshes: in, out, and what is refused."""

import json
import os
import pickle
import re
from collections.abc import Mapping

import limn
import numpy as np
import pytest
from conftest import SCENE, TENT

TENT_POINTS = [[0, 1, 0], [1, 0, 0], [0, 0, 1]]


def image(scene):
    return limn.render(scene, spp=2, seed=5).value


def same(a, b):
    return np.array_equal(a.view(np.uint32), b.view(np.uint32))


def test_keywords_give_values_to_names(folder):
    scene = limn.load(os.fspath(folder / "scene.xml"), size=24, alpha=0.5)
    assert (scene.width, scene.height, scene.spp) == (24, 12, 4)
    assert scene["metal.alpha"] == 0.5
    assert image(scene).shape == (12, 24, 3)


def test_smooth_lobes_are_made_rough(tmp_path):
    def write(name, kind, alpha=""):
        (tmp_path / name).write_text(f"""<scene version="3.0.0">
  <sensor type="perspective"><film type="hdrfilm"><integer name="width" value="8"/>
    <integer name="height" value="8"/></film></sensor>
  <shape type="rectangle"><transform name="to_world"><translate z="4"/></transform>
    <bsdf type="twosided"><bsdf type="{kind}">{alpha}</bsdf></bsdf></shape>
  <emitter type="constant"><rgb name="radiance" value="$light"/></emitter></scene>""")
        return tmp_path / name

    alpha = '<float name="alpha" value="0.2"/><string name="distribution" value="ggx"/>'
    for kind in ("conductor", "plastic"):
        smooth = write("smooth.xml", kind)
        scene = limn.load(smooth, smooth_as=0.2, light=0.5)
        rough = limn.load(write("rough.xml", f"rough{kind}", alpha), light=0.5)
        assert (scene.smooth_as, rough.smooth_as, limn.load(smooth, light=0.5).smooth_as) == (
            0.2, 0, 0)
        assert same(image(scene), image(rough))
        assert not same(image(scene), image(limn.load(smooth, light=0.5)))


def test_the_program_writes_the_roughness(program, folder):
    program("render", "--smooth-as", "0.25", "--spp", "1")
    text = (folder / "program.exr").read_bytes()
    assert b"limn.smooth_as\0string\0\x04\0\0\0" + b"0.25" in text


def test_text_is_as_good_as_a_file(folder, scene):
    assert same(image(limn.load_string(SCENE, folder)), image(scene))
    broken = SCENE.replace("</scene>", "<lamp/></scene>")
    line = broken[:broken.index("<lamp/>")].count("\n") + 1
    with pytest.raises(limn.InputError, match=re.escape(f"{folder}/string:{line}:1: error: ")):
        limn.load_string(broken, folder)


@pytest.mark.parametrize("call, text", [
    (lambda s, f: limn.load(f / "no.xml"), "{f}/no.xml: error: cannot read: No such file or directory"),
    (lambda s, f: limn.load(f / "scene.xml", sise=3),
     '{f}/scene.xml: error: -D sise=3: the scene has no parameter "$sise" (known: alpha, size)'),
    (lambda s, f: limn.load(f / "scene.xml", smooth_as=2),
     "error: smooth_as: must be 0, or lie between 0.0001 and 1"),
    (lambda s, f: s.__setitem__("metal.alpha", -1),
     '{f}/scene.xml: error: parameter "metal.alpha" cannot be -1: it must be finite and lie in '
     "[0, 1e+06]"),
    (lambda s, f: s.__setitem__("clay.reflectance", [0.5, 0.5]),
     '{f}/scene.xml: error: parameter "clay.reflectance" holds 3 numbers, not 2'),
    (lambda s, f: s.__setitem__("clay.reflectance", 1.5),
     '{f}/scene.xml: error: parameter "clay.reflectance" cannot be 1.5: it must be finite and lie '
     "in [0, 1]"),
    (lambda s, f: s.__setitem__("sensor.fov", np.nan),
     '{f}/scene.xml: error: parameter "sensor.fov" cannot be nan: it must be finite and lie in '
     "[2.22507e-308, 180]"),
    (lambda s, f: s.__setitem__("tent.rotate.x", 1),
     '{f}/scene.xml: error: parameter "tent.rotate.x" moves things from where they are and has no '
     'value to set: scene.move("tent.rotate.x", step), or scene["tent.to_world"]'),
    (lambda s, f: s.__setitem__("tent.vertex_positions", np.zeros((5, 3))),
     '{f}/scene.xml: error: parameter "tent.vertex_positions" has shape (6, 3), not (5, 3)'),
    (lambda s, f: s.__setitem__("tent.vertex_positions", np.full((6, 3), np.inf)),
     '{f}/scene.xml: error: parameter "tent.vertex_positions" cannot be inf: it must be finite and '
     "lie in [-2e+12, 2e+12]"),
    (lambda s, f: s.mesh("tend"),
     '{f}/scene.xml: error: unknown shape "tend" (known: tent, floor, ball)'),
    (lambda s, f: s.set_mesh("tent", np.zeros((4, 2)), [[0, 1, 2]]),
     "error: Vertices have shape (V, 3), one row each"),
    (lambda s, f: s.set_mesh("tent", np.eye(3), [[0, 1, -1]]),
     "error: Faces hold indices of vertices, from 0 on, not -1"),
    (lambda s, f: s.set_mesh("tent", np.eye(3), [[0, 1, 3]]),
     "{f}/scene.xml:15:3: error: face 0 (counted from 0) names vertex 3 of 3"),
    (lambda s, f: setattr(s, "shading", "flat"),
     'error: unknown shading "flat" (known: continuous, mitsuba)'),
    (lambda s, f: limn.render(s, spp=0), "error: spp: 0 is not a number from 1 to 1073741824"),
    (lambda s, f: limn.render(s, threads=-1), "error: threads: -1 is not a number from 1 to 4096"),
    (lambda s, f: limn.gradient(s, "tent.vertex_positions"),
     '{f}/scene.xml: error: parameter "tent.vertex_positions" is an array of 18 numbers, and one is '
     'wanted: "tent.vertex_positions:FILE" for a field of vectors, "tent.vertex_positions.0.x" for '
     "one number"),
    (lambda s, f: limn.gradient(s, "metal.alpha", samples="many"),
     'error: unknown kind of samples "many" (known: auto, uniform); counts are a list, one for '
     "each term"),
    (lambda s, f: limn.write_exr(f / "a.exr", np.zeros(3)),
     "error: an image has shape (H, W, 3), (H, W, 1) or (H, W)"),
])
def test_what_is_refused_and_why(folder, scene, call, text):
    before = image(scene)
    with pytest.raises(limn.InputError) as caught:
        call(scene, folder)
    assert str(caught.value) == text.replace("{f}", str(folder))
    assert same(image(scene), before)


def test_a_scene_knows_its_names(scene):
    assert list(scene) == list(scene.parameters)
    assert "metal.alpha" in scene and "metal.beta" not in scene and 3 not in scene


def test_another_sensor_is_a_view(scene):
    for call in (limn.render, lambda s, **k: limn.gradient(s, "metal.alpha", **k)):
        with pytest.raises(TypeError, match=r"no argument 'sensor' \(use scene.view\(sensor\)\)"):
            call(scene, sensor=1)


def test_unknown_parameters_are_key_errors_too(scene):
    for call in (lambda: scene["tent.translate"], lambda: scene.parameters["tent.translate"],
                 lambda: limn.gradient(scene, ["metal.alpha", "tent.translate"]),
                 lambda: limn.check(scene, "tent.translate"),
                 lambda: limn.compare(scene, "tent.translate", ["fd"], [1]),
                 lambda: scene.move("tent.translate", 1)):
        with pytest.raises(KeyError, match="^[^'].*nearest: tent.translate.x, ") as caught:
            call()
        assert isinstance(caught.value, limn.InputError)


def test_parameters_are_a_mapping(scene):
    parameters = scene.parameters
    assert isinstance(parameters, Mapping)
    assert len(parameters) == len(list(parameters)) == len(dict(parameters.items()))
    assert list(parameters) == [row["name"] for row in limn.info(scene)["parameters"]]
    assert "tent.vertex_positions.3.y" in parameters and "tent.vertex_positions.3.y" not in list(parameters)
    assert "nothing" not in parameters and 3 not in parameters
    fov = parameters["sensor.fov"]
    assert (fov.name, fov.unit, fov.shape, fov.value) == ("sensor.fov", "degrees", (), 40)
    assert fov.natural_step == pytest.approx(0.4)
    assert parameters["tent.vertex_positions"].shape == (6, 3)
    assert parameters["tent.rotate.x"].value is None
    parameter = limn.load_string(SCENE.replace("tent.obj", scene.file.replace("scene.xml", "tent.obj"))).parameters["lamp.radiance"]
    assert parameter.value.tolist() == [4, 5, 6]  # its scene is gone


# Where the file has it is 0.
def test_translations_have_a_value(scene):
    name, before = "tent.translate.x", scene["tent.vertex_positions"]
    assert scene[name] == 0 and scene.parameters[name].value == 0
    scene.move(name, 0.25)
    other = scene.copy()
    scene[name] = 1.5
    assert (scene[name], other[name], scene["tent.translate.y"]) == (1.5, 0.25, 0)
    assert np.array_equal(scene["tent.vertex_positions"] - before, np.tile([1.5, 0, 0], (6, 1)))
    with pytest.raises(limn.InputError):
        scene[name] = np.inf
    assert scene[name] == 1.5
    fit = limn.Fit(other, limn.render(other, spp=2).value, name, spp=2)
    fit.run(2)
    assert fit.scenes[0][name] == 0.25 + fit.values[name] != 0.25


def test_every_value_comes_back(scene):
    names = [name for name, p in scene.parameters.items() if p.value is not None]
    assert len(names) > 12
    for name in names:
        value = np.asarray(scene[name])
        other = value * (0.75 if name != "sensor.fov" else 1.5) + 0.0625
        scene[name] = other
        assert scene[name] == pytest.approx(other, abs=0)
        assert np.shape(scene[name]) == np.shape(value)
    scene["clay.reflectance"] = 0.25
    assert scene["clay.reflectance"].tolist() == [0.25] * 3


def test_views_cannot_be_written_and_stay_as_they_were(folder, scene):
    view = scene["tent.vertex_positions"]
    assert view.dtype == np.float32 and view.flags["C_CONTIGUOUS"] and not view.flags.writeable
    assert np.shares_memory(view, scene["tent.vertex_positions"])
    with pytest.raises(ValueError, match="read-only"):
        view[0, 0] = 3
    kept = view.copy()
    scene["tent.vertex_positions"] = view + 1
    assert np.array_equal(view, kept)
    assert np.array_equal(scene["tent.vertex_positions"], kept + 1)
    mesh = limn.load(folder / "scene.xml").mesh("tent")
    assert np.array_equal(mesh.positions, kept)
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3], [4, 3, 5], [4, 5, 1]]
    assert mesh.weld.tolist() == [0, 1, 2, 3, 0, 5]
    with pytest.raises(AttributeError):
        mesh.positions = kept


@pytest.mark.parametrize("name, change", [
    ("tent.vertex_positions", [0, 0.125, 0]), ("clay.reflectance", 0.125),
    ("ball.to_world", np.eye(4, k=3) / 2)])
def test_arrays_change_in_place_by_assignment(scene, name, change):
    start = np.array(scene[name])
    scene[name] += change
    np.testing.assert_allclose(scene[name], start + change, atol=1e-6)
    scene[name] -= change
    scene[name] *= 1
    scene[name] /= 1
    np.testing.assert_allclose(scene[name], start, atol=1e-6)
    with pytest.raises(ValueError, match="read-only"):
        scene[name][0] = 0
    with pytest.raises(ValueError, match=r"copy it \(a = scene\[name\].copy\(\)\)"):
        scene[name][1:] += 1
    with pytest.raises(TypeError, match="not complex"):
        scene[name] += 1j
    np.testing.assert_allclose(scene[name], start, atol=1e-6)
    own = scene[name].copy()
    part = own[:1]
    part += 1
    assert np.array_equal(own[:1], part)


def test_what_is_computed_of_arrays_is_numbers_and_plain_arrays(scene):
    value = scene["clay.reflectance"]
    numbers = [value.max(), value.sum(), value.mean(), (value == value).all(), value @ value]
    assert all(isinstance(x, np.generic) and hash(x) == hash(x.item()) for x in numbers)
    assert json.dumps(value.max()) == "0.7"
    for array in (value * 2, pickle.loads(pickle.dumps(value))):
        assert type(array) is np.ndarray and array.flags.writeable
    scene["clay.reflectance"] %= 0.5
    np.testing.assert_allclose(scene["clay.reflectance"], [0.2, 0, 0.3])
    scene["clay.reflectance"] //= 0.25
    assert scene["clay.reflectance"].tolist() == [0, 0, 1]


def test_names_of_mitsuba_that_are_called_otherwise(scene):
    scene["sensor.x_fov"] = 42
    assert scene["sensor.fov"] == 42 and "sensor.x_fov" not in list(scene)
    slopes = limn.gradient(scene, ["sensor.x_fov", "sensor.fov"], spp=2)
    assert same(slopes["sensor.x_fov"].value, slopes["sensor.fov"].value)
    other = limn.load_dict({"type": "scene", "eye": {"type": "perspective", "fov_axis": "y", "fov": 40,
                            "film": {"type": "hdrfilm", "width": 8, "height": 4}}})
    with pytest.raises(KeyError, match="sensor.fov is along the file's fov_axis, which is not x"):
        other["eye.x_fov"]
    other["eye.fov"] = 30
    assert other["sensor.fov"] == 30
    for name in ("nope.x_fov", "nope.positions", "nope.faces"):
        with pytest.raises(KeyError, match="nearest: "):
            other[name]
    for name, advice in (("tent.positions", "called vertex_positions"), ("tent.faces", r"set_mesh\(\)"),
                         ("sensor.film.size", r"resize\(\) in Python")):
        with pytest.raises(limn.UnknownParameterError, match=advice):
            scene[name]
    with pytest.raises(AttributeError, match="limn.load reads files"):
        limn.load_file


@pytest.mark.parametrize("call, text", [
    (lambda s: limn.render(s, seed=-1), r"seed must be int \| None, not -1: from 0 on$"),
    (lambda s: limn.render(s, spp=2**70), r"spp must be int \| None, not \d+$"),
    (lambda s: limn.render(s, integrator="path"), r'the scene has it, as "integrator": '),
    (lambda s: limn.render(s, sensor=1), r"'sensor' \(use scene.view\(sensor\)\)$"),
    (lambda s: limn.render(s, thread=1), r"no argument 'thread' \(nearest: threads, "),
    (lambda s: limn.Fit(s, 0, "clay.reflectance", lr=0.05), r"use step, in natural steps: step=5 is"),
    (lambda s: limn.fit(s, 0, "clay.reflectance", learning_rate=1), "use step, in natural steps"),
])
def test_arguments_that_are_none(scene, call, text):
    with pytest.raises(TypeError, match=text) as error:
        call(scene)
    assert len(str(error.value)) < 150


# Setting positions is reading the mesh with them; nothing else of the scene is touched.
def test_positions_make_what_a_file_with_them_makes(folder, scene):
    moved = scene["tent.vertex_positions"] + np.float32([0.3, 0.1, -0.2])
    lines = ["v " + " ".join(repr(float(x)) for x in row) for row in moved]
    (folder / "moved.obj").write_text("\n".join(lines + TENT.splitlines()[6:]))
    read = limn.load_string(SCENE.replace("tent.obj", "moved.obj"), folder)
    untouched = image(scene)
    assert not same(image(read), untouched)
    other = scene.copy()
    scene["tent.vertex_positions"] = moved
    assert same(image(scene), image(read))
    assert same(image(other), untouched)
    other.set_mesh("tent", moved, scene.mesh("tent").faces)
    assert same(image(other), image(read))
    scene["tent.vertex_positions"] = moved - np.float32([0.3, 0.1, -0.2])
    scene["tent.vertex_positions"] = other["tent.vertex_positions"].astype(np.float64)
    assert same(image(scene), image(read))


def test_a_mesh_is_mended_with_a_warning(scene):
    positions = scene["tent.vertex_positions"]
    faces = np.vstack([scene.mesh("tent").faces, [[1, 2, 1]]])
    with pytest.warns(UserWarning, match="1 of 5 faces have two corners at the same position"):
        scene.set_mesh("tent", positions, faces)
    assert len(scene.mesh("tent").faces) == 4
    with pytest.raises(limn.InputError, match="no faces"):
        scene["tent.vertex_positions"] = np.zeros((6, 3))
    assert np.array_equal(scene["tent.vertex_positions"], positions)


def test_moving_is_what_positions_do(scene):
    other = scene.copy()
    scene.move("floor.translate.y", -0.25)
    other["floor.vertex_positions"] = other["floor.vertex_positions"] - [0, 0.25, 0]
    assert same(image(scene), image(other))
    scene.move("sensor.fov", 2)
    assert scene["sensor.fov"] == 42


@pytest.mark.parametrize("name, step, text", [
    ("tent.translate.x", float("nan"), "the step nan is not finite"),
    ("tent.translate.x", float("-inf"), "the step -inf is not finite"),
    ("tent.translate.x", 1e30, "a step of 1e+30 is too long: the shape would go beyond 2e+12"),
    ("tent.scale", -1, "a step of -1 is too long: the shape would be a point"),
    ("tent.scale", -1.5, "a step of -1.5 is too long: the shape would be a point, or inside out"),
    ("lamp.radiance", -100, "cannot be -96: it must be finite and lie in"),
    ("sensor.fov", 200, "cannot be 240: it must be finite and lie in"),
    ("sensor.translate.x", 1e30, "cannot be 1e+30"),
])
def test_no_move_leads_out_of_what_a_scene_can_be(scene, name, step, text):
    before = image(scene)
    with pytest.raises(limn.InputError, match=re.escape(f'parameter "{name}"') + ".*" +
                       re.escape(text)):
        scene.move(name, step)
    assert same(image(scene), before)


@pytest.mark.parametrize("call", [
    lambda p, i: limn.load(p), lambda p, i: limn.load_string(SCENE, p),
    lambda p, i: limn.read_exr(p), lambda p, i: limn.write_exr(p, i),
    lambda p, i: limn.write_png(p, i), lambda p, i: limn.write_ply(p, TENT_POINTS, [[0, 1, 2]]),
])
def test_bytes_are_no_path(call):
    with pytest.raises(TypeError, match="(file|folder): a path is a str"):
        call(b"a", np.zeros((2, 2, 3)))


def test_a_mesh_is_written_through_a_link(tmp_path):
    (tmp_path / "link.ply").symlink_to("there.ply")
    limn.write_ply(tmp_path / "link.ply", TENT_POINTS, [[0, 1, 2]])
    assert (tmp_path / "link.ply").is_symlink()
    assert (tmp_path / "there.ply").stat().st_size > 50


def test_shading_is_the_programs(scene, program):
    scene.shading = "mitsuba"
    assert scene.shading == "mitsuba"
    assert same(image(scene), program("render", "--spp", "2", "--seed", "5", "--shading", "mitsuba",
                                      "--generator", "independent"))


def test_images_come_back(tmp_path):
    pixels = np.random.default_rng(1).random((5, 7, 3), dtype=np.float32)
    limn.write_exr(tmp_path / "a.exr", pixels)
    assert same(limn.read_exr(tmp_path / "a.exr"), pixels)
    limn.write_exr(tmp_path / "b.exr", pixels[:, :, 0], half=True)
    assert limn.read_exr(tmp_path / "b.exr")[:, :, 0] == pytest.approx(pixels[:, :, 0], rel=2**-11)
    limn.write_png(tmp_path / "a.png", pixels)
    limn.write_signed_png(tmp_path / "b.png", pixels - 0.5, scale=0.5)
    for name in ("a.png", "b.png"):
        assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")


def test_other_sensors_are_views(scene, folder):
    text = (folder / "scene.xml").read_text()
    at, end = text.index("<sensor"), text.index("</sensor>") + len("</sensor>")
    second = text[at:end].replace("<sensor", '<sensor id="side"').replace('value="40"', 'value="55"')
    both = limn.load_string(text[:end] + second + text[end:], folder)
    assert both.sensors == ["", "side"] and scene.sensors == [""]
    assert same(limn.render(both, spp=1).value, limn.render(scene, spp=1).value)
    assert both["sensor.fov"] == 40
    both["clay.reflectance"] = [0.1, 0.2, 0.3]
    for name in ("side", 1):
        side = both.view(name)
        assert side["sensor.fov"] == 55 and side["clay.reflectance"].tolist() == [0.1, 0.2, 0.3]
    assert both["sensor.fov"] == 40
    with pytest.raises(limn.InputError, match=r'no sensor "2" \(known: 0, 1 or "side"\)'):
        both.view(2)


def test_meshes_are_written(scene, tmp_path):
    mesh = scene.mesh("tent")
    limn.write_ply(tmp_path / "tent.ply", mesh.positions, mesh.faces)
    again = limn.load_string(
        '<scene version="3.0.0"><sensor type="perspective"/><shape type="ply" id="m">'
        '<string name="filename" value="tent.ply"/></shape></scene>', tmp_path).mesh("m")
    assert same(again.positions, mesh.positions) and same(again.faces, mesh.faces)
    for bad in [(mesh.positions[:, :2], mesh.faces), (mesh.positions, mesh.faces + 1),
                (mesh.positions, mesh.faces.astype(float)), (mesh.positions, mesh.faces.ravel())]:
        with pytest.raises(limn.InputError):
            limn.write_ply(tmp_path / "bad.ply", *bad)
    # What was there stays until the new one is whole.
    (tmp_path / "folder.ply").mkdir()
    with pytest.raises(OSError):
        limn.write_ply(tmp_path / "folder.ply", mesh.positions, mesh.faces)
    assert sorted(os.listdir(tmp_path)) == ["folder.ply", "tent.ply"]
