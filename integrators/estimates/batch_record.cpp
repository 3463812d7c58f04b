// Sums of batches, number by number.
#include "integrators/estimates/batch_record.h"

#include <algorithm>
#include <bit>

#include "integrators/estimates/gradient_estimator.h"
#include "limn/core/error.h"

namespace limn {

namespace {

[[noreturn]] void fail() {
  throw InputError("a part of the run holds other numbers than it needs");
}

constexpr size_t kBits = 64;  // of a word of the mask

}  // namespace

void RecordWriter::add(const std::string& text) {
  add(static_cast<int64_t>(text.size()));
  for (const char c : text) add(int64_t{c});
}

void RecordWriter::add(const std::vector<double>& numbers) {
  add(static_cast<int64_t>(numbers.size()));
  for (size_t first = 0; first < numbers.size(); first += kBits) {
    uint64_t mask = 0;
    for (size_t i = first; i < std::min(numbers.size(), first + kBits); ++i) {
      if (std::bit_cast<uint64_t>(numbers[i]) == 0) continue;
      mask |= uint64_t{1} << (i - first);
      add(numbers[i]);
    }
    add(std::bit_cast<int64_t>(mask));
  }
}

void RecordWriter::add(const TermCost& cost) {
  // All of its members: another one does not compile here until it is kept.
  const auto& [seconds, rays, shadow_rays, samples, no_edge, zero_weight, left_out, occluded,
               counted, warped, dominated, dropped, largest] = cost;
  for (const uint64_t count : {rays, shadow_rays, samples, no_edge, zero_weight, left_out, occluded,
                               counted, warped, dominated, dropped}) {
    add(static_cast<int64_t>(count));
  }
  add(int64_t{largest.place.x});
  add(int64_t{largest.place.y});
  add(largest.place.sample);
  add(largest.place.term);
  add(seconds);
  add(largest.square);
  add(largest.squares);
}

void RecordWriter::add(const NonFinite& bad) {
  add(static_cast<int64_t>(bad.count));
  add(static_cast<int64_t>(bad.first.size()));
  for (const NonFinite::SampleId& place : bad.first) {
    add(int64_t{place.x});
    add(int64_t{place.y});
    add(place.sample);
    add(place.term);
  }
}

int64_t RecordReader::count() {
  if (counts_ == record_.counts.size()) fail();
  return record_.counts[counts_++];
}

double RecordReader::number() {
  if (sums_ == record_.sums.size()) fail();
  return record_.sums[sums_++];
}

std::string RecordReader::text() {
  std::string text;
  for (int64_t left = count(); left > 0; --left) text += static_cast<char>(count());
  return text;
}

std::vector<double> RecordReader::numbers(size_t size) {
  if (count() != static_cast<int64_t>(size)) fail();
  std::vector<double> numbers(size);
  for (size_t first = 0; first < numbers.size(); first += kBits) {
    const auto mask = std::bit_cast<uint64_t>(count());
    for (size_t i = first; i < std::min(numbers.size(), first + kBits); ++i) {
      if (mask >> (i - first) & 1) numbers[i] = number();
    }
  }
  return numbers;
}

TermCost RecordReader::cost() {
  TermCost cost;
  for (uint64_t* to : {&cost.rays, &cost.shadow_rays, &cost.samples, &cost.no_edge,
                       &cost.zero_weight, &cost.left_out, &cost.occluded, &cost.counted,
                       &cost.warped, &cost.dominated, &cost.dropped}) {
    *to = static_cast<uint64_t>(count());
  }
  LargestSample& largest = cost.largest;
  largest.place.x = static_cast<int>(count());
  largest.place.y = static_cast<int>(count());
  largest.place.sample = count();
  largest.place.term = text();
  cost.seconds = number();
  largest.square = number();
  largest.squares = number();
  return cost;
}

NonFinite RecordReader::non_finite() {
  NonFinite bad;
  bad.count = static_cast<uint64_t>(count());
  for (int64_t left = count(); left > 0; --left) {
    NonFinite::SampleId& place = bad.first.emplace_back();
    place.x = static_cast<int>(count());
    place.y = static_cast<int>(count());
    place.sample = count();
    place.term = text();
  }
  return bad;
}

void RecordReader::end() const {
  if (counts_ != record_.counts.size() || sums_ != record_.sums.size()) fail();
}

BatchRecord to_record(const Batch& batch, const std::vector<BatchSums>& sums) {
  BatchRecord record{batch.first, batch.last, {}, {}};
  RecordWriter to(record);
  for (const BatchSums& pass : sums) {
    to.add(pass.radiance);
    for (const auto& image : pass.images) to.add(image);
    for (const TermCost& cost : pass.costs) to.add(cost);
    to.add(pass.non_finite);
  }
  return record;
}

std::vector<BatchSums> to_sums(const BatchRecord& record, Estimators estimators) {
  RecordReader from(record);
  std::vector<BatchSums> sums;
  for (const auto& estimator : estimators) {
    const auto* gradient = dynamic_cast<const GradientEstimator*>(estimator.get());
    const size_t film = film_size(estimator->scene().film);
    std::vector<size_t> sizes(estimator->slots() * estimator->lanes(), film);
    if (gradient) {
      sizes = gradient->sizes();
      sizes.push_back(GradientEstimator::kCounts);
    }
    BatchSums& pass = sums.emplace_back();
    pass.radiance = from.numbers(gradient ? 0 : film);
    for (const size_t size : sizes) pass.images.push_back(from.numbers(size));
    for (size_t slot = 0; slot < estimator->slots(); ++slot) pass.costs.push_back(from.cost());
    pass.non_finite = from.non_finite();
  }
  from.end();
  return sums;
}

}  // namespace limn
