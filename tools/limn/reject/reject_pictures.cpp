// The pictures of limn reject: slices, reachable edges, the overview.
#include "tools/limn/reject/reject_pictures.h"

#include <algorithm>
#include <optional>
#include <vector>

#include "limn/core/parallel.h"
#include "limn/core/shading.h"

namespace limn {
namespace {

constexpr uint32_t kCutColor = 0x39424a;

// Strokes are given for pictures of this many pixels.
double stroke(double width, int size) { return width * std::max(size, 256) / 768; }

Color verdict_color(NodeVerdict verdict) { return srgb(kVerdictColors[static_cast<int>(verdict)]); }

PixelPoint place_on(const Slice& slice, const Vec3d& x) {
  const Vec3d w = x - slice.center;
  const double a = dot(w, slice.right) / length_squared(slice.right);
  const double b = dot(w, slice.up) / length_squared(slice.up);
  return {0.5 * (1 + a) * slice.size, 0.5 * (1 - b) * slice.size};
}

// Where a face cuts the slice's plane.
struct Cut {
  Vec3d a, b;
};
std::optional<Cut> cut_of(const Mesh& mesh, FaceId face, const Slice& slice) {
  const Vec3d n = cross(slice.right, slice.up);
  const auto corners = face_corners<double>(mesh, face);
  double heights[3];
  for (int k = 0; k < 3; ++k) heights[k] = dot(corners[k] - slice.center, n);
  std::vector<Vec3d> ends;
  for (int k = 0; k < 3; ++k) {
    const int l = (k + 1) % 3;
    if ((heights[k] < 0) == (heights[l] < 0)) continue;
    const double t = heights[k] / (heights[k] - heights[l]);
    ends.push_back(corners[k] + (corners[l] - corners[k]) * t);
  }
  if (ends.size() != 2) return std::nullopt;
  return Cut{ends[0], ends[1]};
}

void draw_cuts(const Mesh& mesh, std::span<const FaceId> faces, const Slice& slice, double width,
               Layer& layer) {
  for (const FaceId face : faces) {
    const auto cut = cut_of(mesh, face, slice);
    if (cut) layer.line(place_on(slice, cut->a), place_on(slice, cut->b), width);
  }
}

std::vector<FaceId> faces_around(const EdgeMesh& mesh, std::span<const EdgeRef> edges) {
  std::vector<FaceId> faces;
  for (const EdgeRef id : edges) {
    for (const FaceRef face : mesh.faces_around(id.edge)) faces.push_back(face.face);
  }
  std::sort(faces.begin(), faces.end());
  faces.erase(std::unique(faces.begin(), faces.end()), faces.end());
  return faces;
}

// Colours of a slice's pixels; those where verdicts meet are means over points inside of them.
class SlicePainter {
 public:
  SlicePainter(const Subject& subject, const RejectionTree& tree, uint32_t node, const Slice& slice,
               const std::vector<NodeVerdict>& verdicts)
      : subject_(subject), tree_(tree), node_(node), slice_(slice), verdicts_(verdicts) {}

  Image paint() const {
    Image image(slice_.size, slice_.size, 3);
    parallel_for(slice_.size, subject_.threads, [&](size_t row) {
      const int y = static_cast<int>(row);
      for (int x = 0; x < slice_.size; ++x) {
        const Color color = borders(x, y) ? mean_color(x, y) : verdict_color(at(x, y));
        set_pixel(image, x, y, color * (is_inside(x, y) ? 0.72 : 1.0));
      }
    });
    return image;
  }

 private:
  static constexpr int kPointsPerSide = 4;

  NodeVerdict at(int x, int y) const { return verdicts_[static_cast<size_t>(y) * slice_.size + x]; }
  bool differs(int x, int y, NodeVerdict verdict) const {
    return x >= 0 && y >= 0 && x < slice_.size && y < slice_.size && at(x, y) != verdict;
  }
  bool borders(int x, int y) const {
    const NodeVerdict own = at(x, y);
    return differs(x - 1, y, own) || differs(x + 1, y, own) || differs(x, y - 1, own) ||
           differs(x, y + 1, own);
  }
  Color mean_color(int x, int y) const {
    Color sum;
    for (int k = 0; k < kPointsPerSide * kPointsPerSide; ++k) {
      const Vec3d p = slice_.point(x + (k % kPointsPerSide + 0.5) / kPointsPerSide,
                                   y + (k / kPointsPerSide + 0.5) / kPointsPerSide);
      sum += verdict_color(judge(subject_.input, tree_, node_, p));
    }
    return sum * (1.0 / (kPointsPerSide * kPointsPerSide));
  }
  // In a closed mesh: what a ray meets first is seen from behind.
  bool is_inside(int x, int y) const {
    const EdgeMesh& mesh = subject_.input.objects[0];
    if (!mesh.one_sided_closed) return false;
    Ray ray;
    ray.origin = slice_.point(x + 0.5, y + 0.5);
    ray.direction = normalize(cross(slice_.right, slice_.up));
    Hit hit;
    return subject_.tracer.closest(ray, hit) && dot(mesh.plane(hit.face.face).n, ray.direction) > 0;
  }

