#pragma once
// Reverse mode's sinks of boundary samples: each pushes the points of its sample, and the viewer.

#include "integrators/backward/edge_motion.h"
#include "integrators/backward/film_adjoint.h"
#include "integrators/backward/film_field.h"
#include "integrators/terms/boundary_sample.h"
#include "limn/core/var.h"

namespace limn {

inline double weighed(const Rgb<double>& adjoint, const Rgb<double>& value) {
  return adjoint.r * value.r + adjoint.g * value.g + adjoint.b * value.b;
}

// The samples of one vertex of a path. adjoint: dLoss/dI of the pixel, over what samples are
// averaged by.
class VertexAdjoint final : public BoundarySink {
 public:
  VertexAdjoint(const EdgeMotion& motion, const Rgb<double>& adjoint, const Vec3<Var>& p,
                Tape& tape, Seeds& seeds, SampleLog* log)
      : BoundarySink(log), motion_(motion), adjoint_(adjoint), p_(p), tape_(tape), seeds_(seeds) {}

  bool takes(const BoundaryForm& form, const Rng& key) override;
  void add(const Rgb<double>& amount) override;

 private:
  const EdgeMotion& motion_;
  const Rgb<double>& adjoint_;
  const Vec3<Var>& p_;
  Tape& tape_;
  Seeds& seeds_;
  const BoundaryForm* form_ = nullptr;
};

// One sample of the film. share: of the batch's samples, one over their number for each pixel and
// path. field: by which positions move; null: they are held.
class FilmPointAdjoint final : public FilmSink {
 public:
  FilmPointAdjoint(const EdgeMotion& motion, const FilmAdjoint& film, const FilmField* field,
                   double share, Tape& tape)
      : motion_(motion), film_(film), field_(field), share_(share), tape_(tape) {
    book_on(own_);
  }
  // Whether its pixels have an adjoint, and whether it added something.
  bool has_adjoint() const { return has_adjoint_; }
  bool added() const { return added_; }
  const FilmPlace& place() const { return place_; }
  const Seeds& seeds() const { return seeds_; }

  bool at(const FilmPlace& place) override;
  bool takes(const BoundaryForm& form, const Rng& key) override;
  void add(const Rgb<double>& amount) override;
  void add_line(const FilmLineSample& line, const Rgb<double>& difference) override;

 private:
  void add_clip(const FilmLineSample& line, double weight);
  bool film_moves() const { return field_ && field_->moves(place_); }

  const EdgeMotion& motion_;
  const FilmAdjoint& film_;
  const FilmField* field_;
  double share_;
  Tape& tape_;
  Seeds seeds_;
  TermCost own_;
  FilmPlace place_;
  Rgb<double> adjoint_;
  bool has_adjoint_ = true, added_ = false;
  const BoundaryForm* form_ = nullptr;
};

}  // namespace limn
