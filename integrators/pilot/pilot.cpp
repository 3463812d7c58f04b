// The pilot: second moments of single samples, pixel by pixel.
#include "integrators/pilot/pilot.h"

#include <algorithm>

#include "integrators/pilot/probed.h"

namespace limn {
namespace {

// The samples of probed pixels go into sums; only what belongs to the film goes on.
class PilotEstimator final : public ProbingEstimator {
 public:
  PilotEstimator(const TermEstimator& terms, bool turns, size_t pixels)
      : ProbingEstimator(terms), grid_(terms.scene().film, pixels), turns_(turns) {
    for (size_t slot = 0; slot < terms.slots(); ++slot) {
      sums_.emplace_back(terms.adds_to_pixels(slot) ? grid_.size() : 0, terms.lanes());
      pairs_.emplace_back(terms.draws_at_vertices(slot) ? grid_.size() : 0, terms.lanes());
    }
    listing_.resize(grid_.size() * terms.slots());
    traced_.resize(grid_.size());
  }

  void add_pixels(std::span<const KeyedSample> samples, SampleSink& sink) const override {
    for (const KeyedSample& sample : samples) add_pixel(sample.at, sample.key, sink);
  }
  // The film has samples for as many pixels as are probed.
  double share() const {
    return static_cast<double>(grid_.size()) / (static_cast<double>(film_size(scene().film)) / 3);
  }
  double film_samples(size_t slot) const override {
    const bool fewer = fewer_ && !terms_->adds_to_pixels(slot);
    return terms_->film_samples(slot) * share() * (fewer ? kFewer : 1);
  }
  // Terms of the film alone have fewer samples: what stratification makes of more is seen.
  static constexpr double kFewer = 0.25;
  void take_fewer(bool fewer) { fewer_ = fewer; }
  // From now on, with the same slots and parameters.
  void look_at(const TermEstimator& terms) { terms_ = &terms; }

  const PlanGrid& grid() const { return grid_; }
  const std::vector<PairSums>& pairs() const { return pairs_; }
  // Of all samples.
  double listing(size_t slot) const {
    double sum = 0;
    for (size_t cell = 0; cell < grid_.size(); ++cell) sum += listing_[cell * slots() + slot];
    return sum;
  }
  TracedDraws traced() const {
    TracedDraws sum;
    for (const TracedDraws& cell : traced_) sum.add(cell);
    return sum;
  }
  // Of the samples since the last call.
  std::vector<CellCovariances> take_covariances(int samples) {
    std::vector<CellCovariances> result;
    for (CellSums& sums : sums_) result.push_back(sums.take(samples));
    return result;
  }

 private:
  // A share of the cells tells enough, and second draws take time.
  bool draws_pairs(size_t cell) const {
    constexpr size_t kPairs = 1024;  // not tuned
    const size_t each = (grid_.size() + kPairs - 1) / kPairs;
    return (cell % grid_.columns + 3 * (cell / grid_.columns)) % each == 0;
  }
  void add_pixel(const PixelSample& at, const Rng& key, SampleSink& sink) const {
    if (!grid_.is_probe(scene().film, at.x, at.y)) return;
    const size_t cell = grid_.index(at.x, at.y);
    const bool pair = draws_pairs(cell);
    const TermEstimator::Sample sample = terms_->sample(at, key, turns_, pair, sink);
    if (!sample.finite) return;
    for (size_t slot = 0; slot < slots(); ++slot) {
      if (!sums_[slot].empty()) sums_[slot].add(cell, sample.terms[slot]);
      if (!terms_->draws_at_vertices(slot)) continue;
      listing_[cell * slots() + slot] += sample.listing[slot];
      // Terms may draw at some times alone.
      if (pair && !pairs_[slot].empty())
        pairs_[slot].add(cell, sample.pair[slot][0], sample.pair[slot][1]);
    }
    traced_[cell].add(sample.traced);
  }

  PlanGrid grid_;
  bool turns_;
  bool fewer_ = false;
  // Of every slot; a cell is written by the thread of its tile alone.
  mutable std::vector<CellSums> sums_;
  mutable std::vector<TracedDraws> traced_;
  mutable std::vector<PairSums> pairs_;  // of every slot
  mutable std::vector<double> listing_;  // [cell][slot]
};

// Sums up batches.
class PilotRun {
 public:
  PilotRun(const TermEstimator& terms, std::unique_ptr<PilotEstimator> pilot)
      : terms_(terms), pilot_(*pilot), costs_(terms.slots()) {
    for (auto& film : film_) {
      film.assign(terms.slots() * terms.lanes(), Moments(film_size(terms.scene().film)));
    }
    estimators_.push_back(std::move(pilot));
  }

