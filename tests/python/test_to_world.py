"""Transforms in memory: scene["ID.to_world"] is what a file with that transform has."""

import limn
import numpy as np
import pytest

T = limn.Transform
TURN = T().translate([0.4, 0.1, -0.3]).rotate([0.2, 1, 0.1], 25)
STRETCH = TURN @ T().scale([1.5, 0.8, 1.1])

NORMALS = """v 0 1 0
v 1 0.2 0.1
v 0 0.3 -1.2
v -1 0.2 -0.1
vn 0.3 0.9 0.1
vn 0 1 0.2
vn -0.1 0.8 -0.4
f 1//1 2//2 3//3
f 1//1 3//3 4//2
"""

SCENE = """<scene version="3.0.0">
  <sensor type="perspective">
    <float name="fov" value="60"/>
    <transform name="to_world"><lookat origin="1,4,5" target="0,0.5,0" up="0,1,0"/></transform>
    <film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="12"/></film>
  </sensor>
  <shape type="obj" id="tent">
    <string name="filename" value="normals.obj"/>
    <transform name="to_world"><scale value="1.3"/>TENT</transform>
  </shape>
  <shape type="rectangle" id="floor">
    <transform name="to_world"><rotate x="1" angle="-90"/><scale value="4"/>FLOOR</transform>
    <bsdf type="diffuse"/>
  </shape>
  <shape type="sphere" id="ball">
    <float name="radius" value="0.4"/>
    <transform name="to_world"><translate value="1,2,0"/>BALL</transform>
    <emitter type="area" id="lamp"><rgb name="radiance" value="4,5,6"/></emitter>
  </shape>
  <emitter type="spot" id="beam">
    <float name="cutoff_angle" value="40"/>
    <transform name="to_world"><lookat origin="1,5,2" target="0,0,0" up="0,1,0"/>BEAM</transform>
  </emitter>
  <emitter type="point" id="bulb"><transform name="to_world"><translate value="0,3,1"/>BULB</transform></emitter>
  <emitter type="directional" id="sun"><transform name="to_world"><rotate x="1" angle="60"/>SUN</transform></emitter>
  <emitter type="envmap" id="sky">
    <string name="filename" value="sky.exr"/><float name="scale" value="0.5"/>
    <transform name="to_world">SKY</transform>
  </emitter>
</scene>"""


# The transforms in the file.
FIRST = {"tent": T().scale(1.3), "floor": T().scale(4) @ T().rotate([1, 0, 0], -90),
         "ball": T().translate([1, 2, 0]) @ T().scale(0.4), "bulb": T().translate([0, 3, 1]),
         "beam": T().look_at([1, 5, 2], [0, 0, 0], [0, 1, 0]), "sun": T().rotate([1, 0, 0], 60),
         "sky": T()}


def load(folder, **added):
    """The scene, with further steps after the transforms of these objects."""
    text = SCENE
    for name in ("tent", "floor", "ball", "beam", "bulb", "sun", "sky"):
        steps = added.get(name)
        matrix = "" if steps is None else " ".join(map(str, np.asarray(steps.matrix).ravel()))
        text = text.replace(name.upper(), matrix and f'<matrix value="{matrix}"/>')
    (folder / "normals.obj").write_text(NORMALS)
    limn.write_exr(folder / "sky.exr", np.random.default_rng(3).uniform(0, 1, (8, 16, 3)))
    return limn.load_string(text, folder)


pytestmark = pytest.mark.filterwarnings("ignore:.*faces block")


@pytest.mark.parametrize("name, matrix", [
    ("tent", TURN), ("tent", STRETCH), ("floor", STRETCH), ("ball", TURN), ("bulb", STRETCH),
    ("beam", TURN), ("sun", T().rotate([0, 1, 1], 20)), ("sky", T().rotate([0, 1, 0], 130))])
