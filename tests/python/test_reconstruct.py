"""From photographs to an object: what is read, what is told of bad folders, what comes out."""

import dataclasses
import json
import os
import subprocess
import sys
import tempfile
import warnings

import limn
import numpy as np
import photo_folders as pf
import pytest
from limn.photo_cameras import read_cameras
from limn.photo_fit import PhotoFit, Plan, posed
from limn.photo_hull import checked, marching_tetrahedra, visual_hull
from limn.photo_model import Model, scenes_of
from limn.photo_output import baked, psnr, rendered, unwrapped, write_glb, write_model
from limn.photo_views import View, _resampled, read_views
from limn.reconstruction import _most_faces


@pytest.fixture(scope="session")
def photographs():
    poses = [pf.pose_of(e) for e in pf.EYES]
    return poses, [pf.photograph(p) for p in poses]


@pytest.fixture
def egg(tmp_path, photographs):
    """A folder that nothing is wrong with."""
    poses, images = photographs
    pf.write_transforms(tmp_path, poses)
    for i, image in enumerate(images):
        pf.write_png(tmp_path / "images" / f"{i}.png", image)
    return tmp_path


def read(folder):
    return checked(read_views(str(folder), pf.SIZE), read_cameras(str(folder))[1])


def test_every_file_of_cameras_says_the_same(tmp_path, photographs):
    poses, _ = photographs
    pf.write_transforms(tmp_path, poses)
    told = [read_cameras(str(tmp_path))[0]]
    os.remove(tmp_path / "transforms.json")
    for binary in (False, True):
        pf.write_colmap(tmp_path, poses, binary)
        cameras, place = read_cameras(str(tmp_path))
        assert place.endswith("sparse/0")
        told.append(cameras)
    for cameras in told:
        assert [os.path.basename(c.image) for c in cameras] == [f"{i}.png" for i in range(8)]
        for c, pose in zip(cameras, poses):
            np.testing.assert_allclose(c.to_world, pose, atol=1e-12)
            assert c.focal == (40, 40) and c.center == (16, 16) and not any(c.distortion)


@pytest.mark.parametrize("name, number, parameters, distortion", [
    ("SIMPLE_PINHOLE", 0, (50, 15, 17), (0, 0, 0, 0)),
    ("SIMPLE_RADIAL", 2, (50, 15, 17, 0.1), (0.1, 0, 0, 0)),
    ("RADIAL", 3, (50, 15, 17, 0.1, 0.2), (0.1, 0.2, 0, 0)),
    ("OPENCV", 4, (50, 50, 15, 17, 0.1, 0.2, 0.3, 0.4), (0.1, 0.2, 0.3, 0.4)),
])  # fmt: skip
def test_camera_models(tmp_path, photographs, name, number, parameters, distortion):
    for binary in (False, True):
        folder = tmp_path / str(binary)
        folder.mkdir()
        pf.write_colmap(folder, photographs[0], binary, (name, number, parameters))
        camera = read_cameras(str(folder))[0][0]
        assert camera.focal == (50, 50) and camera.center == (15, 17)
        assert camera.distortion == distortion


def test_a_view_s_sensor_sees_what_the_view_says():
    # A small ball off the axis, by a camera whose principal point is far off the middle.
    places = np.array([[0.5, 0.2, -0.1], [-0.4, -0.3, 0.2]])
    view = View("a", "a", np.zeros((40, 60, 3)), np.zeros((40, 60)), None, 55.0, (22.0, 25.0),
                pf.pose_of((2, 1.5, -2)))  # fmt: skip
    ball = limn.load_string('<scene version="3.0.0"><sensor type="perspective"/>'
                            '<shape type="sphere" id="o"><float name="radius" value="0.03"/>'
                            '</shape></scene>').mesh("o")  # fmt: skip
    for place in places:
        model = Model(ball.positions + place, ball.faces, np.full((len(ball.positions), 3), 0.5))
        image = limn.render(scenes_of_model(model, [view]), spp=256).value[..., 0]
        rows, columns = np.indices(image.shape)
        middle = np.array([(columns + 0.5) * image, (rows + 0.5) * image]).sum(axis=(1, 2))
        at, depth = view.project(place[None])
        assert depth > 0
        np.testing.assert_allclose(middle / image.sum(), at[0], atol=0.05)


def scenes_of_model(model, views):
    with tempfile.TemporaryDirectory() as folder:
        return scenes_of(model, views, folder)[1].view(0)


