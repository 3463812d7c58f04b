// The adjoint of shading normals and horizons: from them back to the positions of the one-ring.
#include "limn/core/normals_adjoint.h"

#include "limn/core/check.h"
#include "src/mesh/face_shape.h"

namespace limn {

namespace {

// Derivatives with respect to the unit normal and the angles of a face.
struct FaceAdjoint {
  Vec3d normal;
  std::array<double, 3> angles{};
};

// The sine of the tilt of a corner's normal against its face, and how far rounding reaches.
struct Tilt {
  double sine = -1, rounding = 0;
};

// The faces around each of some items (vertices, normals), those of one item in their order.
class FacesAround {
 public:
  // items_of(face): three of them.
  template <class ItemsOf>
  FacesAround(size_t items, size_t faces, const ItemsOf& items_of) : begins_(items + 1) {
    for (size_t f = 0; f < faces; ++f)
      for (const uint32_t i : items_of(f)) ++begins_[i + 1];
    for (size_t i = 0; i < items; ++i) begins_[i + 1] += begins_[i];
    faces_.resize(begins_.back());
    std::vector<uint32_t> next(begins_.begin(), begins_.end() - 1);
    for (uint32_t f = 0; f < faces; ++f)
      for (const uint32_t i : items_of(f)) faces_[next[i]++] = f;
  }
  template <class Visit>
  void for_each(uint32_t item, const Visit& visit) const {
    for (uint32_t k = begins_[item]; k < begins_[item + 1]; ++k) visit(faces_[k]);
  }

 private:
  std::vector<uint32_t> begins_, faces_;
};

bool is_zero(const Vec3d& v) { return v.x == 0 && v.y == 0 && v.z == 0; }

}  // namespace

struct ShadingNormalsAdjoint::OfMesh {
  explicit OfMesh(const Mesh& of);

  std::array<uint32_t, 3> roots(uint32_t f) const {
    const FaceIndices& v = mesh.faces[f];
    return {mesh.weld[v[0]], mesh.weld[v[1]], mesh.weld[v[2]]};
  }
  // Those of faces without area are never the largest.
  Tilt tilt(uint32_t f, int corner) const {
    const uint32_t n = mesh.normal_ids[f][corner];
    return {sine_of_tilt(mesh.normals[n], shapes[f].normal),
            tilt_rounding(shapes[f].rounding, noise[n])};
  }
  bool ties_with(const Tilt& tilt, uint32_t root) const {
    return tilt.sine + tilt.rounding >= largest[root];
  }
  void find_largest_tilts();
  void add_up_normals();

  std::vector<uint32_t> touched(const std::vector<double>& at_root,
                                const std::vector<Vec3d>& of_normals) const;
  void pull_back_horizons(const std::vector<uint32_t>& faces, const std::vector<double>& at_root,
                          std::vector<FaceAdjoint>& adjoints, std::vector<Vec3d>& of_normals) const;
  void pull_back_sums(const std::vector<uint32_t>& faces, const std::vector<Vec3d>& of_normals,
                      std::vector<FaceAdjoint>& adjoints) const;

  const Mesh& mesh;
  std::vector<FaceShape<double>> shapes;
  FacesAround around_root, around_normal;
  // Of normals: the largest rounding around each.
  std::vector<double> noise;
  // Of roots: a horizon is the largest tilt of all corners of the faces around its vertex.
  std::vector<double> largest;
  std::vector<uint32_t> ties;
  // Of computed normals: their sums, normalised, and the lengths of these, 0 where they cancel; a
  // face around each.
  std::vector<Vec3d> units;
  std::vector<double> sizes;
  std::vector<uint32_t> any_face;
};

ShadingNormalsAdjoint::OfMesh::OfMesh(const Mesh& of)
    : mesh(of),
      around_root(of.positions.size(), of.faces.size(), [this](size_t f) { return roots(f); }),
      around_normal(of.normals.size(), of.normal_ids.size(),
                    [this](size_t f) { return mesh.normal_ids[f]; }),
      noise(of.normals.size()) {
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
    shapes.push_back(face_shape<double>(mesh, FaceId(f)));
    if (!shapes[f].has_area) continue;
    for (const uint32_t n : mesh.normal_ids[f]) noise[n] = std::max(noise[n], shapes[f].rounding);
  }
  find_largest_tilts();
  if (mesh.normal_source == NormalSource::kComputed) add_up_normals();
}

