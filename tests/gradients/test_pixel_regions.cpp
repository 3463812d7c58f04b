// The visible regions of pixels: faces at points of the film against rays in double precision.
#include "integrators/film/pixel_regions.h"

#include <gtest/gtest.h>

#include <array>

#include "integrators/paths/camera_path.h"
#include "limn/core/duplicate_faces.h"
#include "limn/core/ray_tracer.h"
#include "support/brute_force_tracer.h"
#include "support/meshes.h"
#include "support/scenes.h"

namespace limn {
namespace {

// All regions of a film, to look up the face at a point.
class FilmFaces {
 public:
  FilmFaces(const Scene& scene, int threads)
      : film_(scene.film), faces_(scene, threads), pixels_(scene, faces_, threads) {
    regions_.resize(static_cast<size_t>(film_.crop_width) * film_.crop_height);
    for (size_t t = 0; t < pixels_.tiles().size(); ++t) {
      pixels_.for_each_pixel(
          t, nullptr, [](int, int) { return true; },
          [&](int x, int y, const VisibleRegions& regions) {
            size_ += regions.size();
            crossings_ += regions.crossings();
            regions.for_each([&](uint32_t label, std::span<const PlanePoint> corners) {
              regions_[index(x, y)].push_back(
                  {pixels_.face_of(label), {corners.begin(), corners.end()}});
            });
          });
    }
  }
  // In pixels of the full film. Where rounding leaves a point outside of all regions, the one whose
  // side it is nearest to.
  FaceRef face_at(double x, double y) const {
    FaceRef nearest;
    double most = -INFINITY;
    for (const Region& region : regions_[index(static_cast<int>(x), static_cast<int>(y))]) {
      double inside = INFINITY;
      for (size_t i = 0; i < region.corners.size(); ++i) {
        const PlanePoint &a = region.corners[i],
                         &b = region.corners[(i + 1) % region.corners.size()];
        const double turn = (b.x - a.x) * (y - a.y) - (b.y - a.y) * (x - a.x);
        inside = std::min(inside, turn / std::hypot(b.x - a.x, b.y - a.y));
      }
      if (inside > most) most = inside, nearest = region.face;
    }
    return nearest;
  }
  size_t size() const { return size_; }
  size_t crossings() const { return crossings_; }

