"""What each kind of scene's picture is, in closed form, with the three terms kept apart.

A model's image(domain, shade, outline, shadow, order) takes the scene four times, so that a parameter
can be moved in one copy alone (directions omega are held fixed in solid angle while it moves):
  domain   decides what the camera's rays meet first:            its derivative is the camera term,
  shade    holds normals, directions to the viewer, BSDFs, radiances:             interior term,
  outline  holds shading points and all outlines seen from them:                  boundary term,
  shadow   holds the edges of sharp shadows, and all that they fall on:             shadow term.
All three moved together give the picture of the moved scene, so the terms add up to its derivative.
`order` is the number of Gauss nodes per axis. Images are height by width by 3.
"""
import copy
import dataclasses

import numpy as np

from closed_form_geometry import (along_layers, clip, clip_box, clip_convex, gauss, hit_plane,
                                  loop_normal, loop_rule, mirrored, ramp, shadow_on_plane,
                                  square_rule, squares, through_layers, unit)
from closed_form_radiance import (Filter, convex_vector, lobe, lobe_over_polygon, polygon_area,
                                  polygon_vector)


def pixels(camera, mean):
    """An image of mean(corner): of the pixel that begins there on the film [pixels]."""
    return np.array([[mean(np.array([column, row], dtype=float)) for column in range(camera.width)]
                     for row in range(camera.height)])


class FloorModel:
    """The camera sees nothing but the face of shape "floor": a mean of radiance() over pixels."""

    outlines_in_view = False

    def image(self, domain, shade, outline, shadow, order):
        nodes, weights = square_rule(order)

        def mean(corner):
            film = nodes + corner
            p = hit_plane(outline.camera, film, outline.shapes["floor"].face(0))
            viewer = -shade.camera.directions(film)
            return weights @ self.radiance(shade, outline, p, viewer, order)

        return pixels(domain.camera, mean)


def floor_normal(scene):
    return loop_normal(scene.shapes["floor"].face(0))


class HiddenSky(FloorModel):
    """A constant sky of radiance L_e partly hidden by a black convex mesh, over a diffuse plane.

    L = rho / pi L_e (pi - n.Phi), Phi the mesh's outline by Lambert's formula.
    """

    def radiance(self, shade, outline, p, viewer, order):
        n = floor_normal(shade)
        hidden = convex_vector(p, outline.shapes["object"]) @ n
        rho = shade.shapes["floor"].bsdf.reflectance
        return (np.pi - hidden)[:, None] * rho / np.pi * shade.environment


class LampOnFloor(FloorModel):
    """A polygonal lamp over a diffuse plane: L = rho / pi L_e n.Phi."""

    def radiance(self, shade, outline, p, viewer, order):
        phi = polygon_vector(p, lamp_loop(outline, p))
        lamp, floor = shade.shapes["lamp"], shade.shapes["floor"]
        return (phi @ floor_normal(shade))[:, None] * floor.bsdf.reflectance / np.pi * lamp.radiance


def lamp_loop(scene, p):
    """The lamp's loop; all points p (N by 3) must be on its front."""
    loop = scene.shapes["lamp"].face(0)
    assert np.all((p - loop[0]) @ loop_normal(loop) > 0), "behind the lamp"
    return loop


class HalfHiddenLamp(FloorModel):
    """The same with the lamp cut by the edge between corners 0 and 1 of shape "screen".

    From p the screen hides all that lies on its side of the plane through p and that edge, so Phi
    is that of the lamp's polygon clipped by the plane.
    """

    def radiance(self, shade, outline, p, viewer, order):
        lamp, screen = lamp_loop(outline, p), outline.shapes["screen"].face(0)
        phi, patterns = np.zeros_like(p), set()
        for k, point in enumerate(p):
            side = np.cross(screen[0] - point, screen[1] - point)
            side = side * -np.sign(np.dot(screen[2] - point, side))
            patterns.add(tuple((lamp - point) @ side > 0))
            visible = clip(lamp, side, np.dot(point, side))
            phi[k] = polygon_vector(point[None], visible)[0]
        assert len(patterns) == 1, "the clipped outline changes within a pixel"
        emitter, floor = shade.shapes["lamp"], shade.shapes["floor"]
        irradiance = (phi @ floor_normal(shade))[:, None] * emitter.radiance
        return irradiance * floor.bsdf.reflectance / np.pi


