// Inserting a face: cut the regions it overlaps, compare depths, split, merge.
#include "limn/core/visible_regions.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "src/regions/convex_region.h"
#include "src/regions/seen_lines.h"

namespace limn {
namespace {

constexpr int kNone = -1;

// A grid prevents long thin regions, whose boxes overlap many faces. For a bumpy sphere in one
// window of 8192 and 131072 faces, a face takes 4.8 and 63 us without a grid, 2.5 and 3.1 us with
// 16 faces per cell, 2.4 and 3.5 us with 4.
constexpr size_t kFacesOfCell = 16;
constexpr int kMostLevels = 24;

// A face in grid coordinates of the window.
struct Inserted {
  uint32_t label;
  PlaneFunction inverse_depth;  // on the grid
  double error;                 // of inverse_depth on the face
  double nearest;
  bool ruled;
  LineSide lines[6];
  SideFilter filters[6];   // of `lines`
  int8_t numbers[6] = {};  // FaceLines::numbers
  int line_count = 0;
};

struct Box {
  double x0 = 1e300, y0 = 1e300, x1 = -1e300, y1 = -1e300;  // on the grid
  void extend(double x, double y) {
    x0 = std::min(x0, x), x1 = std::max(x1, x);
    y0 = std::min(y0, y), y1 = std::max(y1, y);
  }
  void extend(const Box& b) {
    extend(b.x0, b.y0);
    extend(b.x1, b.y1);
  }
  bool meets(const Box& b) const { return x0 <= b.x1 && b.x0 <= x1 && y0 <= b.y1 && b.y0 <= y1; }
  GridCorner lower() const { return {x0, y0}; }
  GridCorner upper() const { return {x1, y1}; }
};

// A node of the tree over regions; leaves are regions.
struct Node {
  Box box;
  double least;  // least visible inverse depth in it, lowered by its rounding
  int left = kNone, right = kNone;
  int face = kNone;  // visible in a leaf
  Ring ring;         // of a leaf
  bool is_leaf() const { return left == kNone; }
};

// The line where two faces are equally deep.
struct Crossing {
  int first, second;
  HalfPlane half_plane;  // where `first` is nearer
  size_t line;
};

}  // namespace

class VisibleRegions::Tree {
 public:
  void reset(const PlaneWindow& plane, size_t faces) {
    grid_ = WindowGrid(plane);
    lines_.clear();
    faces_.clear();
    crossings_.clear();
    free_.clear();
    used_ = 0;
    leaves_ = 0;
    int levels = 0;
    while (levels < kMostLevels && (kFacesOfCell << levels) < faces) ++levels;
    const GridCell window = window_cell(lines_);
    window.to_ring(window_);
    root_ = make_cells(window, levels);
  }

  void insert(const SeenFace& face) {
    if (!face.ruled && face.nearest + face.depth_error < nodes_[root_].least) return;
    const size_t lines_before = lines_.size(), crossings_before = crossings_.size();
    if (!prepare(face)) {
      lines_.resize(lines_before);
      return;
    }
    gained_ = 0;
    lost_ = false;
    root_ = insert_at(root_);
    if (gained_ == 0) {
      faces_.pop_back();
      lines_.resize(lines_before);
      crossings_.resize(crossings_before);
    } else if (gained_ > 1 && !lost_) {
      merge();
    }
  }

  void set_rule(Rule rule) { rule_ = std::move(rule); }
  size_t size() const { return leaves_; }
  double hidden_below() const { return nodes_[root_].least; }
  size_t crossings() const { return crossings_.size(); }

  void for_each(const std::function<void(uint32_t, std::span<const PlanePoint>)>& visit) const {
    std::vector<PlanePoint>& corners = corners_;
    for_each_leaf([&](const Node& node) {
      corners.clear();
      for (const RingCorner& corner : node.ring) corners.push_back(grid_.to_plane(corner.at));
      visit(node.face == kNone ? kNothing : faces_[node.face].label, corners);
    });
  }

