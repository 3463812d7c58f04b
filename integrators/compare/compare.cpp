// Methods in turn at equal time, and what their runs add up to.
#include "limn/integrators/compare.h"
#include "limn/core/memory.h"

#include <fmt/format.h>

#include <algorithm>

#include "limn/core/rng.h"

namespace limn {
namespace {

constexpr int kUnlimited = 1 << 30;  // samples per pixel

bool stopped(const RunSettings& settings) {
  return settings.interrupted && settings.interrupted->load();
}

// One run after another, with the progress of all of them.
class Runner {
 public:
  Runner(const CompareOptions& options, const Reference& reference, size_t methods,
         const RunSettings& settings)
      : options_(options), reference_(reference), settings_(settings) {
    for (const double time : options.times) total_ += time * options.repeats * methods;
  }

  // Adds a run to `to`. False if it did not come to its end.
  bool run(TimedMethod& method, size_t budget, int repeat, ComparedMethod& to) {
    const double time = options_.times[budget];
    const double before = done_;
    done_ += time;
    RunSettings settings = settings_;
    settings.spp = kUnlimited;
    settings.seconds = time;
    settings.seed =
        derived_seed(settings_.seed, fmt::format("{} {} {}", method.name(), budget, repeat));
    if (settings_.progress) {
      settings.progress = [&](double done) { settings_.progress((before + done * time) / total_); };
    }
    reset_peak_memory();
    MethodRun result = method.run(settings);
    if (stopped(settings_) || result.spp == 0) return false;
    if (result.peak_memory_bytes == 0) result.peak_memory_bytes = peak_memory_bytes();
    add(method, {budget, repeat, settings.seed, std::move(result), {}}, to);
    report();
    return true;
  }

  void skip(size_t budget) {
    done_ += options_.times[budget];
    report();
  }

 private:
  void report() {
    if (settings_.progress) settings_.progress(done_ / total_);
  }

  void add(const TimedMethod& method, ComparedRun run, ComparedMethod& to) {
    run.errors = image_errors(run.run.image, reference_.image, reference_.variance);
    if (run.repeat == 0) {
      to.image = std::move(run.run.image);
      to.settings = method.settings();
    }
    run.run.image = {};
    for (const std::string& warning : run.run.warnings) {
      if (std::ranges::find(to.warnings, warning) == to.warnings.end()) {
        to.warnings.push_back(warning);
      }
    }
    to.runs.push_back(std::move(run));
  }

