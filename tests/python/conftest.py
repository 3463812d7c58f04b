"""One small scene that has a bit of everything, and the program beside the module."""

import os
import subprocess

import limn
import numpy as np
import pytest

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))

SCENE = """<scene version="3.0.0">
  <default name="size" value="16"/>
  <default name="alpha" value="0.2"/>
  <sensor type="perspective">
    <float name="fov" value="40"/>
    <transform name="to_world"><lookat origin="1,3,5" target="0,0.5,0" up="0,1,0"/></transform>
    <sampler type="independent"><integer name="sample_count" value="4"/></sampler>
    <film type="hdrfilm">
      <integer name="width" value="$size"/><integer name="height" value="12"/>
      <string name="component_format" value="float32"/><rfilter type="box"/>
    </film>
  </sensor>
  <bsdf type="roughconductor" id="metal"><float name="alpha" value="$alpha"/></bsdf>
  <bsdf type="diffuse" id="clay"><rgb name="reflectance" value="0.7,0.5,0.3"/></bsdf>
  <shape type="obj" id="tent"><string name="filename" value="tent.obj"/><ref id="metal"/></shape>
  <shape type="rectangle" id="floor">
    <transform name="to_world"><rotate x="1" angle="-90"/><scale value="4"/></transform>
    <ref id="clay"/>
  </shape>
  <shape type="sphere" id="ball">
    <point name="center" value="-2,3,1"/><float name="radius" value="0.5"/>
    <emitter type="area" id="lamp"><rgb name="radiance" value="4,5,6"/></emitter>
  </shape>
  <emitter type="constant" id="sky"><rgb name="radiance" value="0.5"/></emitter>
  <emitter type="point" id="bulb"><point name="position" value="1,4,2"/></emitter>
</scene>
"""

# Four faces; the fifth vertex is a copy of the first, as along a seam of a texture.
TENT = """v 0 1 0
v 1 0.2 0.1
v 0 0.3 -1.2
v -1 0.2 -0.1
v 0 1 0
v 0.1 0.1 0.9
f 1 2 3
f 1 3 4
f 5 4 6
f 5 6 2
"""


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scene")
    (folder / "scene.xml").write_text(SCENE)
    (folder / "tent.obj").write_text(TENT)
    return folder


@pytest.fixture
def scene(folder):
    return limn.load(folder / "scene.xml")


@pytest.fixture
def program(folder):
    """Runs limn on the scene; the image that it wrote."""

    def run(command, *arguments):
        output = folder / "program.exr"
        words = [os.environ["LIMN_PROGRAM"], command, str(folder / "scene.xml"), "--quiet"]
        done = subprocess.run([*words, "-o", str(output), *arguments], capture_output=True,
                              text=True, check=False)
        assert done.returncode == 0, done.stderr
        return limn.read_exr(output)

    return run


@pytest.fixture
def adjoint(scene):
    return np.random.default_rng(3).normal(size=(scene.height, scene.width, 3)).astype(np.float32)
