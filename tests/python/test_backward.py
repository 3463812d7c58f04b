"""Reverse mode from Python: against forward mode, with its bits, and for PyTorch."""

import json
import math
import os
import subprocess

import limn
import numpy as np
import pytest
from limn.motions import Motions
from test_scene import same

POSITIONS = "tent.vertex_positions"


# Two sides, 5 sigma: 6e-7 for each number.
def test_reverse_dotted_with_a_motion_is_forward(scene, adjoint):
    names = ["clay.reflectance", "lamp.radiance", "sensor.fov", "ball.translate.x", "tent.scale"]
    reverse = limn.backward(scene, adjoint, spp=64, seed=1)
    # Displacements repeat what vertices have.
    assert list(reverse) == [n for n in scene.parameters if not n.endswith(".displacement")]
    forward = limn.gradient(scene, [*names, "tent.translate.y"], spp=64, seed=2)

    def compare(name, value, error):
        expected = np.vdot(adjoint, forward[name].value)
        # Pixels of one run are as good as independent; samples of paths are.
        spread = np.hypot(error, np.linalg.norm(adjoint * forward[name].stderr))
        assert spread > 0
        assert abs(value - expected) < 5 * spread, name

    for name in names:
        found = reverse[name]
        assert found.value.shape == scene.parameters[name].shape and found.value.dtype == np.float64
        assert found.value.shape == ((3,) if name.endswith(("reflectance", "radiance")) else ())
        # The channels of a colour add up to what they do together; their errors are tied.
        compare(name, found.value.sum(), found.stderr.sum())
    part = limn.backward(scene, adjoint, "lamp.radiance.g", spp=64, seed=1)["lamp.radiance.g"]
    assert part.value.shape == ()
    assert float(part) == pytest.approx(reverse["lamp.radiance"].value[1], rel=1e-9)
    moved = reverse[POSITIONS]
    assert moved.value.shape == (6, 3) and moved.stderr.shape == (6, 3)
    assert np.array_equal(moved.value[0], moved.value[4])  # copies share
    # The whole shape's motion is a parameter of its own, with the same samples.
    whole = reverse["tent.translate.y"]
    assert moved.value[:, 1].sum() == pytest.approx(float(whole.value), rel=1e-9)
    compare("tent.translate.y", float(whole.value), float(whole.stderr))


DULL = {"type": "roughconductor", "alpha": 0.3}
BSDFS = {
    "diffuse": {"type": "diffuse"},
    "isotropic": DULL,
    "anisotropic": {"type": "roughconductor", "alpha_u": 0.4, "alpha_v": 0.1},
    "normal map": {"type": "normalmap", "bsdf": DULL,
                   "normalmap": {"type": "bitmap", "raw": True, "data": np.random.default_rng(1)
                                 .random((4, 4, 3)).astype(np.float32) * 0.3 + 0.4}},
    "principled": {"type": "principled", "roughness": 0.4, "anisotropic": 0.8, "spec_tint": 0.5},
}


@pytest.mark.parametrize("bsdf", BSDFS)
def test_both_modes_are_equal_along_the_same_paths(bsdf):
    scene = limn.load_dict({
        "type": "scene", "integrator": {"type": "path", "max_depth": 3},
        "sensor": {"type": "perspective", "fov": 40,
                   "to_world": limn.Transform().look_at([1, 1, 4], [0, 0, 0], [0, 1, 0]),
                   "film": {"type": "hdrfilm", "width": 4, "height": 4, "rfilter": {"type": "box"}}},
        "ball": {"type": "sphere", "bsdf": BSDFS[bsdf]},
        "lamp": {"type": "point", "position": [2, 3, 4]},
        "sky": {"type": "constant"}})
    run = {"spp": 16, "seed": 3, "method": "forest", "terms": ["interior"]}
    adjoint = np.random.default_rng(2).random((4, 4, 3), dtype=np.float32)
    names = [n for n, p in scene.parameters.items() if p.shape == ()]
    assert {"ball.translate.x", "ball.rotate.y", "sensor.fov"} < set(names)
    forward = limn.gradient(scene, names, samples=[1], **run)
    reverse = limn.backward(scene, adjoint, names, uniform_pixels=True, **run)
    for name in names:
        products = adjoint * forward[name].value.astype(float)
        # What images keep of a number, of all that may have cancelled.
        rounding = 2.0**-23 * np.abs(products).sum() + 1e-12
        assert abs(float(reverse[name].value) - products.sum()) <= rounding, name