def test_distortion_is_undone(tmp_path, photographs):
    pf.write_colmap(tmp_path, photographs[0], False,
                    ("OPENCV", 4, (36, 40, 15, 17, -0.2, 0.05, 0.01, -0.02)))  # fmt: skip
    camera = read_cameras(str(tmp_path))[0][0]
    # The photograph shows a quadratic of the directions: where each pixel looks, by Newton's steps.
    x, y = np.meshgrid(np.arange(pf.SIZE) + 0.5, np.arange(pf.SIZE) + 0.5)
    u, v = (x - 15) / 36, (y - 17) / 40
    k1, k2, p1, p2 = camera.distortion
    a, b = u.copy(), v.copy()
    for _ in range(50):
        r2 = a * a + b * b
        radial = 1 + k1 * r2 + k2 * r2 * r2
        a = (u - 2 * p1 * a * b - p2 * (r2 + 2 * a * a)) / radial
        b = (v - p1 * (r2 + 2 * b * b) - 2 * p2 * a * b) / radial

    def shown(x, y):
        return np.stack([x + 0.3, y * x, y * y], -1)

    found, known, focal, center = _resampled(camera, shown(a, b), pf.SIZE)
    assert (focal, center) == (36, (15, 17)) and 0.7 < known.mean() < 1
    inner = known.copy()
    inner[:2] = inner[-2:] = inner[:, :2] = inner[:, -2:] = False
    truth = shown((x - 15) / 36, (y - 17) / 36)
    # Bilinear interpolation errs by an eighth of second differences: 2 / 36^2 at most, and the
    # pixel's shape by as much.
    assert abs(found - truth)[inner].max() < 0.5 * 2 / 36**2
    plain, whole, _, _ = _resampled(pf_pinhole(camera), shown(a, b), pf.SIZE)
    assert whole.all() and (plain == shown(a, b)).all()
    assert abs(shown(a, b) - truth)[inner].max() > 0.02


def pf_pinhole(camera):
    return dataclasses.replace(camera, focal=(36, 36), distortion=(0, 0, 0, 0), width=32, height=32)


def test_photographs_come_as_they_are(egg, photographs):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        views = read(egg)
    assert len(views) == 8
    for view, image in zip(views, photographs[1]):
        np.testing.assert_allclose(view.mask, image[..., 3], atol=1 / 255)
        inside = view.mask == 1
        np.testing.assert_allclose(pf.srgb(view.image)[inside], image[inside][:, :3], atol=1 / 255)
        assert (view.image[view.mask == 0] == 0).all()


@pytest.mark.parametrize("file", ["masks/{}.png", "masks/{}.png.png", "images/{}_mask.png"])
def test_masks_may_be_files(egg, photographs, file):
    for i, image in enumerate(photographs[1]):
        pf.write_png(egg / "images" / f"{i}.png", image[..., :3])
        pf.write_png(egg / file.format(i), image[..., 3])
    for view, image in zip(read(egg), photographs[1]):
        np.testing.assert_allclose(view.mask, image[..., 3], atol=1 / 255)


def test_exr_photographs_are_linear(egg, photographs):
    told = json.loads((egg / "transforms.json").read_text())
    for i, image in enumerate(photographs[1]):
        limn.write_exr(egg / "images" / f"{i}.exr", 2 * image[..., :3])
        pf.write_png(egg / "masks" / f"{i}.png", image[..., 3])
        told["frames"][i]["file_path"] = f"images/{i}.exr"
    (egg / "transforms.json").write_text(json.dumps(told))
    for view, image in zip(read(egg), photographs[1]):
        inside = view.mask == 1
        np.testing.assert_allclose(view.image[inside], 2 * image[inside][:, :3], rtol=1e-6)


def test_photographs_are_made_smaller(egg, photographs):
    views = read_views(str(egg), 16)
    image = photographs[1][0]
    assert views[0].size == (16, 16) and views[0].focal == 20
    blocks = image[..., 3].reshape(16, 2, 16, 2).mean(axis=(1, 3))
    np.testing.assert_allclose(views[0].mask, blocks, atol=1 / 255)


# --- folders that something is wrong with -----------------------------------------------------


def test_no_cameras(tmp_path):
    with pytest.raises(limn.InputError, match=f"{tmp_path}: error: has no cameras"):
        limn.reconstruct(tmp_path, tmp_path / "out")
    with pytest.raises(limn.InputError, match="no such folder"):
        limn.reconstruct(tmp_path / "nowhere", tmp_path / "out")


