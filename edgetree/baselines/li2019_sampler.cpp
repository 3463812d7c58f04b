// The edge sampler of Li et al. 2018, as described in Li's thesis (2019): a baseline.
//
// It uses binary trees over the edges' positions and the Hough transforms of their faces'
// planes. With an origin o, a plane is represented by its point h closest to o. The planes
// through p are the points of the sphere with the diameter from o to p. An edge is a
// silhouette if its two points are on different sides of that sphere. A node is rejected
// if the box of all its points is entirely inside or entirely outside of the hollow
// sphere.
// This requires edges that are no silhouettes from o: a plane's point is inside the sphere
// if the signed distances s of o and of p agree, so both planes of an edge must have the
// same sign of s. Other edges, and those that are always candidates, are in a separate
// tree over positions alone, which rejects nothing. The importance of a node is its total
// length times the largest cosine of the transformed box, divided by the distance.
// Differences: o is the center of the scene's edges (the thesis uses the camera, unknown
// to an edge sampler); the sphere-box test is exact; and a hundredth of the untransformed
// cosine is added, so that no edge is lost where only the transformed cosine is zero.
// redner treats the sphere as solid by mistake (Soroka et al. 2025, App. F) and rejects
// less: sphere=solid.
#include <algorithm>
#include <array>

#include "edgetree/baselines/baselines.h"
#include "edgetree/lobe/ltc.h"
#include "limn/core/bounds.h"

namespace limn {
namespace {

struct Node {
  Bounds positions;
  Bounds planes;                // Hough points of all faces
  bool always = false;          // always a candidate: the planes are unused
  double length = 0;            // of all edges
  uint32_t begin = 0, end = 0;  // range of edges
  uint32_t right = 0;           // second child; the first follows its parent; 0 for a leaf
};

struct Item {
  EdgeRef id;
  Vec3d center;
  Vec3d plane;  // mean of the Hough points
  bool always;  // belongs to the tree over positions alone
};

// True if the sphere around `center` meets the box.
bool meets_sphere(const Bounds& box, const Vec3d& center, double radius, bool solid) {
  double nearest = 0;
  double farthest = 0;
  for (int i = 0; i < 3; ++i) {
    const double below = box.lower[i] - center[i];
    const double above = box.upper[i] - center[i];
    const double near = std::max({below, -above, 0.0});
    const double far = std::max(std::fabs(below), std::fabs(above));
    nearest += near * near;
    farthest += far * far;
  }
  // Tolerance for rounding: a box that touches the sphere is kept.
  const double slack = 1e-12 * (farthest + radius * radius);
  return nearest <= radius * radius + slack && (solid || farthest >= radius * radius - slack);
}

// The sphere of all planes through p, as Hough points.
struct PlaneSphere {
  Vec3d center;
  double radius;
  bool solid;

  PlaneSphere(const Vec3d& p, const Vec3d& origin, bool is_solid)
      : center((p + origin) * 0.5), radius(0.5 * length(p - origin)), solid(is_solid) {}
  bool rejects(const Node& node) const {
    return !node.always && !meets_sphere(node.planes, center, radius, solid);
  }
};

// Largest z / |w| over the box of eight corners: z increases with the cosine, x and y with the
// distance.
double largest_cosine(const std::array<Vec3d, 8>& corners) {
  Bounds box;
  for (const Vec3d& corner : corners) box.extend(corner);
  const double z = box.upper.z;
  if (z <= 0) return 0;
  const double x = std::max({box.lower.x, -box.upper.x, 0.0});
  const double y = std::max({box.lower.y, -box.upper.y, 0.0});
  return z / std::sqrt(x * x + y * y + z * z);
}

// Query data shared by all nodes.
struct Descent {
  const EdgeQuery& query;
  LtcLobe lobe;
  Frame frame;
  PlaneSphere sphere;

  Descent(const EdgeQuery& q, const Vec3d& origin, bool solid)
      : query(q), lobe(q.lobe, q.n, q.wi), frame(q.n), sphere(q.p, origin, solid) {}

