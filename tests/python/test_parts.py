"""Runs in parts, joined."""

import pickle

import limn
import numpy as np
import pytest
from test_scene import same

NAMES = ["ball.translate.x", "metal.alpha"]


def parts_of(function, *arguments, n=3, **keywords):
    """Sent and back, as between processes; by other threads, in another order."""
    parts = [limn.part((k, n), function, *arguments, threads=1 + k % 2, **keywords)
             for k in range(n, 0, -1)]
    return pickle.loads(pickle.dumps(parts))  # noqa: S301


@pytest.mark.parametrize("arguments", [
    {"spp": 20},  # with a pilot
    {"spp": 4, "method": "fd"},
])
def test_a_gradient_has_the_bits_of_one_run(scene, arguments):
    joined = limn.merge(parts_of(limn.gradient, scene, NAMES, **arguments), scene)
    alone = limn.gradient(scene, NAMES, **arguments)
    assert list(joined) == NAMES
    for name in NAMES:
        assert same(joined[name].value, alone[name].value)
        assert same(joined[name].stderr, alone[name].stderr)
        assert joined[name].spp == alone[name].spp == arguments["spp"]


def test_a_reverse_pass_and_an_image_have_the_bits_of_one_run(scene):
    adjoint = np.ones((scene.height, scene.width), np.float32)
    joined = limn.merge(parts_of(limn.backward, scene, adjoint, spp=7, batches=5), scene)
    alone = limn.backward(scene, adjoint, spp=7, batches=5)
    assert list(joined) == list(alone) and len(alone) > 10
    for name in alone:
        assert np.array_equal(joined[name].value, alone[name].value)
        assert np.array_equal(joined[name].stderr, alone[name].stderr)
    for options in ({}, {"method": "silhouettes", "what": "ao"}):
        joined = limn.merge(parts_of(limn.render, scene, spp=5, **options), scene)
        assert same(joined.value, limn.render(scene, spp=5, **options).value)


def test_parts_that_do_not_fit_are_refused(scene):
    parts = parts_of(limn.gradient, scene, NAMES, spp=4)
    with pytest.raises(limn.InputError, match="part 2/3 is missing; 2 of 3 are given"):
        limn.merge([parts[0], parts[2]], scene)
    with pytest.raises(limn.InputError, match="each is needed once"):
        limn.merge([*parts, parts[0]], scene)
    alien = limn.part((1, 3), limn.gradient, scene, NAMES, spp=4, seed=1)
    with pytest.raises(limn.InputError, match="another run than .*: seed is 1, there 0"):
        limn.merge([*parts[:2], alien], scene)
    moved = scene.copy()
    moved["tent.vertex_positions"] = scene["tent.vertex_positions"] * 1.01
    with pytest.raises(limn.InputError, match="cannot be joined here: scene was"):
        limn.merge(parts, moved)
    with pytest.raises(limn.InputError, match="no parts are given"):
        limn.merge([], scene)
    with pytest.raises(limn.InputError, match="expected K/N"):
        limn.part((4, 3), limn.render, scene, spp=4)
    with pytest.raises(limn.InputError, match="takes no limit of time"):
        limn.part((1, 3), limn.gradient, scene, NAMES, seconds=1)
    with pytest.raises(limn.InputError, match="parts are made of backward, gradient, render"):
        limn.part((1, 3), limn.check, scene, NAMES[0])


def test_parts_know_how_high_a_parallel_view_is():
    low, high = (limn.load_string(f"""<scene version="3.0.0"><sensor type="orthographic">
        <transform name="to_world"><scale x="2" y="{y}"/></transform>
        <film type="hdrfilm"><integer name="width" value="4"/><integer name="height" value="4"/></film>
        </sensor><emitter type="constant"/></scene>""") for y in (1, 4))
    parts = [limn.part((k, 2), limn.render, s, spp=2) for k, s in ((1, low), (2, high))]
    with pytest.raises(limn.InputError, match="another run than .*: scene is"):
        limn.merge(parts, low)
