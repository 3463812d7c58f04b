"""Fits from Python: a value is found back, with the program's bits."""

import json
import os
import subprocess
import warnings

import limn
import numpy as np
import pytest


def test_a_colour_is_found_back(scene):
    target = limn.render(scene, spp=1024, seed=9).value
    start = scene.copy()
    truth = scene["clay.reflectance"]
    begin = truth + [-0.25, 0.2, 0.1]
    start["clay.reflectance"] = begin
    seen = []
    fit = limn.Fit(start, target, "clay.reflectance", spp=8, step=8, step_half_life=6, seed=1)
    fit.run(30, callback=lambda record: seen.append(record.step))
    assert seen == list(range(30)) and len(fit.history) == 30
    # Steps end before the last of Adam's overshoot is gone: eight seeds leave 0.125, 0.06 and 0.08
    # of the way, and are within 0.01 of one another.
    assert (abs(fit.values["clay.reflectance"] - truth) < 0.2 * abs(begin - truth)).all()
    np.testing.assert_array_equal(start["clay.reflectance"], begin)
    np.testing.assert_array_equal(fit.scenes[0]["clay.reflectance"], fit.values["clay.reflectance"])


def test_one_call_is_a_fit_and_its_run(scene):
    target = limn.render(scene, spp=64, seed=9)
    seen = []
    one = limn.fit(scene, target, "clay.reflectance", 3, lambda record: seen.append(record.step),
                   spp=2, seed=1, step=5)  # fmt: skip
    other = limn.Fit(scene, target, "clay.reflectance", spp=2, seed=1, step=5)
    other.run(3)
    assert seen == [0, 1, 2]
    np.testing.assert_array_equal(one.values["clay.reflectance"], other.values["clay.reflectance"])
    with pytest.raises(TypeError, match="sppp"):
        limn.fit(scene, target, "clay.reflectance", 1, sppp=2)


def test_results_have_the_names_that_were_given(scene):
    target = limn.render(scene, spp=16, seed=9)
    adjoint = limn.image_loss(scene, target, spp=4).adjoint
    ours, mitsubas = "clay.reflectance", "clay.reflectance.value"
    slopes = [limn.backward(scene, adjoint, name, spp=4)[name].value for name in (ours, mitsubas)]
    np.testing.assert_array_equal(*slopes)
    fits = [limn.fit(scene, target, name, 1, spp=2).values[name] for name in (ours, mitsubas)]
    np.testing.assert_array_equal(*fits)


def test_vertices_go_along_their_normals(scene):
    target = limn.render(scene, spp=64, seed=9)
    start = scene.copy()
    start.move("tent.translate.y", 0.2)
    before = start["tent.vertex_positions"].astype(float)
    fit = limn.fit(start, target, "tent.displacement", 3, spp=4, seed=1, step=2)
    moved = fit.scenes[0]["tent.vertex_positions"] - before
    assert np.linalg.norm(moved, axis=1).max() > 1e-3
    # What backward finds for vertices, along the normals, is what it finds for displacements.
    adjoint = limn.image_loss(start, target, spp=4).adjoint
    names = ["tent.vertex_positions", "tent.displacement"]
    found = limn.backward(start, adjoint, names, spp=4, seed=3)
    vertices, along = (found[n].value for n in names)
    assert along.shape == start.parameters["tent.displacement"].shape == (len(before),)
    going = moved / np.linalg.norm(moved, axis=1, keepdims=True)
    assert abs(along).max() > 0
    np.testing.assert_allclose(abs((vertices * going).sum(axis=1)), abs(along), rtol=1e-3,
                               atol=1e-5 * abs(along).max())
    np.testing.assert_array_equal(moved[0], moved[4])  # copies stay together


def test_bounds_hold(scene):
    least = scene["clay.reflectance"].min() - 0.01  # the target is black, and no step so short
    target = np.zeros((scene.height, scene.width, 3))
    fit = limn.Fit(scene, target, "clay.reflectance", spp=2, step=50,
                   bounds={"clay.reflectance": (least, 1)})  # fmt: skip
    fit.run(2)
    assert fit.values["clay.reflectance"].min() == least


VALUES = ["clay.reflectance", "lamp.radiance"]
BOUNDS = {"clay.reflectance": (0.25, 0.75), "lamp.radiance": (3.99, 7)}


