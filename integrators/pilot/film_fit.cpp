// Covariances over batches of one sample, least squares over windows, chosen by cross-validation.
#include "integrators/pilot/film_fit.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "integrators/pilot/allocation.h"
#include "integrators/pilot/pilot.h"

namespace limn {
namespace {

constexpr int kRadii[] = {1, 2, 4};
constexpr int kJudgeRadius = 4;
// Motion must leave less than this share of what is left by positions that are held: over 9 by 9
// cells of their variance, over the film of squared error times work. Not tuned.
constexpr double kConvincing = 0.8;
// As in field_fit.cpp.
constexpr double kRidge = 0.05, kLeast = 0.01;
constexpr int kRounds = 3;

// All terms, with the film's two motions as if they were parameters behind the others.
class FilmProbe final : public SampleEstimator {
 public:
  FilmProbe(const TermEstimator& terms, const PlanGrid& grid) : terms_(terms), grid_(grid) {}

  const Scene& scene() const override { return terms_.scene(); }
  size_t slots() const override { return terms_.slots(); }
  const char* slot_name(size_t slot) const override { return terms_.slot_name(slot); }
  int lanes() const override { return terms_.lanes() + 2; }
  Lanes lane_scale() const override { return terms_.lane_scale(); }
  bool samples_pixels() const override { return terms_.samples_pixels(); }
  size_t pixel_slot() const override { return terms_.pixel_slot(); }
  void add_pixels(std::span<const KeyedSample> samples, SampleSink& sink) const override {
    std::vector<KeyedSample> probes;
    for (const KeyedSample& sample : samples) {
      if (grid_.is_probe(scene().film, sample.at.x, sample.at.y)) probes.push_back(sample);
    }
    terms_.add_pixels(probes, sink);
  }
  double film_samples(size_t slot) const override { return terms_.film_samples(slot); }
  int film_stream(size_t slot) const override { return terms_.film_stream(slot); }
  bool sample_film(size_t slot, double u, const Rng& key, RayCount& rays,
                   FilmSample& sample) const override {
    return terms_.sample_film(slot, u, key, rays, sample);
  }
  const FilmMotion* film_motion(int x, int y) const override { return terms_.film_motion(x, y); }

 private:
  const TermEstimator& terms_;
  const PlanGrid& grid_;
};

// Of the derivatives of the parameters, which come first, and by the film's two motions.
class Figures {
 public:
  explicit Figures(int parameters) : count_(parameters + 2) {}
  size_t size() const { return static_cast<size_t>(count_) * (count_ + 1) / 2; }
  size_t of(int i, int j) const { return i < j ? of(j, i) : i * (i + 1) / 2 + j; }
  int count() const { return count_; }

 private:
  int count_;
};

// Covariances, summed over channels: [entry of Figures][cell].
using Covariances2 = std::vector<std::vector<double>>;

// Of one slot over one half of the batches.
class SlotSums {
 public:
  SlotSums(const Figures& figures, size_t cells)
      : figures_(figures),
        cells_(cells),
        first_(3 * figures.count(), std::vector<float>(cells)),
        second_(figures.size(), std::vector<float>(cells)) {}

  // x: of every figure and channel.
  void add(size_t cell, const std::vector<Rgb<double>>& x) {
    for (int i = 0; i < figures_.count(); ++i) {
      for (int c = 0; c < 3; ++c) first_[3 * i + c][cell] += static_cast<float>(x[i][c]);
      for (int j = 0; j <= i; ++j) {
        const double product = x[i].r * x[j].r + x[i].g * x[j].g + x[i].b * x[j].b;
        second_[figures_.of(i, j)][cell] += static_cast<float>(product);
      }
    }
  }
  Covariances2 covariances(int samples) const {
    Covariances2 result(figures_.size(), std::vector<double>(cells_));
    for (int i = 0; i < figures_.count(); ++i) {
      for (int j = 0; j <= i; ++j) {
        for (size_t cell = 0; cell < cells_; ++cell) {
          double means = 0;
          for (int c = 0; c < 3; ++c) {
            means += double{first_[3 * i + c][cell]} * first_[3 * j + c][cell] / samples;
          }
          result[figures_.of(i, j)][cell] =
              (second_[figures_.of(i, j)][cell] - means) / (samples - 1);
        }
      }
    }
    return result;
  }