def test_an_image_of_another_size(egg, photographs):
    pf.write_png(egg / "images" / "3.png", photographs[1][3][:20])
    with pytest.raises(limn.InputError, match=r"images/3.png: error: has 32 x 20 pixels; its cam"):
        read(egg)
    pf.write_png(egg / "images" / "3.png", np.repeat(np.repeat(photographs[1][3], 2, 0), 2, 1))
    with pytest.warns(UserWarning, match=r"images/3.png: has 64 x 64 pixels.*scaled copy"):
        views = read(egg)
    np.testing.assert_allclose(views[3].mask, photographs[1][3][..., 3], atol=1 / 255)


def test_a_black_photograph(egg, photographs):
    black = photographs[1][2] * [0, 0, 0, 1]
    pf.write_png(egg / "images" / "2.png", black)
    with pytest.warns(UserWarning, match=r"images/2.png: the photograph is black"):
        assert [v.name for v in read(egg)] == [f"images/{i}.png" for i in range(8) if i != 2]


def turned(pose):
    return pose @ np.diag([-1, -1, 1, 1])


def test_one_camera_upside_down(egg, photographs):
    poses = list(photographs[0])
    poses[4] = turned(poses[4])
    pf.write_transforms(egg, poses)
    with pytest.warns(UserWarning, match=r"images/4.png: contradicts.*upside down"):
        assert len(read(egg)) == 7


# All cameras turned by half a turn show a point reflection of the object, but for perspective.
def test_all_cameras_with_other_axes(egg, photographs):
    poses = photographs[0]
    for wrong, text in (([p @ np.diag([1, -1, -1, 1]) for p in poses], "OpenCV's axes"),
                        ([np.linalg.inv(p) for p in poses], "when inverted")):  # fmt: skip
        pf.write_transforms(egg, wrong)
        with pytest.raises(limn.InputError, match=f"transforms.json: error: the cameras.*{text}"):
            read(egg)


def test_a_mask_of_another_view(egg, photographs):
    other = np.roll(photographs[1][5], 14, axis=1)
    pf.write_png(egg / "images" / "5.png", other)
    with pytest.warns(UserWarning, match=r"images/5.png: contradicts.*camera or its mask is wrong"):
        assert len(read(egg)) == 7


def test_masks_with_holes(egg, photographs):
    image = photographs[1][1].copy()
    rows, columns = np.nonzero(image[..., 3] == 1)
    row, column = int(rows.mean()), int(columns.mean())
    image[row : row + 2, column, 3] = 0
    pf.write_png(egg / "images" / "1.png", image)
    place = f"hole of 2 pixels around column {column}, row {row} of 32 x 32: filled"
    with pytest.warns(UserWarning, match=f"images/1.png: the mask has a {place}"):
        view = read(egg)[1]
    assert view.mask[row, column] == 1 and (~view.known).sum() == 2
    image[row - 3 : row + 3, column - 2 : column + 3, 3] = 0
    pf.write_png(egg / "images" / "1.png", image)
    with pytest.warns(UserWarning, match="hole of 30 pixels.*taken for an opening"):
        assert read_views(str(egg), pf.SIZE)[1].mask[row, column] == 0


def test_masks_that_say_nothing(egg, photographs):
    pf.write_png(egg / "images" / "0.png", photographs[1][0] * [1, 1, 1, 0])
    pf.write_png(egg / "images" / "1.png", photographs[1][1] * [1, 1, 1, 0] + [0, 0, 0, 1])
    with pytest.warns(UserWarning) as told:
        assert len(read_views(str(egg), pf.SIZE)) == 6
    texts = [str(w.message) for w in told]
    assert any("0.png: the mask is empty" in t for t in texts)
    assert any("1.png: the mask is white everywhere" in t for t in texts)
    pf.write_png(egg / "images" / "2.png", photographs[1][2][..., :3])
    with pytest.raises(limn.InputError, match=r"images/2.png: error: has no mask"):
        read_views(str(egg), pf.SIZE)
    pf.write_png(egg / "masks" / "2.png", photographs[1][2][:8, :, 3])
    with pytest.raises(limn.InputError, match=r"masks/2.png: error: the mask has 32 x 8 pixels"):
        read_views(str(egg), pf.SIZE)


