"""Runs: the program's bits, threads, interruption, and what stays usable."""

import json
import os
import subprocess
import sys
import textwrap
import threading
import time

import limn
import numpy as np
import pytest
from conftest import ROOT
from test_scene import same

sys.path.insert(0, os.path.join(ROOT, "tools"))
import exr  # noqa: E402


@pytest.mark.parametrize("threads", [1, 2])
def test_render_has_the_programs_bits(scene, program, threads):
    estimate = limn.render(scene, spp=5, seed=3, threads=threads)
    independent = ("--generator", "independent")
    assert same(estimate.value, program("render", "--spp", "5", "--seed", "3", *independent))
    assert estimate.spp == 5 and estimate.seconds > 0 and estimate.warnings == []
    assert same(limn.render(scene).value, program("render", *independent))
    assert same(limn.render(scene, generator="sobol").value, program("render"))


def test_layers_have_the_programs_bits(folder, scene):
    names = ["normals", "depth", "uv", "alpha"]
    layers = limn.layers(scene, names, spp=4, seed=3)
    file = str(folder / "layers.exr")
    subprocess.run([os.environ["LIMN_PROGRAM"], "render", str(folder / "scene.xml"), "--spp", "4",
                    "--seed", "3", "--what", ",".join(names), "-o", file, "--quiet"], check=True)
    wanted = exr.read(file)
    assert list(layers) == names and layers["uv"].shape == (12, 16, 2)
    for name, channels in zip(names, ("XYZ", "Y", "UV", "Y")):
        for i, channel in enumerate(channels):
            assert same(layers[name][..., i], wanted[f"{name}.{channel}"].astype(np.float32))
    assert layers["alpha"].max() == 1 and limn.layers(scene, "depth", spp=1)["depth"].shape[2] == 1
    with pytest.raises(limn.InputError, match="normals"):
        limn.layers(scene, "normal")
    with pytest.raises(limn.InputError, match="no layer is named .known: normals"):
        limn.layers(scene, [])


def test_an_estimate_computes_like_its_value(scene):
    image = limn.render(scene, spp=2)
    value, other = image.value, np.full_like(image.value, 0.5)
    assert image.shape == value.shape == np.shape(image) and image.dtype == np.float32
    assert len(image) == len(value) and same(image[2:, ..., 1], value[2:, ..., 1])
    for found, expected in [
        (image + other, value + other), (other + image, other + value), (1 + image, 1 + value),
        (image - image, value - value), (2.5 - image, 2.5 - value), (other - image, other - value),
        (image * 3, value * 3), (3 * image, 3 * value), (image / other, value / other),
        (1 / (1 + image), 1 / (1 + value)), (1 / image[:1, :1], 1 / value[:1, :1]),
        (-image, -value), (abs(-image), value), ((image - other) ** 2, (value - other) ** 2),
        (image**2, value**2),
    ]:
        assert same(found, expected)
    fov = limn.backward(scene, np.ones(image.shape, np.float32), "sensor.fov", spp=2)["sensor.fov"]
    assert float(fov) == fov.value[()]
    with pytest.raises(ValueError):
        image + np.zeros((2, 2, 2))


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("arguments, words", [
    ({"spp": 3, "seed": 7}, ["--spp", "3", "--seed", "7"]),
    ({"spp": 4, "method": "li2019", "samples": [1, 0.5, 2]},
     ["--spp", "4", "--method", "li2019", "--samples", "1,0.5,2"]),
    ({"spp": 20, "terms": ["camera"], "samples": "uniform"},
     ["--spp", "20", "--terms", "camera", "--samples", "uniform"]),
    ({"spp": 2, "method": "was", "aux": 4, "kappa": 1e3},
     ["--spp", "2", "--method", "was", "--aux", "4", "--kappa", "1e3"]),
    ({"spp": 2, "method": "fd", "step": 0.01}, ["--spp", "2", "--method", "fd", "--step", "0.01"]),
])
def test_gradient_has_the_programs_bits(folder, scene, program, threads, arguments, words):
    name = "tent.vertex_positions.0.y"
    gradient = limn.gradient(scene, name, threads=threads, **arguments)
    assert list(gradient) == [name]
    assert np.any(gradient[name].value)
    assert same(gradient[name].value, program("gradient", "--wrt", name, *words))
    assert same(gradient[name].stderr, limn.read_exr(folder / "program_stderr.exr"))


