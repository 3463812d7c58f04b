// Which textures jump where.
#include "integrators/edges/texture_jumps.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "integrators/edges/face_jumps.h"
#include "limn/core/duplicate_faces.h"
#include "limn/core/names.h"

namespace limn {
namespace {

std::vector<const Texture*> textures_of(const Shape& shape) {
  std::vector<const Texture*> textures;
  for (int k = 0; k < shape.bsdf->texture_count(); ++k) {
    textures.push_back(&shape.bsdf->texture(k));
  }
  if (shape.radiance_texture) textures.push_back(shape.radiance_texture.get());
  return textures;
}

bool is_near(const std::array<double, 2>& a, const std::array<double, 2>& b) {
  constexpr double kNear = 0x1p-22;
  return std::fabs(a[0] - b[0]) <= kNear && std::fabs(a[1] - b[1]) <= kNear;
}

// Lines that two textures have in common.
void leave_out_copies(std::vector<Texture::Jump>& jumps) {
  std::vector<Texture::Jump> kept;
  for (const Texture::Jump& jump : jumps) {
    const bool known = std::any_of(kept.begin(), kept.end(), [&](const Texture::Jump& other) {
      return (is_near(jump.from, other.from) && is_near(jump.to, other.to)) ||
             (is_near(jump.from, other.to) && is_near(jump.to, other.from));
    });
    if (!known) kept.push_back(jump);
  }
  jumps = std::move(kept);
}

// Attributes of vertices jump at most where these are stored more than once.
void mark_copies(const Mesh& mesh, TextureSeams& seams) {
  std::vector<uint8_t> has_copies(mesh.positions.size());
  for (uint32_t v = 0; v < mesh.weld.size(); ++v) {
    if (mesh.weld[v] != v) has_copies[mesh.weld[v]] = 1;
  }
  seams.sides.resize(mesh.faces.size());
  for (size_t f = 0; f < mesh.faces.size(); ++f) {
    for (int k = 0; k < 3; ++k) {
      const uint32_t a = mesh.faces[f][k], b = mesh.faces[f][(k + 1) % 3];
      if (has_copies[mesh.weld[a]] || has_copies[mesh.weld[b]]) seams.sides[f] |= 1 << k;
    }
  }
}

}  // namespace

TextureJumps::TextureJumps(const Scene& scene) {
  for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
    if (scene.shapes[s].mesh.textured) look_at(scene, ShapeId(s));
  }
}

void TextureJumps::look_at(const Scene& scene, ShapeId id) {
  const Shape& shape = scene.shape(id);
  const Mesh& mesh = shape.mesh;
  shapes_.resize(scene.shapes.size());
  OfShape& result = shapes_[id.index()];
  TextureSeams& seams = result.seams;
  std::vector<const Texture*> textures;
  seams.period_one = true;
  for (const Texture* texture : textures_of(shape)) {
    seams.everywhere = seams.everywhere || texture->jumps_between_faces();
    if (!texture->needs_uv()) {
      mark_copies(mesh, seams);
      continue;
    }
    textures.push_back(texture);
    seams.coordinates = true;
    seams.period_one = seams.period_one && texture->has_period_one();
  }
  result.has_seams = seams.everywhere || seams.coordinates || !seams.sides.empty();
  if (textures.empty()) return;
  if (mesh.uv_source != UvSource::kPlane && !seams.period_one) with_meridian_.push_back(id);
  seams.sides.resize(mesh.faces.size());
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
    if (add_face(textures, mesh, FaceId(f), result)) continue;
    result.segments.clear();
    if (!first_without_.valid()) first_without_ = id;
    return;
  }
}

bool TextureJumps::add_face(const std::vector<const Texture*>& textures, const Mesh& mesh,
                            FaceId face, OfShape& result) {
  Texture::Jumps jumps;
  size_t of_one = 0;  // how many textures jump
  for (const Texture* texture : textures) {
    const size_t before = jumps.inside.size();
    if (!add_face_jumps(*texture, mesh, face, kMost - std::min(count_, kMost), jumps)) {
      count_ = kMost + 1;
      return false;
    }
    of_one += jumps.inside.size() > before;
  }
  if (of_one > 1) leave_out_copies(jumps.inside);
  result.seams.sides[face.index()] |= jumps.sides;
  for (const Texture::Jump& jump : jumps.inside) {
    result.segments.push_back({face, jump.from, jump.to});
  }
  count_ += jumps.inside.size();
  return true;
}

const TextureSeams* TextureJumps::seams(ShapeId shape) const {
  if (shapes_.empty() || !shapes_[shape.index()].has_seams) return nullptr;
  return &shapes_[shape.index()].seams;
}

std::span<const FaceSegment> TextureJumps::segments(ShapeId shape) const {
  if (shapes_.empty()) return {};
  return shapes_[shape.index()].segments;
}

void check_texture_edges(const Scene& scene, std::vector<std::string>& warnings) {
  const TextureJumps jumps(scene);
  if (jumps.first_without().valid()) {
    throw InputError(
        scene.shape(jumps.first_without()).where,
        fmt::format("{}: its texture jumps along more than {} edges in all, which derivatives with "
                    "respect to what moves need: scale to_uv by less",
                    quoted_name(scene, jumps.first_without()), TextureJumps::kMost));
  }
  if (jumps.with_meridian().empty()) return;
  std::vector<std::string> names;
  for (const ShapeId shape : jumps.with_meridian()) names.push_back(quoted_name(scene, shape));
  constexpr size_t kMostNames = 8;
  const size_t more = names.size() > kMostNames ? names.size() - kMostNames : 0;
  names.resize(names.size() - more);
  warnings.push_back(fmt::format(
      "derivatives with respect to what moves are incomplete: the textures of {}{} jump where the "
      "angle of a sphere or disk comes back to its beginning, which is no edge (where to_uv has "
      "whole numbers they do not)",
      join(names), more > 0 ? fmt::format(" and {} more", more) : ""));
}

}  // namespace limn