  const Subject& subject_;
  const RejectionTree& tree_;
  uint32_t node_;
  const Slice& slice_;
  const std::vector<NodeVerdict>& verdicts_;
};

// A pane's colour and opacity where a ray crosses it.
struct Crossing {
  double distance;
  Color color;
  double opacity;
};
std::optional<Crossing> cross_pane(const PlacedSlice& pane, const Ray& ray) {
  const Slice& slice = pane.slice;
  const Vec3d n = cross(slice.right, slice.up);
  const double t = dot(slice.center - ray.origin, n) / dot(ray.direction, n);
  if (!(t > 0)) return std::nullopt;
  const PixelPoint at = place_on(slice, ray.origin + ray.direction * t);
  if (!(at.x >= 0 && at.y >= 0 && at.x < slice.size && at.y < slice.size)) return std::nullopt;
  const double rim = std::min(std::min(at.x, at.y), slice.size - std::max(at.x, at.y));
  if (rim < 0.006 * slice.size) return Crossing{t, srgb(kCutColor), 0.9};
  const NodeVerdict verdict =
      pane.verdicts[static_cast<size_t>(at.y) * slice.size + static_cast<size_t>(at.x)];
  return Crossing{t, verdict_color(verdict), verdict == NodeVerdict::kTrueReject ? 0.35 : 0.7};
}

}  // namespace

Image slice_picture(const Subject& subject, const RejectionTree& tree, uint32_t node,
                    const Slice& slice, const std::vector<NodeVerdict>& verdicts) {
  Image image = SlicePainter(subject, tree, node, slice, verdicts).paint();
  const Mesh& mesh = subject.scene.shapes[0].mesh;
  std::vector<FaceId> all;
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) all.emplace_back(f);
  Layer outline(slice.size, slice.size), patch(slice.size, slice.size);
  draw_cuts(mesh, all, slice, stroke(2, slice.size), outline);
  draw_cuts(mesh, faces_around(subject.input.objects[0], tree.edges(node)), slice,
            stroke(6, slice.size), patch);
  paint(image, outline, srgb(kCutColor));
  paint(image, patch, srgb(kNodeColor));
  return image;
}

Image reach_picture(const MeshView& view, Image clay, const EdgeMesh& edges, const Reach& reach,
                    const Vec3d& p) {
  const int size = clay.width;
  const auto draw = [&](const std::vector<EdgeRef>& ids, double width, uint32_t color,
                        double faint) {
    Layer visible(size, size), hidden(size, size);
    for (const EdgeRef id : ids)
      view.draw_edge(edges, id.edge, stroke(width, size), visible, hidden);
    paint(clay, hidden, srgb(color), faint);
    paint(clay, visible, srgb(color));
  };
  draw(reach.false_positives, 1.8, kDeadEndColor, 0.15);
  draw(reach.false_accepts, 2.6, kFalseAcceptColor, 0.15);
  draw(reach.silhouettes, 4.0, kSilhouetteColor, 0.3);
  draw(reach.missed, 6.0, kVerdictColors[static_cast<int>(NodeVerdict::kMissed)], 1);
  Layer rim(size, size), dot(size, size);
  rim.disc(view.project(p), stroke(22, size));
  dot.disc(view.project(p), stroke(16, size));
  paint(clay, rim, srgb(0xffffff));
  paint(clay, dot, srgb(kPointColor));
  return clay;
}

Image overview_picture(const MeshView& view, const EdgeMesh& mesh, std::span<const EdgeRef> edges,
                       std::span<const PlacedSlice> slices) {
  Image image = view.picture([&](const Ray& ray) {
    const MeshView::Surface behind = view.surface(ray);
    std::vector<Crossing> crossings;
    for (const PlacedSlice& slice : slices) {
      const auto crossing = cross_pane(slice, ray);
      if (crossing && crossing->distance < behind.distance) crossings.push_back(*crossing);
    }
    std::sort(crossings.begin(), crossings.end(),
              [](const Crossing& a, const Crossing& b) { return a.distance > b.distance; });
    Color color = behind.color;
    for (const Crossing& c : crossings) color = color * (1 - c.opacity) + c.color * c.opacity;
    return color;
  });
  Layer visible(image.width, image.height), hidden(image.width, image.height);
  for (const EdgeRef id : edges)
    view.draw_edge(mesh, id.edge, stroke(1.6, image.width), visible, hidden);
  paint(image, hidden, srgb(kNodeColor), 0.15);
  paint(image, visible, srgb(kNodeColor));
  return image;
}

}  // namespace limn
