// Visible regions against brute force in exact integers, on a coarse grid where all is degenerate.
#include "limn/core/visible_regions.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include "limn/core/rng.h"

namespace limn {
namespace {

// The window is [-8, 8] x [-8, 8] at depth 1; corners of faces lie at whole numbers there, and
// inverse depths are whole eighths.
constexpr int kHalf = 8;
using Wide = __int128;

struct Point {
  int64_t x, y;
};
struct TestFace {
  Point corners[3];
  int64_t eighths[3];  // inverse depth
};

// a x + b y + c
struct Linear {
  Wide a, b, c;
  Linear operator-() const { return {-a, -b, -c}; }
};
// A convex polygon as lines that hold it on their positive side.
using Lines = std::vector<Linear>;

Linear left_of(Point p, Point q) {
  const int64_t a = p.y - q.y, b = q.x - p.x;
  return {a, b, -(a * p.x + b * p.y)};
}

struct Meeting {
  Wide x, y, w;
};
Meeting meet(const Linear& l, const Linear& m) {
  return {l.b * m.c - m.b * l.c, l.c * m.a - m.c * l.a, l.a * m.b - m.a * l.b};
}
int sign_at(const Linear& f, const Meeting& p) {
  const Wide v = f.a * p.x + f.b * p.y + f.c * p.w;
  const int s = v > 0 ? 1 : v < 0 ? -1 : 0;
  return p.w < 0 ? -s : s;
}

// The corners of what all lines hold, by looking at every pair of them: slow, and unlike what the
// library does.
std::vector<Meeting> corners_of(const Lines& lines) {
  std::vector<Meeting> corners;
  for (size_t i = 0; i < lines.size(); ++i) {
    for (size_t j = 0; j < i; ++j) {
      const Meeting p = meet(lines[i], lines[j]);
      if (p.w == 0) continue;
      if (std::all_of(lines.begin(), lines.end(),
                      [&](const Linear& l) { return sign_at(l, p) >= 0; }))
        corners.push_back(p);
    }
  }
  return corners;
}
// Whether a linear function is positive (or negative) somewhere in the polygon.
bool reaches(const std::vector<Meeting>& corners, const Linear& f, int sign) {
  return std::any_of(corners.begin(), corners.end(),
                     [&](const Meeting& p) { return sign_at(f, p) == sign; });
}
// Drops lines that bound nothing, so that lists stay short; `corners` are those of all lines.
Lines needed(const Lines& lines, const std::vector<Meeting>& corners) {
  Lines kept;
  for (const Linear& l : lines) {
    int on = 0;
    double first_x = 0, first_y = 0;
    for (const Meeting& p : corners) {
      if (sign_at(l, p) != 0) continue;
      const double x = double(p.x) / double(p.w), y = double(p.y) / double(p.w);
      if (on == 0) {
        first_x = x, first_y = y, on = 1;
      } else if (x != first_x || y != first_y) {
        on = 2;
      }
    }
    const bool repeated = std::any_of(kept.begin(), kept.end(), [&](const Linear& k) {
      return k.a * l.b == l.a * k.b && k.a * l.c == l.a * k.c && k.b * l.c == l.b * k.c;
    });
    if (on == 2 && !repeated) kept.push_back(l);
  }
  return kept;
}

double area_of(const std::vector<Meeting>& corners) {
  std::vector<std::pair<double, double>> p;
  double cx = 0, cy = 0;
  for (const Meeting& m : corners) {
    p.emplace_back(double(m.x) / double(m.w), double(m.y) / double(m.w));
    cx += p.back().first / double(corners.size());
    cy += p.back().second / double(corners.size());
  }
  std::sort(p.begin(), p.end(), [&](const auto& a, const auto& b) {
    return std::atan2(a.second - cy, a.first - cx) < std::atan2(b.second - cy, b.first - cx);
  });
  double twice = 0;
  for (size_t i = 0; i < p.size(); ++i) {
    const auto &a = p[i], &b = p[(i + 1) % p.size()];
    twice += (a.first - cx) * (b.second - cy) - (b.first - cx) * (a.second - cy);
  }
  return 0.5 * twice;
}

class Oracle {
 public:
  explicit Oracle(const std::vector<TestFace>& faces) : faces_(faces) {
    for (const TestFace& face : faces) {
      Point p[3] = {face.corners[0], face.corners[1], face.corners[2]};
      int64_t q[3] = {face.eighths[0], face.eighths[1], face.eighths[2]};
      int64_t area = twice_area(p);
      if (area < 0) std::swap(p[1], p[2]), std::swap(q[1], q[2]), area = -area;
      Lines lines{{1, 0, kHalf}, {-1, 0, kHalf}, {0, 1, kHalf}, {0, -1, kHalf}};
      Linear depth{0, 0, 0};
      for (int k = 0; k < 3; ++k) {
        const Linear l = left_of(p[k], p[(k + 1) % 3]);
        lines.push_back(l);
        const Wide at = q[(k + 2) % 3];  // the corner opposite, where l is the doubled area
        depth = {depth.a + l.a * at, depth.b + l.b * at, depth.c + l.c * at};
      }
      outlines_.push_back(lines);
      depths_.push_back(depth);
      areas_.push_back(area);
    }
  }