@pytest.mark.parametrize("method, told", [("fd", "step found by"), ("fastest", "chosen")])
def test_gradients_say_how_their_method_was_set_up(folder, scene, method, told):
    words = ["gradient", str(folder / "scene.xml"), "--wrt", "tent.translate.y", "--spp", "16",
             "--method", method, "-o", str(folder / "set_up.exr"), "--quiet", "--json"]
    program = subprocess.run([os.environ["LIMN_PROGRAM"], *words, str(folder / "set_up.json")],
                             check=False)
    assert program.returncode == 0
    moved = limn.gradient(scene, "tent.translate.y", 16, method=method)["tent.translate.y"]
    assert moved.settings == json.loads((folder / "set_up.json").read_text())["settings"]
    assert told in moved.settings and "settings" not in repr(moved)
    assert limn.render(scene, 1).settings == {}


def test_backward_says_which_method_ran(scene):
    slopes = limn.backward(scene, np.ones((12, 16, 3)), "tent.translate.y", 2048)
    found = slopes["tent.translate.y"].settings
    assert set(found) == {"method", "pilot"} and found["method"] in limn.methods()
    plain = limn.backward(scene, np.ones((12, 16, 3)), "tent.translate.y", 64, method="silhouettes")
    assert plain["tent.translate.y"].settings == {}


def test_what_a_camera_sees_looks_around(scene):
    with pytest.raises(limn.InputError, match='"bulb"'):
        limn.render(scene, method="rays", what="direct")
    by_lines = limn.render(scene, spp=2, method="lines", what="ao", lines=16, tolerance=0.01)
    assert np.all(by_lines.value >= -1e-6) and np.all(by_lines.value <= 1 + 1e-6)
    by_rays = limn.render(scene, spp=64, method="rays", what="ao")
    assert abs(np.mean(by_lines.value) - np.mean(by_rays.value)) < 0.02
    with pytest.raises(limn.InputError, match='unknown what "sky"'):
        limn.render(scene, what="sky")
    for wrong in ({"lines": 0}, {"tolerance": -1.0}):
        with pytest.raises(limn.InputError, match=next(iter(wrong))):
            limn.render(scene, method="silhouettes", what="ao", **wrong)
    with pytest.raises(limn.InputError, match="what: direct"):
        limn.render(scene, method="rays")


def test_methods_are_known_by_name(scene):
    with pytest.raises(limn.InputError, match='unknown method "bidirectional"'):
        limn.render(scene, method="bidirectional")
    for method in ("path", "rays"):
        with pytest.raises(limn.InputError, match='unknown generator "sobel"'):
            limn.render(scene, method=method, generator="sobel")
    with pytest.raises(limn.InputError, match='the method "analytic": '):
        limn.render(scene, method="analytic")


@pytest.mark.parametrize("call, text", [
    (lambda s, a: limn.gradient(s, []), "names: at least one"),
    (lambda s, a: limn.backward(s, a, []), "names: none are given"),
    (lambda s, a: limn.gradient(s, "tent.scale", method="fd", step=-1), "step: -1 is not a number from"),
    (lambda s, a: limn.gradient(s, "tent.scale", method="fd", step=float("nan")), "step: "),
    (lambda s, a: limn.gradient(s, "tent.scale", samples=[1e9] * 3), "at most 1024"),
    (lambda s, a: limn.check(s, "tent.scale", step=-1, spp=2), "step: -1 is not a number from"),
])
def test_arguments_that_mean_nothing_are_refused_at_once(scene, call, text):
    with pytest.raises(limn.InputError, match=text):
        call(scene, np.ones((scene.height, scene.width, 3)))


