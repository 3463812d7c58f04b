// Derivatives of images made of visible faces, see faces_estimator.h.
#include "integrators/methods/term_job.h"

#include "integrators/estimates/batches.h"
#include "integrators/methods/faces_estimator.h"
#include "limn/core/error.h"
#include "limn/integrators/parts.h"

namespace limn {

void check_points(FilmPoints points, bool closed_light, const std::string& method) {
  if (points == FilmPoints::kRandom || closed_light) return;
  throw FieldError("points", std::string(name_of(points)) +
                                 " needs light in closed form, that of \"analytic\": \"" + method +
                                 "\" samples it");
}

RunSettings settings_for(FilmPoints points, RunSettings settings) {
  if (points != FilmPoints::kFaces) return settings;
  if (settings.store) {
    throw FieldError("points", "faces is one pass without samples: it has no parts");
  }
  settings.spp = 1;
  settings.least_spp = 1;
  settings.seconds = 0;
  return settings;
}

std::vector<std::string> trace_faces(const Scene& scene, const GradientOptions& options,
                                     const NonFinite::SampleId& place) {
  check_pixel(scene.film, place);
  const FacesEstimator estimator(scene, parameters_of(scene, options), 1);
  SampleLog log;
  run_pixel_sample(estimator, 0, {place.x, place.y, place.sample}, log);
  return log;
}

GradientResult run_faces(const Scene& scene, const GradientOptions& options,
                         const RunSettings& requested) {
  const RunSettings settings = settings_for(FilmPoints::kFaces, requested);
  const Stopwatch watch;
  selected_terms({kFacesTerm}, options.terms, scene.file);
  const std::vector<Parameter> parameters = parameters_of(scene, options);
  std::vector<std::unique_ptr<SampleEstimator>> estimators;
  estimators.push_back(std::make_unique<FacesEstimator>(scene, parameters, settings.threads));
  check_memory(estimators);

  const Film& film = scene.film;
  const int width = film.crop_width, height = film.crop_height, block = options.block;
  GradientResult result;
  result.terms.push_back({kFacesTerm, true, false, 1, {}, {}});
  result.settings.push_back({"points", std::string(name_of(FilmPoints::kFaces))});
  result.radiance = Moments(film_size(film));
  result.setup_seconds = watch.seconds();
  run_batches(estimators, settings, watch, [&](const Batch& batch, const auto& sums) {
    for (size_t k = 0; k < parameters.size(); ++k) {
      const std::vector<double>& image = sums[0].images[k];
      ParameterGradient& g = result.parameters.emplace_back();
      g.name = parameters[k].name;
      g.total = Moments(image.size());
      g.total.add_exact(image);
      g.terms = {g.total};
      g.image_sum = Moments(1);
      g.image_sum.add_exact(sum_blocks(image, width, height, std::max(width, height)));
      if (block > 0) {
        g.total_blocks = Moments(block_count(width, height, block), true);
        g.total_blocks.add_exact(sum_blocks(image, width, height, block));
        g.term_blocks = {g.total_blocks};
      }
    }
    for (const TermCost& cost : sums[0].costs) result.terms[0].cost.merge(cost);
    result.non_finite.merge(sums[0].non_finite);
    result.radiance.add_exact(sums[0].radiance);
    result.spp += batch.count();
  });
  result.seconds = watch.seconds();
  return result;
}

}  // namespace limn
