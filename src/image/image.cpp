// Reading and writing of OpenEXR files; the only file that includes OpenEXR.
#include "limn/core/image.h"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <ImfOutputFile.h>
#include <ImfStdIO.h>
#include <ImfStringAttribute.h>
#include <ImfTestFile.h>
#include <openexr.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <stdexcept>

#include "limn/core/check.h"
#include "limn/core/error.h"
#include "limn/core/memory.h"
#include "limn/core/output_file.h"
#include "src/image/formats.h"

namespace limn {
namespace {

constexpr int kMaxTile = 8192;  // pixels on a side; not tuned

std::vector<const char*> channel_names(int channels) {
  if (channels == 3) return {"R", "G", "B"};
  CHECK_EQ(channels, 1);
  return {"Y"};
}

// Finite values beyond half's range become its largest value instead of infinity.
std::vector<half> to_half(const std::vector<float>& data) {
  constexpr float kLargest = HALF_MAX;
  std::vector<half> result;
  result.reserve(data.size());
  for (float v : data) {
    result.emplace_back(std::isfinite(v) ? std::clamp(v, -kLargest, kLargest) : v);
  }
  return result;
}

// Slices of interleaved channels; the top left pixel is at `origin` of the file's data window.
template <class T>
Imf::FrameBuffer interleaved(T* data, Imf::PixelType type, const std::vector<const char*>& names,
                             int width, const Imath::V2i& origin) {
  Imf::FrameBuffer buffer;
  const size_t pixel = names.size() * sizeof(T);
  const auto base =
      reinterpret_cast<intptr_t>(data) -
      (static_cast<intptr_t>(origin.y) * width + origin.x) * static_cast<intptr_t>(pixel);
  for (size_t c = 0; c < names.size(); ++c) {
    // NOLINTNEXTLINE(performance-no-int-to-ptr): OpenEXR needs the address of pixel (0, 0)
    auto* const first = reinterpret_cast<char*>(base + c * sizeof(T));
    buffer.insert(names[c], Imf::Slice(type, first, pixel, pixel * width));
  }
  return buffer;
}

Imf::Header plain_header(int width, int height, const std::vector<ImageAttribute>& attributes) {
  Imf::Header header(width, height);
  header.compression() = Imf::ZIP_COMPRESSION;
  for (const ImageAttribute& a : attributes) {
    header.insert(a.name, Imf::StringAttribute(a.value));
  }
  return header;
}

void write_pixels(const std::string& file, const Imf::Header& header,
                  const Imf::FrameBuffer& buffer, int height) {
  OutputFile output(file);
  // Writes to memory first: OpenEXR does not report a full disk when it closes a file.
  Imf::StdOSStream stream;
  try {
    Imf::OutputFile exr(stream, header);
    exr.setFrameBuffer(buffer);
    exr.writePixels(height);
  } catch (const std::exception& e) {
    throw InputError(SourceLocation{file}, std::string("cannot write: ") + e.what());
  }
  output.write(stream.str());
  output.commit();
}

void check_is_exr(const std::string& file) {
  errno = 0;
  std::ifstream stream(file, std::ios::binary);
  char first = 0;
  if (!stream.is_open()) {
    throw InputError(SourceLocation{file}, std::string("cannot read: ") + std::strerror(errno));
  }
  if (!stream.get(first)) throw InputError(SourceLocation{file}, "cannot read: the file is empty");
  if (!Imf::isOpenExrFile(file.c_str())) {
    throw InputError(SourceLocation{file}, "is not an OpenEXR image");
  }
}

// An open EXR file. OpenEXR's C reader validates sizes against the file and block sizes before use;
// its C++ reader does not.
class ExrFile {
 public:
  explicit ExrFile(const std::string& file) : file_(file) {
    check_is_exr(file);
    complaint_.clear();
    exr_context_initializer_t options = EXR_DEFAULT_CONTEXT_INITIALIZER;
    options.error_handler_fn = [](exr_const_context_t, exr_result_t, const char* message) {
      if (complaint_.empty()) complaint_ = message;
    };
    options.max_tile_width = options.max_tile_height = kMaxTile;
    options.flags = EXR_CONTEXT_FLAG_DISABLE_CHUNK_RECONSTRUCTION;
    const exr_result_t result = exr_start_read(&context_, file.c_str(), &options);
    // After a misplaced attribute the reader continues with undefined results.
    if (result == EXR_ERR_SUCCESS && complaint_.empty()) return;
    exr_finish(&context_);
    fail_damaged();
  }
  ~ExrFile() { exr_finish(&context_); }
  ExrFile(const ExrFile&) = delete;
  ExrFile& operator=(const ExrFile&) = delete;

