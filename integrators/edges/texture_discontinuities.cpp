// Which textures are discontinuous where: faces are cut in four until texture coordinates are
// linear over each part.
#include "integrators/edges/texture_discontinuities.h"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <optional>

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

using Pair = std::array<double, 2>;

Pair middle(const Pair& a, const Pair& b) { return {0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])}; }

// A point of the face: barycentric and texture coordinates.
struct Point {
  Pair b, uv;
};
using Part = std::array<Point, 3>;

class CurvedFace {
 public:
  CurvedFace(const Texture& texture, const Mesh& mesh, FaceId face, size_t most,
             Texture::Discontinuities& lines)
      : texture_(texture), mesh_(mesh), face_(face), most_(most), lines_(lines) {
    angle_ = mesh.uv_source == UvSource::kSphere ? 0 : 1;
    turn_ = uv({1.0 / 3, 1.0 / 3})[angle_];
    for (int k = 0; k < 3; ++k) {
      const Vec3f& place = mesh.uv_places[mesh.uv_ids[face.index()][k]];
      if (std::hypot(double{place.x}, double{place.y}) < 1e-6) pole_ = Pair{kCorners[k]};
    }
  }

  bool add() {
    const auto sides = add({at(kCorners[0]), at(kCorners[1]), at(kCorners[2])}, 0);
    if (sides) lines_.sides |= *sides;
    return sides.has_value();
  }

 private:
  static constexpr int kMostCuts = 5;
  static constexpr Pair kCorners[3] = {{0, 0}, {1, 0}, {0, 1}};

  Pair uv(const Pair& b) const { return texture_point<double>(mesh_, face_, b).uv; }
  Point at(const Pair& b) const {
    Point point{b, uv(b)};
    point.uv[angle_] += std::round(turn_ - point.uv[angle_]);  // an angle goes on within the face
    return point;
  }

  // How far lines are off segments, in barycentric coordinates of the face.
  static double off_lines(const Part& part, const Part& middles, int cuts) {
    double most = 0;
    for (int c = 0; c < 2; ++c) {
      const auto [least, greatest] = std::minmax({part[0].uv[c], part[1].uv[c], part[2].uv[c]});
      for (int k = 0; k < 3; ++k) {
        const double off = middles[k].uv[c] - 0.5 * (part[k].uv[c] + part[(k + 1) % 3].uv[c]);
        if (off != 0) most = std::max(most, std::fabs(off) / (greatest - least));
      }
    }
    return std::ldexp(most, -cuts);
  }

  // Returns the sides along which it is discontinuous; nothing if there are too many lines.
  std::optional<uint8_t> add(Part part, int cuts) {
    // A pole has no angle: it takes the mean of the others.
    for (int k = 0; k < 3; ++k) {
      if (pole_ && part[k].b == *pole_)
        part[k].uv[angle_] = 0.5 * (part[(k + 1) % 3].uv[angle_] + part[(k + 2) % 3].uv[angle_]);
    }
    Part middles;
    for (int k = 0; k < 3; ++k) middles[k] = at(middle(part[k].b, part[(k + 1) % 3].b));
    if (cuts < kMostCuts && off_lines(part, middles, cuts) > kOffCurve)
      return add_quarters(part, middles, cuts + 1);
    Texture::Discontinuities found;
    if (!texture_.add_discontinuities({part[0].uv, part[1].uv, part[2].uv}, most_, found))
      return {};
    const auto on_face = [&](const Pair& at) {
      Pair b = part[0].b;
      for (int c = 0; c < 2; ++c) {
        b[c] += at[0] * (part[1].b[c] - part[0].b[c]) + at[1] * (part[2].b[c] - part[0].b[c]);
      }
      return b;
    };
    for (const Texture::Discontinuity& line : found.inside) {
      lines_.inside.push_back({on_face(line.from), on_face(line.to)});
    }
    if (lines_.inside.size() > most_) return {};
    return found.sides;
  }

  // middles[k]: of the side from corner k to the next.
  std::optional<uint8_t> add_quarters(const Part& part, const Part& middles, int cuts) {
    const auto inner = add({middles[0], middles[1], middles[2]}, cuts);
    uint8_t sides = 7;
    for (int k = 0; k < 3; ++k) {
      // At corner k: to the middle of its side, and of the side before.
      const int before = (k + 2) % 3;
      const auto outer = add({part[k], middles[k], middles[before]}, cuts);
      if (!inner || !outer) return {};
      if ((*outer & 1) == 0) sides &= ~(1 << k);
      if ((*outer & 4) == 0) sides &= ~(1 << before);
      // The cut between both parts, of the inner one the side from middle `before` to middle k.
      if ((*outer & 2) != 0 || (*inner >> before & 1) != 0)
        lines_.inside.push_back({middles[before].b, middles[k].b});
    }
    return sides;
  }

  const Texture& texture_;
  const Mesh& mesh_;
  FaceId face_;
  size_t most_;
  Texture::Discontinuities& lines_;
  int angle_;
  double turn_;               // of the middle
  std::optional<Pair> pole_;  // a corner on the axis
};

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
  if (!is_linear(mesh.uv_source) && !seams.period_one) with_meridian_.push_back(id);
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

bool add_face_discontinuities(const Texture& texture, const Mesh& mesh, FaceId face, size_t most,
                              Texture::Discontinuities& lines) {
  if (!is_linear(mesh.uv_source)) return CurvedFace(texture, mesh, face, most, lines).add();
  const FaceIndices& ids = mesh.uv_ids[face.index()];
  std::array<Pair, 3> uv;
  for (int k = 0; k < 3; ++k) {
    const Vec3f& place = mesh.uv_places[ids[k]];
    uv[k] = {place.x, place.y};
  }
  return texture.add_discontinuities(uv, most, lines);
}

}  // namespace limn
