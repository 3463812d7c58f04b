// Edges, light polygons and the environment of a scene, for edge samplers.
#include "integrators/edges/scene_edges.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>
#include <map>
#include <set>
#include <utility>

#include "integrators/edges/texture_discontinuities.h"
#include "limn/core/duplicate_faces.h"
#include "limn/core/exposure.h"
#include "limn/core/lights.h"
#include "limn/core/surface_point.h"
#include "limn/edgetree/crossing_curves.h"
#include "limn/edgetree/touching.h"

namespace limn {

namespace {

// Shapes look alike if they share a BSDF; every emitter looks like itself alone.
std::vector<TouchingShape> touching_shapes(const Scene& scene,
                                           std::span<const Mesh* const> meshes) {
  std::vector<TouchingShape> shapes;
  std::map<const Bsdf*, uint32_t> first_of_bsdf;
  for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
    const Shape& shape = scene.shapes[s];
    const uint32_t look =
        shape.is_emitter ? s : first_of_bsdf.emplace(shape.bsdf.get(), s).first->second;
    shapes.push_back({meshes[s], look, shape.mesh.textured});
  }
  return shapes;
}

// Duplicates cross others along one line: it is that of the first, also where they would part. As
// they cross the same faces, they are among those that cross.
void leave_out_duplicates(const Scene& scene, std::vector<IntersectionSegment>& segments) {
  const auto corners_of = [&](FaceRef face) {
    auto corners = face_corners<double>(scene.shape(face.shape).mesh, face.face);
    std::array<std::array<double, 3>, 3> sorted;
    for (int k = 0; k < 3; ++k) sorted[k] = {corners[k].x, corners[k].y, corners[k].z};
    std::sort(sorted.begin(), sorted.end());
    return sorted;
  };
  const auto place = [](FaceRef face) { return std::pair(face.shape, face.face); };
  std::map<std::array<std::array<double, 3>, 3>, FaceRef> firsts;
  for (const IntersectionSegment& segment : segments) {
    for (const FaceRef face : segment.faces) {
      FaceRef& first = firsts.emplace(corners_of(face), face).first->second;
      if (place(face) < place(first)) first = face;
    }
  }
  std::erase_if(segments, [&](const IntersectionSegment& segment) {
    return std::ranges::any_of(
        segment.faces, [&](FaceRef face) { return !(firsts.at(corners_of(face)) == face); });
  });
}

bool is_black_behind(const Shape& shape) { return shape.bsdf->side(false) == nullptr; }

// Whether all faces that a point sees the front of look alike from there: nothing is scattered, and
// what is emitted varies neither by place nor by vertex normals (SurfacePoint::emission).
bool ignores_normals(const Scene& scene, const Shape& shape) {
  const bool by_normals = scene.shading == ShadingModel::kMitsuba && !shape.mesh.normals.empty();
  if (shape.is_emitter && (shape.radiance_texture || by_normals)) return false;
  for (const bool front : {true, false}) {
    const Bsdf* side = shape.bsdf->side(front);
    if (side && !(side->is_lambertian() && side->lobe().albedo == 0)) return false;
  }
  return true;
}

// EdgeMesh::fold_contrast. Light that is scattered changes with the normal as the lobe does; where
// normals are not the faces', or textures may differ too, nothing is known.
float fold_contrast(const Shape& shape) {
  constexpr float kUnknown = std::numeric_limits<float>::infinity();
  if (shape.mesh.normal_source != NormalSource::kFace || shape.mesh.textured) return kUnknown;
  double most = 0;
  for (const bool front : {true, false}) {
    const Bsdf* side = shape.bsdf->side(front);
    if (!side) continue;
    const LobeSummary lobe = side->lobe();
    const bool summary = side->is_lambertian() || lobe.model != &kHemisphere;
    if (!summary || side->lobes().smooth || side->lobes().through) return kUnknown;
    most = std::max(most, lobe.albedo / lobe.model->width(lobe));
  }
  return static_cast<float>(most);
}

// Radiance of such a shape differs across an edge only where one of its faces is seen from behind.
void drop_folds(EdgeMesh& mesh) {
  for (Edge& edge : mesh.edges)
    if (edge.edge_class == EdgeClass::kSharp) edge.edge_class = EdgeClass::kSmooth;
}

using ShapePair = std::array<ShapeId, 2>;

bool is_of_lines(const EdgeMesh& mesh) { return !mesh.shape.valid(); }

// Those of lines of contact, not of crossings.
std::set<ShapePair> pressed_pairs(const EdgeSamplerInput& edges) {
  std::set<ShapePair> pairs;
  const auto found = std::find_if(edges.objects.begin(), edges.objects.end(), is_of_lines);
  if (found == edges.objects.end()) return pairs;
  const EdgeMesh& lines = *found;
  for (uint32_t e = 0; e < lines.edges.size(); ++e) {
    const FacesAround around = lines.around(EdgeId(e));
    if (around.incidence(0).motion_group == kNoMotionGroup) continue;
    const auto [first, second] = std::minmax(around.faces[0].shape, around.faces[1].shape);
    pairs.insert({first, second});
  }
  return pairs;
}

std::string pair_in_text(const Scene& scene, const ShapePair& pair) {
  const std::string first = quoted_name(scene, pair[0]);
  if (pair[0] == pair[1]) return fmt::format("faces of {}", first);
  return fmt::format("{} and {}", first, quoted_name(scene, pair[1]));
}

// As make_scene_edges(), of the chosen shapes alone: the objects of others are empty.
EdgeSamplerInput edges_of(const Scene& scene, const std::vector<bool>& chosen, int threads) {
  static const Mesh none;
  EdgeSamplerInput input;
  std::vector<const Mesh*> meshes;
  const TextureDiscontinuities textures(scene);
  for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
    const Shape& shape = scene.shapes[s];
    meshes.push_back(chosen[s] ? &shape.mesh : &none);
    if (!chosen[s]) {
      input.objects.emplace_back().shape = ShapeId(s);
      continue;
    }
    input.objects.push_back(build_edge_mesh(shape.mesh, is_black_behind(shape), ShapeId(s),
                                            textures.seams(ShapeId(s))));
    input.objects.back().fold_contrast = fold_contrast(shape);
    if (ignores_normals(scene, shape)) drop_folds(input.objects.back());
  }
  const Vec3d pinhole = value(scene.camera.origin);
  const std::vector<FacePair> pairs = find_face_pairs(meshes, pinhole, threads);
  const auto [contacts, parting] =
      unite_touching_edges(touching_shapes(scene, meshes), pairs, pinhole, threads, input.objects);
  std::vector<IntersectionSegment> crossings = find_intersections(meshes, pairs, threads);
  leave_out_duplicates(scene, crossings);
  if (!crossings.empty() || !contacts.empty())
    input.objects.push_back(intersection_edges(meshes, crossings, contacts));
  for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
    const auto segments = textures.segments(ShapeId(s));
    if (segments.empty() || !chosen[s]) continue;
    input.objects.push_back(
        texture_edges(*meshes[s], input.objects[s], is_black_behind(scene.shapes[s]), segments));
  }
  input.parting = parting;
  if (scene.environment) input.environment_luminance = scene.environment->mean_luminance();
  return input;
}

}  // namespace