class LampInMirror(FloorModel):
    """A lamp over a diffuse plane, which sees it also in flat shapes of reflectances R_i, by chains of
    them: L = rho / pi L_e n.(Phi(lamp) + sum over chains of prod R_i Phi(the lamp's image cut by the
    mirrors, those after the first by their images, as p sees them))."""

    def __init__(self, *chains):
        self.chains = chains  # of names, in the order in which the plane sees them

    def images(self, shade, outline, lamp):
        """(loop, windows that cut it, what it counts) of each."""
        for chain in self.chains:
            loops = [outline.shapes[name].face(0) for name in chain] + [lamp]
            for k in reversed(range(len(chain))):
                loops[k + 1:] = [mirrored(loop, loops[k])[::-1] for loop in loops[k + 1:]]
            yield loops[-1], loops[:-1], np.prod(
                [shade.shapes[name].bsdf.reflectance for name in chain], axis=0)

    def radiance(self, shade, outline, p, viewer, order):
        lamp, n = lamp_loop(outline, p), floor_normal(shade)
        irradiance = (polygon_vector(p, lamp) @ n)[:, None]
        for image, windows, share in self.images(shade, outline, lamp):
            phi, patterns = np.zeros_like(p), set()
            for k, point in enumerate(p):
                seen, pattern = image, []
                for window in windows:
                    for a, b in zip(window, np.roll(window, -1, axis=0)):
                        side = np.cross(a - point, b - point)
                        side = side * np.sign(np.dot(window.mean(axis=0) - point, side))
                        pattern += [*((image - point) @ side > 0)]
                        seen = clip(seen, side, np.dot(point, side))
                patterns.add((len(seen), *pattern))
                phi[k] = polygon_vector(point[None], seen)[0]
            assert len(patterns) == 1, "the clipped image changes within a pixel"
            assert len(seen), "nothing of an image is seen"
            irradiance = irradiance + (phi @ n)[:, None] * share
        return (irradiance * shade.shapes["lamp"].radiance
                * shade.shapes["floor"].bsdf.reflectance / np.pi)


class LampBehindMask(LampInMirror):
    """A lamp over a diffuse plane, partly behind the flat shape "mask" of opacity o:
    L = rho / pi L_e (n.Phi(lamp) - o n.Phi(the lamp cut by the mask as p sees it))."""

    def images(self, shade, outline, lamp):
        yield lamp, [outline.shapes["mask"].face(0)], -shade.shapes["mask"].bsdf.opacity


class CrossingLampsOnFloor(FloorModel):
    """A convex mesh "object" that emits L_o passes through a lamp that emits L_l, over a diffuse floor:
    L = rho / pi (L_l n.Phi(lamp) + (L_o - L_l) n.Phi(faces of the object before the lamp)).

    From every p the part before the lamp must lie within the lamp's outline.
    """

    def radiance(self, shade, outline, p, viewer, order):
        loop, shape = lamp_loop(outline, p), outline.shapes["object"]
        phi, patterns = np.zeros_like(p), set()
        for k, point in enumerate(p):
            parts, pattern = faces_before(shape, point, loop)
            assert all(np.all(within(on_chart(part, point, loop, point), loop)) for part in parts)
            phi[k] = sum(polygon_vector(point[None], part)[0] for part in parts)
            patterns.add(pattern)
        assert len(patterns) == 1, "the crossing line changes within a pixel"
        n, floor = floor_normal(shade), shade.shapes["floor"]
        lamp, other = shade.shapes["lamp"].radiance, shade.shapes["object"].radiance
        irradiance = ((polygon_vector(p, loop) @ n)[:, None] * lamp
                      + (phi @ n)[:, None] * (other - lamp))
        return irradiance * floor.bsdf.reflectance / np.pi