 private:
  Figures figures_;
  size_t cells_;
  std::vector<std::vector<float>> first_, second_;
};

struct Vec2 {
  double x = 0, y = 0;
};

// The motion that leaves least, and what it leaves.
class Chooser {
 public:
  // covariances: [half][slot]; work: of a sample of every slot.
  Chooser(const PlanGrid& grid, const Figures& figures,
          const std::array<std::vector<Covariances2>, 2>& covariances,
          const std::vector<double>& work)
      : grid_(grid),
        figures_(figures),
        parameters_(figures.count() - 2),
        covariances_(covariances),
        work_(work) {}

  // [parameter][cell], in the unit of the probing motion; empty: none.
  std::vector<std::vector<Vec2>> run() {
    const Chosen held(parameters_, std::vector<Fit>(grid_.size()));
    const std::vector<double> at_rest = variances(held);
    if (!(error_times_work(at_rest) > 0)) return {};
    std::vector<double> left(work_.size(), 1);
    Chosen chosen;
    for (int round = 0; round < kRounds; ++round) {
      weigh(left);
      chosen = choose();
      left = variances(chosen);
    }
    if (!(error_times_work(left) < kConvincing * error_times_work(at_rest))) return {};
    std::vector<std::vector<Vec2>> result(parameters_);
    for (int k = 0; k < parameters_; ++k) {
      for (const Fit& fit : chosen[k]) result[k].push_back(fit.both);
    }
    return result;
  }

 private:
  // From either half and from both.
  struct Fit {
    Vec2 halves[2], both;
  };
  using Chosen = std::vector<std::vector<Fit>>;

  // Squared error after equal time, where samples are shared out best.
  double error_times_work(const std::vector<double>& variances) const {
    double sum = 0;
    for (size_t t = 0; t < work_.size(); ++t) {
      sum += std::sqrt(std::max(variances[t], 0.0) * work_[t]);
    }
    return sum * sum;
  }

  static double left_by(const Covariances2& c, const Figures& f, size_t cell, int k,
                        const Vec2& v) {
    const int x = f.count() - 2, y = x + 1;
    return c[f.of(k, k)][cell] + 2 * (v.x * c[f.of(k, x)][cell] + v.y * c[f.of(k, y)][cell]) +
           v.x * v.x * c[f.of(x, x)][cell] + 2 * v.x * v.y * c[f.of(x, y)][cell] +
           v.y * v.y * c[f.of(y, y)][cell];
  }

  // Of every slot over the film, cross-validated; each parameter in units of all that it has with
  // positions held.
  std::vector<double> variances(const Chosen& chosen) const {
    std::vector<double> result(work_.size());
    for (int k = 0; k < parameters_; ++k) {
      std::vector<double> own(work_.size());
      double held = 0;
      for (size_t t = 0; t < work_.size(); ++t) {
        std::vector<double> cells(grid_.size()), resting(grid_.size());
        for (size_t cell = 0; cell < grid_.size(); ++cell) {
          for (int half = 0; half < 2; ++half) {
            const Covariances2& other = covariances_[1 - half][t];
            cells[cell] +=
                0.5 * left_by(other, figures_, cell, k, chosen[k][cell].halves[half]);
            resting[cell] += 0.5 * other[figures_.of(k, k)][cell];
          }
        }
        own[t] = trimmed_mean(cells);
        held += trimmed_mean(resting);
      }
      if (!(held > 0)) continue;
      for (size_t t = 0; t < work_.size(); ++t) result[t] += own[t] / held;
    }
    return result;
  }