  // Samples [first, last); false if interrupted. Each is a batch of its own: terms of the film are
  // stratified over a batch, where more samples leave less than so many single ones.
  bool run(const RunSettings& settings, int first, int last, const Stopwatch& watch,
           const TermsAt& at = {}) {
    RunSettings quiet = settings;
    quiet.progress = nullptr;
    ProgressCounter progress(quiet, watch, 1);
    constexpr uint64_t kStream = 0x9110;  // any number
    for (int sample = first; sample < last; ++sample) {
      pilot_.take_fewer(sample % 2 == 1);
      std::unique_ptr<TermEstimator> there;
      if (at) {
        const Stopwatch set_up;
        there = at(sample);
        there->set_plan(terms_.plan());
        pilot_.look_at(*there);
        set_up_ += set_up.seconds();
      }
      const Batch batch{mix_bits(settings.seed + kStream), sample, sample + 1};
      const auto sums = run_batch(estimators_, batch, settings.threads, progress);
      pilot_.look_at(terms_);
      if (sums.empty()) return false;
      for (size_t slot = 0; slot < costs_.size(); ++slot) costs_[slot].merge(sums[0].costs[slot]);
      std::vector<Moments>& film = film_[sample % 2];
      for (size_t i = 0; i < film.size(); ++i) film[i].add_batch(sums[0].images[i], 1);
    }
    return true;
  }

  // seconds: of all batches.
  void add_work(int spp, double seconds, PilotFigures& figures) const {
    double all = 0;
    for (size_t slot = 0; slot < costs_.size(); ++slot) {
      const double samples = static_cast<double>(spp) * static_cast<double>(pilot_.grid().size());
      const double listing = pilot_.listing(slot);
      const double work = terms_.work(slot, costs_[slot]) + listing;
      const double film_share = terms_.adds_to_pixels(slot) ? 1 : (1 + PilotEstimator::kFewer) / 2;
      figures.work.push_back(work / (samples * film_share));
      figures.first_work.push_back((terms_.first_work(slot, costs_[slot]) + listing) / samples);
      all += work;
    }
    figures.seconds_of_work = all > 0 ? (seconds - set_up_) / all : 0;
  }

  // A thousandth of the pixels that vary, those that do most, is left out: single bright samples
  // would rule the choice. share: of a sample that each pixel had.
  Lanes film_variance(size_t slot, double share, bool fewer = false) const {
    Lanes result;
    for (int lane = 0; lane < terms_.lanes(); ++lane) {
      const Moments& moments = film_[fewer][slot * terms_.lanes() + lane];
      std::vector<double> variances(moments.size() / 3);
      for (size_t i = 0; i < moments.size(); ++i) {
        variances[i / 3] += moments.variance(i) * static_cast<double>(moments.samples());
      }
      std::sort(variances.begin(), variances.end());
      const auto seen = static_cast<size_t>(
          variances.end() - std::upper_bound(variances.begin(), variances.end(), 0.0));
      const size_t kept = variances.size() - seen / 1000;
      for (size_t i = 0; i < kept; ++i) result[lane] += variances[i] / static_cast<double>(kept);
      result[lane] *= share;
    }
    return result;
  }

  // Where samples have times: the variance of one sample per pixel, and the share of it that any
  // number of samples at the same times leave. Few samples and fewer have the same of it.
  std::pair<Lanes, Lanes> film_variance_of_times(size_t slot, double share) const {
    const Lanes more = film_variance(slot, 1), fewer = film_variance(slot, 1, true);
    Lanes variance, kept;
    for (int lane = 0; lane < terms_.lanes(); ++lane) {
      // Some at least: there are few times, and variances of both are noisy. Not tuned.
      const double drawn = std::clamp((fewer[lane] - more[lane]) / (1 / PilotEstimator::kFewer - 1),
                                      0.05 * more[lane], more[lane]);
      const double of_time = more[lane] - drawn;
      variance[lane] = of_time + share * drawn;
      kept[lane] = variance[lane] > 0 ? of_time / variance[lane] : 0;
    }
    return {variance, kept};
  }

  // How the variance of terms of the film alone falls with their samples, where samples have no
  // times: see DrawShares.
  Lanes film_power(size_t slot) const {
    const Lanes more = film_variance(slot, 1), fewer = film_variance(slot, 1, true);
    Lanes power;
    for (int lane = 0; lane < terms_.lanes(); ++lane) {
      const double gain = more[lane] > 0 ? fewer[lane] / more[lane] : 1;
      power[lane] =
          gain > 1 ? std::clamp(-std::log(gain) / std::log(PilotEstimator::kFewer), 1.0, 2.0) : 1;
    }
    return power;
  }

