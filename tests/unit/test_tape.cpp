// Reverse-mode scalars, surface points and shading normals against dual numbers.
#include <gtest/gtest.h>

#include "limn/core/make_bsdf.h"
#include "limn/core/normals_adjoint.h"
#include "limn/core/reverse.h"
#include "limn/core/rng.h"
#include "support/meshes.h"

namespace limn {
namespace {

// Of four numbers, one for each lane.
template <class S>
using Inputs = std::array<S, 4>;

// Out of line: GCC 12 folds constant lanes wrongly where it sees through (-O3 -march=znver3).
[[gnu::noinline]] Inputs<Dual> seeded(const std::array<double, 4>& x) {
  return {Dual(x[0], {1, 0, 0, 0}), Dual(x[1], {0, 1, 0, 0}), Dual(x[2], {0, 0, 1, 0}),
          Dual(x[3], {0, 0, 0, 1})};
}

template <class F>
void expect_dual(const F& f, const std::array<double, 4>& x) {
  const Dual expected = f(seeded(x));
  Tape tape;
  const TapeScope scope(tape);
  Inputs<Var> var;
  for (int k = 0; k < 4; ++k) var[k] = {x[k], tape.leaf(1 + k)};
  const Var found = f(var);
  // A product and the sum it goes into are rounded at once in one of them and apart in the other:
  // half a unit of the product, up to four times, of which none is above 40 here.
  EXPECT_NEAR(found.v, expected.v, 4 * 40 * 0x1p-53);
  std::array<double, 4> gradient{};
  if (found.node != 0) {
    tape.start();
    tape.adjoint(found.node) = 1;
    tape.sweep();
    for (const Contribution& c : tape.contributions()) gradient[c.slot - 1] += c.value;
  }
  double size = 0;
  for (int k = 0; k < 4; ++k) size = std::max(size, std::fabs(expected.d[k]));
  for (int k = 0; k < 4; ++k) EXPECT_NEAR(gradient[k], expected.d[k], 1e-13 * size);
}

TEST(Tape, OperationsMatchDual) {
  Rng rng(1, 2, 3);
  for (int i = 0; i < 2000; ++i) {
    std::array<double, 4> x;
    for (double& v : x) v = 0.05 + 0.9 * rng.uniform();
    expect_dual([](auto a) { return a[0] + a[1] - a[2] * a[3]; }, x);
    expect_dual([](auto a) { return a[0] / a[1] + 2.0 / a[2] - a[3] / 3.0; }, x);
    expect_dual([](auto a) { return (1.5 + a[0]) * (a[1] + 2.5) * (0.5 - a[2]) * (a[3] - 0.25); },
                x);
    expect_dual([](auto a) { return 3.0 * a[0] * a[0] - -a[1] * 2.0; }, x);
    expect_dual([](auto a) { return sqrt(a[0]) * exp(a[1]) + sin(a[2]) * cos(a[3]) * tan(a[0]); },
                x);
    expect_dual([](auto a) { return acos(a[0]) + atan2(a[1], a[2] - 0.5) * a[3]; }, x);
    expect_dual([](auto a) { return max(a[0], a[1]) * min(a[2], a[3]); }, x);
    expect_dual(
        [](auto a) {
          auto b = a[0];
          b += a[1];
          b *= a[2];
          return b * b;
        },
        x);
    expect_dual(
        [](auto a) {
          using S = std::decay_t<decltype(a[0])>;
          const Vec3<S> u{a[0], a[1], a[2]}, v{a[3], a[0], 0.5};
          const Vec3d c{0.3, -1, 2};
          return dot(cross(u, v), normalize(u + v)) + dot(u, c) * dot(c, v) + length(v);
        },
        x);
  }
}

TEST(Tape, ConstantsWriteNothing) {
  Tape tape;
  const TapeScope scope(tape);
  const size_t bytes = tape.bytes();
  const Vec3<Var> v = normalize(cross(Vec3<Var>{1, 2, 3}, Vec3<Var>{3, 2, 5}));
  EXPECT_EQ((dot(v, v) * sqrt(v.x) - 1.0).node, 0u);
  EXPECT_EQ(tape.bytes(), bytes);
}

Vec3d random_vector(Rng& rng) {
  return {2 * rng.uniform() - 1, 2 * rng.uniform() - 1, 2 * rng.uniform() - 1};
}

// A scene of one mesh, and slots for its positions and normals.
struct MeshScene {
  Scene scene;
  SceneSlots slots;

