// Parts of runs as files of NumPy arrays.
#include "limn/integrators/parts.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>

#include "integrators/estimates/checksum.h"
#include "limn/core/check.h"
#include "limn/core/error.h"

namespace limn {

namespace {

static_assert(std::endian::native == std::endian::little);

constexpr const char* kTitle = "limn part 5";    // counts changes of what files hold
constexpr const char* kMagic = "\x93NUMPY\x01";  // and the byte 0 that ends it

constexpr size_t kBefore = 10;  // bytes of an array before its header: magic, version, length
constexpr const char* kSum = "checksum: ";

// What describes a vector in NumPy's format, version 1.0. type: as NumPy writes it, "<f8".
std::string npy_header(const std::string& type, size_t count) {
  std::string header =
      fmt::format("{{'descr': '{}', 'fortran_order': False, 'shape': ({},), }}", type, count);
  header.append(63 - (kBefore + header.size()) % 64, ' ');
  return header + '\n';
}

template <class T>
std::string_view bytes_of(const T* values, size_t count) {
  return {reinterpret_cast<const char*>(values), count * sizeof(T)};
}

template <class T>
std::string npy(const std::string& type, const T* values, size_t count) {
  const std::string header = npy_header(type, count);
  std::string bytes(kMagic, 8);
  bytes += static_cast<char>(header.size() % 256);
  bytes += static_cast<char>(header.size() / 256);
  bytes += header;
  return bytes.append(bytes_of(values, count));
}

// The numbers of a batch as files hold them, but for their checksum, the third count.
constexpr size_t kBeforeCounts = 3;
int64_t checksum_of(const std::vector<int64_t>& counts, const std::vector<double>& sums) {
  std::string bytes(bytes_of(counts.data(), 2));
  bytes += bytes_of(counts.data() + kBeforeCounts, counts.size() - kBeforeCounts);
  return checksum(bytes.append(bytes_of(sums.data(), sums.size())));
}

std::string text_of(Part part) { return fmt::format("{}/{}", part.index, part.count); }

std::string one_line(std::string text) {
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text;
}

using Identity = std::vector<std::pair<std::string, std::string>>;

// The first row in which two runs differ; null where there is none.
struct Difference {
  std::string name, here, there;
};
std::unique_ptr<Difference> difference(const Identity& here, const Identity& there) {
  for (size_t i = 0; i < std::max(here.size(), there.size()); ++i) {
    const auto row = [i](const Identity& run) {
      return i < run.size() ? run[i] : std::pair<std::string, std::string>{"", "nothing"};
    };
    const auto a = row(here), b = row(there);
    if (a == b) continue;
    return std::make_unique<Difference>(
        Difference{a.first.empty() ? b.first : a.first, a.second, b.second});
  }
  return nullptr;
}

std::unique_ptr<PartFile> open_part(const std::string& file, bool damaged = false) {
  auto stream = std::make_unique<std::ifstream>(file, std::ios::binary);
  if (!*stream) throw InputError({file}, "cannot be read");
  return std::make_unique<PartFile>(std::move(stream), file, damaged);
}

}  // namespace

Part parse_part(const std::string& text) {
  Part part{0, 0};
  const char* end = text.data() + text.size();
  auto [slash, bad] = std::from_chars(text.data(), end, part.index);
  if (bad == std::errc() && slash != end && *slash == '/') {
    const auto [last, wrong] = std::from_chars(slash + 1, end, part.count);
    if (wrong == std::errc() && last == end && part.index >= 1 && part.index <= part.count) {
      return part;
    }
  }
  throw InputError("part \"" + text + "\": expected K/N, part K of parts 1 to N, as in 2/3");
}

void BatchStore::identify(const std::string& name, const std::string& value) {
  identity_.emplace_back(name, one_line(value));
}

// Where the batches of a part are.
class PartFile {
 public:
  // damaged: what is no batch ends the whole ones, and is no error.
  PartFile(std::unique_ptr<std::istream> stream, std::string name, bool damaged = false)
      : stream_(std::move(stream)), name_(std::move(name)) {
    stream_->seekg(0, std::ios::end);
    size_ = stream_->tellg();
    stream_->seekg(0);
    read_text();
    try {
      while (find_batch()) {
      }
    } catch (const InputError&) {
      if (!damaged) throw;
    }
  }

  const std::string& name() const { return name_; }
  const Part& part() const { return part_; }
  const std::string& arguments() const { return arguments_; }
  bool complete() const { return complete_; }
  // Where the last whole batch ends.
  int64_t end() const { return end_; }
  bool has(int64_t first) const { return batches_.contains(first); }
  const std::vector<std::pair<std::string, std::string>>& identity() const { return identity_; }

  BatchRecord read(int64_t first) {
    stream_->clear();
    stream_->seekg(batches_.at(first));
    const std::vector<int64_t> counts = array<int64_t>("<i8");
    BatchRecord batch{counts[0], counts[1], {counts.begin() + kBeforeCounts, counts.end()}, {}};
    batch.sums = array<double>("<f8");
    if (!*stream_ || checksum_of(counts, batch.sums) != counts[2]) fail();
    return batch;
  }

