"""The module as such: names, documentation, stubs, examples, silence."""

import ast
import glob
import inspect
import os
import re
import subprocess
import sys

import limn
import numpy as np
import pytest
from conftest import ROOT
from limn import _processor
from limn._processor import missing

EXAMPLES = os.path.join(ROOT, "tools", "python", "examples")
STUB = os.path.join(os.path.dirname(limn.__file__), "_limn.pyi")


def public():
    """(name, object) of all that users see, members of classes included."""
    for name in limn.__all__:
        thing = getattr(limn, name)
        yield name, thing
        if inspect.isclass(thing) and not issubclass(thing, Exception):
            for member in (m for m in vars(thing) if not m.startswith("_")):
                yield f"{name}.{member}", getattr(thing, member)


def test_every_public_name_is_documented():
    # What a mapping has needs no words of its own.
    known = {"Parameters.keys", "Parameters.values", "Parameters.items"}
    bare = [name for name, thing in public() if name not in known and not thing.__doc__]
    assert bare == []


def test_the_stub_has_every_public_name():
    with open(STUB, encoding="utf-8") as stream:
        tree = ast.parse(stream.read())
    found = set()
    for node in tree.body:
        if isinstance(node, (ast.ClassDef, ast.FunctionDef)):
            found.add(node.name)
        if isinstance(node, ast.ClassDef):
            found |= {f"{node.name}.{m.name}" for m in node.body if isinstance(m, ast.FunctionDef)}
    bound = {name for name in limn.__all__ if getattr(limn, name).__module__ == "limn._limn"}
    assert len(bound) > 20
    assert {name for name, _ in public() if name.split(".")[0] in bound} <= found
    assert os.path.exists(os.path.join(os.path.dirname(limn.__file__), "py.typed"))


def stub_defaults(name, function):
    """The defaults that the stub tells of a function, or of a class's method."""
    with open(STUB, encoding="utf-8") as stream:
        nodes = ast.parse(stream.read()).body
    for part in (name, function):
        found = [n for n in nodes if getattr(n, "name", None) == part]
        if part == function or not isinstance(found[0], ast.ClassDef):
            break
        nodes = found[0].body
    arguments = found[0].args
    names = [a.arg for a in arguments.args][len(arguments.args) - len(arguments.defaults):]
    names += [a.arg for a in arguments.kwonlyargs]
    defaults = arguments.defaults + arguments.kw_defaults
    return {n: ast.literal_eval(d) for n, d in zip(names, defaults)}


# A signature is a text beside the code: what it says must be what is done without a word.
def test_the_stubs_defaults_are_those_of_the_code(scene):
    own = {"spp": 4, "seed": 3}
    adjoint = np.random.default_rng(3).normal(size=(scene.height, scene.width, 3))
    told = stub_defaults("backward", "backward") | own
    assert {"edge_samples", "camera_samples", "shadow_samples", "batches", "method"} <= set(told)
    plain, said = limn.backward(scene, adjoint, **own), limn.backward(scene, adjoint, **told)
    for name in plain:
        np.testing.assert_array_equal(plain[name].value, said[name].value)
        np.testing.assert_array_equal(plain[name].stderr, said[name].stderr)
    more = limn.backward(scene, adjoint, **{**told, "camera_samples": 2})
    moved = "tent.vertex_positions"
    assert (more[moved].value != plain[moved].value).any()
    target = np.zeros((scene.height, scene.width, 3))
    told = stub_defaults("Fit", "__init__") | own
    assert {"edge_samples", "camera_samples", "uniform_pixels", "step"} <= set(told)
    fits = [limn.Fit(scene, target, moved, **o) for o in (own, told)]
    for fit in fits:
        fit.run(1)
    assert fits[0].history[0].loss == fits[1].history[0].loss
    np.testing.assert_array_equal(*(fit.scenes[0][moved] for fit in fits))


def test_wheels_tell_what_a_processor_lacks():
    info = "processor\t: 0\nflags\t\t: fpu avx fma\nbugs\t: none\n"
    assert missing("avx2 fma bmi2", info) == ["avx2", "bmi2"]
    assert missing("avx fma", info) == missing("avx2", "processor\t: 0\n") == []