def test_several_parameters_are_one_run(scene):
    names = ["ball.translate.x", "metal.alpha", "sensor.fov", "bulb.intensity", "tent.scale"]
    together = limn.gradient(scene, names, spp=2)
    assert list(together) == names
    for name in names:
        assert np.any(together[name].value), name


def test_estimates_are_arrays(scene):
    estimate = limn.render(scene, spp=2)
    assert np.shares_memory(np.asarray(estimate), estimate.value)
    assert np.asarray(estimate, dtype=np.float64).dtype == np.float64
    copy = np.array(estimate)
    assert not np.shares_memory(copy, estimate.value) and same(copy, estimate.value)
    assert same(np.asarray(estimate) * 2, estimate.value * 2)
    assert np.isnan(limn.render(scene, spp=1).stderr).all()
    value = estimate.value
    del estimate
    assert value.sum() > 0


def test_check_and_compare_say_what_the_program_says(folder, scene):
    check = limn.check(scene, "tent.translate.y", spp=16, threads=2)
    words = [os.environ["LIMN_PROGRAM"], "check", str(folder / "scene.xml"), "--wrt",
             "tent.translate.y", "--spp", "16", "--quiet", "--json", str(folder / "check.json")]
    subprocess.run(words, capture_output=True, check=False)
    told = json.loads((folder / "check.json").read_text())[0]
    assert check.verdict == told["verdict"] and check.p == told["p"]
    assert check.found == told["smallest_at"] and check.step == told["step"]
    assert check.gradient_sum == told["gradient_sum"] and check.z_sum == told["z_sum"]
    assert check.gradient.value.shape == check.differences.value.shape == (12, 16, 3)
    assert check.gradient.is_derivative and check.differences.is_derivative
    with pytest.raises(limn.InputError, match="check needs spp of at least 2"):
        limn.check(scene, "tent.translate.y", spp=1)
    with pytest.raises(limn.InputError, match="are for the method was"):
        limn.check(scene, "tent.translate.y", spp=2, aux=4)
    with pytest.raises(limn.InputError, match="none of the methods adaptive, fd has any"):
        limn.compare(scene, "tent.translate.y", ["adaptive", "fd"], [0.05], kappa=1e3)
    comparison = limn.compare(scene, "tent.translate.y", ["adaptive", "fd"], [0.05, 0.1],
                              repeats=2, reference_seconds=0.3)
    assert [m.name for m in comparison.methods] == ["adaptive", "fd"]
    assert comparison.reference.value.shape == (12, 16, 3) and comparison.reference.spp > 1
    assert comparison.reference.is_derivative
    for method in comparison.methods:
        assert len(method.budgets) == 2 and method.budgets[1].mse[1] > 0 and method.message == ""
        assert method.image.shape == (12, 16, 3)
    assert comparison.methods[0].time_ratio[0] == pytest.approx(1)


def test_info_says_what_the_program_says(folder, scene):
    file = folder / "info.json"
    subprocess.run([os.environ["LIMN_PROGRAM"], "info", str(folder / "scene.xml"), "--json",
                    str(file)], capture_output=True, check=True)
    told = json.loads(file.read_text())
    assert told.pop("warnings") == []
    assert limn.info(scene) == told


def test_time_limits_and_progress(scene):
    told = []
    limn.gradient(scene, "tent.scale", seconds=0.4, progress=told.append)
    assert told and told == sorted(told) and 0 < told[0] and told[-1] <= 1


class Stop(Exception):
    pass


def test_an_exception_of_progress_ends_the_run(scene):
    def stop(_):
        raise Stop

    began = time.process_time()
    with pytest.raises(Stop):
        limn.render(scene, spp=1 << 24, progress=stop, threads=2)
    assert time.process_time() - began < 5
    assert limn.render(scene, spp=1).spp == 1


