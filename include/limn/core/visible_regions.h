#pragma once
// The visible faces from a point through a window, as convex regions that show one face each, or
// nothing. Based on Zhou, Wu, Ramamoorthi, Yan 2021 (Algorithm 1), with lines in place of points.
// A region is a ring of lines, each through two grid points. Its corners are never rounded, and
// all side-of-line tests are exact. So regions are convex and cover the window without gap or
// overlap.
#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>

#include "limn/core/vec.h"

namespace limn {

// A point of the projection plane.
struct PlanePoint {
  double x = 0, y = 0;
};

// a x + b y + c
struct PlaneFunction {
  double a = 0, b = 0, c = 0;
  double at(const PlanePoint& p) const { return a * p.x + b * p.y + c; }
};

// A face projected to the plane.
struct SeenFace {
  // A side; all faces that share it agree on the order of its ends.
  struct Side {
    PlanePoint from, to;
    // True if the end is a corner of the face; false if the face was clipped
    // there.
    bool from_corner, to_corner;
    bool reversed;   // the face's own order goes from `to` to `from`
    uint8_t number;  // the side goes from this corner of the face to the next
  };
  uint32_t label = 0;
  std::array<Side, 3> sides;
  int side_count = 0;
  bool whole = false;                 // no side was clipped or omitted
  bool counter_clockwise = true;      // orientation of the corners on the plane
  PlaneFunction inverse_depth;        // [1 / length]; depths are positive
  double depth_error = 0;             // bound of the rounding error of inverse_depth on the face
  bool ruled = false;                 // the ordering rule may apply to it
  std::array<PlaneFunction, 3> cuts;  // the face is visible only where these are not negative
  int cut_count = 0;
  PlanePoint lower, upper;  // its bounding box
  double nearest = 0;       // the largest inverse depth of its points
};

// Projects faces to a plane. The point (x, y) of the plane is seen from `origin` in the direction a
// + x u + y v; origin + z (a + x u + y v) has the depth z.
class PlaneView {
 public:
  // u, v and a are linearly independent, and 0 < near < far. Geometry outside of this depth range
  // is invisible.
  PlaneView(const Vec3d& origin, const Vec3d& u, const Vec3d& v, const Vec3d& a, double near,
            double far);
  // Nothing if the face is outside of the depth range or seen exactly edge-on.
  std::optional<SeenFace> face(uint32_t label, const std::array<Vec3d, 3>& corners) const;

 private:
  struct Corner {
    Vec3d w;  // minus `origin`
    PlanePoint p;
    double z;
  };
  Corner project(const Vec3d& w) const;
  bool add_side(const Corner& a, const Corner& b, SeenFace& face) const;

  Vec3d origin_, u_, v_, a_;
  Vec3d to_x_, to_y_, to_z_;  // give x z, y z and z of a point as dot products
  bool right_handed_;
  double near_, far_;
};

struct PlaneWindow {
  PlanePoint center;
  double half_width = 1, half_height = 1;
};

class VisibleRegions {
 public:
  static constexpr uint32_t kNothing = UINT32_MAX;  // label of empty regions

  // Starts empty: a single region, or a grid of regions suited to `faces`, the expected number of
  // faces. The grid changes speed (with thousands of faces), not the result.
  explicit VisibleRegions(const PlaneWindow& window, size_t faces = 0);
  ~VisibleRegions();
  // Reinitialises, keeping memory.
  void reset(const PlaneWindow& window, size_t faces = 0);

  // An ordering rule for two labels. True if the first occludes the second wherever both are seen,
  // at any depths; nothing if depths decide. It serves coplanar faces, whose depths differ by the
  // rounding of positions only. Kept by reset(); used for ruled faces only.
  using Rule = std::function<std::optional<bool>(uint32_t, uint32_t)>;
  void set_rule(Rule rule);

  // Inserts a face; nearer faces occlude others. The lower label wins where depths are equal to
  // rounding. Intersecting faces are split where depths are equal. The insertion order changes only
  // how regions are cut; nearest first is fastest.
  void insert(const SeenFace& face);

  size_t size() const;
  // The inverse depth behind which everything is occluded: inserting a face whose `nearest` plus
  // `depth_error` is less has no effect, unless it is ruled.
  double hidden_below() const;
  // Number of lines where faces were found to intersect.
  size_t crossings() const;
  // Calls visit(label, corners) for every region; the order depends on the insertions alone.
  // Corners are counter-clockwise, exact to four roundings of the window's size.
  void for_each(const std::function<void(uint32_t, std::span<const PlanePoint>)>& visit) const;

  // The line of a region's side. It may extend beyond the face that it comes from.
  struct Side {
    uint32_t label = kNothing;  // the face that it belongs to; kNothing: the window
    int8_t side = -1;           // SeenFace::Side::number of that face, or
    int8_t cut = -1;            // index of SeenFace::cuts, or
    uint32_t other = kNothing;  // the face that intersects it there
    PlaneFunction line;         // rounded to the grid; positive inside of the region
  };
  // for_each with sides, for regions with a label below `labels` or kNothing. Side i begins at
  // corner i.
  using SideVisitor =
      std::function<void(uint32_t, std::span<const PlanePoint>, std::span<const Side>)>;
  void for_each_below(uint64_t labels, const SideVisitor& visit) const;

 private:
  class Tree;
  std::unique_ptr<Tree> tree_;
};

}  // namespace limn
