// What a point on an edge adds at a vertex of a path.
#include "integrators/terms/vertex_edges.h"

#include <fmt/format.h>

namespace limn {

bool is_unseen(const PathVertex& vertex) {
  const Scattering<double>& scattering = vertex.scattering;
  return is_black(vertex.throughput) ||
         (scattering.bsdf().is_lambertian() && scattering.lobe().albedo == 0);
}

EdgeQuery query_at(const PathVertex& vertex) {
  EdgeQuery query;
  query.p = vertex.surface.p;
  query.n = vertex.scattering.lobe_normal();
  query.wi = vertex.scattering.wi();
  query.lobe = vertex.scattering.lobe();
  if (vertex.below) {
    const Bsdf::PassedLobe passed = vertex.scattering.passed_lobe();
    query.n = -query.n;
    query.wi = passed.wi;
    query.lobe = passed.lobe;
  }
  query.velocity = vertex.velocity;
  query.turn = vertex.turn;
  query.face = vertex.surface.start();
  return query;
}

void draw_edges(const EdgeSampler& sampler, const EdgeQuery& query, const Rng& key, int bounces,
                int count, std::vector<std::optional<EdgeSample>>& drawn) {
  static thread_local std::vector<Rng> rngs;
  rngs.clear();
  for (int i = 0; i < count; ++i) {
    rngs.push_back(key.copy(Purpose::kEdgeCopy, i).at(Purpose::kEdge, bounces));
  }
  sampler.sample_several(query, rngs, drawn);
}

Ray ray_to(const PathVertex& vertex, FaceRef face, const Vec3d& omega, double distance) {
  Ray ray{vertex.surface.p, omega};
  ray.start = vertex.surface.start();
  ray.end = face;
  ray.t_max = distance * (1 - 0x1p-20);  // as shadow rays end
  return ray;
}

bool is_hidden_from(const PathContext& context, const PathVertex& vertex, FaceRef face,
                    const Vec3d& omega, double distance, TermCost& cost) {
  cost.add(RayCount{0, 1});
  return context.tracer.occluded(ray_to(vertex, face, omega, distance));
}

namespace {

void log_point(const EdgeSample& sample, double distance, SampleLog& log) {
  log.push_back(fmt::format(
      "  edge {} of shape {} at t = {:.6g}: probability {:.4g}, density of t {:.4g}, distance "
      "{:.6g}",
      sample.edge.edge.index(), sample.edge.object.index(), sample.t, sample.probability,
      sample.pdf_t, distance));
}

// Directions sweep over the edge at the rate v . side / |w|^3.
BoundaryForm form_of(const Scene& scene, const PathVertex& vertex, const EdgeDraw& draw,
                     const EdgeView& view) {
  const EdgeSample& sample = draw.sample;
  BoundaryForm form;
  form.held = draw.held && !draw.along;
  form.scale = draw.share /
               (view.distance * view.distance * view.distance * sample.probability * sample.pdf_t);
  form.add_edge(draw.mesh, sample.edge, sample.t, view.side);
  if (draw.along) {
    const Vec3d p = vertex.surface.p;
    if (vertex.bounces == 0 && !draw.held) form.turn_at(p, view.y);
    form.x = p;
    form.distance = draw.along->distance;
    form.add_seen_point(scene, vertex.surface.face, draw.along->omega, -view.side);
    if (const SeenVertex* viewer = draw.along->viewer) {
      form.turn_at(viewer->q, p);
      form.x = viewer->q;
      form.distance = viewer->seen.distance;
      form.add_seen_point(scene, viewer->face, viewer->seen.omega, form.of_ray());
    }
  } else {
    form.x = view.y;
    form.distance = view.distance;
  }
  return form;
}

// The ray from a vertex to a point of an edge, by way of mirrors.
Ray leaving_by(const FlatMirrors& mirrors, const PathVertex& vertex, const MirrorWay& way,
               const Vec3d& y, BoundaryForm& form) {
  Ray ray = unfolded(mirrors, way.chain, way.image, y);
  ray.origin = vertex.surface.p;
  ray.start = vertex.surface.start();
  form.leaves = ray.direction;
  for (const uint32_t m : std::span(way.chain.mirrors).first(way.chain.count)) {
    form.by.faces[form.by.count++] = mirrors.mirrors()[m].faces[0];
  }
  return ray;
}

// edge_difference() by way of mirrors, times what they reflect. form: gets the faces that do.
bool mirrored_difference(const PathContext& context, const PathVertex& vertex, const EdgeDraw& draw,
                         const Ray& ray, RayCount& rays, BoundaryForm& form,
                         Rgb<double>& difference) {
  MirrorSight sight;
  if (!follow_mirrors(context, draw.way->chain, ray, vertex.bounces + 1, rays, sight)) return false;
  EdgeView view;
  if (!view_edge(draw.mesh, draw.sample.edge, draw.sample.t, sight.from, view)) return false;
  const EdgeViewer viewer{sight.last(), sight.bounces, draw.key, draw.part};
  if (!edge_difference(context, draw.mesh, view, viewer, rays, difference)) return false;
  difference = difference * sight.share;
  form.by = sight.by;
  return true;
}

}  // namespace

void add_edge_point(const PathContext& context, const PathVertex& vertex, const EdgeDraw& draw,
                    BoundarySink& sink) {
  const EdgeSample& sample = draw.sample;
  TermCost& cost = sink.cost();
  EdgeView view;
  const Vec3d from = draw.way ? draw.way->image : vertex.surface.p;
  const bool seen = view_edge(draw.mesh, sample.edge, sample.t, from, view);
  if (sink.log()) log_point(sample, view.distance, *sink.log());
  BoundaryForm form = form_of(context.scene, vertex, draw, view);
  Ray ray{from, view.omega};
  if (draw.way && seen) ray = leaving_by(*context.flat_mirrors, vertex, *draw.way, view.y, form);
  // A density may round to zero at the very horizon.
  const bool counts = seen && sample.pdf_t > 0 && sink.takes(form, draw.key);
  const Rgb<double> f = counts ? vertex.scattered(ray.direction) : Rgb<double>{};
  if (is_black(f)) {
    ++cost.zero_weight;
    if (sink.log()) sink.log()->push_back("    no weight");
    return;
  }
  const Rgb<double> scattered = vertex.throughput * f;
  if (draw.roulette && !sink.survives(scattered, draw.key)) {
    ++cost.left_out;
    if (sink.log()) sink.log()->push_back("    left out by roulette");
    return;
  }
  RayCount rays;
  Rgb<double> difference;
  const EdgeViewer viewer{vertex.surface.start(), vertex.bounces + 1, draw.key, draw.part};
  const bool visible = draw.way
                           ? mirrored_difference(context, vertex, draw, ray, rays, form, difference)
                           : edge_difference(context, draw.mesh, view, viewer, rays, difference);
  cost.add(rays);
  const Rgb<double> amount = visible ? scattered * difference : Rgb<double>{};
  if (draw.roulette) sink.traced(scattered, rays, amount);
  if (!visible) {
    ++cost.occluded;
    if (sink.log()) sink.log()->push_back("    hidden");
    return;
  }
  ++cost.counted;
  if (sink.log()) {
    sink.log()->push_back(fmt::format("    radiance difference ({:.6g}, {:.6g}, {:.6g})",
                                      difference.r, difference.g, difference.b));
  }
  sink.add(amount);
}

}  // namespace limn