  void for_each_below(uint64_t labels, const SideVisitor& visit) const {
    std::vector<Side> of_line(lines_.size());
    for (const Crossing& crossing : crossings_) {
      of_line[crossing.line].label = faces_[crossing.first].label;
      of_line[crossing.line].other = faces_[crossing.second].label;
    }
    for (const Inserted& face : faces_) {
      for (int k = 0; k < face.line_count; ++k) {
        Side& side = of_line[face.lines[k].line()];
        side.label = face.label;
        if (face.numbers[k] >= 0) side.side = face.numbers[k];
        if (face.numbers[k] < 0) side.cut = static_cast<int8_t>(-1 - face.numbers[k]);
      }
    }
    std::vector<PlanePoint> corners;
    std::vector<Side> sides;
    for_each_leaf([&](const Node& node) {
      const uint32_t shown = node.face == kNone ? kNothing : faces_[node.face].label;
      if (shown >= labels) return;
      corners.clear();
      sides.clear();
      for (const RingCorner& corner : node.ring) {
        corners.push_back(grid_.to_plane(corner.at));
        sides.push_back(of_line[corner.side.line()]);
        sides.back().line = grid_.to_plane(corner.side.in(lines_));
      }
      visit(shown, corners, sides);
    });
  }

 private:
  // Visits the leaves from left to right.
  template <class Visit>
  void for_each_leaf(const Visit& visit) const {
    std::vector<int>& stack = stack_;
    stack.assign(1, root_);
    while (!stack.empty()) {
      const Node& node = nodes_[stack.back()];
      stack.pop_back();
      if (!node.is_leaf()) {
        stack.push_back(node.right);
        stack.push_back(node.left);
        continue;
      }
      visit(node);
    }
  }
  int make_cells(const GridCell& cell, int levels) {
    if (levels > 0) {
      const auto [low, high] = cell.halves(lines_);
      const int left = make_cells(low, levels - 1);
      return join(left, make_cells(high, levels - 1));
    }
    const int leaf = new_leaf(kNone);
    cell.to_ring(nodes_[leaf].ring);
    measure(leaf);
    return leaf;
  }
  int new_leaf(int face) {
    int node = static_cast<int>(used_);
    if (!free_.empty()) {
      node = free_.back();
      free_.pop_back();
    } else if (++used_ > nodes_.size()) {
      nodes_.emplace_back();
    }
    nodes_[node].left = nodes_[node].right = kNone;
    nodes_[node].face = face;
    ++leaves_;
    return node;
  }
  // Joins two existing nodes; the number of a leaf does not change.
  int join(int left, int right) {
    const int node = new_leaf(kNone);
    --leaves_;
    nodes_[node].left = left;
    nodes_[node].right = right;
    measure(node);
    return node;
  }
  void release(int node) {
    if (nodes_[node].is_leaf()) --leaves_;
    free_.push_back(node);
  }

  // Computes box and least depth of a node from its children or its ring.
  void measure(int index) {
    Node& node = nodes_[index];
    node.box = {};
    if (!node.is_leaf()) {
      const Node &l = nodes_[node.left], &r = nodes_[node.right];
      node.box.extend(l.box);
      node.box.extend(r.box);
      node.least = std::min(l.least, r.least);
      return;
    }
    for (const RingCorner& corner : node.ring) node.box.extend(corner.at.x, corner.at.y);
    node.least = -std::numeric_limits<double>::infinity();
    if (node.face == kNone) return;
    const Inserted& face = faces_[node.face];
    node.least = face.nearest;
    for (const RingCorner& corner : node.ring) {
      node.least = std::min(node.least, face.inverse_depth.at({corner.at.x, corner.at.y}));
    }
    node.least -= face.error;
  }

