#pragma once
// The options of runs: one row for each field, with its name, range and help. What the command line
// takes, the arguments and documentation of Python's functions, the checks of ranges and the JSON
// of fits are made from these rows. Those of reverse mode and fits: fit_options.h.
#include <limits>

#include "limn/integrators/check.h"
#include "limn/integrators/gradient.h"
#include "limn/integrators/option.h"
#include "limn/integrators/render.h"

namespace limn {

inline constexpr Option kPointsOption = choice(
    "points", kFilmPoints,
    "Points at which the method analytic evaluates light. random: random points of each pixel. "
    "faces: one point per visible face of each pixel, weighted by its visible area. Faces has no "
    "noise and needs a box filter; its gradient is exact for its own image, which ignores how "
    "light varies within a pixel's part of a face");
inline constexpr Option kGeneratorOption =
    choice("generator", kGenerators,
           "Sample generator: Owen-scrambled Sobol' points (a third of the squared error, mostly, "
           "but no standard errors), or independent random numbers")
        .samples();

// What a run is to do; the scene's file says the rest.
struct RunRequest {
  std::optional<int> spp;
  std::optional<uint64_t> seed;
  int threads = 0;     // 0: all cores
  double seconds = 0;  // 0: no limit; else as many samples as fit, spp at most if that is given
  BatchStore* store = nullptr;
};
// FieldError for numbers out of range.
RunSettings settings_of(const RunRequest& request, const Scene& scene);

void visit_options(Like<RunRequest> auto& o, auto&& visit) {
  visit(o.spp, Option{"spp", "Samples per pixel (default: sample_count of the scene's sampler)", 1,
                      1 << 30}
                   .samples());
  visit(o.seed, Option{"seed", "Seed of the random numbers (default: seed of the scene's sampler)",
                       0, std::numeric_limits<uint64_t>::max()});
  visit(o.threads, Option{"threads", "Number of threads", 1, 4096}.or_zero("all cores"));
  visit(o.seconds,
        Option{"seconds", "Time budget in seconds, set-up included, instead of `spp`", 1e-6L, 1e7L}
            .or_zero("none")
            .typed("SECONDS")
            .samples());
}

void visit_options(Like<WarpOptions> auto& o, auto&& visit) {
  visit(o.rays, Option{"aux",
                       "Auxiliary rays per direction (method was): an even number. More rays "
                       "reduce the bias",
                       2, 1 << 20}
                    .typed("N"));
  visit(o.kappa, Option{"kappa",
                        "Concentration K of the kernel of auxiliary rays, which is K^(-1/2) "
                        "radians wide (method was)",
                        1, 1e12L}
                     .typed("K"));
}

void visit_options(Like<Blur> auto& o, auto&& visit) {
  visit(o.sigma, Option{"sigma",
                        "Square of the width over which faces fade beyond their sides, in squared "
                        "scene units (methods blurred and blurred-published)",
                        1e-30L, 1e30L}
                     .or_zero("a sixteenth of the median side, squared"));
  visit(
      o.gamma,
      Option{"gamma",
             "Depth over which surfaces mix, in scene units (methods blurred and "
             "blurred-published)",
             1e-15L, 1e15L}
          .or_zero("none; of blurred-published its minimum, a sixteenth of the scene's diagonal"));
}

void visit_options(Like<RenderOptions> auto& o, auto&& visit) {
  visit(o.method, method_option(Task::kImage));
  visit(o.what, choice("what", kRenderWhat,
                       "What the image shows: all light (image), direct light, ambient occlusion "
                       "(ao) or openness of the sky. The last two need the method silhouettes, "
                       "lines or rays"));
  visit(o.lines, Option{"lines",
                        "Methods silhouettes and lines: lines through the sky per point; each area "
                        "light gets a quarter as many",
                        1, 1 << 14});
  visit(o.tolerance, Option{"tolerance",
                            "Methods silhouettes and lines: double the lines until two halves "
                            "differ by at most twice this share of the result (0: never)",
                            0, 1});
  visit(o.rays, Option{"rays", "Method rays: rays per point for the sky and for each area light", 1,
                       1 << 20});
  visit(o.generator, kGeneratorOption);
  visit(o.points, kPointsOption);
  visit_options(o.blur, visit);
}

void visit_options(Like<GradientOptions> auto& o, auto&& visit) {
  visit(o.method, method_option(Task::kGradient));
  visit(o.terms, terms_option(Task::kGradient));
  visit(o.step, step_option("Step of finite differences (method fd), in the parameter's unit"));
  visit_options(o.warp, visit);
  visit_options(o.blur, visit);
  visit(o.points, kPointsOption);
}

void visit_options(Like<CheckOptions> auto& o, auto&& visit) {
  visit(o.method, method_option(Task::kGradient));
  visit(o.terms, terms_option(Task::kGradient));
  visit(o.step, step_option("Step of the finite differences, in the parameter's unit"));
  visit(o.block,
        Option{"block", "Spacing in pixels of the windows whose sums are compared", 1, 1 << 20}
            .or_zero("an eighth of the longer side, at least 4")
            .samples());
  visit_options(o.warp, visit);
  visit_options(o.blur, visit);
  visit(o.points, kPointsOption);
}

}  // namespace limn
