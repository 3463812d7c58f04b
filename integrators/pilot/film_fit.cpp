// Covariances over batches of one sample, least squares over windows, chosen by cross-validation.
#include "integrators/pilot/film_fit.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "integrators/pilot/allocation.h"
#include "integrators/pilot/film_flow.h"
#include "integrators/pilot/pilot.h"
#include "limn/core/parallel.h"

namespace limn {
namespace {

// So many samples are taken of every other cell, then of the rest.
constexpr int kTurn = 4;
// Each of a turn's samples is judged by fits from the others.
constexpr int kFolds = kTurn;
constexpr int kAll = -1;  // but no fold
constexpr int kRadii[] = {1, 2, 4};
constexpr int kJudgeRadius = 4;
// Motion must leave less than this share of what is left by positions that are held: over 9 by 9
// cells of their variance. Not tuned.
constexpr double kConvincing = 0.8;
// As in field_fit.cpp.
constexpr double kRidge = 0.05, kLeast = 0.01;
// What is left of a term decides how much of the work it gets, and so how much it counts.
constexpr int kRounds = 3;

// Numbers the entries of symmetric matrices: over the parameters' derivatives, which come first,
// and what the film's motions along x and y add.
class Entries {
 public:
  explicit Entries(int parameters) : parameters_(parameters) {}
  int parameters() const { return parameters_; }
  int figures() const { return parameters_ + 2; }
  int x() const { return parameters_; }
  int y() const { return parameters_ + 1; }
  size_t size() const { return static_cast<size_t>(figures()) * (figures() + 1) / 2; }
  size_t of(int i, int j) const { return i < j ? of(j, i) : i * (i + 1) / 2 + j; }

 private:
  int parameters_;
};

// Covariances of one sample of a cell, summed over channels, or weighted sums of some.
using Matrix = std::array<double, kLanes*(kLanes + 1) / 2>;
using CellMatrices = std::vector<Matrix>;

// Sums over the samples of one slot.
class SlotSums {
 public:
  SlotSums(const Entries& entries, size_t cells)
      : entries_(entries), size_(3 * entries.figures() + entries.size()) {
    sums_.resize(cells * kFolds * size_);
  }

  void add(int fold, size_t cell, const std::vector<Rgb<double>>& figures) {
    float* first = &sums_[(cell * kFolds + fold) * size_];
    float* second = first + 3 * entries_.figures();
    for (int i = 0; i < entries_.figures(); ++i) {
      const Rgb<double>& a = figures[i];
      for (int c = 0; c < 3; ++c) *first++ += static_cast<float>(a[c]);
      for (int j = 0; j <= i; ++j) {  // in the order of entries
        const Rgb<double>& b = figures[j];
        *second++ += static_cast<float>(a.r * b.r + a.g * b.g + a.b * b.b);
      }
    }
  }
  // From the samples of all folds but one, so many in each.
  Matrix covariances(size_t cell, int but, int samples) const {
    const Sums sums = sum(cell, but);
    const double n = samples * (but == kAll ? kFolds : kFolds - 1);
    return each([&](int i, int j, size_t entry) {
      double products = sums.second[entry];
      for (int c = 0; c < 3; ++c) products -= sums.first[3 * i + c] * sums.first[3 * j + c] / n;
      return products / (n - 1);
    });
  }
  // From the samples of one fold, about the means of the others.
  Matrix judged(size_t cell, int fold, int samples) const {
    Sums own, others = sum(cell, fold);
    add(cell, fold, own);
    const double n = samples * (kFolds - 1);
    for (double& mean : others.first) mean /= n;
    return each([&](int i, int j, size_t entry) {
      double products = own.second[entry];
      for (int c = 0; c < 3; ++c) {
        const double a = others.first[3 * i + c], b = others.first[3 * j + c];
        products += samples * a * b - own.first[3 * i + c] * b - own.first[3 * j + c] * a;
      }
      return products / samples * (n / (n + 1));  // a mean has a variance of its own
    });
  }

