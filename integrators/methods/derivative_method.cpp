#include "limn/integrators/derivative_method.h"

#include "integrators/compare/method_images.h"
#include "integrators/methods/difference_method.h"
#include "limn/core/error.h"
#include "limn/core/names.h"
#include "limn/edgetree/edge_sampler_types.h"

namespace limn {
namespace {

class SamplerMethod final : public DerivativeMethod {
 public:
  SamplerMethod(const MethodInput& input, const EdgeSamplerType& type)
      : input_(input), type_(type) {}

  std::string name() const override { return type_.name; }
  std::string description() const override { return type_.description; }

  MethodRun run(const RunSettings& settings) override {
    GradientOptions options;
    options.parameters = {input_.parameter};
    options.terms = input_.terms;
    options.sampler = type_.name;
    options.block = input_.block;
    options.samples = input_.samples;
    const GradientResult result = gradient(input_.scene, options, settings);
    MethodRun run;
    run.image = means(result.parameters[0].total);
    run.blocks = block_sums(result.parameters[0].total_blocks, result.parameters[0].events);
    run.seconds = result.seconds;
    run.setup_seconds = result.setup_seconds;
    run.spp = result.spp;
    for (const TermCost& cost : result.costs) {
      run.rays += cost.rays;
      run.term_seconds.push_back(cost.seconds / settings.threads);
    }
    run.non_finite = result.non_finite;
    samples_ = result.samples;
    return run;
  }

  std::vector<MethodSetting> settings() const override {
    return {{"samples of each term", to_string(samples_)}};
  }

 private:
  const MethodInput& input_;
  const EdgeSamplerType& type_;
  SampleCounts samples_;
};

}  // namespace

std::vector<double> means(const Moments& moments) {
  std::vector<double> values(moments.size());
  for (size_t i = 0; i < values.size(); ++i) values[i] = moments.mean(i);
  return values;
}

std::vector<double> variances(const Moments& moments) {
  std::vector<double> values(moments.size());
  for (size_t i = 0; i < values.size(); ++i) values[i] = moments.variance(i);
  return values;
}

BlockSums block_sums(const Moments& blocks, const Events& events) {
  BlockSums result;
  result.sums = means(blocks);
  if (blocks.batches() > 1) result.variances = variances(blocks);
  result.degrees = blocks.batches() - 1;
  if (blocks.samples() > 0) {
    result.event = events.mean_size() / static_cast<double>(blocks.samples());
  }
  return result;
}

std::vector<MethodName> method_names() {
  std::vector<MethodName> names;
  for (const EdgeSamplerType& type : edge_sampler_types()) {
    names.push_back({type.name, type.description});
  }
  names.push_back({kDifferences, "central finite differences with common random numbers"});
  return names;
}

std::unique_ptr<DerivativeMethod> make_method(const MethodInput& input, const std::string& name) {
  if (name == kDifferences) return make_difference_method(input);
  for (const EdgeSamplerType& type : edge_sampler_types()) {
    if (type.name == name) return std::make_unique<SamplerMethod>(input, type);
  }
  throw InputError(unknown_name("method", name, names_of(method_names())));
}

}  // namespace limn
