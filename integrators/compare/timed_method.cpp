// The rows of the table of methods, as a comparison runs them.
#include "limn/integrators/timed_method.h"

#include "integrators/compare/edge_events.h"

namespace limn {
namespace {

class TableMethod final : public TimedMethod {
 public:
  TableMethod(const MethodInput& input, Method method)
      : input_(input), method_(std::move(method)) {}

  std::string name() const override { return method_.name(); }
  std::string description() const override { return method_->description; }

  MethodRun run(const RunSettings& settings) override {
    const GradientOptions options = input_.options(method_);
    GradientResult result = gradient(input_.scene, options, settings);
    MethodRun run;
    run.image = means(result.parameters[0].total);
    run.blocks = block_sums(result);
    run.seconds = result.seconds;
    run.setup_seconds = result.setup_seconds;
    run.spp = result.spp;
    for (const TermRun& term : result.terms) {
      run.rays += term.cost.rays;
      run.term_seconds.emplace_back(term.name, term.cost.seconds / settings.threads);
    }
    run.non_finite = result.non_finite;
    settings_ = std::move(result.settings);
    return run;
  }

  std::vector<MethodSetting> settings() const override { return settings_; }

 private:
  const MethodInput& input_;
  Method method_;
  std::vector<MethodSetting> settings_;
};

}  // namespace

GradientOptions MethodInput::options(const Method& method) const {
  GradientOptions options;
  options.parameters = {parameter};
  options.method = method;
  options.terms = terms;
  options.samples = samples;
  options.step = step;
  if (method->warps) options.warp = warp;
  if (method->blurs) options.blur = blur;
  options.block = block;
  return options;
}

std::unique_ptr<TimedMethod> make_method(const MethodInput& input, const Method& method) {
  check_task(method, Task::kGradient);
  return std::make_unique<TableMethod>(input, method);
}

}  // namespace limn