  // Appends the face and its lines; false if it is outside of the window.
  bool prepare(const SeenFace& seen) {
    const PlanePoint lower = grid_.to_grid(seen.lower), upper = grid_.to_grid(seen.upper);
    box_ = {lower.x, lower.y, upper.x, upper.y};
    if (!box_.meets({-kGridHalf - 1, -kGridHalf - 1, kGridHalf + 1, kGridHalf + 1})) return false;
    // Corners are rounded to the grid.
    box_ = {lower.x - 2, lower.y - 2, upper.x + 2, upper.y + 2};
    FaceLines lines;
    if (!lines_of(seen, grid_, lines)) return false;
    faces_.push_back({seen.label,
                      grid_.to_grid(seen.inverse_depth),
                      seen.depth_error,
                      seen.nearest,
                      seen.ruled,
                      {},
                      {},
                      {},
                      lines.count});
    Inserted& face = faces_.back();
    for (int k = 0; k < lines.count; ++k) {
      face.numbers[k] = lines.numbers[k];
      face.filters[k] = SideFilter(lines.lines[k]);
      face.lines[k] = LineSide(lines_.size(), false);
      lines_.push_back(lines.lines[k]);
    }
    return true;
  }

  int insert_at(int index) {
    const Node& node = nodes_[index];
    if (!node.box.meets(box_)) return index;
    const Inserted& face = faces_.back();
    if (!face.ruled && face.nearest + face.error < node.least) {
      lost_ = true;  // if it is visible at all
      return index;
    }
    if (node.is_leaf()) return insert_in_leaf(index);
    const size_t gained_before = gained_;
    const int left = insert_at(node.left);
    const int right = insert_at(nodes_[index].right);
    if (gained_ == gained_before) return index;
    nodes_[index].left = left;
    nodes_[index].right = right;
    measure(index);
    return index;
  }

  // True if a common line separates two faces, as for neighbours in a mesh.
  bool are_beside(const Inserted& f, const Inserted& g) const {
    for (int i = 0; i < f.line_count; ++i) {
      const GridLine line = f.lines[i].other().in(lines_);
      for (int j = 0; j < g.line_count; ++j) {
        if (line == g.lines[j].in(lines_)) return true;
      }
    }
    return false;
  }

  // Differences of inverse depth at the corners of a ring: the new face minus another.
  struct Depths {
    double least = 1e300, most = -1e300;
    double rounding = 0;  // of these differences
  };
  Depths compare(const Ring& ring, int other) const {
    const Inserted &f = faces_.back(), &g = faces_[other];
    const PlaneFunction &p = f.inverse_depth, &q = g.inverse_depth;
    Depths depths;
    double largest = 0;
    for (const RingCorner& corner : ring) {
      const double here = p.at({corner.at.x, corner.at.y}),
                   there = q.at({corner.at.x, corner.at.y});
      depths.least = std::min(depths.least, here - there);
      depths.most = std::max(depths.most, here - there);
      largest = std::max(largest, std::fabs(here));
    }
    // Outside of a face errors grow with the value. Corners are rounded to the grid: differences of
    // four grid steps are not significant.
    depths.rounding = f.error * (1 + largest / f.nearest) + g.error +
                      4 * (std::fabs(p.a) + std::fabs(p.b) + std::fabs(q.a) + std::fabs(q.b));
    return depths;
  }

  int insert_in_leaf(int index) {
    const int face = static_cast<int>(faces_.size()) - 1;
    const int other = nodes_[index].face;
    if (other != kNone && are_beside(faces_[face], faces_[other])) return index;
    const std::optional<bool> wins = rule_for(face, other);
    if (wins && !*wins) {
      lost_ = true;
      return index;
    }
    if (other != kNone && !wins) {
      const Depths depths = compare(nodes_[index].ring, other);
      if (depths.most < -depths.rounding) {
        lost_ = true;
        return index;
      }
    }
    size_t pieces = 0;
    if (!cut_by_face(nodes_[index], pieces)) return index;
    if (other != kNone && !wins) {
      const Depths depths = compare(ring_, other);
      const bool nearer = depths.most > depths.rounding, farther = depths.least < -depths.rounding;
      if (nearer && farther) {
        if (!cut_at_crossing(other, pieces)) {
          lost_ = true;
          return index;
        }
      } else if (!nearer && (farther || faces_[other].label < faces_[face].label)) {
        lost_ = true;
        return index;
      }
    }
    ++gained_;
    return split(index, face, pieces);
  }

