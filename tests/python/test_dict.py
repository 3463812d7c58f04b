"""Scenes as dictionaries."""

import re

import limn
import numpy as np
import pytest
from limn.dicts import TYPES
from test_scene import same


def grey(value):
    return {"type": "rgb", "value": value}


def scene_dict():
    """conftest.SCENE in Mitsuba's words."""
    transform = limn.Transform()
    return {
        "type": "scene",
        "eye": {
            "type": "perspective",
            "fov": 40,
            "to_world": transform.look_at([1, 3, 5], [0, 0.5, 0], up=[0, 1, 0]),
            "sampler": {"type": "independent", "sample_count": 4},
            "film": {"type": "hdrfilm", "width": 16, "height": np.int64(12),
                     "component_format": "float32", "rfilter": {"type": "box"}},
        },
        "metal": {"type": "roughconductor", "alpha": np.float64(0.2)},
        "clay": {"type": "diffuse", "reflectance": grey([0.7, 0.5, 0.3])},
        "tent": {"type": "obj", "filename": "tent.obj", "surface": {"type": "ref", "id": "metal"}},
        "floor": {"type": "rectangle",
                  "to_world": transform.scale(4) @ transform.rotate([1, 0, 0], -90),
                  "bsdf": {"type": "ref", "id": "clay"}},
        "ball": {"type": "sphere", "center": (-2, 3, 1), "radius": 0.5,
                 "emitter": {"type": "area", "radiance": grey([4, 5, 6])}},
        "sky": {"type": "constant", "radiance": grey([0.5])},
        "bulb": {"type": "point", "position": np.array([1, 4, 2])},
    }


def test_it_is_the_scene_of_the_file(folder, scene):
    read = limn.load_dict(scene_dict(), str(folder))
    assert same(limn.render(read).value, limn.render(scene).value)
    # What is inside others has a name with a dot, or the one that it asks for.
    inside = {"lamp": "ball.emitter"}
    renamed = [".".join([inside.get(n.split(".")[0], n.split(".")[0]), *n.split(".")[1:]])
               for n in scene.parameters]
    assert sorted(read.parameters) == sorted(renamed)
    named = scene_dict()
    named["ball"]["emitter"]["id"] = "lamp"
    assert list(limn.load_dict(named, str(folder)).parameters) == list(scene.parameters)


def test_transforms_go_the_way_of_matrices():
    t = limn.Transform()
    turn = np.array([[0, 0, 1, 0], [0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1.0]])
    move, half = np.eye(4), np.diag([0.5, 0.5, 0.5, 1])
    move[:3, 3] = [1, 2, 3]
    asked = [t.translate([1, 2, 3]).rotate([0, 1, 0], 90).scale(0.5),
             t.translate([1, 2, 3]) @ t.rotate([0, 1, 0], 90) @ t.scale([0.5, 0.5, 0.5]),
             limn.Transform(move) @ limn.Transform(turn) @ limn.Transform(half),
             move @ turn @ half]

    def corners(transform):
        scene = limn.load_dict({"type": "scene", "eye": {"type": "perspective"},
                                "box": {"type": "cube", "to_world": transform}})
        return scene["box.vertex_positions"]

    for transform in asked:
        # To the rounding of a float of this size.
        assert np.abs(corners(transform) - corners(asked[-1])).max() <= 4 * 2.0**-24 * 4


def test_transforms_have_inverses():
    t = limn.Transform().translate([1, 2, 3]).rotate([0, 1, 0], 90).scale(0.5)
    np.testing.assert_allclose((t @ t.inverse()).matrix, np.eye(4), atol=1e-12)
    assert repr(limn.Transform().scale(2)).startswith("limn.Transform([[2.0, 0.0, 0.0, 0.0], [0.0,")


def test_meshes_have_mitsubas_names():
    points, corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]
    scene = limn.load_dict({"type": "scene", "eye": {"type": "perspective"}, "leaf": {
        "type": "mesh", "positions": points, "faces": corners, "normals": [[0, 0, 1]] * 3,
        "texcoords": [[0, 0], [1, 0], [0, 1]]}})
    assert scene.mesh("leaf").positions.tolist() == points