def test_files_that_are_not_there_or_broken(egg, photographs):
    for i in range(6):
        os.remove(egg / "images" / f"{i}.png")
    with pytest.warns(UserWarning, match="no such photograph: images/5.png"):
        with pytest.raises(limn.InputError, match="2 usable photographs of 8"):
            read(egg)
    text = (egg / "transforms.json").read_text()
    for wrong, told in ((text[:-20], "cannot be read as JSON"), ("{}", "no list of frames"),
                        (text.replace("fl_x", "f"), "neither fl_x nor camera_angle_x"),
                        (text.replace("transform_matrix", "matrix"), "no transform_matrix")):
        (egg / "transforms.json").write_text(wrong)
        with pytest.raises(limn.InputError, match=f"transforms.json: .*{told}"):
            read_cameras(str(egg))
    os.remove(egg / "transforms.json")
    pf.write_colmap(egg, photographs[0], True)
    data = (egg / "sparse/0/images.bin").read_bytes()
    (egg / "sparse/0/images.bin").write_bytes(data[:-5])
    with pytest.raises(limn.InputError, match=r"images.bin: error: the file is truncated"):
        read_cameras(str(egg))
    pf.write_colmap(egg, photographs[0], True, ("OPENCV_FISHEYE", 5, (1,) * 8))
    with pytest.raises(limn.InputError, match="OPENCV_FISHEYE is not read.*undistort"):
        read_cameras(str(egg))


# --- the first shape --------------------------------------------------------------------------


def half_edges(faces):
    pairs = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    return pairs[:, 0].astype(int) * 10**6 + pairs[:, 1], pairs[:, 1].astype(int) * 10**6 + pairs[:, 0]


def volume(p, f):
    return (np.cross(p[f[:, 0]], p[f[:, 1]]) * p[f[:, 2]]).sum() / 6


def test_marching_tetrahedra_close_a_ball():
    x = np.stack(np.meshgrid(*[np.arange(24.0)] * 3, indexing="ij"), -1) - 11.3
    positions, faces = marching_tetrahedra(8.0 - np.linalg.norm(x, axis=-1))
    there, back = half_edges(faces)
    assert len(np.unique(there)) == len(there) and set(there) == set(back)
    # A chord of a cell is off by 3 / (8 * 8) at most.
    away = np.linalg.norm(positions - 11.3, axis=1)
    assert abs(away - 8).max() < 3 / 64 + 0.05
    assert abs(volume(positions - 11.3, faces) / (4 / 3 * np.pi * 8**3) - 1) < 0.02


def test_the_hull_holds_the_object(egg):
    views = read(egg)
    positions, faces = visual_hull(views, 48)
    there, back = half_edges(faces)
    assert set(there) == set(back)
    # Inside of all masks: the egg is in it, but for what a pixel's width leaves.
    away = np.linalg.norm((positions - pf.MIDDLE) / pf.RADII, axis=1)
    pixel = 3 / pf.FOCAL
    assert away.min() > 1 - pixel / 0.6
    assert 1 < volume(positions, faces) / (4 / 3 * np.pi * np.prod(pf.RADII)) < 1.3


# --- what comes out ---------------------------------------------------------------------------


def distance(positions, faces):
    ball = limn.load_string('<scene version="3.0.0"><sensor type="perspective"/>'
                            '<shape type="sphere" id="o"/></scene>').mesh("o")  # fmt: skip
    return limn.mesh_distance(positions, faces, ball.positions * pf.RADII + pf.MIDDLE, ball.faces)["chamfer"]


# From photographs of the model itself, so that nothing else is left to explain.
def test_exposures_are_found(egg):
    views = read(egg)
    positions, faces = visual_hull(views, 24)
    model = Model(positions, faces, np.full((len(positions), 3), 0.5)).remeshed(400)
    true = np.array([1.5 if i % 2 else 0.7 for i in range(8)])
    images = rendered(model, views, 64)
    shot = [dataclasses.replace(v, image=e * image) for v, e, image in zip(views, true, images)]
    fit = PhotoFit(model, shot, 1)
    fit.run(Plan(0, 0, image_spp=64), "light")
    ratio = np.array([model.exposures[v.name] for v in views]) / true
    assert ratio.max() / ratio.min() < 1.02 and abs(np.log(true * ratio).mean()) < 1e-9


