// The visible regions of every pixel, as they are looked up.
#include "integrators/film/film_regions.h"

#include <algorithm>
#include <cmath>

#include "integrators/film/pixel_regions.h"
#include "limn/core/parallel.h"
#include "limn/integrators/run.h"

namespace limn {
namespace {

constexpr RegionsUser kUser{"the exact film", "film \"rays\""};

}  // namespace

void FilmRegions::check(const Scene& scene) { PixelRegions::check(scene, kUser); }

FilmRegions::FilmRegions(const Scene& scene, int threads, const std::atomic<bool>* interrupted)
    : film_(scene.film) {
  const Stopwatch watch;
  faces_ = std::make_shared<CoincidentFaces>(scene, threads);
  const PixelRegions pixels(scene, *faces_, threads, kUser);
  tiles_.resize(pixels.tiles().size());
  parallel_for(tiles_.size(), threads, [&](size_t t) {
    Tile& tile = tiles_[t];
    const bool done = pixels.for_each_pixel(
        t, interrupted, [](int, int) { return true; },
        [&](int, int, const VisibleRegions& regions) { append(pixels, regions, tile); });
    if (done) {
      tile.first_region.push_back(static_cast<uint32_t>(tile.regions.size()));
    } else {
      tile = {};
    }
  });
  seconds_ = watch.seconds();
}

namespace {

void append_box(std::span<const PlanePoint> corners, std::vector<PlanePoint>& to) {
  PlanePoint lower = corners[0], upper = corners[0];
  for (const PlanePoint& p : corners) {
    lower = {std::min(lower.x, p.x), std::min(lower.y, p.y)};
    upper = {std::max(upper.x, p.x), std::max(upper.y, p.y)};
  }
  to.push_back(lower);
  to.push_back(upper);
}

}  // namespace

void FilmRegions::append(const PixelRegions& pixels, const VisibleRegions& regions, Tile& tile) {
  tile.first_region.push_back(static_cast<uint32_t>(tile.regions.size()));
  tile.crossings += regions.crossings();
  const bool whole = regions.size() == 1;
  regions.for_each([&](uint32_t label, std::span<const PlanePoint> corners) {
    if (!whole) append_box(corners, tile.corners);
    const auto first = static_cast<uint32_t>(tile.corners.size());
    if (!whole) tile.corners.insert(tile.corners.end(), corners.begin(), corners.end());
    tile.regions.push_back(
        {pixels.face_of(label), first, static_cast<uint32_t>(tile.corners.size()) - first});
  });
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

// Along which part of the edge a region is seen beside it.
struct Stretch {
  double from, to;
  FaceRef face;
  bool own;
};

// What is beside the edge between neighbouring ends of stretches.
std::vector<FilmRegions::SeenPart> parts_of(std::vector<Stretch> stretches,
                                            std::vector<double> ends) {
  std::sort(ends.begin(), ends.end());
  std::sort(stretches.begin(), stretches.end(),
            [](const Stretch& a, const Stretch& b) { return a.from < b.from; });
  std::vector<FilmRegions::SeenPart> parts;
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

}  // namespace

std::vector<FilmRegions::SeenPart> FilmRegions::seen_parts(const PlanePoint& from,
                                                           const PlanePoint& to,
                                                           std::span<const FaceRef> around) const {
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
  return parts_of(std::move(stretches), std::move(ends));
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