def within(points, loop):
    """Whether points of the plane of a convex loop (N by 3) lie inside it."""
    normal = loop_normal(loop)
    return np.all([(points - a) @ np.cross(normal, b - a) > 0
                   for a, b in zip(loop, np.roll(loop, -1, axis=0))], axis=0)


class LampInGloss(FloorModel):
    """A lamp over a rough conductor: L = L_e times the integral of f_s over the lamp's outline."""

    def radiance(self, shade, outline, p, viewer, order):
        emitted = shade.shapes["lamp"].radiance
        return lobe_over_polygon(p, floor_normal(shade), viewer, shade.shapes["floor"].bsdf,
                                 lamp_loop(outline, p), 4 * order, lambda x: emitted)


class WedgeInGloss(FloorModel):
    """Two diffuse faces that meet in a sharp edge, over a glossy floor; a lamp lights face 0 only.

    Seen from p face 0 has L_A(x) = rho_A / pi L_e n_A.Phi_lamp(x) and face 1 is black, so the edge
    between them, both seen from the front, carries the jump L_A(x). The floor sees the lamp's back.
    """

    def radiance(self, shade, outline, p, viewer, order):
        wedge, lamp = outline.shapes["wedge"], outline.shapes["lamp"].face(0)
        lit, dark = wedge.face(0), wedge.face(1)
        assert np.all((p - lamp[0]) @ loop_normal(lamp) < 0), "the floor sees the lamp's front"
        assert np.all((lamp - dark[0]) @ loop_normal(dark) < 0), "the dark face sees the lamp"
        assert np.all((p - dark[0]) @ loop_normal(dark) > 0), "the dark face is not seen"
        n = loop_normal(shade.shapes["wedge"].face(0))
        rho, emitted = shade.shapes["wedge"].bsdf.reflectance, shade.shapes["lamp"].radiance

        def reflected(x):
            irradiance = polygon_vector(x, lamp_loop(outline, x)) @ n
            return irradiance[:, None] * rho / np.pi * emitted

        return lobe_over_polygon(p, floor_normal(shade), viewer, shade.shapes["floor"].bsdf, lit,
                                 4 * order, reflected)


class RampOnFloor(FloorModel):
    """A lamp whose radiance is bilinear over its face, over a diffuse floor.

    Directions from the floor are points of the plane of the lamp at rest as seen from the point of
    the floor at rest: the lamp's outline there, and what the lamp sends in these directions.
    """

    def image(self, domain, shade, outline, shadow, order):
        nodes, weights = square_rule(order)

        def mean(corner):
            film = nodes + corner
            p = [hit_plane(s.camera, film, s.shapes["floor"].face(0))
                 for s in (domain, shade, outline)]
            return sum(weight * self.radiance_at(shade, outline, domain, [q[k] for q in p], order)
                       for k, weight in enumerate(weights))

        return pixels(domain.camera, mean)

    def radiance_at(self, shade, outline, rest, p, order):
        chart = rest.shapes["lamp"].face(0)
        loop = on_chart(outline.shapes["lamp"].face(0), p[2], chart, p[0])
        parts = [loop_rule(loop[[0, k, k + 1]], 2 * order) for k in (1, 2)]
        node, area = (np.concatenate(values) for values in zip(*parts))
        w = node - p[0]
        r = np.linalg.norm(w, axis=1)
        omega = w / r[:, None]
        lamp = shade.shapes["lamp"]
        normal = loop_normal(lamp.face(0))
        x = p[1] + omega * ((lamp.face(0)[0] - p[1]) @ normal / (omega @ normal))[:, None]
        f = lobe(shade.shapes["floor"].bsdf, floor_normal(shade), None, omega)
        return (area * -(w @ loop_normal(chart)) / r**3) @ (f * ramp(lamp, x))


