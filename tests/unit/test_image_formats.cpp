// Images of the formats that are told apart by their first bytes, and files that are none.
#include <gtest/gtest.h>

#include <filesystem>

#include "limn/core/error.h"
#include "limn/core/image.h"
#include "src/base/text.h"
#include "support/temp_files.h"

namespace limn {
namespace {

std::string corpus(const std::string& name) {
  return (std::filesystem::path(LIMN_SOURCE_DIR) / "tests" / "fuzz" / "corpus" / name).string();
}

using ByteList = std::vector<uint8_t>;

// The files of 3 x 2 pixels hold bytes 0, 10, 20, ...
ByteList tens() {
  ByteList bytes;
  for (int i = 0; i < 18; ++i) bytes.push_back(static_cast<uint8_t>(10 * i));
  return bytes;
}

TEST(ImageFormats, BytesAreAsInTheFile) {
  const std::vector<std::pair<std::string, ByteList>> known = {
      {"png/rgb.png", tens()},
      {"png/rgba.png", tens()},
      {"bmp/rgb.bmp", tens()},
      {"bmp/rgbx.bmp", tens()},
      {"bmp/top_down.bmp", tens()},
      {"bmp/palette.bmp",
       {0, 10, 20, 30, 40, 50, 60, 70, 80, 90, 100, 110, 120, 130, 140, 150, 160, 170}},
      {"png/palette.png", {0, 0, 0, 255, 0, 0, 0, 128, 0, 1, 2, 3}},
      {"png/grey_alpha.png", {0, 50, 100, 255}},
      {"png/grey1.png",
       {255, 0, 255, 0, 0, 255, 0, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255, 0}},
      {"png/interlaced.png", {5, 6, 7, 8, 9, 10}},
      {"png/bomb.png", {7}},
      {"jpeg/grey.jpg", ByteList(63, 100)},
  };
  for (const auto& [name, bytes] : known) {
    const StoredImage image = read_stored_image(corpus(name));
    EXPECT_EQ(image.bytes, bytes) << name;
    EXPECT_TRUE(image.srgb) << name;
    EXPECT_EQ(image.bytes.size(), size_t{1} * image.width * image.height * image.channels) << name;
  }
}

TEST(ImageFormats, SixteenBits) {
  const StoredImage grey = read_stored_image(corpus("png/grey16.png"));
  EXPECT_EQ(grey.floats, (std::vector<float>{1 / 65535.0f, 65534 / 65535.0f}));
  const StoredImage colour = read_stored_image(corpus("png/rgba16.png"));
  EXPECT_EQ(colour.floats, (std::vector<float>{258 / 65535.0f, 32768 / 65535.0f, 1}));
}

// A byte of mantissa counts 2^(exponent - 136).
TEST(ImageFormats, Rgbe) {
  EXPECT_EQ(read_image(corpus("rgbe/plain.hdr")).data,
            (std::vector<float>{1, 0.5f, 0.25f, 0, 0, 0, 255 / 256.0f, 1 / 256.0f, 2 / 256.0f, 160,
                                320, 480}));
  const Image runs = read_image(corpus("rgbe/runs.hdr"));
  ASSERT_EQ(runs.width, 8);
  EXPECT_EQ(runs.at(0, 0, 0), 1);
  EXPECT_EQ(runs.at(2, 0, 1), 3 / 128.0f);
  EXPECT_EQ(runs.at(7, 0, 1), 1);
  EXPECT_EQ(runs.at(7, 0, 2), 7 / 64.0f);
  const Image old = read_image(corpus("rgbe/old_runs.hdr"));  // 43 and 256 copies
  ASSERT_EQ(old.width, 300);
  for (int x = 0; x < 300; ++x) EXPECT_EQ(old.at(x, 0, 0), 1) << x;
}

// Of a gradient at the best quality, with colours at half the resolution.
TEST(ImageFormats, JpegIsCloseToItsSource) {
  for (const char* name : {"jpeg/rgb.jpg", "jpeg/progressive.jpg"}) {
    const StoredImage image = read_stored_image(corpus(name));
    ASSERT_EQ(image.width, 24) << name;
    ASSERT_EQ(image.height, 16) << name;
    for (int y = 0; y < 16; ++y) {
      for (int x = 0; x < 24; ++x) {
        const int expected[3] = {x * 8 + 20, y * 10 + 40, (x + y) * 4 + 30};
        for (int c = 0; c < 3; ++c) {
          EXPECT_NEAR(image.bytes[static_cast<size_t>(3 * (24 * y + x) + c)], expected[c], 8)
              << name << x << " " << y;
        }
      }
    }
  }
}

TEST(ImageFormats, SrgbIsDecoded) {
  EXPECT_EQ(srgb_decode(0), 0);
  EXPECT_EQ(srgb_decode(1), 1);
  EXPECT_NEAR(srgb_decode(188 / 255.0), 0.5029, 1e-4);
  for (const double v : {0.001, 0.0031, 0.0032, 0.2, 0.9}) {
    EXPECT_NEAR(srgb_decode(srgb_encode(v)), v, 1e-7);
  }
  const Image image = read_image(corpus("png/grey_alpha.png"));
  EXPECT_EQ(image.data[0], 0);
  EXPECT_NEAR(image.data[1], 0.0318960, 1e-7);  // ((50 / 255 + 0.055) / 1.055)^2.4
  EXPECT_NEAR(image.data[2], 0.1274377, 1e-7);
  EXPECT_EQ(image.data[3], 1);
}

std::string error_of(const std::string& file) {
  try {
    read_stored_image(file);
  } catch (const InputError& e) {
    const std::string message = e.what(), begin = file + ": error: ";
    EXPECT_TRUE(message.starts_with(begin)) << message;
    return message.substr(begin.size());
  }
  return "no error";
}

// The bytes of a file with some replaced.
std::string with(const std::string& name, size_t at, const std::string& bytes) {
  return read_whole_file(corpus(name)).replace(at, bytes.size(), bytes);
}

// With the checksum of its header made right again.
std::string png_of_size(const std::string& size) {
  std::string png = with("png/rgb.png", 16, size);
  uint32_t crc = 0xffffffff;
  for (size_t i = 12; i < 29; ++i) {
    crc ^= static_cast<uint8_t>(png[i]);
    for (int bit = 0; bit < 8; ++bit) crc = crc >> 1 ^ (crc & 1 ? 0xedb88320 : 0);
  }
  for (size_t i = 0; i < 4; ++i) png[29 + i] = static_cast<char>(~crc >> (24 - 8 * i));
  return png;
}

TEST(ImageFormats, HostileFilesAreRefused) {
  const TempFiles files;
  const auto error = [&](const std::string& bytes) { return error_of(files.write("a", bytes)); };
  using namespace std::string_literals;  // NOLINT: for zeros inside
  EXPECT_EQ(error_of(files.path("none")), "cannot read: No such file or directory");
  EXPECT_EQ(error(""), "cannot read: the file is empty");
  EXPECT_EQ(error("P6 1 1 255 abc"),
            "is no image that is read (known: BMP, EXR, JPEG, PNG, Radiance RGBE)");
  EXPECT_EQ(error("version https://git-lfs.github.com/spec/v1\noid sha256:5e07\n"),
            "is a pointer of Git LFS in place of the file (git lfs pull gets it)");
  EXPECT_EQ(error(png_of_size("\x80\0\0\0\0\0\0\1"s)),
            "the PNG file is truncated or damaged: PNG unsigned integer out of range");
  EXPECT_EQ(error(png_of_size("\x7f\xff\xff\xff\0\0\0\1"s)),
            "the image of 2147483647 x 1 pixels is too large (at most 268435456 pixels)");
  EXPECT_EQ(error(png_of_size("\0\0\x40\0\0\0\x40\0"s)),
            "the image of 16384 x 16384 pixels cannot come out of a file of 85 bytes: it is "
            "truncated or damaged");
  EXPECT_EQ(error(png_of_size("\0\0\0\4\0\0\0\2"s)),
            "the PNG file is truncated or damaged: Not enough image data");
  EXPECT_EQ(error(with("bmp/rgb.bmp", 18, "\xff\xff\xff\x7f"s)),
            "the image of 2147483647 x 2 pixels is too large (at most 268435456 pixels)");
  EXPECT_EQ(error(with("bmp/rgb.bmp", 22, "\0\0\0\x80"s)),
            "the image of 3 x 2147483648 pixels is too large (at most 268435456 pixels)");
  EXPECT_EQ(error(with("bmp/rgb.bmp", 22, "\3"s)), "the BMP file is truncated");
  EXPECT_EQ(error(with("bmp/rgb.bmp", 10, "\xff\xff\xff\xff"s)), "the BMP file is truncated");
  EXPECT_EQ(error(with("bmp/rgb.bmp", 30, "\1"s)),
            "the BMP file is compressed, which is not read: use PNG");
  EXPECT_EQ(error(with("bmp/rgb.bmp", 28, "\x10"s)),
            "the BMP file has 16 bits per pixel (known: 8, 24, 32)");
  EXPECT_EQ(error(with("bmp/palette.bmp", 78, "\6"s)),
            "the BMP file names a colour beyond its palette");
  EXPECT_EQ(error_of(corpus("jpeg/cmyk.jpg")),
            "the JPEG file is truncated or damaged: its colours are CMYK, which is not read");
  EXPECT_EQ(error_of(corpus("jpeg/arithmetic.jpg")), "JPEG with arithmetic coding is not read");
  const std::string hdr = "#?RADIANCE\n\n-Y 1 +X ";
  EXPECT_EQ(error("#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\nabcd"),
            "is a Radiance file of FORMAT=32-bit_rle_xyze (known: 32-bit_rle_rgbe)");
  EXPECT_EQ(error("#?RADIANCE\n\n+X 1 -Y 1\nabcd"),
            "the RGBE file has no size \"-Y HEIGHT +X WIDTH\"");
  EXPECT_EQ(error("#?RADIANCE"), "the RGBE file ends inside its header");
  EXPECT_EQ(error(hdr + "2\nabcd"), "the RGBE file is truncated");
  EXPECT_EQ(error(hdr + "300000000\nabcd"),
            "the image of 300000000 x 1 pixels is too large (at most 268435456 pixels)");
  EXPECT_EQ(error(hdr + "8\n\2\2\0\x9 more"s), "the RGBE file is damaged");
  EXPECT_EQ(error(hdr + "8\n\2\2\0\x8\x89\1"s), "the RGBE file is damaged");
  EXPECT_EQ(error(hdr + "8\n\1\1\1\1"), "the RGBE file is damaged");
  EXPECT_EQ(error(hdr + "0\n"), "the image of 0 x 1 pixels has none");
}

TEST(ImageFormats, TruncatedFilesAreRefused) {
  const TempFiles files;
  for (const char* name : {"png/rgb.png", "jpeg/rgb.jpg", "jpeg/progressive.jpg", "bmp/rgb.bmp",
                           "rgbe/runs.hdr", "png/interlaced.png"}) {
    const std::string whole = read_whole_file(corpus(name));
    for (const size_t size : {size_t{9}, whole.size() / 2, whole.size() - 14}) {
      EXPECT_NE(error_of(files.write("a", whole.substr(0, size))), "no error") << name << size;
    }
  }
}

}  // namespace
}  // namespace limn
