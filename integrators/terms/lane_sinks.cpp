// Velocities put into boundary samples.
#include "integrators/terms/lane_sinks.h"

#include <fmt/format.h>

#include <cmath>

#include "limn/core/surface_point.h"

namespace limn {
namespace {

Lanes along(const Vec3<Lanes>& v, const Vec3d& g) { return v.x * g.x + v.y * g.y + v.z * g.z; }

Vec3<Lanes> velocity_of(const Vec3<Dual>& v) { return {v.x.d, v.y.d, v.z.d}; }

// How a viewer's ray moves.
struct RayMotion {
  Vec3d origin;
  Vec3<Lanes> velocity;        // of the origin
  DirectionTurn turn = {};     // of directions there
  Vec3<Lanes> direction = {};  // velocity of the unit direction besides
};

Vec3<Lanes> against_ray(const Vec3<Lanes>& velocity, const Vec3d& x, const RayMotion& ray) {
  return velocity - ray.velocity - ray.turn.velocity(x - ray.origin);
}

// v(X) - v_ray but for the velocity of the unit direction. Ends of an edge that moves with the ray
// are at rest, exactly.
Vec3<Lanes> relative_velocity(const Scene& scene, const BoundaryForm& form,
                              const MovingPoint& point, const RayMotion& ray) {
  switch (point.of) {
    case MovingPoint::Of::kEdge: {
      const auto end = [&](VertexId vertex) {
        const Vec3<Lanes> own =
            point.mesh->tangents.empty() ? Vec3<Lanes>{} : point.mesh->tangent(vertex);
        // The point of a single edge is x itself: the mean of its ends' turns is that at x.
        return against_ray(own, form.count == 1 ? point.mesh->position(vertex) : form.x, ray);
      };
      const auto [a, b] = point.mesh->edge(point.edge.edge).vertices;
      if (point.t == 0 || point.t == 1) return end(point.t == 0 ? a : b);
      return end(a) * (1 - point.t) + end(b) * point.t;
    }
    case MovingPoint::Of::kFace: {
      const Mesh& mesh = scene.shape(point.face.shape).mesh;
      const auto corners = face_corners<Dual>(mesh, point.face.face);
      const auto b =
          barycentric({value(corners[0]), value(corners[1]), value(corners[2])}, point.x);
      Vec3<Lanes> sum;
      for (int k = 0; k < 3; ++k) sum = sum + velocity_of(corners[k]) * b[k];
      return against_ray(sum, form.x, ray);
    }
    case MovingPoint::Of::kLight:
      break;
  }
  const LightOrigin origin = point.light->origin();
  const Vec3<Lanes> own = velocity_of(origin.v);
  return origin.infinite ? own : against_ray(own, form.x, ray);
}

// What the corners of the face and their normals add to g . v of a lifted point, but for the
// velocity of the unit direction.
Lanes rate_of_lift(const Scene& scene, const BoundaryForm& form, const RayMotion& ray) {
  const Mesh& mesh = scene.shape(form.lift->face.shape).mesh;
  const auto corners = face_corners<Dual>(mesh, form.lift->face.face);
  const auto normals = detail::corner_normals<Dual>(mesh, form.lift->face.face);
  Lanes sum{};
  for (int k = 0; k < 3; ++k) {
    const Vec3<Lanes> v = against_ray(velocity_of(corners[k]), form.x, ray);
    sum += along(v - ray.direction * form.distance, form.lift->of_corners[k]);
    sum += along(velocity_of(normals[k]), form.lift->of_normals[k]);
  }
  return sum;
}

Lanes rate_of(const Scene& scene, const BoundaryForm& form, const RayMotion& ray) {
  const auto of_point = [&](const MovingPoint& point) {
    const Vec3<Lanes> v = relative_velocity(scene, form, point, ray);
    // A light at infinity is no point that the ray carries.
    const bool infinite = point.light && point.light->origin().infinite;
    return along(infinite ? v : v - ray.direction * form.distance, point.g);
  };
  Lanes sum = of_point(form.points[0]);
  for (const MovingPoint& point : form.all().subspan(1)) sum += of_point(point);
  if (form.lift) sum += rate_of_lift(scene, form, ray);
  return sum * form.scale;
}

// Of a ray from a vertex that leaves in a direction at rest, beyond the mirrors.
RayMotion image_of_ray(const Scene& scene, const BoundaryForm& form, const PathVertex& vertex) {
  const Vec3d &p = vertex.surface.p, &w = form.leaves;
  const Vec3<Lanes>& v = vertex.velocity;
  Vec3<Dual> origin{{p.x, v.x}, {p.y, v.y}, {p.z, v.z}}, direction{w.x, w.y, w.z};
  const auto corners = [&](FaceRef face) {
    return face_corners<Dual>(scene.shape(face.shape).mesh, face.face);
  };
  reflect_ray(form.by, corners, origin, direction);
  return {value(origin), velocity_of(origin), {}, velocity_of(direction)};
}

}  // namespace

bool VertexLanes::takes(const BoundaryForm& form, const Rng& key) {
  form_ = &form;
  RayMotion ray{vertex_.surface.p, vertex_.velocity, form.held ? DirectionTurn{} : vertex_.turn};
  if (setting_.warp) {
    RayCount rays;
    DirectionWarper warper(*setting_.warp, rays);
    const Vec3d omega = (form.x - ray.origin) / form.distance;
    const Rng rng = key.at(Purpose::kEdge, vertex_.bounces).at(Purpose::kEdge, 1);
    const DirectionMotion* motion = warper.motion(surface_, omega, rng);
    cost().add(rays);
    ray.turn = {};
    if (motion) ray.direction = velocity_of(warped(omega, *motion->warp));
  }
  if (form.by.count > 0) ray = image_of_ray(setting_.scene, form, vertex_);
  rate_ = rate_of(setting_.scene, form, ray);
  return !is_zero(rate_) || turned_;
}

// What adds much is always traced; else by chance, and then it counts for what is not.
bool VertexLanes::survives(const Rgb<double>& scattered, const Rng& key) {
  if (turned_ || is_zero(survival_)) return true;
  double squares = 0;
  for (int k = 0; k < kLanes; ++k) {
    const double w = rate_[k] * survival_[k];
    squares += w * w;
  }
  const double probability = std::sqrt(squares) * luminance(scattered);
  if (!(probability < 1)) return true;
  if (key.at(Purpose::kDrawRoulette, vertex_.bounces).uniform() >= probability) return false;
  rate_ = rate_ * (1 / probability);
  return true;
}

// A run would decide on draws that move for a parameter.
void VertexLanes::traced(const Rgb<double>& scattered, const RayCount& rays,
                         const Rgb<double>& amount) {
  if (!setting_.traced) return;
  double moves = 0;
  for (int k = 0; k < setting_.parameters; ++k) moves += std::fabs(rate_[k]);
  if (moves == 0) return;
  const double unit = luminance(scattered);
  double squares = 0;
  for (int c = 0; c < 3; ++c) squares += amount[c] * amount[c];
  setting_.traced->add({1, rays.total(), unit > 0 ? squares / (unit * unit) : 0});
}

void VertexLanes::add(const Rgb<double>& amount) {
  const Rgb<Lanes> added{rate_ * amount.r, rate_ * amount.g, rate_ * amount.b};
  sum_ = sum_ + added;
  if (turned_) {
    const Vec3d from = vertex_.surface.p;
    const Vec3<Lanes> turn = form_->held ? Vec3<Lanes>{} : turned_->turn.velocity(form_->x - from);
    const Lanes swept = along(turned_->velocity + turn, form_->of_ray()) * form_->scale;
    for (int c = 0; c < 3; ++c) turned_->sum[c] += swept * amount[c];
  }
  if (log()) {
    log()->push_back(fmt::format("    adds ({:.6g}, {:.6g}, {:.6g}) to the first parameter",
                                 added.r[0], added.g[0], added.b[0]));
  }
}

bool FilmLanes::at(const FilmPlace& place) {
  place_ = place;
  sample_.x = place.x;
  sample_.y = place.y;
  return true;
}

bool FilmLanes::takes(const BoundaryForm& form, const Rng&) {
  form_ = &form;
  const auto ray = ray_at(CameraView<Dual>(scene_.camera), place_);
  rate_ = rate_of(scene_, form,
                  {value(ray.origin), velocity_of(ray.origin), {}, velocity_of(ray.direction)});
  return !is_zero(rate_) || moves_film_ || (rates_ && form.turned);
}

void FilmLanes::add(const Rgb<double>& amount) {
  added_ = true;
  sample_.value = {rate_ * amount.r, rate_ * amount.g, rate_ * amount.b};
  if (rates_ && form_->turned) {
    const auto& [vertex, to, g] = *form_->turned;
    sample_.amount = amount * form_->scale;
    sample_.per_turn = rates_->per_turn(vertex, to, g);
  }
  if (!moves_film_) return;
  const auto ray = shifted_ray(scene_.camera, {{sample_.x, sample_.y}});
  const Vec3<Lanes> v = velocity_of(ray.origin) + velocity_of(ray.direction) * form_->distance;
  // Against positions that move.
  const Lanes rate = along(v, form_->of_ray()) * -form_->scale;
  sample_.along_x = amount * rate[0];
  sample_.along_y = amount * rate[1];
}

void FilmLanes::add_line(const FilmLineSample& line, const Rgb<double>& difference) {
  added_ = true;
  const Lanes speed = line.speed / line.density;
  sample_.value = {speed * difference.r, speed * difference.g, speed * difference.b};
  sample_.along_x = difference * (line.nx / line.density);
  sample_.along_y = difference * (line.ny / line.density);
}

}  // namespace limn
