// Blurred faces: their neighbours, what rays meet of them, and how far they extend.
#include <algorithm>
#include <cmath>
#include <unordered_set>

#include "limn/core/blur_tracer.h"
#include "limn/core/error.h"
#include "limn/core/touch.h"

namespace limn {
namespace {

double most_exponent() { return std::log((1 - kLeastOpacity) / kLeastOpacity); }

// Every side has one other face, which has it the other way round.
bool is_closed(const Mesh& mesh) {
  std::unordered_set<uint64_t> sides;
  const auto side = [&](uint32_t a, uint32_t b) {
    return static_cast<uint64_t>(mesh.weld[a]) << 32 | mesh.weld[b];
  };
  for (const FaceIndices& f : mesh.faces) {
    for (int k = 0; k < 3; ++k) {
      if (!sides.insert(side(f[k], f[(k + 1) % 3])).second) return false;
    }
  }
  return std::ranges::all_of(mesh.faces, [&](const FaceIndices& f) {
    return sides.contains(side(f[1], f[0])) && sides.contains(side(f[2], f[1])) &&
           sides.contains(side(f[0], f[2]));
  });
}

// Whether no side of the face `a` has all corners of `b`, in its plane, on its outer side.
bool reaches_into(const std::array<Vec3d, 3>& a, const std::array<Vec3d, 3>& b) {
  const Vec3d n = cross(a[1] - a[0], a[2] - a[0]);
  constexpr double kRounding = 1e-12;
  for (int k = 0; k < 3; ++k) {
    const Vec3d in = cross(n, a[(k + 1) % 3] - a[k]);
    const auto is_out = [&](const Vec3d& x) {
      return dot(in, x - a[k]) <= kRounding * length(in) * length(x - a[k]);
    };
    if (std::ranges::all_of(b, is_out)) return false;
  }
  return true;
}
bool overlap(const std::array<Vec3d, 3>& a, const std::array<Vec3d, 3>& b) {
  return reaches_into(a, b) && reaches_into(b, a);
}

bool before(const BlurHit& a, const BlurHit& b) {
  if (a.t != b.t) return a.t < b.t;
  if (a.face.shape != b.face.shape) return a.face.shape < b.face.shape;
  return a.face.face < b.face.face;
}

}  // namespace

double Blur::reach() const { return std::sqrt(sigma * most_exponent()); }
double Blur::depth() const { return gamma * most_exponent(); }

BlurFaces::BlurFaces(const Scene& scene, const Blur& blur)
    : scene_(scene), blur_(blur), reach_(blur.reach()), meshes_(scene.shapes.size()) {
  for (size_t s = 0; s < meshes_.size(); ++s) {
    const Shape& shape = scene.shapes[s];
    const Mesh& mesh = shape.mesh;
    MeshFaces& own = meshes_[s];
    own.front_only = !shape.bsdf->side(false) && is_closed(mesh);
    own.first.assign(mesh.positions.size() + 1, 0);
    std::vector<uint32_t> faces;
    for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
      const auto c = face_corners<double>(mesh, FaceId(f));
      own.normals.push_back(cross(c[1] - c[0], c[2] - c[0]));
      if (!has_area(mesh, mesh.faces[f])) continue;
      faces.push_back(f);
      for (const uint32_t v : mesh.faces[f]) ++own.first[mesh.weld[v] + 1];
    }
    for (size_t v = 0; v < mesh.positions.size(); ++v) own.first[v + 1] += own.first[v];
    own.around.resize(3 * faces.size());
    std::vector<uint32_t> next = own.first;
    for (const uint32_t f : faces) {
      for (const uint32_t v : mesh.faces[f]) own.around[next[mesh.weld[v]]++] = f;
    }
    own.alone.resize(mesh.faces.size());
    for (const uint32_t f : faces) own.alone[f] = is_alone(mesh, own, f);
  }
}

