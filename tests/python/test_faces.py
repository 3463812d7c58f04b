"""Pixels made of their visible faces: the program's bits, and one function with its derivative."""

import json
import os
import subprocess

import limn
import numpy as np
import pytest
from test_scene import same

FACES = {"method": "analytic", "points": "faces"}
WORDS = ["--method", "analytic", "--points", "faces"]
REVERSE = {"method": "analytic", "points": "faces"}
POSITIONS = "tent.vertex_positions"

SCENE = """<scene version="3.0.0">
  <integrator type="path"><integer name="max_depth" value="2"/></integrator>
  <sensor type="perspective">
    <float name="fov" value="40"/>
    <transform name="to_world"><lookat origin="0.7,3,5" target="0,0.5,0" up="0,1,0"/></transform>
    <film type="hdrfilm">
      <integer name="width" value="16"/><integer name="height" value="12"/>
      <string name="component_format" value="float32"/><rfilter type="box"/>
    </film>
  </sensor>
  <bsdf type="diffuse" id="clay"><rgb name="reflectance" value="0.7,0.5,0.3"/></bsdf>
  <shape type="obj" id="tent"><string name="filename" value="tent.obj"/>
    <bsdf type="twosided"><ref id="clay"/></bsdf></shape>
  <shape type="rectangle" id="floor">
    <transform name="to_world"><rotate x="1" angle="-90"/><scale value="4"/></transform>
    <ref id="clay"/>
  </shape>
  <shape type="rectangle" id="panel">
    <transform name="to_world"><rotate x="1" angle="90"/><translate y="4"/></transform>
    <emitter type="area" id="lamp"><rgb name="radiance" value="4,5,6"/></emitter>
  </shape>
</scene>
"""


@pytest.fixture
def lit(folder):
    """The tent under a flat lamp."""
    (folder / "lit.xml").write_text(SCENE)
    return limn.load(folder / "lit.xml")


@pytest.fixture
def run(folder):
    def run(command, *words):
        subprocess.run([os.environ["LIMN_PROGRAM"], command, str(folder / "lit.xml"), "--quiet",
                        *words], capture_output=True, check=True)  # fmt: skip
        return folder / "faces"

    return run


@pytest.mark.parametrize("threads", [1, 2])
def test_images_and_gradients_have_the_programs_bits(lit, run, folder, threads):
    file = str(folder / "faces.exr")
    image = limn.render(lit, threads=threads, **FACES)
    run("render", *WORDS, "-o", file)
    assert same(image.value, limn.read_exr(file)) and np.any(image.value)
    assert image.spp == 1
    name = "tent.translate.x"
    gradient = limn.gradient(lit, name, threads=threads, **FACES)[name]
    run("gradient", *WORDS, "--wrt", name, "-o", file)
    assert same(gradient.value, limn.read_exr(file)) and np.any(gradient.value)
    # Random points are others.
    assert not same(limn.render(lit, spp=1, method="analytic").value, image.value)


def test_a_check_says_what_the_program_says(lit, run, folder):
    check = limn.check(lit, "tent.translate.x", **FACES)
    run("check", *WORDS, "--wrt", "tent.translate.x", "--json", str(folder / "faces.json"))
    told = json.loads((folder / "faces.json").read_text())[0]
    assert isinstance(check, limn.FacesCheck) and check.verdict == told["verdict"] == "agree"
    for key in ("gradient_sum", "difference_sum", "error", "known", "step"):
        assert getattr(check, key) == told[key]
    assert check.gradient.value.shape == (12, 16, 3)


def test_a_reverse_pass_is_the_derivative_of_the_loss(lit, run, folder):
    target = limn.render(lit, **FACES).value * np.float32(1.3)
    limn.write_exr(folder / "target.exr", target)
    loss = limn.image_loss(lit, target, **FACES)
    slopes = limn.backward(lit, loss.adjoint, [POSITIONS, "tent.translate.x"], **REVERSE)
    output = run("backward", "--method", "analytic", "--points", "faces", "--wrt", POSITIONS,
                 "--target", str(folder / "target.exr"), "-o", str(folder / "faces"))  # fmt: skip
    assert loss.value == json.loads((output / "gradient.json").read_text())["loss"]["value"]
    assert np.array_equal(np.load(output / f"{POSITIONS}.npy"), slopes[POSITIONS].value)
    # Both images of a loss are one: no seed matters.
    assert limn.image_loss(lit, target, seed=5, **FACES).value == loss.value

    def moved(step):
        other = lit.copy()
        other.move("tent.translate.x", step)
        return limn.image_loss(other, target, **FACES).value

    # What differences miss shrinks with the step: by less than what they change from step to step.
    coarse, fine = ((moved(h) - moved(-h)) / (2 * h) for h in (1e-3, 1e-4))
    slope = float(slopes["tent.translate.x"])
    assert abs(slope - fine) < abs(fine - coarse) < 0.05 * abs(slope)


