// Welding, and shading normals with their derivatives.
#include "limn/core/mesh.h"

#include <algorithm>
#include <numeric>
#include <tuple>

#include "limn/core/check.h"
#include "limn/core/tangent.h"
#include "src/mesh/face_shape.h"
#include "src/mesh/mesh_build.h"

namespace limn {
namespace {

// Normal indices of a mesh with computed normals: one per welded vertex in use.
void assign_normal_ids(Mesh& mesh) {
  std::vector<uint32_t> slot(mesh.positions.size(), kUnused);
  mesh.normal_ids.resize(mesh.faces.size());
  uint32_t count = 0;
  for (size_t f = 0; f < mesh.faces.size(); ++f) {
    for (int c = 0; c < 3; ++c) {
      uint32_t& s = slot[mesh.weld[mesh.faces[f][c]]];
      if (s == kUnused) s = count++;
      mesh.normal_ids[f][c] = s;
    }
  }
  mesh.normals.assign(count, Vec3d{});
}

// Angle-weighted sums of face normals (Thuermer and Wuethrich 1998), normalised. A sum may cancel
// (fins around an axis, a sheet folded onto itself) to a thousandth, or to the rounding error. Its
// direction is then arbitrary and its derivative unbounded, so the normal of one face is used. A
// vertex with degenerate faces only gets +Z, which is never used. cancelled: number of such
// vertices.
template <class S>
std::vector<Vec3<S>> computed_normals(const Mesh& mesh, size_t& cancelled) {
  std::vector<Vec3<S>> normals(mesh.normals.size());
  std::vector<uint32_t> any_face(mesh.normals.size(), kUnused);
  std::vector<double> angles(mesh.normals.size()), noise(mesh.normals.size());
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
    const FaceShape<S> shape = face_shape<S>(mesh, FaceId(f));
    if (!shape.has_area) continue;
    for (int c = 0; c < 3; ++c) {
      const uint32_t n = mesh.normal_ids[f][c];
      normals[n] += shape.normal * shape.angles[c];
      any_face[n] = f;
      angles[n] += value(shape.angles[c]);
      noise[n] += value(shape.angles[c]) * shape.rounding;
    }
  }
  for (size_t n = 0; n < normals.size(); ++n) {
    const double rest = rest_of_cancelled(noise[n], angles[n]);
    if (any_face[n] == kUnused) {
      normals[n] = {S(0), S(0), S(1)};
    } else if (value(length(normals[n])) > rest) {
      normals[n] = normalize(normals[n]);
    } else {
      normals[n] = face_shape<S>(mesh, FaceId(any_face[n])).normal;
      ++cancelled;
    }
  }
  return normals;
}

}  // namespace

Vec3<Dual> Mesh::position(VertexId id) const {
  const Vec3d p = cast<double>(positions[id.index()]);
  if (position_tangents.empty()) return {p.x, p.y, p.z};
  const Vec3<Lanes> t = position_tangents[id.index()];
  return {{p.x, t.x}, {p.y, t.y}, {p.z, t.z}};
}

void weld_positions(Mesh& mesh) {
  std::vector<uint32_t> order(mesh.positions.size());
  std::iota(order.begin(), order.end(), 0);
  const auto key = [&](uint32_t i) {
    const Vec3f& p = mesh.positions[i];
    return std::make_tuple(p.x, p.y, p.z);  // compares -0 equal to 0
  };
  std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
    return std::make_pair(key(a), a) < std::make_pair(key(b), b);
  });
  mesh.weld.resize(order.size());
  uint32_t root = 0;
  for (size_t i = 0; i < order.size(); ++i) {
    if (i == 0 || key(order[i]) != key(order[i - 1])) root = order[i];
    mesh.weld[order[i]] = root;
  }
}

void update_shading_normals(Mesh& mesh) { fill_shading_normals(mesh); }

size_t fill_shading_normals(Mesh& mesh) {
  CHECK_EQ(mesh.weld.size(), mesh.positions.size());
  update_u_directions(mesh);
  if (mesh.normal_source != NormalSource::kComputed) return 0;
  assign_normal_ids(mesh);
  size_t cancelled = 0;
  mesh.normals = computed_normals<double>(mesh, cancelled);
  update_shading_tangents(mesh);
  return cancelled;
}

void update_shading_tangents(Mesh& mesh) {
  update_u_tangents(mesh);
  if (mesh.normal_source != NormalSource::kComputed) return;
  mesh.normal_tangents.clear();
  if (mesh.position_tangents.all_alike()) return;  // then all derivatives of normals are zero
  mesh.normal_tangents.reserve(mesh.normals.size());
  size_t cancelled = 0;
  for (const Vec3<Dual>& n : computed_normals<Dual>(mesh, cancelled)) {
    mesh.normal_tangents.push_back({n.x.d, n.y.d, n.z.d});
  }
}

bool has_idle_normals(const Mesh& mesh) {
  constexpr double kRounding = 1e-6;  // of normals in files with six digits
  if (mesh.normal_source == NormalSource::kFace || mesh.has_tangents) return false;
  for (size_t f = 0; f < mesh.faces.size(); ++f) {
    const auto c = face_corners<double>(mesh, FaceId(static_cast<uint32_t>(f)));
    const Vec3d across = cross(c[1] - c[0], c[2] - c[0]);
    const double area = length(across);
    if (area == 0) continue;
    for (const uint32_t i : mesh.normal_ids[f]) {
      if (!(length(mesh.normals[i] - across * (1 / area)) <= kRounding)) return false;
    }
  }
  return true;
}

Bounds bounds_of(const Mesh& mesh) {
  Bounds bounds;
  for (const FaceIndices& f : mesh.faces) {
    for (uint32_t v : f) bounds.extend(cast<double>(mesh.positions[v]));
  }
  return bounds;
}

std::vector<Vec3d> displacement_directions(const Mesh& mesh) {
  Mesh smooth;
  smooth.positions = mesh.positions;
  smooth.faces = mesh.faces;
  smooth.weld = mesh.weld;
  smooth.normal_source = NormalSource::kComputed;
  update_shading_normals(smooth);
  std::vector<Vec3d> of_root(mesh.positions.size()), directions;
  for (size_t f = 0; f < mesh.faces.size(); ++f) {
    for (int c = 0; c < 3; ++c) {
      of_root[mesh.weld[mesh.faces[f][c]]] = smooth.normals[smooth.normal_ids[f][c]];
    }
  }
  for (const uint32_t root : mesh.weld) directions.push_back(of_root[root]);
  return directions;
}

}  // namespace limn
