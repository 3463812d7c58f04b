// Layers of an image: one ray from the camera per sample.
#include "limn/integrators/layers.h"

#include <algorithm>

#include "integrators/estimates/batches.h"
#include "integrators/paths/camera_path.h"
#include "limn/core/error.h"
#include "limn/core/exposure.h"
#include "limn/core/names.h"
#include "limn/core/shading.h"

namespace limn {
namespace {

// What a ray from the camera meets.
struct Seen {
  const SurfacePoint<double>& surface;
  double distance;  // along the ray
  Vec3d place;      // on the face
  Vec3d direction;  // unit
  Rng key;
  ShadingModel shading;
};

Rgb<double> as_rgb(const Vec3d& v) { return {v.x, v.y, v.z}; }

Rgb<double> albedo_of(const Seen& seen) {
  const Scattering<double> scattering(seen.surface, -seen.direction, seen.shading);
  if (scattering.black()) return {};
  Rgb<double> smooth;
  const int count = scattering.is_smooth() ? scattering.shares().count : 0;
  for (int k = 0; k < count; ++k) smooth += scattering.smooth_ray(k).weight;
  if (!scattering.is_rough()) return smooth;
  Rng rng = seen.key.at(Purpose::kBsdf, 0);
  const double u1 = rng.uniform();
  const double u2 = rng.uniform();
  const auto wo = scattering.sample(u1, u2);
  if (!wo) return smooth;
  const auto [f, pdf] = scattering.eval_with_pdf(*wo);
  return pdf > 0 ? smooth + f * (scattering.rough_share() / pdf) : smooth;
}

Rgb<double> uv_of(const Seen& seen) {
  const SurfacePoint<double>& s = seen.surface;
  const Mesh& mesh = s.shape->mesh;
  if (!mesh.textured) return {};
  const auto point = texture_point<double>(mesh, s.face.face, s.b);
  return {point.uv[0], point.uv[1], 0};
}

struct LayerType {
  const char* name;
  const char* channels;
  Rgb<double> (*value)(const Seen& seen);
};

// The shape's place in the scene, counted from 1; 0 where no shape is seen.
Rgb<double> index_of(const Seen& seen) {
  return grey(1.0 + static_cast<double>(seen.surface.face.shape.index()));
}

Rgb<double> normal_of(const Seen& seen) { return as_rgb(seen.surface.n_s); }

constexpr LayerType kTypes[] = {
    {"normals", "XYZ", normal_of},
    {"sh_normal", "XYZ", normal_of},
    {"depth", "Y", [](const Seen& seen) { return grey(seen.distance); }},
    {"position", "XYZ", [](const Seen& seen) { return as_rgb(seen.place); }},
    {"uv", "UV", uv_of},
    {"albedo", "RGB", albedo_of},
    {"alpha", "Y", [](const Seen&) { return grey(1.0); }},
    {"shape_index", "Y", index_of},
};

// A slot for each layer, of one lane.
class LayerEstimator final : public SampleEstimator {
 public:
  LayerEstimator(const Scene& scene, std::vector<const LayerType*> types, int threads)
      : scene_(scene),
        types_(std::move(types)),
        tracer_(make_embree_tracer(scene, threads)),
        camera_(scene.camera),
        filter_(scene.film.filter) {}

  const Scene& scene() const override { return scene_; }
  size_t slots() const override { return types_.size(); }
  const char* slot_name(size_t slot) const override { return types_[slot]->name; }
  int lanes() const override { return 1; }
  Numbers numbers() const override { return Numbers::kEvenInRun; }
  void add_pixels(std::span<const KeyedSample> samples, SampleSink& sink) const override {
    for (const KeyedSample& sample : samples) {
      try {
        add(sample, sink);
      } catch (const UntraceableRay&) {
        sink.reject(sample.at, slot_name(0));
      }
    }
  }

 private:
  void add(const KeyedSample& sample, SampleSink& sink) const {
    const FilmPosition film =
        sample_pixel_filter(scene_.film, filter_, sample.at.x, sample.at.y, sample.key);
    const auto start = sample_ray(camera_, film, sample.key);
    Hit hit;
    if (!tracer_->closest(camera_ray(scene_, start), hit)) return;
    const auto surface = surface_on_ray<double>(scene_, hit.face, start.origin, start.direction);
    const Seen seen{surface,         hit.t,      start.origin + start.direction * hit.t,
                    start.direction, sample.key, scene_.shading};
    const double weight = pixel_filter_weight(scene_.film, filter_, sample.at.x, sample.at.y, film);
    for (size_t slot = 0; slot < types_.size(); ++slot) {
      const Rgb<double> value = types_[slot]->value(seen);
      if (is_finite(value)) {
        Rgb<Lanes> lanes;
        for (int c = 0; c < 3; ++c) lanes[c][0] = value[c];
        sink.add(slot, sample.at, lanes, weight);
      } else {
        sink.reject(sample.at, slot_name(slot));
      }
    }
  }

  const Scene& scene_;
  std::vector<const LayerType*> types_;
  std::unique_ptr<RayTracer> tracer_;
  CameraView<double> camera_;
  FilterTable filter_;
};

std::vector<const LayerType*> find_types(const std::vector<std::string>& names) {
  std::vector<const LayerType*> types;
  for (const std::string& name : names) {
    const auto type = std::find_if(std::begin(kTypes), std::end(kTypes),
                                   [&](const LayerType& t) { return t.name == name; });
    if (type == std::end(kTypes)) throw InputError(unknown_name("layer", name, layer_names()));
    if (std::find(types.begin(), types.end(), type) != types.end()) {
      throw InputError("the layer " + name + " is named twice");
    }
    types.push_back(type);
  }
  return types;
}

// sums: crop_height by crop_width by 3.
ImageLayer layer_of(const LayerType& type, const std::vector<double>& sums, const Film& film,
                    int64_t spp) {
  const std::string channels = type.channels;
  const auto count = static_cast<int>(channels.size());
  ImageLayer layer{type.name, channels, Image(film.crop_width, film.crop_height, count)};
  for (size_t i = 0; i < layer.image.data.size(); ++i) {
    const size_t at = i / channels.size() * 3 + i % channels.size();
    layer.image.data[i] = static_cast<float>(sums[at] / static_cast<double>(spp));
  }
  return layer;
}

}  // namespace

std::vector<std::string> layer_names() { return names_of(kTypes); }

LayersResult render_layers(const Scene& scene, const std::vector<std::string>& names,
                           const RunSettings& settings) {
  const Stopwatch watch;
  if (names.empty()) throw InputError("no layer is named (" + known_names(layer_names()) + ")");
  const std::vector<const LayerType*> types = find_types(names);
  check_still(scene, "layers");
  std::vector<std::unique_ptr<SampleEstimator>> estimators;
  estimators.push_back(std::make_unique<LayerEstimator>(scene, types, settings.threads));
  check_memory(estimators);
  LayersResult result;
  std::vector<std::vector<double>> sums(types.size());
  run_batches(estimators, settings, watch, [&](const Batch& batch, const auto& parts) {
    for (size_t k = 0; k < types.size(); ++k) {
      const std::vector<double>& part = parts[0].images[k];
      sums[k].resize(part.size());
      for (size_t i = 0; i < part.size(); ++i) sums[k][i] += part[i];
    }
    result.non_finite.merge(parts[0].non_finite);
    result.spp += batch.count();
  });
  for (size_t k = 0; k < types.size() && result.spp > 0; ++k) {
    result.layers.push_back(layer_of(*types[k], sums[k], scene.film, result.spp));
  }
  result.seconds = watch.seconds();
  return result;
}

}  // namespace limn