  // As in field_fit.cpp: the derivative of error times work by a slot's variance.
  void weigh(const std::vector<double>& variances) {
    for (int half = 0; half < 2; ++half) {
      total_[half].assign(figures_.size(), std::vector<double>(grid_.size()));
      for (size_t t = 0; t < work_.size(); ++t) {
        if (!(variances[t] > 0) || !(work_[t] > 0)) continue;
        const double weight = std::sqrt(work_[t] / variances[t]);
        for (size_t i = 0; i < figures_.size(); ++i) {
          for (size_t cell = 0; cell < grid_.size(); ++cell) {
            total_[half][i][cell] += weight * covariances_[half][t][i][cell];
          }
        }
      }
    }
    prior_.assign(figures_.size(), 0);
    for (size_t i = 0; i < figures_.size(); ++i) {
      for (const Covariances2& total : total_) {
        prior_[i] += 0.5 * std::accumulate(total[i].begin(), total[i].end(), 0.0) /
                     static_cast<double>(grid_.size());
      }
    }
  }

  Vec2 solve(const Covariances2& c, size_t cell, int k) const {
    const int x = figures_.count() - 2, y = x + 1;
    const double usual = prior_[figures_.of(k, k)];
    const double size = usual > 0 ? std::max(c[figures_.of(k, k)][cell], 0.0) / usual : 0;
    const auto diagonal = [&](int i) {
      return (1 + kRidge) * c[figures_.of(i, i)][cell] +
             kLeast * size * prior_[figures_.of(i, i)];
    };
    const double xx = diagonal(x), yy = diagonal(y), xy = c[figures_.of(x, y)][cell];
    const double bx = -c[figures_.of(k, x)][cell], by = -c[figures_.of(k, y)][cell];
    const double determinant = xx * yy - xy * xy;
    const Vec2 v{(yy * bx - xy * by) / determinant, (xx * by - xy * bx) / determinant};
    return std::isfinite(v.x) && std::isfinite(v.y) ? v : Vec2{};
  }

  Chosen choose() const {
    Chosen chosen(parameters_, std::vector<Fit>(grid_.size()));
    std::vector<std::vector<double>> least(parameters_);
    for (int k = 0; k < parameters_; ++k) {
      std::vector<double> held(grid_.size());
      for (size_t cell = 0; cell < grid_.size(); ++cell) {
        for (const Covariances2& total : total_) {
          held[cell] += 0.5 * total[figures_.of(k, k)][cell];
        }
      }
      least[k] = window_means(grid_, held, kJudgeRadius);
      for (double& v : least[k]) v *= kConvincing;
    }
    for (const int radius : kRadii) {
      Covariances2 windows[3];
      for (int half = 0; half < 2; ++half) {
        for (const auto& entry : total_[half]) {
          windows[half].push_back(window_means(grid_, entry, radius));
        }
      }
      windows[2] = windows[0];
      for (size_t i = 0; i < figures_.size(); ++i) {
        for (size_t cell = 0; cell < grid_.size(); ++cell) {
          windows[2][i][cell] = 0.5 * (windows[0][i][cell] + windows[1][i][cell]);
        }
      }
      for (int k = 0; k < parameters_; ++k) try_windows(windows, k, least[k], chosen[k]);
    }
    return chosen;
  }

  void try_windows(const Covariances2 (&windows)[3], int k, std::vector<double>& least,
                   std::vector<Fit>& chosen) const {
    std::vector<Fit> fits(grid_.size());
    std::vector<double> left(grid_.size());
    for (size_t cell = 0; cell < grid_.size(); ++cell) {
      for (int half = 0; half < 2; ++half) {
        fits[cell].halves[half] = solve(windows[half], cell, k);
        left[cell] += 0.5 * left_by(total_[1 - half], figures_, cell, k, fits[cell].halves[half]);
      }
      fits[cell].both = solve(windows[2], cell, k);
    }
    const std::vector<double> judged = window_means(grid_, left, kJudgeRadius);
    for (size_t cell = 0; cell < grid_.size(); ++cell) {
      if (!(judged[cell] < least[cell])) continue;
      least[cell] = judged[cell];
      chosen[cell] = fits[cell];
    }
  }

