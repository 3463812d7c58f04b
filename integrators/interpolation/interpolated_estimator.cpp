// The method `interpolated`: direct light of the sky, from its view at the vertices of triangles.
// After a paper of 2021 (IEEE Access 9) on vectorized visibility and its Voronoi correspondence.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <optional>

#include "integrators/estimates/sample_estimator.h"
#include "integrators/interpolation/baselines.h"
#include "integrators/interpolation/gloss.h"
#include "integrators/interpolation/radiance_tables.h"
#include "integrators/interpolation/sky_mesh.h"
#include "integrators/lights/direct_light_check.h"
#include "integrators/methods/method_table.h"
#include "integrators/paths/camera_path.h"
#include "limn/core/parallel.h"
#include "limn/core/shading.h"

namespace limn {
namespace {

constexpr double kDetail = 256;  // power of the cosine that blurs the sky for `adaptive`
constexpr int kMostParts = 32;   // of a triangle's side
constexpr int kLooks = 2;        // rays along each side of a pixel that look for faces

enum class Interpolate { kOutline, kRadiance, kDistances, kNothing, kRays };
constexpr const char* kInterpolate[] = {"outline", "radiance", "distances", "nothing", "rays"};
enum class Shading { kPixel, kVertex, kAdaptive };
constexpr const char* kShading[] = {"pixel", "vertex", "adaptive"};

template <class Word, size_t kCount>
Word number_of(const char* const (&names)[kCount], const std::string& name) {
  return static_cast<Word>(std::find(names, names + kCount, name) - names);
}

struct Choices {
  explicit Choices(const Settings& settings)
      : interpolate(number_of<Interpolate>(kInterpolate, settings["interpolate"])),
        shading(number_of<Shading>(kShading, settings["shading"])),
        subdivision(std::stod(settings["subdivision"])),
        cap_share(std::stod(settings["gloss-cap"])) {
    mesh.tolerance = std::stod(settings["tolerance"]);
    mesh.triples.single_loops = settings["loops"] == "one";
  }
  // Whether outlines are looked at by pixels.
  bool views() const {
    return shading == Shading::kPixel && interpolate != Interpolate::kDistances;
  }
  Interpolate interpolate;
  Shading shading;
  double subdivision, cap_share;
  SkyMeshOptions mesh;
};

bool is_glossy(const Bsdf& bsdf) {
  const LobeSummary lobe = bsdf.lobe();
  const bool microfacets = lobe.model == &ggx_lobe() || lobe.model == &beckmann_lobe();
  return microfacets && lobe.diffuse == 0 && bsdf.texture_count() == 0;
}

void check(const Scene& scene, const Choices& choices) {
  const std::string method = "interpolated";
  check_direct_light(scene, method);
  const SourceLocation whole{scene.file};
  if (!scene.camera.is_pinhole()) refuse_light(method, whole, "it needs a pinhole (use path)");
  const bool meshless =
      choices.interpolate == Interpolate::kRays || choices.interpolate == Interpolate::kNothing;
  if (choices.shading != Shading::kPixel && meshless) {
    refuse_light(method, whole,
                 "interpolate=nothing and interpolate=rays evaluate light at pixels: choose "
                 "shading=pixel");
  }
  if (choices.shading == Shading::kVertex && choices.interpolate != Interpolate::kOutline) {
    refuse_light(method, whole,
                 "shading=vertex interpolates light, nothing else: leave out interpolate");
  }
  if (choices.shading == Shading::kAdaptive && choices.interpolate == Interpolate::kOutline) {
    // Dark smudges at points on triangles' edges.
    refuse_light(method, whole,
                 "shading=adaptive is wrong with outlines: add interpolate=radiance, or choose "
                 "shading=pixel");
  }
  const Environment* sky = scene.environment.get();
  if (!sky) refuse_light(method, whole, "the scene has no environment to look at: add one");
  if (!sky->is_uniform() && !sky->grid()) {
    refuse_light(method, whole, "the environment is neither constant nor a map: use path");
  }
  for (const Shape& shape : scene.shapes) {
    const std::string name = shape_in_text(shape);
    if (shape.is_emitter) {
      refuse_light(method, shape.where, name + ": only the environment is interpolated: use lines");
    }
    for (const bool front : {true, false}) {
      const Bsdf* side = shape.bsdf->side(front);
      if (!side || side->is_lambertian() || choices.interpolate == Interpolate::kRays) continue;
      const bool glossy = is_glossy(*side);
      if (glossy && choices.views()) continue;
      refuse_light(method, shape.where,
                   name + (glossy ? ": gloss is known of outlines at pixels alone: choose "
                                    "shading=pixel"
                                  : ": only diffuse surfaces and rough conductors without textures "
                                    "are known: use rays or path"));
    }
  }
}

class InterpolatedEstimator final : public SampleEstimator {
 public:
  InterpolatedEstimator(const Scene& scene, const RunSettings& settings, const Choices& choices)
      : scene_((check(scene, choices), scene)),
        choices_(choices),
        tracer_(make_embree_tracer(scene, settings.threads)),
        contours_(scene, *tracer_, settings.threads),
        camera_(scene.camera),
        filter_(scene.film.filter) {
    choices_.mesh.triples.seed = settings.seed;
    choices_.mesh.triples.threads = settings.threads;
    if (choices_.interpolate == Interpolate::kRays) {
      rays_.emplace(scene, *tracer_, camera_);
      return;
    }
    add_gloss();
    const Environment& sky = *scene.environment;
    if (!sky.is_uniform() || !gloss_.empty()) {
      const auto grid =
          sky.grid().value_or(Environment::Grid{{0, 1, 0}, {1, 0, 0}, {0, 0, -1}, 256, 129});
      tables_.emplace(grid, grid.columns, grid.rows - 1,
                      [&](const Vec3d& w) { return sky.radiance(w); });
    }
    std::vector<SeenSide> sides;
    if (choices_.interpolate != Interpolate::kNothing) sides = seen_sides();
    mesh_.emplace(scene, contours_, sides, choices_.mesh);
    if (choices_.interpolate == Interpolate::kDistances) {
      distances_.emplace(sky, *mesh_, contours_, settings.threads);
    }
    if (choices_.shading == Shading::kVertex) shade_vertices(settings.threads);
    if (choices_.shading == Shading::kAdaptive) shade_adaptively(settings.threads);
  }

