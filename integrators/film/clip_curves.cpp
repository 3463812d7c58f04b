// Where the camera's clip planes cut faces.
#include "integrators/film/clip_curves.h"

#include "integrators/paths/path_follow.h"

namespace limn {
namespace {

// What rounding may make of the depth of points on a triangle, with a margin of 16 roundings.
double depth_rounding(const Camera& camera, const std::array<Vec3d, 3>& corners) {
  double size = 0;
  for (const Vec3d& x : corners) size = std::max(size, length(x - value(camera.origin)));
  return 0x1p-48 * size;
}

// Faces that a plane of this depth cuts.
void append_segments(const Scene& scene, ShapeId shape, double clip, bool at_far_plane,
                     std::vector<ClipSegment>& segments) {
  const Camera& camera = scene.camera;
  const Mesh& mesh = scene.shape(shape).mesh;
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
    const auto corners = face_corners<double>(mesh, FaceId(f));
    bool beyond[3];
    for (int k = 0; k < 3; ++k) beyond[k] = camera.depth(corners[k]) > clip;
    if ((beyond[0] == beyond[1] && beyond[1] == beyond[2]) || !has_area(mesh, mesh.faces[f]))
      continue;
    // Seen only by a pinhole on the face itself, as far as double precision can tell.
    if (clip < depth_rounding(camera, corners)) continue;
    const auto moving = face_corners<Dual>(mesh, FaceId(f));
    ClipSegment segment{{shape, FaceId(f)}, at_far_plane, {}, {}};
    int count = 0;
    for (int k = 0; k < 3; ++k) {
      const int next = (k + 1) % 3;
      if (beyond[k] == beyond[next]) {
        // The third corner is on the other side, alone.
        const Vec3d apart = corners[(k + 2) % 3] - corners[k];
        segment.into_view = beyond[k] == at_far_plane ? apart : -apart;
        continue;
      }
      const Dual a = camera.depth(moving[k]), b = camera.depth(moving[next]);
      segment.ends[count++] = moving[k] + (moving[next] - moving[k]) * ((clip - a) / (b - a));
    }
    segments.push_back(segment);
  }
}

}  // namespace

std::vector<ClipSegment> find_clip_segments(const Scene& scene) {
  std::vector<ClipSegment> segments;
  for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
    // The camera sees no emitter, whole or cut.
    if (scene.hide_emitters && scene.shapes[s].is_emitter) continue;
    append_segments(scene, ShapeId(s), scene.camera.near_clip, false, segments);
    append_segments(scene, ShapeId(s), scene.camera.far_clip, true, segments);
  }
  return segments;
}

bool clip_difference(const PathContext& context, const ClipSegment& segment, const Vec3d& from,
                     const Vec3d& y, const Rng& key, RayCount& rays, Rgb<double>& difference) {
  const Scene& scene = context.scene;
  const double distance = length(y - from);
  Ray ray{from, (y - from) / distance};
  const double cosine = dot(ray.direction, value(scene.camera.forward));
  ray.skip_emitters = scene.hide_emitters;
  Hit cut{segment.face, distance};
  context.tracer.settle(ray, cut);
  if (cut.face != segment.face) return false;  // it is not seen where it is cut
  ray.start = segment.face;
  ray.t_min = segment.at_far_plane ? scene.camera.near_clip / cosine : distance;
  ray.t_max = segment.at_far_plane ? distance : scene.camera.far_clip / cosine;
  Hit hit;
  ++rays.closest;
  const bool found = context.tracer.closest(ray, hit);
  if (found && segment.at_far_plane) return false;

  PathTracer<double, NoVisitor> path(context, rays);
  const Rng side_key = key.at(Purpose::kEdgeSide, 0);  // of both sides, as in edge_difference
  const auto leaving = [&](FaceRef face) {
    Walk<double, NoVisitor> walk(side_key, 0, nullptr);
    path.place(walk, surface_on_ray<double>(scene, face, from, ray.direction), -ray.direction);
    path.follow_one(walk);
    return walk.radiance();
  };
  difference = (found ? leaving(hit.face) : path.escaped(ray.direction, 0)) - leaving(segment.face);
  return true;
}

}  // namespace limn
