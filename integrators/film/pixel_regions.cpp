// Faces in bins of tiles, and what is seen of them in every pixel.
#include "integrators/film/pixel_regions.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "limn/core/error.h"
#include "limn/core/exposure.h"
#include "limn/core/parallel.h"
#include "limn/core/shading.h"

namespace limn {
namespace {

// The film's plane: (x, y) in pixels of the full film.
PlaneView view_of(const Camera& camera) {
  const auto through = [&](double x, double y) {
    const Vec3d d = camera.ray<double>(x, y).direction;
    return d / dot(d, value(camera.forward));
  };
  const Vec3d a = through(0, 0);
  const Vec3d u = (through(camera.width, 0) - a) / double(camera.width);
  const Vec3d v = (through(0, camera.height) - a) / double(camera.height);
  return {value(camera.origin), u, v, a, camera.near_clip, camera.far_clip};
}

constexpr const char* kInstead = "points \"random\"";

constexpr size_t kChunk = 4096;  // faces at a time; not tuned
// Of a pixel: a hundred megabytes. Thin faces behind each other, all over one pixel, make as many
// as their number squared.
constexpr size_t kMostRegions = 1 << 18;

// Whole pixels that may see [from, to], which may be off by rounding.
std::pair<int, int> pixels_that_see(double from, double to, int first, int last) {
  constexpr double kRounding = 0x1p-20;  // pixels; films are far smaller than 2^30
  return {static_cast<int>(std::clamp<double>(std::floor(from - kRounding), first, last)),
          static_cast<int>(std::clamp<double>(std::floor(to + kRounding) + 1, first, last))};
}

// The faces of every pixel of a tile, nearest first.
class PixelLists {
 public:
  struct Entry {
    uint32_t face;   // an index
    double nearest;  // inverse depth that it does not exceed
  };
  // In the faces' order where they are equally near.
  PixelLists(const std::vector<SeenFace>& faces, const Tile& tile)
      : tile_(tile), first_(static_cast<size_t>(tile.y1 - tile.y0) * (tile.x1 - tile.x0) + 2, 0) {
    std::vector<Entry> order(faces.size());
    for (uint32_t f = 0; f < faces.size(); ++f) {
      order[f] = {f, faces[f].nearest + faces[f].depth_error};
      for_each_pixel(faces[f], [&](size_t pixel) { ++first_[pixel + 2]; });
    }
    std::sort(order.begin(), order.end(), [](const Entry& a, const Entry& b) {
      return a.nearest != b.nearest ? a.nearest > b.nearest : a.face < b.face;
    });
    for (size_t i = 2; i < first_.size(); ++i) first_[i] += first_[i - 1];
    entries_.resize(first_.back());
    for (const Entry& entry : order) {
      for_each_pixel(faces[entry.face],
                     [&](size_t pixel) { entries_[first_[pixel + 1]++] = entry; });
    }
  }
  std::span<const Entry> of(int x, int y) const {
    const size_t pixel = index(x, y);
    return std::span(entries_).subspan(first_[pixel], first_[pixel + 1] - first_[pixel]);
  }

 private:
  size_t index(int x, int y) const {
    return static_cast<size_t>(y - tile_.y0) * (tile_.x1 - tile_.x0) + (x - tile_.x0);
  }
  template <class Visit>
  void for_each_pixel(const SeenFace& face, const Visit& visit) const {
    const auto [x0, x1] = pixels_that_see(face.lower.x, face.upper.x, tile_.x0, tile_.x1);
    const auto [y0, y1] = pixels_that_see(face.lower.y, face.upper.y, tile_.y0, tile_.y1);
    for (int y = y0; y < y1; ++y) {
      for (int x = x0; x < x1; ++x) visit(index(x, y));
    }
  }