  const std::string& file() const { return file_; }
  exr_const_context_t context() const { return context_; }
  [[noreturn]] void fail(const std::string& message) const { throw InputError({file_}, message); }
  [[noreturn]] void fail_damaged() const {
    fail("the EXR file is truncated or damaged" + (complaint_.empty() ? "" : ": " + complaint_));
  }
  void check(exr_result_t result) const {
    if (result != EXR_ERR_SUCCESS) fail_damaged();
  }

 private:
  static thread_local std::string complaint_;  // OpenEXR's first message since a file was opened
  std::string file_;
  exr_context_t context_ = nullptr;
};
thread_local std::string ExrFile::complaint_;

// Reads the first part of a file as an image.
class ExrReader {
 public:
  // alpha: channel A alone; has_pixels() says whether there is one.
  explicit ExrReader(const ExrFile& exr, bool alpha = false) : exr_(exr), alpha_(alpha) {
    exr.check(exr_get_storage(exr.context(), 0, &storage_));
    exr.check(exr_get_compression(exr.context(), 0, &compression_));
    exr.check(exr_get_data_window(exr.context(), 0, &window_));
    exr.check(exr_get_channels(exr.context(), 0, &channels_));
    if (storage_ != EXR_STORAGE_SCANLINE && storage_ != EXR_STORAGE_TILED) {
      exr.fail("deep images are not read");
    }
    names_ = channels_to_read();
    width_ = int64_t{window_.max.x} - window_.min.x + 1;
    height_ = int64_t{window_.max.y} - window_.min.y + 1;
    check_size();
  }

  bool has_pixels() const { return !names_.empty(); }

  Image read() {
    image_.width = static_cast<int>(width_);
    image_.height = static_cast<int>(height_);
    image_.channels = static_cast<int>(names_.size());
    image_.data.reserve(static_cast<size_t>(width_ * height_) * names_.size());
    // OpenEXR 3.1's C reader does not support DWA, and crashes on one of four channels of halves.
    if (alpha_ || compression_ == EXR_COMPRESSION_DWAA || compression_ == EXR_COMPRESSION_DWAB) {
      read_by_classes();
    } else {
      BlockDecoder decoder(exr_);
      for_each_block([&](const exr_chunk_info_t& block, int64_t x, int64_t y) {
        grow_to(y + block.height);
        decode(decoder, block, x, y);
      });
    }
    return std::move(image_);
  }

 private:
  std::vector<std::string> channels_to_read() const {
    const auto full = [&](const char* name) {
      return std::any_of(channels_->entries, channels_->entries + channels_->num_channels,
                         [&](const exr_attr_chlist_entry_t& c) {
                           return std::strcmp(c.name.str, name) == 0 && c.x_sampling == 1 &&
                                  c.y_sampling == 1;
                         });
    };
    std::string found;
    bool has_chroma = false;
    for (int i = 0; i < channels_->num_channels; ++i) {
      const std::string name = channels_->entries[i].name.str;
      found += (found.empty() ? "" : ", ") + name;
      has_chroma = has_chroma || name == "RY";
    }
    if (alpha_) return full("A") ? std::vector<std::string>{"A"} : std::vector<std::string>{};
    if (full("R") && full("G") && full("B")) return {"R", "G", "B"};
    if (full("Y") && !has_chroma) return {"Y"};
    exr_.fail("needs channels R, G, B or Y in full resolution (found: " + found + ")");
  }

  // Rejects sizes that the file cannot hold, before memory is allocated.
  void check_size() const {
    const std::string size =
        "the image of " + std::to_string(width_) + " x " + std::to_string(height_) + " pixels";
    if (width_ > kMaxPixels || height_ > kMaxPixels || width_ * height_ > kMaxPixels) {
      exr_.fail(size + " is too large (at most " + std::to_string(kMaxPixels) + " pixels)");
    }
    double bytes = 0;
    for (int i = 0; i < channels_->num_channels; ++i) {
      const exr_attr_chlist_entry_t& c = channels_->entries[i];
      bytes += (c.pixel_type == EXR_PIXEL_HALF ? 2.0 : 4.0) * width_ * height_ /
               (static_cast<double>(c.x_sampling) * c.y_sampling);
    }
    const auto held = static_cast<double>(std::filesystem::file_size(exr_.file()));
    if (bytes > held * largest_ratio()) {
      exr_.fail(size + " cannot come out of a file of " +
                std::to_string(static_cast<int64_t>(held)) + " bytes: it is truncated or damaged");
    }
    // Memory for floats, for an environment map, and for a block before and after unpacking.
    uint64_t block = 0;
    exr_.check(exr_get_chunk_unpacked_size(exr_.context(), 0, &block));
    require_memory(
        {exr_.file()},
        8.0 * static_cast<double>(width_ * height_) * static_cast<double>(names_.size()) +
            3.0 * static_cast<double>(block),
        size, "use a smaller one");
  }