def test_a_wrong_shape_follows_the_masks(egg):
    views = read(egg)
    positions, faces = visual_hull(views, 24)
    grown = pf.MIDDLE + 1.2 * (positions - pf.MIDDLE)
    model = Model(grown, faces, np.full((len(positions), 3), 0.5)).remeshed(400)
    before = distance(model.positions, model.faces)
    PhotoFit(model, views, 1).run(Plan(0, 25, 2, 0.1, False), "masks")
    assert distance(model.positions, model.faces) < before / 3


def test_motions_of_a_pose():
    pose = pf.pose_of((1, 2, 3))
    turned_pose = posed(pose, [0, 0, np.pi / 2, 1, 2, 3])
    np.testing.assert_allclose(turned_pose[:3, 3], [2, 4, 6], atol=1e-12)
    x, y, z = pose[:3, :3]  # a quarter of a turn about the world's z
    np.testing.assert_allclose(turned_pose[:3, :3], [-y, x, z], atol=1e-12)


# Two of eight cameras are half a degree off: a third of a pixel here, told by masks alone.
def test_cameras_are_refined(egg):
    views = read(egg)
    true = [v.pose for v in views]
    axes = [[0, 1, 0], [1, 0.3, -0.7]]
    for i, axis in zip((1, 4), axes):
        turn = np.radians(0.5) * np.array(axis) / np.linalg.norm(axis)
        views[i].pose = posed(views[i].pose, [*turn, 0, 0, 0])

    # Of where the egg is seen, in pixels, over all views, for the best place of it: where the whole
    # scene is cannot be told.
    def off():
        def away(point):
            return np.concatenate([
                v.project(point[None])[0]
                - dataclasses.replace(v, pose=t).project(pf.MIDDLE[None])[0]
                for v, t in zip(views, true)
            ])  # fmt: skip

        here = away(pf.MIDDLE)
        slope = np.stack([(away(pf.MIDDLE + 1e-4 * a) - here).ravel() / 1e-4 for a in np.eye(3)], 1)
        rest = here.ravel() - slope @ np.linalg.lstsq(slope, here.ravel(), rcond=None)[0]
        return float(np.linalg.norm(rest))

    before = off()
    assert before > 0.3
    positions, faces = visual_hull(views, 24)
    model = Model(positions, faces, np.full((len(positions), 3), 0.5)).remeshed(400)
    PhotoFit(model, views, 1).run(Plan(0, 40, 0.5, 0.1, False, cameras=True), "masks")
    assert off() < before / 2


def test_faces_follow_the_photographs_and_the_time(egg):
    views = read(egg)
    area = np.mean([v.mask.sum() for v in views])
    assert 2000 < 10 * area < 20000
    assert [_most_faces(views, m) for m in (15, 0.5, 0.01)] == [int(10 * area), 2000, 800]


def test_an_egg_comes_out(egg):
    seen = []
    found = limn.reconstruct(egg, egg / "out", size=32, faces=1500, steps=[15, 15, 10, 8], seed=2,
                             tell=lambda p: seen.append(p.stage))  # fmt: skip
    assert len(seen) == 48 == len(found.history) and found.figures["steps"] == 48
    # A quarter of a pixel.
    assert distance(found.model.positions, found.model.faces) < 0.25 * 3 / pf.FOCAL
    assert [v.name for v in found.held_out] == ["images/7.png"]
    assert found.figures["PSNR, held-out views [dB]"] > 27
    # The egg is of one colour: 3 : 2 : 1, by grey light.
    colour = found.model.colours.mean(axis=0)
    np.testing.assert_allclose(colour / colour.sum(), [3 / 6, 2 / 6, 1 / 6], atol=0.04)
    files = set(os.listdir(egg / "out"))
    assert {"object.obj", "object.ply", "object.glb", "sky.exr", "scene.xml", "cameras.json", "errors.json",
            "report.html"} <= files  # fmt: skip
    errors = json.loads((egg / "out" / "errors.json").read_text())
    # An ellipsoid's distance, to first order; the hull of five views is worse than that of seven.
    away = (found.model.positions - pf.MIDDLE) / pf.RADII
    length = np.linalg.norm(away, axis=1)
    true = (length - 1) / np.linalg.norm(away / length[:, None] / pf.RADII, axis=1)
    z = true / np.array(errors["position"])
    assert 0.3 < np.sqrt((z**2).mean()) < 3
    assert np.shape(errors["position"]) == (len(found.model.positions),)
    assert np.shape(errors["colour"]) == (len(found.model.positions), 3)
    assert np.shape(errors["roughness"]) == (len(found.model.positions),)
    # Others read it: the scene shows what was found, the cameras are those of the photographs.
    scene = limn.load(egg / "out" / "scene.xml")
    image = limn.render(scene.view(0), spp=64).value * found.model.exposures["images/0.png"]
    inside = found.views[0].mask == 1
    assert abs(pf.srgb(image) - pf.srgb(found.views[0].image))[inside].mean() < 0.05
    os.rename(egg / "out" / "cameras.json", egg / "out" / "transforms.json")
    for camera, view in zip(read_cameras(str(egg / "out"))[0], [*found.views, *found.held_out]):
        np.testing.assert_allclose(camera.to_world, view.pose, atol=1e-12)
        assert os.path.samefile(camera.image, view.file)
    rows = (egg / "out" / "object.obj").read_text().splitlines()
    vertices = np.array([r.split()[1:] for r in rows if r.startswith("v ")], float)
    np.testing.assert_allclose(vertices[:, :3], found.model.positions, atol=1e-5)
    np.testing.assert_allclose(vertices[:, 3:], pf.srgb(found.model.colours), atol=1e-5)


