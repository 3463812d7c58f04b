// Writes a mesh and a sky for the demo where Debian's cannot be had: a little creature with ears,
// and a morning sky with the sun. `limn_demo_data FOLDER` makes FOLDER/creature.obj and
// FOLDER/sky.exr.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <vector>

#include "limn/core/image.h"
#include "limn/core/mesh.h"

namespace limn {
namespace {

// Unit sphere: an icosahedron whose faces are split in four `levels` times.
struct SphereMesh {
  std::vector<Vec3d> directions;  // V, unit
  std::vector<FaceIndices> faces;
};

SphereMesh icosahedron() {
  const double a = (1 + std::sqrt(5.0)) / 2;
  SphereMesh mesh;
  for (const Vec3d& v : {Vec3d{-1, a, 0}, Vec3d{1, a, 0}, Vec3d{-1, -a, 0}, Vec3d{1, -a, 0},
                         Vec3d{0, -1, a}, Vec3d{0, 1, a}, Vec3d{0, -1, -a}, Vec3d{0, 1, -a},
                         Vec3d{a, 0, -1}, Vec3d{a, 0, 1}, Vec3d{-a, 0, -1}, Vec3d{-a, 0, 1}}) {
    mesh.directions.push_back(normalize(v));
  }
  mesh.faces = {{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
                {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
                {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}};
  return mesh;
}

SphereMesh split(const SphereMesh& mesh) {
  SphereMesh result{mesh.directions, {}};
  std::map<std::pair<uint32_t, uint32_t>, uint32_t> middles;
  const auto middle = [&](uint32_t a, uint32_t b) {
    const auto [entry, is_new] =
        middles.try_emplace(std::minmax(a, b), static_cast<uint32_t>(result.directions.size()));
    if (is_new) result.directions.push_back(normalize(mesh.directions[a] + mesh.directions[b]));
    return entry->second;
  };
  for (const auto& [a, b, c] : mesh.faces) {
    const uint32_t ab = middle(a, b);
    const uint32_t bc = middle(b, c);
    const uint32_t ca = middle(c, a);
    for (const FaceIndices& face : {FaceIndices{a, ab, ca}, FaceIndices{ab, b, bc},
                                    FaceIndices{ca, bc, c}, FaceIndices{ab, bc, ca}}) {
      result.faces.push_back(face);
    }
  }
  return result;
}

// A swelling of a star-shaped body: height * exp(sharpness (d.centre - 1)).
struct Bump {
  Vec3d centre;  // unit
  double height, sharpness;
};

double radius(const Vec3d& d) {
  static const Bump bumps[] = {
      {normalize(Vec3d{-0.8, 0.45, 0.1}), 0.35, 9},       // head
      {normalize(Vec3d{-0.55, 0.85, 0.28}), 0.55, 60},    // ears
      {normalize(Vec3d{-0.45, 0.85, -0.28}), 0.55, 60},   // ears
      {normalize(Vec3d{1, -0.25, 0}), 0.15, 60},          // tail
      {normalize(Vec3d{-0.55, -0.75, 0.35}), 0.22, 25},   // feet
      {normalize(Vec3d{-0.55, -0.75, -0.35}), 0.22, 25},  // feet
      {normalize(Vec3d{0.4, -0.8, 0.5}), 0.2, 16},        // feet
      {normalize(Vec3d{0.4, -0.8, -0.5}), 0.2, 16},       // feet
  };
  double r = 0.62;
  for (const Bump& bump : bumps) {
    r += bump.height * std::exp(bump.sharpness * (dot(d, bump.centre) - 1));
  }
  return r;
}

// As large as the bunny: within 1 of the origin, resting on y = -0.99.
void write_creature(const std::string& file) {
  SphereMesh mesh = icosahedron();
  for (int level = 0; level < 5; ++level) mesh = split(mesh);
  std::vector<Vec3d> positions;
  double lowest = 0;
  for (const Vec3d& d : mesh.directions) {
    positions.push_back(d * radius(d));
    lowest = std::min(lowest, positions.back().y);
  }
  std::ofstream out(file);
  for (const Vec3d& p : positions) {
    out << fmt::format("v {:.6f} {:.6f} {:.6f}\n", p.x, p.y - 0.99 - lowest, p.z);
  }
  for (const auto& [a, b, c] : mesh.faces) out << fmt::format("f {} {} {}\n", a + 1, b + 1, c + 1);
  out.close();
  if (!out) throw InputError({file}, "cannot be written");
}

// Radiance from the unit direction d: blue above, bright at the horizon, brown below, a soft sun.
Rgb<double> sky(const Vec3d& d) {
  const double up = std::max(0.0, d.y);
  const double glow = std::exp(-6 * up);
  Rgb<double> c{0.18 + 1.1 * glow, 0.32 + 0.75 * glow, 0.6 + 0.35 * glow};
  if (d.y < 0) c = c * std::exp(12 * d.y) + Rgb<double>{0.12, 0.08, 0.05} * (-std::expm1(12 * d.y));
  const double sun = std::exp(400 * (dot(d, normalize(Vec3d{0.7, 0.45, 0.75})) - 1));
  return c + Rgb<double>{160, 130, 90} * sun;
}

void write_sky(const std::string& file) {
  Image image(512, 256, 3);
  for (int y = 0; y < image.height; ++y) {
    const double theta = kPi * y / (image.height - 1);
    for (int x = 0; x < image.width; ++x) {
      const double phi = 2 * kPi * (x + 0.5) / image.width;
      const Rgb<double> c =
          sky({std::sin(phi) * std::sin(theta), std::cos(theta), -std::cos(phi) * std::sin(theta)});
      for (int i = 0; i < 3; ++i) image.at(x, y, i) = static_cast<float>(c[i]);
    }
  }
  write_exr(file, image, true, {});
}

}  // namespace
}  // namespace limn

int main(int argc, char** argv) {
  if (argc != 2) {
    fmt::print(stderr, "usage: limn_demo_data FOLDER\n");
    return 2;
  }
  try {
    const std::string folder = argv[1];
    std::filesystem::create_directories(folder);
    limn::write_creature(folder + "/creature.obj");
    limn::write_sky(folder + "/sky.exr");
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 2;
  }
  return 0;
}
