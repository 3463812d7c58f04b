// A CAD part: a plate with four countersunk bores and a boss with a stepped bore, all outer edges
// chamfered. Closed; for flat shading (face_normals).
#include <cmath>
#include <map>
#include <tuple>

#include "tools/generate/generate_kinds.h"
#include "tools/generate/generate_parts.h"

namespace limn {
namespace {

// Here x and y lie in the plate and z points up.
using Loop = std::vector<Vec3d>;  // counter-clockwise from above

constexpr double kThickness = 0.36;
constexpr double kChamfer = 0.045;

struct Circle {
  double radius, z;
};

// Collects quads between points given by position; points at the same place are one vertex.
class Builder {
 public:
  void quad(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& d) {
    const uint32_t i = vertex(a), j = vertex(b), k = vertex(c), l = vertex(d);
    add_quad(mesh_, i, j, k, l);
  }
  // Between two loops of as many points, cut into `pieces`; the outside is on the right of one who
  // walks along the loops with `to` on the left hand.
  void strip(const Loop& from, const Loop& to, int pieces) {
    const size_t count = from.size();
    const auto at = [&](size_t k, int piece) {
      const double t = static_cast<double>(piece) / pieces;
      return from[k % count] * (1 - t) + to[k % count] * t;
    };
    for (size_t k = 0; k < count; ++k) {
      for (int p = 0; p < pieces; ++p) quad(at(k, p), at(k + 1, p), at(k + 1, p + 1), at(k, p + 1));
    }
  }
  Triangles take() { return std::move(mesh_); }

 private:
  uint32_t vertex(const Vec3d& p) {
    // Far finer than any edge, far coarser than rounding.
    const auto cell = [](double x) { return std::llround(x * 1e8); };
    const auto [entry, is_new] = vertices_.try_emplace(
        {cell(p.x), cell(p.y), cell(p.z)}, static_cast<uint32_t>(mesh_.positions.size()));
    if (is_new) mesh_.positions.push_back({p.x, p.z, -p.y});
    return entry->second;
  }
  Triangles mesh_;
  std::map<std::tuple<int64_t, int64_t, int64_t>, uint32_t> vertices_;
};

struct Cell {
  double x_0, x_1, y_0, y_1;
  int columns, rows;  // pieces of its sides