def run_program(folder, *words):
    """The output's folder, and what is in its report. The scene may follow any option."""
    output = folder / "backward"
    subprocess.run([os.environ["LIMN_PROGRAM"], "backward", "--quiet", "-o", str(output), *words,
                    str(folder / "scene.xml")], check=True)
    return output, json.loads((output / "gradient.json").read_text())


@pytest.mark.parametrize("threads", [1, 2])
def test_it_has_the_programs_bits(folder, scene, adjoint, threads):
    limn.write_exr(folder / "adjoint.exr", adjoint)
    output, told = run_program(folder, "--adjoint", str(folder / "adjoint.exr"), "--spp", "4",
                               "--seed", "9")
    found = limn.backward(scene, adjoint, spp=4, seed=9, threads=threads)
    for row in told["parameters"]:
        estimate = found[row["name"]]
        if "array" not in row:
            assert estimate.value.tolist() == row["value"]
            assert estimate.stderr.tolist() == row["stderr"]
    assert np.array_equal(np.load(output / f"{POSITIONS}.npy"), found[POSITIONS].value)
    heights = "tent.displacement"
    output, _ = run_program(folder, "--adjoint", str(folder / "adjoint.exr"), "--spp", "4",
                            "--seed", "9", "--wrt", heights)
    found = limn.backward(scene, adjoint, heights, spp=4, seed=9, threads=threads)
    assert np.array_equal(np.load(output / f"{heights}.npy"), found[heights].value)
    # With a loss, and half of what can be asked for.
    target = np.asarray(limn.render(scene, spp=16, seed=4)) * np.float32(1.5)
    limn.write_exr(folder / "target.exr", target)
    output, told = run_program(folder, "--target", str(folder / "target.exr"), "--loss",
                               "relative-l2", "--spp", "4", "--terms",
                               "interior,boundary", "--pixels", "uniform", "--edge-samples", "2",
                               "--method", "uniform", "--wrt", POSITIONS)
    loss = limn.image_loss(scene, target, "relative-l2", spp=4, threads=threads)
    assert (loss.value, loss.stderr) == (told["loss"]["value"], told["loss"]["stderr"])
    found = limn.backward(scene, loss.adjoint, POSITIONS, spp=4, terms=["interior", "boundary"],
                          uniform_pixels=True, edge_samples=2, threads=threads, method="uniform")
    assert np.array_equal(np.load(output / f"{POSITIONS}.npy"), found[POSITIONS].value)


def test_a_step_against_the_gradient_lowers_the_loss(scene):
    target = limn.render(scene, spp=256, seed=11)
    scene.move("tent.translate.y", 0.2)
    loss = limn.image_loss(scene, target, spp=256, seed=1)
    assert loss.value > 5 * loss.stderr > 0
    assert loss.adjoint.shape == (12, 16, 3)
    g = limn.backward(scene, loss.adjoint, POSITIONS, spp=32, seed=1)[POSITIONS].value
    before = scene[POSITIONS]
    scene[POSITIONS] = before - 0.2 * g / np.abs(g).max()
    after = limn.image_loss(scene, target, spp=256, seed=2)
    assert after.value + 3 * after.stderr < loss.value - 3 * loss.stderr