@pytest.mark.parametrize("bare", ["perspective", "mesh", "bitmap", "sphere"])
def test_what_is_bare_belongs_into_a_scene(bare):
    with pytest.raises(limn.InputError, match=re.escape(f'"name": {{"type": "{bare}", ...}}, ...}}')):
        limn.load_dict({"type": bare})


def test_transforms_move_points():
    t = limn.Transform()
    steps = t.translate([1, 2, 3]).rotate([1, 2, -1], 40).scale([1, 2, 0.5])
    still = corners_of(t).astype(float)
    moved = steps @ still
    assert np.abs(moved - corners_of(steps)).max() <= 4 * 2.0**-24 * 8  # the rounding of floats
    np.testing.assert_array_equal(steps @ still[3], moved[3])
    np.testing.assert_allclose((limn.Transform(steps.matrix) @ t.scale(2)).matrix,
                               steps.matrix @ np.diag([2, 2, 2, 1]))  # fmt: skip
    pose = t.look_at([1, 3, 5], [0, 0.5, 0], up=[0, 1, 0])
    eye = limn.load_dict({"type": "scene", "eye": {"type": "perspective", "to_world": pose}})
    np.testing.assert_allclose(pose.matrix, eye.sensor_to_world, atol=1e-12)
    with pytest.raises(limn.InputError, match=r"points have shape \(3,\) or \(N, 3\), not \(2,\)"):
        steps @ [1, 2]
    for step, wrong in [(t.rotate([0, 0, 0], 40), "rotate: the axis is zero"),
                        (t.look_at([1, 2, 3], [1, 2, 3], up=[0, 1, 0]), "origin and target"),
                        (t.look_at([0, 0, 5], [0, 0, 0], up=[0, 0, 2]), "up lies along")]:
        with pytest.raises(limn.InputError, match=wrong):
            step.matrix  # noqa: B018


@pytest.mark.parametrize("change, text", [
    ({"ball": {"type": "sphere", "radius": -1}},
     r"^dict\.ball\.radius: error: .*"),
    ({"ball": {"type": "sphere", "bsdf": {"type": "diffuse", "alpha": 0.1}}},
     r'^dict\.ball\.bsdf\.alpha: error: .*unknown parameter "alpha"'),
    ({"ball": {"type": "stl", "filename": "b.stl"}},
     r'^dict\.ball: error: unknown type "stl" .*; "mesh" reads STL, glTF, \.\.\.\)'),
    ({"ball": {"type": "heterogeneous"}},
     r'^dict\.ball: error: unknown type "heterogeneous" \(known: .*\); limn has no volumes'),
    ({"ball": {"type": "globe"}}, r'^dict\.ball: error: unknown type "globe" \(known: aov, area, '),
    ({"ball": {"type": "sphere", "bsdf": {"type": "ref", "id": "wood"}}}, r"^dict\.ball\.bsdf: error"),
    ({"ball": {"type": "sphere", "center": [1, 2]}},
     r"^dict\.ball\.center: error: expected a number, a string, three numbers"),
    ({"ball": 3}, r"^dict\.ball: error: expected a dictionary"),
    ({"type": "shape"}, r"^dict: error: expected \{"),
    ({"ball": {"type": ["x"]}}, r'^dict\.ball: error: expected a word for "type", not \[\'x\'\]'),
    ({"b$ll": {"type": "sphere"}}, r'^dict\.b\$ll: error: "\$" cannot be in the name'),
    ({"ball": {"type": "sphere", "$r": 1}}, r'^dict\.ball\.\$r: error: "\$" cannot be'),
    ({"ball": {"type": "sphere", "id": "$b"}}, r'^dict\.ball\.id: error: "\$" cannot be'),
    ({"ball": {"type": "sphere", "bsdf": {"type": "ref", "id": "$c"}}},
     r'^dict\.ball\.bsdf\.id: error: "\$" cannot be'),
    ({3: {"type": "sphere"}}, r"^dict\.3: error: a name must be a word, not int"),
    ({"eye": {"type": "path"}}, r"^dict: error: .*there is no sensor"),
    ({"mesh": {"type": "obj", "filename": "$none.obj"}}, r"^dict\.mesh\.filename: error: .*none\.obj"),
])
def test_mistakes_have_a_place(folder, change, text):
    with pytest.raises(limn.InputError) as error:
        limn.load_dict({**scene_dict(), **change}, str(folder))
    assert re.match(text, str(error.value)), str(error.value)


