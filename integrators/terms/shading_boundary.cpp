#include "integrators/terms/shading_boundary.h"

#include <algorithm>

namespace limn {
namespace {

Vec3<Lanes> edge_velocity(const EdgeMesh& mesh, uint32_t edge, double t) {
  if (mesh.tangents.empty()) return {};
  const auto& ends = mesh.edges[edge].vertices;
  return mesh.tangents[ends[0]] * (1 - t) + mesh.tangents[ends[1]] * t;
}

Vec3<Lanes> velocity(const Vec3<Dual>& p) { return {p.x.d, p.y.d, p.z.d}; }

}  // namespace

EdgeSamplerInput make_sampler_input(const Scene& scene) {
  EdgeSamplerInput input;
  for (const Shape& shape : scene.shapes) {
    const bool black_behind = shape.bsdf->side(false) == nullptr;
    input.objects.push_back(build_edge_mesh(shape.mesh, black_behind));
    if (!shape.is_emitter) continue;
    for (uint32_t f = 0; f < shape.mesh.faces.size(); ++f) {
      const auto corners = face_corners<double>(shape.mesh, f);
      input.lights.push_back(
          {{corners[0], corners[1], corners[2]}, luminance(value(shape.radiance))});
    }
  }
  if (!scene.environment) return input;
  const Environment& environment = *scene.environment;
  input.environment_luminance = environment.mean_luminance();
  if (!environment.is_uniform()) {
    const auto brightness = [&](const Vec3d& d) {
      return std::max(0.0, luminance(environment.radiance(d)));
    };
    input.environment = std::make_shared<RadiancePyramid>(brightness, 8, 2);
  }
  return input;
}

void ShadingBoundary::operator()(const SurfacePoint<Dual>& surface,
                                 const Scattering<Dual>& scattering, const Rgb<Dual>& throughput,
                                 int bounces, const Rng& key) {
  const Stopwatch watch;
  EdgeQuery query;
  query.p = value(surface.p);
  query.n = value(scattering.normal());
  query.wi = value(scattering.wi());
  query.lobe = scattering.bsdf().lobe();
  query.velocity = velocity(surface.p);
  query.object = surface.face.shape;
  query.face = surface.face.face;
  for (int i = 0; i < samples_; ++i) {
    add_sample(query, scattering, value(throughput), bounces, key.copy(Purpose::kEdgeCopy, i));
  }
  cost_.seconds += watch.seconds();
}

void ShadingBoundary::add_sample(const EdgeQuery& query, const Scattering<Dual>& scattering,
                                 const Rgb<double>& throughput, int bounces, const Rng& key) {
  ++cost_.samples;
  Rng rng = key.at(Purpose::kEdge, bounces);
  const std::optional<EdgeSample> drawn = sampler_.sample(query, rng);
  if (!drawn) {
    ++cost_.no_edge;
    return;
  }
  const EdgeSample& sample = *drawn;
  const EdgeMesh& mesh = objects_[sample.edge.object];
  EdgeView view;
  const bool seen = view_edge(mesh, sample.edge, sample.t, query.p, view);
  const Vec3<Lanes> v = edge_velocity(mesh, sample.edge.edge, sample.t) - query.velocity;
  const Lanes weight =
      (v.x * view.side.x + v.y * view.side.y + v.z * view.side.z) *
      (1 / (view.distance * view.distance * view.distance * sample.probability * sample.pdf_t));
  // A density may round to zero at the very horizon.
  const Rgb<double> f =
      seen && sample.pdf_t > 0 ? value(scattering.eval(view.omega)) : Rgb<double>{};
  if (is_zero(weight) || is_black(f)) {
    ++cost_.zero_weight;
    return;
  }
  RayCount rays;
  Rgb<double> jump;
  const bool visible =
      edge_jump(context_, mesh, view, {query.object, query.face}, 0, bounces + 1, key, rays, jump);
  cost_.rays += rays.total();
  if (!visible) {
    ++cost_.occluded;
    return;
  }
  ++cost_.counted;
  const Rgb<double> amount = throughput * f * jump;
  sum_ = sum_ + Rgb<Lanes>{weight * amount.r, weight * amount.g, weight * amount.b};
}

}  // namespace limn