class BoardInGloss(FloorModel):
    """A checkerboard that a lamp lights, over a glossy floor, which sees the lamp's back.

    A square's radiance is rho / pi L_e n.Phi_lamp(x): L is the sum over squares of its integral.
    """

    def radiance(self, shade, outline, p, viewer, order):
        board, bsdf = outline.shapes["board"], shade.shapes["board"].bsdf
        lamp, n = outline.shapes["lamp"].face(0), loop_normal(shade.shapes["board"].face(0))
        assert np.all((p - lamp[0]) @ loop_normal(lamp) < 0), "the floor sees the lamp's front"
        emitted = shade.shapes["lamp"].radiance

        def irradiance(x):
            return (polygon_vector(x, lamp_loop(outline, x)) @ n)[:, None] * emitted

        return sum(lobe_over_polygon(p, floor_normal(shade), viewer, shade.shapes["floor"].bsdf, loop,
                                     4 * order, irradiance) * bsdf.colors[color] / np.pi
                   for loop, color in squares(board, 0))


class SharpShadow(FloorModel):
    """A triangle's sharp shadow on a diffuse floor: L = rho / pi E n.wo where the floor is lit.

    The shadow is a polygon on the film: its share of the pixel is taken off the whole pixel.
    """

    def image(self, domain, shade, outline, shadow, order):
        corners = shadow_on_plane(shadow.lights["lamp"], shadow.shapes["object"].face(0),
                                  shadow.shapes["floor"].face(0))
        dark = shadow.camera.project(corners)

        def mean(lower):
            square = lower + np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
            part = clip_box(dark, lower, lower + 1)
            whole = self.light(shade, square, order)
            return whole - self.light(shade, part, order) if len(part) else whole

        return pixels(domain.camera, mean)

    def light(self, scene, polygon, order):
        film, weights = loop_rule(polygon, order)
        floor = scene.shapes["floor"]
        x = hit_plane(scene.camera, film, floor.face(0))
        return weights @ reflected_light(scene.lights["lamp"], floor, x)


def reflected_light(light, shape, x):
    """Radiance that leaves points x of face 0 of a diffuse shape, lit from its front."""
    wo, irradiance = light.arriving(x)
    cosine = wo @ loop_normal(shape.face(0))
    assert np.all(cosine > 0), "lit from behind"
    return cosine[:, None] * irradiance * shape.bsdf.reflectance / np.pi


class SharpShadowInGloss(FloorModel):
    """A triangle's sharp shadow on a diffuse panel, seen in a glossy floor that the light misses.

    Directions from the floor are points of the plane of the panel at rest as seen from the point of
    the floor at rest, where all outlines are polygons: the panel's, and in it the shadow's.
    """

    def image(self, domain, shade, outline, shadow, order):
        nodes, weights = square_rule(order)

        def mean(corner):
            film = nodes + corner
            q = [hit_plane(s.camera, film, s.shapes["floor"].face(0))
                 for s in (domain, shade, outline, shadow)]
            viewer = -shade.camera.directions(film)
            return sum(weight * self.radiance_at(shade, outline, shadow, domain, [p[k] for p in q],
                                                 viewer[k], order)
                       for k, weight in enumerate(weights))

        return pixels(domain.camera, mean)

    def radiance_at(self, shade, outline, shadow, rest, q, viewer, order):
        chart = rest.shapes["panel"].face(0)
        panel = on_chart(outline.shapes["panel"].face(0), q[2], chart, q[0])
        corners = shadow_on_plane(shadow.lights["lamp"], shadow.shapes["object"].face(0),
                                  shadow.shapes["panel"].face(0))
        dark = on_chart(corners, q[3], chart, q[0])
        frame = chart_frame(chart)
        flat, hole = (panel - chart[0]) @ frame.T, (dark - chart[0]) @ frame.T
        assert polygon_area(clip_convex(hole, flat)) > polygon_area(hole) * (1 - 1e-9), "clipped"
        return (self.reflected(shade, chart, q[0], panel, q[1], viewer, order)
                - self.reflected(shade, chart, q[0], dark, q[1], viewer, order))

    def reflected(self, shade, chart, q_rest, polygon, q, viewer, order):
        # As triangles, whatever its shape: one rule for the polygon at rest and moved.
        parts = [loop_rule(polygon[[0, k, k + 1]], 4 * order) for k in range(1, len(polygon) - 1)]
        node, area = (np.concatenate(values) for values in zip(*parts))
        w = node - q_rest
        r = np.linalg.norm(w, axis=1)
        facing = -(w @ loop_normal(chart))
        omega = w / r[:, None]
        panel = shade.shapes["panel"]
        normal = loop_normal(panel.face(0))
        x = q + omega * ((panel.face(0)[0] - q) @ normal / (omega @ normal))[:, None]
        f = lobe(shade.shapes["floor"].bsdf, floor_normal(shade), viewer, omega)
        return (area * facing / r**3) @ (f * reflected_light(shade.lights["lamp"], panel, x))