# A mesh of arrays is that of a file.
def test_meshes_are_arrays(folder, tmp_path):
    vertices = np.array([[0, 1, 0], [1, 0, 0], [-1, 0, 0], [0, 0, 1], [0, 0, -1]])
    faces = np.array([[0, 1, 4], [0, 4, 2], [0, 2, 3], [0, 3, 1]])
    limn.write_ply(tmp_path / "a.ply", vertices, faces)
    shapes = [{"type": "mesh", "vertices": np.asfortranarray(vertices), "faces": faces.tolist()},
              {"type": "mesh", "filename": str(tmp_path / "a.ply")},
              {"type": "ply", "filename": str(tmp_path / "a.ply")}]
    for more in ({}, {"face_normals": True, "bsdf": {"type": "ref", "id": "metal"}}):
        read = [limn.load_dict({**scene_dict(), "roof": {**s, **more}}, str(folder)) for s in shapes]
        assert read[0].mesh("roof").positions.shape == (5, 3)
        for scene in read[:2]:
            assert same(limn.render(scene).value, limn.render(read[2]).value)


def test_meshes_take_attributes(folder):
    square = {"type": "mesh", "vertices": [[-1, 0, 0], [1, 0, 0], [1, 2, 0], [-1, 2, 0]],
              "faces": [[0, 1, 2], [0, 2, 3]]}
    colours = np.array([[0.1, 0.2, 0.3]] * 4)

    def image_of(reflectance, **attributes):
        scene = limn.load_dict({**scene_dict(), "roof": {
            **square, **attributes, "bsdf": {"type": "diffuse", "reflectance": reflectance}}}, folder)
        return scene, limn.render(scene, seed=3).value

    scene, image = image_of({"type": "mesh_attribute", "name": "vertex_color"}, vertex_color=colours)
    np.testing.assert_allclose(image, image_of({"type": "rgb", "value": [0.1, 0.2, 0.3]})[1],
                               rtol=1e-5)
    assert scene.parameters["roof.vertex_color"].shape == (1, 4, 3)
    scene["roof.vertex_color"] = scene["roof.vertex_color"][0] / 2
    np.testing.assert_allclose(scene["roof.vertex_color"][0], np.float32(colours) / 2)
    with pytest.raises(limn.InputError, match=r"has shape \(1, 4, 3\), not \(5, 3\)"):
        scene["roof.vertex_color"] = np.ones((5, 3))
    # What is nearest to the corner (0, 0) of the texture coordinates, of every point.
    texture = {"type": "bitmap", "bitmap": np.array([[[.5, .2, .1], [.9, .9, .9]]]), "raw": True,
               "filter_type": "nearest"}
    corner = image_of(texture, vertex_texcoords=np.full((4, 2), 0.1))[1]
    np.testing.assert_allclose(corner, image_of({"type": "rgb", "value": [.5, .2, .1]})[1], rtol=1e-5)
    # Normals of the file in place of the plane's.
    plane = {"type": "rgb", "value": [0.5, 0.5, 0.5]}
    tilted = image_of(plane, vertex_normals=np.tile([0, 0.6, 0.8], (4, 1)))[1]
    assert not np.allclose(tilted, image_of(plane)[1], rtol=1e-2)


def test_later_messages_name_the_dictionary(folder):
    scene = limn.load_dict(scene_dict(), str(folder))
    assert scene.file == "dict"
    for call, text in ((lambda: scene["ball.rotate"], r"^dict: error: unknown parameter"),
                       (lambda: scene.set_mesh("ball", np.eye(3), [[0, 1, 3]]),
                        r"^dict\.ball: error: face 0")):
        with pytest.raises(limn.InputError) as error:
            call()
        assert re.match(text, str(error.value)), str(error.value)


