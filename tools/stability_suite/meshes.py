"""Meshes of the suite, in numpy. A mesh is (positions V by 3 in double, faces F by 3)."""

import numpy as np

# A square turned by 18 degrees whose corners are multiples of 1/8: exact in float even far away.
CORNERS = np.array([(0.375, 0.125), (-0.125, 0.375), (-0.375, -0.125), (0.125, -0.375)])
SIDES = [(0, 1), (1, 2), (2, 3), (3, 0)]


def join(*meshes):
    positions, faces, before = [], [], 0
    for p, f in meshes:
        positions.append(np.asarray(p, float))
        faces.append(np.asarray(f, int) + before)
        before += len(p)
    return np.concatenate(positions), np.concatenate(faces)


def quad(a, b, c, d):
    return np.array([a, b, c, d], float), np.array([(0, 1, 2), (0, 2, 3)])


def level(x, y, z, half, up=True):
    """A horizontal square."""
    corners = [(x - half, y - half, z), (x + half, y - half, z),
               (x + half, y + half, z), (x - half, y + half, z)]
    return quad(*(corners if up else corners[::-1]))


def ring(corners, z):
    return [(x, y, z) for x, y in corners]


def between(low, high):
    """A closed surface between two convex rings of as many points: lid, floor and sides. The rings
    turn counter-clockwise seen from the upper one."""
    n = len(low)
    faces = [(0, i + 1, i) for i in range(1, n - 1)]
    faces += [(n, n + i, n + i + 1) for i in range(1, n - 1)]
    for i in range(n):
        j = (i + 1) % n
        faces += [(i, j, n + j), (i, n + j, n + i)]
    return np.concatenate([np.asarray(low, float), np.asarray(high, float)]), np.array(faces)


def prism(bottom=0.25, top=1.0, corners=CORNERS):
    """Closed, over any convex polygon that turns counter-clockwise seen from above."""
    return between(ring(corners, bottom), ring(corners, top))


def band(low, high):
    """Upright squares between two rings of four points."""
    return [quad(low[i], low[j], high[j], high[i]) for i, j in SIDES]


def prism_quads(bottom=0.25, top=1.0, out=0.0):
    """The six faces of the prism, each a mesh, moved outwards by `out`."""
    low, high = ring(CORNERS, bottom), ring(CORNERS, top)
    moved = []
    for p, f in [quad(*low[::-1]), quad(*high), *band(low, high)]:
        normal = np.cross(p[1] - p[0], p[2] - p[0])
        moved.append((p + out * normal / np.linalg.norm(normal), f))
    return moved


def block(center, half):
    """A box along the axes; half: of its sides."""
    (x, y, z), (a, b, c) = center, half
    return prism(z - c, z + c, np.array([(x + a, y + b), (x - a, y + b), (x - a, y - b),
                                         (x + a, y - b)]))


def split_sides(count, bottom=0.25, top=1.0):
    """The prism, its upright faces in `count` strips that its lid and floor know nothing of:
    T-junctions along all level edges."""
    low, high = ring(CORNERS, bottom), ring(CORNERS, top)
    parts = [quad(*low[::-1]), quad(*high)]
    for i, j in SIDES:
        a, b, c, d = map(np.array, (low[i], low[j], high[j], high[i]))
        for k in range(count):
            s, t = k / count, (k + 1) / count
            parts.append(quad(a + s * (b - a), a + t * (b - a), d + t * (c - d), d + s * (c - d)))
    return join(*parts)


def slivers(width, bottom=0.25, top=1.0):
    """The prism with strips of this width along all its edges."""
    inner = CORNERS * (1 - width / np.linalg.norm(CORNERS[0]))
    outer_low, outer_high = ring(CORNERS, bottom), ring(CORNERS, top)
    next_low, next_high = ring(CORNERS, bottom + width), ring(CORNERS, top - width)
    inner_low, inner_high = ring(inner, bottom), ring(inner, top)
    parts = [quad(*inner_low[::-1]), quad(*inner_high)]
    for below, above in ((outer_low, next_low), (next_low, next_high), (next_high, outer_high),
                         (outer_high, inner_high), (inner_low, outer_low)):
        parts += band(below, above)
    return join(*parts)