def test_is_what_a_file_with_it_has(tmp_path, name, matrix):
    scene, wanted = load(tmp_path), load(tmp_path, **{name: matrix})
    before = limn.render(scene, spp=4).value
    first = FIRST[name]
    np.testing.assert_allclose(scene[f"{name}.to_world"], first.matrix, atol=1e-7)
    scene.copy()[f"{name}.to_world"] = matrix @ first
    assert np.array_equal(limn.render(scene, spp=4).value, before)
    for _ in range(2):  # in place of the file's
        scene[f"{name}.to_world"] = matrix @ first
    if name not in ("sun", "bulb"):  # without place, without direction
        np.testing.assert_allclose(scene[f"{name}.to_world"], (matrix @ first).matrix, atol=1e-6)
    found, goal = (limn.render(s, spp=4).value for s in (scene, wanted))
    assert not np.allclose(found, before, rtol=1e-3)
    if name != "ball":  # of whose faces rounding chooses others
        np.testing.assert_allclose(found, goal, rtol=2e-3, atol=2e-4)
    if name in scene.shapes:
        np.testing.assert_allclose(*(s.mesh(name).positions for s in (scene, wanted)), atol=2e-6)
    scene[f"{name}.to_world"] = first
    np.testing.assert_allclose(limn.render(scene, spp=4).value, before, rtol=1e-3, atol=1e-4)


def test_a_light_is_placed_by_its_shape_or_itself(tmp_path):
    scene, other = load(tmp_path), load(tmp_path)
    scene["ball.to_world"], other["lamp.to_world"] = TURN, TURN.matrix
    assert np.array_equal(scene["ball.vertex_positions"], other["ball.vertex_positions"])
    assert np.array_equal(other["ball.to_world"], TURN.matrix)


def test_the_camera_has_its_pose(scene):
    pose = scene["sensor.to_world"]
    assert np.array_equal(pose, scene.sensor_to_world)
    scene["sensor.to_world"] = T().translate([0, 1, 0]) @ T(pose)
    np.testing.assert_allclose(scene.sensor_to_world[:3, 3], pose[:3, 3] + [0, 1, 0])


def test_the_selected_sensor_has_a_pose_by_its_id():
    look = T().look_at
    scene = limn.load_dict({
        "type": "scene", "ball": {"type": "sphere"},
        "left": {"type": "perspective", "to_world": look([-1, 0, 5], [0, 0, 0], [0, 1, 0])},
        "right": {"type": "perspective", "to_world": look([1, 0, 5], [0, 0, 0], [0, 1, 0])}})
    assert np.array_equal(scene["left.to_world"], scene.sensor_to_world)
    assert "right.to_world" not in scene and ".to_world" not in scene
    scene = scene.view("right")
    scene["right.to_world"] = look([2, 0, 5], [0, 0, 0], [0, 1, 0])
    np.testing.assert_allclose(scene["sensor.to_world"][:3, 3], [2, 0, 5])


def test_follows_what_moves_a_shape(scene):
    before, first = scene["tent.vertex_positions"].copy(), T(scene["tent.to_world"])
    center = (before.min(axis=0) + before.max(axis=0)) / 2
    scene["tent.to_world"] = T().translate([1, 2, 3]) @ first
    assert [scene[f"tent.translate.{x}"] for x in "xyz"] == pytest.approx([1, 2, 3])
    scene.move("tent.rotate.y", np.pi / 2)
    scene.move("tent.scale", 0.5)
    scene["tent.translate.x"] = 0
    about = T().rotate([0, 1, 0], 90).scale(1.5) @ T().translate(-center)
    wanted = (T().translate(center + [0, 2, 3]) @ about @ first).matrix
    np.testing.assert_allclose(scene["tent.to_world"], wanted, atol=1e-5)
    other = scene.copy()
    other["tent.to_world"] = scene["tent.to_world"]
    np.testing.assert_allclose(other["tent.vertex_positions"], scene["tent.vertex_positions"], atol=1e-5)
    other.move("tent.scale", -0.5)
    np.testing.assert_allclose(*(np.linalg.det(m) for m in (other["tent.to_world"], first.matrix)),
                               rtol=1e-4)


def test_flat_shapes_have_a_transform(scene):
    first = T(scene["floor.to_world"])
    scene.move("floor.rotate.x", 0.3)
    scene.move("floor.translate.y", 1)
    found = scene["floor.to_world"]
    turn = T().translate([0, 1, 0]).rotate([1, 0, 0], np.degrees(0.3)) @ first
    np.testing.assert_allclose(found, turn.matrix, atol=1e-6)


def test_fits_keep_it(scene):
    fit = limn.Fit(scene, limn.render(scene, spp=2).value, ["tent.translate.x", "tent.rotate.y"], spp=2)
    fit.run(3)
    found = fit.scenes[0]
    moved = found["tent.to_world"] @ np.linalg.inv(scene["tent.to_world"])
    assert not np.allclose(moved, np.eye(4))
    positions = scene["tent.vertex_positions"] @ moved[:3, :3].T + moved[:3, 3]
    np.testing.assert_allclose(positions, found["tent.vertex_positions"], atol=1e-5)


