#pragma once
// A run in parts, which any machines make, and whose sums are joined into the bits of one run.
//
// A run adds up its batches of samples in their order. A part makes some of the batches and keeps
// what each one came to; joining is the run again, with these sums read in place of made. What a
// run chooses before its first batch (a pilot's counts, a step) every part and the joining run
// choose again, by the same random numbers.
//
// A part is kept as a sequence of NumPy arrays, as numpy.save appends them to one file: a text
// (uint8) that says what it is a part of, then two arrays for each batch, its counts (int64, the
// first two being its samples [first, last), the third the CRC-32 of all other counts, then all
// sums) and its sums (float64), then an empty array of int64. The last line of the text is the
// CRC-32 of the others. So a flipped bit anywhere is an error.
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "limn/core/scene.h"

namespace limn {

struct Parameter;

// Part `index` of parts 1 to `count`: the batches whose first sample is in the index-th share of
// all samples.
struct Part {
  int index = 1, count = 1;
};
// "2/3". InputError.
Part parse_part(const std::string& text);

// What one batch came to.
struct BatchRecord {
  int64_t first = 0, last = 0;  // samples [first, last) of every pixel
  std::vector<int64_t> counts;
  std::vector<double> sums;
};

// Who makes the batches of a run; RunSettings::store. One store serves one run.
class BatchStore {
 public:
  virtual ~BatchStore() = default;

  // Before the first batch: what must be alike in all parts of the run.
  void identify(const std::string& name, const std::string& value);
  // After that: a run of spp samples per pixel begins.
  virtual void start(int spp) = 0;

  enum class Task { kMake, kRead, kLeave };
  // Of the batch that begins with sample `first`.
  virtual Task task(int64_t first) const = 0;
  virtual BatchRecord read(int64_t first) = 0;
  virtual void write(const BatchRecord& batch) = 0;

 protected:
  using Identity = std::vector<std::pair<std::string, std::string>>;
  const Identity& identity() const { return identity_; }

 private:
  Identity identity_;
};

// A file with (or the bytes of) one part, finished or not.
class PartFile;

// Makes a part. Batches that the file holds already, of the same part of the same run, are not made
// again; so an interrupted part goes on where it stopped, and a damaged one before the damage.
// InputError if the file cannot be written, or holds another part or one of another run.
class PartWriter final : public BatchStore {
 public:
  // arguments: the command's, one line, for who joins the parts. file "": in memory.
  PartWriter(Part part, std::string arguments, std::string file);
  PartWriter(const PartWriter&) = delete;
  PartWriter& operator=(const PartWriter&) = delete;
  ~PartWriter() override;

  void start(int spp) override;
  Task task(int64_t first) const override;
  BatchRecord read(int64_t first) override;
  void write(const BatchRecord& batch) override;
  // To be called when the run has made all its batches: without it the part is not complete.
  void finish();

  // Samples per pixel of this part that are done.
  int64_t samples() const { return samples_; }
  // Samples per pixel that the whole run plans, all parts together; 0 before it begins.
  int spp() const { return spp_; }
  // Of a part in memory.
  std::string bytes() const;

 private:
  void check_before() const;
  void append(const std::string& bytes);

  Part part_;
  std::string arguments_, file_;
  int spp_ = 0;
  int64_t samples_ = 0;
  std::unique_ptr<PartFile> before_;  // what the file held already
  std::unique_ptr<std::iostream> out_;
};

// All parts of a run. InputError that says which part is missing, there twice, not complete,
// damaged, or of another run, and how that differs.
class PartReader final : public BatchStore {
 public:
  explicit PartReader(const std::vector<std::string>& files);
  // The bytes of parts in memory, in any order.
  static std::unique_ptr<PartReader> of_bytes(const std::vector<std::string>& parts);
  PartReader(const PartReader&) = delete;
  PartReader& operator=(const PartReader&) = delete;
  ~PartReader() override;

  // The command's, one line.
  const std::string& arguments() const;

  void start(int spp) override;
  Task task(int64_t) const override { return Task::kRead; }
  BatchRecord read(int64_t first) override;
  void write(const BatchRecord&) override {}

 private:
  explicit PartReader(std::vector<std::unique_ptr<PartFile>> files);
  void check_parts() const;

  std::vector<std::unique_ptr<PartFile>> files_;
};

// A number that differs (but for chance, 2^-64) between scenes that differ: their shapes,
// materials, lights, camera, film; of an environment's texels what 4096 directions see. Sixteen hex
// digits.
std::string fingerprint(const Scene& scene);
// The same of how parameters move vertices, which names do not tell of fields; arrays count for
// nothing.
std::string fingerprint(const Scene& scene, const std::vector<Parameter>& parameters);
// The same of numbers, bit by bit.
std::string fingerprint(const std::vector<double>& numbers);

}  // namespace limn