// A ray that comes from the front of a plane has crossed it before it meets what lies behind it;
// where it meets a face in the same plane, that is where it met the first.
bool BlurFaces::is_alone(const Mesh& mesh, const MeshFaces& own, uint32_t face) {
  const auto corners = face_corners<double>(mesh, FaceId(face));
  for (const uint32_t v : mesh.faces[face]) {
    for (uint32_t i = own.first[mesh.weld[v]]; i < own.first[mesh.weld[v] + 1]; ++i) {
      const uint32_t other = own.around[i];
      if (other == face) continue;
      const auto beside = face_corners<double>(mesh, FaceId(other));
      bool in_plane = true;
      for (const Vec3d& x : corners) {
        const double above = dot(own.normals[other], x - beside[0]);
        if (own.front_only ? above > 0 : above != 0) return false;
        in_plane = in_plane && above == 0;
      }
      if (in_plane && overlap(corners, beside)) return false;
    }
  }
  return true;
}

bool BlurFaces::touch(FaceRef a, FaceRef b) const {
  if (a.shape != b.shape) return false;
  const Mesh& mesh = scene_.shape(a.shape).mesh;
  for (const uint32_t v : mesh.face(a.face)) {
    for (const uint32_t w : mesh.face(b.face)) {
      if (mesh.weld[v] == mesh.weld[w]) return true;
    }
  }
  return false;
}

// Few points need the distance to the sides.
double BlurFaces::opacity_at(const std::array<Vec3d, 3>& corners, const Vec3d& n,
                             const Vec3d& x) const {
  constexpr double kBeyond = 1.01;  // far above rounding
  const double squared = reach_ * reach_ * dot(n, n);
  bool deep = true;
  for (int k = 0; k < 3; ++k) {
    const Vec3d u = corners[(k + 1) % 3] - corners[k];
    const double side = dot(cross(n, u), x - corners[k]);  // its distance times |n| |u|
    const double own = side * side, most = squared * dot(u, u);
    if (side < 0 && own > kBeyond * most) return 0;
    deep = deep && side > 0 && own > most;
  }
  if (deep) return 1;
  const double distance = distance_to_sides(corners, x);
  return distance > -reach_ ? blur_opacity(distance, blur_.sigma) : 0;
}

bool BlurFaces::is_beside_start(const Ray& ray, FaceRef face,
                                const std::array<Vec3d, 3>& corners) const {
  if (!ray.start.shape.valid()) return false;
  if (face == ray.start) return true;
  const auto a = face_corners<double>(scene_.shape(ray.start.shape).mesh, ray.start.face);
  Vec3d n = normalize(cross(a[1] - a[0], a[2] - a[0]));
  if (dot(n, ray.direction) < 0) n = -n;
  const double tolerance = touch_tolerance(largest_coordinate(a), largest_coordinate(corners));
  double least = 0, most = 0;
  for (const Vec3d& x : corners) {
    least = std::min(least, dot(n, x - a[0]));
    most = std::max(most, dot(n, x - a[0]));
  }
  if (most > tolerance) return false;
  return least >= -tolerance || touch(face, ray.start);
}

std::optional<BlurHit> BlurFaces::meet(const Ray& ray, FaceRef face) const {
  const Shape& shape = scene_.shape(face.shape);
  if (ray.skip_emitters && shape.is_emitter) return {};
  const MeshFaces& own = meshes_[face.shape.index()];
  const Vec3d& n = own.normals[face.face.index()];
  const double facing = dot(n, ray.direction);
  if (facing == 0 || (facing > 0 && own.front_only)) return {};
  const Vec3f& corner = shape.mesh.positions[shape.mesh.face(face.face)[0]];
  const double t = dot(n, cast<double>(corner) - ray.origin) / facing;
  if (!(t > ray.t_min) || !(t < ray.t_max)) return {};
  const auto corners = face_corners<double>(shape.mesh, face.face);
  const double opacity = opacity_at(corners, n, ray.origin + ray.direction * t);
  if (!(opacity > 0) || is_beside_start(ray, face, corners)) return {};
  return BlurHit{face, t, opacity, facing < 0};
}