  double importance(const Node& node) const {
    if (sphere.rejects(node)) return 0;
    std::array<Vec3d, 8> transformed;
    std::array<Vec3d, 8> plain;
    for (int i = 0; i < 8; ++i) {
      const Vec3d corner = {(i & 1 ? node.positions.upper : node.positions.lower).x,
                            (i & 2 ? node.positions.upper : node.positions.lower).y,
                            (i & 4 ? node.positions.upper : node.positions.lower).z};
      transformed[i] = lobe.transform(corner - query.p);
      plain[i] = frame.to_local(corner - query.p);
    }
    const double plain_cosine = largest_cosine(plain);
    if (plain_cosine == 0) return 0;
    const double cosine = lobe.diffuse() ? plain_cosine : largest_cosine(transformed);
    const double size = 0.5 * limn::length(node.positions.upper - node.positions.lower);
    const double distance = std::max(limn::length(node.positions.center() - query.p), size);
    return node.length * (cosine + 0.01 * plain_cosine) / distance;
  }
};

// All nodes except the root, to which no choice leads.
class Li2019RejectionTree final : public RejectionTree {
 public:
  Li2019RejectionTree(const std::vector<Node>& nodes, const std::vector<Item>& items,
                      const Vec3d& origin, bool solid)
      : tree_(nodes), origin_(origin), solid_(solid), first_(nodes.size() > 1 ? 1 : 0) {
    for (const Item& item : items) edges_.push_back(item.id);
    std::vector<uint32_t> open;  // ancestors of the next node, outermost first
    for (uint32_t i = first_; i < tree_.size(); ++i) {
      while (!open.empty() && nodes_[open.back()].end <= tree_[i].begin) close(open);
      const uint32_t parent = open.empty() ? kNoNode : open.back();
      const auto depth = static_cast<uint32_t>(open.size() + 1);
      open.push_back(static_cast<uint32_t>(nodes_.size()));
      nodes_.push_back({parent, 0, depth, tree_[i].begin, tree_[i].end});
    }
    while (!open.empty()) close(open);
  }

  bool rejects(uint32_t node, const Vec3d& p) const override {
    return PlaneSphere(p, origin_, solid_).rejects(tree_[node + first_]);
  }

 private:
  void close(std::vector<uint32_t>& open) {
    nodes_[open.back()].after = static_cast<uint32_t>(nodes_.size());
    open.pop_back();
  }

  const std::vector<Node>& tree_;
  Vec3d origin_;
  bool solid_;
  uint32_t first_;
};

class Li2019Sampler final : public EdgeSampler {
 public:
  Li2019Sampler(const EdgeSamplerInput& input, bool solid) : input_(input), solid_(solid) {
    collect();
    const auto middle = std::stable_partition(items_.begin(), items_.end(),
                                              [](const Item& item) { return item.always; });
    if (!items_.empty()) {
      build(0, static_cast<uint32_t>(items_.size()),
            static_cast<uint32_t>(middle - items_.begin()));
    }
    places_.resize(input.objects.size());
    for (size_t o = 0; o < input.objects.size(); ++o) {
      places_[o].resize(input.objects[o].edges.size());
    }
    for (uint32_t i = 0; i < items_.size(); ++i) place(items_[i].id) = i;
  }

  std::optional<EdgeSample> sample(const EdgeQuery& query, Rng& rng) const override {
    if (nodes_.empty()) return std::nullopt;
    const Descent descent(query, origin_, solid_);
    double u = rng.uniform();
    uint32_t node = 0;
    double probability = 1;
    while (nodes_[node].right != 0) {
      const double first = first_share(descent, node);
      if (first < 0) return std::nullopt;
      if (u < first) {
        u /= first;
        probability *= first;
        ++node;
      } else {
        u = (u - first) / (1 - first);
        probability *= 1 - first;
        node = nodes_[node].right;
      }
    }
    const EdgeRef id = items_[nodes_[node].begin].id;
    if (!is_drawn(query, id)) return std::nullopt;
    const LtcEdge edge = transformed_edge(descent, id);
    if (!(edge.integral() > 0)) return std::nullopt;
    EdgeSample sample;
    sample.edge = id;
    sample.probability = probability;
    sample.t = edge.sample_t(rng.uniform());
    sample.pdf_t = edge.pdf_t(sample.t);
    if (!(sample.pdf_t > 0)) return std::nullopt;
    return sample;
  }

