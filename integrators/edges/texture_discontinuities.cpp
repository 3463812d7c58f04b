// Which textures are discontinuous where.
#include "integrators/edges/texture_discontinuities.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "integrators/edges/face_discontinuities.h"
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
void leave_out_copies(std::vector<Texture::Discontinuity>& lines) {
  std::vector<Texture::Discontinuity> kept;
  for (const Texture::Discontinuity& line : lines) {
    const bool known =
        std::any_of(kept.begin(), kept.end(), [&](const Texture::Discontinuity& other) {
          return (is_near(line.from, other.from) && is_near(line.to, other.to)) ||
                 (is_near(line.from, other.to) && is_near(line.to, other.from));
        });
    if (!known) kept.push_back(line);
  }
  lines = std::move(kept);
}

// Attributes of vertices are discontinuous at most where these are stored more than once.
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

TextureDiscontinuities::TextureDiscontinuities(const Scene& scene) {
  for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
    if (scene.shapes[s].mesh.textured) look_at(scene, ShapeId(s));
  }
}

void TextureDiscontinuities::look_at(const Scene& scene, ShapeId id) {
  const Shape& shape = scene.shape(id);
  const Mesh& mesh = shape.mesh;
  shapes_.resize(scene.shapes.size());
  OfShape& result = shapes_[id.index()];
  TextureSeams& seams = result.seams;
  std::vector<const Texture*> textures;
  seams.period_one = true;
  for (const Texture* texture : textures_of(shape)) {
    seams.everywhere = seams.everywhere || texture->discontinuous_between_faces();
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

bool TextureDiscontinuities::add_face(const std::vector<const Texture*>& textures, const Mesh& mesh,
                                      FaceId face, OfShape& result) {
  Texture::Discontinuities lines;
  size_t of_one = 0;  // how many textures are discontinuous
  for (const Texture* texture : textures) {
    const size_t before = lines.inside.size();
    if (!add_face_discontinuities(*texture, mesh, face, kMost - std::min(count_, kMost), lines)) {
      count_ = kMost + 1;
      return false;
    }
    of_one += lines.inside.size() > before;
  }
  if (of_one > 1) leave_out_copies(lines.inside);
  result.seams.sides[face.index()] |= lines.sides;
  for (const Texture::Discontinuity& line : lines.inside) {
    result.segments.push_back({face, line.from, line.to});
  }
  count_ += lines.inside.size();
  return true;
}

const TextureSeams* TextureDiscontinuities::seams(ShapeId shape) const {
  if (shapes_.empty() || !shapes_[shape.index()].has_seams) return nullptr;
  return &shapes_[shape.index()].seams;
}

std::span<const FaceSegment> TextureDiscontinuities::segments(ShapeId shape) const {
  if (shapes_.empty()) return {};
  return shapes_[shape.index()].segments;
}

void check_texture_edges(const Scene& scene, std::vector<std::string>& warnings) {
  const TextureDiscontinuities lines(scene);
  if (lines.first_without().valid()) {
    throw InputError(
        scene.shape(lines.first_without()).where,
        fmt::format("{}: its texture is discontinuous along more than {} edges in all, which "
                    "derivatives with respect to what moves need: scale to_uv by less",
                    quoted_name(scene, lines.first_without()), TextureDiscontinuities::kMost));
  }
  if (lines.with_meridian().empty()) return;
  std::vector<std::string> names;
  for (const ShapeId shape : lines.with_meridian()) names.push_back(quoted_name(scene, shape));
  constexpr size_t kMostNames = 8;
  const size_t more = names.size() > kMostNames ? names.size() - kMostNames : 0;
  names.resize(names.size() - more);
  warnings.push_back(fmt::format(
      "derivatives with respect to what moves are incomplete: the textures of {}{} are "
      "discontinuous where the angle of a sphere or disk comes back to its beginning, which is no "
      "edge (where to_uv has whole numbers they are continuous)",
      join(names), more > 0 ? fmt::format(" and {} more", more) : ""));
}

}  // namespace limn
