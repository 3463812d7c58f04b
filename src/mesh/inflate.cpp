// Decompression; the only file that includes zlib.
#include "src/mesh/mesh_file.h"

#include <zlib.h>

#include <algorithm>
#include <limits>
#include <new>

namespace limn {

struct Inflater::Stream {
  std::string_view left;  // not yet given to zlib
  z_stream z{};
};

Inflater::Inflater(std::string_view compressed) : stream_(std::make_unique<Stream>()) {
  stream_->left = compressed;
  if (inflateInit(&stream_->z) != Z_OK) throw std::bad_alloc();
}

Inflater::~Inflater() { inflateEnd(&stream_->z); }

bool Inflater::read(void* out, size_t size) {
  constexpr size_t kMost = std::numeric_limits<uInt>::max();
  z_stream& z = stream_->z;
  auto* next = static_cast<Bytef*>(out);
  while (size > 0) {
    if (z.avail_in == 0) {
      const size_t some = std::min(stream_->left.size(), kMost);
      // zlib does not write to its input.
      z.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(stream_->left.data()));
      z.avail_in = static_cast<uInt>(some);
      stream_->left.remove_prefix(some);
    }
    const auto wanted = static_cast<uInt>(std::min(size, kMost));
    z.next_out = next;
    z.avail_out = wanted;
    const int status = inflate(&z, Z_NO_FLUSH);
    const uInt written = wanted - z.avail_out;
    next += written;
    size -= written;
    if (size > 0 && (status != Z_OK || written == 0)) return false;
  }
  return true;
}

}  // namespace limn