def test_what_prints_say(scene, adjoint):
    name = "tent.translate.x"
    slope = limn.backward(scene, adjoint, name, spp=4)[name]
    assert repr(slope).startswith(f"<limn.Estimate: {float(slope):.6g} +- {slope.stderr:.2g}, 4 spp")
    assert repr(limn.render(scene, spp=2)).startswith("<limn.Estimate: (12, 16, 3), 2 spp")
    fit = limn.Fit(scene, adjoint, name, spp=2)
    assert repr(fit) == "<limn.Fit: no steps>"
    loss = fit.step().loss
    assert repr(fit).startswith(f"<limn.Fit: 1 step, loss {loss:.4g} +- ")


@pytest.mark.parametrize("call, text", [
    (lambda s, a: limn.backward(s, a[:5]), "adjoint"),
    (lambda s, a: limn.backward(s, a * np.nan), "adjoint"),
    (lambda s, a: limn.backward(s, a, terms=["none"]), "term"),
    (lambda s, a: limn.backward(s, a, edge_samples=0), "edge_samples: 0 is not a number from"),
    (lambda s, a: limn.backward(s, a, camera_samples=math.inf), "camera_samples: (inf|nan) is not a number"),
    (lambda s, a: limn.backward(s, a, camera_samples=math.nan), "camera_samples: (inf|nan) is not a number"),
    (lambda s, a: limn.image_loss(s, a[:5]), "target"),
    (lambda s, a: limn.image_loss(s, a, "l3"), "known: "),
])
def test_what_is_refused(scene, adjoint, call, text):
    with pytest.raises(limn.InputError, match=text):
        call(scene, adjoint)


def test_unknown_names_are_key_errors(scene, adjoint):
    with pytest.raises(KeyError, match="nearest"):
        limn.backward(scene, adjoint, "tent.vertices")


# PyTorch is not among what tests install.
def torch_and_bridge():
    torch = pytest.importorskip("torch")
    import limn.torch

    return torch, limn.torch


def test_torch_gets_what_backward_finds(scene, adjoint):
    torch, bridge = torch_and_bridge()
    values = {POSITIONS: torch.tensor(scene[POSITIONS] + 0.05, requires_grad=True),
              "clay.reflectance": torch.tensor([0.6, 0.5, 0.4], dtype=torch.float64,
                                               requires_grad=True),
              "metal.alpha": torch.tensor(0.3)}
    before = limn.render(scene, spp=2).value
    image = bridge.render(scene, values, spp=2, spp_grad=8, seed=4)
    assert same(limn.render(scene, spp=2).value, before)
    assert image.shape == (12, 16, 3) and image.dtype == torch.float32
    (image * torch.from_numpy(adjoint)).sum().backward()
    for name, tensor in values.items():
        scene[name] = tensor.detach().numpy()
    assert same(image.detach().numpy(), limn.render(scene, spp=2, seed=8).value)
    expected = limn.backward(scene, adjoint, POSITIONS, spp=8, seed=9)[POSITIONS]
    found = values[POSITIONS].grad
    assert found.dtype == torch.float32
    assert np.array_equal(found.numpy(), expected.value.astype(np.float32))
    channels = values["clay.reflectance"].grad
    assert channels.dtype == torch.float64 and channels.shape == (3,)
    expected = limn.backward(scene, adjoint, list(values)[:2], spp=8, seed=9)["clay.reflectance"]
    assert np.array_equal(channels.numpy(), expected.value)
    # Channels never mix: channel c of the forward image is what channel c of the colour does.
    forward = limn.gradient(scene, "clay.reflectance", spp=64, seed=10)["clay.reflectance"]
    error = np.hypot(expected.stderr, np.linalg.norm(adjoint * forward.stderr, axis=(0, 1)))
    assert (abs(channels.numpy() - (adjoint * forward.value).sum((0, 1))) < 5 * error).all()
    assert values["metal.alpha"].grad is None


