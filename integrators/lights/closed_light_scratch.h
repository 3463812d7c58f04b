#pragma once
// What closed light works with at a point. Included by closed_light.cpp.
#include <algorithm>
#include <tuple>
#include <vector>

#include "integrators/lights/closed_light.h"
#include "limn/core/shadow_outlines.h"
#include "limn/core/visible_regions.h"

namespace limn {

// The point that light falls on.
struct ClosedLight::Receiver {
  Vec3d p;
  Vec3d up;  // unit, of its face, towards the viewer
  FaceRef face;
  const EdgeStart* edge;
  // Of a point on an edge: another face there leaves directions w with wedge . w >= 0.
  std::optional<Vec3d> wedge = {};
};

// Which way round faces are seen, while outlines are found: as large as the tree, so there is one
// for all emitters.
struct ClosedLight::Turns {
  // Of each item of the tree twice the query that last evaluated it, and one more if it is seen
  // from behind.
  std::vector<uint64_t> of;
  uint64_t query = 0;
};

struct ClosedLight::Scratch {
  // What the rest holds: of the emitter whose faces are the first of `faces`, as seen by a point.
  struct Found {
    uint64_t places = 0;  // 0: nothing that may be looked up
    By by = By::kOutlines;
    Vec3d p, up;
    FaceRef face;
    std::vector<FaceRef> emitter;
  } last;
  bool seen_at_all = false, by_outlines = false;

  // What lines are of a face: its sides, then where it was cut.
  enum Line { kNearCut = 3, kFarCut, kHorizon, kWedge };
  // The number of a line of the face with a label.
  static constexpr uint32_t kLines = 8;
  struct Corner {
    Vec3d w;        // from the point
    uint32_t line;  // of the side that begins here
  };
  struct CutPoint {
    ShadowOutlines::Point at;
    uint32_t number;    // as they were found
    uint32_t lines[2];  // that meet there
    Vec3d w;            // from the point
  };

  std::vector<const FaceTree::Item*> items;
  std::vector<FaceRef> faces;  // by label: first the emitter's, then those before it
  size_t first_item = 0;       // from this label on they are those of `items`
  size_t emitter_faces = 0;
  size_t uncut = 0;  // of these, those that the emitter's plane does not cut
  PlaneWindow window;
  double near = 0, far = 0;  // depths, towards the emitter's plane, of what is before it

  // By regions.
  std::vector<SeenFace> seen;
  std::vector<uint32_t> order;
  VisibleRegions regions{{}};

  // By outlines.
  ShadowOutlines outlines;
  std::vector<Corner> polygon, clipped;
  std::vector<ShadowOutlines::Point> points;
  std::vector<uint32_t> lines;
  std::vector<CutPoint> cut_points;  // by place, then number

  // The polygon's corners as points and lines of an outline.
  void place(const auto& on_grid) {
    points.clear();
    lines.clear();
    for (const Corner& corner : polygon) {
      points.push_back(on_grid(corner.w));
      lines.push_back(corner.line);
    }
  }
  // Keeps what is not below zero in the polygon.
  template <class Height, class OnGrid>
  void clip(const Height& height, uint32_t line, const OnGrid& on_grid) {
    clipped.clear();
    for (size_t i = 0; i < polygon.size(); ++i) {
      const Corner &here = polygon[i], &next = polygon[(i + 1) % polygon.size()];
      const double h0 = height(here.w), h1 = height(next.w);
      if (h0 >= 0) clipped.push_back(here);
      if ((h0 >= 0) == (h1 >= 0)) continue;
      // The same for both faces beside it.
      const auto key = [](const Vec3d& w) { return std::tuple(w.x, w.y, w.z); };
      const bool swapped = key(next.w) < key(here.w);
      const Vec3d &x0 = swapped ? next.w : here.w, &x1 = swapped ? here.w : next.w;
      const double a0 = swapped ? h1 : h0, a1 = swapped ? h0 : h1;
      const Vec3d w = x0 + (x1 - x0) * (a0 / (a0 - a1));
      clipped.push_back({w, h0 >= 0 ? line : here.line});
      const auto number = static_cast<uint32_t>(cut_points.size());
      cut_points.push_back({on_grid(w), number, {here.line, line}, w});
    }
    std::swap(polygon, clipped);
  }
  void sort_cut_points() {
    std::sort(cut_points.begin(), cut_points.end(), [](const CutPoint& a, const CutPoint& b) {
      return std::tie(a.at, a.number) < std::tie(b.at, b.number);
    });
  }
  // The first that was found at a place; null if none was.
  const CutPoint* cut_point_at(const ShadowOutlines::Point& at) const {
    const auto found =
        std::lower_bound(cut_points.begin(), cut_points.end(), at,
                         [](const CutPoint& cut, const auto& place) { return cut.at < place; });
    return found != cut_points.end() && found->at == at ? &*found : nullptr;
  }
};

}  // namespace limn
