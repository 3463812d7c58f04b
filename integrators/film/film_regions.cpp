// Faces in bins of pixels, and the visible regions of each.
#include "integrators/film/film_regions.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "integrators/estimates/tiles.h"
#include "limn/core/error.h"
#include "limn/core/parallel.h"
#include "limn/core/shading.h"
#include "limn/integrators/run.h"

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

constexpr size_t kChunk = 4096;  // faces at a time; not tuned
// Of a pixel: a hundred megabytes. Thin faces behind each other, all over one pixel, make as many
// as their number squared.
constexpr size_t kMostRegions = 1 << 18;

}  // namespace

void FilmRegions::check(const Film& film) {
  if (film.filter.kind == Filter::Kind::kBox && film.filter.radius == 0.5) return;
  throw InputError(film.where,
                   "the exact film needs a box filter, <rfilter type=\"box\"/>: a pixel is what is "
                   "seen within it (--film rays takes every filter)");
}

namespace {

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

// Which faces may be seen in which tile, and the regions of a tile.
class FilmRegions::Builder {
 public:
  Builder(const Scene& scene, const FacesInPlace& faces, std::span<const limn::Tile> tiles,
          int threads)
      : scene_(scene),
        copies_(faces.copies),
        overlaps_(faces.overlaps),
        view_(view_of(scene.camera)),
        tiles_(tiles) {
    for (const Shape& shape : scene.shapes) {
      first_label_.push_back(labels_);
      labels_ += static_cast<uint32_t>(shape.mesh.faces.size());
    }
    bin_faces(threads);
  }

  // Empty if interrupted meanwhile.
  Tile build(size_t t, const std::atomic<bool>* interrupted) const {
    const limn::Tile& tile = tiles_[t];
    const std::vector<SeenFace> faces = seen_in(t);
    const PixelLists lists(faces, tile);
    const bool ruled =
        std::any_of(faces.begin(), faces.end(), [](const SeenFace& f) { return f.ruled; });
    Tile result;
    VisibleRegions regions({});
    if (ruled) regions.set_rule([&](uint32_t a, uint32_t b) { return rule(a, b); });
    for (int y = tile.y0; y < tile.y1; ++y) {
      for (int x = tile.x0; x < tile.x1; ++x) {
        if (interrupted && interrupted->load(std::memory_order_relaxed)) return {};
        regions.reset({{x + 0.5, y + 0.5}, 0.5, 0.5});
        for (const auto& [f, nearest] : lists.of(x, y)) {
          if (!ruled && nearest < regions.hidden_below()) break;
          regions.insert(faces[f]);
          if (regions.size() > kMostRegions) refuse(x, y);
        }
        append(regions, result);
      }
    }
    result.first_region.push_back(static_cast<uint32_t>(result.regions.size()));
    return result;
  }

 private:
  std::vector<SeenFace> seen_in(size_t t) const {
    std::vector<SeenFace> faces;
    faces.reserve(first_binned_[t + 1] - first_binned_[t]);
    for (size_t i = first_binned_[t]; i < first_binned_[t + 1]; ++i) {
      faces.push_back(*see(binned_[i]));
    }
    return faces;
  }

  FaceRef face_of(uint32_t label) const {
    if (label == VisibleRegions::kNothing) return {};
    const auto shape = std::upper_bound(first_label_.begin(), first_label_.end(), label) - 1;
    return {ShapeId(static_cast<uint32_t>(shape - first_label_.begin())), FaceId(label - *shape)};
  }

  std::optional<SeenFace> see(uint32_t label) const {
    const FaceRef face = face_of(label);
    auto seen = view_.face(label, face_corners<double>(scene_.shape(face.shape).mesh, face.face));
    if (seen) seen->ruled = !overlaps_.of(face).empty();
    return seen;
  }
  // Of faces in one plane that which a ray would meet is seen.
  std::optional<bool> rule(uint32_t a, uint32_t b) const {
    const FaceRef first = face_of(a), second = face_of(b);
    if (!overlaps_.contains(first, second)) return {};
    const Vec3d corner = face_corners<double>(scene_.shape(first.shape).mesh, first.face)[0];
    return is_met_first(scene_, first, second, corner - value(scene_.camera.origin));
  }

  [[noreturn]] void refuse(int x, int y) const {
    throw InputError(scene_.film.where,
                     fmt::format("the exact film: pixel ({}, {}) shows more than {} regions "
                                 "(--film rays takes it)",
                                 x, y, kMostRegions));
  }

  // Whether a ray from the camera can meet the face: of faces in one place one alone.
  bool is_met(uint32_t label) const {
    const FaceRef face = face_of(label);
    const Shape& shape = scene_.shape(face.shape);
    if (scene_.hide_emitters && shape.is_emitter) return false;
    if (!has_area(shape.mesh, shape.mesh.face(face.face))) return false;
    if (copies_.empty()) return true;
    const Vec3d towards =
        face_corners<double>(shape.mesh, face.face)[0] - value(scene_.camera.origin);
    return copies_.met(face, towards, scene_.hide_emitters) == face;
  }