def test_torch_refuses_arrays_without_a_value_and_second_derivatives(scene):
    torch, bridge = torch_and_bridge()
    with pytest.raises(limn.InputError, match="has no value to give"):
        bridge.render(scene, {"tent.displacement": torch.tensor(0.1)})
    with pytest.raises(limn.InputError, match='"tent.to_world" has no derivative'):
        bridge.render(scene, {"tent.to_world": torch.eye(4)})
    fov = torch.tensor(41.0, dtype=torch.float64, requires_grad=True)
    image = bridge.render(scene, {"sensor.fov": fov}, spp=2)
    slope, = torch.autograd.grad((image**2).sum(), fov, create_graph=True)
    with pytest.raises(RuntimeError, match="differentiate twice"):
        slope.backward()


# Installed by tools/python/venv where PyPI has it.
def test_jax_gets_what_backward_finds(scene, adjoint):
    jax = pytest.importorskip("jax")
    import limn.jax as bridge

    values = {POSITIONS: scene[POSITIONS] + np.float32(0.05), "metal.alpha": np.float32(0.3),
              "clay.reflectance": np.float32(0.5), "ball.translate.x": np.float32(0.1)}

    def loss(values, seed):
        image = bridge.render(scene, values, spp=2, spp_grad=8, seed=seed)
        return (image * adjoint).sum(), image

    with pytest.raises(limn.InputError, match='"tent.to_world" has no derivative'):
        jax.jit(loss)({"tent.to_world": np.eye(4)}, 4)
    before = limn.render(scene, spp=2).value
    for run in (loss, jax.jit(loss)):  # the seed is traced in the second
        (_, image), found = jax.value_and_grad(run, has_aux=True)(values, 4)
        moved = scene.copy()
        for name, value in values.items():
            if name != "ball.translate.x":
                moved[name] = value
        moved.move("ball.translate.x", values["ball.translate.x"])
        assert same(np.asarray(image), limn.render(moved, spp=2, seed=8).value)
        expected = limn.backward(moved, np.asarray(adjoint, np.float32), list(values), spp=8,
                                 seed=9)
        for name, value in values.items():
            slope = expected[name].value
            slope = slope if slope.size == value.size else slope.sum()
            assert np.array_equal(found[name], np.float32(slope))
    assert same(limn.render(scene, spp=2).value, before)


STEPS = {"tent.rotate.y": 0.375, "tent.scale": 0.25, "ball.scale": 0.5}  # floats


@pytest.fixture
def stepped(scene):
    """The scene with these steps, and weights of pixels for which no slope is near 0."""
    moved = scene.copy()
    for name in ("tent.scale", "tent.rotate.y", "ball.scale"):
        moved.move(name, STEPS[name])
    images = limn.gradient(moved, list(STEPS), spp=64, seed=11).values()
    return moved, sum(i.value / np.linalg.norm(i.value) for i in images).astype(np.float32)


def check_steps(stepped, image, found):
    """Slopes of (image * weights).sum() are those of derivative images, up to their noise."""
    moved, weights = stepped
    assert same(image, limn.render(moved, spp=2, seed=8).value)
    reverse = limn.backward(moved, weights, list(STEPS), spp=64, seed=9)
    for name, forward in limn.gradient(moved, list(STEPS), spp=64, seed=10).items():
        error = np.hypot(reverse[name].stderr, np.linalg.norm(weights * forward.stderr))
        expected = (weights * forward.value).sum()
        assert abs(found[name] - expected) < 4 * error < abs(expected), name


def test_steps_through_jax_have_the_slopes_of_derivative_images(scene, stepped):
    jax = pytest.importorskip("jax")
    import limn.jax as bridge

    def loss(values):
        image = bridge.render(scene, values, spp=2, spp_grad=64, seed=4)
        return (image * stepped[1]).sum(), image

    (_, image), found = jax.value_and_grad(loss, has_aux=True)(STEPS)
    check_steps(stepped, np.asarray(image), found)


