// Weights of boundary samples on what moves their points.
#include "integrators/backward/adjoint_sinks.h"

#include <fmt/format.h>

#include "integrators/film/clip_curves.h"
#include "integrators/terms/mirror_sight.h"
#include "limn/core/reverse.h"

namespace limn {

namespace {

// The corners of a face, as they may move.
auto moving_corners(const Scene& scene) {
  return [&scene](FaceRef face) { return corner_leaves(scene, face); };
}

// A point of a face on a clip plane, between two corners.
Vec3<Var> meet_clip_plane(const CameraView<Var>& camera, const Vec3<Var>& a, const Vec3<Var>& b,
                          double clip) {
  const Var depth_a = camera.depth(a), depth_b = camera.depth(b);
  return a + (b - a) * ((clip - depth_a) / (depth_b - depth_a));
}

// The point at t of where the face meets the plane, as clip_curves.cpp lists its ends.
Vec3<Var> clip_point(const Scene& scene, const CameraView<Var>& view, const ClipSegment& segment,
                     double t) {
  const Camera& camera = scene.camera;
  const double clip = segment.at_far_plane ? camera.far_clip : camera.near_clip;
  const auto corners = corner_leaves(scene, segment.face);
  Vec3<Var> ends[2];
  int count = 0;
  for (int k = 0; k < 3; ++k) {
    const Vec3<Var>&a = corners[k], &b = corners[(k + 1) % 3];
    const bool beyond_a = camera.depth(value(a)) > clip, beyond_b = camera.depth(value(b)) > clip;
    if (beyond_a != beyond_b) ends[count++] = meet_clip_plane(view, a, b, clip);
  }
  return ends[0] + (ends[1] - ends[0]) * t;
}

}  // namespace

bool VertexAdjoint::takes(const BoundaryForm& form, const Rng&) {
  form_ = &form;
  return form.scale != 0 && (motion_.moves(form) || !is_constant(p_) || form.by.count > 0);
}

void VertexAdjoint::add(const Rgb<double>& amount) {
  const double weight = weighed(adjoint_, amount) * form_->scale;
  if (weight == 0) return;
  motion_.contribute(tape_, seeds_, *form_, weight);
  const Vec3d g = form_->of_ray() * weight;
  if (form_->by.count == 0) {
    seeds_.add(p_, g);
  } else {
    Vec3<Var> origin = p_, direction{form_->leaves.x, form_->leaves.y, form_->leaves.z};
    reflect_ray(form_->by, moving_corners(motion_.scene()), origin, direction);
    seeds_.add(origin, g);
    seeds_.add(direction, g * form_->distance);
  }
  if (log()) log()->push_back(fmt::format("    adds with weight {:.6g}", weight));
}

bool FilmPointAdjoint::at(const FilmPlace& place) {
  place_ = place;
  adjoint_ = film_.at(place.x, place.y);
  return has_adjoint_ = !is_black(adjoint_);
}

bool FilmPointAdjoint::takes(const BoundaryForm& form, const Rng&) {
  form_ = &form;
  return motion_.moves(form) || motion_.slots().camera != 0 || film_moves();
}

void FilmPointAdjoint::add(const Rgb<double>& amount) {
  added_ = true;
  const double weight = weighed(adjoint_, amount) * form_->scale * share_;
  motion_.contribute(tape_, seeds_, *form_, weight);
  if (motion_.slots().camera == 0 && form_->by.count == 0 && !film_moves()) return;
  auto ray = moving_ray(motion_.scene(), field_, place_);
  double distance = form_->distance;
  if (form_->by.through) {
    refract_ray(motion_.scene(), form_->by, ray.origin, ray.direction);
    distance = length(form_->x - value(ray.origin));
  } else {
    reflect_ray(form_->by, moving_corners(motion_.scene()), ray.origin, ray.direction);
  }
  const Vec3d g = form_->of_ray() * weight;
  seeds_.add(ray.origin, g);
  seeds_.add(ray.direction, g * distance);
}

// With J the derivative of the film position of a point of the scene, the normal speed of the line
// is n . J (v - v_ray).
void FilmPointAdjoint::add_line(const FilmLineSample& line, const Rgb<double>& difference) {
  added_ = true;
  if (line.clip) {
    add_clip(line, weighed(adjoint_, difference) * share_ / line.density);
    return;
  }
  const auto [a, b] = line.mesh->edge(line.edge.edge).vertices;
  BoundaryForm form;
  form.x = line.mesh->position(a) * (1 - line.t) + line.mesh->position(b) * line.t;
  form.scale = 1 / line.density;
  form.by = line.by;
  form_ = &form;
  if (line.by.through) {
    form.add_edge(*line.mesh, line.edge, line.t, line.g);
    add(difference);
    return;
  }
  Camera camera = motion_.scene().camera;
  for (const FaceRef face : line.by.all()) {
    const Mesh& mesh = motion_.scene().shape(face.shape).mesh;
    const auto corners = face_corners<double>(mesh, face.face);
    camera = image_of(camera, at_rest(MirrorPlane<double>::through(corners)));
  }
  const CameraView<Dual> view = CameraView<Dual>(camera).at(place_.lens);
  const Vec3<Dual> x{{form.x.x, {1, 0, 0, 0}}, {form.x.y, {0, 1, 0, 0}}, {form.x.z, {0, 0, 1, 0}}};
  form.distance = length(form.x - value(view.start_of(x)));
  const auto at = view.project(x);
  Vec3d g;
  for (int k = 0; k < 3; ++k) g[k] = line.nx * at.x.d[k] + line.ny * at.y.d[k];
  form.add_edge(*line.mesh, line.edge, line.t, g);
  add(difference);
}

// The cut moves with the camera and the face: that is easier on the tape.
void FilmPointAdjoint::add_clip(const FilmLineSample& line, double weight) {
  const CameraView<Var> view = camera_leaves(motion_.scene().camera).at(place_.lens);
  const auto position = view.project(clip_point(motion_.scene(), view, *line.clip, line.t));
  seeds_.add(position.x.node, weight * line.nx);
  seeds_.add(position.y.node, weight * line.ny);
  if (!film_moves()) return;
  const auto film = field_->moving(place_);
  seeds_.add(film.x.node, -weight * line.nx);
  seeds_.add(film.y.node, -weight * line.ny);
}

}  // namespace limn