def test_other_programs_read_gltf(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    positions = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 2.0]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    model = Model(positions, faces, np.linspace(0, 1, 12).reshape(4, 3), [0.2, 0.4, 0.4, 0.6])
    write_glb(str(tmp_path / "object.glb"), model)
    mesh = trimesh.load(tmp_path / "object.glb", force="mesh", process=False)
    np.testing.assert_allclose(mesh.vertices, positions)
    np.testing.assert_array_equal(mesh.faces, faces)
    assert mesh.visual.material.roughnessFactor == pytest.approx(0.4)


# Charts lie apart: where one touches another, its corners would show the other's colours.
def test_an_atlas_shows_what_the_vertices_have(egg):
    pytest.importorskip("xatlas")
    views = read(egg)[:2]
    positions, faces = visual_hull(views, 24)
    model = Model(positions, faces, np.full((len(positions), 3), 0.5)).remeshed(600)
    place = (model.positions - model.positions.min(axis=0)) / np.ptp(model.positions, axis=0)
    model.colours, model.roughness = 0.1 + 0.7 * place, 0.3 + 0.5 * place[:, 0]
    names = write_model(str(egg), model, views)
    assert {"albedo.png", "roughness.png", "object.mtl"} <= set(names)
    assert all((egg / name).exists() for name in names)
    vertices, corners, uv = unwrapped(model.positions, model.faces)
    np.testing.assert_array_equal(vertices[corners], model.faces)
    assert (uv >= 0).all() and (uv <= 1).all()
    albedo = limn.read_image(egg / "albedo.png")
    for place, shown in ((uv, model.colours[vertices]),
                         (uv[corners].mean(axis=1), model.colours[model.faces].mean(axis=1))):
        at = np.minimum(np.stack([1 - place[:, 1], place[:, 0]], 1) * 512, 511).astype(int)
        np.testing.assert_allclose(albedo[at[:, 0], at[:, 1]], shown, atol=0.02)
    scene = limn.load(egg / "scene.xml")
    for k, image in enumerate(rendered(model, views, 256)):
        assert psnr(limn.render(scene.view(k), spp=256).value, image, np.ones(image.shape[:2])) > 35


# A ball, half of it shiny, and nothing else left to explain.
def test_roughness_is_found_where_it_is(egg):
    views = read(egg)
    positions, faces = visual_hull(views, 24)
    sky = np.full((16, 32, 3), 0.3)
    sky[3:6, ::5] = 6
    model = Model(positions, faces, np.full((len(positions), 3), 0.8), sky=sky).remeshed(600)
    shiny = model.positions[:, 0] < pf.MIDDLE[0]
    true = dataclasses.replace(model, roughness=np.where(shiny, 0.2, 0.7))
    shot = [dataclasses.replace(v, image=i) for v, i in zip(views, rendered(true, views, 256))]
    PhotoFit(model, shot, 1).run(Plan(0, 30, shape=False, image_spp=16, spp=8), "details")
    # Not how rough in all: smooth skies have blurred reflections, too.
    assert np.corrcoef(model.roughness, true.roughness)[0, 1] > 0.7