  const PlanGrid& grid_;
  const Figures& figures_;
  int parameters_;
  const std::array<std::vector<Covariances2>, 2>& covariances_;
  const std::vector<double>& work_;
  std::array<Covariances2, 2> total_;  // of all slots, weighed
  std::vector<double> prior_;          // its means over the film
};

}  // namespace

double film_speed(const TermEstimator& estimator) {
  const Camera& camera = estimator.scene().camera;
  const double pixels =
      camera.width / (2 * std::tan(camera.fov.v * (kPi / 360)) * camera.x_factor);
  return pixels * estimator.motion_rates().at(value(camera.origin));
}

FilmFit fit_film(TermEstimator& estimator, SamplePlan plan, int spp, const RunSettings& settings,
                 const Stopwatch& watch) {
  FilmFit fit;
  const Film& film = estimator.scene().film;
  const int parameters = estimator.lanes();
  fit.grid = PlanGrid(film, kMostProbes);
  const double unit = film_speed(estimator);
  FilmMotion probing;  // in the free lanes behind the parameters'
  probing.x[parameters] = probing.y[parameters + 1] = unit;
  plan.grid = fit.grid;
  plan.film.assign(fit.grid.size(), probing);
  estimator.set_plan(std::move(plan));

  const Figures figures(parameters);
  const size_t slots = estimator.slots();
  std::vector<std::unique_ptr<SampleEstimator>> probes;
  probes.push_back(std::make_unique<FilmProbe>(estimator, fit.grid));
  std::array<std::vector<SlotSums>, 2> sums;
  for (auto& half : sums) half.assign(slots, SlotSums(figures, fit.grid.size()));
  std::vector<TermCost> costs(slots);
  RunSettings quiet = settings;
  quiet.progress = nullptr;
  const double began = watch.seconds();
  std::vector<Rgb<double>> x(figures.count());
  for (int s = 0; s < spp; ++s) {
    ProgressCounter progress(quiet, watch, 1);
    constexpr uint64_t kStream = 0xf117;  // any number
    const Batch batch{mix_bits(settings.seed + kStream), s, s + 1};
    const auto found = run_batch(probes, batch, settings.threads, progress);
    if (found.empty()) return fit;
    for (size_t slot = 0; slot < slots; ++slot) {
      costs[slot].merge(found[0].costs[slot]);
      for (int row = 0; row < film.crop_height; ++row) {
        for (int column = 0; column < film.crop_width; ++column) {
          const int px = film.crop_x + column, py = film.crop_y + row;
          if (!fit.grid.is_probe(film, px, py)) continue;
          const size_t index = pixel_index(film, px, py);
          for (int i = 0; i < figures.count(); ++i) {
            const auto& image = found[0].images[slot * figures.count() + i];
            x[i] = {image[index], image[index + 1], image[index + 2]};
          }
          sums[s < spp / 2 ? 0 : 1][slot].add(fit.grid.index(px, py), x);
        }
      }
    }
    if (s == 0 && settings.seconds > 0) {
      const double each = watch.seconds() - began;
      const int fitting = static_cast<int>(std::min(settings.seconds / 16 / each, 1e6));
      spp = std::min(spp, fitting) / 2 * 2;
      if (spp < 4) return fit;
    }
  }
  std::array<std::vector<Covariances2>, 2> covariances;
  for (int half = 0; half < 2; ++half) {
    for (const SlotSums& slot : sums[half]) covariances[half].push_back(slot.covariances(spp / 2));
  }
  std::vector<double> work;
  for (size_t slot = 0; slot < slots; ++slot) {
    const size_t pixels =
        estimator.adds_to_pixels(slot) ? fit.grid.size() : film_size(film) / 3;
    work.push_back(estimator.work(slot, costs[slot]) /
                   (static_cast<double>(spp) * static_cast<double>(pixels)));
  }
  fit.spp = spp;
  const auto chosen = Chooser(fit.grid, figures, covariances, work).run();
  if (chosen.empty()) return fit;
  fit.motion.resize(fit.grid.size());
  for (int k = 0; k < parameters; ++k) {
    for (size_t cell = 0; cell < fit.grid.size(); ++cell) {
      fit.motion[cell].x[k] = chosen[k][cell].x * unit;
      fit.motion[cell].y[k] = chosen[k][cell].y * unit;
    }
  }
  return fit;
}

}  // namespace limn