 private:
  // Numbers of the array that begins here, whose places come next; -1 where the file ends sooner.
  int64_t header(const std::string& type, size_t bytes);
  template <class T>
  std::optional<std::vector<T>> array_if_whole(const std::string& type) {
    const int64_t count = header(type, sizeof(T));
    if (count < 0) return std::nullopt;
    std::vector<T> values(static_cast<size_t>(count));
    stream_->read(reinterpret_cast<char*>(values.data()),
                  static_cast<std::streamsize>(values.size() * sizeof(T)));
    return values;
  }
  template <class T>
  std::vector<T> array(const std::string& type) {
    auto values = array_if_whole<T>(type);
    if (!values) fail();
    return std::move(*values);
  }
  void read_text();
  bool find_batch();
  [[noreturn]] void fail() const {
    if (end_ == 0) throw InputError({name_}, "is no part of a run");
    throw InputError({name_}, fmt::format("is damaged after {} whole batches: make part {} again; "
                                          "with the same -o it goes on from there",
                                          batches_.size(), text_of(part_)));
  }

  std::unique_ptr<std::istream> stream_;
  std::string name_, arguments_;
  Part part_;
  std::vector<std::pair<std::string, std::string>> identity_;
  std::map<int64_t, int64_t> batches_;  // by their first sample: where they begin
  int64_t size_ = 0, end_ = 0;          // of the file, of its last whole batch
  bool complete_ = false;
};

int64_t PartFile::header(const std::string& type, size_t bytes) {
  char before[10];
  if (!stream_->read(before, sizeof(before))) return -1;
  if (std::memcmp(before, kMagic, 8) != 0) fail();
  const size_t size = static_cast<unsigned char>(before[8]) +
                      256 * static_cast<size_t>(static_cast<unsigned char>(before[9]));
  std::string text(size, ' ');
  if (!stream_->read(text.data(), static_cast<std::streamsize>(size))) return -1;
  const size_t digits = text.find('(');
  int64_t count = 0;
  if (digits == std::string::npos) fail();
  std::from_chars(text.data() + digits + 1, text.data() + size, count);
  if (count < 0 || text != npy_header(type, static_cast<size_t>(count))) fail();
  const int64_t left = size_ - static_cast<int64_t>(stream_->tellg());
  return count <= left / static_cast<int64_t>(bytes) ? count : -1;
}

void PartFile::read_text() {
  const std::vector<char> bytes = array<char>("|u1");
  if (!*stream_) fail();
  const std::string text(bytes.begin(), bytes.end());
  std::istringstream lines(text);
  std::string line;
  if (!std::getline(lines, line)) fail();
  if (line.starts_with("limn part ") && line != kTitle) {
    throw InputError({name_}, "was written by another version of limn: make the part again");
  }
  if (line != kTitle) fail();
  const size_t sum_begin = text.rfind(kSum);
  if (sum_begin == std::string::npos ||
      text.substr(sum_begin) !=
          fmt::format("{}{:08x}\n", kSum, checksum(text.substr(0, sum_begin)))) {
    throw InputError({name_}, "is damaged at its beginning: make this part again");
  }
  while (std::getline(lines, line) && !line.starts_with(kSum)) {
    const size_t colon = line.find(": ");
    if (colon == std::string::npos) fail();
    const std::string name = line.substr(0, colon), value = line.substr(colon + 2);
    if (name == "arguments") {
      arguments_ = value;
    } else if (name == "part") {
      part_ = parse_part(value);
    } else {
      identity_.emplace_back(name, value);
    }
  }
  end_ = stream_->tellg();
}

bool PartFile::find_batch() {
  stream_->seekg(end_);
  const auto counts = array_if_whole<int64_t>("<i8");
  if (!counts) return false;
  if (counts->empty()) {
    complete_ = stream_->tellg() == size_;
    if (!complete_) fail();
    return false;
  }
  if (counts->size() < kBeforeCounts) fail();
  const auto sums = array_if_whole<double>("<f8");
  if (!sums) return false;
  if (checksum_of(*counts, *sums) != (*counts)[2]) fail();
  batches_[counts->front()] = end_;
  end_ = stream_->tellg();
  return true;
}

PartWriter::PartWriter(Part part, std::string arguments, std::string file)
    : part_(part), arguments_(one_line(std::move(arguments))), file_(std::move(file)) {}
PartWriter::~PartWriter() = default;

void PartWriter::start(int spp) {
  spp_ = spp;
  std::string text =
      fmt::format("{}\narguments: {}\npart: {}\n", kTitle, arguments_, text_of(part_));
  for (const auto& [name, value] : identity()) text += name + ": " + value + "\n";
  text += fmt::format("{}{:08x}\n", kSum, checksum(text));
  if (!file_.empty() && std::filesystem::exists(file_) && std::filesystem::file_size(file_) > 0) {
    try {
      before_ = open_part(file_, true);
    } catch (const InputError&) {  // another file of this name, to be written over
    }
  }
  if (before_) check_before();
  if (file_.empty()) {
    out_ = std::make_unique<std::stringstream>();
  } else if (before_) {
    std::filesystem::resize_file(file_, before_->end());
    out_ = std::make_unique<std::fstream>(file_, std::ios::binary | std::ios::app | std::ios::out);
  } else {
    out_ =
        std::make_unique<std::fstream>(file_, std::ios::binary | std::ios::trunc | std::ios::out);
  }
  if (!before_) append(npy("|u1", text.data(), text.size()));
}

void PartWriter::check_before() const {
  const std::string held = text_of(before_->part()), asked = text_of(part_);
  if (held != asked) {
    throw InputError({file_}, fmt::format("holds part {}, and part {} is asked for: choose another "
                                          "-o, or remove it",
                                          held, asked));
  }
  if (const auto d = difference(identity(), before_->identity())) {
    throw InputError({file_}, fmt::format("holds a part of another run: {} was {}, but now is {}; "
                                          "choose another -o, or remove it",
                                          d->name, d->there, d->here));
  }
}

BatchStore::Task PartWriter::task(int64_t first) const {
  if (first * part_.count / spp_ != part_.index - 1) return Task::kLeave;
  return before_ && before_->has(first) ? Task::kRead : Task::kMake;
}

BatchRecord PartWriter::read(int64_t first) {
  BatchRecord batch = before_->read(first);
  samples_ += batch.last - batch.first;
  return batch;
}

void PartWriter::write(const BatchRecord& batch) {
  std::vector<int64_t> counts{batch.first, batch.last, 0};
  counts.insert(counts.end(), batch.counts.begin(), batch.counts.end());
  counts[2] = checksum_of(counts, batch.sums);
  append(npy("<i8", counts.data(), counts.size()) +
         npy("<f8", batch.sums.data(), batch.sums.size()));
  samples_ += batch.last - batch.first;
}

void PartWriter::finish() { append(npy("<i8", static_cast<const int64_t*>(nullptr), 0)); }

void PartWriter::append(const std::string& bytes) {
  out_->write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  out_->flush();  // a full disk shows here, and an end by force loses one batch
  if (!*out_) throw InputError({file_}, "cannot be written");
}

std::string PartWriter::bytes() const { return static_cast<std::stringstream&>(*out_).str(); }

PartReader::PartReader(const std::vector<std::string>& files) {
  for (const std::string& file : files) files_.push_back(open_part(file));
  check_parts();
}

PartReader::PartReader(std::vector<std::unique_ptr<PartFile>> files) : files_(std::move(files)) {
  check_parts();
}

std::unique_ptr<PartReader> PartReader::of_bytes(const std::vector<std::string>& parts) {
  std::vector<std::unique_ptr<PartFile>> files;
  for (size_t i = 0; i < parts.size(); ++i) {
    files.push_back(
        std::make_unique<PartFile>(std::make_unique<std::istringstream>(parts[i], std::ios::binary),
                                   fmt::format("parts[{}]", i)));
  }
  return std::unique_ptr<PartReader>(new PartReader(std::move(files)));
}

PartReader::~PartReader() = default;

const std::string& PartReader::arguments() const { return files_.front()->arguments(); }

void PartReader::check_parts() const {
  if (files_.empty()) throw InputError("merge: no parts are given");
  const PartFile& first = *files_.front();
  std::vector<const PartFile*> found(first.part().count);
  for (const auto& file : files_) {
    if (const auto d = difference(first.identity(), file->identity())) {
      throw InputError({file->name()},
                       fmt::format("is a part of another run than {}: {} is {}, there {}",
                                   first.name(), d->name, d->there, d->here));
    }
    if (file->part().count != first.part().count) {
      throw InputError({file->name()},
                       fmt::format("is part {}, but {} is part {}: parts of one split are needed",
                                   text_of(file->part()), first.name(), text_of(first.part())));
    }
    const PartFile*& same = found[file->part().index - 1];
    if (same) {
      throw InputError({file->name()}, fmt::format("is part {}, as {} is: each is needed once",
                                                   text_of(file->part()), same->name()));
    }
    same = file.get();
    if (!file->complete()) {
      throw InputError({file->name()},
                       fmt::format("is not complete: make part {} again, and it goes on from there",
                                   text_of(file->part())));
    }
  }
  for (size_t k = 0; k < found.size(); ++k) {
    if (found[k]) continue;
    throw InputError(fmt::format("merge: part {} is missing; {} of {} are given",
                                 text_of({static_cast<int>(k + 1), first.part().count}),
                                 files_.size(), first.part().count));
  }
}

void PartReader::start(int) {
  const PartFile& first = *files_.front();
  if (const auto d = difference(identity(), first.identity())) {
    throw InputError({first.name()}, fmt::format("cannot be joined here: {} was {}, but now is {}",
                                                 d->name, d->there, d->here));
  }
}

BatchRecord PartReader::read(int64_t first) {
  for (const auto& file : files_) {
    if (file->has(first)) return file->read(first);
  }
  throw InputError({files_.front()->name()},
                   fmt::format("no part holds the batch that begins with sample {}", first));
}

}  // namespace limn
