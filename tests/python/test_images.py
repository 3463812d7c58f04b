"""Images as files by their endings, and what notebooks show."""

import limn
import numpy as np
import pytest


def test_the_ending_chooses_the_format(scene, tmp_path):
    image = limn.render(scene, spp=2)
    limn.write_image(tmp_path / "a.exr", image)
    assert np.array_equal(limn.read_image(tmp_path / "a.exr"), image.value)
    limn.write_image(tmp_path / "a.png", image)
    limn.write_png(tmp_path / "b.png", image)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    shown = np.clip(image.value, 0, 1)
    assert np.abs(limn.read_image(tmp_path / "a.png") - shown).max() < 0.01
    slope = limn.gradient(scene, "sky.scale" if "sky.scale" in scene.parameters else "sky.radiance",
                          spp=2)
    (slope,) = slope.values()
    limn.write_image(tmp_path / "a.png", slope)
    limn.write_signed_png(tmp_path / "b.png", slope)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    assert slope.is_derivative and not image.is_derivative


@pytest.mark.parametrize("write", [limn.write_image, limn.write_png, limn.write_signed_png,
                                   limn.write_exr])
def test_other_endings_are_refused(write, tmp_path):
    with pytest.raises(limn.InputError, match="a.tif"):
        write(tmp_path / "a.tif", np.zeros((2, 2, 3)))
    assert not list(tmp_path.iterdir())


def test_notebooks_show_images(scene, tmp_path):
    image = limn.render(scene, spp=2)
    limn.write_png(tmp_path / "a.png", image)
    assert image._repr_png_() == (tmp_path / "a.png").read_bytes()
    positions = limn.backward(scene, image.value, ["tent.vertex_positions"], spp=2)
    assert positions["tent.vertex_positions"]._repr_png_() is None


def test_notebooks_show_layers_and_what_is_relit(folder, tmp_path):
    scene = limn.load(folder / "scene.xml")
    for name, layer in limn.layers(scene, ["normals", "depth", "uv"], spp=2).items():
        (tmp_path / "a.png").write_bytes(layer._repr_png_())
        shown = limn.read_image(tmp_path / "a.png")
        assert (shown.min(), shown.max()) == (0, 1 if np.ptp(layer) else 0), name
    assert layer[0]._repr_png_() is None and layer.mean() == np.asarray(layer).mean()
    scene = limn.load_dict({"type": "scene", "floor": {"type": "rectangle"},
                            "sensor": {"type": "perspective", "film": {"type": "hdrfilm", "width": 8,
                                                                      "height": 8},
                                       "to_world": limn.Transform().look_at([0, 0, 3], [0, 0, 0], [0, 1, 0])},
                            "integrator": {"type": "path", "max_depth": 2},
                            "sky": {"type": "constant"}})
    image = limn.bake(scene, spp=2, lines=4).relight(np.full((4, 8, 3), 0.5, np.float32))
    limn.write_png(tmp_path / "b.png", image)
    assert image._repr_png_() == (tmp_path / "b.png").read_bytes()


def test_estimates_have_what_arrays_have(scene):
    image = limn.render(scene, spp=2)
    assert image.mean() == image.value.mean()
    assert np.array_equal(image.sum(axis=2), image.value.sum(axis=2))
    with pytest.raises(AttributeError):
        image.nothing


def test_the_version():
    assert limn.__version__.count(".") == 2