  double probability(const EdgeQuery& query, EdgeRef id) const override {
    if (!is_drawn(query, id)) return 0;
    const Descent descent(query, origin_, solid_);
    if (!(transformed_edge(descent, id).integral() > 0)) return 0;
    const uint32_t own = place(id);
    uint32_t node = 0;
    double probability = 1;
    while (nodes_[node].right != 0) {
      const double first = first_share(descent, node);
      if (first < 0) return 0;
      const bool right = own >= nodes_[nodes_[node].right].begin;
      probability *= right ? 1 - first : first;
      node = right ? nodes_[node].right : node + 1;
    }
    return probability;
  }

  double pdf_t(const EdgeQuery& query, EdgeRef id, double t) const override {
    return transformed_edge(Descent(query, origin_, solid_), id).pdf_t(t);
  }

  // A descent costs a few rays.
  double draw_cost() const override { return 5; }
  // First draws cost 1.1 to 1.2 more than further ones, which cost 4 to 5.
  double query_cost() const override { return 1; }
  SamplerSize size() const override {
    uint64_t bytes = nodes_.size() * sizeof(Node) + items_.size() * sizeof(Item);
    for (const auto& places : places_) bytes += places.size() * sizeof(uint32_t);
    return {nodes_.size(), bytes};
  }
  std::unique_ptr<RejectionTree> rejection_tree() const override {
    return std::make_unique<Li2019RejectionTree>(nodes_, items_, origin_, solid_);
  }

 private:
  void collect() {
    Bounds all;
    for (const EdgeMesh& mesh : input_.objects) {
      for (const Edge& edge : mesh.edges) {
        for (const VertexId vertex : edge.vertices) all.extend(mesh.position(vertex));
      }
    }
    origin_ = all.center();
    for (uint32_t o = 0; o < input_.objects.size(); ++o) {
      const EdgeMesh& mesh = input_.objects[o];
      for (uint32_t e = 0; e < mesh.edges.size(); ++e) {
        const EdgeRef id{ShapeId(o), EdgeId(e)};
        const Bounds box = plane_box(mesh, id.edge);
        const auto [a, b] = mesh.edge(id.edge).vertices;
        items_.push_back({id, (mesh.position(a) + mesh.position(b)) * 0.5, box.center(),
                          matters_everywhere(mesh, id.edge)});
      }
    }
  }

  // Also true if o is within rounding of a plane.
  bool matters_everywhere(const EdgeMesh& mesh, EdgeId id) const {
    const Edge& edge = mesh.edge(id);
    if (edge.edge_class != EdgeClass::kSmooth && edge.edge_class != EdgeClass::kFlat) return true;
    const double error = distance_error(mesh, origin_);
    const double s0 = mesh.plane(edge.faces[0]).distance(origin_);
    const double s1 = mesh.plane(edge.faces[1]).distance(origin_);
    return std::min(std::fabs(s0), std::fabs(s1)) <= error || (s0 > 0) != (s1 > 0);
  }

  Bounds plane_box(const EdgeMesh& mesh, EdgeId edge) const {
    Bounds box;
    const auto extend = [&](FaceId face) {
      const Plane& plane = mesh.plane(face);
      box.extend(origin_ - plane.n * plane.distance(origin_));
    };
    for (const FaceRef face : mesh.faces_around(edge))
      if (face.shape == mesh.shape) extend(face.face);
    for (const FaceId face : mesh.edge(edge).faces)
      if (face.valid()) extend(face);
    return box;
  }

