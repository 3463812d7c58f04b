// Covariances over batches of one sample, least squares over windows, chosen by cross-validation.
#include "integrators/pilot/film_fit.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "integrators/pilot/allocation.h"
#include "integrators/pilot/pilot.h"
#include "limn/core/parallel.h"

namespace limn {
namespace {

// So many samples are taken of every other cell, then of the rest. Even.
constexpr int kTurn = 4;
constexpr int kRadii[] = {1, 2, 4};
constexpr int kJudgeRadius = 4;
// Motion must leave less than this share of what is left by positions that are held: over 9 by 9
// cells of their variance. Not tuned.
constexpr double kConvincing = 0.8;
// The same over the film, of squared error times work. Fits from half of so few samples leave more
// than those that are used: in the sun 0.97 was found where 0.7 is right, in the demo 0.81 where
// 0.65 is.
constexpr double kConvincingFilm = 0.92;
// A pilot that has found more than this left after 4, 8 or 16 samples looks no further. Not tuned.
constexpr double kHopeless = 0.99;
// As in field_fit.cpp.
constexpr double kRidge = 0.05, kLeast = 0.01;
// What is left of a term decides how much of the work it gets, and so how much it counts.
constexpr int kRounds = 3;

// Numbers the entries of symmetric matrices: over the parameters' derivatives, which come first, and
// what the film's motions along x and y add.
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

// [entry][cell]: covariances of one sample, summed over channels, or weighted sums of some.
using CellMatrices = std::vector<std::vector<double>>;

// Sums over samples of one slot.
class SlotSums {
 public:
  SlotSums(const Entries& entries, size_t cells)
      : entries_(entries),
        first_(3 * entries.figures(), std::vector<float>(cells)),
        second_(entries.size(), std::vector<float>(cells)) {}

  void add(size_t cell, const std::vector<Rgb<double>>& figures) {
    for (int i = 0; i < entries_.figures(); ++i) {
      const Rgb<double>& a = figures[i];
      for (int c = 0; c < 3; ++c) first_[3 * i + c][cell] += static_cast<float>(a[c]);
      for (int j = 0; j <= i; ++j) {
        const Rgb<double>& b = figures[j];
        second_[entries_.of(i, j)][cell] += static_cast<float>(a.r * b.r + a.g * b.g + a.b * b.b);
      }
    }
  }
  CellMatrices covariances(int samples) const {
    CellMatrices result;
    for (int i = 0; i < entries_.figures(); ++i) {
      for (int j = 0; j <= i; ++j) {  // in the order of entries
        const std::vector<float>& products = second_[entries_.of(i, j)];
        std::vector<double>& cells = result.emplace_back(products.begin(), products.end());
        for (size_t cell = 0; cell < cells.size(); ++cell) {
          for (int c = 0; c < 3; ++c) {
            cells[cell] -= double{first_[3 * i + c][cell]} * first_[3 * j + c][cell] / samples;
          }
          cells[cell] /= samples - 1;
        }
      }
    }
    return result;
  }

 private:
  Entries entries_;
  std::vector<std::vector<float>> first_, second_;  // [figure and channel], [entry]
};

// Along x and y, in units of the probing motion.
struct Coefficients {
  double x = 0, y = 0;
};

// Of one cell: from either half of the samples, to be judged by the other, and from both.
struct CellFit {
  std::array<Coefficients, 2> halves;
  Coefficients both;
};
using Fits = std::vector<std::vector<CellFit>>;  // [parameter][cell]

// Variance of a derivative that moves so.
double variance_with(const CellMatrices& c, const Entries& e, size_t cell, int parameter,
                     const Coefficients& b) {
  const auto of = [&](int i, int j) { return c[e.of(i, j)][cell]; };
  return of(parameter, parameter) + 2 * (b.x * of(parameter, e.x()) + b.y * of(parameter, e.y())) +
         b.x * b.x * of(e.x(), e.x()) + 2 * b.x * b.y * of(e.x(), e.y()) +
         b.y * b.y * of(e.y(), e.y());
}

// Finds the motion that leaves least squared error times work.
class FilmFitter {
 public:
  // slots: [half][slot]. work: of a sample of each slot.
  FilmFitter(const PlanGrid& grid, const Entries& entries,
             std::array<std::vector<CellMatrices>, 2> slots, std::vector<double> work, int threads)
      : grid_(grid),
        entries_(entries),
        slots_(std::move(slots)),
        work_(std::move(work)),
        threads_(threads) {}

