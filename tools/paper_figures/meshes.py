"""Patches of the paper's Fig. 7 as meshes, and the count of its Table 2. A mesh is (positions V by
3, triangles F by 3)."""

import numpy as np


def _grid(rows, columns, points):
    """Positions of points(i, j) over a grid."""
    i, j = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    return np.stack(points(i, j), -1).reshape(-1, 3)


def sphere(faces):
    """About so many faces; every other ring is turned by half a step."""
    rings = max(4, round((faces / 4) ** 0.5))
    around = 2 * rings

    def at(i, j):
        a, b = np.pi * (i + 1) / rings, 2 * np.pi * (j + 0.5 * ((i + 1) % 2)) / around
        return np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), np.cos(a)

    points = np.concatenate([[(0, 0, 1)], _grid(rings - 1, around, at), [(0, 0, -1)]])
    last, j = len(points) - 1, np.arange(around)
    k = (j + 1) % around
    parts = [(0 * j, 1 + j, 1 + k), (0 * j + last, last - around + k, last - around + j)]
    for i in range(rings - 2):
        a, b = 1 + i * around, 1 + (i + 1) * around
        # The shorter diagonal.
        parts += ([(a + j, b + j, a + k), (b + j, b + k, a + k)] if i % 2 else
                  [(a + j, b + j, b + k), (a + j, b + k, a + k)])
    return points, np.concatenate([np.stack(part, -1) for part in parts])


def torus(faces):
    """Radii 1 and 0.4."""
    tube = max(6, round((faces / 5) ** 0.5))
    around = round(2.5 * tube)

    def at(i, j):
        a, b = 2 * np.pi * i / around, 2 * np.pi * j / tube
        r = 1 + 0.4 * np.cos(b)
        return r * np.cos(a), r * np.sin(a), 0.4 * np.sin(b)

    i, j = (axis.ravel() for axis in np.meshgrid(np.arange(around), np.arange(tube), indexing="ij"))
    p, q, k = i * tube, (i + 1) % around * tube, (j + 1) % tube
    triangles = np.stack([(p + j, q + j, q + k), (p + j, q + k, p + k)])
    return _grid(around, tube, at), triangles.transpose(2, 0, 1).reshape(-1, 3)


MADE = {"sphere": sphere, "torus": torus}


def write_obj(file, points, triangles):
    with open(file, "w", encoding="utf-8") as out:
        np.savetxt(out, points, "v %.9g %.9g %.9g")
        np.savetxt(out, triangles + 1, "f %d %d %d")


def _read_obj(file):
    points, triangles = [], []
    with open(file, encoding="utf-8", errors="replace") as stream:
        for line in stream:
            words = line.split()
            if words[:1] == ["v"]:
                points.append([float(w) for w in words[1:4]])
            elif words[:1] == ["f"]:
                face = [int(w.split("/")[0]) for w in words[1:]]
                face = [v - 1 if v > 0 else len(points) + v for v in face]
                triangles += [(face[0], face[k], face[k + 1]) for k in range(1, len(face) - 1)]
    return np.array(points), np.array(triangles)


def _read_ply(file):
    """As limn_generate writes them: binary, little endian, float positions first."""
    with open(file, "rb") as stream:
        content = stream.read()
    end = content.index(b"end_header\n") + len(b"end_header\n")
    counts, floats, element = {}, {}, ""
    for line in content[:end].decode("ascii").splitlines():
        words = line.split()
        if words[0] == "format" and words[1] != "binary_little_endian":
            raise ValueError(f"{file}: not a binary little-endian PLY file")
        if words[0] == "element":
            element = words[1]
            counts[element], floats[element] = int(words[2]), 0
        if words[0] == "property" and words[1] == "float":
            floats[element] += 1
    width = floats["vertex"]
    points = np.frombuffer(content, "<f4", counts["vertex"] * width, end).reshape(-1, width)[:, :3]
    faces = np.frombuffer(content, np.dtype([("corners", "u1"), ("at", "<i4", 3)]),
                          counts["face"], end + points.shape[0] * 4 * width)
    return points.astype(float), faces["at"]


def read(file):
    return (_read_ply if file.lower().endswith(".ply") else _read_obj)(file)


def count_edges(points, triangles):
    """(edges that are not within a plane, concave ones of these). Copies of a vertex are one."""
    points, weld = np.unique(np.asarray(points, float), axis=0, return_inverse=True)
    faces = weld.reshape(-1)[np.asarray(triangles)]
    # Edge, then opposite corner.
    sides = np.stack([np.roll(faces, -k, axis=1) for k in range(3)], 1).reshape(-1, 3)
    _, edge, uses = np.unique(np.sort(sides[:, :2], axis=1), axis=0, return_inverse=True,
                              return_counts=True)
    inner = np.argsort(edge.reshape(-1), kind="stable")
    inner = inner[uses[edge.reshape(-1)[inner]] == 2]
    (a, b, c), d = sides[inner[0::2]].T, sides[inner[1::2], 2]
    normal = np.cross(points[b] - points[a], points[c] - points[a])
    height = np.einsum("ij,ij->i", normal, points[d] - points[a])
    # The rounding of positions that are floats, in the size of what is compared.
    largest = np.abs(points[[a, b, d]]).max(axis=(0, 2))
    flat = np.abs(height) <= 2**-20 * np.linalg.norm(normal, axis=1) * largest
    return len(uses) - int(flat.sum()), int(((height > 0) & ~flat).sum())