@pytest.mark.parametrize("mesh, text", [
    ({}, "give vertices and faces, or a filename"),
    ({"vertices": [[0, 0, 0]]}, "give vertices and faces, or a filename"),
    ({"vertices": [[0, 0, 0]], "faces": [[0, 0, 1]]}, "faces name vertices 0 to 1 of 1"),
    ({"vertices": [[0, 0]], "faces": [[0, 0, 0]]}, r"positions have shape \(V, 3\), not \(1, 2\)"),
    ({"vertices": [[0, 0, 0], [1, 0, 0], [0, np.nan, 0]], "faces": [[0, 1, 2]]}, ".*not finite"),
    ({"vertices": [[0, 0, 0]], "faces": [[0, 0, 0]], "filename": "a.ply"}, "give vertices"),
    ({"vertices": [[0, 0, 0]], "positions": [[0, 0, 0]], "faces": [[0, 0, 0]]},
     "vertices and positions are names of the same array"),
    ({"vertices": [[0, 0, 0]], "faces": [[0, 0, 0]], "vertex_color": [1, 2]},
     r"vertex_color has shape \(1, 3\), not \(2,\)"),
    ({"vertices": [[0, 0, 0]], "faces": [[0, 0, 0]], "face_a": [1, 2]},
     r"face_a has shape \(1, 1 or 3\), not \(2,\)"),
])
def test_mistakes_in_meshes_have_a_place(mesh, text):
    with pytest.raises(limn.InputError, match=rf"^dict\.roof: error: {text}"):
        limn.load_dict({"type": "scene", "eye": {"type": "perspective"},
                        "roof": {"type": "mesh", **mesh}})


