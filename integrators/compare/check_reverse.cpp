// Reverse mode against forward mode: the sum over pixels of a random adjoint times the derivative.
#include <algorithm>
#include <cmath>
#include <numeric>

#include "integrators/backward/parameter_slots.h"
#include "integrators/backward/reverse_pilot.h"
#include "integrators/estimates/batches.h"
#include "integrators/pilot/term_estimator.h"
#include "limn/core/error.h"
#include "limn/core/exposure.h"
#include "limn/core/parameter.h"
#include "limn/integrators/backward.h"
#include "limn/integrators/methods.h"
#include "limn/integrators/statistics.h"

namespace limn {

namespace {

// Positive, so that what all pixels share shows beside their noise, and different in each.
Image random_adjoint(const Film& film, uint64_t seed) {
  Image adjoint(film.crop_width, film.crop_height, 3);
  for (size_t i = 0; i < adjoint.data.size(); ++i) {
    adjoint.data[i] = static_cast<float>(Rng(seed, i, 0).uniform());
  }
  return adjoint;
}

// Each component a sine of a random direction, of about a period over the shape. Copies of a vertex
// move together.
std::vector<Vec3d> random_field(const Mesh& mesh, uint64_t seed) {
  Rng rng(seed, UINT64_MAX, 0);
  const Bounds bounds = bounds_of(mesh);
  const double scale = 2 * kPi / std::max(bounds.diagonal(), 1e-300);
  Vec3d waves[3];
  double phases[3];
  for (int k = 0; k < 3; ++k) {
    for (int j = 0; j < 3; ++j) waves[k][j] = scale * (2 * rng.uniform() - 1);
    phases[k] = 2 * kPi * rng.uniform();
  }
  std::vector<Vec3d> field(mesh.positions.size());
  for (size_t v = 0; v < field.size(); ++v) {
    const Vec3d x = cast<double>(mesh.positions[mesh.weld[v]]) - bounds.center();
    for (int k = 0; k < 3; ++k) field[v][k] = std::sin(dot(waves[k], x) + phases[k]);
  }
  return field;
}

// As smooth over the map's rows and columns, positive and negative; channels differ.
Image random_texels(const TexelMap::Map& map, uint64_t seed) {
  Rng rng(seed, UINT64_MAX, 1);
  Image field(map.width, map.height, 3);
  for (int c = 0; c < 3; ++c) {
    const double phase = 2 * kPi * rng.uniform(), tilt = 2 * kPi * (2 * rng.uniform() - 1);
    for (int y = 0; y < map.height; ++y) {
      for (int x = 0; x < map.width; ++x) {
        const double turn = 2 * kPi * x / map.width + tilt * y / map.height + phase;
        field.at(x, y, c) = static_cast<float>(map.mean * std::sin(turn));
      }
    }
  }
  return field;
}

// A parameter in forward mode, and what the numbers of one in reverse mode are dotted with.
struct Compared {
  std::string name;
  Parameter forward;
  size_t reverse;  // place of that one
  std::vector<double> weights;
};

// Of a colour each channel.
std::vector<Compared> compared(const Scene& scene, const Parameter& parameter, size_t place,
                               uint64_t seed) {
  if (parameter.colour) {
    std::vector<Compared> channels;
    for (size_t c = 0; c < 3; ++c) {
      const std::string name = parameter.name + "." + "rgb"[c];
      channels.push_back({name, find_parameter(scene, name), place, std::vector<double>(3)});
      channels.back().weights[c] = 1;
    }
    return channels;
  }
  if (parameter.size == 1) return {{parameter.name, parameter, place, {1.0}}};
  if (parameter.array.size() == 3) {
    const Image field = random_texels(parameter.texel_map(scene)->map(), seed);
    return {{parameter.name,
             texel_field(scene, parameter, field),
             place,
             {field.data.begin(), field.data.end()}}};
  }
  for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
    if (parameter.velocities(scene, ShapeId(s)).empty()) continue;
    std::vector<Vec3d> field = random_field(scene.shapes[s].mesh, seed);
    std::vector<double> weights;
    const std::vector<Vec3d> directions = parameter.directions(scene);
    if (!directions.empty()) {
      for (size_t v = 0; v < field.size(); ++v) {
        weights.push_back(field[v].x);
        field[v] = directions[v] * weights[v];
      }
      return {{parameter.name, vertex_field(scene, ShapeId(s), field), place, weights}};
    }
    for (const Vec3d& v : field) weights.insert(weights.end(), {v.x, v.y, v.z});
    return {{parameter.name, vertex_field(scene, ShapeId(s), field), place, weights}};
  }
  throw std::logic_error("an array that moves no shape: " + parameter.name);
}

struct ForwardSums {
  std::vector<Moments> products;  // with the adjoint, one for each parameter
  double light = 0;               // the sum of |adjoint| times the image
};
ForwardSums forward_sums(const Scene& scene, std::span<const Parameter> parameters,
                         const BackwardOptions& options, const Image& adjoint,
                         const RunSettings& settings) {
  check_task(options.method, Task::kBackward);
  const ReverseMethod& method = *options.method->reverse;
  const EdgeSamplerType sampler = method.sampler;
  const bool closed = method.closed;
  const std::vector<std::string>& terms = options.terms;
  const std::vector<const TermType*> types = terms_of(scene, sampler, closed);
  std::vector<bool> computed;
  for (const TermType* type : types) {
    computed.push_back(terms.empty() ||
                       std::find(terms.begin(), terms.end(), type->name) != terms.end());
  }
  ForwardSums result{std::vector<Moments>(parameters.size(), Moments(1))};
  Moments light(1);
  for (size_t first = 0; first < parameters.size(); first += kLanes) {
    const auto some =
        parameters.subspan(first).first(std::min<size_t>(kLanes, parameters.size() - first));
    const auto at_u = [&](const std::optional<double>& u) {
      EstimatorsAtTime now;
      now.list.push_back(std::make_unique<TermEstimator>(scene, some, types, computed, sampler,
                                                         settings.threads,
                                                         TermExtras{.closed = closed, .time = u}));
      return now;
    };
    const EstimatorsAtTime still = at_u(std::nullopt);
    const Stopwatch watch;
    const auto take = [&](const Batch& batch, const auto& sums) {
      const std::vector<std::vector<double>>& images = sums[0].images;
      for (size_t k = 0; k < some.size(); ++k) {
        double sum = 0;
        for (size_t image = k; image < images.size(); image += some.size()) {
          for (size_t i = 0; i < images[image].size(); ++i) {
            sum += adjoint.data[i] * images[image][i];
          }
        }
        result.products[first + k].add_batch({sum}, batch.count());
      }
      double sum = 0;
      for (size_t i = 0; i < adjoint.data.size(); ++i)
        sum += std::fabs(adjoint.data[i]) * sums[0].radiance[i];
      light.add_batch({sum}, batch.count());
    };
    run_batches(still.list, settings, watch, take,
                needs_times(scene, some) ? EstimatorsAt(at_u) : EstimatorsAt());
  }
  result.light = light.mean(0);
  return result;
}

// Moments of dot products by reverse mode, one for each of `list`. Of batches nothing else is kept.
std::vector<Moments> reverse_sums(const Scene& scene, const std::vector<Compared>& list,
                                  const BackwardOptions& options, const Image& adjoint,
                                  const RunSettings& settings) {
  std::vector<Moments> moments(list.size(), Moments(1));
  BackwardOptions own = options;
  own.batches = 64;  // not tuned: many degrees of freedom
  own.each_batch = [&](int samples, const std::vector<std::vector<double>>& sums) {
    for (size_t i = 0; i < list.size(); ++i) {
      const std::vector<double>& numbers = sums[list[i].reverse];
      const auto& weights = list[i].weights;
      const double sum = std::inner_product(weights.begin(), weights.end(), numbers.begin(), 0.0);
      moments[i].add_batch({sum}, samples);
    }
  };
  backward(scene, adjoint, own, settings);
  return moments;
}

// What rounding leaves of light that cancels, over that light: some hundred units in the last
// place.
constexpr double kRounding = 0x1p-44;

// The difference of two means as a standard normal z: Student's t with Welch's degrees of freedom.
// rounding: of either, a standard deviation.
double score(const Moments& forward, const Moments& reverse, double rounding) {
  const double a = forward.variance(0), b = reverse.variance(0);
  const double both = a + b + rounding * rounding;
  const double own = a * a / forward.degrees() + b * b / reverse.degrees();
  const double degrees = std::min(both * both / own, 1e6);
  return normal_from_student((reverse.mean(0) - forward.mean(0)) / std::sqrt(both), degrees);
}

}  // namespace