def test_steps_through_torch_have_the_slopes_of_derivative_images(scene, stepped):
    torch, bridge = torch_and_bridge()
    values = {n: torch.tensor(v, dtype=torch.float64, requires_grad=True) for n, v in STEPS.items()}
    image = bridge.render(scene, values, spp=2, spp_grad=64, seed=4)
    (image * torch.from_numpy(stepped[1])).sum().backward()
    check_steps(stepped, image.detach().numpy(), {n: v.grad.item() for n, v in values.items()})


# Two axes of three: slopes of a rotation vector (test_geometry) from those about all axes.
def check_turns(scene, loss_slopes):
    turn = {"tent.rotate.x": 0.25, "tent.rotate.z": -0.5}
    motions = Motions(scene, {n: np.array(v) for n, v in turn.items()})
    moved, names = motions.moved(scene), ["tent.rotate.x", "tent.rotate.z", "tent.rotate.y"]
    ones = np.ones((scene.height, scene.width, 3), np.float32)
    about = limn.backward(moved, ones, names, spp=8, seed=9)
    expected = motions.slopes({n: about[n].value for n in names})
    for name, slope in loss_slopes(turn).items():
        assert slope == pytest.approx(expected[name], rel=1e-5)


def test_turns_about_several_axes_through_jax(scene):
    jax = pytest.importorskip("jax")
    import limn.jax as bridge

    check_turns(scene, jax.grad(lambda v: bridge.render(scene, v, 2, 8, seed=4).sum()))


def test_turns_about_several_axes_through_torch(scene):
    torch, bridge = torch_and_bridge()

    def slopes(turn):
        values = {n: torch.tensor(v, requires_grad=True) for n, v in turn.items()}
        bridge.render(scene, values, 2, 8, seed=4).sum().backward()
        return {n: v.grad.item() for n, v in values.items()}

    check_turns(scene, slopes)


# About z by a right angle; then Rodrigues' formula, whose derivative at rest is a cross product.
def check_pose(pose, derivative):
    p = np.array([[0, 0, 0], [2, 0, 0], [0, 4, 2]], dtype=float)
    assert np.allclose(pose(p, [0, 0, np.pi / 2], [0, 0, 1]),
                       [[3, 1, 1], [3, 3, 1], [-1, 1, 3]], atol=1e-6)
    axis, angle = np.array([0.6, 0, 0.8]), 0.7
    arm = p - [1, 2, 1]
    turned = (arm * np.cos(angle) + np.cross(axis, arm) * np.sin(angle)
              + np.outer(arm @ axis, axis) * (1 - np.cos(angle)))
    assert np.allclose(pose(p, axis * angle, [0, 0, 0]), turned + [1, 2, 1], atol=1e-6)
    expected = np.stack([np.cross(e, arm) for e in np.eye(3)], axis=-1)
    assert np.allclose(derivative(p), expected, atol=1e-6)


def test_pose_of_jax():
    jax = pytest.importorskip("jax")
    import limn.jax as bridge

    check_pose(bridge.pose, lambda p: jax.jacobian(lambda t: bridge.pose(p, t))(np.zeros(3)))


def test_pose_of_torch():
    torch, bridge = torch_and_bridge()

    def pose(*arrays):
        return bridge.pose(*map(torch.tensor, arrays)).numpy()

    check_pose(pose, lambda p: torch.autograd.functional.jacobian(
        lambda t: bridge.pose(torch.tensor(p), t), torch.zeros(3, dtype=torch.float64)).numpy())


def test_a_limit_of_time_gives_as_many_samples_as_fit(scene, adjoint):
    name = "metal.alpha"
    short = limn.backward(scene, adjoint, name, seconds=0.01)[name]
    long = limn.backward(scene, adjoint, name, seconds=1)[name]
    assert 2 <= short.spp < long.spp
    assert np.isfinite(short.stderr) and long.stderr > 0
