#pragma once
// Flat parts of surfaces with smooth lobes, and the images that they show. In the mirror
// {x : n.x = h} a point p sees an edge where its image p* = p + 2 (h - n.p) n would see it, without
// the mirror, in the direction M w of p's own direction w, M = 1 - 2 n n^T. M keeps lengths and
// angles, so all that is known of edges that p sees holds for those that p* sees; only the segments
// from p to the mirror and from there to the edge tell what hides them. In a chain of mirrors the
// images are taken one after the other. Planes that refract are seen through (FlatLayer).
#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "limn/core/camera.h"
#include "limn/core/scene.h"
#include "limn/core/vec.h"

namespace limn {

// The plane of a face, which may move.
template <class S>
struct MirrorPlane {
  Vec3<S> point, n;  // of it; unit

  static MirrorPlane through(const std::array<Vec3<S>, 3>& c) {
    return {c[0], normalize(cross(c[1] - c[0], c[2] - c[0]))};
  }
  S distance(const Vec3<S>& x) const { return dot(n, x - point); }
  // The image of a point, and of a direction.
  Vec3<S> image(const Vec3<S>& x) const { return x - n * (2.0 * distance(x)); }
  Vec3<S> turned(const Vec3<S>& w) const { return w - n * (2.0 * dot(n, w)); }
};

// The same at rest.
inline MirrorPlane<Dual> at_rest(const MirrorPlane<double>& plane) {
  const auto& [x, n] = plane;
  return {{x.x, x.y, x.z}, {n.x, n.y, n.z}};
}

class FlatMirrors {
 public:
  // Those with the largest product of area and reflectance. Not tuned.
  static constexpr size_t kMost = 4;
  static constexpr size_t kLongest = 2;  // of a chain

  // Faces of one shape in one plane, which moves as one.
  struct Mirror {
    MirrorPlane<Dual> plane;  // of the first face
    std::vector<FaceRef> faces;
    Vec3d center{};  // of the faces, by their areas
    double area = 0;
    double share = 0;   // of light that it reflects, along its normal
    double passes = 0;  // that it refracts
  };
  // In the order in which a path from the viewer meets them.
  struct Chain {
    std::array<uint32_t, kLongest> mirrors{};
    uint32_t count = 0;
    bool through = false;  // it is refracted by all of them, else reflected
    bool operator==(const Chain&) const = default;
  };

  // scene: with its parameters seeded; it must outlive this. Null where there is no such part.
  static std::unique_ptr<const FlatMirrors> make(const Scene& scene);

  std::span<const Mirror> mirrors() const { return mirrors_; }
  // How many there are beside those.
  size_t left_out() const { return left_out_; }
  // Of one mirror each, then of two different ones.
  std::span<const Chain> chains() const { return chains_; }
  // Of one plane each that refracts, then of two parallel ones.
  std::span<const Chain> panes() const { return panes_; }
  // Whether a chain is one of all these.
  bool has(const Chain& chain) const;
  // Which mirror a face belongs to; kNone.
  static constexpr uint32_t kNone = UINT32_MAX;
  uint32_t of(FaceRef face) const;
  // The plane, at rest.
  MirrorPlane<double> plane(uint32_t mirror) const;
  // Whether a point is on a side of the mirror that reflects.
  bool reflects_to(uint32_t mirror, const Vec3d& p) const;
  // The index of refraction beyond the plane over that before it, as seen from its front or back; 0
  // if it refracts nothing.
  double refraction(uint32_t mirror, bool front) const;

 private:
  explicit FlatMirrors(const Scene& scene) : scene_(scene) {}
  void add_shape(ShapeId shape, std::vector<Mirror>& found) const;

  const Scene& scene_;
  std::vector<Mirror> mirrors_;
  size_t left_out_ = 0;
  std::vector<Chain> chains_, panes_;
};

// The faces of a chain's mirrors on which a ray was reflected, or refracted.
struct MirrorFaces {
  std::array<FaceRef, FlatMirrors::kLongest> faces;
  uint32_t count = 0;
  bool through = false;

  std::span<const FaceRef> all() const { return {faces.data(), count}; }
};

// The image of a ray that is reflected. corners: gives those of a face, in S.
template <class S, class Corners>
void reflect_ray(const MirrorFaces& by, const Corners& corners, Vec3<S>& origin,
                 Vec3<S>& direction) {
  for (const FaceRef face : by.all()) {
    const auto plane = MirrorPlane<S>::through(corners(face));
    origin = plane.image(origin);
    direction = plane.turned(direction);
  }
}

// The camera's image: positions on the film stay. It has no clip planes, as they are about rays
// before they are reflected.
Camera image_of(const Camera& camera, const MirrorPlane<Dual>& plane);

// Whether the unit direction wo is that in which a flat mirror of unit normal n reflects wi.
bool is_mirrored(const Vec3d& n, const Vec3d& wi, const Vec3d& wo);
// The light that a surface seen along wi reflects as a flat mirror does, of unit normal n on the
// side of wi; black where another smooth ray leaves to that side.
Rgb<double> mirrored_share(std::span<const SmoothRay<double>> rays, const Vec3d& n,
                           const Vec3d& wi);

struct FlatLayer {
  double height;  // along the layers' normal; positive
  double index;   // of refraction; of all layers over any one
};

// The unit direction in which a point sees another one through layers. With h_j their heights, n_j
// their indices and R the distance of both points across the normal, the path has
//   sum over j of h_j tan(theta_j) = R,   n_j sin(theta_j) the same for all j.
// In u = tan(theta) of the layer of the least index the sum is concave and grows without bound: it
// has one root, to which Newton's method rises from 0. way: from the one to the other; n: the unit
// normal along it, of which way has the sum of all heights.
Vec3d direction_through(std::span<const FlatLayer> layers, const Vec3d& n, const Vec3d& way);

}  // namespace limn