def test_begins_anew_where_vertices_were_moved_one_by_one(scene):
    first = T(scene["tent.to_world"])
    scene["tent.to_world"] = TURN
    scene.move("tent.vertex_positions.2.x", 0.2)
    bent = scene["tent.vertex_positions"].copy()
    np.testing.assert_array_equal(scene["tent.to_world"], first.matrix)
    scene["tent.to_world"] = T().translate([0, 1, 0]) @ first
    np.testing.assert_allclose(scene["tent.vertex_positions"], bent + [0, 1, 0], atol=1e-6)
    scene.set_mesh("tent", np.eye(3), [[0, 1, 2]])
    np.testing.assert_array_equal(scene["tent.to_world"], np.eye(4))


def test_what_is_refused_and_why(tmp_path, scene):
    placed = load(tmp_path)
    last = np.eye(4)
    last[3, 0] = 1
    for where, name, matrix, text in (
            (scene, "tent", T().scale([1, 1, -1]), "must not mirror or flatten"),
            (scene, "tent", np.zeros((4, 4)), "last row"),
            (scene, "tent", last, "last row"),
            (scene, "tent", np.eye(3), r"tent.to_world has shape \(4, 4\)"),
            (scene, "tent", np.full((4, 4), np.nan), "finite"),
            (scene, "tent", T().translate([1e13, 0, 0]), "cannot be 1e"),
            (scene, "sensor", T().scale(2), "camera"),
            (placed, "beam", T().scale([1, 2, 1]), "moved and rotated"),
            (placed, "sky", T().rotate([1, 0, 0], 20), "about the y axis alone"),
            (scene, "tend", np.eye(4), "tend.to_world")):
        before = limn.render(where, spp=1).value
        with pytest.raises(limn.InputError, match=text):
            where[f"{name}.to_world"] = matrix
        assert np.array_equal(limn.render(where, spp=1).value, before)
    assert "tent.to_world" in scene and "tend.to_world" not in scene
    assert "tent.to_world" not in scene.parameters


def test_not_what_moves_with_a_shutter(folder):
    text = (folder / "scene.xml").read_text().replace('<sensor type="perspective">',
        '<sensor type="perspective"><float name="shutter_open" value="0"/>'
        '<float name="shutter_close" value="1"/>')
    scene = limn.load_string(text, folder)
    first = scene["tent.to_world"]
    scene["tent.to_world"] = TURN  # nothing moves yet
    still = limn.render(scene, spp=2).value
    scene["tent.to_world"] = first
    scene["tent.velocity.x"] = 1
    with pytest.raises(limn.InputError, match="moves while a shutter is open"):
        scene["tent.to_world"] = TURN
    scene["tent.velocity.x"] = 0
    scene["tent.to_world"] = TURN
    assert np.array_equal(limn.render(scene, spp=2).value, still)


def test_goes_on_in_other_scenes(scene):
    scene["tent.to_world"] = TURN
    covered = limn.coverage(scene)
    np.testing.assert_allclose(covered["tent.to_world"], TURN.matrix)
    covered["tent.to_world"] = covered["tent.to_world"]
    np.testing.assert_allclose(*(s["tent.vertex_positions"] for s in (covered, scene)), atol=1e-6)
    tent = scene.mesh("tent")
    scene.set_mesh("tent", 2 * np.asarray(tent.positions) + 1, tent.faces)  # in world space
    np.testing.assert_array_equal(scene["tent.to_world"], np.eye(4))


def test_small_flat_shapes_far_away_have_a_transform(tmp_path):
    rng = np.random.default_rng(1)
    for _ in range(20):
        small = T().translate(rng.uniform(-7, 7, 3)).rotate(rng.uniform(-1, 1, 3), 40).scale(0.005)
        scene = load(tmp_path, floor=small)
        first = scene["floor.to_world"]
        scene.move("floor.translate.x", 0.5)
        scene.move("floor.translate.y", 0.1)
        moved = T().translate([0.5, 0.1, 0]).matrix @ first
        np.testing.assert_allclose(scene["floor.to_world"], moved, atol=1e-5)
