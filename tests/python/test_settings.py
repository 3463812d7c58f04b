"""What else than parameters of a scene can be set: its film, its integrator, its sampler."""

import copy
import pickle

import limn
import numpy as np
import pytest
from test_scene import same


def resized(folder, file, width, height, **names):
    """The scene of a file in a new size, and the same file with that size."""
    scene = limn.load(folder / file, **names)
    scene.resize(width, height)
    text = (folder / file).read_text().replace('value="$size"', f'value="{width}"')
    text = text.replace('name="height" value="12"', f'name="height" value="{height}"')
    return scene, limn.load_string(text, folder, **names)


VIEWS = {
    "pinhole": "",
    "tent filter": '<rfilter type="tent"/>',
    "shifted": '<float name="principal_point_offset_x" value="0.1"/>',
    "lens": '<float name="aperture_radius" value="0.1"/><float name="focus_distance" value="4"/>',
    "orthographic": "",
}


@pytest.fixture(params=VIEWS)
def seen(request, folder):
    text = (folder / "scene.xml").read_text()
    if request.param == "tent filter":
        text = text.replace('<rfilter type="box"/>', VIEWS[request.param])
    else:
        text = text.replace("<sampler", VIEWS[request.param] + "<sampler")
    if request.param == "lens":
        text = text.replace('"perspective"', '"thinlens"')
    if request.param == "orthographic":
        text = text.replace('"perspective"', '"orthographic"').replace(
            '<float name="fov" value="40"/>', "").replace("<lookat", '<scale x="1.3" y="1.7"/><lookat')
    texture = """<bsdf type="diffuse" id="clay"><texture type="bitmap" name="reflectance">
        <string name="filename" value="clay.png"/></texture></bsdf>"""
    at = text.index('<bsdf type="diffuse" id="clay">')
    text = text[:at] + texture + text[text.index("</bsdf>", at) + len("</bsdf>"):]
    limn.write_png(folder / "clay.png", np.random.default_rng(2).random((8, 8, 3)))
    (folder / "seen.xml").write_text(text)
    return folder


def test_a_resized_scene_is_that_of_a_file_of_this_size(seen):
    for width, height in ((7, 21), (32, 9)):
        scene, file = resized(seen, "seen.xml", width, height)
        assert (scene.width, scene.height) == (width, height)
        image = limn.render(scene, spp=3)
        assert image.shape == (height, width, 3) and same(image.value, limn.render(file, 3).value)
        name = "tent.translate.y"
        slope, wanted = (limn.gradient(s, name, 16)[name] for s in (scene, file))
        assert np.any(wanted.value) and same(slope.value, wanted.value)
        adjoint = np.ones((height, width, 3))
        slopes, all_wanted = (limn.backward(s, adjoint, spp=4, method="silhouettes")
                              for s in (scene, file))
        for found in all_wanted:
            assert np.array_equal(slopes[found].value, all_wanted[found].value), found
        assert same(limn.layers(scene, "uv", 2)["uv"], limn.layers(file, "uv", 2)["uv"])


def close(a, b):
    return np.mean(np.isclose(a, b, rtol=1e-4)) > 0.97


@pytest.mark.parametrize("axis", ["y", "smaller", "larger", "diagonal"])
def test_what_is_seen_across_stays_as_in_mitsuba(folder, axis):
    half = np.tan(np.radians(20))  # of the file's 16 by 12 pixels
    across = {"y": half * 4 / 3, "smaller": half * 4 / 3, "larger": half, "diagonal": half * 0.8}
    text = (folder / "scene.xml").read_text()
    (folder / "axis.xml").write_text(text.replace(
        "<sampler", f'<string name="fov_axis" value="{axis}"/><sampler'))
    (folder / "x.xml").write_text(text.replace(
        'value="40"', f'value="{2 * np.degrees(np.arctan(across[axis]))}"'))
    for width, height, as_file in ((32, 9, axis == "larger"), (10, 30, False)):
        scene, file = resized(folder, "axis.xml", width, height)
        image = limn.render(scene, 2).value
        assert close(image, limn.render(resized(folder, "x.xml", width, height)[1], 2).value)
        assert close(image, limn.render(file, 2).value) == as_file