def on_chart(points, q, chart, q_rest):
    """Directions from q to the points as points of the chart's plane seen from q_rest."""
    w, normal = points - q, loop_normal(chart)
    return q_rest + w * ((chart[0] - q_rest) @ normal / (w @ normal))[:, None]


def chart_frame(chart):
    """Two orthonormal rows in the plane of the chart."""
    a = unit(chart[1] - chart[0])
    return np.stack([a, np.cross(loop_normal(chart), a)])


def film_loop(scene, loop):
    """A face as a polygon on the film [pixels]."""
    return scene.camera.project(loop)


class LampsInView:
    """Shapes "near" and "far" emit, near hides part of far, before a constant sky.

    I = L_sky + (L_near - L_sky) c(near) + (L_far - L_sky) (c(far) - c(near and far)), where c is
    the integral of the reconstruction filter over a polygon on the film.
    """

    outlines_in_view = True

    def image(self, domain, shade, outline, shadow, order):
        camera, sky = domain.camera, shade.environment
        near = film_loop(domain, domain.shapes["near"].face(0))
        far = film_loop(domain, domain.shapes["far"].face(0))
        both, cover = clip_convex(far, near), Filter(camera.filter).over_polygon

        def mean(corner):
            at = corner + 0.5
            shown = cover(far, at) - cover(both, at)
            return (sky + (shade.shapes["near"].radiance - sky) * cover(near, at)
                    + (shade.shapes["far"].radiance - sky) * shown)

        return pixels(camera, mean)


class LampsInMirror:
    """Shapes "near" and "far" emit; the camera sees them in the flat shape "mirror" of reflectance R
    alone, before a constant sky. With m the mirror on the film,

    I = L_sky + c(m) (R - 1) L_sky + R ((L_near - L_sky) c(near and m)
        + (L_far - L_sky) (c(far and m) - c(near and far and m))).
    """

    outlines_in_view = True

    def image(self, domain, shade, outline, shadow, order):
        camera, sky, shapes = domain.camera, shade.environment, domain.shapes
        mirror = film_loop(domain, shapes["mirror"].face(0))
        near, far = (clip_convex(film_loop(domain, mirrored(
            shapes[name].face(0), shapes["mirror"].face(0))), mirror) for name in ("near", "far"))
        both, cover = clip_convex(far, near), Filter(camera.filter).over_polygon
        share = shade.shapes["mirror"].bsdf.reflectance

        def mean(corner):
            at = corner + 0.5
            shown = cover(far, at) - cover(both, at)
            return (sky + (share - 1) * sky * cover(mirror, at)
                    + share * (shade.shapes["near"].radiance - sky) * cover(near, at)
                    + share * (shade.shapes["far"].radiance - sky) * shown)

        return pixels(camera, mean)


class LampsInWedge:
    """The same in two faces of "mirror" that meet in a crease, which hide nothing of each other: the
    sum over both, each of which shows one of the lamps."""

    outlines_in_view = True

    def image(self, domain, shade, outline, shadow, order):
        camera, sky, mirror = domain.camera, shade.environment, domain.shapes["mirror"]
        share, cover = shade.shapes["mirror"].bsdf.reflectance, Filter(camera.filter).over_polygon
        parts = []
        for k in range(2):
            window = film_loop(domain, mirror.face(k))
            near, far = (clip_convex(film_loop(domain, mirrored(
                domain.shapes[name].face(0), mirror.face(k))), window) for name in ("near", "far"))
            parts += [(window, (share - 1) * sky)]
            parts += [(loop, share * (shade.shapes[name].radiance - sky))
                      for name, loop in (("near", near), ("far", far)) if len(loop) > 2]
        assert len(parts) == 4, "each face shows one lamp"
        return pixels(camera, lambda corner: sky + sum(
            cover(loop, corner + 0.5) * jump for loop, jump in parts))