 private:
  struct Region {
    FaceRef face;
    std::vector<PlanePoint> corners;  // counter-clockwise as (x, y)
  };
  size_t index(int x, int y) const {
    return static_cast<size_t>(y - film_.crop_y) * film_.crop_width + (x - film_.crop_x);
  }
  const Film& film_;
  CoincidentFaces faces_;
  PixelRegions pixels_;
  std::vector<std::vector<Region>> regions_;
  size_t size_ = 0, crossings_ = 0;
};

std::string glowing(const std::string& id, const std::string& radiance) {
  return diffuse(id + "_bsdf", "0.2, 0.2, 0.2") + area_light(id + "_light", radiance);
}

// Bodies that pass through each other and through the floor, one that is there twice, needles, a
// lamp, and faces that reach behind the camera.
SceneParts crowded(const TempFiles& files) {
  SceneParts parts;
  parts.max_depth = 2;
  parts.origin = {0.3, 1.4, 3};
  parts.target = {0, 0.4, 0};
  const Mesh needles = make_mesh(
      {{-2, 0.3f, 1}, {2, 0.3f, 0.9f}, {2, 0.3002f, 0.9f}, {-2, 0.9f, 1}}, {{0, 1, 2}, {0, 2, 3}});
  const std::string torus = write_mesh(files, "torus.obj", torus_mesh(12, 7));
  parts.body =
      square("floor", 1.5, -90, {0, 0, 0}, diffuse("chalk", "0.8, 0.7, 0.6")) +
      obj_shape("body", torus, true, 0.5, {0, 0.5, 0.1}, diffuse("clay", "0.6, 0.5, 0.4")) +
      obj_shape("twin", torus, true, 0.5, {0, 0.5, 0.1}, glowing("twin", "0.2, 0.9, 0.4")) +
      obj_shape("ball", write_mesh(files, "ball.obj", icosphere_mesh(2)), false, 0.5,
                {0.4, 0.45, 0.2}, diffuse("snow", "0.9, 0.9, 0.9")) +
      obj_shape("needles", write_mesh(files, "needles.obj", needles), true, 1, {0, 0, 0},
                glowing("needles", "1, 2, 3")) +
      square("lamp", 0.3, 60, {-0.5, 1, -0.5}, area_light("glow", "9, 8, 6"));
  return parts;
}

size_t wrong_faces(const Scene& scene, const FilmFaces& regions, int points) {
  const auto tracer = make_brute_force_tracer(scene);
  const DuplicateFaces copies(scene);
  const Film& film = scene.film;
  size_t wrong = 0;
  Rng rng(7, 0, 0);
  for (int i = 0; i < points; ++i) {
    const double x = film.crop_x + film.crop_width * rng.uniform();
    const double y = film.crop_y + film.crop_height * rng.uniform();
    Hit hit;
    const Ray ray = camera_ray(scene, scene.camera.ray<double>(x, y));
    if (tracer->closest(ray, hit))
      hit.face = *copies.met(hit.face, ray.direction, ray.skip_emitters);
    wrong += hit.face != regions.face_at(x, y);
  }
  return wrong;
}

TEST(PixelRegions, FacesAreThoseOfRays) {
  const TempFiles files;
  for (const bool hide_emitters : {false, true}) {
    for (const double far : {1e4, 3.2}) {
      SceneParts parts = crowded(files);
      parts.hide_emitters = hide_emitters;
      Scene scene = make_scene(files, parts);
      scene.camera.near_clip = 2.1;  // through bodies
      scene.camera.far_clip = far;
      const FilmFaces regions(scene, 2);
      EXPECT_GT(regions.size(), 256u);
      EXPECT_GT(regions.crossings(), 0u);
      EXPECT_EQ(wrong_faces(scene, regions, 20000), 0u);
    }
  }
}

// At scales and places far from 1 and 0, to what floats hold of them.
TEST(PixelRegions, FacesAreThoseOfRaysAtAllScales) {
  for (const double scale : {1e-3, 1.0, 1e3}) {
    const TempFiles files;
    SceneParts parts;
    parts.unit = scale;
    parts.hide_emitters = true;
    parts.body =
        obj_shape("ball", write_mesh(files, "ball.obj", icosphere_mesh(3)), true, scale,
                  Vec3d{0, 0.5, 0} * scale, diffuse("snow", "0.9, 0.9, 0.9")) +
        square("lamp", 0.3 * scale, -30, Vec3d{0.2, 1, 3} * scale, area_light("glow", "9, 8, 6"));
    const Scene scene = make_scene(files, parts);
    EXPECT_EQ(wrong_faces(scene, FilmFaces(scene, 1), 20000), 0u) << scale;
  }
}

// Of faces in one plane, to the rounding of positions, the one that rays meet: a lamp before what
// does not shine, else the file's first.
TEST(PixelRegions, FacesInOnePlaneAreThoseOfRays) {
  constexpr double kTilt = -53, kShift = 0.13;
  const double up = std::cos(kTilt * kPi / 180), along = std::sin(kTilt * kPi / 180);
  const std::string sheet = square("sheet", 1, kTilt, {0, 0, 0}, diffuse("chalk", "0.8, 0.7, 0.6"));
  const Vec3d inside{0.1, kShift * up, kShift * along};
  const std::string others[] = {
      square("lamp", 0.5, kTilt, inside, area_light("glow", "9, 8, 6")),
      square("patch", 0.5, kTilt, inside, diffuse("slate", "0.1, 0.2, 0.3"))};
  const TempFiles files;
  for (const std::string& other : others) {
    for (const std::string& body : {sheet + other, other + sheet}) {
      SceneParts parts;
      parts.origin = {0.3, 2.4, 3};
      parts.target = {0, 0, 0};
      parts.body = body;
      const Scene scene = make_scene(files, parts);
      const FilmFaces regions(scene, 1);
      const auto tracer = make_embree_tracer(scene, 1);
      Rng rng(9, 0, 0);
      std::array<int, 2> seen{};
      for (int i = 0; i < 4000; ++i) {
        const double x = 16 * rng.uniform(), y = 16 * rng.uniform();
        Hit hit;
        tracer->closest(camera_ray(scene, scene.camera.ray<double>(x, y)), hit);
        EXPECT_EQ(hit.face, regions.face_at(x, y));
        if (hit.face.shape.valid()) ++seen[hit.face.shape.index()];
      }
      // Behind the sheet in the file, what does not shine is hidden by it.
      const bool hidden = body.starts_with(sheet) && &other != &others[0];
      EXPECT_GT(seen[0], 100);
      EXPECT_EQ(seen[1] > 0, !hidden);
    }
  }
}

// Without a gap: from inside of a closed body no pixel sees nothing.
TEST(PixelRegions, ClosedRoomsHaveNoGaps) {
  const TempFiles files;
  SceneParts parts;
  parts.origin = {0.1, 0.2, 0.3};
  parts.target = {1, 0.7, -0.4};
  parts.fov = 100;
  parts.body = obj_shape("room", write_mesh(files, "room.obj", icosphere_mesh(4)), true, 2,
                         {0, 0, 0}, diffuse("snow", "0.9, 0.9, 0.9"));
  const Scene scene = make_scene(files, parts);
  const FilmFaces regions(scene, 2);
  Rng rng(8, 0, 0);
  for (int i = 0; i < 100000; ++i) {
    const double x = 16 * rng.uniform(), y = 16 * rng.uniform();
    ASSERT_TRUE(regions.face_at(x, y).shape.valid());
  }
}

}  // namespace
}  // namespace limn