  // Splits the range at `first_split` if that is inside (between the two trees), else at the median
  // of the widest axis. Returns the node.
  uint32_t build(uint32_t begin, uint32_t end, uint32_t first_split = 0) {
    const auto index = static_cast<uint32_t>(nodes_.size());
    nodes_.emplace_back();
    nodes_[index].begin = begin;
    nodes_[index].end = end;
    if (end - begin == 1) {
      fill_leaf(index);
      return index;
    }
    uint32_t middle = first_split;
    if (first_split <= begin || first_split >= end) {
      middle = begin + (end - begin) / 2;
      split_at_median(begin, middle, end);
    }
    const uint32_t left = build(begin, middle);
    const uint32_t right = build(middle, end);
    Node& node = nodes_[index];
    node.right = right;
    for (const uint32_t child : {left, right}) {
      const Node& c = nodes_[child];
      node.positions.extend(c.positions.lower);
      node.positions.extend(c.positions.upper);
      node.planes.extend(c.planes.lower);
      node.planes.extend(c.planes.upper);
      node.length += c.length;
      node.always = node.always || c.always;
    }
    return index;
  }

  void split_at_median(uint32_t begin, uint32_t middle, uint32_t end) {
    const int axis = widest_axis(begin, end);
    const auto key = [axis](const Item& item) {
      return axis < 3 ? item.center[axis] : item.plane[axis - 3];
    };
    std::nth_element(items_.begin() + begin, items_.begin() + middle, items_.begin() + end,
                     [&](const Item& a, const Item& b) {
                       const double ka = key(a);
                       const double kb = key(b);
                       if (ka != kb) return ka < kb;
                       return std::pair(a.id.object, a.id.edge) < std::pair(b.id.object, b.id.edge);
                     });
  }

  void fill_leaf(uint32_t index) {
    Node& node = nodes_[index];
    const EdgeRef id = items_[node.begin].id;
    const EdgeMesh& mesh = input_.object(id.object);
    const Edge& edge = mesh.edge(id.edge);
    node.always = items_[node.begin].always;
    for (const VertexId vertex : edge.vertices) node.positions.extend(mesh.position(vertex));
    node.planes = plane_box(mesh, id.edge);
    node.length = length(mesh.position(edge.vertices[1]) - mesh.position(edge.vertices[0]));
  }

  int widest_axis(uint32_t begin, uint32_t end) const {
    Bounds centers;
    Bounds planes;
    for (uint32_t i = begin; i < end; ++i) {
      centers.extend(items_[i].center);
      planes.extend(items_[i].plane);
    }
    int widest = 0;
    double width = -1;
    const int axes = items_[begin].always ? 3 : 6;
    for (int axis = 0; axis < axes; ++axis) {
      const Bounds& box = axis < 3 ? centers : planes;
      const double extent = box.upper[axis % 3] - box.lower[axis % 3];
      if (extent > width) {
        width = extent;
        widest = axis;
      }
    }
    return widest;
  }

  // Probability of the first child; negative if neither child can hold a silhouette.
  double first_share(const Descent& descent, uint32_t node) const {
    const double first = descent.importance(nodes_[node + 1]);
    const double second = descent.importance(nodes_[nodes_[node].right]);
    return first + second > 0 ? first / (first + second) : -1;
  }

  bool is_drawn(const EdgeQuery& query, EdgeRef id) const {
    return is_candidate(input_.object(id.object), id.edge, query.p) &&
           !is_own_edge(input_, query, id);
  }

  LtcEdge transformed_edge(const Descent& descent, EdgeRef id) const {
    const EdgeMesh& mesh = input_.object(id.object);
    const auto [a, b] = mesh.edge(id.edge).vertices;
    return {descent.lobe, mesh.position(a) - descent.query.p, mesh.position(b) - descent.query.p};
  }

  uint32_t place(EdgeRef id) const { return places_[id.object.index()][id.edge.index()]; }
  uint32_t& place(EdgeRef id) { return places_[id.object.index()][id.edge.index()]; }

  const EdgeSamplerInput& input_;
  bool solid_;
  Vec3d origin_{};
  std::vector<Item> items_;                    // in the order of the leaves
  std::vector<std::vector<uint32_t>> places_;  // of an object's edge among the items
  std::vector<Node> nodes_;                    // depth first
};

}  // namespace

std::unique_ptr<EdgeSampler> make_li2019_sampler(const EdgeSamplerInput& input, bool solid) {
  return std::make_unique<Li2019Sampler>(input, solid);
}

}  // namespace limn
