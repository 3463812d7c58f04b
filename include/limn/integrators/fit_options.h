#pragma once
// The options of reverse mode, losses and fits, as rows of options.h.
#include "limn/integrators/fit.h"
#include "limn/integrators/options.h"

namespace limn {

inline constexpr const char* kPixels[] = {"adjoint", "uniform"};
inline constexpr const char* kCaustics[] = {"paths", "particles"};
inline constexpr Option kLossOption =
    choice("loss", kLosses,
           "Loss, a mean over pixels and channels of (I - T)^2 (l2), (I - T)^2 / (T^2 + 0.01) "
           "(relative-l2), |I - T| (l1), the same of sRGB's encoded values (l1-srgb) or "
           "|I - T| / (|I| + |T| + 0.01) (smape)");
inline constexpr Option kPyramidOption{
    "pyramid",
    "Levels of an image pyramid, each half as large as the one before. The loss is the mean over "
    "the levels",
    1, 32};

void visit_options(Like<BackwardOptions> auto& o, auto&& visit, Task task = Task::kBackward) {
  visit(o.method, method_option(task));
  visit(o.terms, terms_option(task));
  visit(o.uniform_pixels,
        choice("pixels", kPixels,
               "Pixels in which paths start: adjoint (more where the loss depends more on the "
               "pixel) or uniform")
            .with(&Option::flag, "uniform_pixels")
            .samples());
  visit(o.points, kPointsOption);
  const bool fit = task == Task::kFit;  // its steps have no pilot
  visit(o.edge_samples,
        Option{"edge_samples",
               fit ? "Boundary samples per path vertex"
                   : "Boundary samples per path vertex. A number other than the default turns the "
                     "pilot off",
               1, 1 << 16}
            .samples());
  visit(o.camera_samples,
        Option{"camera_samples",
               fit ? "Boundary samples on the film per path (term camera)"
                   : "Boundary samples on the film per path (term camera). A number turns the "
                     "pilot off",
               1e-6L, 1 << 16}
            .or_zero(fit ? "1" : "a pilot's choice; without one 1")
            .samples());
  visit(o.shadow_samples,
        Option{"shadow_samples",
               fit ? "Boundary samples on the edges of visible shadows per path (terms shadow and "
                     "penumbra)"
                   : "Boundary samples on the edges of visible shadows per path (terms shadow and "
                     "penumbra). A number other than the default turns the pilot off",
               1e-6L, 1 << 16}
            .samples());
  if (fit) return;
  visit(o.batches, Option{"batches",
                          "Most batches, from which standard errors come; each takes some time per "
                          "vertex",
                          1, 1 << 16}
                       .samples());
}

void visit_options(Like<LossOptions> auto& o, auto&& visit) {
  visit(o.kind, kLossOption);
  visit(o.levels, kPyramidOption);
  visit(o.method, method_option(Task::kImage));
  visit(o.points, kPointsOption);
}

void visit_options(Like<FitOptions> auto& o, auto&& visit) {
  visit(o.loss, kLossOption);
  visit(o.pyramid, kPyramidOption);
  visit(o.optimiser,
        choice("optimiser", kOptimisers,
               "Optimiser: adam-uniform (Adam with one scale for all vertices of a shape), adam, "
               "gradient-descent, or lbfgs, which needs a loss without noise (the method "
               "analytic)"));
  visit(o.step, Option{"step",
                       "Length of the first step in natural steps: what moves a shape's fastest "
                       "vertex by 1 % of its diagonal, 0.01 radians of the camera, 1 % of a value",
                       1e-12L, 1e12L});
  visit(o.step_half_life,
        Option{"step_half_life", "Halve the step length every so many steps", 1, 1 << 30}.or_zero(
            "never"));
  visit(o.smoothing, Option{"smoothing",
                            "How far the step of a vertex spreads over the mesh, as a share of the "
                            "shape's diagonal (0: no smoothing)",
                            0, 100});
  visit(o.remesh, Option{"remesh", "Steps after which optimised meshes are remeshed, as in 100,200",
                         1, 1 << 30});
  visit(o.remesh_edge,
        Option{"remesh_edge", "Edge length after remeshing, relative to the mean length before",
               0.1L, 10});
  visit(o.remesh_shrink,
        Option{"remesh_shrink", "Factor on the lengths of steps and smoothing after each remeshing",
               0.01L, 1});
  visit(
      o.blur_steps,
      Option{"blur_steps",
             "Take the first N steps with faces blurred, so that objects also move towards targets "
             "they do not overlap. Needs `sigma`; arrays of at most 1024 numbers",
             1, 1 << 30}
          .or_zero("none"));
  visit(o.blur.sigma, Option{"sigma",
                             "Squared width over which faces fade beyond their sides in the first "
                             "step, in squared scene units",
                             1e-30L, 1e30L}
                          .or_zero("not blurred"));
  visit(o.sigma_end,
        Option{"sigma_end", "The same in the last blurred step", 1e-30L, 1e30L}.or_zero(
            "a hundredth of `sigma`"));
  visit(o.blur.gamma, Option{"gamma",
                             "Depth over which blurred surfaces mix in the first step, in scene "
                             "units; proportional to the root of sigma",
                             1e-15L, 1e15L}
                          .or_zero("none"));
  visit(o.blur.particles,
        choice("caustics", kCaustics,
               "Caustics of area lights in the images of the loss and in the blurred steps: by "
               "paths from the camera, or by particles from the lights"));
  visit(o.loss_spp, Option{"loss_spp",
                           "Samples per pixel of each of the two images from which the loss is "
                           "computed",
                           1, 1 << 30}
                        .or_zero("`spp`")
                        .samples());
  visit(o.spp_doubling,
        Option{"spp_doubling", "Double the samples per pixel every so many steps", 1, 1 << 30}
            .or_zero("never")
            .samples());
  visit_options(o.backward, visit, Task::kFit);
}

}  // namespace limn