 private:
  struct Sums {
    std::array<double, size_t{3} * kLanes> first{};
    Matrix second{};
  };
  void add(size_t cell, int fold, Sums& to) const {
    const float* from = &sums_[(cell * kFolds + fold) * size_];
    const size_t firsts = size_t{3} * entries_.figures();
    for (size_t i = 0; i < firsts; ++i) to.first[i] += from[i];
    for (size_t i = firsts; i < size_; ++i) to.second[i - firsts] += from[i];
  }
  Sums sum(size_t cell, int but) const {
    Sums sums;
    for (int fold = 0; fold < kFolds; ++fold) {
      if (fold != but) add(cell, fold, sums);
    }
    return sums;
  }
  template <class Entry>
  Matrix each(const Entry& entry) const {
    Matrix result{};
    size_t number = 0;
    for (int i = 0; i < entries_.figures(); ++i) {
      for (int j = 0; j <= i; ++j, ++number) result[number] = entry(i, j, number);
    }
    return result;
  }

  Entries entries_;
  size_t size_;  // of the sums of a cell and fold: figures and channels, then entries
  std::vector<float> sums_;
};

// Along x and y, in units of the probing motion.
struct Coefficients {
  double x = 0, y = 0;
};

// Of one cell: from all samples but those of each fold, to be judged by these, and from all.
struct CellFit {
  std::array<Coefficients, kFolds> folds;
  Coefficients all;
  int flow = -1;  // of FilmFlows, of which it is the motion there; none: a fit
};
using Fits = std::vector<std::vector<CellFit>>;  // [parameter][cell]

// Variance of a derivative that moves so.
double variance_with(const Matrix& c, const Entries& e, int parameter, const Coefficients& b) {
  const auto of = [&](int i, int j) { return c[e.of(i, j)]; };
  return of(parameter, parameter) + 2 * (b.x * of(parameter, e.x()) + b.y * of(parameter, e.y())) +
         b.x * b.x * of(e.x(), e.x()) + 2 * b.x * b.y * of(e.x(), e.y()) +
         b.y * b.y * of(e.y(), e.y());
}

void add_to(Matrix& sum, double weight, const Matrix& m) {
  for (size_t i = 0; i < m.size(); ++i) sum[i] += weight * m[i];
}

// Finds the motion that leaves least squared error times work.
class FilmFitter {
 public:
  // samples: of each cell and fold. flows: where each cell is looked at. work: of a sample of each
  // slot.
  FilmFitter(const PlanGrid& grid, const Entries& entries, const std::vector<SlotSums>& slots,
             int samples, const FilmFlows& flows, std::vector<double> work, int threads)
      : grid_(grid),
        entries_(entries),
        slots_(slots),
        samples_(samples),
        flows_(flows),
        work_(std::move(work)),
        threads_(threads) {}

  void run() {
    fits_.assign(entries_.parameters(), Fits::value_type(grid_.size()));
    const double held = error_times_work(variances());
    if (!(held > 0)) return;
    std::vector<double> left(work_.size(), 1);
    for (int round = 0; round < kRounds; ++round) {
      weigh(left);
      choose();
      left = variances();
    }
    left_ = error_times_work(left) / held;
  }
  // What is left of squared error times work, cross-validated; 1 where nothing moves.
  double left() const { return left_; }
  const CellFit& of(int parameter, size_t cell) const { return fits_[parameter][cell]; }

 private:
  // After equal time, where samples are shared out best.
  double error_times_work(const std::vector<double>& variances) const {
    double sum = 0;
    for (size_t t = 0; t < work_.size(); ++t) {
      sum += std::sqrt(std::max(variances[t], 0.0) * work_[t]);
    }
    return sum * sum;
  }

  // Of every slot over the film, cross-validated, summed over the parameters, each in units of all
  // that it has with positions held.
  std::vector<double> variances() const {
    std::vector<std::vector<double>> moving(work_.size()), resting(work_.size());  // of parameters
    parallel_for(work_.size(), threads_, [&](size_t t) {
      for (int k = 0; k < entries_.parameters(); ++k) {
        std::vector<double> moved(grid_.size()), held(grid_.size());
        for (size_t cell = 0; cell < grid_.size(); ++cell) {
          for (int fold = 0; fold < kFolds; ++fold) {
            const Matrix c = slots_[t].judged(cell, fold, samples_);
            moved[cell] += variance_with(c, entries_, k, fits_[k][cell].folds[fold]) / kFolds;
            held[cell] += c[entries_.of(k, k)] / kFolds;
          }
        }
        moving[t].push_back(trimmed_mean(std::move(moved)));
        resting[t].push_back(trimmed_mean(std::move(held)));
      }
    });
    std::vector<double> result(work_.size());
    for (int k = 0; k < entries_.parameters(); ++k) {
      double held = 0;
      for (const std::vector<double>& of : resting) held += of[k];
      if (!(held > 0)) continue;
      for (size_t t = 0; t < work_.size(); ++t) result[t] += moving[t][k] / held;
    }
    return result;
  }

