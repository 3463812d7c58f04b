#pragma once
// Decompression of zlib streams.
#include <memory>
#include <string_view>

namespace limn {

// Reads a zlib stream piece by piece.
class Inflater {
 public:
  // compressed: begins with the stream, may go on behind its end, and must outlive this object.
  explicit Inflater(std::string_view compressed);
  ~Inflater();
  Inflater(const Inflater&) = delete;
  Inflater& operator=(const Inflater&) = delete;

  // Writes the next `size` bytes to `out`. False if the stream is damaged or ends before.
  bool read(void* out, size_t size);

 private:
  struct Stream;
  std::unique_ptr<Stream> stream_;
};

// The most bytes that a zlib stream of one byte can hold, by the format.
inline constexpr double kLargestInflation = 1032;

}  // namespace limn
