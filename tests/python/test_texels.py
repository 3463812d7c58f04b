"""The texels of an environment's map as a parameter."""

import json
import os
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
    scene["sky.data"][:] = 0  # of a copy
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
