#pragma once
// What batches came to as plain numbers, for runs in parts.
#include <string>
#include <vector>

#include "integrators/estimates/batches.h"
#include "limn/integrators/parts.h"

namespace limn {

// Adds numbers to a record. Reading takes them out in the same order.
class RecordWriter {
 public:
  explicit RecordWriter(BatchRecord& record) : record_(record) {}
  void add(int64_t count) { record_.counts.push_back(count); }
  void add(double number) { record_.sums.push_back(number); }
  void add(const std::string& text);
  // Those that are not zero, and where they are.
  void add(const std::vector<double>& numbers);
  void add(const TermCost& cost);
  void add(const NonFinite& bad);

 private:
  BatchRecord& record_;
};

// InputError where a record holds other numbers than are asked for.
class RecordReader {
 public:
  explicit RecordReader(const BatchRecord& record) : record_(record) {}
  int64_t count();
  double number();
  std::string text();
  std::vector<double> numbers(size_t size);
  TermCost cost();
  NonFinite non_finite();
  void end() const;

 private:
  const BatchRecord& record_;
  size_t counts_ = 0, sums_ = 0;
};

BatchRecord to_record(const Batch& batch, const std::vector<BatchSums>& sums);
// estimators: those of the run. InputError if these are not theirs.
std::vector<BatchSums> to_sums(const BatchRecord& record, Estimators estimators);

}  // namespace limn
