// Blurred faces: opacities, weights, and which faces rays meet.
#include <gtest/gtest.h>

#include <cmath>

#include "limn/core/blur_tracer.h"
#include "limn/core/make_bsdf.h"
#include "support/meshes.h"
#include "support/scenes.h"

namespace limn {
namespace {

using Weights = std::vector<double>;
constexpr Blur kBlurs[] = {{1, 0, BlurWeights::kOrdered},
                           {1, 0.3, BlurWeights::kOrdered},
                           {1, 0.5, BlurWeights::kPublished}};

TEST(BlurOpacity, AddsToOneAcrossASideAndEndsContinuously) {
  const double sigma = 0.3, reach = Blur{sigma}.reach();
  for (double d = -2 * reach; d <= 2 * reach; d += reach / 64) {
    EXPECT_NEAR(blur_opacity(d, sigma) + blur_opacity(-d, sigma), 1, 1e-15);
    if (std::fabs(d) < reach) continue;
    EXPECT_EQ(blur_opacity(d, sigma), d > 0 ? 1 : 0);
  }
  EXPECT_LT(blur_opacity(-reach * (1 - 1e-9), sigma), 1e-12);
  EXPECT_EQ(blur_opacity(0.0, sigma), 0.5);
}

TEST(BlurOpacity, HasItsDerivative) {
  const double sigma = 0.3, reach = Blur{sigma}.reach(), h = 1e-6;
  for (double d = -0.99 * reach; d <= 0.99 * reach; d += reach / 41) {
    const double difference = (blur_opacity(d + h, sigma) - blur_opacity(d - h, sigma)) / (2 * h);
    EXPECT_NEAR(blur_opacity(Dual(d, {1, 0, 0, 0}), sigma).d[0], difference, 1e-7);
  }
}

// The kernel that moves sides are blurred by: mass 1, second moment 2 ln 2 sigma, and the integral
// of its square, by which the variance of derivatives goes, 0.287 / sqrt(sigma).
TEST(BlurOpacity, HasTheMomentsOfItsKernel) {
  const double sigma = 0.3, reach = Blur{sigma}.reach(), h = reach / 20000;
  double mass = 0, second = 0, square = 0;
  for (double d = -reach; d < reach; d += h) {
    const double slope = blur_opacity(Dual(d + h / 2, {1, 0, 0, 0}), sigma).d[0];
    mass += h * slope;
    second += h * slope * d * d;
    square += h * slope * slope;
  }
  EXPECT_NEAR(mass, 1, 1e-6);
  EXPECT_NEAR(second, 2 * std::log(2) * sigma, 1e-4);
  EXPECT_NEAR(square * std::sqrt(sigma), 0.287, 5e-4);
}

TEST(BlurDistance, IsThatOfTheNearestPointOfTheSides) {
  Rng rng(1, 2, 3);
  for (int i = 0; i < 200; ++i) {
    std::array<Vec3d, 3> corners;
    for (Vec3d& x : corners) x = {rng.uniform(), rng.uniform(), rng.uniform()};
    const double a = 3 * rng.uniform() - 1, b = 3 * rng.uniform() - 1;
    const Vec3d x = corners[0] + (corners[1] - corners[0]) * a + (corners[2] - corners[0]) * b;
    double least = 1e9;
    for (int k = 0; k < 3; ++k) {
      for (int n = 0; n <= 4096; ++n) {
        const Vec3d y = corners[k] + (corners[(k + 1) % 3] - corners[k]) * (n / 4096.0);
        least = std::min(least, length(x - y));
      }
    }
    const bool inside = a >= 0 && b >= 0 && a + b <= 1;
    EXPECT_NEAR(distance_to_sides(corners, x), inside ? least : -least, 1e-3);
  }
}

template <class S>
std::vector<BlurredFace<S>> random_hits(Rng& rng, size_t count) {
  std::vector<BlurredFace<S>> hits;
  double depth = 1;
  for (uint32_t k = 0; k < count; ++k) {
    depth += 0.5 * rng.uniform();
    BlurredFace<S> hit{{ShapeId(k / 2), FaceId(k)}, depth, rng.uniform(), true};
    hits.push_back(hit);
  }
  return hits;
}
// Pairs are neighbours.
template <class S>
std::vector<S> weights_of(const std::vector<BlurredFace<S>>& hits, const Blur& blur) {
  std::vector<S> weights;
  const auto neighbours = [](const BlurredFace<S>& a, const BlurredFace<S>& b) {
    return a.face.shape == b.face.shape;
  };
  blur_weights<S>(hits, blur, 10, neighbours, weights);
  return weights;
}

TEST(BlurWeights, HaveTheirDerivatives) {
  Rng rng(4, 5, 6);
  for (const Blur& blur : kBlurs) {
    for (int i = 0; i < 100; ++i) {
      const auto hits = random_hits<double>(rng, 1 + i % 6);
      std::vector<BlurredFace<Dual>> moving;
      auto forward = hits, back = hits;
      const double h = 1e-6;
      for (size_t k = 0; k < hits.size(); ++k) {
        const double dz = rng.uniform() - 0.5, da = rng.uniform() - 0.5;
        moving.push_back({hits[k].face, Dual(hits[k].depth, {dz, 0, 0, 0}),
                          Dual(hits[k].opacity, {da, 0, 0, 0}), true});
        forward[k].depth += h * dz, back[k].depth -= h * dz;
        forward[k].opacity += h * da, back[k].opacity -= h * da;
      }
      const auto weights = weights_of(moving, blur);
      const Weights w = weights_of(hits, blur), plus = weights_of(forward, blur),
                    minus = weights_of(back, blur);
      double sum = 0;
      for (size_t k = 0; k < hits.size(); ++k) {
        EXPECT_NEAR(weights[k].v, w[k], 1e-14);
        EXPECT_NEAR(weights[k].d[0], (plus[k] - minus[k]) / (2 * h), 1e-6);
        EXPECT_GE(w[k], 0);
        sum += w[k];
      }
      EXPECT_LE(sum, 1 + 1e-14);
    }
  }
}

// Two separate faces: the usual over operator.
TEST(BlurWeights, HideInOrder) {
  const std::vector<BlurredFace<double>> hits = {{{ShapeId(0), FaceId(0)}, 1, 0.25, true},
                                                 {{ShapeId(1), FaceId(0)}, 2, 0.5, true}};
  const Weights weights = weights_of(hits, {1, 0});
  EXPECT_DOUBLE_EQ(weights[0], 0.25);
  EXPECT_DOUBLE_EQ(weights[1], 0.375);
  // Far apart, gamma changes nothing; at one depth both hide each other by half.
  const Weights soft = weights_of(hits, {1, 1e-3});
  EXPECT_NEAR(soft[1], 0.375, 1e-12);
  auto level = hits;
  level[1].depth = 1;
  const Weights same = weights_of(level, {1, 1e-3});
  EXPECT_NEAR(same[0], 0.25 * (1 - 0.5 * same[1]), 1e-15);
  EXPECT_NEAR(same[1], 0.5 * (1 - 0.5 * same[0]), 1e-15);
}

// One shape for each mesh; one-sided materials.
Scene scene_of_meshes(const std::vector<Mesh>& meshes) {
  Scene scene;
  for (const Mesh& mesh : meshes) {
    Shape& shape = scene.shapes.emplace_back();
    shape.mesh = mesh;
    shape.bsdf = make_diffuse(grey(0.5));
  }
  return scene;
}

std::vector<double> seen_of(const Scene& scene, const Blur& blur, const Ray& ray,
                            double* sum = nullptr) {
  const BlurFaces faces(scene, blur);
  std::vector<BlurHit> hits;
  for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
    for (uint32_t f = 0; f < scene.shapes[s].mesh.faces.size(); ++f) {
      if (const auto hit = faces.meet(ray, {ShapeId(s), FaceId(f)})) hits.push_back(*hit);
    }
  }
  faces.settle(ray, hits);
  std::vector<BlurredFace<double>> lifted;
  for (const BlurHit& hit : hits) lifted.push_back({hit.face, hit.t, hit.opacity, hit.front});
  Weights weights;
  blur_weights<double>(
      lifted, blur, 100,
      [&](const auto& a, const auto& b) {
        return a.front == b.front && faces.touch(a.face, b.face);
      },
      weights);
  Weights of_faces(scene.shapes[0].mesh.faces.size());
  if (sum) *sum = 0;
  for (size_t k = 0; k < weights.size(); ++k) {
    if (hits[k].face.shape == ShapeId(0)) of_faces[hits[k].face.face.index()] = weights[k];
    if (sum) *sum += weights[k];
  }
  return of_faces;
}

// No seams: whatever their sides and angles, coplanar faces add up to one, and, away from the
// vertices of an outline, to the opacity of the whole.
TEST(BlurWeights, OfCoplanarNeighboursAddUpToThoseOfTheWhole) {
  const Scene scene = scene_of_meshes({grid_mesh(4)});
  const double cell = 0.5;
  const Blur blur{std::pow(cell / 40, 2)};
  Rng rng(7, 8, 9);
  int outline = 0;
  for (int i = 0; i < 2000; ++i) {
    const double x = 2.4 * rng.uniform() - 1.2, y = 1.2 * rng.uniform() - 0.6;
    const double along = std::fabs(y / cell - std::floor(y / cell) - 0.5) * cell;
    const bool inside = std::fabs(x) < 1 - blur.reach();
    if (!inside && along > cell / 2 - 2.5 * blur.reach()) continue;
    outline += !inside;
    const Vec3d direction = normalize(Vec3d{rng.uniform() - 0.5, rng.uniform() - 0.5, -1});
    double sum = 0;
    seen_of(scene, blur, {Vec3d{x, y, 0} - direction * 3, direction}, &sum);
    EXPECT_NEAR(sum, blur_opacity(1 - std::fabs(x), blur.sigma), 1e-9) << x << " " << y;
  }
  EXPECT_GT(outline, 20);
}

// Along a ray that moves, weights change by as much as it does: none jumps. gamma = 0, where only
// separate faces that cross would.
TEST(BlurWeights, AreContinuous) {
  for (const Mesh& mesh : {cube_mesh(), tetrahedron_mesh(), torus_mesh(8, 5), cap_mesh(1)}) {
    const Scene scene = scene_of_meshes({mesh});
    const Blur blur = resolved({}, scene);
    double jumps[2] = {0, 0};
    Rng rng(10, 11, 12);
    for (int i = 0; i < 30; ++i) {
      const Vec3d a = random_direction(rng) * 4, b = random_direction(rng),
                  c = random_direction(rng);
      for (const int finer : {0, 1}) {
        const double step = 1e-3 / (finer ? 16 : 1);
        Weights before;
        for (int k = 0; k < 100; ++k) {
          const Vec3d from = a + c * (k * step);
          const Weights now = seen_of(scene, blur, {from, normalize(b - from)});
          for (size_t f = 0; f < before.size(); ++f) {
            jumps[finer] = std::max(jumps[finer], std::fabs(now[f] - before[f]));
          }
          before = now;
        }
      }
    }
    EXPECT_LT(jumps[1], 0.15 * jumps[0]);
  }
}

TEST(BlurWeights, DoNotDependOnTheUnit) {
  const Mesh mesh = torus_mesh(8, 5);
  const Vec3d upright[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  const double unit = 1024;
  const Scene one = scene_of_meshes({mesh});
  const Scene other = scene_of_meshes({transformed(mesh, upright, unit, {})});
  for (Blur blur : kBlurs) {
    blur.sigma = 1e-3;
    const Blur scaled{blur.sigma * unit * unit, blur.gamma * unit, blur.weights};
    Rng rng(13, 14, 15);
    for (int i = 0; i < 200; ++i) {
      const Vec3d from = random_direction(rng) * 3, to = random_direction(rng);
      const Vec3d direction = normalize(to - from);
      if (blur.weights == BlurWeights::kPublished) continue;  // its far end does not scale here
      const Weights a = seen_of(one, blur, {from, direction});
      const Weights b = seen_of(other, scaled, {from * unit, direction});
      for (size_t f = 0; f < a.size(); ++f) EXPECT_NEAR(a[f], b[f], 1e-9);
    }
  }
}

// Copies along seams are neighbours like others.
TEST(BlurWeights, DoNotDependOnCopiesAlongSeams) {
  const Mesh mesh = torus_mesh(8, 5);
  const Scene one = scene_of_meshes({mesh}), other = scene_of_meshes({seam_split(mesh)});
  const Blur blur = resolved({}, one);
  Rng rng(16, 17, 18);
  for (int i = 0; i < 200; ++i) {
    const Vec3d from = random_direction(rng) * 3, to = random_direction(rng);
    const Ray ray{from, normalize(to - from)};
    EXPECT_EQ(seen_of(one, blur, ray), seen_of(other, blur, ray));
  }
}

// Sorts hits, and drops all behind the first opaque face but its neighbours, by the definition.
void leave_out_hidden(const BlurFaces& faces, std::vector<BlurHit>& hits) {
  std::ranges::sort(hits, [](const BlurHit& a, const BlurHit& b) {
    return std::tuple(a.t, a.face.shape, a.face.face) < std::tuple(b.t, b.face.shape, b.face.face);
  });
  const auto opaque = std::ranges::find_if(hits, [](const BlurHit& h) { return h.opacity == 1; });
  if (opaque == hits.end()) return;
  const BlurHit first = *opaque;
  std::erase_if(hits, [&](const BlurHit& hit) {
    return hit.t > first.t + faces.blur().depth() && !faces.touch(hit.face, first.face);
  });
}

// Embree finds what brute force finds, from anywhere and from faces.
TEST(BlurTracer, FindsWhatBruteForceFinds) {
  size_t found = 0, rays = 0;
  for (const NamedMesh& named : test_meshes()) {
    SCOPED_TRACE(named.name);
    const Vec3d upright[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    const Scene scene =
        scene_of_meshes({named.mesh, transformed(cube_mesh(), upright, 0.7, {0.6, 0.2, -0.3})});
    for (const double gamma : {0.0, 0.05}) {
      Blur blur{0, gamma};
      blur = resolved(blur, scene);
      const BlurFaces faces(scene, blur);
      const auto tracer = make_blur_tracer(faces, 1);
      Rng rng(19, 20, 21);
      for (int i = 0; i < 400; ++i) {
        Ray ray{random_direction(rng) * 3, random_direction(rng)};
        ray.direction = normalize(ray.direction * 1.2 - ray.origin);
        if (i % 2 == 1) {
          const auto f = static_cast<uint32_t>(rng.uniform() * named.mesh.faces.size());
          const auto c = face_corners<double>(named.mesh, FaceId(f));
          if (!has_area(named.mesh, named.mesh.faces[f])) continue;
          const double a = rng.uniform(), b = rng.uniform();
          ray.start = {ShapeId(0), FaceId(f)};
          ray.origin = c[0] + (c[1] - c[0]) * a + (c[2] - c[0]) * b;
          ray.direction = random_direction(rng);
        }
        std::vector<BlurHit> brute, hits;
        for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
          const Mesh& mesh = scene.shapes[s].mesh;
          for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
            if (!has_area(mesh, mesh.faces[f])) continue;
            if (const auto hit = faces.meet(ray, {ShapeId(s), FaceId(f)})) brute.push_back(*hit);
          }
        }
        leave_out_hidden(faces, brute);
        tracer->hits(ray, hits);
        ASSERT_EQ(hits.size(), brute.size()) << i;
        for (size_t k = 0; k < hits.size(); ++k) {
          EXPECT_EQ(hits[k].face, brute[k].face);
          EXPECT_EQ(hits[k].t, brute[k].t);
          EXPECT_EQ(hits[k].opacity, brute[k].opacity);
        }
        found += hits.size();
        ++rays;
      }
    }
  }
  EXPECT_GT(found, rays / 2);
}

// Rays that leave a cube meet nothing of it, also where they start beyond a side of their face.
TEST(BlurTracer, ConvexShapesDoNotDarkenThemselves) {
  const Scene scene = scene_of_meshes({cube_mesh()});
  const BlurFaces faces(scene, resolved({}, scene));
  const auto tracer = make_blur_tracer(faces, 1);
  Rng rng(22, 23, 24);
  std::vector<BlurHit> hits;
  for (int i = 0; i < 1000; ++i) {
    Ray ray;
    ray.start = {ShapeId(0), FaceId(static_cast<uint32_t>(12 * rng.uniform()))};
    const auto c = face_corners<double>(scene.shapes[0].mesh, ray.start.face);
    const double a = 1.2 * rng.uniform() - 0.1, b = (1.2 - a) * rng.uniform() - 0.1;
    ray.origin = c[0] + (c[1] - c[0]) * a + (c[2] - c[0]) * b;
    ray.direction = random_direction(rng);
    const Vec3d n = cross(c[1] - c[0], c[2] - c[0]);
    if (dot(n, ray.direction) < 0) ray.direction = -ray.direction;
    tracer->hits(ray, hits);
    EXPECT_TRUE(hits.empty());
  }
}

// The polygon of an enlarged face holds all that is near the face, and not much more.
TEST(BlurTracer, EnlargedFacesHoldAllThatIsNear) {
  Rng rng(25, 26, 27);
  for (int i = 0; i < 300; ++i) {
    std::array<Vec3d, 3> c;
    for (Vec3d& x : c) x = {rng.uniform(), 0.2 * rng.uniform(), 0};
    if (!has_area(c[0], c[1], c[2])) continue;
    if (cross(c[1] - c[0], c[2] - c[0]).z < 0) std::swap(c[1], c[2]);
    const double reach = 0.1;
    const auto polygon = enlarged_face(c, reach);
    for (const Vec3d& x : polygon) EXPECT_LT(-distance_to_sides(c, x), 3.2 * reach);
    for (int n = 0; n < 100; ++n) {
      const Vec3d x{1.6 * rng.uniform() - 0.3, 0.8 * rng.uniform() - 0.3, 0};
      if (distance_to_sides(c, x) < -reach) continue;
      for (size_t k = 0; k < polygon.size(); ++k) {
        const Vec3d& a = polygon[k];
        const Vec3d& b = polygon[(k + 1) % polygon.size()];
        EXPECT_GE(cross(b - a, x - a).z, -1e-12);
      }
    }
  }
}

}  // namespace
}  // namespace limn
