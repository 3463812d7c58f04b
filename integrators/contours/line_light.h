#pragma once
// Light that a point receives past all that is in the way, integrated along lines between contours
// without a ray (after Nowrouzezahrai, Baran, Mitchell, Jarosz 2014): how open its sky is, and
// direct light of area emitters, of constant environments and of maps.
//
// One dimension is exact, the other a sum over lines at equal distances whose offset is given:
// uniform in [0, 1) it makes all results unbiased. Their standard error falls as lines^-1.5.
#include <atomic>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "integrators/contours/contours.h"
#include "integrators/contours/isolines.h"
#include "integrators/contours/radiance_columns.h"
#include "integrators/contours/sky_record.h"
#include "integrators/lights/light_regions.h"
#include "limn/core/face_overlaps.h"
#include "limn/core/shading.h"

namespace limn {

struct LineOptions {
  int lines = 64;  // through the sky; a quarter of them through an emitter
  // Above 0: lines, 8 at least, are doubled until the results of two halves differ by at most twice
  // this part of the result, or until there are kMostLines. That is no more unbiased.
  double tolerance = 0;
  bool uniform = false;  // lines through a map at equal azimuths, else dense where it is bright
  std::string method = "lines";  // that errors name
};
inline constexpr int kMostLines = 1 << 14;

class LineLight {
 public:
  // The scene and its tracer must outlive it. direct: whether emitters() and environment() are to
  // be called; InputError where check() says so, and for emitters that lie in one place.
  LineLight(const Scene& scene, const RayTracer& tracer, int threads, const LineOptions& options,
            bool direct);

  // InputError, with the place in the scene's file and what to do, for a scene whose direct light
  // lines do not know: delta lights, BSDFs that are not diffuse, interpolated normals after
  // Mitsuba, more than direct light, environments that are neither constant nor a map.
  static void check(const Scene& scene, const std::string& method);

  // The part of the directions above the face's horizon in which a ray would leave the scene.
  double openness(const ContourPoint& at, double offset) const;
  // The same weighed by the cosine to the shading normal n, over pi; with n = up it is 1 in the
  // open.
  double ambient_occlusion(const ContourPoint& at, const Vec3d& n, double offset) const;
  // Radiance that the surface scatters towards the viewer of `scattering`, of all emitters, or of
  // the environment, seen directly [W / (m^2 sr)].
  Rgb<double> emitters(const SurfacePoint<double>& surface, const Scattering<double>& scattering,
                       double offset) const;
  Rgb<double> environment(const SurfacePoint<double>& surface, const Scattering<double>& scattering,
                          double offset) const;
  // What `environment` integrates of a map, without its radiance, times `weight`, where lines are
  // uniform: along meridians of the record's grid.
  void record(const SurfacePoint<double>& surface, const Scattering<double>& scattering,
              double offset, double weight, SkyRecord& record) const;
  // How many sums ended at kMostLines above the tolerance, so far.
  int64_t missed() const { return missed_; }

  ContourPoint at(const SurfacePoint<double>& surface, const Vec3d& up) const {
    return contours_.at(surface, up);
  }

 private:
  struct Emitter {
    Rgb<double> radiance;
    EmitterHull hull;  // flat
    ContourScreen screen;
    std::vector<FaceRef> faces;
    FaceOverlaps::Set in_place;  // these, and what overlaps them in their plane
  };
  struct Receiver;
  Receiver receiver_at(const SurfacePoint<double>& surface,
                       const Scattering<double>& scattering) const;
  struct Scratch;
  static Scratch& scratch();

  // All contours into scratch().
  void list(const ContourPoint& at, const DirectionCone& cone, const ContourScreen* screen) const;
  void find_overlaps(int threads);
  void add_emitter(ShapeId id);
  void add_polygon(const EmitterHull& hull, ShapeId id, std::vector<FaceRef> faces);
  Rgb<double> emitter_light(const Emitter& emitter, const Receiver& receiver, double offset) const;
  Rgb<double> sky_light(const Receiver& receiver, double offset) const;
  Rgb<double> map_light(const Receiver& receiver, double offset) const;
  Pencil meridians(const Vec3d& up, const Environment::Grid& grid) const;
  struct LineChoice {
    int count;
    double offset;  // of the first line, in [0, 1) of their distance
  };
  template <class V, class Piece>
  V sum_over_lines(const ContourPoint& at, const Pencil& pencil, std::span<const Vec3d> planes,
                   int w, const V* all, LineChoice choice, const Piece& piece) const;

  const Scene& scene_;
  Contours contours_;
  LineOptions options_;
  std::vector<Emitter> emitters_;
  std::unique_ptr<RadianceColumns> columns_;  // of a map
  // Lines from its pole, and from the opposite one, dense where it is bright.
  std::vector<AzimuthWarp> warps_;
  mutable std::atomic<int64_t> missed_{0};
};

}  // namespace limn