std::vector<ReverseCheck> check_reverse(const Scene& scene, const BackwardOptions& options,
                                        const RunSettings& settings) {
  if (settings.spp < 2)
    throw FieldError("spp", "a check of reverse mode needs 2 or more, for standard errors");
  const Image adjoint = random_adjoint(scene.film, mix_bits(settings.seed));
  std::vector<Compared> list;
  std::vector<Parameter> parameters;
  const std::vector<Parameter> requested = reverse_parameters(scene, options);
  for (size_t place = 0; place < requested.size(); ++place) {
    for (const Compared& one : compared(scene, requested[place], place, settings.seed)) {
      list.push_back(one);
      parameters.push_back(one.forward);
    }
  }
  const auto reverse = reverse_sums(scene, list, options, adjoint, settings);
  RunSettings other = settings;
  other.seed = mix_bits(mix_bits(settings.seed) + 3);
  // Single terms are those of one method.
  const BackwardOptions own = options.terms.empty() ? options : without_pilot(options);
  const auto [sums, light] = forward_sums(scene, parameters, own, adjoint, other);
  if (settings.interrupted && settings.interrupted->load()) return {};
  std::vector<ReverseCheck> checks;
  for (size_t i = 0; i < list.size(); ++i) {
    ReverseCheck check{list[i].name, sums[i].mean(0), std::sqrt(sums[i].variance(0)),
                       reverse[i].mean(0), std::sqrt(reverse[i].variance(0))};
    // A derivative that is zero but for rounding is a part of the light over a step that shows.
    const double rounding = kRounding * light / parameters[i].natural_step;
    if (check.forward != check.reverse) check.z = score(sums[i], reverse[i], rounding);
    checks.push_back(check);
  }
  return checks;
}

}  // namespace limn