  void bin_faces(int threads) {
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
        const auto x = pixels_that_see(seen->lower.x, seen->upper.x, film.crop_x,
                                       film.crop_x + film.crop_width);
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

  void append(const VisibleRegions& regions, Tile& tile) const {
    tile.first_region.push_back(static_cast<uint32_t>(tile.regions.size()));
    tile.crossings += regions.crossings();
    const bool whole = regions.size() == 1;
    regions.for_each([&](uint32_t label, std::span<const PlanePoint> corners) {
      if (!whole) append_box(corners, tile.corners);
      const auto first = static_cast<uint32_t>(tile.corners.size());
      if (!whole) tile.corners.insert(tile.corners.end(), corners.begin(), corners.end());
      tile.regions.push_back(
          {face_of(label), first, static_cast<uint32_t>(tile.corners.size()) - first});
    });
  }

  static void append_box(std::span<const PlanePoint> corners, std::vector<PlanePoint>& to) {
    PlanePoint lower = corners[0], upper = corners[0];
    for (const PlanePoint& p : corners) {
      lower = {std::min(lower.x, p.x), std::min(lower.y, p.y)};
      upper = {std::max(upper.x, p.x), std::max(upper.y, p.y)};
    }
    to.push_back(lower);
    to.push_back(upper);
  }

  const Scene& scene_;
  const FaceCopies& copies_;
  const FaceOverlaps& overlaps_;
  PlaneView view_;
  std::span<const limn::Tile> tiles_;
  std::vector<uint32_t> first_label_;  // of each shape: labels are faces, counted through
  uint32_t labels_ = 0;
  // Labels in order: of tile t those from first_binned_[t] to first_binned_[t + 1].
  std::vector<size_t> first_binned_;
  std::vector<uint32_t> binned_;
};

FilmRegions::FilmRegions(const Scene& scene, int threads, const std::atomic<bool>* interrupted)
    : film_(scene.film) {
  check(film_);
  const Stopwatch watch;
  const std::vector<limn::Tile> tiles = make_tiles(film_);
  faces_ = std::make_shared<FacesInPlace>(scene, threads);
  const Builder builder(scene, *faces_, tiles, threads);
  tiles_.resize(tiles.size());
  parallel_for(tiles.size(), threads, [&](size_t t) { tiles_[t] = builder.build(t, interrupted); });
  seconds_ = watch.seconds();
}

template <class Visit>
void FilmRegions::for_each_region(int x, int y, const Visit& visit) const {
  const int left = x - film_.crop_x, top = y - film_.crop_y;
  const int columns = (film_.crop_width + kTileSize - 1) / kTileSize;
  const int column = left / kTileSize;
  const Tile& tile = tiles_[static_cast<size_t>(top / kTileSize) * columns + column];
  const int width = std::min(kTileSize, film_.crop_width - column * kTileSize);
  const size_t pixel = static_cast<size_t>(top % kTileSize) * width + left % kTileSize;
  if (tile.first_region.empty()) return;  // interrupted
  const std::array<PlanePoint, 4> whole = {
      {{double(x), double(y)}, {x + 1.0, double(y)}, {x + 1.0, y + 1.0}, {double(x), y + 1.0}}};
  for (uint32_t r = tile.first_region[pixel]; r < tile.first_region[pixel + 1]; ++r) {
    const Region& region = tile.regions[r];
    if (region.corner_count == 0) {
      visit(region.face, whole[0], whole[2], std::span<const PlanePoint>(whole));
      continue;
    }
    const PlanePoint* first = &tile.corners[region.first_corner];
    visit(region.face, first[-2], first[-1],
          std::span<const PlanePoint>(first, region.corner_count));
  }
}

namespace {

// How far inside a convex polygon a point is [pixels], negative outside; or something less than
// `least`, if it is less.
double depth_in(std::span<const PlanePoint> corners, const PlanePoint& p, double least) {
  double depth = 1e300;
  for (size_t i = 0; i < corners.size() && depth >= least; ++i) {
    const PlanePoint &a = corners[i], &b = corners[(i + 1) % corners.size()];
    const double dx = b.x - a.x, dy = b.y - a.y;
    depth = std::min(depth, (dx * (p.y - a.y) - dy * (p.x - a.x)) / std::sqrt(dx * dx + dy * dy));
  }
  return depth;
}

bool in_box(const PlanePoint& lower, const PlanePoint& upper, const PlanePoint& p, double margin) {
  return p.x >= lower.x - margin && p.x <= upper.x + margin && p.y >= lower.y - margin &&
         p.y <= upper.y + margin;
}

// A region may be off by the rounding of its lines to the grid, a billionth of a pixel, and film
// positions by that of the projection.
constexpr double kNear = 0x1p-20;

}  // namespace

FaceRef FilmRegions::face_at(int x, int y, double film_x, double film_y) const {
  const PlanePoint p{film_x, film_y};
  FaceRef face;
  double deepest = -1e300;
  for_each_region(x, y,
                  [&](FaceRef region_face, const PlanePoint& lower, const PlanePoint& upper,
                      std::span<const PlanePoint> corners) {
                    if (!in_box(lower, upper, p, kNear)) return;
                    const double depth = depth_in(corners, p, deepest);
                    if (!(depth > deepest)) return;
                    deepest = depth;
                    face = region_face;
                  });
  return face;
}

namespace {

// Keeps what is not farther than kNear outside of a convex polygon; false if that is nothing.
bool clip_to(std::span<const PlanePoint> corners, const PlanePoint& from, const PlanePoint& to,
             double& s0, double& s1) {
  for (size_t i = 0; i < corners.size(); ++i) {
    const PlanePoint &a = corners[i], &b = corners[(i + 1) % corners.size()];
    const double dx = b.x - a.x, dy = b.y - a.y, size = std::hypot(dx, dy);
    const double at_from = dx * (from.y - a.y) - dy * (from.x - a.x) + kNear * size;
    const double at_to = dx * (to.y - a.y) - dy * (to.x - a.x) + kNear * size;
    if (at_from < 0 && at_to < 0) return false;
    const double s = at_from / (at_from - at_to);
    if (at_from < 0) s0 = std::max(s0, s);
    if (at_to < 0) s1 = std::min(s1, s);
  }
  return s0 < s1;
}

// The pixels [first, last) of a film's row or column that [from, to] reaches.
std::pair<int, int> pixels_of(double from, double to, int first, int size) {
  const double low = std::min(from, to) - kNear, high = std::max(from, to) + kNear;
  return {static_cast<int>(std::clamp<double>(std::floor(low), first, first + size)),
          static_cast<int>(std::clamp<double>(std::floor(high) + 1, first, first + size))};
}

}  // namespace

std::vector<FilmRegions::SeenPart> FilmRegions::seen_parts(const PlanePoint& from,
                                                           const PlanePoint& to,
                                                           std::span<const FaceRef> around) const {
  // Along which part of the edge a region is seen beside it.
  struct Stretch {
    double from, to;
    FaceRef face;
    bool own;
  };
  std::vector<Stretch> stretches;
  std::vector<double> ends;
  const auto [y0, y1] = pixels_of(from.y, to.y, film_.crop_y, film_.crop_height);
  for (int y = y0; y < y1; ++y) {
    // The part of the edge in this row.
    double t0 = 0, t1 = 1;
    if (const double dy = to.y - from.y; dy != 0) {
      const double a = (y - kNear - from.y) / dy, b = (y + 1 + kNear - from.y) / dy;
      t0 = std::clamp(std::min(a, b), 0.0, 1.0);
      t1 = std::clamp(std::max(a, b), 0.0, 1.0);
    }
    const auto column = [&](double t) { return from.x + (to.x - from.x) * t; };
    const auto [x0, x1] = pixels_of(column(t0), column(t1), film_.crop_x, film_.crop_width);
    for (int x = x0; x < x1; ++x) {
      for_each_region(x, y, [&](FaceRef face, const PlanePoint&, const PlanePoint&, auto corners) {
        Stretch s{0, 1, face, std::find(around.begin(), around.end(), face) != around.end()};
        if (!clip_to(corners, from, to, s.from, s.to)) return;
        stretches.push_back(s);
        ends.push_back(s.from);
        ends.push_back(s.to);
      });
    }
  }
  std::sort(ends.begin(), ends.end());
  std::sort(stretches.begin(), stretches.end(),
            [](const Stretch& a, const Stretch& b) { return a.from < b.from; });
  std::vector<SeenPart> parts;
  size_t begun = 0, over = 0;  // stretches that have begun; before `over` all have ended
  for (size_t i = 0; i + 1 < ends.size(); ++i) {
    if (ends[i] == ends[i + 1]) continue;
    while (begun < stretches.size() && stretches[begun].from <= ends[i]) ++begun;
    while (over < begun && stretches[over].to <= ends[i]) ++over;
    bool seen = false, ambiguous = false;
    std::optional<FaceRef> other;
    for (size_t k = over; k < begun; ++k) {
      const Stretch& s = stretches[k];
      if (s.to <= ends[i]) continue;
      seen = seen || s.own;
      if (s.own) continue;
      ambiguous = ambiguous || (other && *other != s.face);
      other = s.face;
    }
    if (!seen) continue;
    std::optional<FaceRef> beside = other.value_or(FaceRef{});
    if (ambiguous) beside.reset();
    if (!parts.empty() && parts.back().to == ends[i] && parts.back().beside == beside) {
      parts.back().to = ends[i + 1];
    } else {
      parts.push_back({ends[i], ends[i + 1], beside});
    }
  }
  return parts;
}

size_t FilmRegions::size() const {
  size_t sum = 0;
  for (const Tile& tile : tiles_) sum += tile.regions.size();
  return sum;
}
size_t FilmRegions::crossings() const {
  size_t sum = 0;
  for (const Tile& tile : tiles_) sum += tile.crossings;
  return sum;
}

}  // namespace limn
