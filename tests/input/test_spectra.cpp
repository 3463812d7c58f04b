// Spectra, named metals and named dielectrics give Mitsuba's colours and indices.
#include <gtest/gtest.h>

#include "limn/core/scene.h"
#include "src/bsdf/indices.h"
#include "src/scene_file/spectrum.h"
#include "support/temp_files.h"
#include "support/test_properties.h"

namespace limn {
namespace {

void expect_near(const Rgb<double>& c, const Rgb<double>& known, double digits) {
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(c[i], known[i], digits) << i;
}

std::vector<SpectrumSample> parse(const std::string& text) { return parse_spectrum(text, {"s"}); }

TEST(Spectra, KnownColours) {
  expect_near(integrate_spectrum(parse("360:1, 830:1"), ColourUse::kReflectance),
              {0.99899, 0.99887, 0.99880}, 5e-6);
  expect_near(
      integrate_spectrum(parse("400:0.78, 500:0.78, 600:0.78, 700:0.78"), ColourUse::kReflectance),
      {0.77637, 0.77981, 0.77603}, 5e-6);
  expect_near(integrate_spectrum(parse("400:0, 500:8, 600:15.6, 700:18.4"), ColourUse::kEmission),
              {20.711, 10.855, 2.771}, 5e-4);
}

TEST(Spectra, ConstantsAreGreyButForEmission) {
  expect_near(constant_spectrum(0.5, ColourUse::kReflectance), {0.5, 0.5, 0.5}, 0);
  expect_near(constant_spectrum(0.5, ColourUse::kUnbounded), {0.5, 0.5, 0.5}, 0);
  expect_near(constant_spectrum(2, ColourUse::kEmission),
              {2 * 1.204794, 2 * 0.948291, 2 * 0.908916}, 1e-12);
}

TEST(Spectra, ClampedByTheirUse) {
  const auto red = parse("600:9, 700:9");
  EXPECT_EQ(integrate_spectrum(red, ColourUse::kReflectance).r, 1);
  EXPECT_GT(integrate_spectrum(red, ColourUse::kUnbounded).r, 1);
  EXPECT_EQ(integrate_spectrum(red, ColourUse::kUnbounded).b, 0);
}

// The ratio of two temperatures at 555 nm, where Y is largest, is near the ratio of Planck's law.
TEST(Spectra, BlackBodies) {
  const Rgb<double> warm = blackbody(3000), cold = blackbody(9000);
  EXPECT_GT(warm.r, warm.b);
  EXPECT_LT(cold.r, cold.b);
  // Wien's tail: far below, radiance grows as exp(-h c / (w k T)).
  const double ratio = blackbody(1000).r / blackbody(990).r;
  EXPECT_NEAR(std::log(ratio), 0.0143877688 / 630e-9 * (1 / 990. - 1 / 1000.), 0.02);
}

TEST(Spectra, FilesAndMistakes) {
  const TempFiles files;
  const auto read = read_spectrum_file(files.write("a.spd", "# nm value\n400 0.25\n\n700\t0.5\n"));
  ASSERT_EQ(read.size(), 2u);
  EXPECT_EQ(read[1].wavelength, 700);
  EXPECT_EQ(read[1].value, 0.5);
  const auto message = [&](const std::string& content) -> std::string {
    const std::string file = files.write("b.spd", content);
    try {
      read_spectrum_file(file);
    } catch (const InputError& error) {
      return std::string(error.what()).substr(file.size());
    }
    return "no error";
  };
  EXPECT_EQ(message("400 1\n500\n"), ":2:1: error: a line of a spectrum is \"WAVELENGTH VALUE\"");
  EXPECT_EQ(
      message("400 1\n500 x\n"),
      ":2:1: error: a spectrum has wavelengths and values that are finite numbers, not \"x\"");
  EXPECT_EQ(message("400 1\n"), ": error: a spectrum needs two wavelengths at least");
  EXPECT_EQ(message("500 1\n400 1\n"), ": error: the wavelengths of a spectrum must increase");
}

ConductorIndices metal(const std::string& name) {
  test::TestProperties p("bsdf", "roughconductor", {{"material", name}});
  return read_conductor_indices(p);
}

TEST(Indices, Metals) {
  expect_near(metal("Cu_palik").eta, {0.2132, 0.9197, 1.102}, 5e-4);
  expect_near(metal("Te-e").k, {5.584, 4.947, 3.998}, 5e-4);
  expect_near(metal("MgO_palik").eta, metal("MgO").eta, 0);
  expect_near(metal("none").k, {1, 1, 1}, 0);
  EXPECT_THROW(metal("Ag_palik"), InputError);
  EXPECT_THROW(metal("MgO_palik_palik"), InputError);
}

TEST(Indices, Dielectrics) {
  EXPECT_EQ(named_ior("Carbon Dioxide"), 1.00045);
  EXPECT_EQ(named_ior("bk7"), 1.5046);
  EXPECT_EQ(named_ior("cheese"), std::nullopt);
  test::TestProperties p("bsdf", "dielectric", {{"int_ior", "diamond"}, {"ext_ior", 1.5}});
  EXPECT_EQ(read_ior(p, "int_ior", "bk7"), 2.419);
  EXPECT_EQ(read_ior(p, "ext_ior", "air"), 1.5);
  test::TestProperties q("bsdf", "dielectric", {{"int_ior", 0.0}});
  EXPECT_EQ(read_ior(q, "ext_ior", "air"), 1.000277);
  EXPECT_THROW(read_ior(q, "int_ior", "bk7"), InputError);
}

}  // namespace
}  // namespace limn
