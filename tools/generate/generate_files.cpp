// The tables of what can be made, and the mesh files.
#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cstring>

#include "limn/core/output_file.h"
#include "tools/generate/generate.h"
#include "tools/generate/generate_kinds.h"

namespace limn {

std::span<const MeshKind> mesh_kinds() {
  static const MeshKind kinds[] = {
      {"pebble", "a sphere with hollows and bumps", 30000, 1000, true, 1, 0, make_pebble},
      {"knot", "a trefoil, genus 1", 30000, 1000, true, 1, 1, make_knot},
      {"pretzel", "two rings grown together, genus 2", 30000, 1000, true, 1, 2, make_pretzel},
      {"tetrapod", "the edges of a tetrahedron grown thick, genus 3", 30000, 1000, true, 1, 3,
       make_tetrapod},
      {"creature", "an animal with ears and a curled tail", 40000, 3000, true, 1, 0, make_creature},
      {"harp", "a frame and two rows of thin strings with their pins", 60000, 20000, true, 290, 1,
       make_harp},
      {"chandelier", "arms, candles, a chain, beads and drops", 70000, 30000, true, 448, 26,
       make_chandelier},
      {"bracket", "a CAD part with bores, a boss and chamfers, for face_normals", 20000, 2000, true,
       1, 5, make_bracket},
      {"plant", "open leaves on closed stems in a pot", 30000, 5000, false, 69, 0, make_plant},
      {"tree", "a trunk, branches and open leaves", 24000, 9000, false, 1001, 0, make_tree},
      {"gear", "12 teeth, 4 spokes and a bore, about the z axis", 3000, 1500, true, 1, 5,
       make_gear},
      {"pinion", "8 teeth and a bore, about the z axis", 1500, 1000, true, 1, 1, make_pinion},
      {"ball", "a sphere of few faces, nearly alike", 320, 80, true, 1, 0, make_ball},
      {"vase", "a bellied vase", 20000, 2000, true, 1, 0, make_vase},
      {"bowl", "a wide bowl", 20000, 2000, true, 1, 0, make_bowl},
      {"goblet", "a wine glass with a thin wall", 40000, 8000, true, 1, 0, make_goblet},
      {"bottle", "an open bottle", 30000, 4000, true, 1, 0, make_bottle},
      {"orange", "an orange, with colours", 30000, 1000, true, 1, 0, make_orange},
      {"lemon", "a lemon that stands, with colours", 20000, 1000, true, 1, 0, make_lemon},
      {"pear", "a pear, with colours", 20000, 1000, true, 1, 0, make_pear},
      {"grapes", "a heap of grapes", 30000, 5000, true, 34, 0, make_grapes},
      {"twigs", "six twigs with oval open leaves", 20000, 5000, false, 114, 0, make_twigs},
      {"cloth", "a cloth with folds that hangs over a table's edge, with texture coordinates",
       40000, 2000, false, 1, 0, make_cloth},
      {"word", "the letters of limn, for face_normals", 4500, 1100, true, 5, 0, make_word},
  };
  return kinds;
}

std::span<const ImageKind> sky_kinds() {
  static const ImageKind kinds[] = {
      {"sky_soft", "clouds, lit from one side", make_soft_sky},
      {"sky_sun", "clear, with a strong small sun", make_sun_sky},
  };
  return kinds;
}

std::span<const ImageKind> texture_kinds() {
  static const ImageKind kinds[] = {
      {"boards", "a table's boards", make_boards},
      {"linen", "woven linen with checks", make_linen},
  };
  return kinds;
}

Triangles make_mesh(const MeshKind& kind, int faces) {
  Triangles mesh = kind.make(faces);
  Bounds bounds;
  for (const Vec3d& p : mesh.positions) bounds.extend(p);
  const Vec3d size = bounds.upper - bounds.lower;
  const double scale = 1.98 / std::max({size.x, size.y, size.z});
  const Vec3d center = bounds.center();
  for (Vec3d& p : mesh.positions) {
    p = Vec3d{p.x - center.x, p.y - bounds.lower.y, p.z - center.z} * scale - Vec3d{0, 0.99, 0};
  }
  return mesh;
}

namespace {

template <class T>
void put(std::string& bytes, T number) {
  if constexpr (std::endian::native == std::endian::big && sizeof(T) == 4) {
    number = std::bit_cast<T>(__builtin_bswap32(std::bit_cast<uint32_t>(number)));
  }
  char raw[sizeof(T)];
  std::memcpy(raw, &number, sizeof(T));
  bytes.append(raw, sizeof(T));
}

std::string ply_bytes(const Triangles& mesh) {
  std::string names = "xyz";
  if (!mesh.uv.empty()) names += "uv";
  if (!mesh.colours.empty()) names += "rgb";
  std::string bytes = fmt::format("ply\nformat binary_little_endian 1.0\nelement vertex {}\n",
                                  mesh.positions.size());
  for (const char name : names) bytes += fmt::format("property float {}\n", name);
  bytes += fmt::format("element face {}\nproperty list uchar int vertex_indices\nend_header\n",
                       mesh.faces.size());
  for (size_t v = 0; v < mesh.positions.size(); ++v) {
    for (int i = 0; i < 3; ++i) put(bytes, static_cast<float>(mesh.positions[v][i]));
    if (!mesh.uv.empty()) {
      for (const double x : mesh.uv[v]) put(bytes, static_cast<float>(x));
    }
    if (!mesh.colours.empty()) {
      for (int i = 0; i < 3; ++i) put(bytes, static_cast<float>(mesh.colours[v][i]));
    }
  }
  for (const FaceIndices& face : mesh.faces) {
    put(bytes, uint8_t{3});
    for (const uint32_t v : face) put(bytes, v);
  }
  return bytes;
}

std::string obj_bytes(const Triangles& mesh) {
  std::string bytes;
  for (const Vec3d& p : mesh.positions) {
    bytes += fmt::format("v {} {} {}\n", static_cast<float>(p.x), static_cast<float>(p.y),
                         static_cast<float>(p.z));
  }
  for (const auto& [a, b, c] : mesh.faces) {
    bytes += fmt::format("f {} {} {}\n", a + 1, b + 1, c + 1);
  }
  return bytes;
}

}  // namespace

void write_triangles(const std::string& file, const Triangles& mesh) {
  const bool obj = file.ends_with(".obj");
  if (!obj && !file.ends_with(".ply")) {
    throw InputError({file}, "mesh files end with .ply or .obj");
  }
  OutputFile output(file);
  output.write(obj ? obj_bytes(mesh) : ply_bytes(mesh));
  output.commit();
}

}  // namespace limn