  const Scene& scene() const override { return scene_; }
  size_t slots() const override { return 1; }
  const char* slot_name(size_t) const override { return "radiance"; }
  Numbers numbers() const override { return Numbers::kEvenInRun; }
  void add_pixels(std::span<const KeyedSample> samples, SampleSink& sink) const override;

 private:
  // Colours of a triangle's parts: (parts + 1) (parts + 2) / 2, row by row.
  struct Parts {
    int parts = 1;
    std::vector<Rgb<double>> colours;
    const Rgb<double>& at(int i, int j) const {
      return colours[static_cast<size_t>(i * (2 * parts + 3 - i) / 2 + j)];
    }
  };
  void add_gloss();
  std::vector<SeenSide> seen_sides() const;
  Rgb<double> sample(const KeyedSample& sample, RayCount& rays, DirectionLoops& loops) const;
  // Irradiance; with a scattering function what it scatters. Changes the loops.
  Rgb<double> light(const Vec3d& n, const Scattering<double>* to, DirectionLoops& loops) const;
  Rgb<double> exact(const SkyMesh::Vertex& vertex, const Scattering<double>* to,
                    DirectionLoops& loops) const;
  Rgb<double> between(const SkyMesh::Spot& spot, const SkyMesh::Vertex& vertex,
                      const Scattering<double>* to, DirectionLoops& loops) const;
  Rgb<double> look_up(const SkyMesh::Spot& spot) const;
  void describe(SampleLog& log) const;
  void shade_vertices(int threads);
  void shade_adaptively(int threads);

