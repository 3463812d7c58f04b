"""Patches of the paper's Fig. 7 as meshes, and the count of its Table 2."""

import math
import struct


def sphere(faces):
    """About so many faces: positions, triangles."""
    rings = max(4, round(math.sqrt(faces / 4)))
    around = 2 * rings
    points = [(0.0, 0.0, 1.0)]
    for i in range(1, rings):
        a = math.pi * i / rings
        for j in range(around):
            b = 2 * math.pi * (j + 0.5 * (i % 2)) / around
            points.append((math.sin(a) * math.cos(b), math.sin(a) * math.sin(b), math.cos(a)))
    points.append((0.0, 0.0, -1.0))
    last = len(points) - 1
    triangles = []
    for j in range(around):
        k = (j + 1) % around
        triangles.append((0, 1 + j, 1 + k))
        triangles.append((last, last - around + k, last - around + j))
        for i in range(rings - 2):
            a, b = 1 + i * around, 1 + (i + 1) * around
            # Every other ring is turned by half a step: the shorter diagonal.
            if i % 2:
                triangles += [(a + j, b + j, a + k), (b + j, b + k, a + k)]
            else:
                triangles += [(a + j, b + j, b + k), (a + j, b + k, a + k)]
    return points, triangles


def torus(faces):
    """Radii 1 and 0.4."""
    tube = max(6, round(math.sqrt(faces / 5)))
    around = round(2.5 * tube)
    points = []
    for i in range(around):
        a = 2 * math.pi * i / around
        for j in range(tube):
            b = 2 * math.pi * j / tube
            r = 1 + 0.4 * math.cos(b)
            points.append((r * math.cos(a), r * math.sin(a), 0.4 * math.sin(b)))
    triangles = []
    for i in range(around):
        for j in range(tube):
            p, q = i * tube, (i + 1) % around * tube
            k = (j + 1) % tube
            triangles += [(p + j, q + j, q + k), (p + j, q + k, p + k)]
    return points, triangles


MADE = {"sphere": sphere, "torus": torus}


def write_obj(file, points, triangles):
    with open(file, "w", encoding="utf-8") as out:
        for p in points:
            out.write("v {:.9g} {:.9g} {:.9g}\n".format(*p))
        for t in triangles:
            out.write("f {} {} {}\n".format(*(v + 1 for v in t)))


def _read_obj(file):
    points, triangles = [], []
    with open(file, encoding="utf-8", errors="replace") as stream:
        for line in stream:
            words = line.split()
            if words[:1] == ["v"]:
                points.append(tuple(float(w) for w in words[1:4]))
            elif words[:1] == ["f"]:
                face = [int(w.split("/")[0]) for w in words[1:]]
                face = [v - 1 if v > 0 else len(points) + v for v in face]
                triangles += [(face[0], face[k], face[k + 1]) for k in range(1, len(face) - 1)]
    return points, triangles


def _read_ply(file):
    """As limn_generate writes them: binary, little endian, float positions first."""
    with open(file, "rb") as stream:
        content = stream.read()
    end = content.index(b"end_header\n") + len(b"end_header\n")
    counts, sizes, element = {}, {}, ""
    for line in content[:end].decode("ascii").splitlines():
        words = line.split()
        if words[0] == "format" and words[1] != "binary_little_endian":
            raise ValueError(f"{file}: not a binary little-endian PLY file")
        if words[0] == "element":
            element = words[1]
            counts[element], sizes[element] = int(words[2]), 0
        if words[0] == "property" and words[1] == "float":
            sizes[element] += 4
    points = [
        struct.unpack_from("<3f", content, end + i * sizes["vertex"])
        for i in range(counts["vertex"])
    ]
    at = end + counts["vertex"] * sizes["vertex"]
    triangles = []
    for _ in range(counts["face"]):
        triangles.append(struct.unpack_from("<3i", content, at + 1))
        at += 13
    return points, triangles


def read(file):
    return (_read_ply if file.lower().endswith(".ply") else _read_obj)(file)


def _minus(a, b):
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def _cross(a, b):
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def count_edges(points, triangles):
    """(edges that are not within a plane, concave ones of these). Copies of a vertex are one."""
    first = {}
    weld = [first.setdefault(p, i) for i, p in enumerate(points)]
    sides = {}
    for triangle in triangles:
        a, b, c = (weld[v] for v in triangle)
        for edge, opposite in (((a, b), c), ((b, c), a), ((c, a), b)):
            sides.setdefault(tuple(sorted(edge)), []).append((edge, opposite))
    edges = concave = 0
    for around in sides.values():
        edges += 1
        if len(around) != 2:
            continue
        (a, b), c = around[0]
        d = around[1][1]
        n = _cross(_minus(points[b], points[a]), _minus(points[c], points[a]))
        height = _dot(n, _minus(points[d], points[a]))
        # The rounding of positions that are floats, in the size of what is compared.
        size = math.sqrt(_dot(n, n)) * max(map(abs, (*points[a], *points[b], *points[d])))
        if abs(height) <= 2**-20 * size:
            edges -= 1
        elif height > 0:
            concave += 1
    return edges, concave
