// Surfaces, lights and the camera as statements on a tape.
#include "limn/core/reverse.h"

#include "limn/core/framed_light.h"

namespace limn {

namespace {

void contribute(Tape& tape, uint32_t slot, const Vec3d& g) {
  for (int k = 0; k < 3; ++k) tape.contribute(slot + k, g[k]);
}

// The adjoint of the barycentric coordinates b1 = (q x e2).n / n^2, b2 = (e1 x q).n / n^2 of x on
// the face with corners c, where q = x - c0: adds to `of`. Slivers take constant coordinates in
// interpolate_shading; on flat meshes, too, their derivatives are left out.
void pull_back_barycentrics(const std::array<Vec3d, 3>& c, const Vec3d& x,
                            const std::array<double, 2>& of_b, ShadingAdjoint& of) {
  const Vec3d e1 = c[1] - c[0], e2 = c[2] - c[0], q = x - c[0], n = cross(e1, e2);
  const double inverse = 1 / dot(n, n);
  const Vec3d x1 = cross(q, e2), x2 = cross(e1, q);
  const double b1 = dot(x1, n) * inverse, b2 = dot(x2, n) * inverse;
  if (!(std::fabs(b1) <= 2 && std::fabs(b2) <= 2)) return;
  const Vec3d of_x1 = n * (of_b[0] * inverse), of_x2 = n * (of_b[1] * inverse);
  const Vec3d of_n =
      (x1 * of_b[0] + x2 * of_b[1] - n * (2 * (b1 * of_b[0] + b2 * of_b[1]))) * inverse;
  const Vec3d of_q = cross(e2, of_x1) + cross(of_x2, e1);
  const Vec3d of_e1 = cross(q, of_x2) + cross(e2, of_n), of_e2 = cross(of_x1, q) + cross(of_n, e1);
  of.x += of_q;
  of.corners[0] += -of_q - of_e1 - of_e2;
  of.corners[1] += of_e1;
  of.corners[2] += of_e2;
}

// The adjoint of surface_on_ray: of x = o + t d, t = (c0 - o) . N / (d . N), and of what is found
// at x. Nodes and values: of o, then of d.
void pull_back_surface(Tape& tape, const Tape::Composite& s) {
  const auto read = [&](int first) {
    return Vec3d{tape.adjoint(s.first + first), tape.adjoint(s.first + first + 1),
                 tape.adjoint(s.first + first + 2)};
  };
  const Vec3d of_p = read(0), of_normal = read(3);
  std::array<double, 2> of_b{};
  for (uint32_t k = 0; k + 6 < s.outputs; ++k) of_b[k] = tape.adjoint(s.first + 6 + k);
  const bool looked_up = of_b[0] != 0 || of_b[1] != 0;
  if (of_p == Vec3d{} && of_normal == Vec3d{} && !looked_up) return;
  const FaceRef face{ShapeId(s.shape), FaceId(s.part)};
  const Scene& scene = *tape.slots()->scene;
  const Mesh& mesh = scene.shape(face.shape).mesh;
  const MeshSlots& slots = tape.slots()->mesh(face.shape);
  const auto c = face_corners<double>(mesh, face.face);
  const Vec3d o{s.values[0], s.values[1], s.values[2]}, d{s.values[3], s.values[4], s.values[5]};
  const Vec3d e1 = c[1] - c[0], e2 = c[2] - c[0], n = cross(e1, e2);
  const double slope = dot(n, d);
  const double t = dot(c[0] - o, n) / slope;
  ShadingAdjoint of{of_p, {}, {}};
  Vec3d of_n;
  if (mesh.normal_source == NormalSource::kFace) {
    const double size = length(n);
    const Vec3d unit = n / size;
    of_n = (of_normal - unit * dot(unit, of_normal)) / size;
  } else {
    of = pull_back_shading(scene, face, o + d * t, d, of_p, of_normal);
    for (int k = 0; k < 3 && slots.normals != 0; ++k) {
      const uint32_t id = mesh.normal_ids[face.face.index()][k];
      contribute(tape, slots.normals + 3 * id, of.normals[k]);
    }
  }
  if (looked_up) pull_back_barycentrics(c, o + d * t, of_b, of);
  const double k = dot(of.x, d) / slope;
  const Vec3d of_o = of.x - n * k, of_d = of.x * t - n * (k * t);
  for (int i = 0; i < 3; ++i) {
    tape.adjoint(s.nodes[i]) += of_o[i];
    tape.adjoint(s.nodes[3 + i]) += of_d[i];
  }
  if (slots.positions == 0) return;
  of_n += (c[0] - o) * k - d * (k * t);
  const Vec3d of_e1 = cross(e2, of_n), of_e2 = cross(of_n, e1);
  of.corners[0] += n * k - of_e1 - of_e2;
  of.corners[1] += of_e1;
  of.corners[2] += of_e2;
  for (int i = 0; i < 3; ++i) {
    contribute(tape, slots.positions + 3 * mesh.weld[mesh.face(face.face)[i]], of.corners[i]);
  }
}

// A colour of an object's own parameters alone. eval(object): the colour with its derivatives.
template <class T, class Eval>
Rgb<Var> of_parameters(const SeededCopies<T>& copies, const Rgb<double>& value, const Eval& eval) {
  detail::Jacobian jacobian;
  for (const auto& copy : copies) jacobian.add(detail::leaves_of(copy.slots), eval(*copy.object));
  return jacobian.result(value);
}

// The adjoint of with_texels(): nodes and direction are those of the statement.
void pull_back_texels(Tape& tape, const Tape::Composite& s) {
  const double a[3] = {tape.adjoint(s.first), tape.adjoint(s.first + 1), tape.adjoint(s.first + 2)};
  if (a[0] == 0 && a[1] == 0 && a[2] == 0) return;
  const SceneSlots& slots = *tape.slots();
  const Vec3d d{s.values[0], s.values[1], s.values[2]};
  for (uint32_t c = 0; c < 3; ++c) tape.adjoint(s.nodes[c]) += a[c];
  const Environment& environment = *slots.scene->environment;
  const uint32_t first = slots.of(&environment);
  for (const auto& [texel, weight] : environment.texel_weights(d)) {
    for (uint32_t c = 0; c < 3; ++c) tape.contribute(first + 3 * texel + c, weight * a[c]);
  }
}

// Radiance of the environment from d, which is held, as its texels make it besides.
Rgb<Var> with_texels(const Vec3d& d, Rgb<Var> radiance) {
  Tape& tape = *Tape::current();
  if (tape.slots()->of(tape.slots()->scene->environment.get()) == 0) return radiance;
  const uint32_t first = tape.add({0,
                                   3,
                                   pull_back_texels,
                                   0,
                                   0,
                                   {radiance.r.node, radiance.g.node, radiance.b.node, 0, 0, 0},
                                   {d.x, d.y, d.z, 0, 0, 0}});
  for (int c = 0; c < 3; ++c) radiance[c].node = first + static_cast<uint32_t>(c);
  return radiance;
}

template <class S>
Rgb<S> as_colour(const Vec3<S>& v) {
  return {v.x, v.y, v.z};
}

}  // namespace

ShadingAdjoint pull_back_shading(const Scene& scene, FaceRef face, const Vec3d& x,
                                 const Vec3d& direction, const Vec3d& of_p,
                                 const Vec3d& of_normal) {
  const Mesh& mesh = scene.shape(face.shape).mesh;
  const auto c = face_corners<double>(mesh, face.face);
  const Vec3d e1 = c[1] - c[0], e2 = c[2] - c[0], n = cross(e1, e2);
  const double inverse = 1 / dot(n, n), size = length(n);
  const Vec3d q = x - c[0], x1 = cross(q, e2), x2 = cross(e1, q);
  double b1 = dot(x1, n) * inverse, b2 = dot(x2, n) * inverse;
  const bool wide = std::fabs(b1) <= 2 && std::fabs(b2) <= 2;
  if (!wide) b1 = b2 = 1.0 / 3;
  const std::array<double, 3> b = {1 - b1 - b2, b1, b2};
  const std::array<Vec3d, 3> normals = detail::corner_normals<double>(mesh, face.face);
  const Vec3d sum = normals[0] * b[0] + normals[1] * b[1] + normals[2] * b[2];
  const Vec3d unit = normalize(sum);
  const Vec3d of_sum = (of_normal - unit * dot(unit, of_normal)) / length(sum);
  std::array<double, 3> depth{};
  detail::Lift lift;
  if (wide && is_lifted(scene, face.shape)) {
    for (int k = 0; k < 3; ++k) depth[k] = dot(x - c[k], normals[k]);
    const Vec3d n_g = n / size;
    lift = detail::lift_of(normals, b, depth, n_g, dot(n_g, direction) < 0 ? 1 : -1, size, x);
  }
  ShadingAdjoint of{of_p, {}, {}};
  double of_b[3];
  for (int k = 0; k < 3; ++k) {
    // What lifts x is gain b depth n, depth = (x - corner) . n.
    const double along = dot(of_p, normals[k]) * lift.gain[k], of_depth = along * b[k];
    of_b[k] = dot(of_sum, normals[k]) + along * depth[k];
    of.x += normals[k] * of_depth;
    of.corners[k] += normals[k] * -of_depth;
    of.normals[k] = of_sum * b[k] + of_p * (lift.gain[k] * b[k] * depth[k]) + (x - c[k]) * of_depth;
  }
  if (!wide) return of;
  const double of_b1 = of_b[1] - of_b[0], of_b2 = of_b[2] - of_b[0];
  const double of_inverse = of_b1 * dot(x1, n) + of_b2 * dot(x2, n);
  const Vec3d of_x1 = n * (of_b1 * inverse), of_x2 = n * (of_b2 * inverse);
  const Vec3d of_q = cross(e2, of_x1) + cross(of_x2, e1);
  const Vec3d of_n =
      x1 * (of_b1 * inverse) + x2 * (of_b2 * inverse) - n * (2 * of_inverse * inverse * inverse);
  const Vec3d of_e1 = cross(q, of_x2) + cross(e2, of_n), of_e2 = cross(of_x1, q) + cross(of_n, e1);
  of.x += of_q;
  of.corners[0] += -of_q - of_e1 - of_e2;
  of.corners[1] += of_e1;
  of.corners[2] += of_e2;
  return of;
}

namespace {

// A texture's value: it follows the barycentric coordinates, and its texels.
Rgb<Var> texture_value(const Texture& texture, const TexturePoint<Dual>& point, ShapeId shape,
                       const std::array<Var, 2>& b) {
  const Rgb<Dual> f = texture.eval(point);
  detail::Jacobian jacobian;
  for (int k = 0; k < 2; ++k) jacobian.add(b[k].node, f.r.d[k], f.g.d[k], f.b.d[k]);
  Tape& tape = *Tape::current();
  const SceneSlots& slots = *tape.slots();
  if (const uint32_t slot = texture.is_tangent() ? slots.mesh(shape).directions
                                                 : slots.of(&texture.texels_on(*point.mesh))) {
    const TexturePoint<double> here{
        point.mesh, point.face, {b[0].v, b[1].v}, {point.uv[0].v, point.uv[1].v}};
    for (const auto& [texel, weight] : texture.texel_weights(here)) {
      for (uint32_t c = 0; c < 3; ++c) {
        Rgb<double> of;
        of[static_cast<int>(c)] = weight;
        if (texture.of_numbers()) of = grey(luminance(of));
        jacobian.add(tape.leaf(slot + 3 * texel + c), of.r, of.g, of.b);
      }
    }
  }
  const Rgb<Var> v = jacobian.result(value(f));
  return texture.of_numbers() ? Rgb<Var>{v.r, v.r, v.r} : v;
}

}  // namespace

template <>
void TexturesAt<Var>::resolve(const Bsdf& bsdf, const SurfacePoint<Var>& point) {
  count_ = bsdf.texture_count();
  const std::array<Dual, 2> b = {Dual(point.b[0].v, {1, 0, 0, 0}),
                                 Dual(point.b[1].v, {0, 1, 0, 0})};
  point_ = texture_point<Dual>(point.shape->mesh, point.face.face, b);
  for (int k = 0; k < count_; ++k) {
    moving_.values[k] = texture_value(bsdf.texture(k), point_, point.face.shape, point.b);
    held_.values[k] = value(moving_.values[k]);
  }
}

namespace detail {

template <>
Rgb<Var> textured_radiance<Var>(const Shape& shape, FaceId face, const std::array<Var, 2>& b) {
  const std::array<Dual, 2> along = {Dual(b[0].v, {1, 0, 0, 0}), Dual(b[1].v, {0, 1, 0, 0})};
  return texture_value(*shape.radiance_texture, texture_point<Dual>(shape.mesh, face, along),
                       ShapeId(), b);
}

namespace {

Rgb<Dual> held_colour(const Rgb<double>& c) { return {c.r, c.g, c.b}; }

// Calls visit(nodes) for values of textures that move, four at a time, while these move in `at`.
template <class Visit>
void for_textures(const Bsdf& bsdf, const TexturesAt<Var>& textures, Rgb<Dual>* at,
                  const Visit& visit) {
  std::array<ChannelSlots, kLanes> nodes{};
  int lane = 0, first = 0;
  const auto end_at = [&](int end) {
    if (lane > 0) visit(nodes);
    for (; first < end; ++first) at[first] = held_colour(textures.held()[first]);
    nodes = {};
    lane = 0;
  };
  for (int k = 0; k < textures.count(); ++k) {
    const Rgb<Var>& v = textures.moving()[k];
    if (is_constant(v)) continue;
    const bool mixes = bsdf.texture(k).mixes_channels();
    if (lane + (mixes ? 3 : 1) > kLanes) end_at(k);
    for (int c = 0; c < 3; ++c) {
      const uint32_t node = v[c].node;
      nodes[lane] =
          mixes ? ChannelSlots{node, node, node} : ChannelSlots{v.r.node, v.g.node, v.b.node};
      at[k][c].d[lane] = 1;
      if (mixes || c == 2) ++lane;
    }
  }
  end_at(textures.count());
}

struct Directions {
  const Vec3<Var>&n, &wi, &wo;
};

// Calls eval(bsdf, n, wi, wo, at) with each argument in turn moving, and add(nodes, what it gives).
template <class Eval, class Add>
void along_each(const Bsdf& bsdf, const SeededCopies<Bsdf>* copies, const Directions& directions,
                const TexturesAt<Var>& textures, const Eval& eval, const Add& add) {
  const Vec3<Var>&n = directions.n, &wi = directions.wi, &wo = directions.wo;
  Rgb<Dual> at[kMostTextures];
  for (int k = 0; k < textures.count(); ++k) at[k] = held_colour(textures.held()[k]);
  if (!is_constant(n)) add(n, eval(bsdf, along_axes(n), held(wi), held(wo), at));
  if (!is_constant(wi)) add(wi, eval(bsdf, held(n), along_axes(wi), held(wo), at));
  if (!is_constant(wo)) add(wo, eval(bsdf, held(n), held(wi), along_axes(wo), at));
  for_textures(bsdf, textures, at,
               [&](const auto& nodes) { add(nodes, eval(bsdf, held(n), held(wi), held(wo), at)); });
  if (!copies) return;
  TexturePoint<Dual> still = textures.point();
  for (int k = 0; k < 2; ++k) {
    still.b[k] = still.b[k].v;
    still.uv[k] = still.uv[k].v;
  }
  for (const auto& copy : *copies) {
    copy.object->resolve(still, at);
    add(leaves_of(copy.slots), eval(*copy.object, held(n), held(wi), held(wo), at));
  }
}

}  // namespace

template <>
Rgb<Var> eval_bsdf<Var>(const Bsdf& bsdf, const SeededCopies<Bsdf>* copies, const Vec3<Var>& n,
                        const Vec3<Var>& wi, const Vec3<Var>& wo, const TexturesAt<Var>& textures) {
  Jacobian jacobian;
  std::optional<Rgb<double>> f;
  along_each(
      bsdf, copies, {n, wi, wo}, textures,
      [](const Bsdf& of, const auto&... arguments) { return of.eval(arguments...); },
      [&](const auto& nodes, const Rgb<Dual>& moving) {
        jacobian.add(nodes, moving);
        if constexpr (std::is_same_v<decltype(nodes), const Vec3<Var>&>) f = value(moving);
      });
  return jacobian.result(f ? *f : bsdf.eval(value(n), value(wi), value(wo), textures.held()));
}

template <>
SmoothRay<Var> smooth_ray<Var>(const Bsdf& bsdf, const SeededCopies<Bsdf>* copies,
                               const Vec3<Var>& n, const Vec3<Var>& wi, int k,
                               const TexturesAt<Var>& textures) {
  SmoothRays<double> rays;
  bsdf.smooth_rays(value(n), value(wi), rays, textures.held());
  Jacobian direction, weight;
  along_each(
      bsdf, copies, {n, wi, {}}, textures,
      [k](const Bsdf& of, const Vec3<Dual>& normal, const Vec3<Dual>& from, const Vec3<Dual>&,
          const Rgb<Dual>* at) {
        SmoothRays<Dual> moving;
        of.smooth_rays(normal, from, moving, at);
        return moving[k];
      },
      [&](const auto& nodes, const SmoothRay<Dual>& moving) {
        direction.add(nodes, as_colour(moving.wo));
        weight.add(nodes, moving.weight);
      });
  const SmoothRay<double>& ray = rays[k];
  const Rgb<Var> wo = direction.result(as_colour(ray.wo));
  return {{wo.r, wo.g, wo.b}, weight.result(ray.weight), ray.eta, ray.total};
}

}  // namespace detail

template <>
SurfacePoint<Var> surface_on_ray<Var>(const Scene& scene, FaceRef face, const Vec3<Var>& origin,
                                      const Vec3<Var>& direction) {
  const auto point = surface_on_ray<double>(scene, face, value(origin), value(direction));
  const auto fixed = [](const Vec3d& v) { return Vec3<Var>{v.x, v.y, v.z}; };
  const auto& x = point.on_face;
  SurfacePoint<Var> moving{
      point.shape,      point.face,   fixed(point.p),           point.n_g,
      fixed(point.n_s), point.lifted, {point.b[0], point.b[1]}, {x[0], x[1], x[2]}};
  Tape& tape = *Tape::current();
  const MeshSlots& slots = tape.slots()->mesh(face.shape);
  if (slots.positions == 0 && is_constant(origin) && is_constant(direction)) return moving;
  if (is_lifted(scene, face.shape) && point.shape->bsdf->lobes().through) {
    const auto c = corner_leaves(scene, face);
    const Vec3<Var> n = cross(c[1] - c[0], c[2] - c[0]);
    const Vec3<Var> on_face = origin + direction * (dot(c[0] - origin, n) / dot(n, direction));
    moving.on_face = {on_face.x, on_face.y, on_face.z};
  }
  const bool textured = point.shape->mesh.textured;
  Tape::Composite statement{
      0, textured ? 8u : 6u, pull_back_surface, face.shape.index(), face.face.index(), {}, {}};
  for (int k = 0; k < 3; ++k) {
    statement.nodes[k] = origin[k].node;
    statement.nodes[3 + k] = direction[k].node;
    statement.values[k] = origin[k].v;
    statement.values[3 + k] = direction[k].v;
  }
  const uint32_t first = tape.add(statement);
  const bool flat = point.shape->mesh.normal_source == NormalSource::kFace;
  for (int k = 0; k < 3; ++k) {
    moving.p[k].node = first + k;
    if (!flat || slots.positions != 0) moving.n_s[k].node = first + 3 + k;
  }
  for (uint32_t k = 0; k < 2 && textured; ++k) moving.b[k].node = first + 6 + k;
  return moving;
}

template <>
Rgb<Var> Light::drawn_radiance<Var>(const LightSample& sample) const {
  const SceneSlots& slots = *Tape::current()->slots();
  if (sample.face) {
    const ShapeId shape = sample.face->shape;
    return detail::emitter_radiance<Var>(slots.scene->shape(shape), shape);
  }
  return with_texels(sample.wo,
                     of_parameters(slots.environment, drawn_value(sample),
                                   [&](const Light& seeded) { return seeded.drawn_dual(sample); }));
}

template <>
Environment::Sight<Var> Lights::environment<Var>(const Point& place, const Vec3d& wo,
                                                 const std::array<double, 2>& at) const {
  Environment::Sight<double> sight;
  environment_->look(wo, at, sight);
  const auto radiance = of_parameters(Tape::current()->slots()->environment, sight.radiance,
                                      [&](const Environment& seeded) {
                                        Environment::Sight<Dual> of;
                                        seeded.look(wo, at, of);
                                        return of.radiance;
                                      });
  return {with_texels(wo, radiance), sight.pdf * probability(place, area_lights_.size())};
}

template <>
Rgb<Var> environment_radiance<Var>(const Environment& environment, const Vec3<Var>& d) {
  const SeededCopies<Environment>& copies = Tape::current()->slots()->environment;
  detail::Jacobian jacobian;
  if (!is_constant(d)) jacobian.add(d, environment.radiance(detail::along_axes(d)));
  for (const auto& copy : copies) {
    jacobian.add(detail::leaves_of(copy.slots), copy.object->radiance(detail::held(d)));
  }
  return with_texels(value(d), jacobian.result(environment.radiance(value(d))));
}

template <>
std::optional<Arrival<Var>> arrival<Var>(const DeltaLight& light, const Vec3<Var>& p) {
  const auto at = light.arriving(value(p));
  if (!at) return {};
  detail::Jacobian direction, irradiance;
  if (!is_constant(p)) {
    const auto moving = *light.arriving(detail::along_axes(p));
    direction.add(p, as_colour(moving.wo));
    irradiance.add(p, moving.irradiance);
  }
  if (const auto* copies = Tape::current()->slots()->of(light)) {
    for (const auto& copy : *copies) {
      const auto nodes = detail::leaves_of(copy.slots);
      const auto seeded = *copy.object->arriving(detail::held(p));
      direction.add(nodes, as_colour(seeded.wo));
      irradiance.add(nodes, seeded.irradiance);
    }
  }
  if (const uint32_t slot = light.texture() ? Tape::current()->slots()->of(light.texture()) : 0) {
    for (const auto& [texel, weight] : light.texel_weights(value(p))) {
      for (uint32_t c = 0; c < 3; ++c) {
        irradiance.add(Tape::current()->leaf(slot + 3 * texel + c), c == 0 ? weight : 0,
                       c == 1 ? weight : 0, c == 2 ? weight : 0);
      }
    }
  }
  const Rgb<Var> wo = direction.result(as_colour(at->wo));
  return Arrival<Var>{{wo.r, wo.g, wo.b}, irradiance.result(at->irradiance)};
}

Vec3<Var> light_origin(const DeltaLight& light) {
  const Rgb<double> at = as_colour(value(light.origin().v));
  const auto* copies = Tape::current()->slots()->of(light);
  if (!copies) return {at.r, at.g, at.b};
  const Rgb<Var> v = of_parameters(
      *copies, at, [](const DeltaLight& seeded) { return as_colour(seeded.origin().v); });
  return {v.r, v.g, v.b};
}

Vec3<Var> corner_of_frame(const FramedLight& light, size_t corner) {
  const Rgb<double> at = as_colour(value(light.corners()[corner]));
  const auto* copies = Tape::current()->slots()->of(light);
  if (!copies) return {at.r, at.g, at.b};
  const Rgb<Var> v = of_parameters(*copies, at, [&](const DeltaLight& seeded) {
    return as_colour(static_cast<const FramedLight&>(seeded).corners()[corner]);
  });
  return {v.r, v.g, v.b};
}

CameraView<Var> camera_leaves(const Camera& camera) {
  const uint32_t slot = Tape::current()->slots()->camera;
  const auto vector = [&](const Vec3<Dual>& v, uint32_t offset) {
    return slot == 0 ? Vec3<Var>{v.x.v, v.y.v, v.z.v} : detail::leaves(value(v), slot + offset);
  };
  const auto number = [&](const Dual& v, uint32_t offset) {
    return Var{v.v, slot == 0 ? 0 : Tape::current()->leaf(slot + offset)};
  };
  return CameraView<Var>(camera, vector(camera.origin, 0), vector(camera.left, 3),
                         vector(camera.up, 6), vector(camera.forward, 9), number(camera.fov, 12),
                         {number(camera.aperture_radius, 13), number(camera.focus_distance, 14)});
}

std::array<Vec3<Var>, 3> corner_leaves(const Scene& scene, FaceRef face) {
  const Mesh& mesh = scene.shape(face.shape).mesh;
  const MeshSlots& slots = Tape::current()->slots()->mesh(face.shape);
  const auto corners = face_corners<double>(mesh, face.face);
  std::array<Vec3<Var>, 3> result;
  for (int k = 0; k < 3; ++k) {
    const Vec3d& x = corners[k];
    const uint32_t root = mesh.weld[mesh.face(face.face)[k]];
    result[k] = slots.positions == 0 ? Vec3<Var>{x.x, x.y, x.z}
                                     : detail::leaves(x, slots.positions + 3 * root);
  }
  return result;
}

}  // namespace limn