  void run() {
    const double held =
        error_times_work(variances(Fits(entries_.parameters(), Fits::value_type(grid_.size()))));
    if (!(held > 0)) return;
    std::vector<double> left(work_.size(), 1);
    for (int round = 0; round < kRounds; ++round) {
      weigh(left);
      fits_ = choose();
      left = variances(fits_);
    }
    left_ = error_times_work(left) / held;
  }
  // What is left of squared error times work, cross-validated; 1 where nothing moves.
  double left() const { return left_; }
  const Coefficients& of(int parameter, size_t cell) const { return fits_[parameter][cell].both; }

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
  std::vector<double> variances(const Fits& fits) const {
    std::vector<double> result(work_.size());
    for (int k = 0; k < entries_.parameters(); ++k) {
      std::vector<double> own(work_.size());
      double held = 0;
      for (size_t t = 0; t < work_.size(); ++t) {
        std::vector<double> moving(grid_.size()), resting(grid_.size());
        for (size_t cell = 0; cell < grid_.size(); ++cell) {
          for (int half = 0; half < 2; ++half) {
            const CellMatrices& other = slots_[1 - half][t];
            moving[cell] +=
                0.5 * variance_with(other, entries_, cell, k, fits[k][cell].halves[half]);
            resting[cell] += 0.5 * other[entries_.of(k, k)][cell];
          }
        }
        own[t] = trimmed_mean(moving);
        held += trimmed_mean(resting);
      }
      if (!(held > 0)) continue;
      for (size_t t = 0; t < work_.size(); ++t) result[t] += own[t] / held;
    }
    return result;
  }

  // As in field_fit.cpp: by the derivative of squared error times work.
  void weigh(const std::vector<double>& variances) {
    for (int half = 0; half < 2; ++half) {
      total_[half].assign(entries_.size(), std::vector<double>(grid_.size()));
      for (size_t t = 0; t < work_.size(); ++t) {
        if (!(variances[t] > 0) || !(work_[t] > 0)) continue;
        const double weight = std::sqrt(work_[t] / variances[t]);
        for (size_t i = 0; i < entries_.size(); ++i) {
          for (size_t cell = 0; cell < grid_.size(); ++cell) {
            total_[half][i][cell] += weight * slots_[half][t][i][cell];
          }
        }
      }
    }
    usual_.assign(entries_.size(), 0);
    for (const CellMatrices& total : total_) {
      for (size_t i = 0; i < entries_.size(); ++i) {
        usual_[i] += 0.5 * std::accumulate(total[i].begin(), total[i].end(), 0.0) /
                     static_cast<double>(grid_.size());
      }
    }
  }

