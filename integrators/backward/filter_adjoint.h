#pragma once
// What moving positions on the film change in the pixels, in reverse mode. With A(x) the adjoint
// that a position sees, of all filters that reach it, and f the radiance there, it is
//   integral of f div(A V) dx  =  integral of f (A div V + V . grad A) dx
//                                 + integral over A's discontinuities of f (A_+ - A_-) V . n dl,
// n from - to +. Neighbouring pixels cancel but for what A differs by. Paths of the pixels give
// the first, and samples of the lines the second: the sides of pixels with a box filter, else the
// rim of a crop that cuts filters.
#include "integrators/backward/film_adjoint.h"
#include "integrators/backward/film_field.h"
#include "integrators/backward/pixel_choice.h"
#include "limn/core/discrete_distribution.h"
#include "limn/core/tape.h"

namespace limn {

class FilterAdjoint {
 public:
  // All must outlive it.
  FilterAdjoint(const Film& film, const FilmAdjoint& adjoint, const PixelChoice& choice,
                const FilmField& field);

  // Whether a path of a pixel adds something though its own pixel has no adjoint.
  bool needs_all() const { return film_.filter.kind != Filter::Kind::kBox; }
  // A path of this pixel found this radiance. paths: of all pixels in the batch.
  void add_path(const PixelSample& pixel, double paths, const FilmPosition& at,
                const Rgb<double>& radiance, Tape& tape) const;

  // Samples of lines for each path: none where A is nearly continuous.
  double line_samples() const { return line_samples_; }
  struct LinePoint {
    FilmPosition at;
    Rgb<double> difference;  // of A, over the density of the point [1 / pixel]
    uint32_t slots[2];       // of V . n, between two corners, and their weights
    double weights[2];
  };
  // u in [0, 1).
  LinePoint line_point(double u) const;

 private:
  struct Line {
    int column, row;  // of its first corner
    bool vertical;
  };
  Rgb<double> difference(const Line& line, double along) const;
  void add_lines();
  void add_line(const Line& line, double even);
  FilmPosition place(const Line& line, double along) const;

  const Film& film_;
  FilterTable table_;
  const FilmAdjoint& adjoint_;
  const PixelChoice& choice_;
  const FilmField& field_;
  std::vector<Line> lines_;
  DiscreteDistribution choice_of_line_;
  double line_samples_ = 0;
};

}  // namespace limn