  const Scene& scene_;
  Choices choices_;
  std::unique_ptr<RayTracer> tracer_;
  Contours contours_;
  CameraView<double> camera_;
  FilterTable filter_;
  std::optional<RadianceTables> tables_;  // none: a constant sky
  std::optional<SkyMesh> mesh_;
  std::optional<SignedDistances> distances_;
  std::optional<OpenSkyRays> rays_;
  std::map<const Bsdf*, Gloss> gloss_;
  std::vector<Rgb<double>> irradiances_;  // of vertices
  std::vector<Parts> parts_;              // of patches
};

// Barycentric coordinates, of the second and third corner, of where a ray meets a face's plane.
std::array<double, 2> place_on_face(const Scene& scene, FaceRef face, const Vec3d& origin,
                                    const Vec3d& direction) {
  const auto c = face_corners<double>(scene.shape(face.shape).mesh, face.face);
  const Vec3d e1 = c[1] - c[0], e2 = c[2] - c[0], n = cross(e1, e2);
  const Vec3d q = origin + direction * (dot(c[0] - origin, n) / dot(n, direction)) - c[0];
  return {dot(cross(q, e2), n) / dot(n, n), dot(cross(e1, q), n) / dot(n, n)};
}

SeenSide side_of(const Scene& scene, FaceRef face, const Vec3d& direction) {
  const auto c = face_corners<double>(scene.shape(face.shape).mesh, face.face);
  return {face, dot(cross(c[1] - c[0], c[2] - c[0]), direction) < 0};
}

// In the order of the scene. What slips between the rays is looked at exactly.
std::vector<SeenSide> InterpolatedEstimator::seen_sides() const {
  const Film& film = scene_.film;
  std::map<std::array<uint32_t, 3>, SeenSide> found;
  for (int y = 0; y < film.crop_height * kLooks; ++y) {
    for (int x = 0; x < film.crop_width * kLooks; ++x) {
      const auto start =
          camera_.ray(film.crop_x + (x + 0.5) / kLooks, film.crop_y + (y + 0.5) / kLooks);
      Hit hit;
      const Ray ray = camera_ray(scene_, start);
      if (!is_traceable(ray) || !tracer_->closest(ray, hit)) continue;
      const SeenSide side = side_of(scene_, hit.face, start.direction);
      if (scene_.shape(hit.face.shape).bsdf->side(side.front)) found.emplace(side.key(), side);
    }
  }
  std::vector<SeenSide> sides;
  for (const auto& [key, side] : found) sides.push_back(side);
  return sides;
}

void InterpolatedEstimator::add_gloss() {
  for (const Shape& shape : scene_.shapes) {
    for (const bool front : {true, false}) {
      const Bsdf* side = shape.bsdf->side(front);
      if (!side || side->is_lambertian() || gloss_.contains(side)) continue;
      gloss_.emplace(side, Gloss(*scene_.environment, side->lobe().alpha, choices_.cap_share));
    }
  }
}

Rgb<double> InterpolatedEstimator::light(const Vec3d& n, const Scattering<double>* to,
                                         DirectionLoops& loops) const {
  if (to && !to->bsdf().is_lambertian()) {
    return gloss_.at(&to->bsdf()).radiance(*tables_, *to, loops);
  }
  Rgb<double> e = tables_ ? tables_->light(loops).along(n)
                          : scene_.environment->radiance(n) * dot(n, mean_direction(loops));
  for (int c = 0; c < 3; ++c) e[c] = std::fmax(e[c], 0);
  return to ? to->eval(n) * e : e;
}

Rgb<double> InterpolatedEstimator::exact(const SkyMesh::Vertex& vertex,
                                         const Scattering<double>* to,
                                         DirectionLoops& loops) const {
  view_of(find_sky_polygons(contours_, vertex.at), vertex.at.p, loops);
  return light(vertex.n, to, loops);
}

Rgb<double> InterpolatedEstimator::between(const SkyMesh::Spot& spot, const SkyMesh::Vertex& vertex,
                                           const Scattering<double>* to,
                                           DirectionLoops& loops) const {
  const Vec3d &p = vertex.at.p, &n = vertex.n;
  if (distances_) {
    const Rgb<double> e = distances_->light(*mesh_, spot, n);
    return to ? to->eval(n) * e : e;
  }
  if (choices_.interpolate == Interpolate::kOutline) {
    mesh_->outline(spot, p, loops);
    return light(n, to, loops);
  }
  Rgb<double> sum;
  for (int k = 0; k < 3; ++k) {
    view_of(mesh_->skies()[mesh_->patches()[spot.patch].vertices[k]], p, loops);
    sum += light(n, to, loops) * spot.weights[k];
  }
  return sum;
}

void InterpolatedEstimator::shade_vertices(int threads) {
  irradiances_.resize(mesh_->vertices().size());
  parallel_for(irradiances_.size(), threads, [&](size_t v) {
    DirectionLoops loops;
    view_of(mesh_->skies()[v], mesh_->vertices()[v].at.p, loops);
    irradiances_[v] = light(mesh_->vertices()[v].n, nullptr, loops);
  });
}

// 2^round(zeta delta) parts of a triangle's sides; delta: the greatest change at its vertices where
// the sky is blurred, over the mean of an open sky's irradiance.
void InterpolatedEstimator::shade_adaptively(int threads) {
  shade_vertices(threads);
  std::vector<double> changes(irradiances_.size());
  if (tables_) {
    const Environment& sky = *scene_.environment;
    const BlurredSky blurred(sky, kDetail);
    const RadianceTables coarse(sky.grid().value(), 64, 32,
                                [&](const Vec3d& w) { return blurred.radiance(w); });
    const double unit = kPi * sky.mean_luminance();
    parallel_for(changes.size(), threads, [&](size_t v) {
      DirectionLoops loops;
      view_of(mesh_->skies()[v], mesh_->vertices()[v].at.p, loops);
      const auto smooth = coarse.light(loops).along(mesh_->vertices()[v].n);
      changes[v] = std::fabs(luminance(irradiances_[v] - smooth)) / unit;
    });
  }
  parts_.resize(mesh_->patches().size());
  parallel_for(parts_.size(), threads, [&](size_t i) {
    const auto& vertices = mesh_->patches()[i].vertices;
    double change = 0;
    for (const uint32_t v : vertices) change = std::max(change, changes[v]);
    Parts& parts = parts_[i];
    const double power = std::round(choices_.subdivision * change);
    parts.parts = power > 5 ? kMostParts : 1 << static_cast<int>(power);
    const SkyMesh::Origin& origin = mesh_->origin(static_cast<uint32_t>(i));
    DirectionLoops loops;
    for (int r = 0; r <= parts.parts; ++r) {
      for (int c = 0; r + c <= parts.parts; ++c) {
        SkyMesh::Spot spot{static_cast<uint32_t>(i), {}};
        spot.weights[1] = static_cast<double>(r) / parts.parts;
        spot.weights[2] = static_cast<double>(c) / parts.parts;
        spot.weights[0] = 1 - spot.weights[1] - spot.weights[2];
        std::array<double, 2> b{};
        for (int k = 0; k < 3; ++k) {
          for (int l = 0; l < 2; ++l) b[l] += spot.weights[k] * origin.b[k][l];
        }
        const SkyMesh::Vertex at = mesh_->vertex_at(origin.side, b);
        parts.colours.push_back(between(spot, at, nullptr, loops));
      }
    }
  });
}

Rgb<double> InterpolatedEstimator::look_up(const SkyMesh::Spot& spot) const {
  if (choices_.shading == Shading::kVertex) {
    Rgb<double> sum;
    for (int k = 0; k < 3; ++k) {
      sum += irradiances_[mesh_->patches()[spot.patch].vertices[k]] * spot.weights[k];
    }
    return sum;
  }
  const Parts& parts = parts_[spot.patch];
  const int n = parts.parts;
  const double x = std::clamp(spot.weights[1], 0.0, 1.0) * n;
  const double y = std::clamp(spot.weights[2], 0.0, 1.0) * n;
  const int i = std::min(static_cast<int>(x), n - 1);
  const int j = std::min(static_cast<int>(y), n - 1 - i);
  const double u = x - i, v = y - j;
  if (u + v <= 1 || i + j + 2 > n) {
    return parts.at(i, j) * (1 - u - v) + parts.at(i + 1, j) * u + parts.at(i, j + 1) * v;
  }
  return parts.at(i + 1, j + 1) * (u + v - 1) + parts.at(i, j + 1) * (1 - u) +
         parts.at(i + 1, j) * (1 - v);
}

Rgb<double> InterpolatedEstimator::sample(const KeyedSample& sample, RayCount& rays,
                                          DirectionLoops& loops) const {
  const FilmPosition film =
      sample_pixel_filter(scene_.film, filter_, sample.at.x, sample.at.y, sample.key);
  const auto start = camera_.ray(film.x, film.y);
  Hit hit;
  ++rays.closest;
  if (!tracer_->closest(camera_ray(scene_, start), hit)) {
    return scene_.hide_emitters ? Rgb<double>{} : scene_.environment->radiance(start.direction);
  }
  const auto surface = surface_on_ray<double>(scene_, hit.face, start.origin, start.direction);
  const Scattering<double> scattering(surface, -start.direction, scene_.shading);
  if (scattering.black()) return {};
  const Vec3d n = scattering.normal();
  if (rays_) return rays_->sample(surface, n, scattering, sample.key.at(Purpose::kDirect, 0), rays);
  const SkyMesh::Vertex vertex{contours_.at(surface, n), n};
  const auto spot = mesh_->find(side_of(scene_, hit.face, start.direction),
                                place_on_face(scene_, hit.face, start.origin, start.direction));
  if (!spot) return exact(vertex, &scattering, loops);
  if (choices_.shading == Shading::kPixel) return between(*spot, vertex, &scattering, loops);
  return scattering.eval(n) * look_up(*spot);
}

// For --debug-sample: sizes of the mesh.
void InterpolatedEstimator::describe(SampleLog& log) const {
  size_t corners = 0, contradictions = 0, triples = 0, relaxed = 0;
  for (const SkyPolygons& sky : mesh_->skies()) {
    corners += sky.corners.size(), contradictions += sky.contradictions > 0;
  }
  for (const SkyTriples& t : mesh_->triples()) triples += t.triples.size(), relaxed += t.relaxed;
  log.push_back(fmt::format("{} vertices with {} corners, {} of them contradict",
                            mesh_->skies().size(), corners, contradictions));
  log.push_back(fmt::format("{} triangles with {} triples, {} by no rule; {} are too coarse",
                            mesh_->patches().size(), triples, relaxed, mesh_->coarse()));
}

void InterpolatedEstimator::add_pixels(std::span<const KeyedSample> samples,
                                       SampleSink& sink) const {
  if (sink.log() && mesh_) describe(*sink.log());
  RayCount rays;
  DirectionLoops loops;
  for (const KeyedSample& one : samples) {
    try {
      const Rgb<double> radiance = sample(one, rays, loops);
      if (!is_finite(radiance)) throw UntraceableRay();
      sink.add_radiance(one.at, radiance,
                        pixel_filter_weight(scene_.film, filter_, one.at.x, one.at.y, one.key));
    } catch (const UntraceableRay&) {
      sink.reject(one.at, slot_name(0));
    }
  }
  sink.cost(0).add(rays);
  sink.cost(0).samples += samples.size();
}

}  // namespace

std::unique_ptr<SampleEstimator> make_interpolated_estimator(const Scene& scene,
                                                             const RunSettings& settings,
                                                             const Settings& choices) {
  return std::make_unique<InterpolatedEstimator>(scene, settings, Choices(choices));
}

}  // namespace limn
