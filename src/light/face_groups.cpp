// A wide tree of the faces of an emitter.
#include "src/light/face_groups.h"

#include <algorithm>
#include <cmath>

namespace limn {
namespace {

// Most nodes above a face. With one more, images of spheres and a torus have 0.6 to 0.85 of the
// variance in 1.1 to 1.2 of the time, and nodes take eight times the memory.
constexpr int kDepth = 3;
// Share of draws by area, at each node: a part may shine though it is not expected to. A tenth and
// a hundredth were no better.
constexpr double kAny = 1.0 / 32;
// Variance of the normals of a group that counts as flat. Not tuned.
constexpr double kFlat = 1e-6;

}  // namespace

struct FaceGroups::Face {
  Vec3d center, normal;
  double area;
  uint32_t index;
};

struct FaceGroups::Group {
  double area = 0;
  Vec3d center, normal;  // means over area
  Vec3d spread, bend;    // their variances
  bool flat = false;     // not to be divided
};

FaceGroups::FaceGroups(const Mesh& mesh, DrawFaces draw) {
  std::vector<Face> faces;
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
    const auto c = face_corners<double>(mesh, FaceId(f));
    const Vec3d n = cross(c[1] - c[0], c[2] - c[0]);
    const double area = 0.5 * length(n);
    areas_.add(area);
    if (area > 0) faces.push_back({(c[0] + c[1] + c[2]) / 3.0, n / (2 * area), area, f});
  }
  inverse_area_ = 1 / areas_.sum();
  if (draw == DrawFaces::kByArea || faces.empty()) return;
  const Group whole = group_of(faces);
  if (whole.flat) return;
  order_.reserve(faces.size());
  leaf_of_.resize(mesh.faces.size());
  areas_ = {};
  add(faces, whole, {}, 0);
  for (Leaf& leaf : leaves_) {
    leaf.below = leaf.below / areas_.sum();
    leaf.share = leaf.share / areas_.sum();
  }
}

FaceGroups::Group FaceGroups::group_of(std::span<const Face> faces) {
  Group group;
  for (const Face& face : faces) {
    group.area += face.area;
    group.center += face.center * face.area;
    group.normal += face.normal * face.area;
  }
  group.center = group.center / group.area;
  group.normal = group.normal / group.area;
  for (const Face& face : faces) {
    const Vec3d x = face.center - group.center, n = face.normal - group.normal;
    const double share = face.area / group.area;
    group.spread += Vec3d{x.x * x.x, x.y * x.y, x.z * x.z} * share;
    group.bend += Vec3d{n.x * n.x, n.y * n.y, n.z * n.z} * share;
  }
  group.flat = group.bend.x + group.bend.y + group.bend.z < kFlat;
  return group;
}

// Halves the part that varies most in place and normal, at the mean of what varies most, until
// there are eight or all are flat.
std::vector<std::span<FaceGroups::Face>> FaceGroups::parts_of(std::span<Face> faces,
                                                              const Group& whole) {
  const double size = whole.spread.x + whole.spread.y + whole.spread.z;
  const auto varies = [&](const Group& group, int k) {
    return group.area * (k < 3 ? group.bend[k] : group.spread[k - 3] / size);
  };
  std::vector<std::span<Face>> parts{faces};
  std::vector<Group> groups{whole};
  while (parts.size() < wide::kWidth) {
    size_t part = 0;
    double most = 0;
    for (size_t i = 0; i < groups.size(); ++i) {
      double sum = 0;
      for (int k = 0; k < 6; ++k) sum += varies(groups[i], k);
      if (groups[i].flat || sum <= most) continue;
      most = sum;
      part = i;
    }
    if (most == 0) break;
    Group& group = groups[part];
    int axis = 0;
    for (int k = 1; k < 6; ++k) {
      if (varies(group, k) > varies(group, axis)) axis = k;
    }
    const std::span<Face> all = parts[part];
    const auto middle = std::stable_partition(all.begin(), all.end(), [&](const Face& face) {
      return axis < 3 ? face.normal[axis] < group.normal[axis]
                      : face.center[axis - 3] < group.center[axis - 3];
    });
    if (middle == all.begin() || middle == all.end()) {  // by rounding
      group.flat = true;
      continue;
    }
    const auto at = static_cast<std::ptrdiff_t>(part);
    parts[part] = {all.begin(), middle};
    parts.insert(parts.begin() + at + 1, {middle, all.end()});
    group = group_of(parts[part]);
    groups.insert(groups.begin() + at + 1, group_of(parts[part + 1]));
  }
  return parts;
}