  // The area that shows a face: its outline without what others hide, piece by piece.
  double visible_area(size_t f) const {
    if (areas_[f] == 0) return 0;
    std::vector<Lines> pieces{outlines_[f]};
    for (size_t g = 0; g < faces_.size() && !pieces.empty(); ++g) {
      if (g == f || areas_[g] == 0) continue;
      // Over the product of both doubled areas, where f is farther.
      const Linear &p = depths_[f], &q = depths_[g];
      const Linear behind{q.a * areas_[f] - p.a * areas_[g], q.b * areas_[f] - p.b * areas_[g],
                          q.c * areas_[f] - p.c * areas_[g]};
      Lines hiding = outlines_[g];
      if (behind.a != 0 || behind.b != 0 || behind.c != 0) {
        hiding.push_back(behind);
      } else if (f < g) {
        continue;
      }
      pieces = subtract(pieces, hiding);
    }
    double area = 0;
    for (const Lines& piece : pieces) area += area_of(corners_of(piece));
    return area;
  }

 private:
  static int64_t twice_area(const Point* p) {
    return (p[1].x - p[0].x) * (p[2].y - p[0].y) - (p[1].y - p[0].y) * (p[2].x - p[0].x);
  }
  static std::vector<Lines> subtract(const std::vector<Lines>& pieces, const Lines& hiding) {
    std::vector<Lines> left;
    for (Lines piece : pieces) {
      Lines inside = piece;
      std::vector<Lines> outside;
      bool empty = false;
      for (const Linear& l : hiding) {
        const auto corners = corners_of(inside);
        if (!reaches(corners, l, 1)) empty = true;
        if (empty) break;
        if (!reaches(corners, l, -1)) continue;
        Lines out = inside;
        out.push_back(-l);
        inside.push_back(l);
        outside.push_back(needed(out, corners_of(out)));
        inside = needed(inside, corners_of(inside));
      }
      if (empty) {
        left.push_back(std::move(piece));
      } else {
        for (Lines& out : outside) left.push_back(std::move(out));
      }
    }
    return left;
  }

