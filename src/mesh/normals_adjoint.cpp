// The adjoint of shading normals and horizons: from them back to the positions of the one-ring.
#include "limn/core/check.h"
#include "limn/core/mesh.h"
#include "src/mesh/face_shape.h"

namespace limn {

namespace {

// Derivatives with respect to the unit normal and the angles of a face.
struct FaceAdjoint {
  Vec3d normal;
  std::array<double, 3> angles{};
};

struct Faces {
  std::vector<FaceShape<double>> shapes;
  std::vector<FaceAdjoint> adjoints;
};

// The sine of the tilt of a corner's normal against its face, and how far rounding reaches.
struct Tilt {
  double sine = -1, rounding = 0;
};

// Of each corner of each face; those of faces without area are never the largest.
std::vector<std::array<Tilt, 3>> tilts_of(const Mesh& mesh, const Faces& faces) {
  std::vector<double> noise(mesh.normals.size());
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
    if (!faces.shapes[f].has_area) continue;
    for (const uint32_t n : mesh.normal_ids[f])
      noise[n] = std::max(noise[n], faces.shapes[f].rounding);
  }
  std::vector<std::array<Tilt, 3>> tilts(mesh.faces.size());
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
    const FaceShape<double>& shape = faces.shapes[f];
    if (!shape.has_area) continue;
    for (int c = 0; c < 3; ++c) {
      const uint32_t n = mesh.normal_ids[f][c];
      tilts[f][c] = {sine_of_tilt(mesh.normals[n], shape.normal),
                     tilt_rounding(shape.rounding, noise[n])};
    }
  }
  return tilts;
}

// A horizon is the largest tilt of all corners of the faces around its vertex; sine = |n x N| of a
// corner's normal n and a face's N.
void pull_back_horizons(const Mesh& mesh, const std::vector<double>& at_root, Faces& faces,
                        std::vector<Vec3d>& normals) {
  const std::vector<std::array<Tilt, 3>> tilts = tilts_of(mesh, faces);
  std::vector<double> largest(at_root.size());
  const auto for_every_vertex = [&](const auto& visit) {
    for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
      if (!faces.shapes[f].has_area) continue;
      for (const uint32_t v : mesh.faces[f]) visit(f, mesh.weld[v]);
    }
  };
  for_every_vertex([&](uint32_t f, uint32_t v) {
    for (const Tilt& tilt : tilts[f]) largest[v] = std::max(largest[v], tilt.sine - tilt.rounding);
  });
  const auto ties_with = [&](const Tilt& tilt, uint32_t v) {
    return tilt.sine + tilt.rounding >= largest[v];
  };
  std::vector<uint32_t> ties(at_root.size());
  for_every_vertex([&](uint32_t f, uint32_t v) {
    for (const Tilt& tilt : tilts[f]) ties[v] += ties_with(tilt, v);
  });
  for_every_vertex([&](uint32_t f, uint32_t v) {
    if (at_root[v] == 0) return;
    for (int c = 0; c < 3; ++c) {
      if (!ties_with(tilts[f][c], v) || tilts[f][c].sine >= 1) continue;
      const uint32_t n = mesh.normal_ids[f][c];
      const Vec3d across = cross(mesh.normals[n], faces.shapes[f].normal);
      const double size = length(across);
      if (size == 0) continue;
      const Vec3d u = across * (at_root[v] / (ties[v] * size));
      normals[n] += cross(faces.shapes[f].normal, u);
      faces.adjoints[f].normal += cross(u, mesh.normals[n]);
    }
  });
}

