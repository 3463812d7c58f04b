// The adjoint of computed shading normals: from them back to the positions of the one-ring.
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

// The faces around each normal, those of one normal in their order.
class FacesAround {
 public:
  explicit FacesAround(const Mesh& mesh) : begins_(mesh.normals.size() + 1) {
    for (const FaceIndices& ids : mesh.normal_ids)
      for (const uint32_t n : ids) ++begins_[n + 1];
    for (size_t n = 0; n < mesh.normals.size(); ++n) begins_[n + 1] += begins_[n];
    faces_.resize(begins_.back());
    std::vector<uint32_t> next(begins_.begin(), begins_.end() - 1);
    for (uint32_t f = 0; f < mesh.normal_ids.size(); ++f)
      for (const uint32_t n : mesh.normal_ids[f]) faces_[next[n]++] = f;
  }
  template <class Visit>
  void for_each(uint32_t normal, const Visit& visit) const {
    for (uint32_t k = begins_[normal]; k < begins_[normal + 1]; ++k) visit(faces_[k]);
  }

 private:
  std::vector<uint32_t> begins_, faces_;
};

bool is_zero(const Vec3d& v) { return v.x == 0 && v.y == 0 && v.z == 0; }

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

struct ShadingNormalsAdjoint::OfMesh {
  explicit OfMesh(const Mesh& of);

  std::array<uint32_t, 3> roots(uint32_t f) const {
    const FaceIndices& v = mesh.faces[f];
    return {mesh.weld[v[0]], mesh.weld[v[1]], mesh.weld[v[2]]};
  }
  void add_up_normals();

  std::vector<uint32_t> touched(const std::vector<Vec3d>& of_normals) const;
  void pull_back_sums(const std::vector<uint32_t>& faces, const std::vector<Vec3d>& of_normals,
                      std::vector<FaceAdjoint>& adjoints) const;

  const Mesh& mesh;
  std::vector<FaceShape<double>> shapes;
  FacesAround around;
  // The sums of face normals, normalised, and the lengths of these, 0 where they cancel; a face
  // around each.
  std::vector<Vec3d> units;
  std::vector<double> sizes;
  std::vector<uint32_t> any_face;
};

ShadingNormalsAdjoint::OfMesh::OfMesh(const Mesh& of) : mesh(of), around(of) {
  shapes.reserve(mesh.faces.size());
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
    shapes.push_back(face_shape<double>(mesh, FaceId(f)));
  }
  add_up_normals();
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
    const std::vector<Vec3d>& of_normals) const {
  std::vector<uint8_t> face(mesh.faces.size());
  for (uint32_t n = 0; n < of_normals.size(); ++n) {
    if (is_zero(of_normals[n])) continue;
    around.for_each(n, [&](uint32_t f) { face[f] = true; });
  }
  std::vector<uint32_t> list;
  for (uint32_t f = 0; f < face.size(); ++f) {
    if (face[f] && shapes[f].has_area) list.push_back(f);
  }
  return list;
}

ShadingNormalsAdjoint::ShadingNormalsAdjoint(const Mesh& mesh)
    : of_mesh_(mesh.normal_source == NormalSource::kComputed ? std::make_unique<OfMesh>(mesh)
                                                             : nullptr) {}
ShadingNormalsAdjoint::ShadingNormalsAdjoint(ShadingNormalsAdjoint&&) noexcept = default;
ShadingNormalsAdjoint::~ShadingNormalsAdjoint() = default;

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

void ShadingNormalsAdjoint::pull_back(const std::vector<Vec3d>& normals,
                                      std::vector<Vec3d>& positions) const {
  if (!of_mesh_) return;
  const OfMesh& m = *of_mesh_;
  CHECK_EQ(normals.size(), m.mesh.normals.size());
  CHECK_EQ(positions.size(), m.mesh.positions.size());
  const std::vector<uint32_t> faces = m.touched(normals);
  std::vector<FaceAdjoint> adjoints(faces.size());
  m.pull_back_sums(faces, normals, adjoints);
  for (size_t i = 0; i < faces.size(); ++i) {
    pull_back_face(m.mesh, m.roots(faces[i]), m.shapes[faces[i]], adjoints[i], positions);
  }
}

}  // namespace limn