# Every option changes what three steps find: the first loss, which has no step, the values at last.
@pytest.mark.parametrize("names, options, words", [
    (["tent.vertex_positions"], {}, []),
    (["tent.vertex_positions"], {"method": "uniform"}, ["--method", "uniform"]),
    (["tent.vertex_positions"], {"camera_samples": 2}, ["--camera-samples", "2"]),
    (["tent.vertex_positions"], {"shadow_samples": 2}, ["--shadow-samples", "2"]),
    (["tent.vertex_positions"], {"edge_samples": 3}, ["--edge-samples", "3"]),
    (["tent.vertex_positions"], {"uniform_pixels": True}, ["--pixels", "uniform"]),
    (["tent.vertex_positions"], {"smoothing": 0.3}, ["--smoothing", "0.3"]),
    (["tent.vertex_positions"], {"terms": ["interior"]}, ["--terms", "interior"]),
    (VALUES, {"loss": "relative-l2"}, ["--loss", "relative-l2"]),
    (VALUES, {"pyramid": 2}, ["--pyramid", "2"]),
    (VALUES, {"mask": True}, ["--mask", "mask.exr"]),
    (VALUES, {"optimiser": "gradient-descent"}, ["--optimiser", "gradient-descent"]),
    (VALUES, {"step": 3}, ["--step", "3"]),
    (VALUES, {"step_half_life": 1}, ["--step-half-life", "1"]),
    (VALUES, {"spp_doubling": 1}, ["--spp-doubling", "1"]),
    (VALUES, {"loss_spp": 3}, ["--loss-spp", "3"]),
    (VALUES, {"bounds": BOUNDS, "step": 9},
     ["--step", "9", "--bounds", "clay.reflectance=0.25,0.75", "--bounds", "lamp.radiance=3.99,7"]),
], ids=lambda x: " ".join(x) if isinstance(x, (list, dict)) else None)  # fmt: skip
def test_it_is_what_the_program_does(scene, tmp_path, folder, monkeypatch, names, options, words):
    monkeypatch.chdir(tmp_path)
    limn.write_exr("target.exr", limn.render(scene, spp=4, seed=9).value * 1.2)
    mask = np.random.default_rng(2).random((scene.height, scene.width), dtype=np.float32)
    limn.write_exr("mask.exr", mask)
    if "mask" in options:
        options = {"mask": mask}

    def found(own):
        fit = limn.Fit(scene, limn.read_exr("target.exr"), names, spp=2, seed=5, **own)
        fit.run(3)
        return [r.loss for r in fit.history], [fit.scenes[0][n].tolist() for n in names], fit

    subprocess.run([os.environ["LIMN_PROGRAM"], "fit", str(folder / "scene.xml"), "--quiet",
                    "--no-report", "--target", "target.exr", "--spp", "2", "--seed", "5", "--steps",
                    "3", "-o", "fit", *words, *[w for n in names for w in ("--wrt", n)]],
                   check=True)  # fmt: skip
    told = json.loads((tmp_path / "fit" / "fit.json").read_text())
    losses, values, fit = found(options)
    assert losses == [r["loss"] for r in told["history"]]
    scalars = [s["value"] for s in told["scalars"]]
    if scalars:
        assert np.ravel(values).tolist() == scalars
    else:
        mesh = limn.load_string(
            '<scene version="3.0.0"><sensor type="perspective"/><shape type="ply" id="m">'
            '<string name="filename" value="step_00003_tent.ply"/></shape></scene>',
            tmp_path / "fit").mesh("m")  # fmt: skip
        assert mesh.positions.tolist() == values[0]
    if options:
        assert found({})[:2] != (losses, values)


def test_errors_and_interrupts(scene):
    target = np.zeros((scene.height, scene.width, 3))
    with pytest.raises(limn.InputError, match="unknown optimiser"):
        limn.Fit(scene, target, "clay.reflectance", optimiser="sgd")
    with pytest.raises(limn.UnknownParameterError, match="clay.reflectance"):
        limn.Fit(scene, target, "clay.reflectanse")
    with pytest.raises(limn.InputError, match='unknown method "tree"'):
        limn.Fit(scene, target, "clay.reflectance", method="tree")
    with pytest.raises(limn.InputError, match='bounds of "lamp.radiance", which is not fitted'):
        limn.Fit(scene, target, "clay.reflectance", bounds={"lamp.radiance": (0, 1)})
    fit = limn.Fit(scene, target, "clay.reflectance", spp=64)

    def stop(_):
        raise KeyboardInterrupt

    before = fit.values
    with pytest.raises(KeyboardInterrupt):
        fit.step(progress=stop)
    assert len(fit.history) == (fit.values["clay.reflectance"] != before["clay.reflectance"]).any()


def test_a_late_interrupt_leaves_the_step_in_the_history(scene):
    target = np.zeros((scene.height, scene.width, 3))
    fit = limn.Fit(scene, target, "clay.reflectance", spp=1)

    def stop(_):
        raise KeyboardInterrupt

    for _ in range(100):  # the first one is late, unless the machine is very busy
        before, steps = fit.values, len(fit.history)
        with pytest.raises(KeyboardInterrupt):
            fit.step(progress=stop)
        moved = fit.values["clay.reflectance"] != before["clay.reflectance"]
        assert len(fit.history) - steps == moved.any()
        if fit.history:
            break
    assert [record.step for record in fit.history] == [0]