void ShadingNormalsAdjoint::OfMesh::find_largest_tilts() {
  largest.resize(mesh.positions.size());
  ties.resize(mesh.positions.size());
  const auto for_every_tilt = [&](const auto& visit) {
    for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
      if (!shapes[f].has_area) continue;
      for (int c = 0; c < 3; ++c) {
        const Tilt t = tilt(f, c);
        for (const uint32_t v : roots(f)) visit(t, v);
      }
    }
  };
  for_every_tilt(
      [&](const Tilt& t, uint32_t v) { largest[v] = std::max(largest[v], t.sine - t.rounding); });
  for_every_tilt([&](const Tilt& t, uint32_t v) { ties[v] += ties_with(t, v); });
}

void ShadingNormalsAdjoint::OfMesh::add_up_normals() {
  const size_t count = mesh.normals.size();
  units.resize(count);
  sizes.resize(count);
  any_face.assign(count, kUnused);
  std::vector<double> angles(count), rounding(count);
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
    const FaceShape<double>& shape = shapes[f];
    if (!shape.has_area) continue;
    for (int c = 0; c < 3; ++c) {
      const uint32_t n = mesh.normal_ids[f][c];
      units[n] += shape.normal * shape.angles[c];
      any_face[n] = f;
      angles[n] += shape.angles[c];
      rounding[n] += shape.angles[c] * shape.rounding;
    }
  }
  for (size_t n = 0; n < count; ++n) {
    const double size = length(units[n]);
    if (!(size > rest_of_cancelled(rounding[n], angles[n]))) continue;
    sizes[n] = size;
    units[n] = units[n] / size;
  }
}

// The faces that derivatives reach, in order.
std::vector<uint32_t> ShadingNormalsAdjoint::OfMesh::touched(
    const std::vector<double>& at_root, const std::vector<Vec3d>& of_normals) const {
  std::vector<uint8_t> face(mesh.faces.size()), normal(of_normals.size());
  for (uint32_t v = 0; v < at_root.size(); ++v) {
    if (at_root[v] == 0) continue;
    around_root.for_each(v, [&](uint32_t f) {
      face[f] = true;
      for (const uint32_t n : mesh.normal_ids[f]) normal[n] = true;
    });
  }
  if (mesh.normal_source == NormalSource::kComputed) {
    for (uint32_t n = 0; n < of_normals.size(); ++n) {
      if (!normal[n] && is_zero(of_normals[n])) continue;
      around_normal.for_each(n, [&](uint32_t f) { face[f] = true; });
    }
  }
  std::vector<uint32_t> list;
  for (uint32_t f = 0; f < face.size(); ++f) {
    if (face[f] && shapes[f].has_area) list.push_back(f);
  }
  return list;
}