class LampsBehindMask:
    """LampsInView, a part of it behind the flat shape "mask" of opacity o: with c(m) what the mask
    covers, I - o (I restricted to m)."""

    outlines_in_view = True

    def image(self, domain, shade, outline, shadow, order):
        camera, sky, shapes = domain.camera, shade.environment, domain.shapes
        mask, near, far = (film_loop(domain, shapes[name].face(0))
                           for name in ("mask", "near", "far"))
        cover, opacity = Filter(camera.filter).over_polygon, shade.shapes["mask"].bsdf.opacity

        def share(loop, at):
            return cover(loop, at) - opacity * cover(clip_convex(loop, mask), at)

        def mean(corner):
            at = corner + 0.5
            shown = share(far, at) - share(clip_convex(far, near), at)
            return (sky * (1 - opacity * cover(mask, at))
                    + (shade.shapes["near"].radiance - sky) * share(near, at)
                    + (shade.shapes["far"].radiance - sky) * shown)

        return pixels(camera, mean)


def passed(camera, film, planes, indices):
    """The share (N by 1) of radiance behind parallel planes of glass that arrives at film (N by 2)."""
    cosine, share, before = np.abs(camera.directions(film) @ loop_normal(planes[0])), 1.0, 1.0
    for index in indices:
        eta = index / before
        other = np.sqrt(1 - (1 - cosine**2) / eta**2)
        parallel = (eta * cosine - other) / (eta * cosine + other)
        across = (cosine - eta * other) / (cosine + eta * other)
        share = share * (1 - (parallel**2 + across**2) / 2) / eta**2
        cosine, before = other, index
    return share[:, None]


class LampsThroughGlass:
    """Shapes "near" and "far" emit, in a pixel each, before black. The camera sees them through flat
    faces of shape "glass", which it sees beyond the film's borders:
    I = the integral over the lamps of L_e (1 - F) / eta^2 |ds / dA| dA, s their places on the film."""

    outlines_in_view = True

    def __init__(self, *faces):
        self.faces = faces  # of "glass", from the camera on

    def layers(self, scene):
        glass = scene.shapes["glass"]
        eta = glass.bsdf.eta
        return [glass.face(k) for k in self.faces], [eta, 1][:len(self.faces)]

    def film(self, scene, points):
        eye = scene.camera.pinhole()
        if scene.camera.half_width:
            return scene.camera.project(
                along_layers(scene.camera.axes()[2], points, *self.layers(scene)))
        return scene.camera.project(eye + through_layers(eye, points, *self.layers(scene)))

    def image(self, domain, shade, outline, shadow, order):
        result = np.zeros((domain.camera.height, domain.camera.width, 3))
        for name in ("near", "far"):
            loop = domain.shapes[name].face(0)
            points, weights = loop_rule(loop, 2 * order)
            axis = unit(loop[1] - loop[0])
            slopes, h = [], 2.0**-6
            for step in (axis, np.cross(loop_normal(loop), axis)):
                slopes.append(sum(w / h * (self.film(domain, points + k * h * step)
                                           - self.film(domain, points - k * h * step))
                                  for k, w in {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}.items()))
            size = np.abs(slopes[0][:, 0] * slopes[1][:, 1] - slopes[0][:, 1] * slopes[1][:, 0])
            film = self.film(domain, points)
            column, row = np.floor(film[0]).astype(int)
            assert np.all(np.floor(film) == [column, row]), "a lamp is in several pixels"
            share = passed(shade.camera, film, *self.layers(shade))
            result[row, column] += (weights * size) @ share * shade.shapes[name].radiance
        return result


