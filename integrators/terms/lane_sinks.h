#pragma once
// Forward mode's sinks of boundary samples: velocities of up to kLanes parameters at once.
#include "integrators/film/film_point.h"
#include "integrators/paths/direction_field.h"
#include "integrators/paths/warp_field.h"
#include "integrators/terms/term.h"

namespace limn {

// What a pilot evaluates at a vertex: what it would add if directions at the path's first vertex
// turned about the axes x, y and z, on the same samples. Lanes 0 to 2 are the axes.
struct TurnedVertex {
  Vec3<Lanes> velocity{};  // of the vertex as it then slides [scene units per unit of the turn]
  DirectionTurn turn;      // of directions here, in the same unit; zero but at the first vertex
  Rgb<Lanes> sum{};        // added to
};

// What a pilot learns of the draws that were traced.
struct TracedDraws {
  uint64_t count = 0, rays = 0;
  // For all channels, over the square of the luminance they are weighed by.
  double squared_difference = 0;
  void add(const TracedDraws& other) {
    count += other.count;
    rays += other.rays;
    squared_difference += other.squared_difference;
  }
};

// The samples of one vertex of a path.
class VertexLanes final : public BoundarySink {
 public:
  struct Setting {
    const Scene& scene;
    const WarpField* warp = nullptr;  // by which directions move, in place of turns
    int parameters = kLanes;          // the first lanes; others are a pilot's
    TracedDraws* traced = nullptr;    // null but in a pilot
    SampleLog* log = nullptr;
  };
  // surface: the vertex as it moves. turned: null but in a pilot.
  VertexLanes(const Setting& setting, const PathVertex& vertex, const SurfacePoint<Dual>& surface,
              TurnedVertex* turned)
      : BoundarySink(setting.log),
        setting_(setting),
        vertex_(vertex),
        surface_(surface),
        turned_(turned) {}

  // Starts a term. survival: of what its draws add, see SamplePlan.
  void start(TermCost& cost, const Lanes& survival) {
    book_on(cost);
    survival_ = survival;
    sum_ = {};
    if (turned_) turned_->sum = {};
  }
  const Rgb<Lanes>& sum() const { return sum_; }

  bool takes(const BoundaryForm& form, const Rng& key) override;
  bool survives(const Rgb<double>& scattered, const Rng& key) override;
  void traced(const Rgb<double>& scattered, const RayCount& rays,
              const Rgb<double>& amount) override;
  void add(const Rgb<double>& amount) override;

 private:
  const Setting& setting_;
  const PathVertex& vertex_;
  const SurfacePoint<Dual>& surface_;
  TurnedVertex* turned_;
  Lanes survival_{};
  Rgb<Lanes> sum_{};
  const BoundaryForm* form_ = nullptr;  // taken up, with its rate
  Lanes rate_;
};

// One sample of the film.
class FilmLanes final : public FilmSink {
 public:
  // moves_film: positions on the film may move. rates: as directions do; null: they are held.
  FilmLanes(const Scene& scene, bool moves_film, const MotionRates* rates, FilmSample& sample)
      : scene_(scene), moves_film_(moves_film), rates_(rates), sample_(sample) {
    book_on(own_);
  }
  bool added() const { return added_; }

  bool at(const FilmPlace& place) override;
  bool takes(const BoundaryForm& form, const Rng& key) override;
  void add(const Rgb<double>& amount) override;
  void add_line(const FilmLineSample& line, const Rgb<double>& difference) override;

 private:
  const Scene& scene_;
  bool moves_film_;
  const MotionRates* rates_;
  FilmSample& sample_;
  FilmPlace place_;
  TermCost own_;
  bool added_ = false;
  const BoundaryForm* form_ = nullptr;
  Lanes rate_;
};

}  // namespace limn
