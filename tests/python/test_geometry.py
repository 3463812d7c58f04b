"""Poses, rays and motions of a scene in memory."""

import limn
import numpy as np
import pytest
from limn.motions import Motions


def look_at(origin, target):
    forward = np.subtract(target, origin) / np.linalg.norm(np.subtract(target, origin))
    left = np.cross([0, 1, 0], forward)
    left /= np.linalg.norm(left)
    pose = np.eye(4)
    pose[:3, :4] = np.stack([left, np.cross(forward, left), forward, origin], axis=1)
    return pose


def test_the_pose_is_that_of_the_file(scene):
    np.testing.assert_allclose(scene.sensor_to_world, look_at([1, 3, 5], [0, 0.5, 0]), atol=1e-12)


def test_a_pose_moves_the_camera(scene):
    moved = scene.copy()
    moved.sensor_to_world = look_at([2, 3, 5], [0, 0.5, 0])
    steps = scene.copy()
    steps["sensor.translate.x"] = 2
    assert moved["sensor.translate.x"] == 2 and scene["sensor.translate.x"] == 1
    assert not np.array_equal(limn.render(moved, spp=1).value, limn.render(steps, spp=1).value)
    steps.sensor_to_world = moved.sensor_to_world
    assert np.array_equal(limn.render(moved, spp=1).value, limn.render(steps, spp=1).value)


@pytest.mark.parametrize("pose", [2 * np.eye(4), np.full((4, 4), np.nan), np.eye(3),
                                  np.eye(4) + 1e13 * np.eye(4, k=3)])
def test_a_pose_that_no_camera_has(scene, pose):
    before = scene.sensor_to_world
    with pytest.raises(limn.InputError, match="camera|shape"):
        scene.sensor_to_world = pose
    assert np.array_equal(scene.sensor_to_world, before)


def test_rays_meet_what_is_there(scene):
    hits = scene.intersect([[0, 9, 3.5], [0, -9, 3.5], [50, 9, 0]], [[0, -2, 0], [0, 1, 0], [0, -1, 0]])
    floor = scene.shapes.index("floor")
    np.testing.assert_allclose(hits["t"][:2], 9, rtol=4 * np.finfo(np.float32).eps)
    assert hits["t"][2] == np.inf
    assert hits["shape"].tolist() == [floor, floor, -1] and hits["face"][2] == -1
    np.testing.assert_allclose(hits["normal"][:2], [[0, 1, 0]] * 2, atol=1e-7)
    mesh = scene.mesh("floor")
    a, b, c = mesh.positions[mesh.faces[hits["face"][0]]]
    u, v = hits["barycentric"][0]
    np.testing.assert_allclose((1 - u - v) * a + u * b + v * c, [0, 0, 3.5], atol=1e-6)
    np.testing.assert_allclose(hits["position"], [[0, 0, 3.5]] * 2 + [[0, 0, 0]], atol=1e-6)


def test_rays_find_texture_coordinates():
    scene = limn.load_dict({"type": "scene", "sensor": {"type": "perspective"}, "wall": {
        "type": "rectangle", "bsdf": {"type": "diffuse", "reflectance": {"type": "checkerboard"}}}})
    hits = scene.intersect([[0.5, -0.25, 3], [5, 0, 3]], [[0, 0, -1]] * 2)
    np.testing.assert_allclose(hits["uv"], [[0.75, 0.375], [0, 0]], atol=1e-6)


def test_rays_that_are_none(scene):
    for origins, directions, message in (([[0, 0, 0]], [[0, 0, 0]], "ray 0"),
                                         ([[0, 0, 0]] * 2, [[0, 0, 1]], "2 origins"),
                                         ([0, 0, 0], [0, 0, 1], "shape"),
                                         ([[0, 0, 0], [np.nan, 0, 0]], [[0, 0, 1]] * 2, "ray 1")):
        with pytest.raises(limn.InputError, match=message):
            scene.intersect(origins, directions)


def test_slopes_of_steps_are_those_of_the_vertices(scene, adjoint):
    """Where a loss has the slopes g with respect to the vertices, its slope with respect to a motion is
    the sum of g times the motion's velocity, of the same samples."""
    angle, grown, along = 0.7, 0.25, -0.3
    given = {"tent.rotate.y": np.array(angle), "tent.scale": np.array(grown),
             "tent.translate.x": np.array(along)}
    before = scene.mesh("tent").positions.astype(float)
    center = (before.min(axis=0) + before.max(axis=0)) / 2
    motions = Motions(scene, given)
    moved = motions.moved(scene)
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    from_center = (1 + grown) * (before - center) @ turn.T
    after = center + [along, 0, 0] + from_center
    np.testing.assert_allclose(moved.mesh("tent").positions, after, atol=1e-5)
    slopes = limn.backward(moved, adjoint, [*given, "tent.vertex_positions"], spp=8)
    g = slopes["tent.vertex_positions"].value
    for name, velocity in (("tent.rotate.y", np.cross([0, 1, 0], from_center)),
                           ("tent.scale", from_center / (1 + grown)),
                           ("tent.translate.x", np.array([1, 0, 0]) + 0 * before)):
        np.testing.assert_allclose(slopes[name].value, (g * velocity).sum(), rtol=1e-4,
                                   err_msg=name)


