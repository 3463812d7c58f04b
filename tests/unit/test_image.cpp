// Image files: round trips, foreign files, broken files, pictures.
#include "limn/core/image.h"

#include <gtest/gtest.h>
#include <png.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>

#include "limn/core/error.h"
#include "support/temp_files.h"

namespace limn {
namespace {

Image ramp(int width, int height, int channels) {
  Image image(width, height, channels);
  for (size_t i = 0; i < image.data.size(); ++i) {
    image.data[i] = (i % 2 ? -1.0f : 1.0f) * 0.37f * static_cast<float>(i);
  }
  return image;
}

std::string contents(const std::string& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

TEST(Image, FloatExrKeepsEveryBit) {
  for (int channels : {1, 3}) {
    const TempFiles files;
    const std::string file = files.path("float.exr");
    const Image image = ramp(7, 5, channels);
    write_exr(file, image, false, {{"limn.seed", "seed 17 of the test"}});
    const Image back = read_exr(file);
    EXPECT_EQ(back.width, 7);
    EXPECT_EQ(back.height, 5);
    EXPECT_EQ(back.channels, channels);
    EXPECT_EQ(back.data, image.data);
    const std::vector<ImageAttribute> attributes = read_exr_attributes(file);
    ASSERT_EQ(attributes.size(), 1u);
    EXPECT_EQ(attributes[0].name, "limn.seed");
    EXPECT_EQ(attributes[0].value, "seed 17 of the test");
  }
}

TEST(Image, HalfExrRoundsAndStaysFinite) {
  const TempFiles files;
  const std::string file = files.path("half.exr");
  Image image = ramp(6, 4, 3);
  image.data[5] = 1e9f;
  image.data[6] = -1e9f;
  image.data[7] = std::numeric_limits<float>::infinity();
  write_exr(file, image, true, {});
  const Image back = read_exr(file);
  EXPECT_EQ(back.data[5], 65504);
  EXPECT_EQ(back.data[6], -65504);
  EXPECT_TRUE(std::isinf(back.data[7]));
  for (size_t i = 8; i < image.data.size(); ++i) {
    EXPECT_NEAR(back.data[i], image.data[i], std::fabs(image.data[i]) / 2048);
  }
}

TEST(Image, NothingIsLeftBesideTheFile) {
  const std::filesystem::path folder = ::testing::TempDir() + "limn_image_folder";
  std::filesystem::remove_all(folder);
  std::filesystem::create_directory(folder);
  write_exr(folder / "a.exr", ramp(3, 2, 3), true, {});
  write_png(folder / "a.png", ramp(3, 2, 3), 1);
  int files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    EXPECT_EQ(entry.path().stem(), "a");
    ++files;
  }
  EXPECT_EQ(files, 2);
  std::filesystem::remove_all(folder);
}

template <class F>
std::string error_of(F f) {
  try {
    f();
  } catch (const InputError& e) {
    return e.what();
  }
  return "no error";
}

TEST(Image, BrokenFilesAreExplained) {
  const TempFiles files;
  const std::string file = files.path("broken.exr");
  const auto read = [&] { read_exr(file); };
  EXPECT_EQ(error_of(read), file + ": error: cannot read: No such file or directory");
  std::ofstream(file).close();
  EXPECT_EQ(error_of(read), file + ": error: cannot read: the file is empty");
  std::ofstream(file) << "P6 not an exr";
  EXPECT_EQ(error_of(read), file + ": error: is not an OpenEXR image");
  write_exr(file, ramp(200, 100, 3), false, {});
  const std::string whole = contents(file);
  for (size_t size : {whole.size() * 9 / 10, whole.size() / 2, size_t{60}}) {
    std::ofstream(file, std::ios::binary) << whole.substr(0, size);
    const std::string error = error_of(read);
    EXPECT_TRUE(error.starts_with(file + ": error: the EXR file is truncated or damaged")) << error;
  }
  EXPECT_EQ(error_of([&] { write_exr("/no/such/folder/a.exr", ramp(2, 2, 3), true, {}); }),
            "/no/such/folder/a.exr: error: cannot write: no such folder");
  EXPECT_EQ(error_of([&] { write_png("/no/such/folder/a.png", ramp(2, 2, 3), 1); }),
            "/no/such/folder/a.png: error: cannot write: no such folder");
}

// A link stays a link, to a file that is there and to one that is not.
TEST(Image, LinksAreWrittenThrough) {
  const TempFiles files;
  std::filesystem::create_directory(files.path("far"));
  const std::string link = files.path("link.exr"), second = files.path("second.exr");
  std::filesystem::create_symlink("far/image.exr", link);
  std::filesystem::create_symlink(link, second);
  for (const int width : {2, 3}) {
    write_exr(second, ramp(width, 2, 3), false, {});
    EXPECT_TRUE(std::filesystem::is_symlink(link) && std::filesystem::is_symlink(second));
    EXPECT_EQ(read_exr(files.path("far/image.exr")).width, width);
  }
}

// Any prefix of a file is an error, never a crash or a picture.
TEST(Image, EveryTruncationIsAnError) {
  const TempFiles files;
  const std::string file = files.path("prefix.exr");
  write_exr(file, ramp(9, 40, 3), true, {});
  const std::string whole = contents(file);
  for (size_t size = 0; size < whole.size(); size += 13) {
    std::ofstream(file, std::ios::binary) << whole.substr(0, size);
    EXPECT_NE(error_of([&] { read_exr(file); }), "no error") << size;
  }
}

// A written file with other numbers in its windows (16 pixels by 8 before).
std::string with_windows(std::string content, int32_t right, int32_t bottom) {
  for (const std::string name : {"dataWindow", "displayWindow"}) {
    const size_t at = content.find(name) + name.size() + 1 + sizeof("box2i") + 4;
    std::memcpy(&content[at + 8], &right, 4);
    std::memcpy(&content[at + 12], &bottom, 4);
  }
  return content;
}

TEST(Image, SizesAreHeldAgainstTheFile) {
  const TempFiles files;
  const std::string file = files.path("window.exr");
  write_exr(file, ramp(16, 8, 3), true, {{"note", "by hand"}});
  const std::string whole = contents(file);
  const auto error_with = [&](const std::string& content) {
    std::ofstream(file, std::ios::binary) << content;
    return error_of([&] { read_exr(file); });
  };
  const std::string error = file + ": error: ";
  EXPECT_EQ(error_with(with_windows(whole, 15, 7)), "no error");
  EXPECT_EQ(error_with(with_windows(whole, 16383, 16383)),
            error + "the image of 16384 x 16384 pixels cannot come out of a file of " +
                std::to_string(whole.size()) + " bytes: it is truncated or damaged");
  EXPECT_EQ(error_with(with_windows(whole, 65534, 65534)),
            error + "the image of 65535 x 65535 pixels is too large (at most 268435456 pixels)");
  // One pixel or line more or less than the blocks hold.
  for (const auto& [right, bottom] : {std::pair{16, 7}, {14, 7}, {15, 8}, {15, 6}, {-1, -1}}) {
    EXPECT_EQ(error_with(with_windows(whole, right, bottom))
                  .rfind(error + "the EXR file is truncated or damaged: ", 0),
              0u)
        << right << " " << bottom;
  }
  std::string attribute = whole;
  const int32_t size = 0x69651cad;
  std::memcpy(&attribute[attribute.find("note") + 5 + sizeof("string")], &size, 4);
  EXPECT_EQ(error_with(attribute), error +
                                       "the EXR file is truncated or damaged: Attribute 'note', "
                                       "type 'string': Invalid size 1768234157");
}

// Five by three pixels, a tenth of the number of the value, in all compressions that keep halves.
TEST(Image, ReadsEveryCompressionAndTiles) {
  const std::filesystem::path corpus =
      std::filesystem::path(LIMN_SOURCE_DIR) / "tests" / "fuzz" / "corpus" / "exr";
  for (const char* name :
       {"none", "rle", "zips", "zip", "piz", "pxr24", "none_tiled", "zip_tiled", "piz_tiled"}) {
    const Image image = read_exr((corpus / (std::string(name) + ".exr")).string());
    ASSERT_EQ(image.data.size(), 45u) << name;
    for (size_t i = 0; i < image.data.size(); ++i) {
      const float value = 0.1f * static_cast<float>(i);
      EXPECT_NEAR(image.data[i], value, value / 2048) << name;
    }
  }
  // These keep an impression.
  for (const char* name : {"b44", "b44a", "dwaa", "dwab", "dwaa_tiled"}) {
    const Image image = read_exr((corpus / (std::string(name) + ".exr")).string());
    EXPECT_EQ(image.data.size(), 45u) << name;
    EXPECT_LT(image.data.front(), image.data.back()) << name;
  }
  const Image grey = read_exr((corpus / "grey_offset.exr").string());
  EXPECT_EQ(grey.data, (std::vector<float>{0, 1, 2, 3, 4, 5}));
}

// Debian's blender-data holds maps with DWA compression.
TEST(Image, ReadsDwaCompression) {
  const std::string file = "/usr/share/blender/datafiles/studiolights/world/sunset.exr";
  if (!std::filesystem::exists(file)) GTEST_SKIP() << file << " is not installed";
  const Image image = read_exr(file);
  EXPECT_EQ(image.channels, 3);
  EXPECT_EQ(image.width, 2 * image.height);
  double sum = 0;
  for (float v : image.data) {
    ASSERT_TRUE(std::isfinite(v));
    sum += v;
  }
  EXPECT_GT(sum / static_cast<double>(image.data.size()), 0.01);
}

struct Picture {
  unsigned width, height;
  std::vector<png_byte> rgb;
};

Picture read_picture(const std::string& file) {
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  EXPECT_NE(png_image_begin_read_from_file(&png, file.c_str()), 0) << png.message;
  png.format = PNG_FORMAT_RGB;
  Picture picture{png.width, png.height, std::vector<png_byte>(PNG_IMAGE_SIZE(png))};
  EXPECT_NE(png_image_finish_read(&png, nullptr, picture.rgb.data(), 0, nullptr), 0) << png.message;
  return picture;
}

// sRGB: 0.5 is 188, 0.002 is 12.92 * 0.002 * 255 = 6.6.
TEST(Image, PngIsSrgb) {
  const TempFiles files;
  const std::string file = files.path("picture.png");
  Image image(2, 2, 3);
  image.data = {0, 0.25f, 0.001f, 7, -1, std::nanf(""), 0.5f, 0.5f, 0.5f, 0.1f, 0, 0};
  write_png(file, image, 2);
  EXPECT_EQ(contents(file).substr(0, 4), "\x89PNG");
  const Picture picture = read_picture(file);
  EXPECT_EQ(picture.width, 2u);
  EXPECT_EQ(picture.height, 2u);
  const std::vector<png_byte> expected = {0, 188, 7, 255, 0, 0, 255, 255, 255, 124, 0, 0};
  EXPECT_EQ(picture.rgb, expected);
}

TEST(Image, SignedPngIsBlueWhiteRed) {
  const TempFiles files;
  const std::string file = files.path("signed.png");
  Image image(5, 1, 1);
  image.data = {0, 2, -2, 1, -100};
  write_signed_png(file, image, 2);
  const std::vector<png_byte> expected = {255, 255, 255, 255, 0, 0, 0,  0,
                                          255, 255, 128, 128, 0, 0, 255};
  EXPECT_EQ(read_picture(file).rgb, expected);
}

TEST(Image, SignedScaleIgnoresZerosAndTheBrightest) {
  Image image(1000, 3, 3);
  EXPECT_EQ(signed_scale(image), 1);
  for (int x = 0; x < 1000; ++x) {
    for (int c = 0; c < 3; ++c) image.at(x, 1, c) = x < 998 ? -2.0f : 1e6f;
  }
  EXPECT_EQ(signed_scale(image), 2);
}

}  // namespace
}  // namespace limn