void BlurFaces::settle(const Ray& ray, std::vector<BlurHit>& hits) const {
  const auto bring_in_order = [&] {
    std::sort(hits.begin(), hits.end(), before);
    const auto same = [](const BlurHit& a, const BlurHit& b) { return a.face == b.face; };
    hits.erase(std::unique(hits.begin(), hits.end(), same), hits.end());
  };
  bring_in_order();
  const auto opaque = std::ranges::find_if(hits, [](const BlurHit& h) { return h.opacity == 1; });
  if (opaque == hits.end()) return;
  const FaceRef face = opaque->face;
  const double last = opaque->t + blur_.depth();
  std::erase_if(hits, [&](const BlurHit& hit) { return hit.t > last; });
  const Mesh& mesh = scene_.shape(face.shape).mesh;
  const MeshFaces& own = meshes_[face.shape.index()];
  if (own.alone[face.face.index()]) return;
  const size_t count = hits.size();
  Ray behind = ray;
  behind.t_min = std::max(ray.t_min, last);
  for (const uint32_t v : mesh.face(face.face)) {
    for (uint32_t i = own.first[mesh.weld[v]]; i < own.first[mesh.weld[v] + 1]; ++i) {
      const FaceRef other{face.shape, FaceId(own.around[i])};
      if (other == face) continue;
      if (const auto hit = meet(behind, other)) hits.push_back(*hit);
    }
  }
  if (hits.size() > count) bring_in_order();
}

std::vector<Vec3d> enlarged_face(const std::array<Vec3d, 3>& corners, double reach) {
  constexpr double kMostMitre = 3;
  const Vec3d n = normalize(cross(corners[1] - corners[0], corners[2] - corners[0]));
  std::vector<Vec3d> polygon;
  for (int k = 0; k < 3; ++k) {
    const Vec3d& c = corners[k];
    const Vec3d in = normalize(c - corners[(k + 2) % 3]), out = normalize(corners[(k + 1) % 3] - c);
    const Vec3d m_in = cross(in, n), m_out = cross(out, n);  // away from the face
    const double twice = 1 + dot(m_in, m_out);               // 2 / mitre squared
    if (twice * kMostMitre * kMostMitre >= 2) {
      polygon.push_back(c + (m_in + m_out) * (reach / twice));
      continue;
    }
    const Vec3d middle = normalize(in - out);
    const auto cut = [&](const Vec3d& m, const Vec3d& along) {
      return c + (m + along * ((kMostMitre - dot(m, middle)) / dot(along, middle))) * reach;
    };
    polygon.push_back(cut(m_in, in));
    polygon.push_back(cut(m_out, -out));
  }
  return polygon;
}

double median_side(const Scene& scene) {
  std::vector<double> sides;
  for (const Shape& shape : scene.shapes) {
    for (uint32_t f = 0; f < shape.mesh.faces.size(); ++f) {
      const auto c = face_corners<double>(shape.mesh, FaceId(f));
      for (int k = 0; k < 3; ++k) sides.push_back(length(c[(k + 1) % 3] - c[k]));
    }
  }
  if (sides.empty()) return 0;
  const auto middle = sides.begin() + static_cast<std::ptrdiff_t>(sides.size() / 2);
  std::nth_element(sides.begin(), middle, sides.end());
  return *middle;
}

Blur resolved(Blur blur, const Scene& scene) {
  constexpr double kShare = 1.0 / 16;  // faces then extend by a quarter of their sides; not tuned
  if (blur.sigma == 0) blur.sigma = std::pow(kShare * median_side(scene), 2);
  if (!(blur.sigma > 0)) throw InputError(scene.file + ": has no faces that could be blurred");
  if (blur.weights != BlurWeights::kPublished) return blur;
  const double least = bounds_of(scene).diagonal() / 16;
  if (blur.gamma == 0) blur.gamma = least;
  if (blur.gamma < least) {
    throw InputError(
        "gamma: blurred-published needs a sixteenth of the scene's diagonal or more, " +
        std::to_string(least));
  }
  return blur;
}

}  // namespace limn