@pytest.mark.parametrize("owner", ["tent", "sensor"])
@pytest.mark.parametrize("turn", [[0.3, -0.7, 1.1], [1e-6, -2e-6, 0], [0, np.pi / 2, 0]])
def test_several_axes_are_one_rotation(scene, owner, turn):
    """By Rodrigues' formula; slopes as by differences of the turned vertices."""
    def rotated(w):
        angle = np.linalg.norm(w)
        k = np.cross(np.asarray(w) / angle, np.eye(3)).T
        return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k

    def given(w):
        return {f"{owner}.rotate.{a}": np.array(v) for a, v in zip("xyz", w)}

    motions = Motions(scene, given(turn))
    moved = motions.moved(scene)
    if owner == "sensor":
        expected = rotated(turn) @ scene.sensor_to_world[:3, :3]
        np.testing.assert_allclose(moved.sensor_to_world[:3, :3], expected, atol=1e-6)
        return
    before = scene.mesh("tent").positions.astype(float)
    center = (before.min(axis=0) + before.max(axis=0)) / 2
    arms = (before - center) @ rotated(turn).T
    np.testing.assert_allclose(moved.mesh("tent").positions, center + arms, atol=1e-5)
    weights = np.random.default_rng(1).normal(size=arms.shape)
    about = {f"tent.rotate.{a}": (weights * np.cross(e, arms)).sum()
             for a, e in zip("xyz", np.eye(3))}
    assert set(motions.needed(["tent.rotate.y"])) == set(about)
    slopes = motions.slopes(about)
    for k, axis in enumerate("xyz"):
        ends = [(weights * ((before - center) @ rotated(turn + s * np.eye(3)[k]).T)).sum()
                for s in (-1e-5, 1e-5)]
        np.testing.assert_allclose(slopes[f"tent.rotate.{axis}"], (ends[1] - ends[0]) / 2e-5,
                                   rtol=1e-4, atol=1e-5)


def test_turning_back_ends_where_it_began(scene):
    """The center of the tent's bounds moves as it turns; what it turns about does not."""
    before = scene.mesh("tent").positions.copy()
    for step in (0.5, 0.7, -0.4):
        scene.move("tent.rotate.x", step)
    scene.move("tent.translate.y", 2)
    scene.move("tent.scale", 0.5)
    centers = [(p.min(axis=0) + p.max(axis=0)) / 2 for p in (before, scene.mesh("tent").positions)]
    assert abs(centers[1] - centers[0] - [0, 2, 0]).max() > 0.01
    for name, step in (("tent.scale", -0.5), ("tent.rotate.x", -0.8), ("tent.translate.y", -2)):
        scene.move(name, step)
    np.testing.assert_allclose(scene.mesh("tent").positions, before, atol=2e-6)


def test_another_mesh_turns_about_its_own_bounds(scene):
    scene.move("tent.rotate.x", 0.5)
    scene["tent.vertex_positions"] = scene["tent.vertex_positions"] + np.float32([1, 0, 0])
    other = scene.copy()
    other.set_mesh("tent", scene.mesh("tent").positions, scene.mesh("tent").faces)
    for s in (scene, other):
        points = s.mesh("tent").positions
        center = (points.min(axis=0) + points.max(axis=0)) / 2
        s.move("tent.rotate.z", np.pi)
        turned = s.mesh("tent").positions
        np.testing.assert_allclose(turned[:, :2], (2 * center - points)[:, :2], atol=2e-6)


def test_steps_that_cannot_be_given(scene):
    for names, message in ((["tent.scale", "tent.vertex_positions"], "vertex positions and"),
                           (["tent.displacement"], "no value to give"),
                           (["tent.to_world"], '"tent.to_world" has no derivative: give translate')):
        with pytest.raises(limn.InputError, match=message):
            Motions(scene, {n: np.array(0.1) for n in names})


def test_sensors_of_dictionaries_have_names():
    sensor = {"type": "perspective", "film": {"type": "hdrfilm", "width": 4, "height": 4}}
    scene = limn.load_dict({"type": "scene", "left": sensor, "right": sensor})
    assert scene.sensors == ["left", "right"]
    assert scene.view("right").sensors == ["left", "right"]