EdgeSamplerInput make_scene_edges(const Scene& scene, int threads) {
  return edges_of(scene, std::vector<bool>(scene.shapes.size(), true), threads);
}

EdgeSamplerInput make_sampler_input(const Scene& scene, int threads) {
  EdgeSamplerInput input = make_scene_edges(scene, threads);
  add_light(scene, input);
  return input;
}

void add_light(const Scene& scene, EdgeSamplerInput& input) { KeptEdges().add_light(scene, input); }

void KeptEdges::add_light(const Scene& scene, EdgeSamplerInput& input) {
  const Lights lights(scene);
  for (const Light* light : lights.all()) light->add_triangles(input.lights);
  if (!scene.environment || scene.environment->is_uniform()) return;
  if (same_environment_ && environment_) {
    input.environment = environment_;
    return;
  }
  const auto brightness = [&](const Vec3d& d) {
    return std::max(0.0, luminance(scene.environment->radiance(d)));
  };
  input.environment = environment_ = std::make_shared<RadiancePyramid>(brightness, 8, 2);
}

static bool are_equal(const Tangents& a, const Tangents& b) {
  if (a.size() != b.size() || a.all_alike() != b.all_alike()) return false;
  const size_t count = a.all_alike() ? std::min<size_t>(1, a.size()) : a.size();
  for (size_t i = 0; i < count; ++i) {
    const Vec3<Lanes> d = a[i] - b[i];
    if (!is_zero(d.x) || !is_zero(d.y) || !is_zero(d.z)) return false;
  }
  return true;
}

