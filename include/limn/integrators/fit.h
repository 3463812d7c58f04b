#pragma once
// Fitting a scene to images: steps against the gradient of a loss, for any parameters at once, all
// vertices of a shape included.
//
// The loss is the mean over views. Each step renders every view twice for the loss and its adjoint
// image and takes the gradient with samples of their own (see backward.h), so that the
// gradients of l2 and relative-l2 are unbiased. Vertices are moved through u = (I + lambda L) v,
// which spreads each step over a neighbourhood (Nicolet, Jacobson, Jakob 2021, "Large Steps in
// Inverse Rendering of Geometry", Sec. 3).
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "limn/core/blur.h"
#include "limn/core/image.h"
#include "limn/core/scene.h"
#include "limn/integrators/backward.h"
#include "limn/integrators/run.h"

namespace limn {

// What becomes of a gradient g. Numbers are in natural steps: for a parameter that moves a shape,
// the step that moves its fastest vertex by 1 % of the diagonal; else Parameter::natural_step.
enum class OptimiserKind {
  kAdamUniform,      // Adam, but all vertices of a shape share the largest second moment, so that
                     // steps keep the gradient's direction (Nicolet et al. 2021, Sec. 3.4)
  kAdam,             // Kingma and Ba 2015, without its epsilon, with a second moment that forgets
                     // in 20 steps: gradients are noisy, and now and then very large
  kGradientDescent,  // g itself: the size of a step is that of the loss
  // Limited-memory BFGS (Nocedal and Wright 2006, 7.2), with a line search to Wolfe's conditions.
  // It compares losses and gradients of different steps, which noise would make worthless: so it
  // needs light in closed form (the method "analytic"), takes the same samples at every step,
  // alike in all pixels, one image for the loss, and minimises that function of the parameters. Its
  // derivative is the term "interior"; where silhouettes that the camera sees are moved, their term
  // adds an estimate of their part of the mean image's, which the function itself does not have.
  // Over faces (FilmPoints) the function has it, and the gradient is its own.
  // Numbers at a bound that would go on past it are held. Not for l1, nor with more samples
  // as steps go on.
  kLbfgs,
};
inline constexpr const char* kOptimisers[] = {"adam-uniform", "adam", "gradient-descent",
                                              "lbfgs"};  // by their numbers

struct FitView {
  Scene scene;
  Image target;  // crop_height by crop_width, of three channels or one
  Image mask;    // weights of the pixels as in image_loss(); without pixels: all alike
};

// What scalars and texels may not leave; what the reader of scenes would refuse is never left.
struct FitBounds {
  std::string parameter;
  double least, most;
};

struct FitOptions {
  // Names as in parameter.h: scalars, SHAPE.vertex_positions, SHAPE.displacement (along the normals
  // as they are at the start), EMITTER.data; at least one. Every view that has a name moves with
  // it, and one view must have it. Colours move by channels. Motions of a shape, its
  // vertex_positions and its displacement exclude each other, as do motions of texels and all of
  // them; where vertices are fitted, normals of the file give way to computed ones.
  std::vector<std::string> parameters;
  std::vector<FitBounds> bounds;
  LossKind loss = LossKind::kL2;
  int pyramid = 1;  // levels of image_loss()
  OptimiserKind optimiser = OptimiserKind::kAdamUniform;
  // Length of the first step, in natural steps: a shape's fastest vertex moves by 1 % of its
  // diagonal, the camera turns by 0.01 radians, a value changes by 1 %.
  double step = 1;
  int step_half_life = 0;  // after so many steps a step is half as long; 0: all are alike
  int spp_doubling = 0;    // after so many steps there are twice the samples; 0: always as many
  // The distance over which a step of a vertex spreads, over the diagonal of the shape's bounds:
  // lambda = (distance / mean length of an edge)^2. 0: vertices move one by one.
  double smoothing = 0.08;
  // After so many steps shapes whose vertices are fitted get new triangles of one size (Botsch and
  // Kobbelt 2004), their edges remesh_edge times as long as the mean was; steps and smoothing
  // shrink by remesh_shrink, from the large to the small. Needs manifold meshes without flat
  // shading, and OpenMesh.
  std::vector<int64_t> remesh;
  double remesh_edge = 0.75;
  double remesh_shrink = 0.65;
  // The first blur_steps steps take derivatives of the scene with its faces blurred (core/blur.h,
  // kOrdered, shaded flat) in place of exact ones: no gradient of the loss, but 0 in the mean where
  // the image meets the target, and not 0 beside what is near and does not overlap yet. sigma goes
  // from blur.sigma to sigma_end (0: a hundredth) evenly in its logarithm, gamma as its root.
  // InputError for arrays of more than 1024 numbers, lbfgs and faces. 0: none, then with sigma 0.
  // blur.particles: the loss's images are by light-traced, blurred or not.
  int blur_steps = 0;
  Blur blur;
  double sigma_end = 0;
  int loss_spp = 0;  // samples per pixel of each of the two images of the loss; 0: settings.spp
  // Terms and where samples go; `parameters` is not looked at.
  BackwardOptions backward = [] {
    BackwardOptions own;
    own.method = Method(Task::kFit);
    return own;
  }();
};

// One step.
struct FitRecord {
  int64_t step = 0;  // counted from 0
  // Before the step; mean over views. May be negative, see LossResult.
  double loss = 0, error = 0;
  std::vector<double> view_losses;
  double sigma = 0;      // of the gradient's blurred faces; 0: it was exact
  double step_size = 0;  // that was tried, in natural steps
  // How often it was halved so that no face lost its area or grew together with another; if 30
  // times, that shape was left where it was.
  int halvings = 0;
  bool remeshed = false;  // after the step
  int evaluations = 1;    // losses and gradients that the step took
  // Of kLbfgs: no lower loss was found, nothing was moved, and no remeshing is left. Where one is,
  // the fit goes on to it at once, and steps() with it.
  bool at_rest = false;
  std::vector<double> values;  // of Fit::scalars(), after the step
  double seconds = 0;
};

// A number that is fitted: a value of the scene (of a colour NAME.r, NAME.g and NAME.b), or for
// what only moves things from where they are the sum of all steps.
struct FitScalar {
  std::string name, unit;
  double value = 0;
  std::string parameter;  // that it belongs to, as it was requested
};

// All that a later step depends on, besides what the Fit was made from.
struct FitState {
  int64_t steps = 0;
  struct Numbers {
    std::vector<double> values;           // u of an array, n by 3 or n; else the sums of steps
    std::vector<double> first, second;    // moments of Adam; empty for gradient descent
    double natural_step = 0, lambda = 0;  // of an array, as they were when its mesh was made
  };
  std::vector<Numbers> parameters;  // in the order of FitOptions
  // Of kLbfgs: the last steps and changes of the gradient, the oldest first.
  std::vector<std::vector<double>> moves, changes;
  struct Shape {
    std::vector<Vec3f> positions;    // V
    std::vector<Vec3d> normals;      // N
    std::vector<FaceIndices> faces;  // F by 3
  };
  struct View {
    std::vector<double> camera;               // origin, left, up, forward, fov, lens
    std::vector<Shape> shapes;                // of those that are moved, in the scene's order
    std::vector<std::vector<double>> pivots;  // the same: center and size; empty: none
    std::vector<std::vector<double>> values;  // of each parameter but vertices; empty: it has none
    // 3 each, of the courses of moved shapes and of the camera: the center and keyframes' places.
    std::vector<double> courses;
    // H by W by 3 each, of the maps that motions without values move.
    std::vector<float> texels;
  };
  std::vector<View> views;
};

class Fit {
 public:
  // Copies all of it. settings: seed, threads, spp (of the gradient), interrupted; progress is
  // called with the fraction of a step. InputError for names that no view has, arrays that differ
  // from view to view, bounds that leave a value outside, targets and masks of another size, terms
  // that a view does not have, remeshing before the first step.
  Fit(std::vector<FitView> views, const FitOptions& options, const RunSettings& settings);
  ~Fit();
  Fit(Fit&&) noexcept;

  // One step; nothing if it was interrupted, and then nothing has changed. The same seed gives the
  // same bits on any number of threads. InputError where samples are not finite; nothing has
  // changed then, either.
  std::optional<FitRecord> step();

  // In place of what the settings said of progress and interruption; null for none.
  void listen(const std::function<void(double)>& progress, const std::atomic<bool>* interrupted);

  int64_t steps() const;                      // done
  const std::vector<FitView>& views() const;  // as they are now
  std::vector<FitScalar> scalars() const;
  const std::vector<std::string>& warnings() const;

  // A Fit made from the same views and options that restores a state goes on with the very bits.
  FitState state() const;
  // InputError for the state of other parameters or meshes.
  void restore(const FitState& state);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace limn
