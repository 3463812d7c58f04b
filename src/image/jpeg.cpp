// Reading of JPEG files; the only file that includes libjpeg.
#include <cstdio>
// After cstdio, whose FILE it needs.
#include <jpeglib.h>

#include <jerror.h>

#include <csetjmp>

#include "limn/core/error.h"
#include "src/image/formats.h"

namespace limn {
namespace {

// Decodes a file in memory. libjpeg's errors are left by longjmp, so between here and there nothing
// may need a destructor.
class JpegReader {
 public:
  explicit JpegReader(std::string_view data) : data_(data) {
    jpeg_.err = jpeg_std_error(&errors_);
    errors_.error_exit = on_error;
    errors_.emit_message = on_message;
    jpeg_.client_data = this;
  }
  ~JpegReader() { jpeg_destroy_decompress(&jpeg_); }
  JpegReader(const JpegReader&) = delete;
  JpegReader& operator=(const JpegReader&) = delete;

  uint32_t width = 0, height = 0;
  int channels = 0;
  bool arithmetic = false;
  char message[JMSG_LENGTH_MAX] = "";  // of an error

  // Sets the members above; false after an error.
  bool read_header() {
    if (setjmp(jump_)) return false;  // NOLINT: libjpeg has no other way
    jpeg_create_decompress(&jpeg_);
    jpeg_.client_data = this;
    jpeg_mem_src(&jpeg_, reinterpret_cast<const unsigned char*>(data_.data()), data_.size());
    jpeg_read_header(&jpeg_, TRUE);
    if (jpeg_.jpeg_color_space == JCS_CMYK || jpeg_.jpeg_color_space == JCS_YCCK) {
      std::snprintf(message, sizeof(message), "its colours are CMYK, which is not read");
      return false;
    }
    jpeg_.out_color_space = jpeg_.num_components == 1 ? JCS_GRAYSCALE : JCS_RGB;
    width = jpeg_.image_width;
    height = jpeg_.image_height;
    channels = jpeg_.num_components == 1 ? 1 : 3;
    arithmetic = jpeg_.arith_code != 0;
    return true;
  }
  // bytes: of all rows, after a header of this size.
  bool read_rows(uint8_t* bytes) {
    if (setjmp(jump_)) return false;  // NOLINT
    progress_.progress_monitor = on_progress;
    jpeg_.progress = &progress_;
    jpeg_start_decompress(&jpeg_);
    const size_t row = size_t{width} * static_cast<size_t>(channels);
    while (jpeg_.output_scanline < height) {
      JSAMPROW line = bytes + row * jpeg_.output_scanline;
      jpeg_read_scanlines(&jpeg_, &line, 1);
    }
    return true;
  }

 private:
  static JpegReader& of(j_common_ptr jpeg) { return *static_cast<JpegReader*>(jpeg->client_data); }
  [[noreturn]] static void on_error(j_common_ptr jpeg) {
    jpeg->err->format_message(jpeg, of(jpeg).message);
    std::longjmp(of(jpeg).jump_, 1);  // NOLINT
  }
  // Warnings (level -1) stand for damage that libjpeg would paint grey; bytes to spare do no harm.
  static void on_message(j_common_ptr jpeg, int level) {
    if (level < 0 && jpeg->err->msg_code != JWRN_EXTRANEOUS_DATA) on_error(jpeg);
  }
  // Every scan of a progressive file goes over the whole image.
  static void on_progress(j_common_ptr jpeg) {
    constexpr int kMostScans = 500;  // not tuned: encoders write about ten
    auto* const decoder = reinterpret_cast<j_decompress_ptr>(jpeg);
    if (decoder->input_scan_number <= kMostScans) return;
    std::snprintf(of(jpeg).message, JMSG_LENGTH_MAX, "more than %d scans", kMostScans);
    std::longjmp(of(jpeg).jump_, 1);  // NOLINT
  }

  std::string_view data_;
  jpeg_decompress_struct jpeg_{};
  jpeg_error_mgr errors_{};
  jpeg_progress_mgr progress_{};
  std::jmp_buf jump_;
};

}  // namespace

StoredImage read_jpeg(const std::string& file, std::string_view data) {
  JpegReader reader(data);
  const auto check = [&](bool read) {
    if (read) return;
    throw InputError({file},
                     std::string("the JPEG file is truncated or damaged: ") + reader.message);
  };
  check(reader.read_header());
  if (reader.arithmetic) throw InputError({file}, "JPEG with arithmetic coding is not read");
  // A block of 64 pixels takes at least one bit in a progressive file. Its coefficients are kept,
  // of two bytes each, for up to three components.
  check_image_size(file, data, reader.width, reader.height, 512, reader.channels * 3.0);
  StoredImage image{static_cast<int>(reader.width),
                    static_cast<int>(reader.height),
                    reader.channels,
                    true,
                    {},
                    {}};
  image.bytes.resize(size_t{reader.width} * reader.height * static_cast<size_t>(reader.channels));
  check(reader.read_rows(image.bytes.data()));
  return image;
}

}  // namespace limn