def test_trimesh_reads_other_files(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    box = trimesh.creation.box()
    for ending in ("stl", "glb", "off"):
        box.export(tmp_path / f"box.{ending}")
        scene = limn.load_dict({"type": "scene", "eye": {"type": "perspective"},
                                "box": {"type": "mesh", "filename": f"box.{ending}"}}, tmp_path)
        mesh = scene.mesh("box")
        assert len(mesh.faces) == 12 and len(np.unique(mesh.weld)) == 8
        assert np.abs(mesh.positions).max() == 0.5
    (tmp_path / "not.stl").write_text("no mesh")
    for name in ("not.stl", "none.glb"):
        with pytest.raises(limn.InputError, match=r"^dict\.box: error: "):
            limn.load_dict({"type": "scene", "box": {"type": "mesh", "filename": name}}, tmp_path)


def test_trimesh_keeps_normals_coordinates_and_colours(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    ball = trimesh.creation.icosphere(1)
    turn = limn.Transform().rotate([1, 0, 0], 90).scale([1, 1, 2]).matrix
    positions, faces = ball.vertices @ turn[:3, :3].T, ball.faces
    normals = ball.vertices @ np.linalg.inv(turn[:3, :3])
    uv = np.random.default_rng(3).uniform(0, 1, (len(positions), 2)).astype(np.float32)
    colours = np.random.default_rng(4).integers(0, 256, (len(positions), 4), np.uint8)
    texels = np.random.default_rng(5).uniform(0, 1, (4, 4, 3)).astype(np.float32)
    painted = {"type": "mesh_attribute", "name": "vertex_color"}
    mapped = {"type": "bitmap", "bitmap": texels, "raw": True}

    def image(texture, **mesh):
        scene = {**scene_dict(), "ball": {"type": "mesh", **mesh,
                                          "bsdf": {"type": "diffuse", "reflectance": texture}}}
        del scene["tent"]  # which would need its file
        return limn.render(limn.load_dict(scene, str(tmp_path)), spp=2).value

    def export(name, visual):
        part = trimesh.Trimesh(ball.vertices, faces, vertex_normals=ball.vertices, visual=visual,
                               process=False)
        whole = trimesh.Scene()
        whole.add_geometry(part, transform=turn)
        whole.export(tmp_path / name, include_normals=True)

    export("painted.glb", trimesh.visual.ColorVisuals(vertex_colors=colours))
    wanted = image(painted, vertices=positions, faces=faces, vertex_normals=normals,
                   vertex_color=colours[:, :3] / 255)  # linear in glTF
    np.testing.assert_allclose(image(painted, filename="painted.glb"), wanted, rtol=1e-3, atol=1e-4)
    flat = image(painted, vertices=positions, faces=faces, vertex_color=colours[:, :3] / 255)
    assert abs(flat - wanted).max() > 0.01

    material = trimesh.visual.material.PBRMaterial(baseColorFactor=[255, 0, 0, 255])
    export("mapped.glb", trimesh.visual.TextureVisuals(uv=uv, material=material))
    wanted = image(mapped, vertices=positions, faces=faces, vertex_normals=normals,
                   vertex_texcoords=uv * [1, -1] + [0, 1])
    with pytest.warns(UserWarning, match="^dict.ball: warning: mapped.glb has materials"):
        found = image(mapped, filename="mapped.glb")
    np.testing.assert_allclose(found, wanted, rtol=1e-3, atol=1e-4)

    both = trimesh.Scene([trimesh.creation.box(), trimesh.load(tmp_path / "painted.glb", force="mesh")])
    both.export(tmp_path / "both.glb")
    with pytest.warns(UserWarning, match="both.glb has vertex_color of some parts, which limn does not"):
        image({"type": "rgb", "value": 0.5}, filename="both.glb")


def test_mistakes_are_told_together(folder):
    wrong = {"ball": {"type": "sphere", "radius": -1}, "box": {"type": "cube", "size": 2}}
    with pytest.raises(limn.InputError) as error:
        limn.load_dict({**scene_dict(), **wrong}, str(folder))
    lines = str(error.value).splitlines()
    places = ["dict.ball.radius", "dict.box.size"]
    assert [line.split(": ")[0] for line in lines] == [*places, "2 errors"]


def test_warnings_have_a_place(tmp_path):
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2 2\n")
    with pytest.warns(UserWarning, match="1 of 2 faces"):
        limn.load_dict({"type": "scene", "eye": {"type": "perspective"},
                        "mesh": {"type": "obj", "filename": "a.obj"}}, str(tmp_path))


# The reader's own words for what it knows.
@pytest.mark.parametrize("tag", sorted(set(TYPES) - {"spectrum"}))
def test_types_are_those_of_files(tag):
    inside = {"film": "sensor", "sampler": "sensor", "rfilter": "film"}
    xml = f'<{tag} type="nonsense"/>'
    if tag in inside:
        outer = inside[tag]
        xml = f'<{outer} type="{TYPES[outer][0]}">{xml}</{outer}>'
        if outer == "film":
            xml = f'<sensor type="perspective">{xml}</sensor>'
    if tag == "texture":
        xml = xml.replace("<texture", '<texture name="reflectance"')
        xml = f'<bsdf type="diffuse">{xml}</bsdf>'
    known = set()
    places = [xml, f'<shape type="cube">{xml}</shape>'] if tag == "emitter" else [xml]
    for text in places:
        with pytest.raises(limn.InputError, match="known: ") as error:
            limn.load_string(f'<scene version="3.0.0">{text}</scene>')
        known |= set(re.search(r"known: ([^)]*)", str(error.value)).group(1).split(", "))
    assert known == set(TYPES[tag])


def card(reflectance, folder=""):
    """The image of a square in the middle of 4 by 4 pixels."""
    return np.asarray(limn.render(limn.load_dict({
        "type": "scene",
        "eye": {"type": "perspective", "to_world": limn.Transform().translate([0, 0, -3]),
                "film": {"type": "hdrfilm", "width": 4, "height": 4, "rfilter": {"type": "box"}}},
        "card": {"type": "rectangle", "to_world": limn.Transform().rotate([0, 1, 0], 180),
                 "bsdf": {"type": "diffuse", "reflectance": reflectance}},
        "sky": {"type": "constant"}}, str(folder)), spp=4))


@pytest.mark.parametrize("spectrum", [
    {"type": "uniform", "value": 0.75},
    {"type": "srgb", "color": 0.75},
    {"type": "rawconstant", "value": 0.75},
    {"type": "regular", "values": "0.75, 0.75"},
    {"type": "irregular", "wavelengths": "360, 830", "values": "0.75, 0.75"},
])
def test_spectra_are_colours(spectrum):
    assert spectrum["type"] in TYPES["spectrum"]
    assert np.allclose(card(spectrum), card(grey(0.75)), rtol=3e-3)


def test_textures_stand_where_colours_do(tmp_path):
    colours = np.full((2, 2, 3), 0.25, dtype=np.float32)
    colours[0] = 0.75
    limn.write_exr(str(tmp_path / "a.exr"), colours)
    texture = {"type": "bitmap", "filename": "a.exr", "raw": True, "filter_type": "nearest"}
    image = card(texture, tmp_path)
    for row, value in ((1, 0.25), (2, 0.75)):  # v is up, rows go down
        assert np.allclose(image[row, 1:3], card(grey(value))[row, 1:3], rtol=1e-5)


def test_texels_beyond_one_are_told(tmp_path):
    limn.write_exr(str(tmp_path / "a.exr"), np.full((2, 2, 3), 2, dtype=np.float32))
    with pytest.warns(UserWarning, match="bsdf.reflectance: warning: the texture reflects more"):
        image = card({"type": "bitmap", "filename": "a.exr", "raw": True}, tmp_path)
    assert np.allclose(image[1:3, 1:3], 2 * card(grey(1.0))[1:3, 1:3], rtol=1e-5)


@pytest.mark.parametrize("kind", ["bsplinecurve", "linearcurve"])
def test_curves_keep_their_radius(kind, tmp_path):
    (tmp_path / "a.txt").write_text("".join(f"0 0 {z} 0.5\n" for z in range(5)))
    scene = limn.load_dict({"type": "scene", "eye": {"type": "perspective"},
                            "hair": {"type": kind, "filename": "a.txt",
                                     "to_world": limn.Transform().scale(2)}}, str(tmp_path))
    points = np.asarray(scene.mesh("hair").positions)
    assert np.isclose(np.abs(points[:, :2]).max(), 0.5)
    assert np.ptp(points[:, 2]) == pytest.approx(4 if kind == "bsplinecurve" else 9)


class Matrix:
    """As Mitsuba's transforms are: of arrays of one lane, or of numbers."""

    def __init__(self, matrix):
        self.matrix = matrix


class Bitmap:
    """As Mitsuba's: pixels, and whether they are encoded."""

    def __init__(self, pixels, is_srgb):
        self.pixels, self.is_srgb = pixels, is_srgb

    def __array__(self, *arguments, **named):
        return np.asarray(self.pixels, *arguments, **named)

    def srgb_gamma(self):
        return self.is_srgb


def corners_of(transform):
    return np.asarray(limn.load_dict({
        "type": "scene", "eye": {"type": "perspective"},
        "box": {"type": "cube", "to_world": transform}})["box.vertex_positions"])


def test_transforms_of_mitsuba():
    shift = np.eye(4)
    shift[:3, 3] = [1, 2, 3]
    expected = corners_of(limn.Transform().translate([1, 2, 3]))
    for transform in (Matrix(shift), Matrix(shift[:, :, None]), shift.tolist()):
        assert (corners_of(transform) == expected).all()


def test_textures_turn_by_3_x_3_matrices():
    def board(to_uv):
        return {"type": "checkerboard", "color0": grey(0.25), "color1": grey(0.75), "to_uv": to_uv}

    expected = card(board(limn.Transform().scale(2)))
    half = np.diag([2.0, 2.0, 1.0])
    for to_uv in (half, Matrix(half), Matrix(half[:, :, None])):
        assert same(card(board(to_uv)), expected)
    assert not same(card(board(np.eye(3))), expected)


# Floats are linear; bytes are sRGB unless raw or told otherwise; alpha is dropped.
def test_textures_of_pixels(tmp_path):
    colours = np.full((2, 2, 3), 0.25, dtype=np.float32)
    colours[0] = 0.75, 0.5, 0.125
    limn.write_exr(str(tmp_path / "a.exr"), colours)

    def of(image, **more):
        return card({"type": "bitmap", "filter_type": "nearest", **image, **more}, tmp_path)

    expected = of({"filename": "a.exr"})
    opaque = np.concatenate([colours, np.full((2, 2, 1), 0.5, dtype=np.float32)], axis=2)
    for image in (colours, colours.astype(np.float64), opaque, Bitmap(colours, False)):
        assert same(of({"bitmap": image}), expected)
        assert same(of({"data": image}, raw=True), expected)
    red = of({"bitmap": np.repeat(colours[:, :, :1], 3, axis=2)})
    assert same(of({"bitmap": colours[:, :, 0]}), red) and not same(red, expected)
    assert same(of({"bitmap": colours[:, :, :1]}), red)
    levels = np.array([64, 191], dtype=np.uint8)
    encoded = np.repeat(levels[[1, 0], None, None], 2, axis=1)
    linear = ((levels / 255 + 0.055) / 1.055) ** 2.4
    for image, more, least, most in (
            (encoded, {}, *linear), (Bitmap(encoded, True), {}, *linear),
            (encoded, {"raw": True}, *levels / 255), (Bitmap(encoded, False), {}, *levels / 255)):
        shown = of({"bitmap": image}, **more)
        assert np.allclose(shown[1, 1], card(grey(least))[1, 1], rtol=1e-6)
        assert np.allclose(shown[2, 1], card(grey(most))[2, 1], rtol=1e-6)


def test_pixels_of_a_sky():
    def sky(image):
        return np.asarray(limn.render(limn.load_dict({
            "type": "scene", "eye": {"type": "perspective", "film": {
                "type": "hdrfilm", "width": 4, "height": 4}},
            "sky": {"type": "envmap", "bitmap": image, "scale": 2.0}}), spp=1))

    assert np.allclose(sky(np.full((4, 8, 3), 0.5)), 1)


def test_spectra_of_pairs_and_files(tmp_path):
    pairs = [(400.0, 0.5), (500.0, 0.8), (600.0, 0.2)]
    expected = card({"type": "irregular", "wavelengths": "400, 500, 600", "values": "0.5, 0.8, 0.2"})
    (tmp_path / "a.spd").write_text("400 0.5\n500 0.8\n600 0.2\n")
    for spectrum in ({"value": pairs}, {"value": np.array(pairs)}, {"filename": tmp_path / "a.spd"},
                     {"value": "400:0.5, 500:0.8, 600:0.2"}, {"filename": "a.spd"}):
        assert same(card({"type": "spectrum", **spectrum}, tmp_path), expected)


def test_scenes_have_settings_and_batches():
    eye = {"type": "perspective"}
    scene = limn.load_dict({
        "type": "scene", "embree_use_robust_intersections": True,
        "eyes": {"type": "batch", "left": eye, "right": {**eye, "fov": 20},
                 "film": {"type": "hdrfilm", "width": 8, "height": 4}}})
    assert limn.render(scene, spp=1).shape == (4, 4, 3)
    assert len(scene.sensors) == 2


@pytest.mark.parametrize("change, text", [
    ({"spectral": True}, r'^dict\.spectral: error: <scene>: unknown parameter "spectral" \(known: '),
    ({"c": {"type": "diffuse", "reflectance": {"type": "spectrum", "value": [(400, 1), 3]}}},
     r"^dict\.c\.reflectance\.value: error: expected one number, or pairs"),
    ({"c": {"type": "diffuse", "reflectance": {"type": "rgb", "value": "red"}}},
     r'^dict\.c\.reflectance: error: <rgb>: value must be 1 or 3 finite numbers, not "red"'),
    ({"c": {"type": "diffuse", "reflectance": {"type": "rgb", "value": {"r": 1}}}},
     r"^dict\.c\.reflectance\.value: error: expected one or three numbers, not \{'r': 1\}"),
    ({"c": {"type": "diffuse", "reflectance": {"type": "bitmap", "bitmap": [1.0, 2.0]}}},
     r"^dict\.c\.reflectance: error: pixels have shape \(H, W, 1 to 4\), not \(2,\) of float64"),
    ({"ball": {"type": "sphere", "bsdf": {"type": "diffuse", "reflectance": [0.3, 0.2, 0.1]}}},
     r'^dict\.ball\.bsdf\.reflectance: error: .* must be given as {"type": "rgb", "value": \[\.\.\.\]}'
     r', {"type": "spectrum", \.\.\.} or a number, not three numbers$'),
    ({"c": {"type": "cube", "to_world": [[1], [1, 2]]}}, r"^dict\.c\.to_world: error: expected a "),
])
def test_mistakes_of_values_have_a_place(folder, change, text):
    with pytest.raises(limn.InputError) as error:
        limn.load_dict({**scene_dict(), **change}, str(folder))
    assert re.match(text, str(error.value)), str(error.value)


def test_errors_are_told_together():
    with pytest.raises(limn.InputError) as error:
        limn.load_dict({"type": "scene", "a": {"type": "nope"}, "b": 3,
                        "c": {"type": "sphere", "d": {"type": "nope"}, "e": {}}})
    places = [line.split(": error: ")[0] for line in str(error.value).splitlines()]
    assert places == ["dict.a", "dict.b", "dict.c.d", "dict.c.e"]