def with_faces_without_area(count):
    """The prism and faces whose three corners are different points of one of its edges."""
    p, f = prism()
    edges = [(i, j) for i, j in SIDES] + [(i + 4, j + 4) for i, j in SIDES]
    edges += [(i, i + 4) for i in range(4)]
    positions, faces = list(p), list(f)
    for k in range(count):
        a, b = edges[k % len(edges)]
        t = (k + 1) / (count + 2)
        faces.append((a, b, len(positions)))
        positions.append(p[a] + t * (p[b] - p[a]))
    return np.array(positions), np.array(faces)


def with_inner_walls(count, bottom=0.25, top=1.0):
    """The prism in count + 1 slices: walls within, whose edges have four faces or three."""
    a, b, c, d = CORNERS
    parts = []
    for k in range(count + 2):
        t = k / (count + 1)
        s = (k + 1) / (count + 1)
        near, far = a + t * (b - a), d + t * (c - d)
        wall = [(*far, bottom), (*near, bottom), (*near, top), (*far, top)]
        parts.append(quad(*(wall if k == 0 else wall[::-1])))
        if k == count + 1:
            break
        near_next, far_next = a + s * (b - a), d + s * (c - d)
        parts.append(quad((*near, bottom), (*near_next, bottom), (*near_next, top), (*near, top)))
        parts.append(quad((*far_next, bottom), (*far, bottom), (*far, top), (*far_next, top)))
        parts.append(quad((*far, top), (*near, top), (*near_next, top), (*far_next, top)))
        parts.append(quad((*far_next, bottom), (*near_next, bottom), (*near, bottom),
                          (*far, bottom)))
    return join(*parts)


def lathe_sphere(center, radius, seam=0.0, around=24, along=12):
    """A sphere of longitudes and latitudes. The last meridian is a copy of the first, off by `seam`
    radii; None: the first one itself."""
    positions, faces = [], []
    columns = around if seam is None else around + 1
    for i in range(columns):
        phi = 2 * np.pi * (i % around) / around
        for k in range(along + 1):
            theta = np.pi * k / along
            p = np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])
            if i % around == 0:
                p[1] = 0.0
            if i == around and 0 < k < along:
                p = p + seam * np.array([0.5, -1.0, 0.5])
            if k in (0, along):
                p[:2] = 0.0
            positions.append(np.asarray(center) + radius * p)
    for i in range(around):
        first, second = i * (along + 1), (i + 1) % columns * (along + 1)
        for k in range(along):
            if k > 0:
                faces.append((first + k, first + k + 1, second + k))
            if k < along - 1:
                faces.append((second + k, first + k + 1, second + k + 1))
    return np.array(positions), np.array(faces)