def test_the_same_seed_finds_the_same(egg):
    views = read(egg)
    positions, faces = visual_hull(views, 24)
    found = []
    for threads in (1, 2):
        model = Model(positions, faces, np.full((len(positions), 3), 0.5)).remeshed(400)
        fit = PhotoFit(model, views, 3, threads)
        fit.run(Plan(0, 2), "all")
        found.append((fit.model.positions, fit.model.colours, fit.model.sky))
    for one, other in zip(*found):
        assert (one == other).all()


def test_an_interrupt_leaves_what_was_found(egg):
    def stop(progress):
        if progress.step == 3:
            raise KeyboardInterrupt

    found = limn.reconstruct(egg, egg / "out", size=16, steps=[2, 50, 50, 50], tell=stop)
    assert len(found.history) == 3 and not found.errors
    assert os.path.exists(egg / "out" / "report.html")


def test_an_interrupt_of_the_errors_leaves_the_object(egg, monkeypatch):
    def stop(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(limn.reconstruction, "_errors", stop)
    with pytest.warns(UserWarning, match="errors.json is not written"):
        found = limn.reconstruct(egg, egg / "out", size=16, steps=[1, 1, 1, 1])
    assert not found.errors and os.path.exists(egg / "out" / "object.ply")
    assert os.path.exists(egg / "out" / "report.html")


def test_colours_are_baked_where_texture_coordinates_are():
    places = np.array([[0.1, 0.2], [0.9, 0.2], [0.1, 0.9]])
    colours = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1]])
    image = baked(places, np.array([[0, 1, 2]]), colours, 64)
    x, y = 20, 40  # row 40 is v = 1 - 40.5 / 64
    u, v = (x + 0.5) / 64, 1 - (y + 0.5) / 64
    b, c = (u - 0.1) / 0.8, (v - 0.2) / 0.7
    np.testing.assert_allclose(image[y, x], [1 - b - c, b, c], atol=1e-12)


def test_the_program_starts_it(egg):
    words = ["reconstruct", str(egg), "-o", str(egg / "out"), "--minutes", "0.02", "--size", "16"]
    program = [os.environ["LIMN_PROGRAM"]]  # starts the other
    done = subprocess.run([*program, *words], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "report.html" in done.stdout
    for start in ([sys.executable, "-m", "limn"], program):
        done = subprocess.run([*start, "reconstruct", str(egg / "images"), "-o", str(egg / "x")],
                              capture_output=True, text=True, check=False)  # fmt: skip
        assert done.returncode == 2 and "has no cameras" in done.stderr


def test_alpha_is_read(tmp_path):
    grid = np.linspace(0, 1, 12).reshape(3, 4)
    pf.write_png(tmp_path / "a.png", np.stack([grid, 1 - grid, 0 * grid, grid**2], -1))
    np.testing.assert_allclose(limn.read_alpha(tmp_path / "a.png"), grid**2, atol=0.51 / 255)
    np.testing.assert_allclose(pf.srgb(limn.read_image(tmp_path / "a.png"))[..., 0], grid,
                               atol=0.51 / 255)  # fmt: skip
    pf.write_png(tmp_path / "b.png", np.stack([grid] * 3, -1))
    limn.write_exr(tmp_path / "c.exr", grid)
    assert limn.read_alpha(tmp_path / "b.png") is None is limn.read_alpha(tmp_path / "c.exr")
    with pytest.raises(limn.InputError, match="nothing.png: error: cannot read"):
        limn.read_alpha(tmp_path / "nothing.png")


def test_remeshing_keeps_the_surface():
    ball = limn.load_string('<scene version="3.0.0"><sensor type="perspective"/>'
                            '<shape type="sphere" id="o"/></scene>').mesh("o")  # fmt: skip
    positions, faces = ball.positions[ball.weld], ball.weld[ball.faces]
    faces = faces[(faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2])
                  & (faces[:, 2] != faces[:, 0])]  # fmt: skip
    used, corners = np.unique(faces, return_inverse=True)
    new, triangles = limn.remesh(positions[used], corners.reshape(-1, 3), 0.2)
    edges = np.linalg.norm(new[triangles] - new[np.roll(triangles, 1, axis=1)], axis=2)
    assert 0.9 < np.median(edges) / 0.2 < 1.1
    assert abs(np.linalg.norm(new, axis=1) - 1).max() < 0.01
    with pytest.raises(limn.InputError, match="length must be above 0"):
        limn.remesh(positions[used], corners.reshape(-1, 3), 0)
