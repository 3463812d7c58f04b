// The one door to OpenEXR.
#include "limn/core/image.h"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <ImfOutputFile.h>
#include <ImfStdIO.h>
#include <ImfStringAttribute.h>
#include <ImfTestFile.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <stdexcept>

#include "limn/core/check.h"
#include "limn/core/error.h"
#include "src/base/output_file.h"

namespace limn {
namespace {

constexpr int64_t kMaxPixels = int64_t{1} << 28;  // not tuned: 3 GB in memory

std::vector<const char*> channel_names(int channels) {
  if (channels == 3) return {"R", "G", "B"};
  CHECK_EQ(channels, 1);
  return {"Y"};
}

// Finite values beyond half's range become its largest, rather than infinite.
std::vector<half> to_half(const std::vector<float>& data) {
  constexpr float kLargest = HALF_MAX;
  std::vector<half> result;
  result.reserve(data.size());
  for (float v : data) {
    result.emplace_back(std::isfinite(v) ? std::clamp(v, -kLargest, kLargest) : v);
  }
  return result;
}

// Slices for interleaved channels whose top left pixel is at `origin` of the file's window.
template <class T>
Imf::FrameBuffer interleaved(T* data, Imf::PixelType type, const std::vector<const char*>& names,
                             int width, const Imath::V2i& origin) {
  Imf::FrameBuffer buffer;
  const size_t pixel = names.size() * sizeof(T);
  const auto base =
      reinterpret_cast<intptr_t>(data) -
      (static_cast<intptr_t>(origin.y) * width + origin.x) * static_cast<intptr_t>(pixel);
  for (size_t c = 0; c < names.size(); ++c) {
    // NOLINTNEXTLINE(performance-no-int-to-ptr): OpenEXR wants where pixel (0, 0) would be
    auto* const first = reinterpret_cast<char*>(base + c * sizeof(T));
    buffer.insert(names[c], Imf::Slice(type, first, pixel, pixel * width));
  }
  return buffer;
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

std::vector<const char*> channels_to_read(const Imf::ChannelList& channels,
                                          const std::string& file) {
  const auto full = [&](const char* name) {
    const Imf::Channel* c = channels.findChannel(name);
    return c && c->xSampling == 1 && c->ySampling == 1;
  };
  if (full("R") && full("G") && full("B")) return {"R", "G", "B"};
  if (full("Y") && !channels.findChannel("RY")) return {"Y"};
  std::string found;
  for (auto c = channels.begin(); c != channels.end(); ++c) {
    found += (found.empty() ? "" : ", ") + std::string(c.name());
  }
  throw InputError(SourceLocation{file},
                   "needs channels R, G, B or Y in full resolution (found: " + found + ")");
}

Image read_open_file(Imf::InputFile& input, const std::string& file) {
  const Imath::Box2i window = input.header().dataWindow();
  const int64_t width = int64_t{window.max.x} - window.min.x + 1;
  const int64_t height = int64_t{window.max.y} - window.min.y + 1;
  if (width > kMaxPixels || height > kMaxPixels || width * height > kMaxPixels) {
    throw InputError(SourceLocation{file}, "the image is too large");
  }
  const std::vector<const char*> names = channels_to_read(input.header().channels(), file);
  if (!input.isComplete()) throw std::runtime_error("scanlines are missing");
  Image image(static_cast<int>(width), static_cast<int>(height), static_cast<int>(names.size()));
  input.setFrameBuffer(interleaved(image.data.data(), Imf::FLOAT, names, image.width, window.min));
  input.readPixels(window.min.y, window.max.y);
  return image;
}

}  // namespace

void write_exr(const std::string& file, const Image& image, bool half,
               const std::vector<ImageAttribute>& attributes) {
  const std::vector<const char*> names = channel_names(image.channels);
  Imf::Header header(image.width, image.height);
  header.compression() = Imf::ZIP_COMPRESSION;
  for (const char* name : names) {
    header.channels().insert(name, Imf::Channel(half ? Imf::HALF : Imf::FLOAT));
  }
  for (const ImageAttribute& a : attributes) {
    header.insert(a.name, Imf::StringAttribute(a.value));
  }
  OutputFile output(file);
  // In memory: a file that OpenEXR closes does not tell that the disk was full.
  Imf::StdOSStream stream;
  try {
    const Imath::V2i origin(0, 0);
    std::vector<::half> halves;
    if (half) halves = to_half(image.data);
    Imf::OutputFile exr(stream, header);
    exr.setFrameBuffer(half ? interleaved(halves.data(), Imf::HALF, names, image.width, origin)
                            : interleaved(const_cast<float*>(image.data.data()), Imf::FLOAT, names,
                                          image.width, origin));
    exr.writePixels(image.height);
  } catch (const std::exception& e) {
    throw InputError(SourceLocation{file}, std::string("cannot write: ") + e.what());
  }
  output.write(stream.str());
  output.commit();
}

namespace {

// Opens an EXR and calls read(input).
template <class Read>
auto with_exr(const std::string& file, Read read) {
  check_is_exr(file);
  try {
    Imf::InputFile input(file.c_str());
    return read(input);
  } catch (const InputError&) {
    throw;
  } catch (const std::exception&) {
    // OpenEXR's own words depend on where in the file it notices.
    throw InputError(SourceLocation{file}, "the EXR file is truncated or damaged");
  }
}

}  // namespace

Image read_exr(const std::string& file) {
  return with_exr(file, [&](Imf::InputFile& input) { return read_open_file(input, file); });
}

std::vector<ImageAttribute> read_exr_attributes(const std::string& file) {
  return with_exr(file, [](Imf::InputFile& input) {
    std::vector<ImageAttribute> attributes;
    const Imf::Header& header = input.header();
    for (auto i = header.begin(); i != header.end(); ++i) {
      const auto* text = dynamic_cast<const Imf::StringAttribute*>(&i.attribute());
      if (text) attributes.push_back({i.name(), text->value()});
    }
    return attributes;
  });
}

}  // namespace limn