  const CompareOptions& options_;
  const Reference& reference_;
  const RunSettings& settings_;
  double total_ = 0;
  double done_ = 0;
};

template <class Get>
std::vector<double> collect(const std::vector<const ComparedRun*>& runs, Get get) {
  std::vector<double> values;
  for (const ComparedRun* run : runs) values.push_back(static_cast<double>(get(*run)));
  return values;
}

std::vector<std::pair<std::string, double>> mean_term_seconds(
    const std::vector<const ComparedRun*>& runs) {
  auto means = runs[0]->run.term_seconds;
  for (auto& [name, seconds] : means) seconds = 0;
  for (const ComparedRun* run : runs) {
    for (size_t t = 0; t < means.size(); ++t) {
      means[t].second += run->run.term_seconds[t].second / static_cast<double>(runs.size());
    }
  }
  return means;
}

BudgetSummary summarize_runs(const std::vector<const ComparedRun*>& runs,
                             const Reference& reference) {
  BudgetSummary s;
  s.budget = runs[0]->budget;
  s.seconds = mean_of(collect(runs, [](const ComparedRun& r) { return r.run.seconds; }));
  s.setup_seconds =
      mean_of(collect(runs, [](const ComparedRun& r) { return r.run.setup_seconds; }));
  s.spp = mean_of(collect(runs, [](const ComparedRun& r) { return r.run.spp; }));
  s.rays = mean_of(collect(runs, [](const ComparedRun& r) { return r.run.rays; }));
  s.mse = mean_of_repeats(collect(runs, [](const ComparedRun& r) { return r.errors.mse; }));
  s.relative_mse =
      mean_of_repeats(collect(runs, [](const ComparedRun& r) { return r.errors.relative_mse; }));
  s.trimmed_mse =
      mean_of_repeats(collect(runs, [](const ComparedRun& r) { return r.errors.trimmed_mse; }));
  std::vector<BlockSums> repeats;
  for (const ComparedRun* run : runs) repeats.push_back(run->run.blocks);
  s.bias = summarize(bias_scores(repeats, reference.blocks, reference.edges));
  s.term_seconds = mean_term_seconds(runs);
  for (const ComparedRun* run : runs) {
    s.peak_memory_bytes = std::max(s.peak_memory_bytes, run->run.peak_memory_bytes);
  }
  return s;
}

std::vector<const ComparedRun*> runs_within(const ComparedMethod& method, size_t budget) {
  std::vector<const ComparedRun*> runs;
  for (const ComparedRun& run : method.runs) {
    if (run.budget == budget) runs.push_back(&run);
  }
  return runs;
}

void summarize_method(const CompareOptions& options, const Reference& reference,
                      ComparedMethod& method) {
  std::vector<TimedError> errors;
  for (size_t budget = 0; budget < options.times.size(); ++budget) {
    const auto runs = runs_within(method, budget);
    if (runs.empty()) continue;
    method.summary.push_back(summarize_runs(runs, reference));
    errors.push_back({method.summary.back().seconds, method.summary.back().mse});
  }
  method.slope = log_log_slope(errors);
}

std::vector<double> error_times_seconds(const ComparedMethod& method, size_t budget) {
  return collect(runs_within(method, budget),
                 [](const ComparedRun& r) { return r.errors.mse * r.run.seconds; });
}

void find_time_ratio(const ComparedMethod& first, size_t budgets, ComparedMethod& method) {
  for (size_t budget = budgets; budget-- > 0;) {
    const auto ours = error_times_seconds(method, budget);
    const auto theirs = error_times_seconds(first, budget);
    if (ours.empty() || theirs.empty()) continue;
    method.time_ratio = time_ratio(ours, theirs);
    if (method.time_ratio && &method == &first) method.time_ratio->error = 0;
    return;
  }
}

void set_status(const CompareOptions& options, ComparedMethod& method) {
  if (method.status == MethodStatus::kMissing) return;
  const size_t wanted = options.times.size() * static_cast<size_t>(options.repeats);
  if (method.runs.size() == wanted) {
    method.status = MethodStatus::kDone;
  } else if (method.message.empty()) {
    method.message = fmt::format("interrupted after {} of {} runs", method.runs.size(), wanted);
  }
}

}  // namespace

uint64_t derived_seed(uint64_t seed, const std::string& purpose) {
  uint64_t hash = mix_bits(seed);
  for (const char c : purpose) hash = mix_bits(hash + static_cast<unsigned char>(c) + 1);
  return hash >> 33;  // every program can read such a seed
}

NonFinite non_finite_of(const Reference& reference, const std::vector<ComparedMethod>& methods) {
  NonFinite all = reference.non_finite;
  for (const ComparedMethod& method : methods) {
    for (const ComparedRun& run : method.runs) all.merge(run.run.non_finite);
  }
  return all;
}

int block_size(const Film& film) {
  return std::max(1, (std::max(film.crop_width, film.crop_height) + 7) / 8);
}

std::vector<ComparedMethod> compare(const CompareOptions& options, const Reference& reference,
                                    const std::vector<std::unique_ptr<TimedMethod>>& methods,
                                    const RunSettings& settings) {
  std::vector<ComparedMethod> results(methods.size());
  for (size_t m = 0; m < methods.size(); ++m) {
    results[m].name = methods[m]->name();
    results[m].description = methods[m]->description();
  }
  Runner runner(options, reference, methods.size(), settings);
  // Runs one; false if everything must end.
  const auto run = [&](size_t m, size_t budget, int repeat) {
    if (results[m].status == MethodStatus::kMissing) {
      runner.skip(budget);
      return true;
    }
    try {
      return runner.run(*methods[m], budget, repeat, results[m]);
    } catch (const MethodMissing& missing) {
      results[m].status = MethodStatus::kMissing;
      results[m].message = missing.what();
      return true;
    }
  };
  const auto run_all = [&] {
    for (size_t budget = 0; budget < options.times.size(); ++budget) {
      for (int repeat = 0; repeat < options.repeats; ++repeat) {
        for (size_t m = 0; m < methods.size(); ++m) {
          if (stopped(settings) || !run(m, budget, repeat)) return;
        }
      }
    }
  };
  run_all();
  for (ComparedMethod& result : results) {
    summarize_method(options, reference, result);
    set_status(options, result);
  }
  for (ComparedMethod& result : results) {
    find_time_ratio(results[0], options.times.size(), result);
  }
  return results;
}

}  // namespace limn
