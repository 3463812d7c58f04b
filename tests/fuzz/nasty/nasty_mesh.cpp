// Meshes that break things: slivers, copies, contacts, sheets folded onto themselves.
#include "tests/fuzz/nasty/nasty_mesh.h"

#include <fmt/format.h>

#include <algorithm>

namespace limn::nasty {
namespace {

double nasty_number(Die& die) {
  const double size = die.mostly({1.0, 0.0, 0.5, 1e-3, 1e-7, 1e-20, 1e-30, 1e-42, 1e3, 1e7, 1e12});
  return die.chance(0.5) ? size : -size;
}

Vec3d nasty_point(Die& die) {
  const double x = nasty_number(die), y = nasty_number(die);
  return {x, y, nasty_number(die)};
}

void append(NastyMesh& mesh, const std::vector<Vec3d>& positions,
            const std::vector<FaceIndices>& faces) {
  const auto first = static_cast<uint32_t>(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), positions.begin(), positions.end());
  for (const auto& [a, b, c] : faces) mesh.faces.push_back({first + a, first + b, first + c});
}

// Any triangles between points.
NastyMesh soup(Die& die, std::vector<Vec3d> points) {
  NastyMesh mesh;
  mesh.positions = std::move(points);
  const int last = static_cast<int>(mesh.positions.size()) - 1;
  const auto corner = [&] { return static_cast<uint32_t>(die.integer(0, last)); };
  for (int i = die.integer(1, 16); i > 0; --i) {
    const uint32_t a = corner(), b = corner();
    mesh.faces.push_back({a, b, corner()});
  }
  return mesh;
}

NastyMesh nasty_soup(Die& die) {
  std::vector<Vec3d> points;
  for (int i = die.integer(3, 12); i > 0; --i) points.push_back(nasty_point(die));
  return soup(die, points);
}

// Points of a small grid: faces overlap, touch and repeat exactly.
NastyMesh grid_soup(Die& die) {
  std::vector<Vec3d> points;
  const double noise = die.mostly({0.0, 1e-8, 1e-6, 1e-3});
  for (int i = die.integer(3, 10); i > 0; --i) {
    const double x = die.integer(-1, 1), y = die.integer(-1, 1);
    points.push_back(Vec3d{x, y, double(die.integer(-1, 1))} + die.in_cube(noise));
  }
  return soup(die, points);
}

NastyMesh free_soup(Die& die) {
  std::vector<Vec3d> points;
  for (int i = die.integer(3, 12); i > 0; --i) points.push_back(die.in_cube(1));
  return soup(die, points);
}

void append_box(NastyMesh& mesh, const Vec3d& center, const Vec3d& half) {
  std::vector<Vec3d> x;
  for (int i = 0; i < 8; ++i) {
    x.push_back(center + Vec3d{i & 1 ? half.x : -half.x, i & 2 ? half.y : -half.y,
                               i & 4 ? half.z : -half.z});
  }
  append(mesh, x,
         {{0, 2, 3},
          {0, 3, 1},
          {4, 5, 7},
          {4, 7, 6},
          {0, 1, 5},
          {0, 5, 4},
          {2, 6, 7},
          {2, 7, 3},
          {0, 4, 6},
          {0, 6, 2},
          {1, 3, 7},
          {1, 7, 5}});
}

// Boxes in one place, side by side, through each other, nearly.
NastyMesh boxes(Die& die) {
  NastyMesh mesh;
  for (int i = die.integer(1, 3); i > 0; --i) {
    const auto offset = [&] { return die.mostly({0.0, 1.0, 0.5, 2.0, 1e-7, 1e-3, 1 + 1e-7}); };
    const auto half = [&] { return die.mostly({0.5, 1.0, 0.25, 1e-6, 0.0}); };
    const double x = offset(), y = offset(), a = half(), b = half();
    append_box(mesh, {x, y, offset()}, {a, b, half()});
  }
  return mesh;
}

// Fins around an axis: their normals cancel along it.
NastyMesh fins(Die& die) {
  NastyMesh mesh;
  const int count = die.integer(2, 8);
  const double turn = die.uniform(0, 6);
  mesh.positions = {{0, -1, 0}, {0, 1, 0}};
  for (int i = 0; i < count; ++i) {
    const double angle = turn + 2 * kPi * i / count;
    const auto k = static_cast<uint32_t>(mesh.positions.size());
    mesh.positions.push_back({std::cos(angle), -1, std::sin(angle)});
    mesh.positions.push_back({std::cos(angle), 1, std::sin(angle)});
    mesh.faces.insert(mesh.faces.end(), {{0, k, k + 1}, {0, k + 1, 1}});
  }
  return mesh;
}

NastyMesh needles(Die& die) {
  NastyMesh mesh;
  for (int i = die.integer(1, 6); i > 0; --i) {
    const double width = die.pick({1e-1, 1e-3, 1e-6, 1e-8, 1e-12, 1e-20, 1e-30});
    const Vec3d a = die.in_cube(1), b = die.in_cube(1);
    append(mesh, {a, b, (die.chance(0.5) ? a : (a + b) * 0.5) + die.in_cube(width)}, {{0, 1, 2}});
  }
  return mesh;
}

NastyMesh sheet(Die& die) {
  NastyMesh mesh;
  const int cells = die.integer(1, 5);
  const double height = die.mostly({0.2, 0.0, 1e-7, 3.0}), fold = die.chance(0.2) ? -1 : 1;
  for (int y = 0; y <= cells; ++y)
    for (int x = 0; x <= cells; ++x) {
      const double u = 2.0 * x / cells - 1, v = 2.0 * y / cells - 1;
      mesh.positions.push_back({u < 0 ? fold * u : u, v, height * die.uniform(-1, 1)});
    }
  const auto at = [&](int x, int y) { return static_cast<uint32_t>(y * (cells + 1) + x); };
  for (int y = 0; y < cells; ++y)
    for (int x = 0; x < cells; ++x) {
      mesh.faces.push_back({at(x, y), at(x + 1, y), at(x + 1, y + 1)});
      mesh.faces.push_back({at(x, y), at(x + 1, y + 1), at(x, y + 1)});
    }
  return mesh;
}

// What programs do to meshes.
void spoil(Die& die, NastyMesh& mesh) {
  const auto face = [&]() -> FaceIndices& {
    return mesh.faces[die.integer(0, static_cast<int>(mesh.faces.size()) - 1)];
  };
  if (die.chance(0.2)) mesh.faces.push_back(FaceIndices(face()));
  if (die.chance(0.2)) std::swap(face()[0], face()[1]);
  if (die.chance(0.1)) {
    const auto [a, b, c] = FaceIndices(face());
    mesh.faces.push_back({b, a, c});
  }
  if (die.chance(0.1)) {  // a T-junction
    const auto [a, b, c] = FaceIndices(face());
    mesh.positions.push_back((mesh.positions[a] + mesh.positions[b]) * die.pick({0.5, 0.3}));
    mesh.faces.push_back({a, static_cast<uint32_t>(mesh.positions.size() - 1), b});
  }
  if (die.chance(0.1)) mesh.positions.push_back(nasty_point(die));  // no face has it
  if (die.chance(0.1)) {                                            // a copy, or nearly
    auto& corner = face()[die.integer(0, 2)];
    mesh.positions.push_back(mesh.positions[corner] * die.pick({1.0, 1 + 1e-7, 1 + 1e-4}));
    corner = static_cast<uint32_t>(mesh.positions.size() - 1);
  }
}

}  // namespace

