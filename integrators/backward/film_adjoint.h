#pragma once
// What points on the film add to a gradient: of silhouettes, of edges of shadows, and ends of lines
// from lamps.
#include "integrators/backward/adjoint_context.h"

namespace limn {

// dLoss/dI, crop_height by crop_width, as points of the film see it.
// Of the crop's pixels, row by row. InputError for an image of another size, or not finite.
std::vector<Rgb<double>> adjoint_pixels(const Scene& scene, const Image& adjoint);

class FilmAdjoint {
 public:
  FilmAdjoint(const Film& film, std::vector<Rgb<double>> pixels)
      : film_(film), pixels_(std::move(pixels)) {}
  const std::vector<Rgb<double>>& pixels() const { return pixels_; }
  // Of the pixels whose filters reach a film position, weighed by them.
  Rgb<double> at(double x, double y) const;

 private:
  const Film& film_;
  std::vector<Rgb<double>> pixels_;
};

// One sample: u in [0, 1), stratified over a batch, chooses the point; `key` is for everything
// else. share: of the batch's samples, one over their number for each pixel and path. As
// add_path_adjoint.
bool add_camera_adjoint(const AdjointContext& context, const FilmAdjoint& film, double u,
                        const Rng& key, double share, Tape& tape, TermCost& cost,
                        std::vector<Contribution>& contributions);
bool add_penumbra_adjoint(const AdjointContext& context, const FilmAdjoint& film, double u,
                          const Rng& key, double share, Tape& tape, TermCost& cost,
                          std::vector<Contribution>& contributions);
bool add_shadow_adjoint(const AdjointContext& context, const FilmAdjoint& film, double u,
                        const Rng& key, double share, Tape& tape, TermCost& cost,
                        std::vector<Contribution>& contributions);

}  // namespace limn