  explicit MeshScene(const Mesh& mesh) {
    Shape shape;
    shape.mesh = mesh;
    shape.bsdf = make_diffuse(grey(0.5));
    scene.shapes.push_back(shape);
    slots.scene = &scene;
    const auto v = static_cast<uint32_t>(mesh.positions.size());
    MeshSlots of;
    of.positions = 1;
    of.normals = 1 + 3 * v;
    slots.meshes.push_back(of);
    slots.count = of.normals + 3 * static_cast<uint32_t>(mesh.normals.size());
  }
  Mesh& mesh() { return scene.shapes[0].mesh; }
};

Vec3<Dual> moving(const Vec3d& x, const Vec3d& velocity) {
  Vec3<Dual> r;
  for (int k = 0; k < 3; ++k) r[k] = Dual(x[k], {velocity[k], 0, 0, 0});
  return r;
}

Mesh smooth(Mesh mesh) {
  mesh.normal_source = NormalSource::kComputed;
  update_shading_normals(mesh);
  return mesh;
}

// The derivative along random velocities of everything, by dual numbers and by the statement.
void expect_surface(const Mesh& mesh, Rng& rng) {
  MeshScene of(mesh);
  Mesh& m = of.mesh();
  std::vector<double> velocity(of.slots.count);
  for (double& v : velocity) v = 2 * rng.uniform() - 1;
  const auto vector_at = [&](uint32_t slot) {
    return Vec3d{velocity[slot], velocity[slot + 1], velocity[slot + 2]};
  };
  const auto lanes_of = [](const Vec3d& v) {
    return Vec3<Lanes>{{v.x, 0, 0, 0}, {v.y, 0, 0, 0}, {v.z, 0, 0, 0}};
  };
  const MeshSlots& slots = of.slots.meshes[0];
  for (uint32_t i = 0; i < m.positions.size(); ++i) {
    m.position_tangents.push_back(lanes_of(vector_at(slots.positions + 3 * m.weld[i])));
  }
  for (uint32_t i = 0; i < m.normals.size(); ++i) {
    m.normal_tangents.push_back(lanes_of(vector_at(slots.normals + 3 * i)));
  }
  const FaceRef face{ShapeId(0), FaceId(static_cast<uint32_t>(rng.uniform() * m.faces.size()))};
  const auto c = face_corners<double>(m, face.face);
  const Vec3d inside = c[0] * 0.2 + c[1] * 0.3 + c[2] * 0.5;
  const Vec3d origin = inside + random_vector(rng) * 3, direction = normalize(inside - origin);
  const Vec3d of_origin = random_vector(rng), of_direction = random_vector(rng);
  const auto dual = surface_on_ray<Dual>(of.scene, face, moving(origin, of_origin),
                                         moving(direction, of_direction));
  Tape tape(&of.slots);
  const TapeScope scope(tape);
  Vec3<Var> o, d;
  const uint32_t extra = of.slots.count;
  for (int k = 0; k < 3; ++k) {
    o[k] = {origin[k], tape.leaf(extra + k)};
    d[k] = {direction[k], tape.leaf(extra + 3 + k)};
  }
  const auto var = surface_on_ray<Var>(of.scene, face, o, d);
  const Vec3d of_p = random_vector(rng), of_n = random_vector(rng);
  tape.start();
  for (int k = 0; k < 3; ++k) {
    tape.adjoint(var.p[k].node) += of_p[k];
    tape.adjoint(var.n_s[k].node) += of_n[k];
  }
  tape.sweep();
  double reverse = 0, size = 0;
  for (const Contribution& found : tape.contributions()) {
    const double v = found.slot < extra       ? velocity[found.slot]
                     : found.slot < extra + 3 ? of_origin[found.slot - extra]
                                              : of_direction[found.slot - extra - 3];
    reverse += found.value * v;
    size += std::fabs(found.value * v);
  }
  double forward = 0;
  for (int k = 0; k < 3; ++k) forward += of_p[k] * dual.p[k].d[0] + of_n[k] * dual.n_s[k].d[0];
  EXPECT_NEAR(reverse, forward, 1e-12 * size);
}

TEST(Tape, SurfacePointsMatchDual) {
  Rng rng(3, 1, 4);
  const Mesh flat = torus_mesh(7, 5), round = smooth(seam_split(torus_mesh(7, 5)));
  for (int i = 0; i < 2000; ++i) {
    expect_surface(flat, rng);
    expect_surface(round, rng);
  }
}

// Derivatives of positions from those of normals, along random velocities.
void expect_normals(Mesh mesh, Rng& rng) {
  std::vector<Vec3d> velocity(mesh.positions.size());
  for (size_t i = 0; i < velocity.size(); ++i) {
    velocity[i] = mesh.weld[i] < i ? velocity[mesh.weld[i]] : random_vector(rng);
    const Vec3d& v = velocity[i];
    mesh.position_tangents.push_back({{v.x, 0, 0, 0}, {v.y, 0, 0, 0}, {v.z, 0, 0, 0}});
  }
  update_shading_normals(mesh);
  std::vector<Vec3d> of_normals, of_positions(mesh.positions.size());
  double forward = 0;
  for (const Vec3<Lanes> n : mesh.normal_tangents) {
    const Vec3d w = random_vector(rng);
    of_normals.push_back(w);
    forward += w.x * n.x[0] + w.y * n.y[0] + w.z * n.z[0];
  }
  const ShadingNormalsAdjoint adjoint(mesh);
  // Number by number, so that each reaches all that hangs on it by itself.
  std::vector<Vec3d> one_by_one(mesh.positions.size());
  for (size_t i = 0; i < of_normals.size(); ++i) {
    std::vector<Vec3d> normals(of_normals.size());
    normals[i] = of_normals[i];
    adjoint.pull_back(normals, one_by_one);
  }
  adjoint.pull_back(of_normals, of_positions);
  double reverse = 0, size = 0;
  for (size_t i = 0; i < velocity.size(); ++i) {
    reverse += dot(of_positions[i], velocity[i]);
    size += std::fabs(dot(of_positions[i], velocity[i]));
  }
  EXPECT_NEAR(reverse, forward, 1e-12 * size);
  double summed = 0;
  for (size_t i = 0; i < velocity.size(); ++i) summed += dot(one_by_one[i], velocity[i]);
  EXPECT_NEAR(summed, forward, 1e-12 * size);
}

TEST(ShadingNormals, AdjointMatchesDual) {
  Rng rng(2, 7, 1);
  for (int i = 0; i < 50; ++i) {
    Mesh mesh = seam_split(torus_mesh(9, 6));
    for (size_t v = 0; v < mesh.positions.size(); ++v) {
      mesh.positions[v] =
          mesh.weld[v] < v
              ? mesh.positions[mesh.weld[v]]
              : cast<float>(cast<double>(mesh.positions[v]) + random_vector(rng) * 0.05);
    }
    expect_normals(smooth(mesh), rng);
  }
}

}  // namespace
}  // namespace limn