// From normals of vertices to those of faces and their angles.
void pull_back_sums(const Mesh& mesh, const std::vector<Vec3d>& normals, Faces& faces) {
  const size_t count = mesh.normals.size();
  std::vector<Vec3d> sums(count);
  std::vector<uint32_t> any_face(count, kUnused);
  std::vector<double> angles(count), noise(count);
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
    const FaceShape<double>& shape = faces.shapes[f];
    if (!shape.has_area) continue;
    for (int c = 0; c < 3; ++c) {
      const uint32_t n = mesh.normal_ids[f][c];
      sums[n] += shape.normal * shape.angles[c];
      any_face[n] = f;
      angles[n] += shape.angles[c];
      noise[n] += shape.angles[c] * shape.rounding;
    }
  }
  std::vector<Vec3d> of_sum(count);
  for (size_t n = 0; n < count; ++n) {
    if (any_face[n] == kUnused) continue;
    const double size = length(sums[n]);
    if (size > rest_of_cancelled(noise[n], angles[n])) {
      const Vec3d unit = sums[n] / size;
      of_sum[n] = (normals[n] - unit * dot(unit, normals[n])) / size;
    } else {
      faces.adjoints[any_face[n]].normal += normals[n];
    }
  }
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
    const FaceShape<double>& shape = faces.shapes[f];
    if (!shape.has_area) continue;
    for (int c = 0; c < 3; ++c) {
      const Vec3d& s = of_sum[mesh.normal_ids[f][c]];
      faces.adjoints[f].normal += s * shape.angles[c];
      faces.adjoints[f].angles[c] += dot(s, shape.normal);
    }
  }
}

// With sides a, b, c and the doubled area |D|, D = a x b, the angles are those of (q, |D|) for q =
// a.b, -a.c, b.c.
void pull_back_face(const Mesh& mesh, uint32_t f, const FaceShape<double>& shape,
                    const FaceAdjoint& adjoint, std::vector<Vec3d>& positions) {
  std::array<uint32_t, 3> roots;
  std::array<Vec3d, 3> p;
  for (int k = 0; k < 3; ++k) {
    roots[k] = mesh.weld[mesh.faces[f][k]];
    p[k] = cast<double>(mesh.positions[roots[k]]);
  }
  const Vec3d a = p[1] - p[0], b = p[2] - p[0], c = p[2] - p[1];
  const double size = length(cross(a, b));
  const double q[3] = {dot(a, b), -dot(a, c), dot(b, c)};
  double of_q[3], of_size = 0;
  for (int k = 0; k < 3; ++k) {
    const double scale = adjoint.angles[k] / (size * size + q[k] * q[k]);
    of_size += scale * q[k];
    of_q[k] = -scale * size;
  }
  const Vec3d across = adjoint.normal - shape.normal * dot(shape.normal, adjoint.normal);
  const Vec3d of_d = across / size + shape.normal * of_size;
  const Vec3d of_a = cross(b, of_d) + b * of_q[0] - c * of_q[1];
  const Vec3d of_b = cross(of_d, a) + a * of_q[0] + c * of_q[2];
  const Vec3d of_c = b * of_q[2] - a * of_q[1];
  positions[roots[0]] += -of_a - of_b;
  positions[roots[1]] += of_a - of_c;
  positions[roots[2]] += of_b + of_c;
}

}  // namespace

void pull_back_shading_normals(const Mesh& mesh, std::vector<Vec3d>& normals,
                               const std::vector<double>& horizons, std::vector<Vec3d>& positions) {
  if (mesh.normal_source == NormalSource::kFace) return;
  CHECK_EQ(normals.size(), mesh.normals.size());
  CHECK_EQ(positions.size(), mesh.positions.size());
  Faces faces;
  faces.adjoints.resize(mesh.faces.size());
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
    faces.shapes.push_back(face_shape<double>(mesh, FaceId(f)));
  }
  std::vector<double> at_root(horizons.size());
  for (size_t v = 0; v < horizons.size(); ++v) at_root[mesh.weld[v]] += horizons[v];
  pull_back_horizons(mesh, at_root, faces, normals);
  if (mesh.normal_source == NormalSource::kComputed) pull_back_sums(mesh, normals, faces);
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
    if (faces.shapes[f].has_area) {
      pull_back_face(mesh, f, faces.shapes[f], faces.adjoints[f], positions);
    }
  }
}

}  // namespace limn
