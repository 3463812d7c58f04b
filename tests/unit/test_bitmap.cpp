// Bitmap textures: known values, slopes against differences, texels as parameters.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "limn/core/image.h"
#include "limn/core/parameter.h"
#include "limn/core/rng.h"
#include "limn/core/scene.h"
#include "src/texture/texels.h"
#include "support/temp_files.h"
#include "support/test_properties.h"

namespace limn {
namespace {

std::string scene_text(const std::string& texture, const std::string& shape = "rectangle") {
  return "<scene version=\"3.0.0\"><sensor type=\"perspective\"/>\n<shape type=\"" + shape +
         "\" id=\"s\"><bsdf id=\"b\" type=\"diffuse\">" + texture + "</bsdf></shape></scene>";
}
std::string bitmap(const std::string& file, const std::string& more = "") {
  return "<texture name=\"reflectance\" type=\"bitmap\"><string name=\"filename\" value=\"" + file +
         "\"/>" + more + "</texture>";
}
std::string choice(const std::string& name, const std::string& value) {
  return "<string name=\"" + name + "\" value=\"" + value + "\"/>";
}
Scene read(const std::string& texture) {
  return read_scene_text(scene_text(texture), "", {}, nullptr);
}
std::string message_of(const std::string& texture) {
  try {
    read(texture);
  } catch (const InputError& error) {
    return error.what();
  }
  return "no error";
}

double red_at(const Texture& texture, double u, double v) {
  return texture.eval(TexturePoint<double>{nullptr, FaceId(0), {0, 0}, {u, v}}).r;
}

// Rows (0, 1) and (0.5, 0.25).
std::string two_by_two(const TempFiles& files) {
  Image image(2, 2, 1);
  image.data = {0, 1, 0.5f, 0.25f};
  write_exr(files.path("two.exr"), image, false, {});
  return files.path("two.exr");
}

TEST(Bitmap, WrapModesAndFilters) {
  const TempFiles files;
  const std::string file = two_by_two(files);
  struct Row {
    double u, v;
    // repeat, mirror, clamp, each bilinear and nearest
    double known[6];
  };
  const Row rows[] = {
      {0.25, 0.25, {0, 0, 0, 0, 0, 0}},
      {0.75, 0.75, {0.25, 0.25, 0.25, 0.25, 0.25, 0.25}},
      {0.5, 0.5, {0.4375, 0.25, 0.4375, 0.25, 0.4375, 0.25}},
      {0, 0.25, {0.5, 0, 0, 0, 0, 0}},
      {-0.0, 0.25, {0.5, 0, 0, 0, 0, 0}},
      {1, 0.25, {0.5, 0, 1, 1, 1, 1}},
      {1.25, 0.25, {0, 0, 1, 1, 1, 1}},
      {1.75, 0.25, {1, 1, 0, 0, 1, 1}},
      {-0.25, 0.75, {0.25, 0.25, 0.5, 0.5, 0.5, 0.5}},
      {-1.25, -0.25, {0.25, 0.25, 1, 1, 0, 0}},
      {0.375, 0.25, {0.25, 0, 0.25, 0, 0.25, 0}},
      {0.25, 1.125, {0.125, 0, 0.5, 0.5, 0.5, 0.5}},
      {1e9 + 0.25, 0.25, {0, 0, 0, 0, 1, 1}},
      {-1e9, 3e8, {0.4375, 0, 0, 0, 0.5, 0.5}},
  };
  int k = 0;
  for (const char* wrap : {"repeat", "mirror", "clamp"}) {
    for (const char* filter : {"bilinear", "nearest"}) {
      const Scene scene =
          read(bitmap(file, choice("wrap_mode", wrap) + choice("filter_type", filter)));
      for (const Row& row : rows) {
        EXPECT_NEAR(red_at(scene.shapes[0].bsdf->texture(0), row.u, row.v), row.known[k], 1e-6)
            << wrap << " " << filter << " " << row.u << " " << row.v;
      }
      ++k;
    }
  }
}

TEST(Bitmap, ToUvTransformsCoordinates) {
  const TempFiles files;
  const Scene scene = read(bitmap(two_by_two(files),
                                  "<transform name=\"to_uv\"><scale x=\"2\" y=\"3\"/>"
                                  "<translate x=\"0.25\" y=\"0.5\"/></transform>"));
  const Texture& texture = scene.shapes[0].bsdf->texture(0);
  EXPECT_NEAR(red_at(texture, 0.25, 0.0833333333333333), 0.25, 1e-12);  // at (0.75, 0.75)
  EXPECT_NEAR(red_at(texture, 0, 1.0 / 12), 0.5, 1e-12);                // at (0.25, 0.75)
  EXPECT_TRUE(texture.has_period_one());
  EXPECT_FALSE(read(bitmap(files.path("two.exr"),
                           "<transform name=\"to_uv\"><scale value=\"1.5\"/></transform>"))
                   .shapes[0]
                   .bsdf->texture(0)
                   .has_period_one());
}

// 8 bits are decoded texel by texel, then interpolated; unless raw.
TEST(Bitmap, EightBitsAreSrgb) {
  const std::string png = (std::filesystem::path(LIMN_SOURCE_DIR) / "tests" / "fuzz" / "corpus" /
                           "png" / "grey_alpha.png")
                              .string();  // 0, 50; 100, 255
  const Scene scene = read(bitmap(png));
  EXPECT_NEAR(red_at(scene.shapes[0].bsdf->texture(0), 0.5, 0.25), 0.0318960 / 2, 1e-7);
  EXPECT_NEAR(red_at(scene.shapes[0].bsdf->texture(0), 0.5, 0.75), (0.1274377 + 1) / 2, 1e-7);
  const Scene raw = read(bitmap(png, "<boolean name=\"raw\" value=\"true\"/>"));
  EXPECT_NEAR(red_at(raw.shapes[0].bsdf->texture(0), 0.5, 0.25), 25 / 255.0, 1e-7);
}

// What comes out of one file is shared, raw texels apart from others.
TEST(Bitmap, ASceneReadsAFileOnce) {
  const TempFiles files;
  const auto png = std::filesystem::path(LIMN_SOURCE_DIR) / "tests/fuzz/corpus/png/grey_alpha.png";
  std::filesystem::copy_file(png, files.path("map"));
  std::map<std::string, std::shared_ptr<const void>> of_files;
  const auto red = [&](bool raw) {
    test::TestProperties properties("texture", "bitmap",
                                    {{"filename", files.path("map")}, {"raw", raw}});
    properties.of_files.swap(of_files);
    const double value = red_at(*make_texture(properties), 0.5, 0.25);
    properties.of_files.swap(of_files);
    return value;
  };
  EXPECT_NEAR(red(false), 0.0318960 / 2, 1e-7);
  EXPECT_NEAR(red(true), 25 / 255.0, 1e-7);
  std::filesystem::copy_file(two_by_two(files), files.path("map"),
                             std::filesystem::copy_options::overwrite_existing);
  EXPECT_NEAR(red(false), 0.0318960 / 2, 1e-7);
  of_files.clear();
  EXPECT_EQ(red(false), 0.5);
}

TEST(Bitmap, TexelsStayAsTheyAreStored) {
  StoredImage stored{2, 1, 3, true, {0, 128, 255, 1, 2, 3}, {}};
  const Texels bytes(stored);
  EXPECT_NEAR(bytes.texel(0, 0).g, 0.2158605, 1e-6);
  EXPECT_EQ(bytes.texel(0, 0).b, 1);
  EXPECT_EQ(bytes.least(), 0);
  EXPECT_NEAR(bytes.mean().b, (1 + 0.000910581) / 2, 1e-7);
  Image image(1, 2, 3);
  image.data = {0.1f, 2, -3, 1e9f, 5, 6};
  const Texels floats(image);
  EXPECT_EQ(floats.image().data, image.data);
  EXPECT_EQ(floats.least(), -3);
  image.data = {0.5f, 2, -3, 1024, 5, 6};
  EXPECT_EQ(Texels(image).image().data, image.data);
}

// Whole tiles and parts of them, in both directions.
TEST(Bitmap, TexelsHaveColumnsAndRows) {
  Image image(9, 6, 3);
  for (size_t i = 0; i < image.data.size(); ++i) image.data[i] = static_cast<float>(i) + 0.1f;
  const Texels texels(image);
  EXPECT_EQ(texels.image().data, image.data);
  const auto four = texels.square({3, 8}, {5, 0});
  for (const auto& [texel, column, row] :
       {std::tuple{four[0], 3, 5}, {four[1], 8, 5}, {four[2], 3, 0}, {four[3], 8, 0}}) {
    EXPECT_EQ(texel[0], image.data[static_cast<size_t>(3 * (9 * row + column))]);
  }
}

// Numbers take the luminance of colours.
TEST(Bitmap, NumbersAreLuminances) {
  const TempFiles files;
  Image image(1, 1, 3);
  image.data = {0.25f, 0.5f, 1};
  write_exr(files.path("a.exr"), image, false, {});
  const Scene scene = read_scene_text(
      "<scene version=\"3.0.0\"><sensor type=\"perspective\"/><shape type=\"rectangle\"><bsdf "
      "type=\"roughconductor\"><texture name=\"alpha\" type=\"bitmap\"><string "
      "name=\"filename\" value=\"" +
          files.path("a.exr") + "\"/></texture></bsdf></shape></scene>",
      "", {}, nullptr);
  EXPECT_NEAR(red_at(scene.shapes[0].bsdf->texture(0), 0.3, 0.6),
              0.212671 * 0.25 + 0.715160 * 0.5 + 0.072169, 1e-9);
}

// Away from kinks.
TEST(Bitmap, SlopesAreThoseOfDifferences) {
  const TempFiles files;
  Image image(5, 4, 3);
  Rng rng(1, 2, 3);
  for (float& v : image.data) v = static_cast<float>(rng.uniform());
  write_exr(files.path("a.exr"), image, false, {});
  for (const char* wrap : {"repeat", "mirror", "clamp"}) {
    const Scene scene = read(bitmap(files.path("a.exr"), choice("wrap_mode", wrap)));
    const Texture& texture = scene.shapes[0].bsdf->texture(0);
    for (int i = 0; i < 200; ++i) {
      const double u = 4 * rng.uniform() - 2, v = 4 * rng.uniform() - 2;
      const double h = 1e-7;
      const auto kink = [&](double x, int size) {
        const double t = x * size - 0.5;
        return std::fabs(t - std::round(t)) < 1e-5;
      };
      if (kink(u, 5) || kink(v, 4)) continue;
      TexturePoint<Dual> point;
      point.uv = {Dual(u, {1, 0, 0, 0}), Dual(v, {0, 1, 0, 0})};
      const Rgb<Dual> value = texture.eval(point);
      EXPECT_NEAR(value.r.d[0], (red_at(texture, u + h, v) - red_at(texture, u - h, v)) / (2 * h),
                  1e-6);
      EXPECT_NEAR(value.r.d[1], (red_at(texture, u, v + h) - red_at(texture, u, v - h)) / (2 * h),
                  1e-6);
    }
  }
}

// The value is the weighted sum of texels, and the weights add up to 1.
TEST(Bitmap, WeightsOfTexels) {
  const TempFiles files;
  const std::string file = two_by_two(files);
  for (const char* filter : {"bilinear", "nearest"}) {
    for (const char* wrap : {"repeat", "mirror", "clamp"}) {
      const Scene scene =
          read(bitmap(file, choice("wrap_mode", wrap) + choice("filter_type", filter)));
      const Texture& texture = scene.shapes[0].bsdf->texture(0);
      const Image texels = texture.texels();
      for (const double u : {-1.3, 0.0, 0.1, 0.6, 1.0, 2.7}) {
        const TexturePoint<double> point{nullptr, FaceId(0), {0, 0}, {u, 0.4}};
        double sum = 0, weights = 0;
        for (const auto& [texel, weight] : texture.texel_weights(point)) {
          sum += weight * texels.data[3 * texel];
          weights += weight;
        }
        EXPECT_NEAR(weights, 1, 1e-12);
        EXPECT_NEAR(sum, texture.eval(point).r, 1e-12);
      }
    }
  }
}

TEST(Bitmap, TexelsAreParameters) {
  const TempFiles files;
  const Scene scene = read(bitmap(two_by_two(files)));
  const Parameter all = find_parameter_or_array(scene, "b.reflectance.data");
  EXPECT_EQ(all.array, (std::vector<size_t>{2, 2, 3}));
  EXPECT_EQ(all.least, 0);
  EXPECT_EQ(all.most, 1);
  const Parameter one = find_parameter(scene, "b.reflectance.data.1.0.g");
  Scene changed = one.moved(scene, 0.25);
  EXPECT_EQ(changed.shapes[0].bsdf->texture(0).texels().data[7], 0.75f);
  EXPECT_EQ(scene.shapes[0].bsdf->texture(0).texels().data[7], 0.5f);
  one.seed(changed, 2);
  TexturePoint<Dual> point;
  point.uv = {Dual(0.25), Dual(0.625)};
  const Rgb<Dual> value = changed.shapes[0].bsdf->texture(0).eval(point);
  EXPECT_EQ(value.g.d[2], 0.75);
  EXPECT_EQ(value.r.d[2], 0);
  EXPECT_THROW(find_parameter(scene, "b.reflectance.data.2.0.g"), InputError);
}

// Of a texture that is shared by reference, each BSDF has a copy.
TEST(Bitmap, ByReference) {
  const TempFiles files;
  std::string texture = bitmap(two_by_two(files));
  texture.replace(texture.find("name=\"reflectance\""), 18, "id=\"t\"");
  const std::string use = "<ref name=\"reflectance\" id=\"t\"/></bsdf></shape>";
  const Scene scene = read_scene_text(
      "<scene version=\"3.0.0\"><sensor type=\"perspective\"/>" + texture +
          "<shape type=\"disk\"><bsdf type=\"diffuse\" id=\"a\">" + use +
          "<shape type=\"cube\"><bsdf type=\"diffuse\" id=\"b\">" + use + "</scene>",
      "", {}, nullptr);
  const Scene changed = find_parameter(scene, "a.reflectance.data.0.0.r").moved(scene, 1);
  EXPECT_EQ(red_at(changed.shapes[0].bsdf->texture(0), 0.25, 0.25), 1);
  EXPECT_EQ(red_at(changed.shapes[1].bsdf->texture(0), 0.25, 0.25), 0);
}

// Their borders are edges (test_texture_edges.cpp), but those of bumps and light are not.
TEST(Bitmap, NearestTexelsOfBumpsTakeNothingThatMoves) {
  const TempFiles files;
  const std::string file = two_by_two(files), use = choice("filter_type", "nearest");
  EXPECT_NO_THROW(find_parameter(read(bitmap(file, use)), "s.translate.x"));
  const Scene scene = read_scene_text(
      "<scene version=\"3.0.0\"><sensor type=\"perspective\" id=\"sensor\"/>"
      "<shape type=\"rectangle\" id=\"s\"><bsdf type=\"bumpmap\"><texture type=\"bitmap\" "
      "name=\"bumps\"><string name=\"filename\" value=\"" +
          file + "\"/>" + use + "</texture><bsdf type=\"diffuse\"/></bsdf></shape></scene>",
      "", {}, nullptr);
  for (const char* name : {"s.translate.x", "sensor.fov", "s.vertex_positions.0.x"}) {
    std::string message;
    try {
      find_parameter(scene, name);
    } catch (const InputError& error) {
      message = error.what();
    }
    EXPECT_EQ(message, "string: error: parameter \"" + std::string(name) +
                           "\": no term covers texel borders of a nearest bitmap of a light or "
                           "bumpmap: use bilinear");
  }
  EXPECT_THROW(find_parameter(scene, "s.translate.w"), UnknownParameter);
}

TEST(Bitmap, WhatCannotBeIsRefused) {
  const TempFiles files;
  Image image(2, 1, 1);
  image.data = {0.5f, -0.5f};
  write_exr(files.path("dark.exr"), image, false, {});
  EXPECT_EQ(message_of(bitmap(files.path("dark.exr"))),
            "string:2:60: error: bsdf \"diffuse\": reflectance: the values of the texture must not "
            "be negative");
  image.data = {0.5f, std::nanf("")};
  write_exr(files.path("nan.exr"), image, false, {});
  EXPECT_EQ(message_of(bitmap(files.path("nan.exr"))),
            files.path("nan.exr") + ": error: the texture's pixel (column 1, row 0) is not finite");
  EXPECT_NE(message_of(bitmap(two_by_two(files), choice("wrap_mode", "black")))
                .find("wrap_mode: unknown value \"black\" (known: repeat, mirror, clamp)"),
            std::string::npos);
}

}  // namespace
}  // namespace limn
