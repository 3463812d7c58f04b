"""A second opinion on the closed forms: Mitsuba 3 renders the same scenes, and moved ones.

For every scene the image and, for every parameter, the central difference (I(h) - I(-h)) / 2h are
compared with the SAME quantities of the closed form (so the step adds no bias). The standard errors
come from independent seeds; the two sides of a difference share a seed, which makes them correlate.
"""
import tempfile

import mitsuba as mi
import numpy as np

from closed_form_files import write_scene
from closed_form_geometry import moved
from closed_form_scenes import SCENES

SEEDS = 8
STEPS = [2.0**-k for k in range(3, 9)]
mi.set_variant("scalar_rgb")


def render(scene, folder, spp):
    """SEEDS images by height by width by 3."""
    loaded = mi.load_file(write_scene(scene, folder, moved=True), spp=str(spp), optimize=False)
    return np.stack([np.array(mi.render(loaded, seed=s, spp=spp)) for s in range(SEEDS)])


def z_scores(samples, expected):
    """(mean - expected) / standard error, where the samples vary; the rest must be equal."""
    mean = samples.mean(axis=0)
    error = samples.std(axis=0, ddof=1) / np.sqrt(len(samples))
    scale = np.max(np.abs(samples)) + np.max(np.abs(expected)) + 1e-30
    error = np.maximum(error, 2e-6 * scale)  # the rounding of single precision
    return (mean - expected) / error


def report(what, z, expected):
    """z follows Student's t with SEEDS - 1 degrees of freedom; its rms is then 1.18."""
    print(f"  {what:60s} rms z {np.sqrt(np.mean(z**2)):5.2f}  max |z| {np.max(np.abs(z)):5.2f}"
          f"  mean z {np.mean(z):5.2f}  largest value {np.max(np.abs(expected)):.4g}", flush=True)


def two_sides(scene, model, name):
    """The largest step that keeps within the closed form's domain; both scenes and their images."""
    for step in STEPS:
        both = [moved(scene, name, s * step) for s in (1, -1)]
        try:
            return step, both, [model.image(s, s, s, s, 12) for s in both]
        except AssertionError:
            continue
    raise ValueError(f"{scene.name}: no step is small enough for {name}")


def compare(keys, spp):
    with tempfile.TemporaryDirectory() as folder:
        for key in keys:
            print(key)
            scene, model, names = SCENES[key]()
            expected = model.image(scene, scene, scene, scene, 12)
            report("image", z_scores(render(scene, folder, spp), expected), expected)
            for name in names:
                step, both, images = two_sides(scene, model, name)
                samples = [render(s, folder, spp) for s in both]
                expected = (images[0] - images[1]) / (2 * step)
                report(name, z_scores((samples[0] - samples[1]) / (2 * step), expected), expected)
    return 0