# A process of its own: the signal goes to its main thread alone, and comes while it renders. Clocks
# are the processor's: other work on the machine makes nothing late.
INTERRUPTED = """
    import os, signal, sys, threading, time
    import limn
    signal.signal(signal.SIGINT, signal.default_int_handler)  # shells' background jobs ignore it
    scene = limn.load(sys.argv[1])
    ticks, sent, stop = [], [], threading.Event()
    def tick():
        while not stop.wait(0.005):
            ticks.append(time.process_time())
    def kick():  # with the GIL held there would be no ticks
        while len(ticks) < 10 or ticks[-1] < ticks[0] + 0.4:
            time.sleep(0.005)
        sent.append(time.process_time())
        os.kill(os.getpid(), signal.SIGINT)
    for run in (lambda: limn.render(scene, spp=1 << 24, threads=2),
                lambda: limn.gradient(scene, "tent.scale", spp=1 << 24, threads=2),
                lambda: limn.backward(scene, [[1] * 16] * 12, spp=1 << 24, threads=2),
                lambda: limn.check(scene, "tent.scale", spp=1 << 22, threads=2)):
        ticks.clear()
        stop.clear()
        threads = [threading.Thread(target=f) for f in (tick, kick)]
        for thread in threads:
            thread.start()
        try:
            run()
            sys.exit("no KeyboardInterrupt")
        except KeyboardInterrupt:
            print(time.process_time() - sent[-1])
        stop.set()
        for thread in threads:
            thread.join()
        assert limn.render(scene, spp=1).spp == 1
"""


def test_control_c_ends_runs_and_other_threads_go_on(folder):
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(INTERRUPTED),
                           str(folder / "scene.xml")], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    late = [float(line) for line in done.stdout.splitlines()]
    assert len(late) == 4 and max(late) < 1


def test_runs_in_several_threads_are_those_in_one(scene):
    expected = [limn.render(scene, spp=4, seed=seed).value for seed in range(4)]
    found = [None] * 4

    def run(seed):
        found[seed] = limn.render(scene, spp=4, seed=seed).value

    threads = [threading.Thread(target=run, args=(seed,)) for seed in range(4)]
    for thread in threads:
        thread.start()
    scene["metal.alpha"] = 0.9  # runs that were started keep what they were started with
    for thread in threads:
        thread.join()
    scene["metal.alpha"] = 0.2
    for seed in range(4):
        again = limn.render(scene, spp=4, seed=seed).value
        assert same(again, expected[seed])


def test_another_process_by_spawn_renders(folder):
    code = ("import multiprocessing as m, sys, limn\n"
            "def f(file): return float(limn.render(limn.load(file), spp=2).value.sum())\n"
            "if __name__ == '__main__':\n"
            "    a = f(sys.argv[1])\n"
            "    with m.get_context('spawn').Pool(1) as pool: b = pool.map(f, sys.argv[1:])[0]\n"
            "    assert a == b, (a, b)\n")
    (folder / "spawn.py").write_text(code)
    subprocess.run([sys.executable, str(folder / "spawn.py"), str(folder / "scene.xml")], check=True)


def test_samples_that_are_not_finite_raise_with_the_result(folder, scene):
    scene["lamp.radiance"] = 1e308
    with pytest.raises(limn.NonFiniteError, match="non-finite sample") as caught:
        limn.render(scene, spp=2)
    assert isinstance(caught.value, ArithmeticError)
    assert caught.value.result.value.shape == (12, 16, 3)
    assert np.isfinite(caught.value.result.value).all()


def resident_kilobytes():
    with open("/proc/self/statm", encoding="ascii") as stream:
        return int(stream.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1024


# A scene with its views is about 60 kB here; what allocators keep is gone after the first hundred.
def test_scenes_that_are_dropped_leave_no_memory(folder):
    def make(count):
        for _ in range(count):
            scene = limn.load(folder / "scene.xml")
            view = scene["ball.vertex_positions"]
            scene["ball.vertex_positions"] = view
            limn.render(scene, spp=1, threads=1)

    make(50)
    before = resident_kilobytes()
    make(200)
    assert resident_kilobytes() - before < 200 * 60 / 4