  // As in field_fit.cpp: by the derivative of squared error times work.
  void weigh(const std::vector<double>& variances) {
    all_.assign(grid_.size(), {});
    for (int fold = 0; fold < kFolds; ++fold) {
      fitted_[fold].assign(grid_.size(), {});
      judging_[fold].assign(grid_.size(), {});
    }
    parallel_for(grid_.size(), threads_, [&](size_t cell) {
      for (size_t t = 0; t < work_.size(); ++t) {
        if (!(variances[t] > 0) || !(work_[t] > 0)) continue;
        const double weight = std::sqrt(work_[t] / variances[t]);
        add_to(all_[cell], weight, slots_[t].covariances(cell, kAll, samples_));
        for (int fold = 0; fold < kFolds; ++fold) {
          add_to(fitted_[fold][cell], weight, slots_[t].covariances(cell, fold, samples_));
          add_to(judging_[fold][cell], weight, slots_[t].judged(cell, fold, samples_));
        }
      }
    });
    usual_ = {};
    for (const Matrix& m : all_) add_to(usual_, 1 / static_cast<double>(grid_.size()), m);
  }

  // Least squares.
  Coefficients solve(const Matrix& c, int parameter) const {
    const auto of = [&](int i, int j) { return c[entries_.of(i, j)]; };
    const double usual = usual_[entries_.of(parameter, parameter)];
    const double size = usual > 0 ? std::max(of(parameter, parameter), 0.0) / usual : 0;
    const auto diagonal = [&](int i) {
      return (1 + kRidge) * of(i, i) + kLeast * size * usual_[entries_.of(i, i)];
    };
    const int x = entries_.x(), y = entries_.y();
    const double xx = diagonal(x), yy = diagonal(y), xy = of(x, y);
    const double bx = -of(parameter, x), by = -of(parameter, y);
    const double determinant = xx * yy - xy * xy;
    const Coefficients b{(yy * bx - xy * by) / determinant, (xx * by - xy * bx) / determinant};
    return std::isfinite(b.x) && std::isfinite(b.y) ? b : Coefficients{};
  }

  // Of windows of all sizes the one that leaves least, and none that does not convince.
  void choose() {
    fits_.assign(entries_.parameters(), Fits::value_type(grid_.size()));
    std::vector<std::vector<double>> least;
    for (int k = 0; k < entries_.parameters(); ++k) {
      least.push_back(judged(k, Fits::value_type(grid_.size())));
      for (double& v : least[k]) v *= kConvincing;
    }
    for (int flow = 0; flow < static_cast<int>(flows_.size()); ++flow) {
      for (int k = 0; k < entries_.parameters(); ++k) {
        Fits::value_type fits(grid_.size());
        for (size_t cell = 0; cell < grid_.size(); ++cell) {
          const FilmMotion& motion = flows_[flow][cell];
          fits[cell].all = {motion.x[k], motion.y[k]};
          fits[cell].folds.fill(fits[cell].all);
          fits[cell].flow = flow;
        }
        take_better(k, fits, least[k]);
      }
    }
    for (const int radius : kRadii) {
      const CellMatrices all = windows(all_, radius);
      std::array<CellMatrices, kFolds> folds;
      for (int fold = 0; fold < kFolds; ++fold) folds[fold] = windows(fitted_[fold], radius);
      for (int k = 0; k < entries_.parameters(); ++k) {
        std::vector<CellFit> fits(grid_.size());
        parallel_for(grid_.size(), threads_, [&](size_t cell) {
          for (int fold = 0; fold < kFolds; ++fold)
            fits[cell].folds[fold] = solve(folds[fold][cell], k);
          fits[cell].all = solve(all[cell], k);
        });
        take_better(k, fits, least[k]);
      }
    }
  }