  // Largest compression ratio of a block, by method: run-length 128 bytes from 2; deflate
  // 1032; 255 halves from 9 bits; 4 by 4 halves from 3 bytes; 8 by 8 floats from 4 deflated
  // bytes.
  double largest_ratio() const {
    switch (compression_) {
      case EXR_COMPRESSION_NONE:
        return 1;
      case EXR_COMPRESSION_RLE:
        return 64;
      case EXR_COMPRESSION_PIZ:
        return 454;
      case EXR_COMPRESSION_B44:
      case EXR_COMPRESSION_B44A:
        return 11;
      case EXR_COMPRESSION_DWAA:
      case EXR_COMPRESSION_DWAB:
        return 64.0 * 1032;
      default:
        return 4.0 / 3 * 1032;  // PXR24 keeps three bytes of a float
    }
  }

  // Grows while lines are read, so that a small file cannot allocate much.
  void grow_to(int64_t lines) {
    image_.data.resize(static_cast<size_t>(lines * width_) * names_.size());
  }

  // Visits the blocks of full resolution: visit(block, x, y) with the block's top left pixel in the
  // image.
  template <class Visit>
  void for_each_block(const Visit& visit) const {
    const bool tiled = storage_ == EXR_STORAGE_TILED;
    int32_t across = static_cast<int32_t>(width_), down = 0;
    exr_.check(tiled ? exr_get_tile_sizes(exr_.context(), 0, 0, 0, &across, &down)
                     : exr_get_scanlines_per_chunk(exr_.context(), 0, &down));
    for (int64_t y = 0; y < height_; y += down) {
      for (int64_t x = 0; x < width_; x += across) {
        exr_chunk_info_t block{};
        exr_.check(tiled ? exr_read_tile_chunk_info(exr_.context(), 0, static_cast<int>(x / across),
                                                    static_cast<int>(y / down), 0, 0, &block)
                         : exr_read_scanline_chunk_info(
                               exr_.context(), 0, static_cast<int>(window_.min.y + y), &block));
        if (x + block.width > width_ || y + block.height > height_) exr_.fail_damaged();
        visit(block, x, y);
      }
    }
  }

  struct BlockDecoder {
    explicit BlockDecoder(const ExrFile& file) : exr(file) {}
    ~BlockDecoder() { exr_decoding_destroy(exr.context(), &pipeline); }
    BlockDecoder(const BlockDecoder&) = delete;
    BlockDecoder& operator=(const BlockDecoder&) = delete;
    const ExrFile& exr;
    exr_decode_pipeline_t pipeline{};
    bool begun = false;
  };

  // Decodes a block whose top left pixel is (x, y) of the image.
  void decode(BlockDecoder& decoder, const exr_chunk_info_t& block, int64_t x, int64_t y) {
    exr_decode_pipeline_t& pipeline = decoder.pipeline;
    exr_.check(decoder.begun ? exr_decoding_update(exr_.context(), 0, &block, &pipeline)
                             : exr_decoding_initialize(exr_.context(), 0, &block, &pipeline));
    decoder.begun = true;
    const size_t pixel = names_.size();
    float* const corner = &image_.data[static_cast<size_t>(y * width_ + x) * pixel];
    for (int c = 0; c < pipeline.channel_count; ++c) {
      exr_coding_channel_info_t& channel = pipeline.channels[c];
      const auto wanted =
          std::find(names_.begin(), names_.end(), std::string(channel.channel_name));
      channel.decode_to_ptr = nullptr;
      if (wanted == names_.end()) continue;
      channel.decode_to_ptr = reinterpret_cast<uint8_t*>(corner + (wanted - names_.begin()));
      channel.user_data_type = EXR_PIXEL_FLOAT;
      channel.user_bytes_per_element = sizeof(float);
      channel.user_pixel_stride = static_cast<int32_t>(pixel * sizeof(float));
      channel.user_line_stride = static_cast<int32_t>(width_ * pixel * sizeof(float));
    }
    exr_.check(exr_decoding_choose_default_routines(exr_.context(), 0, &pipeline));
    exr_.check(exr_decoding_run(exr_.context(), 0, &pipeline));
  }