  // True if the rule shows the first of two faces rather than the second.
  std::optional<bool> rule_for(int face, int other) const {
    if (!rule_ || other == kNone || !faces_[face].ruled || !faces_[other].ruled) return {};
    return rule_(faces_[face].label, faces_[other].label);
  }

  // Cuts a leaf by the lines of the new face: the inside goes to ring_, the outside to the first
  // `pieces` of pieces_. False if the inside is empty.
  bool cut_by_face(const Node& leaf, size_t& pieces) {
    const Inserted& face = faces_.back();
    for (int k = 0; k < face.line_count; ++k) {
      const SideFilter& filter = face.filters[k];
      RingSides& sides = sides_of_line_[k];
      if (filter.side_of(filter.rearmost(leaf.box.lower(), leaf.box.upper())) > 0) {
        sides.positive = true;
        sides.negative = false;
        continue;
      }
      find_sides(lines_, leaf.ring, face.lines[k], sides);
      if (!sides.positive) return false;
    }
    ring_ = leaf.ring;
    for (int k = 0; k < face.line_count; ++k) {
      RingSides& sides = sides_of_line_[k];
      if (!sides.negative) continue;
      if (pieces > 0) {
        find_sides(lines_, ring_, face.lines[k], sides);
        if (!sides.positive) return false;
        if (!sides.negative) continue;
      }
      cut(face.lines[k], sides, pieces);
    }
    return true;
  }

  // Moves what is not on the positive side of the line from ring_ to the pieces.
  void cut(LineSide line, const RingSides& sides, size_t& pieces) {
    if (pieces == pieces_.size()) pieces_.emplace_back();
    cut_ring(lines_, ring_, line, sides, inside_, pieces_[pieces++]);
    std::swap(ring_, inside_);
  }

  // Cuts where depths are equal; false if the new face is invisible.
  bool cut_at_crossing(int other, size_t& pieces) {
    const auto [line, half_plane] = crossing_with(other);
    if (half_plane.reach == Reach::kHoldsAll) return true;
    if (half_plane.reach == Reach::kHoldsNone) return false;
    RingSides& sides = sides_of_line_[0];
    find_sides(lines_, ring_, line, sides);
    if (sides.positive && sides.negative) cut(line, sides, pieces);
    lost_ = lost_ || sides.negative;
    return sides.positive;
  }

  // Symmetric in the two faces.
  std::pair<LineSide, HalfPlane> crossing_with(int other) {
    const int face = static_cast<int>(faces_.size()) - 1;
    for (size_t i = crossings_.size(); i-- > 0 && crossings_[i].first == face;) {
      const Crossing& c = crossings_[i];
      if (c.second == other) return {LineSide(c.line, false), c.half_plane};
    }
    const PlaneFunction &p = faces_[face].inverse_depth, &q = faces_[other].inverse_depth;
    const HalfPlane h = half_plane_of(PlaneFunction{p.a - q.a, p.b - q.b, p.c - q.c});
    crossings_.push_back({face, other, h, lines_.size()});
    lines_.push_back(h.line);
    return {LineSide(lines_.size() - 1, false), h};
  }

  // The leaf shows `face` in ring_, and its former face in the pieces.
  int split(int index, int face, size_t pieces) {
    std::vector<int>& built = built_;
    built.clear();
    const int other = nodes_[index].face;
    nodes_[index].face = face;
    std::swap(nodes_[index].ring, ring_);
    measure(index);
    built.push_back(index);
    for (size_t i = 0; i < pieces; ++i) {
      const int leaf = new_leaf(other);
      std::swap(nodes_[leaf].ring, pieces_[i]);
      measure(leaf);
      built.push_back(leaf);
    }
    while (built.size() > 1) {
      size_t count = 0;
      for (size_t i = 0; i + 1 < built.size(); i += 2)
        built[count++] = join(built[i], built[i + 1]);
      if (built.size() % 2 == 1) built[count++] = built.back();
      built.resize(count);
    }
    return built[0];
  }