  // Least squares.
  Coefficients solve(const CellMatrices& c, size_t cell, int parameter) const {
    const auto of = [&](int i, int j) { return c[entries_.of(i, j)][cell]; };
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
  Fits choose() const {
    Fits fits(entries_.parameters(), Fits::value_type(grid_.size()));
    std::vector<std::vector<double>> least;
    for (int k = 0; k < entries_.parameters(); ++k) {
      std::vector<double> held(grid_.size());
      for (const CellMatrices& total : total_) {
        const std::vector<double>& own = total[entries_.of(k, k)];
        for (size_t cell = 0; cell < grid_.size(); ++cell) held[cell] += 0.5 * own[cell];
      }
      least.push_back(window_means(grid_, held, kJudgeRadius));
      for (double& v : least[k]) v *= kConvincing;
    }
    for (const int radius : kRadii) {
      std::array<CellMatrices, 3> windows;  // over either half, and over both
      for (CellMatrices& matrices : windows) matrices.resize(entries_.size());
      parallel_for(entries_.size(), threads_, [&](size_t i) {
        for (int half = 0; half < 2; ++half)
          windows[half][i] = window_means(grid_, total_[half][i], radius);
        windows[2][i] = windows[0][i];
        for (size_t cell = 0; cell < grid_.size(); ++cell)
          windows[2][i][cell] += windows[1][i][cell];
      });
      for (int k = 0; k < entries_.parameters(); ++k) try_windows(windows, k, least[k], fits[k]);
    }
    return fits;
  }

  void try_windows(const std::array<CellMatrices, 3>& windows, int parameter,
                   std::vector<double>& least, std::vector<CellFit>& best) const {
    std::vector<CellFit> fits(grid_.size());
    std::vector<double> left(grid_.size());
    for (size_t cell = 0; cell < grid_.size(); ++cell) {
      for (int half = 0; half < 2; ++half) {
        const Coefficients b = solve(windows[half], cell, parameter);
        fits[cell].halves[half] = b;
        left[cell] += 0.5 * variance_with(total_[1 - half], entries_, cell, parameter, b);
      }
      fits[cell].both = solve(windows[2], cell, parameter);
    }
    const std::vector<double> judged = window_means(grid_, left, kJudgeRadius);
    for (size_t cell = 0; cell < grid_.size(); ++cell) {
      if (!(judged[cell] < least[cell])) continue;
      least[cell] = judged[cell];
      best[cell] = fits[cell];
    }
  }

  const PlanGrid& grid_;
  Entries entries_;
  std::array<std::vector<CellMatrices>, 2> slots_;
  std::vector<double> work_;
  int threads_;
  std::array<CellMatrices, 2> total_;  // of all slots, weighed
  std::vector<double> usual_;          // its means over the film
  Fits fits_;
  double left_ = 1;
};

// Samples of the probe, one to a batch: what terms on the film add has no samples of its own in a
// pixel.
class FilmPilot {
 public:
  FilmPilot(const TermEstimator& estimator, const PlanGrid& grid)
      : estimator_(estimator), grid_(grid), entries_(estimator.lanes()) {
    auto probe = std::make_unique<FilmProbe>(estimator, grid, kTurn);
    probe_ = probe.get();
    probes_.push_back(std::move(probe));
    costs_.resize(estimator.slots());
  }

  // False if interrupted.
  bool run_sample(int number, const RunSettings& settings, const Stopwatch& watch) {
    constexpr uint64_t kStream = 0xf117;  // any number
    RunSettings quiet = settings;
    quiet.progress = nullptr;
    ProgressCounter progress(quiet, watch, 1);
    const Batch batch{mix_bits(settings.seed + kStream), number, number + 1};
    const auto found = run_batch(probes_, batch, settings.threads, progress);
    if (found.empty()) return false;
    auto& sums = sums_[number % 2];
    if (sums.empty()) sums.assign(estimator_.slots(), SlotSums(entries_, grid_.size()));
    for (size_t slot = 0; slot < estimator_.slots(); ++slot) {
      costs_[slot].merge(found[0].costs[slot]);
      add(number, &found[0].images[slot * entries_.figures()], sums[slot]);
    }
    ++samples_;
    return true;
  }
  int samples() const { return samples_; }