namespace {

// With sides a, b, c and the doubled area |D|, D = a x b, the angles are those of (q, |D|) for q =
// a.b, -a.c, b.c.
void pull_back_face(const Mesh& mesh, const std::array<uint32_t, 3>& roots,
                    const FaceShape<double>& shape, const FaceAdjoint& adjoint,
                    std::vector<Vec3d>& positions) {
  std::array<Vec3d, 3> p;
  for (int k = 0; k < 3; ++k) p[k] = cast<double>(mesh.positions[roots[k]]);
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

ShadingNormalsAdjoint::ShadingNormalsAdjoint(const Mesh& mesh)
    : of_mesh_(mesh.normal_source == NormalSource::kFace ? nullptr
                                                         : std::make_unique<OfMesh>(mesh)) {}
ShadingNormalsAdjoint::ShadingNormalsAdjoint(ShadingNormalsAdjoint&&) noexcept = default;
ShadingNormalsAdjoint::~ShadingNormalsAdjoint() = default;

// The horizon is |n x N| of a corner's normal n and a face's N.
void ShadingNormalsAdjoint::OfMesh::pull_back_horizons(const std::vector<uint32_t>& faces,
                                                       const std::vector<double>& at_root,
                                                       std::vector<FaceAdjoint>& adjoints,
                                                       std::vector<Vec3d>& of_normals) const {
  for (size_t i = 0; i < faces.size(); ++i) {
    const uint32_t f = faces[i];
    const Vec3d& face_normal = shapes[f].normal;
    for (const uint32_t v : roots(f)) {
      if (at_root[v] == 0) continue;
      for (int c = 0; c < 3; ++c) {
        const Tilt t = tilt(f, c);
        if (!ties_with(t, v) || t.sine >= 1) continue;
        const uint32_t n = mesh.normal_ids[f][c];
        const Vec3d across = cross(mesh.normals[n], face_normal);
        const double size = length(across);
        if (size == 0) continue;
        const Vec3d u = across * (at_root[v] / (ties[v] * size));
        of_normals[n] += cross(face_normal, u);
        adjoints[i].normal += cross(u, mesh.normals[n]);
      }
    }
  }
}

// From normals of vertices to those of faces and their angles.
void ShadingNormalsAdjoint::OfMesh::pull_back_sums(const std::vector<uint32_t>& faces,
                                                   const std::vector<Vec3d>& of_normals,
                                                   std::vector<FaceAdjoint>& adjoints) const {
  for (size_t i = 0; i < faces.size(); ++i) {
    const FaceShape<double>& shape = shapes[faces[i]];
    for (int c = 0; c < 3; ++c) {
      const uint32_t n = mesh.normal_ids[faces[i]][c];
      const Vec3d& g = of_normals[n];
      if (sizes[n] == 0) {
        if (any_face[n] == faces[i]) adjoints[i].normal += g;
        continue;
      }
      const Vec3d s = (g - units[n] * dot(units[n], g)) / sizes[n];
      adjoints[i].normal += s * shape.angles[c];
      adjoints[i].angles[c] += dot(s, shape.normal);
    }
  }
}

void ShadingNormalsAdjoint::pull_back(std::vector<Vec3d>& normals,
                                      const std::vector<double>& horizons,
                                      std::vector<Vec3d>& positions) const {
  if (!of_mesh_) return;
  const OfMesh& m = *of_mesh_;
  CHECK_EQ(normals.size(), m.mesh.normals.size());
  CHECK_EQ(positions.size(), m.mesh.positions.size());
  std::vector<double> at_root(horizons.size());
  for (size_t v = 0; v < horizons.size(); ++v) at_root[m.mesh.weld[v]] += horizons[v];
  const std::vector<uint32_t> faces = m.touched(at_root, normals);
  std::vector<FaceAdjoint> adjoints(faces.size());
  m.pull_back_horizons(faces, at_root, adjoints, normals);
  if (m.mesh.normal_source == NormalSource::kComputed) m.pull_back_sums(faces, normals, adjoints);
  for (size_t i = 0; i < faces.size(); ++i) {
    pull_back_face(m.mesh, m.roots(faces[i]), m.shapes[faces[i]], adjoints[i], positions);
  }
}

void pull_back_shading_normals(const Mesh& mesh, std::vector<Vec3d>& normals,
                               const std::vector<double>& horizons, std::vector<Vec3d>& positions) {
  ShadingNormalsAdjoint(mesh).pull_back(normals, horizons, positions);
}

}  // namespace limn
