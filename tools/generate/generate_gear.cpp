// Gears about the z axis: plates of one thickness with a bore, and windows between spokes.
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "tools/generate/generate_kinds.h"
#include "tools/generate/generate_parts.h"

namespace limn {
namespace {

// Radii are over the middle one of the teeth. As many windows as divide the teeth, or none; both
// even, so that half a turn leaves the gear as it is and its bounds stay about its axis.
struct Gear {
  int teeth, windows;
  double tooth;         // half of its height
  double bore;          // radius
  double inner, outer;  // of the windows
  double thickness;
};

// Columns go around, levels from the bore to the teeth, each with a vertex on either side.
class Plate {
 public:
  Plate(const Gear& gear, double h)
      : gear_(gear), columns_(gear.teeth * steps(2 * kPi / gear.teeth, h, 6)) {
    add_band(gear.bore, gear.inner, h, false);
    first_ = levels_.size();
    add_band(gear.inner, gear.outer, h, gear.windows > 0);
    last_ = levels_.size();
    add_band(gear.outer, 1, h, false);
    levels_.push_back(1);
  }

  Triangles triangles() {
    for (size_t band = 0; band + 1 < levels_.size(); ++band) {
      for (int c = 0; c < columns_; ++c) {
        if (is_open(c, band)) continue;
        for (const int side : {0, 1}) add_face(c, band, side);
        if (band == 0 || is_open(c, band - 1)) add_wall(at(c + 1, band), at(c, band));
        if (band + 2 == levels_.size() || is_open(c, band + 1)) {
          add_wall(at(c, band + 1), at(c + 1, band + 1));
        }
        if (is_open(c - 1, band)) add_wall(at(c, band), at(c, band + 1));
        if (is_open(c + 1, band)) add_wall(at(c + 1, band + 1), at(c + 1, band));
      }
    }
    return std::move(mesh_);
  }

 private:
  void add_band(double from, double to, double h, bool is_window) {
    // What windows leave open has no vertices.
    const int count = is_window ? 1 : steps(to - from, h, 1);
    for (int i = 0; i < count; ++i) levels_.push_back(from + (to - from) * i / count);
  }

  // Two thirds of each sector are a window.
  bool is_open(int column, size_t band) const {
    if (gear_.windows == 0 || band < first_ || band >= last_) return false;
    const int sector = columns_ / gear_.windows;
    const int in_sector = (column + columns_) % sector;
    return 6 * in_sector >= sector && 6 * (in_sector + 1) <= 5 * sector;
  }

  // The vertex below; that above is the next one.
  uint32_t at(int column, size_t level) {
    const auto place = std::pair((column + columns_) % columns_, level);
    const auto [known, is_new] =
        vertices_.emplace(place, static_cast<uint32_t>(mesh_.positions.size()));
    if (is_new) {
      const double angle = 2 * kPi * place.first / columns_;
      const double wave = std::clamp(1.6 * std::cos(gear_.teeth * angle), -1.0, 1.0);
      const double depth = std::max(0.0, (levels_[level] - gear_.outer) / (1 - gear_.outer));
      const double r = levels_[level] + gear_.tooth * wave * depth;
      for (const double side : {-0.5, 0.5}) {
        mesh_.positions.push_back(
            {r * std::cos(angle), r * std::sin(angle), side * gear_.thickness});
      }
    }
    return known->second;
  }

  void add_face(int c, size_t band, uint32_t side) {
    uint32_t a = at(c, band) + side, b = at(c, band + 1) + side;
    uint32_t d = at(c + 1, band) + side, e = at(c + 1, band + 1) + side;
    if (side == 0) {
      std::swap(a, d);
      std::swap(b, e);
    }
    add_quad(mesh_, a, b, e, d);
  }

  // From below to above, with the plate to the left of a to b as seen from above.
  void add_wall(uint32_t a, uint32_t b) { add_quad(mesh_, a, b, b + 1, a + 1); }

  Gear gear_;
  int columns_;
  size_t first_ = 0, last_ = 0;  // levels that have windows
  std::vector<double> levels_;
  std::map<std::pair<int, size_t>, uint32_t> vertices_;
  Triangles mesh_;
};

Triangles gear(const Gear& gear, int faces) {
  return with_faces(faces, 3 / std::sqrt(faces),
                    [&](double h) { return Plate(gear, h).triangles(); });
}

}  // namespace

Triangles make_gear(int faces) { return gear({12, 4, 0.15, 0.16, 0.32, 0.68, 0.16}, faces); }

Triangles make_pinion(int faces) { return gear({8, 0, 0.2, 0.26, 0.4, 0.66, 0.3}, faces); }

}  // namespace limn
