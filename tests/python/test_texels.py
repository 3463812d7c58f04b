"""The texels of an environment's map as a parameter."""

import json
import os
import pickle
import subprocess

import limn
import numpy as np
import pytest
from test_scene import same

SHAPE = (5, 8, 3)


@pytest.fixture
def sky(folder):
    """The scene under a map, which it needs an id for."""
    texels = np.random.default_rng(4).uniform(0.1, 1, SHAPE).astype(np.float32)
    limn.write_exr(folder / "map.exr", texels)
    text = (folder / "scene.xml").read_text()
    at, end = text.index('<emitter type="constant"'), text.index('<emitter type="point"')
    text = text[:at] + """<emitter type="envmap" id="sky"><string name="filename" value="map.exr"/>
        <float name="scale" value="0.5"/></emitter>""" + text[end:]
    (folder / "sky.xml").write_text(text)
    return limn.load(folder / "sky.xml"), texels


def test_they_are_read_and_set(folder, sky):
    scene, texels = sky
    assert scene.parameters["sky.data"].shape == SHAPE
    assert same(scene["sky.data"], texels) and scene["sky.data"].dtype == np.float32
    with pytest.raises(ValueError, match="read-only"):
        scene["sky.data"][:] = 0
    assert same(scene["sky.data"], texels)
    limn.write_exr(folder / "other.exr", 2 * texels[::-1])
    text = (folder / "sky.xml").read_text().replace("map.exr", "other.exr")
    other = limn.load_string(text, folder)
    old = scene.copy()
    scene["sky.data"] = 2 * texels[::-1].astype(float)
    assert same(limn.render(scene, spp=2).value, limn.render(other, spp=2).value)
    assert same(old["sky.data"], texels)
    with pytest.raises(limn.InputError, match=r"has shape \(5, 8, 3\), not \(5, 8\)"):
        scene["sky.data"] = texels[:, :, 0]
    with pytest.raises(limn.InputError, match="cannot be nan"):
        scene["sky.data"] = texels * np.nan
    with pytest.raises(limn.InputError, match="rows 0 to 4 and columns 0 to 7"):
        scene.parameters["sky.data.5.0.r"]
    assert scene.parameters["sky.data.4.7.b"].shape == ()


# With an envmap in the scene and without one.
@pytest.mark.parametrize("map", [None, np.full(SHAPE, 3, np.float32)])
def test_textures_and_attributes_are_read_and_set(map):
    rng = np.random.default_rng(6)
    texels, colours = rng.random((4, 6, 3)).astype(np.float32), rng.random((4, 3))
    scene = limn.load_dict({
        "type": "scene", "sensor": {"type": "perspective"},
        "sky": {"type": "constant"} if map is None else {"type": "envmap", "bitmap": map},
        "wall": {"type": "rectangle", "bsdf": {"type": "diffuse", "reflectance": {
            "type": "bitmap", "bitmap": texels, "raw": True}}},
        "roof": {"type": "mesh", "vertices": [[-1, 0, 2], [1, 0, 2], [1, 2, 2], [-1, 2, 2]],
                 "faces": [[0, 1, 2], [0, 2, 3]], "vertex_color": colours,
                 "bsdf": {"type": "diffuse", "reflectance": {
                     "type": "mesh_attribute", "name": "vertex_color"}}}})
    for name, values in (("wall.bsdf.reflectance.data", texels),
                         ("roof.vertex_color", colours[None].astype(np.float32))):
        assert same(scene[name], values)
        scene[name] = values / 2
        assert same(scene[name], values / 2)
    with pytest.raises(limn.InputError, match='"roof.translate.x" is one number, not 3'):
        scene["roof.translate.x"] = [1, 2, 3]


# Two sides, 5 sigma.
def test_reverse_is_forward_and_the_programs(folder, sky):
    scene, texels = sky
    adjoint = np.random.default_rng(3).normal(size=(12, 16, 3)).astype(np.float32)
    found = limn.backward(scene, adjoint, "sky.data", spp=32, seed=1)["sky.data"]
    assert found.value.shape == SHAPE and found.value.dtype == np.float64
    limn.write_exr(folder / "field.exr", texels)
    name = f"sky.data:{folder / 'field.exr'}"
    forward = limn.gradient(scene, ["sky.data.1.3.g", name], spp=32, seed=2)
    for value, error, images in (
            (found.value[1, 3, 1], found.stderr[1, 3, 1], forward["sky.data.1.3.g"]),
            # Errors of texels are tied: their sum is a bound.
            ((found.value * texels).sum(), (found.stderr * texels).sum(), forward[name])):
        spread = np.hypot(error, np.linalg.norm(adjoint * images.stderr))
        assert 0 < abs(value - np.vdot(adjoint, images.value)) < 5 * spread
    limn.write_exr(folder / "adjoint.exr", adjoint)
    output = folder / "texels"
    subprocess.run([os.environ["LIMN_PROGRAM"], "backward", str(folder / "sky.xml"), "--quiet",
                    "--adjoint", str(folder / "adjoint.exr"), "--spp", "32", "--seed", "1", "--wrt",
                    "sky.data", "-o", str(output)], check=True)  # fmt: skip
    assert np.array_equal(np.load(output / "sky.data.npy"), found.value)
    assert same(limn.read_exr(output / "sky.data.exr"), found.value.astype(np.float32))
    assert same(limn.read_exr(output / "sky.data_stderr.exr"), found.stderr.astype(np.float32))
    told = json.loads((output / "gradient.json").read_text())["parameters"]
    assert [p["shape"] for p in told] == [list(SHAPE)]