 private:
  const TermEstimator& terms_;
  PilotEstimator& pilot_;
  std::vector<std::unique_ptr<SampleEstimator>> estimators_;
  std::vector<TermCost> costs_;
  double set_up_ = 0;             // seconds
  std::vector<Moments> film_[2];  // of the film's usual samples, and of fewer
};

}  // namespace

std::vector<double> PilotFigures::variances(size_t slot, int lane) const {
  return both_halves(slot, [&](const Covariances& c) { return c.variance(lane); });
}
std::vector<double> PilotFigures::squared_means(size_t slot, int lane) const {
  return both_halves(slot, [&](const Covariances& c) { return c.squared_mean(lane); });
}

template <class Function>
std::vector<double> PilotFigures::both_halves(size_t slot, const Function& of) const {
  std::vector<double> result;
  for (size_t cell = 0; cell < grid.size(); ++cell)
    result.push_back(0.5 * (of(halves[0][slot][cell]) + of(halves[1][slot][cell])));
  return result;
}

// Covariances by their degrees of freedom.
void PilotFigures::merge(const PilotFigures& more) {
  const int sum = spp + more.spp;
  const auto share = static_cast<double>(more.spp) / sum;
  const auto of_cells = static_cast<float>(more.spp - 2) / static_cast<float>(sum - 4);
  for (int half = 0; half < 2; ++half) {
    for (size_t slot = 0; slot < halves[half].size(); ++slot) {
      CellCovariances& to = halves[half][slot];
      for (size_t cell = 0; !to.empty() && cell < grid.size(); ++cell) {
        const float* from = more.halves[half][slot].entries(cell);
        float* entries = to.entries(cell);
        for (size_t i = 0; i < to.size(); ++i) entries[i] += of_cells * (from[i] - entries[i]);
      }
    }
  }
  const auto mix = [&](double& a, double b) { a += share * (b - a); };
  for (size_t slot = 0; slot < work.size(); ++slot) {
    mix(work[slot], more.work[slot]);
    mix(first_work[slot], more.first_work[slot]);
    for (int k = 0; k < kLanes; ++k) {
      mix(film_variance[slot][k], more.film_variance[slot][k]);
      mix(film_power[slot][k], more.film_power[slot][k]);
      mix(film_kept[slot][k], more.film_kept[slot][k]);
    }
  }
  mix(seconds_of_work, more.seconds_of_work);
  for (size_t slot = 0; slot < pairs.size(); ++slot) pairs[slot].merge(more.pairs[slot]);
  traced.add(more.traced);
  spp = sum;
}

double seconds_of_pixel(const TermEstimator& estimator, bool turns, const RunSettings& settings,
                        const Stopwatch& watch) {
  constexpr size_t kPixels = 256;      // not tuned
  constexpr int kSample = 0x10000000;  // no other pilot takes it
  auto owned = std::make_unique<PilotEstimator>(estimator, turns, kPixels);
  const auto pixels = static_cast<double>(owned->grid().size());
  PilotRun run(estimator, std::move(owned));
  const double began = watch.seconds();
  run.run(settings, kSample, kSample + 1, watch);
  return (watch.seconds() - began) / pixels;
}

PilotFigures run_pilot(const TermEstimator& estimator, bool turns, PilotSamples samples,
                       const RunSettings& settings, const Stopwatch& watch, const TermsAt& at) {
  PilotFigures figures;
  auto owned = std::make_unique<PilotEstimator>(estimator, turns, samples.pixels);
  PilotEstimator& pilot = *owned;
  PilotRun run(estimator, std::move(owned));
  const double began = watch.seconds();
  const int first = samples.first;
  if (!run.run(settings, first, first + 1, watch, at)) return figures;
  int spp = samples.count();
  if (settings.seconds > 0) {
    const double now = watch.seconds();
    spp =
        pilot_samples_in_time(samples.last, now - began, settings.seconds, settings.seconds - now) -
        first;
    if (spp < 4) return figures;
  }
  const int half = spp / 2;
  if (half > 1 && !run.run(settings, first + 1, first + half, watch, at)) return figures;
  figures.halves[0] = pilot.take_covariances(half);
  if (!run.run(settings, first + half, first + spp, watch, at)) return figures;
  figures.halves[1] = pilot.take_covariances(half);
  figures.spp = spp;
  figures.grid = pilot.grid();
  figures.pixel_slot = estimator.pixel_slot();
  const double share = pilot.share();
  figures.traced = pilot.traced();
  figures.pairs = pilot.pairs();
  run.add_work(spp, watch.seconds() - began, figures);
  for (size_t slot = 0; slot < estimator.slots(); ++slot) {
    const bool on_film = estimator.film_samples(slot) > 0;
    figures.film_variance.push_back(on_film ? run.film_variance(slot, share) : Lanes{});
    figures.film_kept.emplace_back();
    figures.film_power.push_back(run.film_power(slot));
    if (!at) continue;  // a term may use the film at some times alone
    const auto [variance, kept] = run.film_variance_of_times(slot, share);
    figures.film_variance.back() = variance;
    figures.film_kept.back() = kept;
    figures.film_power.back() = {1, 1, 1, 1};
  }
  return figures;
}

}  // namespace limn
