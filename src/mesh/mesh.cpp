// Welding, shading normals and horizons, with their derivatives.
#include "limn/core/mesh.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <numeric>
#include <tuple>

#include "limn/core/check.h"
#include "src/mesh/face_shape.h"
#include "src/mesh/mesh_build.h"
#include "src/mesh/shading_tangents.h"

namespace limn {

Vec3<Dual> Mesh::position(VertexId id) const {
  const Vec3d p = cast<double>(positions[id.index()]);
  if (position_tangents.empty()) return {p.x, p.y, p.z};
  const Vec3<Lanes>& t = position_tangents[id.index()];
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

namespace {

template <class S>
std::vector<FaceShape<S>> face_shapes(const Mesh& mesh) {
  std::vector<FaceShape<S>> shapes(mesh.faces.size());
  for (uint32_t f = 0; f < shapes.size(); ++f) shapes[f] = face_shape<S>(mesh, FaceId(f));
  return shapes;
}

// Shading normals (N) and horizons (V) in the scalar type S.
template <class S>
struct ShadingNormals {
  std::vector<Vec3<S>> normals;
  std::vector<S> horizon;
  size_t cancelled = 0;  // number of cancelled sums, see computed_normals
};

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
std::vector<Vec3<S>> computed_normals(const Mesh& mesh, const std::vector<FaceShape<S>>& shapes,
                                      size_t& cancelled) {
  std::vector<Vec3<S>> normals(mesh.normals.size());
  std::vector<uint32_t> any_face(mesh.normals.size(), kUnused);
  std::vector<double> angles(mesh.normals.size()), noise(mesh.normals.size());
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
    if (!shapes[f].has_area) continue;
    for (int c = 0; c < 3; ++c) {
      const uint32_t n = mesh.normal_ids[f][c];
      normals[n] += shapes[f].normal * shapes[f].angles[c];
      any_face[n] = f;
      angles[n] += value(shapes[f].angles[c]);
      noise[n] += value(shapes[f].angles[c]) * shapes[f].rounding;
    }
  }
  for (size_t n = 0; n < normals.size(); ++n) {
    const double rest = rest_of_cancelled(noise[n], angles[n]);
    if (any_face[n] == kUnused) {
      normals[n] = {S(0), S(0), S(1)};
    } else if (value(length(normals[n])) > rest) {
      normals[n] = normalize(normals[n]);
    } else {
      normals[n] = shapes[any_face[n]].normal;
      ++cancelled;
    }
  }
  return normals;
}

template <class S>
std::vector<Vec3<S>> stored_normals(const Mesh& mesh) {
  std::vector<Vec3<S>> normals(mesh.normals.size());
  for (size_t i = 0; i < normals.size(); ++i) {
    for (int k = 0; k < 3; ++k) normals[i][k] = S(mesh.normals[i][k]);
    if constexpr (std::is_same_v<S, Dual>) {
      if (mesh.normal_tangents.empty()) continue;
      for (int k = 0; k < 3; ++k) normals[i][k].d = mesh.normal_tangents[i][k];
    }
  }
  return normals;
}

// Calls visit(root, sine, rounding) for the tilt of each corner of a face.
template <class S, class Visit>
void for_every_tilt(const Mesh& mesh, const std::vector<FaceShape<S>>& shapes,
                    const std::vector<Vec3<S>>& normals, const std::vector<double>& noise,
                    const Visit& visit) {
  for (uint32_t f = 0; f < shapes.size(); ++f) {
    if (!shapes[f].has_area) continue;
    for (const uint32_t n : mesh.normal_ids[f]) {
      const S sine = sine_of_tilt(normals[n], shapes[f].normal);
      const double rounding = tilt_rounding(shapes[f].rounding, noise[n]);
      for (const uint32_t v : mesh.faces[f]) visit(mesh.weld[v], sine, rounding);
    }
  }
}

// At a tie the derivative of a maximum is one-sided. The mean of the least and the largest slope
// among the tied corners replaces it, which is the limit of central differences. Symmetric
// meshes have many ties up to the rounding of positions, so values within rounding of the
// maximum tie.
void average_tied_slopes(const Mesh& mesh, const std::vector<FaceShape<Dual>>& shapes,
                         const std::vector<Vec3<Dual>>& normals, std::vector<Dual>& horizon) {
  std::vector<double> noise(normals.size());
  for (uint32_t f = 0; f < shapes.size(); ++f)
    for (const uint32_t n : mesh.normal_ids[f]) noise[n] = std::max(noise[n], shapes[f].rounding);
  std::vector<double> largest(horizon.size());
  for_every_tilt(mesh, shapes, normals, noise, [&](uint32_t v, const Dual& sine, double rounding) {
    largest[v] = std::max(largest[v], sine.v - rounding);
  });
  std::vector<Lanes> least(horizon.size()), most(horizon.size());
  std::vector<bool> found(horizon.size());
  for_every_tilt(mesh, shapes, normals, noise, [&](uint32_t v, const Dual& sine, double rounding) {
    if (sine.v + rounding < largest[v]) return;
    for (int k = 0; k < kLanes; ++k) {
      least[v][k] = found[v] ? std::min(least[v][k], sine.d[k]) : sine.d[k];
      most[v][k] = found[v] ? std::max(most[v][k], sine.d[k]) : sine.d[k];
    }
    found[v] = true;
  });
  for (size_t v = 0; v < horizon.size(); ++v) horizon[v].d = 0.5 * (least[v] + most[v]);
}

template <class S>
ShadingNormals<S> shading_normals(const Mesh& mesh) {
  const std::vector<FaceShape<S>> shapes = face_shapes<S>(mesh);
  ShadingNormals<S> result;
  result.normals = mesh.normal_source == NormalSource::kComputed
                       ? computed_normals(mesh, shapes, result.cancelled)
                       : stored_normals<S>(mesh);
  std::vector<S> at_root(mesh.positions.size(), S(0));
  for_every_tilt(mesh, shapes, result.normals, std::vector<double>(result.normals.size()),
                 [&](uint32_t v, const S& sine, double) {
                   if (sine > at_root[v]) at_root[v] = sine;
                 });
  if constexpr (std::is_same_v<S, Dual>) average_tied_slopes(mesh, shapes, result.normals, at_root);
  result.horizon.resize(at_root.size());
  for (size_t v = 0; v < at_root.size(); ++v) result.horizon[v] = at_root[mesh.weld[v]];
  return result;
}

void store_tangents(Mesh& mesh, const ShadingNormals<Dual>& from) {
  mesh.normal_tangents.resize(from.normals.size());
  for (size_t i = 0; i < from.normals.size(); ++i) {
    const Vec3<Dual>& n = from.normals[i];
    mesh.normal_tangents[i] = {n.x.d, n.y.d, n.z.d};
  }
  mesh.horizon_tangents.resize(from.horizon.size());
  for (size_t i = 0; i < from.horizon.size(); ++i) mesh.horizon_tangents[i] = from.horizon[i].d;
}

// True if all vertices have the same velocity, bit for bit. Then all derivatives of normals and
// horizons are zero.
bool moves_as_one(const Mesh& mesh) {
  const auto& tangents = mesh.position_tangents;
  const auto alike = [&](const Vec3<Lanes>& t) {
    return std::memcmp(&t, &tangents[0], sizeof(t)) == 0;
  };
  return std::all_of(tangents.begin(), tangents.end(), alike);
}

}  // namespace

void update_shading_normals(Mesh& mesh) { fill_shading_normals(mesh); }

size_t fill_shading_normals(Mesh& mesh) {
  CHECK_EQ(mesh.weld.size(), mesh.positions.size());
  if (mesh.normal_source == NormalSource::kFace) return 0;
  if (mesh.normal_source == NormalSource::kComputed) assign_normal_ids(mesh);
  ShadingNormals<double> values = shading_normals<double>(mesh);
  mesh.normals = std::move(values.normals);
  mesh.horizon = std::move(values.horizon);
  update_shading_tangents(mesh);
  return values.cancelled;
}

void update_shading_tangents(Mesh& mesh) {
  if (mesh.normal_source == NormalSource::kFace) return;
  const bool computed = mesh.normal_source == NormalSource::kComputed;
  if (moves_as_one(mesh) && (computed || mesh.normal_tangents.empty())) {
    mesh.normal_tangents.clear();
    mesh.horizon_tangents.clear();
  } else {
    store_tangents(mesh, shading_normals<Dual>(mesh));
  }
}

Bounds bounds_of(const Mesh& mesh) {
  Bounds bounds;
  for (const FaceIndices& f : mesh.faces) {
    for (uint32_t v : f) bounds.extend(cast<double>(mesh.positions[v]));
  }
  return bounds;
}

}  // namespace limn