  // Where fits leave less than the least so far.
  void take_better(int parameter, const Fits::value_type& fits, std::vector<double>& least) {
    const std::vector<double> left = judged(parameter, fits);
    for (size_t cell = 0; cell < grid_.size(); ++cell) {
      if (!(left[cell] < least[cell])) continue;
      least[cell] = left[cell];
      fits_[parameter][cell] = fits[cell];
    }
  }

  // What fits leave over 9 by 9 cells, cross-validated.
  std::vector<double> judged(int parameter, const std::vector<CellFit>& fits) const {
    std::vector<double> left(grid_.size());
    for (size_t cell = 0; cell < grid_.size(); ++cell) {
      for (int fold = 0; fold < kFolds; ++fold) {
        left[cell] +=
            variance_with(judging_[fold][cell], entries_, parameter, fits[cell].folds[fold]);
      }
    }
    return window_means(grid_, left, kJudgeRadius);
  }

  CellMatrices windows(const CellMatrices& cells, int radius) const {
    CellMatrices result(grid_.size());
    parallel_for(entries_.size(), threads_, [&](size_t i) {
      std::vector<double> values(grid_.size());
      for (size_t cell = 0; cell < grid_.size(); ++cell) values[cell] = cells[cell][i];
      values = window_means(grid_, values, radius);
      for (size_t cell = 0; cell < grid_.size(); ++cell) result[cell][i] = values[cell];
    });
    return result;
  }

  const PlanGrid& grid_;
  Entries entries_;
  const std::vector<SlotSums>& slots_;
  int samples_;
  const FilmFlows& flows_;  // in units of the probing motion
  std::vector<double> work_;
  int threads_;
  // Of all slots, weighed: from all samples, from those of all folds but one, and about these.
  CellMatrices all_;
  std::array<CellMatrices, kFolds> fitted_, judging_;
  Matrix usual_;  // the mean of all_
  Fits fits_;
  double left_ = 1;
};

// Samples of the probe, one to a batch: what terms on the film add has no samples of its own in a
// pixel.
class FilmPilot {
 public:
  FilmPilot(const TermEstimator& estimator, const PlanGrid& grid, FilmFlows flows)
      : estimator_(estimator), grid_(grid), flows_(std::move(flows)), entries_(estimator.lanes()) {
    auto probe = std::make_unique<FilmProbe>(estimator, grid, kTurn);
    probe_ = probe.get();
    probes_.push_back(std::move(probe));
    costs_.resize(estimator.slots());
    sums_.assign(estimator.slots(), SlotSums(entries_, grid.size()));
  }

  // False if interrupted.
  bool run_sample(const RunSettings& settings, const Stopwatch& watch) {
    constexpr uint64_t kStream = 0xf117;  // any number
    RunSettings quiet = settings;
    quiet.progress = nullptr;
    ProgressCounter progress(quiet, watch, 1);
    const Batch batch{mix_bits(settings.seed + kStream), samples_, samples_ + 1};
    const auto found = run_batch(probes_, batch, settings.threads, progress);
    if (found.empty()) return false;
    for (size_t slot = 0; slot < estimator_.slots(); ++slot) {
      costs_[slot].merge(found[0].costs[slot]);
      add(&found[0].images[slot * entries_.figures()], sums_[slot]);
    }
    ++samples_;
    return true;
  }
  int samples() const { return samples_; }
  double work() const {
    double sum = 0;
    for (size_t slot = 0; slot < estimator_.slots(); ++slot)
      sum += estimator_.work(slot, costs_[slot]);
    return sum;
  }

  // samples() must be kTurn, or a multiple of twice as many.
  FilmFitter fit(int threads) const {
    std::vector<double> work;
    for (size_t slot = 0; slot < estimator_.slots(); ++slot) {
      const size_t pixels =
          estimator_.adds_to_pixels(slot) ? (grid_.size() + 1) / 2 : film_size(film()) / 3;
      work.push_back(estimator_.work(slot, costs_[slot]) /
                     (static_cast<double>(samples_) * static_cast<double>(pixels)));
    }
    const int of_fold = std::max(1, samples_ / (2 * kFolds));
    FilmFitter fitter(grid_, entries_, sums_, of_fold, flows_, std::move(work), threads);
    fitter.run();
    return fitter;
  }

