// Area lights: which faces are drawn for a point.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "limn/core/lights.h"
#include "support/chi_square.h"
#include "support/scenes.h"

namespace limn {
namespace {

// Emitters: curved, with edges, concave, flat with many faces; some with faces that are lines.
std::vector<Scene> emitters(const TempFiles& files) {
  const std::string light = area_light("glow", "1, 1, 1") + "</shape>";
  const std::string transform =
      R"(<transform name="to_world"><scale x="1" y="0.2" z="0.5"/><rotate x="1" y="2" angle="40"/>
         <translate x="0.5"/></transform>)";
  std::vector<Scene> scenes;
  for (const char* type : {"sphere", "cube", "cylinder"}) {
    SceneParts parts;
    parts.body = R"(<shape type=")" + std::string(type) + R"(" id="lamp">)" + transform + light;
    scenes.push_back(make_scene(files, parts));
    // Seen from within, and with lines at the beginning, the end and among the others.
    Scene other = scenes.back();
    Mesh& mesh = other.shapes[0].mesh;
    std::vector<FaceIndices> faces;
    for (size_t f = 0; f < mesh.faces.size(); ++f) {
      const FaceIndices& face = mesh.faces[f];
      if (f % 5 == 0) faces.push_back({face[0], face[1], face[1]});
      faces.push_back({face[0], face[2], face[1]});
    }
    faces.push_back({0, 1, 0});
    mesh.faces = {};
    for (const FaceIndices& face : faces) mesh.faces.push_back(face);
    scenes.push_back(other);
  }
  return scenes;
}

const std::vector<Vec3d> kPoints = {
    {30, 20, -10}, {0.5, 0.4, 0}, {0.6, 0.05, 0.1}, {-2, 1, 3}, {0.5, 0, 0}};

struct FaceAt {
  Vec3d center, normal;
  double area;
};
FaceAt face_at(const Mesh& mesh, uint32_t f) {
  const auto c = face_corners<double>(mesh, FaceId(f));
  const Vec3d n = cross(c[1] - c[0], c[2] - c[0]);
  return {(c[0] + c[1] + c[2]) / 3.0, n / length(n), 0.5 * length(n)};
}

// The probability of a face for p, by the density at its center.
double probability(const Light& light, const Vec3d& p, const Mesh& mesh, uint32_t f) {
  const FaceAt face = face_at(mesh, f);
  if (!(face.area > 0)) return 0;
  const Vec3d to = face.center - p;
  const double distance = length(to);
  const Vec3d wo = to / distance;
  const double cosine = std::fabs(dot(wo, face.normal));
  return light.pdf(p, {wo, distance, face.normal, FaceId(f)}, 1) * cosine * face.area /
         (distance * distance);
}

std::optional<LightSample> draw(const Light& light, const Vec3d& p, Rng& rng) {
  LightNumbers u;
  for (double& number : u) number = rng.uniform();
  return light.sample(p, 1, u);
}

TEST(AreaLights, DrawFacesAsOftenAsTheirDensitiesSay) {
  const TempFiles files;
  const auto scenes = emitters(files);
  const double threshold =
      test::sidak_threshold(1e-3, static_cast<int>(scenes.size() * kPoints.size()));
  for (size_t s = 0; s < scenes.size(); ++s) {
    const Mesh& mesh = scenes[s].shapes[0].mesh;
    const auto light = make_area_light(scenes[s], ShapeId(0), DrawFaces::kByLight);
    for (const Vec3d& p : kPoints) {
      const size_t count = mesh.faces.size();
      const int draws = 100000;
      std::vector<double> expected(count + 1), observed(count + 1);
      double sum = 0;
      for (uint32_t f = 0; f < count; ++f) {
        const double of_face = probability(*light, p, mesh, f);
        const FaceAt face = face_at(mesh, f);
        sum += of_face;
        const bool faces = face.area > 0 && dot(face.normal, p - face.center) > 0;
        expected[faces ? f : count] += draws * of_face;
      }
      EXPECT_NEAR(sum, 1, 1e-9);
      Rng rng(s, 2, 3);
      for (int i = 0; i < draws; ++i) {
        const auto sample = draw(*light, p, rng);
        ++observed[sample ? sample->face->face.index() : count];
      }
      EXPECT_GT(test::chi_square_test(observed, expected).p_value, threshold) << s << " " << p.x;
    }
  }
}

TEST(AreaLights, HaveOneDensityOfSamplesAndHits) {
  const TempFiles files;
  for (const Scene& scene : emitters(files)) {
    const auto light = make_area_light(scene, ShapeId(0), DrawFaces::kByLight);
    for (const Vec3d& p : kPoints) {
      Rng rng(4, 5, 6);
      for (int i = 0; i < 1000; ++i) {
        const auto sample = draw(*light, p, rng);
        if (!sample) continue;
        const FaceAt face = face_at(scene.shapes[0].mesh, sample->face->face.index());
        const LightView view{sample->wo, sample->distance, face.normal, sample->face->face};
        const double cosine = -dot(face.normal, sample->wo);
        // Some roundings of the cosine, and of all else.
        EXPECT_NEAR(light->pdf(p, view, 1) / sample->pdf, 1, 0x1p-48 + 0x1p-50 / cosine);
      }
    }
  }
}

// What a sphere sends to a surface that faces it is pi r^2 / d^2. Draws by area have a variance of
// 5/3 of its square, draws of the faces that face the point 1/3.
TEST(AreaLights, OfSpheresAreDrawnWhereTheyFaceThePoint) {
  const TempFiles files;
  SceneParts parts;
  parts.body = R"(<shape type="sphere" id="lamp">)" + area_light("glow", "1, 1, 1") + "</shape>";
  const Scene scene = make_scene(files, parts);
  const auto light = make_area_light(scene, ShapeId(0), DrawFaces::kByLight);
  const Vec3d p{60, 50, -70};
  const double expected = kPi / length_squared(p);
  Rng rng(7, 8, 9);
  const int draws = 20000;
  double sum = 0, squares = 0;
  for (int i = 0; i < draws; ++i) {
    const auto sample = draw(*light, p, rng);
    const double sent = sample ? 1 / (sample->pdf * expected) : 0;
    sum += sent;
    squares += sent * sent;
  }
  const double mean = sum / draws, variance = squares / draws - mean * mean;
  EXPECT_LT(variance, 1.0 / 3);
  // The mesh is 1.2e-3 radii smaller.
  EXPECT_NEAR(mean, 1, 2.4e-3 + 5 * std::sqrt(variance / draws));
}

// As differences need it: whatever the point, the same number draws the same face.
TEST(AreaLights, OfMovedScenesAndFlatOnesAreDrawnByArea) {
  const TempFiles files;
  auto scenes = emitters(files);
  SceneParts parts;
  parts.body = square("lamp", 1, 90, {0, 3, 0}, area_light("glow", "1, 1, 1"));
  scenes.push_back(make_scene(files, parts));
  for (const Scene& scene : scenes) {
    const bool flat = &scene == &scenes.back();
    const Lights lights(scene), moved(scene, &lights);
    const auto by_area = make_area_light(scene, ShapeId(0), DrawFaces::kByArea);
    for (const Vec3d& p : kPoints) {
      Rng rng(4, 5, 6);
      for (int i = 0; i < 100; ++i) {
        LightNumbers u;
        for (double& number : u) number = rng.uniform();
        const Light* const drawn = flat ? lights.all()[0] : moved.all()[0];
        const auto sample = drawn->sample(p, 1, u), other = by_area->sample(p, 1, u);
        ASSERT_EQ(sample.has_value(), other.has_value());
        if (!sample) continue;
        EXPECT_EQ(sample->face, other->face);
        EXPECT_EQ(sample->pdf, other->pdf);
      }
    }
  }
}

}  // namespace
}  // namespace limn
