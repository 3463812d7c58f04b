#pragma once
// What is seen from a point through a window: convex regions, each of which shows one face, or
// nothing. After Zhou, Wu, Ramamoorthi, Yan 2021 (Algorithm 1), with lines in place of points: a
// region is a ring of lines through two points of a grid each, its corners are never rounded, and
// every decision on which side of a line a corner lies is exact. So regions are convex and cover
// the window without gap or overlap, whatever the faces are.
#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>

#include "limn/core/vec.h"

namespace limn {

// A point of the plane that a view projects to.
struct PlanePoint {
  double x = 0, y = 0;
};

// a x + b y + c
struct PlaneFunction {
  double a = 0, b = 0, c = 0;
  double at(const PlanePoint& p) const { return a * p.x + b * p.y + c; }
};

// A face on the plane.
struct SeenFace {
  // A side, in an order of its ends that all faces around it agree on.
  struct Side {
    PlanePoint from, to;
    // Whether the ends are corners of the face; else the face was cut there, and its corner is seen
    // farther on.
    bool from_corner, to_corner;
    bool reversed;   // the face's own order goes from `to` to `from`
    uint8_t number;  // it goes from this corner of the face to the next one, in the face's order
  };
  uint32_t label = 0;
  std::array<Side, 3> sides;
  int side_count = 0;
  bool whole = false;                 // no side was cut or left out
  bool counter_clockwise = true;      // the order of its corners on the plane
  PlaneFunction inverse_depth;        // [1 / length]; depths are positive
  double depth_error = 0;             // bound of the rounding of inverse_depth, where the face is
  bool ruled = false;                 // the regions' rule may know it
  std::array<PlaneFunction, 3> cuts;  // it is seen only where these are not negative
  int cut_count = 0;
  PlanePoint lower, upper;  // its bounding box
  double nearest = 0;       // the largest inverse depth of its points
};

// Projects faces to a plane: the point (x, y) of the plane is seen from `origin` in the direction
// a + x u + y v, and a point origin + z (a + x u + y v) has the depth z.
class PlaneView {
 public:
  // u, v and a are linearly independent, 0 < near < far. What is not between these depths is not
  // seen.
  PlaneView(const Vec3d& origin, const Vec3d& u, const Vec3d& v, const Vec3d& a, double near,
            double far);
  // None if the face is not between the depths, or seen exactly edge-on.
  std::optional<SeenFace> face(uint32_t label, const std::array<Vec3d, 3>& corners) const;

 private:
  struct Corner {
    Vec3d w;  // minus the origin
    PlanePoint p;
    double z;
  };
  Corner project(const Vec3d& w) const;
  bool add_side(const Corner& a, const Corner& b, SeenFace& face) const;

  Vec3d origin_, u_, v_, a_;
  Vec3d to_x_, to_y_, to_z_;  // x z, y z and z of a point are products with these
  bool right_handed_;
  double near_, far_;
};

struct PlaneWindow {
  PlanePoint center;
  double half_width = 1, half_height = 1;
};

class VisibleRegions {
 public:
  static constexpr uint32_t kNothing = UINT32_MAX;  // a label that no face has

  // Shows nothing: one region, or a grid of regions for `faces`, the number of faces to come. What
  // is seen does not depend on that; with thousands of faces in one window, the time does.
  explicit VisibleRegions(const PlaneWindow& window, size_t faces = 0);
  ~VisibleRegions();
  // As if new, but memory stays.
  void reset(const PlaneWindow& window, size_t faces = 0);

  // For two labels: whether the first is seen, and not the second, wherever both are and whatever
  // their depths; none where depths are to tell. For faces that lie in one plane to the rounding of
  // positions, which is far above that of depths. Kept by reset(), asked for ruled faces alone.
  using Rule = std::function<std::optional<bool>(uint32_t, uint32_t)>;
  void set_rule(Rule rule);

  // Nearer faces hide others. Where depths are equal to rounding, the lower label is seen. Faces
  // that pass through each other part where their depths are equal. Regions do not depend on the
  // order of insertion but for how they are cut; nearest first is fastest.
  void insert(const SeenFace& face);

  size_t size() const;
  // Lines along which faces were found to cross.
  size_t crossings() const;
  // visit(label, corners): for every region, in an order that depends on nothing but the
  // insertions. Corners, counter-clockwise, to four roundings of the window's size.
  void for_each(const std::function<void(uint32_t, std::span<const PlanePoint>)>& visit) const;

  // A side of a region: what line it lies on. It may go on beyond the face that has made it.
  struct Side {
    uint32_t label = kNothing;  // a face; none: the window's own
    int8_t side = -1;           // SeenFace::Side::number of that face, or
    int8_t cut = -1;            // index of SeenFace::cuts, or
    uint32_t other = kNothing;  // the face that it crosses there
    PlaneFunction line;         // rounded to the grid; positive inside the region
  };
  // The same for regions that show a label less than `labels`, with their sides: side i begins at
  // corner i. kNothing counts as a label.
  using SideVisitor =
      std::function<void(uint32_t, std::span<const PlanePoint>, std::span<const Side>)>;
  void for_each_below(uint64_t labels, const SideVisitor& visit) const;

 private:
  class Tree;
  std::unique_ptr<Tree> tree_;
};

}  // namespace limn