def test_a_film_is_that_of_its_sensor(scene, folder):
    text = (folder / "scene.xml").read_text()
    at, end = text.index("<sensor"), text.index("</sensor>") + len("</sensor>")
    both = limn.load_string(text[:end] + text[at:end] + text[end:], folder)
    copy, side = both.copy(), both.view(1)
    both.resize(8, 6)
    both.spp, both.seed = 3, 5
    assert [copy.width, side.width, both.view(1).width, both.view(0).width] == [16, 16, 16, 8]
    assert (both.view(0).spp, both.view(0).seed, both.view(1).spp, both.view(1).seed) == (3, 5, 4, 0)
    with pytest.raises(limn.InputError, match="16 x 12 .*8 x 6"):
        limn.image_loss(both, limn.render(scene, 1))
    targets = [limn.render(both.view(k), 1).value for k in (0, 1)]
    assert limn.fit(both, targets, "clay.reflectance", 1, spp=1).values


def test_films_that_cannot_be(scene, folder):
    for size in ((0, 4), (4, -1), (10**6, 10**6)):
        with pytest.raises(limn.InputError, match="at least 1|too large"):
            scene.resize(*size)
    assert (scene.width, scene.height) == (16, 12)
    text = (folder / "scene.xml").read_text().replace(
        "<rfilter", '<integer name="crop_width" value="5"/><rfilter')
    with pytest.raises(limn.InputError, match="crop window"):
        limn.load_string(text, folder).resize(20, 20)


def test_depths_and_the_sampler_are_those_of_a_file(scene, folder):
    text = (folder / "scene.xml").read_text()
    at = text.index("<sensor")
    text = (text[:at] + """<integrator type="path"><integer name="max_depth" value="3"/>
        <integer name="rr_depth" value="2"/><boolean name="hide_emitters" value="true"/></integrator>
        """ + text[at:]).replace('name="sample_count" value="4"/>',
                                 'name="sample_count" value="7"/><integer name="seed" value="9"/>')
    other = limn.load_string(text, folder)
    assert (scene.max_depth, scene.rr_depth, scene.hide_emitters) == (-1, 5, False)
    scene.max_depth, scene.rr_depth, scene.hide_emitters = 3, 2, True
    scene.spp, scene.seed = 7, 9
    assert (other.max_depth, other.rr_depth, other.hide_emitters) == (3, 2, True)
    image = limn.render(scene)
    assert image.spp == 7 and same(image.value, limn.render(other).value)


@pytest.mark.parametrize("name, value, text", [
    ("max_depth", 0, "max_depth: must be -1 .no limit. or at least 1"),
    ("max_depth", -2, "max_depth: must be -1"),
    ("rr_depth", 0, "rr_depth: must lie between 1 and"),
    ("spp", 0, "spp: must lie between 1 and 1073741823"),
    ("spp", 2**30, "spp: must lie between 1 and 1073741823"),
    ("spp", 2**40, "spp: must lie between 1 and 1073741823"),
    ("rr_depth", 2**31, "rr_depth: must lie between 1 and 2147483647"),
    ("max_depth", 2**31, "max_depth: must be"),
    ("seed", -1, "seed: must not be negative"),
])
def test_settings_have_the_ranges_of_a_file(scene, name, value, text):
    before = getattr(scene, name)
    with pytest.raises(limn.InputError, match=text):
        setattr(scene, name, value)
    assert getattr(scene, name) == before


def test_a_scene_says_why_it_does_not_pickle(scene):
    with pytest.raises(TypeError, match="load it in each process"):
        pickle.dumps(scene)
    assert copy.copy(scene).width == copy.deepcopy(scene).width == 16


def test_null_has_no_parameters(folder):
    text = (folder / "scene.xml").read_text().replace(
        "<sensor", '<bsdf type="null" id="nothing"/><sensor', 1)
    text = text.replace("</scene>", '<shape type="sphere" id="air"><ref id="nothing"/></shape></scene>')
    scene = limn.load_string(text, folder)
    assert "air.scale" in scene
    assert not [name for name in scene if name.startswith("nothing.")]