def test_a_fit_in_a_step_is_left_alone(scene):
    target = np.zeros((scene.height, scene.width, 3))
    fit = limn.Fit(scene, target, "clay.reflectance", spp=512)
    for use in (fit.step, lambda: fit.values, lambda: fit.scenes):
        told = []

        def meddle(_, use=use, told=told):
            with pytest.raises(limn.InputError, match="a step is under way"):
                use()
            told.append(1)

        fit.step(progress=meddle)
        assert told
    assert [record.step for record in fit.history] == [0, 1, 2]


def test_a_list_of_targets_is_of_the_sensors():
    sensor = {"type": "perspective", "film": {"type": "hdrfilm", "width": 6, "height": 4}}
    scene = limn.load_dict({"type": "scene", "left": sensor, "sky": {"type": "constant"}, "right": {
        **sensor, "to_world": limn.Transform().translate([0.2, 0, 0])},
        "ball": {"type": "sphere", "center": [0, 0, 4]}})
    targets = [limn.render(scene.view(i), spp=4) for i in (0, 1)]
    scene["ball.bsdf.reflectance"] = 0.3
    fits = [limn.fit(scene, targets, "ball.bsdf.reflectance", 2, spp=2),
            limn.fit(scene.view(1), targets, "ball.bsdf.reflectance", 2, spp=2),
            limn.fit(scene, targets[0], "ball.bsdf.reflectance", 2, spp=2,
                     views=[(scene.view("right"), targets[1].value)])]
    losses = [[record.loss for record in fit.history] for fit in fits]
    assert losses[0] == losses[1] == losses[2]
    assert len(fits[0].scenes) == 2
    stacked = limn.fit(scene, np.stack([t.value for t in targets]), "ball.bsdf.reflectance", 2, spp=2)
    assert [record.loss for record in stacked.history] == losses[0]
    with pytest.warns(UserWarning, match="the target is that of the first of 2 sensors"):
        limn.Fit(scene, targets[0], "ball.bsdf.reflectance", spp=2)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        limn.Fit(scene.view(0), targets[0], "ball.bsdf.reflectance", spp=2)
    with pytest.raises(limn.InputError, match="^error: target: 1 images for 2 sensors"):
        limn.Fit(scene, targets[:1], "ball.bsdf.reflectance")


def test_smoothing_is_a_share(scene):
    target = np.zeros((scene.height, scene.width, 3))
    with pytest.warns(UserWarning, match="smoothing 25 .* it is a share of the shape's diagonal"):
        limn.Fit(scene, target, "tent.vertex_positions", smoothing=25)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        limn.Fit(scene, target, "clay.reflectance", smoothing=25)


# Of values near 1, as Adam's rate elsewhere: step=5 moves by 5 % of the value.
def test_five_steps_are_five_percent(scene):
    scene["clay.reflectance"] = 0.8
    fit = limn.fit(scene, np.zeros((scene.height, scene.width, 3)), "clay.reflectance", 1, step=5, spp=4)
    np.testing.assert_allclose(fit.values["clay.reflectance"], 0.8 * 0.95, rtol=1e-6)


@pytest.mark.parametrize("view, text", [
    ((1, 2), r"^views\[0\]: error: expected \(scene, target\)"),
    (3, r"^views\[0\]: error: expected \(scene, target\)"),
    ("target", r"^views\[0\]: error: the target has 2 x 2 pixels"),
    ("mask", r"^views\[0\]: error: the mask's channels differ in column 0, row 0"),
])
def test_views_that_do_not_fit_are_named(scene, view, text):
    target = np.zeros((scene.height, scene.width, 3))
    coloured = np.ones_like(target)
    coloured[0, 0, 1] = 0
    view = {"target": (scene, np.zeros((2, 2, 3))), "mask": (scene, target, coloured)}.get(view, view)
    with pytest.raises(limn.InputError, match=text):
        limn.Fit(scene, target, "clay.reflectance", views=[view])


def test_distances_between_meshes():
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
    faces = [[0, 1, 2], [0, 2, 3]]
    found = limn.mesh_distance(square + [0, 0, 0.25], faces, square, faces)
    assert found["chamfer"] == pytest.approx(0.25) and found["normal_angle"] == 0
    assert found["hausdorff"] == pytest.approx(0.25)
    with pytest.raises(limn.InputError, match="truth"):
        limn.mesh_distance(square, faces, square * np.nan, faces)