def test_a_fit_goes_the_programs_way(lit, run, folder):
    name = "tent.translate.x"
    limn.write_exr(folder / "target.exr", limn.render(lit, **FACES).value)
    start = lit.copy()
    start.move(name, 0.1)
    fit = limn.Fit(lit, limn.read_exr(folder / "target.exr") * 1.1, name, optimiser="lbfgs",
                   **REVERSE)  # fmt: skip
    fit.run(3)
    limn.write_exr(folder / "target.exr", limn.read_exr(folder / "target.exr") * 1.1)
    output = run("fit", "--no-report", "--target", str(folder / "target.exr"), "--wrt", name,
                 "--method", "analytic", "--points", "faces", "--optimiser", "lbfgs", "--steps",
                 "3", "-o", str(folder / "faces_fit")).parent / "faces_fit"  # fmt: skip
    told = json.loads((output / "fit.json").read_text())
    assert [r.loss for r in fit.history] == [r["loss"] for r in told["history"]]
    # And it finds back where the tent was.
    back = limn.Fit(start, limn.render(lit, **FACES), name, optimiser="lbfgs", **REVERSE)
    back.run(20)
    assert back.values[name] == pytest.approx(-0.1, abs=1e-3)


@pytest.mark.parametrize("call, text", [
    (lambda s, a: limn.render(s, points="face"), 'unknown points "face"'),
    (lambda s, a: limn.render(s, points="faces"), 'needs light in closed form.*"path"'),
    (lambda s, a: limn.render(s, spp=4, **FACES), 'spp: points "faces" take no samples'),
    (lambda s, a: limn.render(s, generator="sobol", **FACES), "error: generator: "),
    (lambda s, a: limn.gradient(s, "lamp.radiance", spp=4, **FACES), "error: spp: "),
    (lambda s, a: limn.gradient(s, "lamp.radiance", seconds=1, **FACES), "error: seconds: "),
    (lambda s, a: limn.gradient(s, "lamp.radiance", samples=[1, 1], **FACES), "error: samples: "),
    (lambda s, a: limn.check(s, "lamp.radiance", block=4, **FACES), "error: block: "),
    (lambda s, a: limn.backward(s, a, batches=4, **REVERSE), "error: batches: "),
    (lambda s, a: limn.backward(s, a, uniform_pixels=True, **REVERSE), "error: uniform_pixels: "),
    (lambda s, a: limn.backward(s, a, edge_samples=2, **REVERSE), "error: edge_samples: "),
    (lambda s, a: limn.backward(s, a, camera_samples=2, **REVERSE), "error: camera_samples: "),
    (lambda s, a: limn.backward(s, a, shadow_samples=2, **REVERSE), "error: shadow_samples: "),
    (lambda s, a: limn.backward(s, a, points="faces"), 'needs light in closed form.*"adaptive"'),
    (lambda s, a: limn.image_loss(s, a, spp=4, **FACES), "error: spp: "),
    (lambda s, a: limn.image_loss(s, a, points="faces"), "needs light in closed form"),
    (lambda s, a: limn.Fit(s, a, "lamp.radiance", loss_spp=2, **REVERSE), "error: loss_spp: "),
    (lambda s, a: limn.Fit(s, a, "lamp.radiance", spp_doubling=2, **REVERSE), "error: spp_doubling: "),
    (lambda s, a: limn.part((1, 2), limn.render, s, **FACES), "no parts"),
])  # fmt: skip
def test_what_is_refused(lit, call, text):
    with pytest.raises(limn.InputError, match=text):
        call(lit, np.ones((lit.height, lit.width), np.float32))