  void read_by_classes() {
    for_each_block([](const exr_chunk_info_t&, int64_t, int64_t) {});
    try {
      Imf::InputFile input(exr_.file().c_str());
      const Imath::Box2i window = input.header().dataWindow();
      if (window.min != Imath::V2i(window_.min.x, window_.min.y) ||
          window.max != Imath::V2i(window_.max.x, window_.max.y) || !input.isComplete()) {
        throw std::runtime_error("not the same");
      }
      std::vector<const char*> names;
      for (const std::string& name : names_) names.push_back(name.c_str());
      grow_to(1);
      input.setFrameBuffer(
          interleaved(image_.data.data(), Imf::FLOAT, names, image_.width, window.min));
      constexpr int64_t kLines = 256;  // largest number of lines of a block
      for (int64_t y = 0; y < height_; y += kLines) {
        const int64_t end = std::min(height_, y + kLines);
        grow_to(end);
        input.readPixels(static_cast<int>(window.min.y + y),
                         static_cast<int>(window.min.y + end) - 1);
      }
    } catch (const std::exception&) {
      // OpenEXR's own message depends on where it detects the damage.
      exr_.fail_damaged();
    }
  }

  const ExrFile& exr_;
  bool alpha_;
  exr_storage_t storage_{};
  exr_compression_t compression_{};
  exr_attr_box2i_t window_{};
  const exr_attr_chlist_t* channels_ = nullptr;
  std::vector<std::string> names_;  // names of the channels read
  int64_t width_ = 0, height_ = 0;
  Image image_;
};

// names: of the image's channels.
void write_channels(const std::string& file, const Image& image,
                    const std::vector<const char*>& names, bool half,
                    const std::vector<ImageAttribute>& attributes) {
  Imf::Header header = plain_header(image.width, image.height, attributes);
  for (const char* name : names) {
    header.channels().insert(name, Imf::Channel(half ? Imf::HALF : Imf::FLOAT));
  }
  const Imath::V2i origin(0, 0);
  std::vector<::half> halves;
  if (half) halves = to_half(image.data);
  const Imf::FrameBuffer buffer =
      half ? interleaved(halves.data(), Imf::HALF, names, image.width, origin)
           : interleaved(const_cast<float*>(image.data.data()), Imf::FLOAT, names, image.width,
                         origin);
  write_pixels(file, header, buffer, image.height);
}

}  // namespace

void write_exr(const std::string& file, const Image& image, bool half,
               const std::vector<ImageAttribute>& attributes) {
  write_channels(file, image, channel_names(image.channels), half, attributes);
}

void write_exr_with_alpha(const std::string& file, const Image& image, const Image& alpha,
                          bool half, const std::vector<ImageAttribute>& attributes) {
  std::vector<const char*> names = channel_names(image.channels);
  const size_t colours = names.size();
  names.push_back("A");
  Image both(image.width, image.height, image.channels + 1);
  for (size_t i = 0; i < alpha.data.size(); ++i) {
    float* const pixel = &both.data[i * names.size()];
    std::copy_n(&image.data[i * colours], colours, pixel);
    pixel[colours] = alpha.data[i];
  }
  write_channels(file, both, names, half, attributes);
}

void write_exr_layers(const std::string& file, const std::vector<ImageLayer>& layers,
                      const std::vector<ImageAttribute>& attributes) {
  const int width = layers[0].image.width;
  Imf::Header header = plain_header(width, layers[0].image.height, attributes);
  Imf::FrameBuffer buffer;
  for (const ImageLayer& layer : layers) {
    const size_t pixel = layer.channels.size() * sizeof(float);
    for (size_t c = 0; c < layer.channels.size(); ++c) {
      const std::string name = layer.name + "." + layer.channels[c];
      header.channels().insert(name, Imf::Channel(Imf::FLOAT));
      auto* const first = const_cast<float*>(layer.image.data.data()) + c;
      buffer.insert(name, Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(first), pixel,
                                     pixel * static_cast<size_t>(width)));
    }
  }
  write_pixels(file, header, buffer, layers[0].image.height);
}

Image read_exr(const std::string& file) {
  const ExrFile exr(file);
  return ExrReader(exr).read();
}

Image read_exr_alpha(const std::string& file) {
  const ExrFile exr(file);
  ExrReader reader(exr, true);
  return reader.has_pixels() ? reader.read() : Image();
}

std::vector<ImageAttribute> read_exr_attributes(const std::string& file) {
  const ExrFile exr(file);
  int32_t count = 0;
  exr.check(exr_get_attribute_count(exr.context(), 0, &count));
  std::vector<ImageAttribute> attributes;
  for (int32_t i = 0; i < count; ++i) {
    const exr_attribute_t* a = nullptr;
    exr.check(exr_get_attribute_by_index(exr.context(), 0, EXR_ATTR_LIST_SORTED_ORDER, i, &a));
    if (a->type != EXR_ATTR_STRING) continue;
    attributes.push_back({a->name, std::string(a->string->str, a->string->length)});
  }
  return attributes;
}

}  // namespace limn