class ThroughLens:
    """The mean of another model over the points of a lens."""

    outlines_in_view = True

    def __init__(self, model):
        self.model = model

    def image(self, domain, shade, outline, shadow, order):
        nodes, weights = gauss(order // 2 + 1)
        angles = (np.arange(2 * order) + 0.25) * (np.pi / order)
        result = 0
        for u, weight in zip(nodes, weights):
            for angle in angles:
                at = (np.sqrt(u) * np.cos(angle), np.sqrt(u) * np.sin(angle))
                scenes = [copy.copy(s) for s in (domain, shade, outline, shadow)]
                for scene in scenes:
                    scene.camera = dataclasses.replace(scene.camera, at=at)
                result = result + weight / len(angles) * self.model.image(*scenes, order)
        return result


class CrossingInView:
    """A convex mesh "object" that emits L_o passes through a face "plane" that emits L_p, before a
    constant sky: I = L_sky + (L_p - L_sky) c(plane) + (L_o - L_p) c(the object before the plane)."""

    outlines_in_view = True

    def image(self, domain, shade, outline, shadow, order):
        camera, sky, loop = domain.camera, shade.environment, domain.shapes["plane"].face(0)
        parts, _ = faces_before(domain.shapes["object"], camera.pinhole(), loop)
        plane, parts = film_loop(domain, loop), [film_loop(domain, part) for part in parts]
        for part in parts:
            assert polygon_area(clip_convex(part, plane)) > polygon_area(part) * (1 - 1e-9), "beyond"
        emitted, other = shade.shapes["plane"].radiance, shade.shapes["object"].radiance

        def mean(box):
            covered = sum(polygon_area(clip_box(part, box, box + 1)) for part in parts)
            return (sky + (other - emitted) * covered
                    + (emitted - sky) * polygon_area(clip_box(plane, box, box + 1)))

        return pixels(camera, mean)


class ConvexInView:
    """A convex diffuse mesh under a constant sky of radiance L_e, which is the background too.

    No point of it sees anything but sky above its own plane: its radiance is rho L_e exactly, and
    I = L_e + (rho - 1) L_e c(outline). The outline's part is summed over its front faces.
    """

    outlines_in_view = True

    def image(self, domain, shade, outline, shadow, order):
        camera, sky, shape = domain.camera, shade.environment, domain.shapes["object"]
        front = [film_loop(domain, shape.vertices[f]) for f in shape.faces
                 if np.dot(camera.pinhole() - shape.vertices[f][0],
                           loop_normal(shape.vertices[f])) > 0]
        rho = shade.shapes["object"].bsdf.reflectance
        return pixels(camera, lambda box: sky + (rho - 1) * sky * sum(
            polygon_area(clip_box(f, box, box + 1)) for f in front))


class BoardInView:
    """Flat checkerboards under a constant sky of radiance L_e, which is the background too: the
    radiance of a square is rho L_e, and I = L_e + sum over squares of (rho - 1) L_e c(square)."""

    outlines_in_view = True

    def image(self, domain, shade, outline, shadow, order):
        camera, sky, shape = domain.camera, shade.environment, domain.shapes["board"]
        colors = shade.shapes["board"].bsdf.colors
        parts = [(film_loop(domain, loop), (colors[color] - 1) * sky)
                 for k in range(len(shape.faces)) for loop, color in squares(shape, k)]
        return pixels(camera, lambda box: sky + sum(
            excess * polygon_area(clip_box(loop, box, box + 1)) for loop, excess in parts))


class ReceiverInView:
    """A small diffuse face "receiver" before black, lit by a lamp: the mean over pixels of
    rho / pi L_e n.Phi(p) inside the receiver's outline on the film, 0 outside."""

    outlines_in_view = True

    def image(self, domain, shade, outline, shadow, order):
        seen = film_loop(domain, domain.shapes["receiver"].face(0))
        n = loop_normal(shade.shapes["receiver"].face(0))
        scale = shade.shapes["receiver"].bsdf.reflectance / np.pi * shade.shapes["lamp"].radiance

        def mean(box):
            part = clip_box(seen, box, box + 1)
            if len(part) == 0:
                return np.zeros(3)
            film, weights = loop_rule(part, order)
            p = hit_plane(outline.camera, film, outline.shapes["receiver"].face(0))
            phi = polygon_vector(p, lamp_loop(outline, p))
            return np.dot(weights, phi @ n) * scale

        return pixels(domain.camera, mean)