def icosphere(center, radius, splits=2):
    g = (1 + 5**0.5) / 2
    points = [np.array(p, float) for p in (
        (-1, g, 0), (1, g, 0), (-1, -g, 0), (1, -g, 0), (0, -1, g), (0, 1, g), (0, -1, -g),
        (0, 1, -g), (g, 0, -1), (g, 0, 1), (-g, 0, -1), (-g, 0, 1))]
    faces = [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4),
             (11, 10, 2), (10, 7, 6), (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8),
             (3, 8, 9), (4, 9, 5), (2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1)]
    for _ in range(splits):
        middles, finer = {}, []

        def middle(i, j):
            key = (min(i, j), max(i, j))
            if key not in middles:
                middles[key] = len(points)
                points.append(points[i] + points[j])
            return middles[key]

        for a, b, c in faces:
            ab, bc, ca = middle(a, b), middle(b, c), middle(c, a)
            finer += [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
            for m in (ab, bc, ca):
                points[m] = points[m] / np.linalg.norm(points[m])
        faces = finer
    unit = np.array([p / np.linalg.norm(p) for p in points])
    return np.asarray(center) + radius * unit, np.array(faces)


def rod(start, end, radius, sides=6):
    """A closed prism about a segment."""
    start, end = np.asarray(start, float), np.asarray(end, float)
    axis = (end - start) / np.linalg.norm(end - start)
    u = np.cross(axis, (0.3, 0.5, 0.8))
    u /= np.linalg.norm(u)
    angles = 2 * np.pi * np.arange(sides) / sides
    around = radius * (np.cos(angles)[:, None] * u + np.sin(angles)[:, None] * np.cross(axis, u))
    return between(start + around, end + around)


def tray(thickness, bottom=0.3, top=0.9, half=0.4):
    """A box without a lid, its walls as thick as this."""
    inner = half - thickness
    outside = np.array([(half, half), (-half, half), (-half, -half), (half, -half)])
    inside = outside * (inner / half)
    out_low, out_high = ring(outside, bottom), ring(outside, top)
    in_low, in_high = ring(inside, bottom + thickness), ring(inside, top)
    parts = [quad(*out_low[::-1]), quad(*in_low), *band(out_low, out_high),
             *band(out_high, in_high), *band(in_high, in_low)]
    return turned(join(*parts), 0.3)


def turned(mesh, angle, about=(0, 0)):
    """About an upright axis, in radians."""
    p = np.array(mesh[0], float)
    c, s = np.cos(angle), np.sin(angle)
    x, y = p[:, 0] - about[0], p[:, 1] - about[1]
    p[:, 0], p[:, 1] = about[0] + c * x - s * y, about[1] + s * x + c * y
    return p, mesh[1]


def room(half, splits):
    """A cube seen from within, each side in splits by splits squares."""
    parts = []
    for axis in range(3):
        for sign in (-1, 1):
            def at(s, t, axis=axis, sign=sign):
                p = np.zeros(3)
                p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3] = sign, sign * s, t
                return half * p
            steps = np.linspace(-1, 1, splits + 1)
            for i in range(splits):
                for j in range(splits):
                    a, b, c, d = steps[i], steps[i + 1], steps[j], steps[j + 1]
                    parts.append(quad(at(a, c), at(a, d), at(b, d), at(b, c)))
    return join(*parts)


def bricks(count, half, first):
    """Rows first, first + 2, ... of a level square of `count` rows; those of odd rows begin half a
    brick later."""
    size = 2 * half / count
    parts = []
    for row in range(first, count, 2):
        low, high = -half + row * size, -half + (row + 1) * size
        cuts = [-half + (k + 0.5 * (row % 2)) * size for k in range(count + 1)]
        cuts = [-half, *(c for c in cuts if -half < c < half), half]
        parts += [quad((a, low, 0), (b, low, 0), (b, high, 0), (a, high, 0))
                  for a, b in zip(cuts, cuts[1:])]
    return parts


def scattered(count, spread=0.5, fill=0.35, seed=5):
    """Small tetrahedra in a cube, turned at random; together they take about the same space."""
    rng = np.random.default_rng(seed)
    size = fill * spread / count ** (1 / 3) if count > 1 else 0.7 * spread
    corners = np.array([(1, 1, 1), (-1, -1, 1), (-1, 1, -1), (1, -1, -1)], float)
    faces = [(0, 1, 3), (0, 2, 1), (0, 3, 2), (1, 2, 3)]
    parts = []
    for _ in range(count):
        turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        if np.linalg.det(turn) < 0:
            turn = -turn
        at = rng.uniform(-spread, spread, 3) if count > 1 else np.zeros(3)
        parts.append((at + size * corners @ turn.T, outwards(corners, faces)))
    return join(*parts)


def outwards(corners, faces):
    """The faces of a convex body about the origin, turned so that they face out."""
    turned_faces = []
    for a, b, c in faces:
        normal = np.cross(corners[b] - corners[a], corners[c] - corners[a])
        turned_faces.append((a, b, c) if normal @ corners[a] > 0 else (a, c, b))
    return turned_faces