  Vec3d point(double u, double v, double z) const {
    return {x_0 + u * (x_1 - x_0), y_0 + v * (y_1 - y_0), z};
  }
  // The outline, from (x_0, y_0) around.
  Loop outline(double z) const {
    Loop loop;
    for (int i = 0; i < columns; ++i) loop.push_back(point(1.0 * i / columns, 0, z));
    for (int i = 0; i < rows; ++i) loop.push_back(point(1, 1.0 * i / rows, z));
    for (int i = columns; i > 0; --i) loop.push_back(point(1.0 * i / columns, 1, z));
    for (int i = rows; i > 0; --i) loop.push_back(point(0, 1.0 * i / rows, z));
    return loop;
  }
  // A circle around the center with a quarter of its turn for every side.
  Loop circle(const Circle& circle) const {
    Loop loop;
    const Vec3d center = point(0.5, 0.5, circle.z);
    for (int side = 0; side < 4; ++side) {
      const int pieces = side % 2 == 0 ? columns : rows;
      for (int i = 0; i < pieces; ++i) {
        const double a = kPi / 2 * (side + 1.0 * i / pieces) - 0.75 * kPi;
        loop.push_back(center + Vec3d{std::cos(a), std::sin(a), 0} * circle.radius);
      }
    }
    return loop;
  }
};

void add_plain(Builder& builder, const Cell& cell) {
  for (int i = 0; i < cell.columns; ++i) {
    for (int k = 0; k < cell.rows; ++k) {
      const auto p = [&](int a, int b, double z) {
        return cell.point(1.0 * a / cell.columns, 1.0 * b / cell.rows, z);
      };
      const double z = kThickness;
      builder.quad(p(i, k, z), p(i + 1, k, z), p(i + 1, k + 1, z), p(i, k + 1, z));
      builder.quad(p(i, k, 0), p(i, k + 1, 0), p(i + 1, k + 1, 0), p(i + 1, k, 0));
    }
  }
}

// A cell whose top is joined to its bottom by a tunnel along circles, from top to bottom.
void add_bored(Builder& builder, const Cell& cell, const std::vector<Circle>& circles, double h) {
  const double side = std::min(cell.x_1 - cell.x_0, cell.y_1 - cell.y_0);
  const auto pieces = [&](double size) { return steps(size, 2 * h, 1); };
  builder.strip(cell.outline(kThickness), cell.circle(circles.front()),
                pieces(side / 2 - circles.front().radius));
  for (size_t i = 0; i + 1 < circles.size(); ++i) {
    const Circle& a = circles[i];
    const Circle& b = circles[i + 1];
    builder.strip(cell.circle(a), cell.circle(b),
                  pieces(std::hypot(a.radius - b.radius, a.z - b.z)));
  }
  builder.strip(cell.circle(circles.back()), cell.outline(0),
                pieces(side / 2 - circles.back().radius));
}

// The plate's rim: from the top's outline over a chamfer, the wall and a chamfer to the bottom's.
void add_rim(Builder& builder, const Cell* cells, double h) {
  Loop top;
  const auto add_side = [&](int first, int stride, int side) {
    for (int i = 0; i < 3; ++i) {
      const Cell& cell = cells[first + i * stride];
      const Loop outline = cell.outline(kThickness);
      const int start[] = {0, cell.columns, cell.columns + cell.rows, 2 * cell.columns + cell.rows};
      const int pieces = side % 2 == 0 ? cell.columns : cell.rows;
      for (int k = 0; k < pieces; ++k) top.push_back(outline[start[side] + k]);
    }
  };
  add_side(0, 1, 0);
  add_side(2, 3, 1);
  add_side(8, -1, 2);
  add_side(6, -3, 3);
  const double x = cells[8].x_1, y = cells[8].y_1;  // the plate is centered
  const auto moved_to = [&](double out, double z) {
    Loop loop = top;
    for (Vec3d& p : loop) p = {p.x * (x + out) / x, p.y * (y + out) / y, z};
    return loop;
  };
  const std::vector<Loop> loops = {moved_to(0, 0), moved_to(kChamfer, kChamfer),
                                   moved_to(kChamfer, kThickness - kChamfer), top};
  builder.strip(loops[0], loops[1], 1);
  builder.strip(loops[1], loops[2], steps(kThickness - 2 * kChamfer, 2 * h, 1));
  builder.strip(loops[2], loops[3], 1);
}

Triangles bracket(double h) {
  constexpr double kX[] = {-1.6, -0.75, 0.75, 1.6};
  constexpr double kY[] = {-1.2, -0.65, 0.65, 1.2};
  std::vector<Cell> cells;
  for (int k = 0; k < 3; ++k) {
    for (int i = 0; i < 3; ++i) {
      cells.push_back({kX[i], kX[i + 1], kY[k], kY[k + 1], steps(kX[i + 1] - kX[i], h, 3),
                       steps(kY[k + 1] - kY[k], h, 3)});
    }
  }
  constexpr double kTop = 1.15;
  const std::vector<Circle> bore = {
      {0.2, kThickness}, {0.135, kThickness - 0.065}, {0.135, 0.03}, {0.165, 0}};
  const std::vector<Circle> boss = {{0.56, kThickness},
                                    {0.56, kTop - kChamfer},
                                    {0.56 - kChamfer, kTop},
                                    {0.4 + kChamfer, kTop},
                                    {0.4, kTop - kChamfer},
                                    {0.4, 0.5},
                                    {0.26, 0.5},
                                    {0.26, kChamfer},
                                    {0.26 + kChamfer, 0}};
  Builder builder;
  for (int i = 0; i < 9; ++i) {
    if (i % 2 == 1) {
      add_plain(builder, cells[i]);
    } else {
      add_bored(builder, cells[i], i == 4 ? boss : bore, h);
    }
  }
  add_rim(builder, cells.data(), h);
  return builder.take();
}

}  // namespace

Triangles make_bracket(int faces) { return with_faces(faces, 7 / std::sqrt(faces), bracket); }

}  // namespace limn