bool KeptEdges::is_known(const Scene& scene) {
  bool known = !still_.objects.empty() && pinhole_ == value(scene.camera.origin);
  for (size_t s = 0; s < scene.shapes.size(); ++s) {
    if (moving_.size() == s) moving_.push_back(scene.exposure->shapes[s].moves());
    const Mesh& mesh = scene.shapes[s].mesh;
    if (!known || moving_[s]) continue;
    const Kept& kept = kept_[s];
    // Where it stands still, but its derivatives do not.
    moving_[s] = kept.positions != mesh.positions || kept.normals != mesh.normals ||
                 !are_equal(kept.tangents, mesh.position_tangents);
    known = !moving_[s];
  }
  return known;
}

// Objects are in the order of make_scene_edges().
EdgeSamplerInput KeptEdges::joined(EdgeSamplerInput moving) const {
  EdgeSamplerInput all = still_;
  const size_t shapes = moving_.size();
  for (size_t s = 0; s < shapes; ++s) {
    if (moving_[s]) all.objects[s] = std::move(moving.objects[s]);
  }
  all.objects.insert(all.objects.end(), std::move_iterator(moving.objects.begin() + shapes),
                     std::move_iterator(moving.objects.end()));
  const auto of_textures = std::find_if(all.objects.begin() + shapes, all.objects.end(),
                                        [](const EdgeMesh& mesh) { return mesh.of_texture(); });
  std::stable_sort(of_textures, all.objects.end(),
                   [](const EdgeMesh& a, const EdgeMesh& b) { return a.shape < b.shape; });
  all.parting.insert(all.parting.end(), moving.parting.begin(), moving.parting.end());
  std::ranges::sort(all.parting);
  return all;
}

EdgeSamplerInput KeptEdges::make(const Scene& scene, int threads) {
  shared_ = nullptr;
  if (!scene.exposure) return make_scene_edges(scene, threads);
  const bool known = is_known(scene);
  if (!is_apart(scene, moving_)) return make_scene_edges(scene, threads);
  if (!known) {
    std::vector<bool> still = moving_;
    still.flip();
    still_ = edges_of(scene, still, threads);
    still_shared_ = std::make_shared<SharedObjects>(SharedObjects{std::move(still)});
    pinhole_ = value(scene.camera.origin);
    kept_.clear();
    for (const Shape& shape : scene.shapes) {
      const Mesh& mesh = shape.mesh;
      kept_.push_back({mesh.positions, mesh.normals, mesh.position_tangents});
    }
  }
  EdgeSamplerInput moving = edges_of(scene, moving_, threads);
  if (std::ranges::any_of(moving.objects, is_of_lines)) return make_scene_edges(scene, threads);
  shared_ = still_shared_;
  return joined(std::move(moving));
}

void warn_of_contacts(const Scene& scene, const EdgeSamplerInput* edges,
                      std::vector<std::string>& warnings) {
  if (!edges) return;
  const auto warn = [&](const std::string& text) {
    if (std::find(warnings.begin(), warnings.end(), text) == warnings.end())
      warnings.push_back(text);
  };
  const std::set<ShapePair> pressed = pressed_pairs(*edges);
  for (const ShapePair& pair : pressed) {
    warn(fmt::format(
        "{} touch, and one moves towards the other or away from it: the derivative is that of "
        "pressing them together; apart, light comes in between, and the slope is another one "
        "(differences take the mean of both)",
        pair_in_text(scene, pair)));
  }
  constexpr size_t kMost = 8;
  size_t reported = 0;
  for (const ShapePair& pair : edges->parting) {
    if (pressed.count(pair) || ++reported > kMost) continue;
    warn(fmt::format(
        "{} touch along an edge and move apart or through each other: there the image is not "
        "differentiable; the derivative is that for an infinitesimal gap between them, which may "
        "equal neither one-sided derivative (differences take the mean of both); move them apart, "
        "or together",
        pair_in_text(scene, pair)));
  }
  if (reported > kMost)
    warn(fmt::format("{} more pairs of shapes touch and part like that", reported - kMost));
}

}  // namespace limn