  // If the newest face is entirely visible, merges its regions into the leaf nearest the root.
  void merge() {
    const Inserted& face = faces_.back();
    const std::vector<GridLine>& lines = lines_;
    ring_ = window_;
    size_t pieces = 0;
    for (int k = 0; k < face.line_count; ++k) {
      RingSides& sides = sides_of_line_[0];
      find_sides(lines, ring_, face.lines[k], sides);
      if (sides.negative) cut(face.lines[k], sides, pieces);
    }
    int best = kNone, best_depth = std::numeric_limits<int>::max();
    find_highest(root_, 0, best, best_depth);
    std::swap(nodes_[best].ring, ring_);
    root_ = keep_one(root_, best);
  }

  bool shows_newest(const Node& node) const {
    return node.face == static_cast<int>(faces_.size()) - 1;
  }
  void find_highest(int index, int depth, int& best, int& best_depth) const {
    const Node& node = nodes_[index];
    if (!node.box.meets(box_) || depth >= best_depth) return;
    if (node.is_leaf()) {
      if (!shows_newest(node)) return;
      best = index;
      best_depth = depth;
      return;
    }
    find_highest(node.left, depth + 1, best, best_depth);
    find_highest(node.right, depth + 1, best, best_depth);
  }
  // Removes the leaves of the newest face except `kept`; kNone if none remains.
  int keep_one(int index, int kept) {
    const Node& node = nodes_[index];
    if (!node.box.meets(box_)) return index;
    if (node.is_leaf()) {
      if (shows_newest(node) && index != kept) {
        release(index);
        return kNone;
      }
      if (index == kept) measure(index);
      return index;
    }
    const int left = keep_one(node.left, kept);
    const int right = keep_one(nodes_[index].right, kept);
    if (left == kNone || right == kNone) {
      release(index);
      return left == kNone ? right : left;
    }
    nodes_[index].left = left;
    nodes_[index].right = right;
    measure(index);
    return index;
  }

  WindowGrid grid_{PlaneWindow{}};
  Ring window_;
  std::vector<GridLine> lines_;
  std::vector<Inserted> faces_;
  std::vector<Crossing> crossings_;
  Rule rule_;
  std::vector<Node> nodes_;
  size_t used_ = 0;        // nodes in use, with
  std::vector<int> free_;  // these free among them
  int root_ = kNone;
  size_t leaves_ = 0;
  // State of the current insertion.
  Box box_;
  size_t gained_ = 0;  // regions that it gained
  bool lost_ = false;  // a part of it may be hidden
  RingSides sides_of_line_[6];
  Ring ring_, inside_;
  std::vector<Ring> pieces_;
  std::vector<int> built_;
  // Scratch of a visit.
  mutable std::vector<PlanePoint> corners_;
  mutable std::vector<int> stack_;
};

VisibleRegions::VisibleRegions(const PlaneWindow& window, size_t faces)
    : tree_(std::make_unique<Tree>()) {
  reset(window, faces);
}
VisibleRegions::~VisibleRegions() = default;
void VisibleRegions::reset(const PlaneWindow& window, size_t faces) { tree_->reset(window, faces); }
void VisibleRegions::set_rule(Rule rule) { tree_->set_rule(std::move(rule)); }
void VisibleRegions::insert(const SeenFace& face) { tree_->insert(face); }
size_t VisibleRegions::size() const { return tree_->size(); }
double VisibleRegions::hidden_below() const { return tree_->hidden_below(); }
size_t VisibleRegions::crossings() const { return tree_->crossings(); }
void VisibleRegions::for_each_below(uint64_t labels, const SideVisitor& visit) const {
  tree_->for_each_below(labels, visit);
}
void VisibleRegions::for_each(
    const std::function<void(uint32_t, std::span<const PlanePoint>)>& visit) const {
  tree_->for_each(visit);
}

}  // namespace limn