  // samples() must be 4, or a multiple of 8.
  FilmFitter fit(int threads) const {
    std::array<std::vector<CellMatrices>, 2> slots;
    for (int half = 0; half < 2; ++half) {
      for (const SlotSums& sums : sums_[half])
        slots[half].push_back(sums.covariances(std::max(kTurn / 2, samples_ / 4)));
    }
    std::vector<double> work;
    for (size_t slot = 0; slot < estimator_.slots(); ++slot) {
      const size_t pixels =
          estimator_.adds_to_pixels(slot) ? (grid_.size() + 1) / 2 : film_size(film()) / 3;
      work.push_back(estimator_.work(slot, costs_[slot]) /
                     (static_cast<double>(samples_) * static_cast<double>(pixels)));
    }
    FilmFitter fitter(grid_, entries_, std::move(slots), std::move(work), threads);
    fitter.run();
    return fitter;
  }

 private:
  const Film& film() const { return estimator_.scene().film; }

  // images: of every figure.
  void add(int number, const std::vector<double>* images, SlotSums& sums) const {
    std::vector<Rgb<double>> figures(entries_.figures());
    for (int y = film().crop_y; y < film().crop_y + film().crop_height; ++y) {
      for (int x = film().crop_x; x < film().crop_x + film().crop_width; ++x) {
        if (!probe_->looks_at({x, y, number})) continue;
        const size_t index = pixel_index(film(), x, y);
        for (int i = 0; i < entries_.figures(); ++i) {
          const double* at = &images[i][index];
          figures[i] = {at[0], at[1], at[2]};
        }
        sums.add(grid_.index(x, y), figures);
      }
    }
  }

  const TermEstimator& estimator_;
  const PlanGrid& grid_;
  Entries entries_;
  std::vector<std::unique_ptr<SampleEstimator>> probes_;  // one
  const FilmProbe* probe_;
  std::array<std::vector<SlotSums>, 2> sums_;  // of samples with even and with odd numbers
  std::vector<TermCost> costs_;
  int samples_ = 0;
};

}  // namespace

void FilmProbe::add_pixels(std::span<const KeyedSample> samples, SampleSink& sink) const {
  std::vector<KeyedSample> probes;
  for (const KeyedSample& sample : samples) {
    if (looks_at(sample.at)) probes.push_back(sample);
  }
  terms_.add_pixels(probes, sink);
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

FilmFit fit_film(TermEstimator& estimator, const SamplePlan& plan, int spp,
                 const RunSettings& settings, const Stopwatch& watch) {
  FilmFit fit;
  fit.grid = PlanGrid(estimator.scene().film, kMostProbes);
  const int parameters = estimator.lanes();
  const double unit = film_speed(estimator);
  if (!(unit > 0) || !std::isfinite(unit)) return fit;
  FilmMotion probing;  // in the free lanes behind the parameters'
  probing.x[parameters] = probing.y[parameters + 1] = unit;
  SamplePlan moving = plan;
  moving.grid = fit.grid;
  moving.film.assign(fit.grid.size(), probing);
  estimator.set_plan(std::move(moving));

  FilmPilot pilot(estimator, fit.grid);
  const double began = watch.seconds();
  while (pilot.samples() < spp) {
    if (!pilot.run_sample(pilot.samples(), settings, watch)) return fit;
    const int samples = pilot.samples();
    if (samples == 1 && settings.seconds > 0) {
      const double each = watch.seconds() - began;
      spp = std::min(spp, static_cast<int>(std::min(settings.seconds / 8 / each, 1e6)) / 8 * 8);
      if (spp == 0) return fit;
    }
    const bool looks = samples == 4 || samples == 8 || samples == 16;
    if (looks && samples < spp && pilot.fit(settings.threads).left() > kHopeless) return fit;
  }
  const FilmFitter fitter = pilot.fit(settings.threads);
  if (fitter.left() > kConvincingFilm) return fit;
  fit.motion.resize(fit.grid.size());
  for (size_t cell = 0; cell < fit.grid.size(); ++cell) {
    for (int k = 0; k < parameters; ++k) {
      fit.motion[cell].x[k] = fitter.of(k, cell).x * unit;
      fit.motion[cell].y[k] = fitter.of(k, cell).y * unit;
    }
  }
  return fit;
}

}  // namespace limn