 private:
  const Film& film() const { return estimator_.scene().film; }

  // images: of every figure, of the sample at hand.
  void add(const std::vector<double>* images, SlotSums& sums) const {
    std::vector<Rgb<double>> figures(entries_.figures());
    for (int y = film().crop_y; y < film().crop_y + film().crop_height; ++y) {
      for (int x = film().crop_x; x < film().crop_x + film().crop_width; ++x) {
        if (!probe_->looks_at({x, y, samples_})) continue;
        const size_t index = pixel_index(film(), x, y);
        for (int i = 0; i < entries_.figures(); ++i) {
          const double* at = &images[i][index];
          figures[i] = {at[0], at[1], at[2]};
        }
        sums.add(samples_ % kFolds, grid_.index(x, y), figures);
      }
    }
  }

  const TermEstimator& estimator_;
  const PlanGrid& grid_;
  FilmFlows flows_;
  Entries entries_;
  std::vector<std::unique_ptr<SampleEstimator>> probes_;  // one
  const FilmProbe* probe_;
  std::vector<SlotSums> sums_;
  std::vector<TermCost> costs_;
  int samples_ = 0;
};

// So many samples as each cell can have alike, at most; or those of the first turn.
int whole_turns(double samples) {
  const int each = 2 * kTurn;
  return samples < each ? (samples < kTurn ? 0 : kTurn)
                        : static_cast<int>(std::min(samples, 1e6)) / each * each;
}

// The flows where each cell of a grid is looked at, in units of the probing motion.
FilmFlows flows_of_probes(const FilmFlows& flows, const PlanGrid& of, const Film& film,
                          const PlanGrid& grid, double unit) {
  FilmFlows probes;
  for (size_t flow = 0; flow < flows.size(); ++flow) {
    probes[flow].resize(grid.size());
    for (int y = film.crop_y; y < film.crop_y + film.crop_height; ++y) {
      for (int x = film.crop_x; x < film.crop_x + film.crop_width; ++x) {
        if (!grid.is_probe(film, x, y)) continue;
        const FilmMotion& motion = flows[flow][of.index(x, y)];
        probes[flow][grid.index(x, y)] = {motion.x * (1 / unit), motion.y * (1 / unit)};
      }
    }
  }
  return probes;
}

bool looks_after(int samples, int last) {
  return samples == last || samples == 4 || samples == 8 || samples == 16;
}

}  // namespace

void FilmProbe::add_pixels(std::span<const KeyedSample> samples, SampleSink& sink) const {
  std::vector<KeyedSample> probes;
  for (const KeyedSample& sample : samples) {
    if (looks_at(sample.at)) probes.push_back(sample);
  }
  terms_->add_pixels(probes, sink);
}

bool FilmProbe::looks_at(const PixelSample& at) const {
  const int column = (at.x - grid_.x0) / grid_.cell, row = (at.y - grid_.y0) / grid_.cell;
  return (column + row + at.s / turn_) % 2 == 0 && grid_.is_probe(scene().film, at.x, at.y);
}

double film_speed(const TermEstimator& estimator) {
  const Camera& camera = estimator.scene().camera;
  const double pixels = camera.width / (2 * std::tan(camera.fov.v * (kPi / 360)) * camera.x_factor);
  const Vec3d eye = value(camera.origin);
  const double distance = length(bounds_of(estimator.scene()).center() - eye);
  // Without shapes there are no bounds.
  return pixels * estimator.motion_rates().in_view(eye, std::isfinite(distance) ? distance : 0);
}

double edges_per_pixel(const TermEstimator& estimator) {
  const EdgeSamplerInput* edges = estimator.edges();
  if (!edges) return 0;
  const Camera& camera = estimator.scene().camera;
  const Film& film = estimator.scene().film;
  const bool moves_camera = estimator.motion_rates().moves_camera();
  std::vector<bool> met(film_size(film) / 3);
  size_t count = 0;
  for (const EdgeMesh& mesh : edges->objects) {
    if (mesh.tangents.empty() && !moves_camera) continue;
    for (const Edge& edge : mesh.edges) {
      const Vec3d middle =
          0.5 * (mesh.position(edge.vertices[0]) + mesh.position(edge.vertices[1]));
      const double depth = camera.depth(middle);
      if (!(depth > camera.near_clip && depth < camera.far_clip)) continue;
      const auto at = camera.project(middle);
      const double x = std::floor(at.x) - film.crop_x, y = std::floor(at.y) - film.crop_y;
      if (!(x >= 0 && y >= 0 && x < film.crop_width && y < film.crop_height)) continue;
      met[static_cast<size_t>(y) * film.crop_width + static_cast<size_t>(x)] = true;
      ++count;
    }
  }
  const auto pixels = std::count(met.begin(), met.end(), true);
  return pixels > 0 ? static_cast<double>(count) / static_cast<double>(pixels) : 0;
}

// In runs of 2.8 s, 64 x 64 pixels, four samples took a tenth of the time. With the look squared
// error was 0.8 times as large where the camera moves, which slides all that is seen, 0.95 (sun),
// 1.05 (demo), 1.25 (concave, object in view) and 1.2 to 1.6 (plant, lights, CAD part). Where they
// took less than a fourteenth, the look cost a sixth of the time: 0.8 (sun, lights), 0.9 (camera),
// 1.0 to 1.3 (mirrors, concave, soft shadow, demo), 1.4 to 1.7 (object in view, plant, CAD part).
// Where several edges lie in a pixel, it may be a factor of ten and more, and a pilot of a share of
// the pixels finds it.
bool is_time_for_film(const PilotTime& pilot, bool slides, double detail) {
  constexpr double kShare = 1.0 / 28, kCameraShare = 1.0 / 6;  // of the time
  return 4 * pilot.taken < kShare * pilot.seconds * pilot.spp ||
         ((slides || detail >= kFilmDetail) && pilot.taken < kCameraShare * pilot.seconds);
}

FilmFit fit_film(TermEstimator& estimator, const SamplePlan& plan, const FilmLook& look,
                 const RunSettings& settings, const Stopwatch& watch) {
  const Film& film = estimator.scene().film;
  FilmFit fit;
  fit.grid = PlanGrid(film, kMostProbes);
  const PlanGrid probes(film, look.pixels);
  const int parameters = estimator.lanes();
  const double unit = film_speed(estimator);
  if (!(unit > 0) || !std::isfinite(unit)) return fit;
  FilmMotion probing;  // in the free lanes behind the parameters'
  probing.x[parameters] = probing.y[parameters + 1] = unit;
  SamplePlan moving = plan;
  moving.grid = probes;
  moving.film.assign(probes.size(), probing);
  estimator.set_plan(std::move(moving));

  const FilmFlows flows = film_flows(estimator, fit.grid, settings.threads);
  FilmPilot pilot(estimator, probes, flows_of_probes(flows, fit.grid, film, probes, unit));
  const double began = watch.seconds();
  for (int last = kTurn; pilot.samples() < last;) {
    if (!pilot.run_sample(settings, watch)) return fit;
    if (pilot.samples() == 1) {
      double most = std::min<double>(look.spp, look.work / pilot.work());
      if (settings.seconds > 0)
        most = std::min(most, settings.seconds / 16 / (watch.seconds() - began));
      last = whole_turns(most);
    }
    if (!looks_after(pilot.samples(), last)) continue;
    const FilmFitter fitter = pilot.fit(settings.threads);
    const double left = fitter.left();
    if (!(left <= look.most_left)) return fit;
    if (pilot.samples() < last) continue;
    fit.motion.resize(fit.grid.size());
    for (size_t cell = 0; cell < fit.grid.size(); ++cell) {
      const size_t probe = in_grid(probes, fit.grid, cell);
      for (int k = 0; k < parameters; ++k) {
        const CellFit& chosen = fitter.of(k, probe);
        const FilmMotion* flow = chosen.flow < 0 ? nullptr : &flows[chosen.flow][cell];
        fit.motion[cell].x[k] = flow ? flow->x[k] : chosen.all.x * unit;
        fit.motion[cell].y[k] = flow ? flow->y[k] : chosen.all.y * unit;
      }
    }
  }
  return fit;
}

}  // namespace limn