// The node of these faces, or the complement of their leaf.
int32_t FaceGroups::add(std::span<Face> faces, const Group& group, Place place, int depth) {
  const auto parts =
      depth == kDepth || group.flat ? std::vector<std::span<Face>>{faces} : parts_of(faces, group);
  if (parts.size() == 1) {
    const auto leaf = static_cast<uint32_t>(leaves_.size());
    const auto first = static_cast<uint32_t>(order_.size());
    const double below = areas_.sum();
    for (const Face& face : faces) {
      leaf_of_[face.index] = leaf;
      order_.push_back(face.index);
      areas_.add(face.area);
    }
    leaves_.push_back({first, static_cast<uint32_t>(order_.size()), below, areas_.sum() - below,
                       1 / group.area, place});
    return ~static_cast<int32_t>(leaf);
  }
  const auto index = static_cast<uint32_t>(nodes_.size());
  Node node{};
  node.place = place;
  std::vector<Group> groups;
  for (size_t i = 0; i < wide::kWidth; ++i) {
    node.spread.v[i] = 1;
    if (i >= parts.size()) continue;
    const Group& part = groups.emplace_back(group_of(parts[i]));
    for (int k = 0; k < 3; ++k) {
      node.center[k].v[i] = part.center[k];
      node.normal[k].v[i] = part.normal[k];
    }
    node.share.v[i] = part.area / group.area;
    node.spread.v[i] = part.area / kPi;
    if (part.flat) continue;
    node.bend.v[i] = (part.bend.x + part.bend.y + part.bend.z) / 3;
    node.extent.v[i] = (part.spread.x + part.spread.y + part.spread.z) / 3;
  }
  nodes_.push_back(node);
  for (uint32_t i = 0; i < parts.size(); ++i) {
    const int32_t part = add(parts[i], groups[i], {index, i}, depth + 1);
    nodes_[index].parts[i] = part;
  }
  return static_cast<int32_t>(index);
}

// A group shows p the mean of its faces' cosines, negative ones as 0. This is about
// (c + sqrt(c^2 + v)) / 2, with c the mean of all cosines and v about their variance, which comes
// from normals and from places. That is exact for flat groups, where v = 0.
wide::Doubles FaceGroups::probabilities(const Node& node, const Vec3d& p) const {
  const wide::Vec to = wide::Vec{p.x, p.y, p.z} - node.center;
  const wide::Doubles squared = length_squared(to), along = dot(node.normal, to);
  const wide::Doubles shown =
      max(along + sqrt(along * along + node.bend * squared + node.extent), wide::Doubles(0));
  const wide::Doubles distance = sqrt(squared + 3 * node.extent + wide::Doubles(1e-300));
  const wide::Doubles sent = node.share * shown / (distance * (squared + node.spread));
  double sums[4];
  for (int i = 0; i < 4; ++i) sums[i] = sent[i] + sent[i + 4];
  const double sum = (sums[0] + sums[1]) + (sums[2] + sums[3]);
  if (!(sum > 0 && std::isfinite(sum))) return node.share;
  return sent * wide::Doubles((1 - kAny) / sum) + node.share * wide::Doubles(kAny);
}

FaceGroups::Drawn FaceGroups::draw(const Vec3d& p, double u) const {
  if (nodes_.empty()) {
    return {FaceId(static_cast<uint32_t>(areas_.sample(u).index)), inverse_area_};
  }
  double probability = 1;
  int32_t at = 0;
  while (at >= 0) {
    const Node& node = nodes_[static_cast<size_t>(at)];
    const wide::Doubles of = probabilities(node, p);
    int part = 0;
    for (int i = 0; i + 1 < wide::kWidth && u >= of[i]; ++i) {
      if (!(of[i + 1] > 0)) break;  // by rounding
      u -= of[i];
      part = i + 1;
    }
    u = std::min(u / of[part], 1 - 0x1p-53);
    probability *= of[part];
    at = node.parts[part];
  }
  const Leaf& leaf = leaves_[static_cast<size_t>(~at)];
  const auto found = static_cast<uint32_t>(areas_.sample(leaf.below + u * leaf.share).index);
  const uint32_t face = order_[std::clamp(found, leaf.first, leaf.last - 1)];
  return {FaceId(face), probability * leaf.density};
}

double FaceGroups::density(const Vec3d& p, FaceId face) const {
  if (nodes_.empty()) return inverse_area_;
  const Leaf& leaf = leaves_[leaf_of_[face.index()]];
  double density = leaf.density;
  for (Place at = leaf.place; at.node != Place().node; at = nodes_[at.node].place) {
    density *= probabilities(nodes_[at.node], p)[static_cast<int>(at.part)];
  }
  return density;
}

}  // namespace limn