NastyMesh nasty_mesh(Die& die) {
  NastyMesh mesh;
  switch (die.integer(0, 7)) {
    case 0:
      mesh = nasty_soup(die);
      break;
    case 1:
      mesh = grid_soup(die);
      break;
    case 2:
      mesh = boxes(die);
      break;
    case 3:
      mesh = fins(die);
      break;
    case 4:
      mesh = needles(die);
      break;
    case 5:
      mesh = sheet(die);
      break;
    case 6:
      mesh = free_soup(die);
      break;
    default:
      append_box(mesh, {}, {1, 1, 1});
      if (die.chance(0.5)) append_box(mesh, die.in_cube(1), {1, 1, 1});
  }
  spoil(die, mesh);
  if (die.chance(0.2)) {
    for (size_t i = 0; i < mesh.positions.size(); ++i)
      mesh.normals.push_back(die.chance(0.9) ? die.in_cube(1) : nasty_point(die));
  }
  return mesh;
}

std::string obj_text(const NastyMesh& mesh) {
  std::string text;
  for (const Vec3d& x : mesh.positions) text += fmt::format("v {} {} {}\n", x.x, x.y, x.z);
  for (const Vec3d& n : mesh.normals) text += fmt::format("vn {} {} {}\n", n.x, n.y, n.z);
  for (const auto& face : mesh.faces) {
    text += "f";
    for (const uint32_t v : face) {
      text += mesh.normals.empty() ? fmt::format(" {}", v + 1) : fmt::format(" {0}//{0}", v + 1);
    }
    text += "\n";
  }
  return text;
}

}  // namespace limn::nasty