def test_a_sky_is_found_back_with_the_programs_bits(folder, sky, tmp_path):
    scene, texels = sky
    target = limn.render(scene, spp=512, seed=9).value
    limn.write_exr(tmp_path / "target.exr", target)
    limn.write_exr(folder / "map.exr", np.full(SHAPE, 0.5, np.float32))
    start = limn.load(folder / "sky.xml")
    bounds = {"sky.data": (0, 0.7)}
    fit = limn.Fit(start, target, "sky.data", spp=4, step=8, step_half_life=12, bounds=bounds)
    fit.run(40)
    before, after = (limn.image_loss(s, target, spp=128, seed=1) for s in (start, fit.scenes[0]))
    assert before.value - after.value > 5 * np.hypot(before.stderr, after.stderr)
    found = fit.scenes[0]["sky.data"]
    assert found.max() == np.float32(0.7)  # where more is true
    assert not fit.values
    words = [os.environ["LIMN_PROGRAM"], "fit", "--quiet", "--no-report"]
    more = ["--target", str(tmp_path / "target.exr"), "--wrt", "sky.data", "--spp", "4", "--step",
            "8", "--step-half-life", "12", "--bounds", "sky.data=0,0.7", "-o", str(tmp_path / "fit")]
    subprocess.run([*words, str(folder / "sky.xml"), *more, "--steps", "25"], check=True)
    subprocess.run([*words, "--resume", str(tmp_path / "fit"), "--steps", "40"], check=True)
    assert same(limn.read_exr(tmp_path / "fit" / "step_00040_sky.data.exr"), found)


BAKED = """<scene version="3.0.0">
  <integrator type="path"><integer name="max_depth" value="2"/></integrator>
  <sensor type="perspective">
    <transform name="to_world"><lookat origin="1,3,5" target="0,0.5,0" up="0,1,0"/></transform>
    <film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="12"/></film>
  </sensor>
  <shape type="obj" id="tent"><string name="filename" value="tent.obj"/></shape>
  <shape type="rectangle" id="floor">
    <transform name="to_world"><rotate x="1" angle="-90"/><scale value="4"/></transform>
  </shape>
  <emitter type="constant" id="sky"/>
</scene>"""


def test_a_baked_view_is_the_programs_and_finds_its_sky(folder):
    texels = np.random.default_rng(4).uniform(0.1, 1, SHAPE).astype(np.float32)
    (folder / "baked.xml").write_text(BAKED)
    limn.write_exr(folder / "map.exr", texels)
    baked = limn.bake(limn.load(folder / "baked.xml"), spp=2, seed=3, lines=16)
    bake = ["bake", "baked.xml", "--spp", "2", "--seed", "3", "--lines", "16", "-o", "a.bake"]
    relight = ["relight", "a.bake", "--sky", "map.exr", "--scale", "0.5", "--rotate", "30",
               "-o", "relit.exr", "--scene", "baked.xml"]
    for words, told in ((relight, "a.bake: error: cannot read: No such file or directory\n"),
                        (bake, ""), (relight, "")):
        done = subprocess.run([os.environ["LIMN_PROGRAM"], *words], cwd=folder, check=False,
                              capture_output=True, text=True)
        assert (done.returncode, done.stderr) == (2 if told else 0, told)
    image = baked.relight(texels, scale=0.5, rotate=30)
    assert same(image, limn.read_exr(folder / "relit.exr"))
    # But for the scene's file and the sum of all.
    assert (folder / "a.bake").read_bytes().split(b"\n\n", 1)[1][:-4] in baked.data
    assert same(pickle.loads(pickle.dumps(baked)).relight(texels, 0.5, 30), image)

    # Conjugate gradients on |A sky - image|^2. After k steps from 0, |A sky - image| is at most
    # |A| |texels| / (2 k + 1), whatever A. Here |image|, which is no more than |A| |texels|, is
    # enough in their place.
    steps = 60
    sky = np.zeros(SHAPE)
    step = rest = baked.adjoint(image, sky, 0.5, 30)
    for _ in range(steps):
        curved = baked.adjoint(baked.relight(step, 0.5, 30), sky, scale=0.5, rotate=30)
        length = np.vdot(rest, rest) / np.vdot(step, curved)
        sky = sky + length * step
        new = rest - length * curved
        step = new + np.vdot(new, new) / np.vdot(rest, rest) * step
        rest = new
    left = np.linalg.norm(baked.relight(sky, 0.5, 30) - image)
    assert left < np.linalg.norm(image) / (2 * steps + 1)
    with pytest.raises(limn.InputError, match="lines: "):
        limn.bake(limn.load(folder / "baked.xml"), lines=0)
    with pytest.raises(limn.InputError, match="data: error: is no file"):
        limn.Baked(b"hello")