  const std::vector<TestFace>& faces_;
  std::vector<Lines> outlines_;
  std::vector<Linear> depths_;  // times the doubled area
  std::vector<Wide> areas_;     // doubled
};

const PlaneView& test_view() {
  static const PlaneView view({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, 1.0 / 64, 1e9);
  return view;
}
PlaneWindow test_window() { return {{0, 0}, kHalf, kHalf}; }

void insert(const TestFace& face, uint32_t label, VisibleRegions& regions) {
  std::array<Vec3d, 3> corners;
  for (int k = 0; k < 3; ++k) {
    const double z = 8.0 / double(face.eighths[k]);
    corners[k] = {double(face.corners[k].x) * z, double(face.corners[k].y) * z, z};
  }
  if (const auto seen = test_view().face(label, corners)) regions.insert(*seen);
}

double area_of(std::span<const PlanePoint> p) {
  double twice = 0;
  for (size_t i = 1; i + 1 < p.size(); ++i) {
    twice += (p[i].x - p[0].x) * (p[i + 1].y - p[0].y) - (p[i].y - p[0].y) * (p[i + 1].x - p[0].x);
  }
  return 0.5 * twice;
}

std::map<uint32_t, double> areas_of(const VisibleRegions& regions) {
  std::map<uint32_t, double> areas;
  regions.for_each([&](uint32_t label, std::span<const PlanePoint> corners) {
    EXPECT_GE(corners.size(), 3u);
    const double area = area_of(corners);
    EXPECT_GE(area, -1e-12);
    areas[label] += area;
  });
  return areas;
}

// How inverse depths are drawn.
enum class Depths { kFlat, kTilted };

std::vector<TestFace> random_faces(Rng& rng, int count, Depths depths) {
  const auto whole = [&](int from, int to) {
    return from + static_cast<int64_t>(rng.uniform() * (to - from + 1));
  };
  std::vector<TestFace> faces(count);
  for (TestFace& face : faces) {
    // Powers of two, so that corners are projected without rounding.
    const int64_t flat = int64_t{1} << whole(0, 3);
    const bool large = rng.uniform() < 0.3;
    const Point middle{whole(-8, 8), whole(-8, 8)};
    for (int k = 0; k < 3; ++k) {
      // Corners beyond the window, too; those beyond 16 are beyond its band, where points of sides
      // are rounded.
      const int reach = depths == Depths::kFlat ? 16 : 24;
      face.corners[k] = large ? Point{whole(-reach, reach), whole(-reach, reach)}
                              : Point{middle.x + whole(-4, 4), middle.y + whole(-4, 4)};
      face.eighths[k] = depths == Depths::kFlat ? flat : int64_t{1} << whole(0, 3);
    }
  }
  return faces;
}

// Lines through whole coordinates are exact. Others, where faces cross and of sides with ends
// beyond the band, go through two points of the grid, 2^-26 here, outside of the window: off by two
// steps along the window's four sides at most, each.
double tolerance(Depths depths, size_t faces) {
  return depths == Depths::kFlat ? 1e-9 : 4 * kHalf * 0x1p-25 * double(faces);
}

void check_windows(uint64_t seed, int windows, int most_faces, Depths depths) {
  size_t crossings = 0, largest = 0;
  for (int w = 0; w < windows; ++w) {
    Rng rng(seed, w, 0);
    const int count = 1 + static_cast<int>(rng.uniform() * most_faces);
    const std::vector<TestFace> faces = random_faces(rng, count, depths);
    std::vector<uint32_t> order(faces.size());
    for (uint32_t i = 0; i < order.size(); ++i) order[i] = i;
    const Oracle oracle(faces);
    std::vector<double> truth;
    for (size_t f = 0; f < faces.size(); ++f) truth.push_back(oracle.visible_area(f));
    VisibleRegions regions(test_window());
    for (int repeat = 0; repeat < 3; ++repeat) {
      regions.reset(test_window(), 100 * repeat);  // with grids of 1, 8 and 16 cells
      for (const uint32_t i : order) insert(faces[i], i, regions);
      auto areas = areas_of(regions);
      double sum = 0;
      for (const auto& [label, area] : areas) sum += area;
      ASSERT_NEAR(sum, 4 * kHalf * kHalf, 1e-9) << "window " << w;
      for (size_t f = 0; f < faces.size(); ++f) {
        ASSERT_NEAR(areas[static_cast<uint32_t>(f)], truth[f], tolerance(depths, faces.size()))
            << "window " << w << ", face " << f << " of " << count << ", order " << repeat;
      }
      crossings += regions.crossings();
      largest = std::max(largest, regions.size());
      for (size_t i = order.size(); i > 1; --i) {
        std::swap(order[i - 1], order[static_cast<size_t>(rng.uniform() * double(i))]);
      }
    }
  }
  EXPECT_EQ(crossings > 0, depths == Depths::kTilted);
  EXPECT_GT(largest, size_t(most_faces));
}

TEST(VisibleRegions, FlatFacesAreTheOracles) { check_windows(1, 2000, 12, Depths::kFlat); }
TEST(VisibleRegions, ManyFlatFacesAreTheOracles) { check_windows(2, 100, 40, Depths::kFlat); }
TEST(VisibleRegions, FacesThatCrossAreTheOracles) { check_windows(3, 4000, 8, Depths::kTilted); }

}  // namespace
}  // namespace limn