  const Tile& tile_;
  std::vector<size_t> first_;  // entry of every pixel, and the end
  std::vector<Entry> entries_;
};

}  // namespace

void PixelRegions::check(const Scene& scene) {
  const Film& film = scene.film;
  check_still(scene, kRegionsUser);
  if (!scene.camera.is_pinhole()) {
    throw InputError({scene.file},
                     fmt::format("{} needs a pinhole, a sensor of type \"perspective\" ({} takes "
                                 "every sensor)",
                                 kRegionsUser, kInstead));
  }
  if (film.filter.kind == Filter::Kind::kBox && film.filter.radius == 0.5) return;
  throw InputError(film.where,
                   fmt::format("{} needs a box filter, <rfilter type=\"box\"/>: a pixel is what is "
                               "seen within it ({} takes every filter)",
                               kRegionsUser, kInstead));
}

PixelRegions::PixelRegions(const Scene& scene, const CoincidentFaces& faces, int threads)
    : scene_((check(scene), scene)),
      copies_(faces.copies),
      overlaps_(faces.overlaps),
      view_(view_of(scene.camera)),
      tiles_(make_tiles(scene.film)) {
  for (const Shape& shape : scene.shapes) {
    first_label_.push_back(labels_);
    labels_ += static_cast<uint32_t>(shape.mesh.faces.size());
  }
  bin_faces(threads);
}

size_t PixelRegions::tile_of(int x, int y) const {
  const Film& film = scene_.film;
  const int columns = (film.crop_width + kTileSize - 1) / kTileSize;
  return static_cast<size_t>((y - film.crop_y) / kTileSize) * columns +
         (x - film.crop_x) / kTileSize;
}

bool PixelRegions::for_each_pixel(size_t t, const std::atomic<bool>* interrupted,
                                  const Wanted& wanted, const Visit& visit) const {
  const Tile& tile = tiles_[t];
  const std::vector<SeenFace> faces = seen_in(t);
  const PixelLists lists(faces, tile);
  const bool ruled =
      std::any_of(faces.begin(), faces.end(), [](const SeenFace& f) { return f.ruled; });
  VisibleRegions regions({});
  if (ruled) regions.set_rule([&](uint32_t a, uint32_t b) { return rule(a, b); });
  for (int y = tile.y0; y < tile.y1; ++y) {
    for (int x = tile.x0; x < tile.x1; ++x) {
      if (interrupted && interrupted->load(std::memory_order_relaxed)) return false;
      if (!wanted(x, y)) continue;
      regions.reset({{x + 0.5, y + 0.5}, 0.5 + kPixelMargin, 0.5 + kPixelMargin});
      for (const auto& [f, nearest] : lists.of(x, y)) {
        if (!ruled && nearest < regions.hidden_below()) break;
        regions.insert(faces[f]);
        if (regions.size() > kMostRegions) refuse(x, y);
      }
      visit(x, y, regions);
    }
  }
  return true;
}

std::vector<SeenFace> PixelRegions::seen_in(size_t t) const {
  std::vector<SeenFace> faces;
  faces.reserve(first_binned_[t + 1] - first_binned_[t]);
  for (size_t i = first_binned_[t]; i < first_binned_[t + 1]; ++i) {
    faces.push_back(*see(binned_[i]));
  }
  return faces;
}

FaceRef PixelRegions::face_of(uint32_t label) const {
  if (label == VisibleRegions::kNothing) return {};
  const auto shape = std::upper_bound(first_label_.begin(), first_label_.end(), label) - 1;
  return {ShapeId(static_cast<uint32_t>(shape - first_label_.begin())), FaceId(label - *shape)};
}

std::optional<SeenFace> PixelRegions::see(uint32_t label) const {
  const FaceRef face = face_of(label);
  auto seen = view_.face(label, face_corners<double>(scene_.shape(face.shape).mesh, face.face));
  if (seen) seen->ruled = !overlaps_.of(face).empty();
  return seen;
}

// Of faces in one plane that which a ray would meet is seen.
std::optional<bool> PixelRegions::rule(uint32_t a, uint32_t b) const {
  const FaceRef first = face_of(a), second = face_of(b);
  if (!overlaps_.contains(first, second)) return {};
  const Vec3d corner = face_corners<double>(scene_.shape(first.shape).mesh, first.face)[0];
  return is_hit_first(scene_, first, second, corner - value(scene_.camera.origin));
}

void PixelRegions::refuse(int x, int y) const {
  throw InputError(scene_.film.where,
                   fmt::format("{}: pixel ({}, {}) shows more than {} regions ({} takes it)",
                               kRegionsUser, x, y, kMostRegions, kInstead));
}

// Whether a ray from the camera can meet the face: of faces in one place one alone.
bool PixelRegions::is_met(uint32_t label) const {
  const FaceRef face = face_of(label);
  const Shape& shape = scene_.shape(face.shape);
  if (scene_.hide_emitters && shape.is_emitter) return false;
  if (!has_area(shape.mesh, shape.mesh.face(face.face))) return false;
  if (copies_.empty()) return true;
  const Vec3d towards =
      face_corners<double>(shape.mesh, face.face)[0] - value(scene_.camera.origin);
  return copies_.met(face, towards, scene_.hide_emitters) == face;
}

void PixelRegions::bin_faces(int threads) {
  struct Found {
    uint32_t label;
    int x0, x1, y0, y1;  // tiles
  };
  const Film& film = scene_.film;
  const int columns = (film.crop_width + kTileSize - 1) / kTileSize;
  const auto tiles_of = [](std::pair<int, int> pixels, int origin) {
    return std::pair((pixels.first - origin) / kTileSize,
                     (pixels.second - origin + kTileSize - 1) / kTileSize);
  };
  std::vector<std::vector<Found>> found((labels_ + kChunk - 1) / kChunk);
  parallel_for(found.size(), threads, [&](size_t c) {
    const auto end = static_cast<uint32_t>(std::min<size_t>(labels_, (c + 1) * kChunk));
    for (auto label = static_cast<uint32_t>(c * kChunk); label < end; ++label) {
      const auto seen = see(label);
      if (!seen || !is_met(label)) continue;
      const auto x =
          pixels_that_see(seen->lower.x, seen->upper.x, film.crop_x, film.crop_x + film.crop_width);
      const auto y = pixels_that_see(seen->lower.y, seen->upper.y, film.crop_y,
                                     film.crop_y + film.crop_height);
      if (x.first >= x.second || y.first >= y.second) continue;
      const auto [x0, x1] = tiles_of(x, film.crop_x);
      const auto [y0, y1] = tiles_of(y, film.crop_y);
      found[c].push_back({label, x0, x1, y0, y1});
    }
  });
  const auto for_every_tile = [&](const auto& visit) {
    for (const auto& chunk : found) {
      for (const Found& f : chunk) {
        for (int y = f.y0; y < f.y1; ++y) {
          for (int x = f.x0; x < f.x1; ++x) visit(static_cast<size_t>(y) * columns + x, f.label);
        }
      }
    }
  };
  first_binned_.resize(tiles_.size() + 1);
  for_every_tile([&](size_t tile, uint32_t) { ++first_binned_[tile + 1]; });
  for (size_t t = 0; t < tiles_.size(); ++t) first_binned_[t + 1] += first_binned_[t];
  binned_.resize(first_binned_.back());
  std::vector<size_t> next(first_binned_.begin(), first_binned_.end() - 1);
  for_every_tile([&](size_t tile, uint32_t label) { binned_[next[tile]++] = label; });
}

}  // namespace limn