@pytest.mark.skipif(not os.path.exists("/proc/cpuinfo"), reason="no list of instruction sets")
def test_wheels_choose_the_build_that_the_processor_runs(monkeypatch, tmp_path):
    monkeypatch.setattr(_processor, "_FOLDER", str(tmp_path))
    assert _processor.choose() == [] and _processor.program().endswith("bin/limn")
    (tmp_path / "v4").mkdir()
    (tmp_path / "v4" / "needs").write_text("fpu\n")
    assert _processor.choose() == [str(tmp_path / "v4")]
    assert _processor.program().endswith("bin/limn-v4")
    (tmp_path / "v4" / "needs").write_text("fpu future\n")
    assert _processor.choose() == []
    (tmp_path / "needs").write_text("future\n")
    with pytest.raises(ImportError, match="lacks future, which this wheel needs"):
        _processor.choose()


# PyTorch may not be there, and has no types of its own for what is subclassed.
def test_types_hold(tmp_path):
    pytest.importorskip("mypy")
    package = os.path.dirname(limn.__file__)
    (tmp_path / "use.py").write_text(
        "import limn\n"
        "scene = limn.load('a.xml', width=2)\n"
        "error: float = limn.gradient(scene, 'a.scale', spp=2)['a.scale'].stderr.max()\n"
        "limn.render(scene, spp='2')  # type: ignore[arg-type]\n")
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "--ignore-missing-imports",
         "--allow-subclassing-any", "--allow-untyped-decorators",
         "--cache-dir", str(tmp_path / "cache"), package, "use.py"],
        cwd=tmp_path, env={**os.environ, "MYPYPATH": os.path.dirname(package)},
        capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


def test_importing_says_nothing_and_starts_nothing():
    code = ("import sys, threading, limn\n"
            "assert threading.active_count() == 1\n"
            "assert not {'jax', 'torch'} & {*sys.modules}")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout + done.stderr == ""


def test_naming_a_bridge_imports_it():
    pytest.importorskip("jax")
    done = subprocess.run([sys.executable, "-c", "import limn; limn.jax.render"],
                          capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    with pytest.raises(AttributeError, match="module 'limn' has no attribute 'cupy'"):
        limn.cupy


# As PyTorch, scikit-learn and others load it. Its thread-local variables need space that the loader
# has little of, which a module must leave.
@pytest.mark.parametrize("order", ["limn, openmp", "openmp, limn"])
def test_openmp_loads_beside_it(tmp_path, order):
    (tmp_path / "openmp.py").write_text("import ctypes; ctypes.CDLL('libgomp.so.1')")
    run = {"cwd": tmp_path, "capture_output": True, "text": True, "check": False}
    if subprocess.run([sys.executable, "-c", "import openmp"], **run).returncode:
        pytest.skip("no libgomp.so.1")
    done = subprocess.run([sys.executable, "-c", f"import {order}"], **run)
    assert done.returncode == 0, done.stderr


# nanobind tells at the end what was not given back.
def test_runs_print_nothing_and_leak_nothing(folder):
    code = ("import limn\n"
            f"s = limn.load({str(folder / 'scene.xml')!r})\n"
            "v = s['tent.vertex_positions']; p = s.parameters; m = s.mesh('tent')\n"
            "e = limn.gradient(s, 'tent.scale', spp=2); limn.render(s, spp=1)\n"
            "try: s['x']\n"
            "except KeyError: pass\n")
    done = subprocess.run([sys.executable, "-W", "ignore::UserWarning", "-c", code],
                          capture_output=True, text=True, check=True)
    assert done.stdout + done.stderr == ""


@pytest.mark.parametrize("file", sorted(glob.glob(os.path.join(EXAMPLES, "*.py"))),
                         ids=os.path.basename)
def test_examples_run(file, tmp_path):
    if "dask" in file:
        pytest.importorskip("dask.distributed")
    if "torch" in file:
        pytest.importorskip("torch")
    done = subprocess.run([sys.executable, file, "--quick"], cwd=tmp_path, capture_output=True,
                          text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "leak" not in done.stderr
    assert list(tmp_path.glob("*.png"))


def test_the_ten_lines_run(tmp_path):
    with open(os.path.join(ROOT, "README.md"), encoding="utf-8") as stream:
        (lines,) = re.findall(r"^    import limn\n(?:    .*\n)+", stream.read(), re.MULTILINE)
    os.symlink(os.path.join(ROOT, "tools"), tmp_path / "tools")
    code = re.sub("^    ", "", lines, flags=re.MULTILINE).replace("spp=64", "spp=4")
    done = subprocess.run([sys.executable, "-W", "error", "-c", code], cwd=tmp_path,
                          capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert re.fullmatch(r"\(\d+, 3\) \S+\n", done.stdout)
    assert (tmp_path / "image.png").exists() and (tmp_path / "change.png").exists()
