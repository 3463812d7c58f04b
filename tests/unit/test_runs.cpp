// What every run promises: the same bits whatever the threads, crops that repeat the full image,
// honest counts when it is stopped or a sample is not finite.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <bit>
#include <map>

#include "integrators/estimates/checksum.h"
#include "integrators/estimates/shared_place.h"
#include "limn/integrators/differences.h"
#include "limn/integrators/gradient.h"
#include "limn/integrators/render.h"
#include "support/compare_moments.h"
#include "support/meshes.h"
#include "support/running_mean.h"
#include "support/scenes.h"

namespace limn {
namespace {

SceneParts small_scene(const TempFiles& files) {
  SceneParts parts;
  parts.width = 40;
  parts.height = 24;
  parts.body = ball_over_gloss(files, 0.2);
  return parts;
}

RunSettings run_settings(int spp, int threads = 1) {
  RunSettings settings;
  settings.spp = spp;
  settings.seed = 3;
  settings.threads = threads;
  return settings;
}

GradientResult run_gradient(const Scene& scene, const RunSettings& settings) {
  GradientOptions options;
  options.parameters = {"ball.translate.x", "sensor.rotate.y"};
  options.block = 8;
  return gradient(scene, options, settings);
}

void expect_same(const Moments& a, const Moments& b) {
  ASSERT_EQ(a.size(), b.size());
  ASSERT_GT(a.size(), 0u);
  for (size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a.mean(i), b.mean(i)) << i;
    // One sample has no variance.
    const bool both_none = std::isnan(a.variance(i)) && std::isnan(b.variance(i));
    if (!both_none) {
      EXPECT_EQ(a.variance(i), b.variance(i)) << i;
    }
  }
}

class Threads : public testing::TestWithParam<int> {};

TEST_P(Threads, SameBits) {
  const TempFiles files;
  const Scene scene = make_scene(files, small_scene(files));
  expect_same(render(scene, run_settings(4)).radiance,
              render(scene, run_settings(4, GetParam())).radiance);
  const RenderOptions even{.generator = "sobol"};
  expect_same(render(scene, run_settings(4), even).radiance,
              render(scene, run_settings(4, GetParam()), even).radiance);
  Scene shared = scene;  // samples
  shared.film.filter = {};
  expect_same(render(shared, run_settings(4), even).radiance,
              render(shared, run_settings(4, GetParam()), even).radiance);
  const GradientResult a = run_gradient(scene, run_settings(4));
  const GradientResult b = run_gradient(scene, run_settings(4, GetParam()));
  expect_same(a.radiance, b.radiance);
  for (size_t k = 0; k < a.parameters.size(); ++k) {
    expect_same(a.parameters[k].total, b.parameters[k].total);
    expect_same(a.parameters[k].total_blocks, b.parameters[k].total_blocks);
    for (size_t t = 0; t < a.terms.size(); ++t) {
      expect_same(a.parameters[k].terms[t], b.parameters[k].terms[t]);
    }
  }
  const auto differences = [&](int threads) {
    return finite_differences(scene, "ball.translate.x", 0.01, 8, run_settings(2, threads));
  };
  expect_same(differences(1).extrapolated.total, differences(GetParam()).extrapolated.total);
}

INSTANTIATE_TEST_SUITE_P(, Threads, testing::Values(2, 7));

// What zlib's crc32 gives, for whole blocks of eight bytes and for rests.
TEST(Runs, ChecksumsAreCrc32) {
  EXPECT_EQ(checksum(""), 0u);
  EXPECT_EQ(checksum("12345678"), 0x9ae0daafu);
  EXPECT_EQ(checksum("123456789"), 0xcbf43926u);
  EXPECT_EQ(checksum("The quick brown fox jumps over the lazy dog"), 0x414fa339u);
}

// Of one to seventeen streams at once: to the bit what each gives by itself.
TEST(Numbers, DrawnAtOnceAreThoseOfTheStreams) {
  for (const bool even : {false, true}) {
    std::vector<Rng> keys;
    std::vector<Rng::Stream> streams;
    for (uint32_t i = 0; i < 17; ++i) {
      keys.push_back(even ? Rng::even(1, i / 3, 1000003 * i) : Rng(1, i / 3, i));
    }
    for (uint64_t i = 0; i < 17; ++i) streams.push_back({&keys[i], i * i});
    for (size_t count = 0; count <= streams.size(); ++count) {
      std::vector<std::array<double, 4>> numbers(count);
      Rng::draw(Purpose::kEmitter, std::span(streams).first(count), numbers.data());
      std::array<double, 1> one;
      for (size_t i = 0; i < count; ++i) {
        Rng rng = keys[i].at(Purpose::kEmitter, streams[i].depth);
        for (const double number : numbers[i]) EXPECT_EQ(number, rng.uniform()) << i << even;
        Rng::draw(Purpose::kEmitter, std::span(streams).subspan(i, 1), &one);
        EXPECT_EQ(one[0], numbers[i][0]);
      }
    }
  }
}

TEST(Numbers, ShortOnesAreMixedAsLongOnes) {
  for (const uint32_t number : {0u, 1u, 77u, UINT32_MAX}) {
    EXPECT_EQ(mix_bits(number), mix_bits(uint64_t{number}));
    EXPECT_TRUE(number == 0 || mix_bits(number) >> 32 != 0);
  }
}

// Of 64 samples that follow each other one lies in every box of 1/64, 1/32 by 1/2, ..., 1 by 1/64.
TEST(EvenNumbers, FillBoxes) {
  constexpr int kLog = 6, kCount = 1 << kLog;
  for (const uint32_t first : {0, kCount, 5 * kCount}) {
    for (int wide = 0; wide <= kLog; ++wide) {
      std::vector<int> boxes(kCount);
      for (uint32_t s = first; s < first + kCount; ++s) {
        Rng rng = Rng::even(1, 2, s).at(Purpose::kBsdf, 3);
        const auto column = static_cast<int>(rng.uniform() * (1 << wide));
        const auto row = static_cast<int>(rng.uniform() * (kCount >> wide));
        ++boxes[(column << (kLog - wide)) + row];
      }
      EXPECT_EQ(boxes, std::vector<int>(kCount, 1)) << first << ' ' << wide;
    }
  }
}

// The paths of four samples, of which each has as many: one of all in every sixteenth, and of the
// first paths one in every quarter.
TEST(EvenNumbers, OfSeveralPathsFillBoxesTogether) {
  constexpr int kCount = 4;
  std::vector<int> boxes(kCount * kCount), of_first(kCount);
  for (uint32_t s = 0; s < kCount; ++s) {
    const Rng key = Rng::even(1, 2, s, kCount);
    for (int path = 0; path < kCount; ++path) {
      const double u = key.path(path).at(Purpose::kFilm, 0).uniform();
      ++boxes[static_cast<size_t>(u * kCount * kCount)];
      if (path == 0) ++of_first[static_cast<size_t>(u * kCount)];
    }
  }
  EXPECT_EQ(boxes, std::vector<int>(kCount * kCount, 1));
  EXPECT_EQ(of_first, std::vector<int>(kCount, 1));
}

// Edges of large meshes are chosen by less than 2^-32.
TEST(EvenNumbers, LieBetweenThoseOf32Bits) {
  RunningMean between;
  for (uint64_t pixel = 0; pixel < 1000; ++pixel) {
    const double u = Rng::even(4, pixel, 7).at(Purpose::kEdge, 1).uniform() * 0x1p32;
    between.add(u - std::floor(u));
  }
  EXPECT_LT(std::fabs(between.z_score(0.5)), 4.5);
}

// Over pixels, a sample's numbers are those of independent streams: in their means, and by pairs
// within a purpose, of two purposes, and of two depths.
TEST(EvenNumbers, AreUniformAndUnrelated) {
  std::vector<RunningMean> means(6), products(36);
  for (int pixel = 0; pixel < 20000; ++pixel) {
    const Rng key = Rng::even(3, pixel, 5);
    std::vector<double> centered;
    for (const auto& [purpose, depth] :
         {std::pair{Purpose::kBsdf, 0}, {Purpose::kEmitter, 0}, {Purpose::kEmitter, 1}}) {
      Rng rng = key.at(purpose, depth);
      for (int k = 0; k < 2; ++k) centered.push_back(rng.uniform() - 0.5);
    }
    for (int i = 0; i < 6; ++i) {
      means[i].add(centered[i]);
      for (int j = 0; j <= i; ++j) products[6 * i + j].add(centered[i] * centered[j]);
    }
  }
  for (int i = 0; i < 6; ++i) {
    EXPECT_LT(std::fabs(means[i].z_score(0)), 4.5) << i;
    for (int j = 0; j <= i; ++j) {
      EXPECT_LT(std::fabs(products[6 * i + j].z_score(i == j ? 1.0 / 12 : 0)), 4.5) << i << j;
    }
  }
}

std::vector<int> batch_ends(int spp, bool even) {
  RunSettings settings;
  settings.spp = spp;
  const Stopwatch watch;
  Schedule schedule(settings, watch, even);
  std::vector<int> ends;
  while (schedule.next()) {
    EXPECT_EQ(schedule.first_sample(), ends.empty() ? 0 : ends.back());
    ends.push_back(schedule.end_sample());
  }
  return ends;
}

// Longer runs begin as shorter ones do, and lose a quarter or less of what they have; they keep
// enough degrees of freedom for a standard error.
class GrowingBatches : public testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(, GrowingBatches, testing::Bool());

TEST_P(GrowingBatches, KeepDegreesOfFreedom) {
  const bool even = GetParam();
  const std::vector<int> longest = batch_ends(5000, even);
  for (const int spp : {1, 2, 8, 16, 33, 64, 100, 256, 1000, 5000}) {
    const std::vector<int> ends = batch_ends(spp, even);
    ASSERT_EQ(ends.back(), spp);
    Moments moments(1);
    for (size_t b = 0; b < ends.size(); ++b) {
      const int first = b > 0 ? ends[b - 1] : 0;
      if (b + 1 < ends.size()) {
        EXPECT_EQ(ends[b], longest[b]);
      }
      EXPECT_LE(ends[b] - first, std::max(1, first / 4));
      if (even && b + 1 < ends.size()) {
        EXPECT_TRUE(std::has_single_bit(static_cast<unsigned>(ends[b] - first)));
      }
      moments.add_batch({0}, ends[b] - first);
    }
    const double least = even ? (spp < 64 ? 6 : 16) : (spp < 64 ? 30 : 40);
    EXPECT_GE(moments.degrees(), std::min(spp - 1.0, least)) << spp;
  }
}

// Of variances v_b of batches the estimate is sum v_b c_b, where c_b is what a batch that is 1
// beside others that are 0 comes to.
TEST(Batches, TellTheVarianceOfTheirMean) {
  const std::vector<int> samples = {1, 1, 1, 1, 2, 2, 4, 4, 8};
  const auto expected = [&](const auto& variance_of_sample) {
    double estimate = 0, truth = 0;
    for (size_t b = 0; b < samples.size(); ++b) {
      Moments moments(1);
      for (size_t other = 0; other < samples.size(); ++other) {
        moments.add_batch({other == b ? 1.0 : 0.0}, samples[other]);
      }
      const double v = samples[b] * variance_of_sample(samples[b]);
      estimate += v * moments.variance(0);
      truth += v / (24.0 * 24.0);
    }
    return estimate / truth;
  };
  EXPECT_NEAR(expected([](int) { return 1.0; }), 1, 1e-12);
  // More even, the more samples: a is 108 / 24^2, b 24 / 9 / 24 of the mean's variance.
  const double a = 108.0 / 576, b = 1.0 / 9;
  EXPECT_NEAR(expected([](int n) { return 1.0 / n; }), 1 + 2 * (a - b) / (1 - a), 1e-12);
}

TEST(Batches, OfWhatIsExactDifferByNothing) {
  Rng rng(1, 2, 3);
  std::vector<double> values;
  for (int i = 0; i < 300; ++i) values.push_back(rng.uniform() - 0.5);
  Moments moments(values.size());
  moments.add_exact(values);
  for (size_t i = 0; i < values.size(); ++i) {
    EXPECT_EQ(moments.mean(i), values[i]);
    EXPECT_EQ(moments.variance(i), 0);
  }
}

TEST(Batches, OfOneSizeHaveADegreeOfFreedomLess) {
  Moments moments(1);
  for (int b = 0; b < 5; ++b) moments.add_batch({0}, 3);
  EXPECT_DOUBLE_EQ(moments.degrees(), 4);
}

// Images of other seeds are independent, so that they tell the true error: it is less than half of
// that of independent samples. What batches differ by does not tell it.
TEST(EvenNumbers, MakeImagesWithLessError) {
  const TempFiles files;
  const Scene scene = make_scene(files, small_scene(files));
  RunSettings settings = run_settings(16);
  Moments images(size_t{3} * scene.film.crop_width * scene.film.crop_height), others = images;
  for (; settings.seed < 11; ++settings.seed) {
    images.add_batch(means(render(scene, settings, {.generator = "sobol"}).radiance), 1);
    others.add_batch(means(render(scene, settings).radiance), 1);
  }
  double true_one = 0, independent = 0;
  for (size_t i = 0; i < images.size(); ++i) {
    true_one += images.variance(i) * 64;
    independent += others.variance(i) * 64;
  }
  EXPECT_LT(true_one, 0.5 * independent);
  EXPECT_GE(compare_moments(images, others).p_largest, 1e-5);
}

// A sample of an even image serves all pixels whose filters reach it: of a gaussian 0.32 pixels
// count, where noise does not depend on the place.
TEST(SharedPlaces, MakeImagesWithLessError) {
  const TempFiles files;
  constexpr int kBorder = 2;
  SceneParts parts = small_scene(files);
  const auto images = [&](const std::string& border, const std::string& generator, int seeds) {
    parts.film = "<rfilter type=\"gaussian\"/>" + border;
    const Scene scene = make_scene(files, parts);
    RunSettings settings = run_settings(16);
    settings.seed = 0;
    Moments moments(size_t{3} * parts.width * parts.height);
    for (; settings.seed < static_cast<uint64_t>(seeds); ++settings.seed) {
      const Moments image = render(scene, settings, {.generator = generator}).radiance;
      std::vector<double> values(image.size());
      for (size_t i = 0; i < image.size(); ++i) values[i] = image.mean(i);
      moments.add_batch(values, 1);
    }
    return moments;
  };
  const auto is_middle = [&](size_t i) {
    const int x = static_cast<int>(i) / 3 % parts.width, y = static_cast<int>(i) / 3 / parts.width;
    return x >= kBorder && y >= kBorder && x < parts.width - kBorder && y < parts.height - kBorder;
  };
  const std::string border = "<boolean name=\"sample_border\" value=\"true\"/>";
  const Moments shared = images(border, "sobol", 30);
  const Moments own = images(border, "independent", 30);
  double middle = 0, margin = 0, of_own_middle = 0, of_own_margin = 0;
  for (size_t i = 0; i < shared.size(); ++i) {
    (is_middle(i) ? middle : margin) += shared.variance(i);
    (is_middle(i) ? of_own_middle : of_own_margin) += own.variance(i);
  }
  fmt::print(
      "squared error over that of independent samples for one pixel: middle {:.3f}, margin "
      "{:.3f}\n",
      middle / of_own_middle, margin / of_own_margin);
  EXPECT_LT(middle, 0.3 * of_own_middle);
  EXPECT_LT(margin, 0.3 * of_own_margin);
  // What serves the middle is the same without samples around the film, but for the order of sums.
  const Moments inside = images("", "sobol", 1), around = images(border, "sobol", 1);
  for (size_t i = 0; i < inside.size(); ++i) {
    if (!is_middle(i)) continue;
    EXPECT_NEAR(inside.mean(i), around.mean(i), 1e-12) << i;
  }
}

// With sample_border the film's outer pixels have their expectations, too.
TEST(SharedPlaces, AroundTheFilmServeItsBorder) {
  const TempFiles files;
  SceneParts parts = small_scene(files);
  parts.film = "<rfilter type=\"gaussian\"/><boolean name=\"sample_border\" value=\"true\"/>";
  const Scene scene = make_scene(files, parts);
  // Sums over the film's outer pixels, of which samples around the film have three tenths.
  const auto sums = [&](const std::string& generator, int spp) {
    RunSettings settings = run_settings(spp);
    Moments moments(1);
    for (settings.seed = 0; settings.seed < 100; ++settings.seed) {
      const Moments image = render(scene, settings, {.generator = generator}).radiance;
      double sum = 0;
      for (int y = 0; y < parts.height; ++y) {
        for (int x = 0; x < parts.width; ++x) {
          if (x > 0 && y > 0 && x < parts.width - 1 && y < parts.height - 1) continue;
          for (int c = 0; c < 3; ++c) sum += image.mean(size_t{3} * (y * parts.width + x) + c);
        }
      }
      moments.add_batch(std::vector<double>{sum}, 1);
    }
    return moments;
  };
  const Moments shared = sums("sobol", 16), own = sums("independent", 16);
  const double error = std::sqrt(shared.variance(0) + own.variance(0));
  EXPECT_LT(error, 0.01 * own.mean(0));
  EXPECT_LT(std::fabs(shared.mean(0) - own.mean(0)), 4.5 * error);
}

// The same for derivatives: expectations of blocks and of the film, and variances.
TEST(SharedPlaces, MakeDerivativesWithLessError) {
  const TempFiles files;
  SceneParts parts = small_scene(files);
  for (const std::string border : {"", "<boolean name=\"sample_border\" value=\"true\"/>"}) {
    parts.film = "<rfilter type=\"gaussian\"/>" + border;
    const Scene scene = make_scene(files, parts);
    GradientOptions options;
    options.parameters = {"ball.translate.x", "ball.translate.y"};
    options.block = 8;
    const auto with = [&](const std::string& method) {
      options.method = Method(method);
      return gradient(scene, options, run_settings(256, 2)).parameters;
    };
    const auto shared = with("adaptive"), own = with("adaptive:generator=independent");
    for (size_t k = 0; k < shared.size(); ++k) {
      double variance = 0, of_own = 0;
      for (size_t i = 0; i < own[k].total.size(); ++i) {
        variance += shared[k].total.variance(i);
        of_own += own[k].total.variance(i);
      }
      fmt::print("{}{}: {:.3f} of the variance\n", shared[k].name, border, variance / of_own);
      EXPECT_LT(variance, 0.4 * of_own);  // even numbers alone: 0.54 to 0.63
      EXPECT_GE(compare_moments(shared[k].total_blocks, own[k].total_blocks).p_largest, 1e-5);
      EXPECT_GE(compare_moments(shared[k].image_sum, own[k].image_sum).p_largest, 1e-5);
    }
  }
}

// Where pixels have different numbers of paths and nothing else is random, weights of samples that
// pixels share must still add up to one: else sums of a film have a hundred times the variance.
TEST(SharedPlaces, LeaveSumsTheirVariance) {
  const TempFiles files;
  SceneParts parts;
  parts.max_depth = 2;
  parts.width = parts.height = 40;
  parts.film = "<rfilter type=\"gaussian\"/>";
  parts.body = square("floor", 8, -90, {0, 0, 0}, diffuse("chalk", "0.5")) +
               square("board", 1, -30, {0.2, 1, 0}, diffuse("clay", "0.5")) +
               R"(<emitter type="point"><point name="position" x="1.4" y="5" z="3"/>
                  <rgb name="intensity" value="20"/></emitter>)";
  const Scene scene = make_scene(files, parts);
  GradientOptions options;
  options.parameters = {"chalk.reflectance"};
  options.samples.reset();
  const auto with = [&](const std::string& method) {
    options.method = Method(method);
    return gradient(scene, options, run_settings(64, 2));
  };
  const GradientResult shared = with("adaptive"), own = with("adaptive:generator=independent");
  const auto& counts = shared.terms[shared.term("interior")].pixel_samples;
  ASSERT_FALSE(counts.empty());
  const auto [least, most] = std::minmax_element(counts.begin(), counts.end());
  EXPECT_GT(*most, *least);
  const ParameterGradient &a = shared.parameters[0], &b = own.parameters[0];
  double variance = 0, of_own = 0;
  for (size_t i = 0; i < a.total.size(); ++i) {
    variance += a.total.variance(i);
    of_own += b.total.variance(i);
  }
  fmt::print("of the variance: pixels {:.3f}, sum {:.3f}\n", variance / of_own,
             a.image_sum.variance(0) / b.image_sum.variance(0));
  EXPECT_LT(variance, 0.2 * of_own);
  EXPECT_LT(a.image_sum.variance(0), b.image_sum.variance(0));
  EXPECT_GE(compare_moments(a.image_sum, b.image_sum).p_largest, 1e-5);
}

// Weights add up to one, and are the filter in the mean: integrals over pixels.
TEST(SharedPlaces, HaveTheWeightsOfTheFilter) {
  for (const Filter& filter :
       {Filter{Filter::Kind::kGaussian, 2.0}, Filter{Filter::Kind::kTent, 1.0},
        Filter{Filter::Kind::kTent, 1.3}, cubic_filter(1.0 / 3, 1.0 / 3), lanczos_filter(3)}) {
    Film film;
    film.filter = filter;
    const int reach = SharedPlace::reach_of(film), side = 2 * reach + 1;
    ASSERT_GT(reach, 0);
    Moments moments(static_cast<size_t>(side) * side);
    for (uint64_t s = 0; s < 20000; ++s) {
      const SharedPlace place(film.filter, reach, Rng(1, 2, s));
      const std::vector<double> weights(place.weights.begin(), place.weights.begin() + side * side);
      double sum = 0;
      for (const double weight : weights) sum += weight;
      EXPECT_NEAR(sum, 1, 1e-12);
      moments.add_batch(weights, 1);
    }
    const auto share = [&](int m) {
      const Filter& f = film.filter;
      return (f.integral(m + 0.5) - f.integral(m - 0.5)) / f.integral(f.radius);
    };
    std::vector<double> exact;
    for (int k = 0; k < side * side; ++k) {
      exact.push_back(share(k / side - reach) * share(k % side - reach));
    }
    EXPECT_TRUE(compare_moments(moments, exact).p_largest >= 1e-5);
  }
}

// Numbers that are spread evenly give places that are; a tent of radius 1, the numbers themselves.
TEST(SharedPlaces, AreInTheOrderOfNumbers) {
  Filter filter;
  std::map<double, double> places;  // by number
  for (uint64_t s = 0; s < 1000; ++s) {
    const Rng key(1, 2, s);
    const double u = key.at(Purpose::kFilm, 0).uniform();
    places[u] = SharedPlace(filter, 2, key).x;
    EXPECT_NEAR(SharedPlace({Filter::Kind::kTent, 1}, 1, key).x, u, 1e-14);
  }
  double before = 0;
  for (const auto& [u, place] : places) {
    EXPECT_LT(before, place) << u;
    before = place;
  }
}

// Pixels whose filters the film cuts have samples of their own.
// Where a filter is negative their weights vary: with a border, all pixels share.
TEST(SharedPlaces, LeaveConstantsExact) {
  const TempFiles files;
  SceneParts parts = small_scene(files);
  parts.body = "<emitter type=\"constant\"><rgb name=\"radiance\" value=\"0.7\"/></emitter>";
  const std::string border = "<boolean name=\"sample_border\" value=\"true\"/>";
  for (const std::string& film :
       {std::string(R"(<rfilter type="gaussian"/>)"), R"(<rfilter type="mitchell"/>)" + border,
        R"(<rfilter type="catmullrom"/>)" + border, R"(<rfilter type="lanczos"/>)" + border}) {
    parts.film = film;
    const Moments image =
        render(make_scene(files, parts), run_settings(3), {.generator = "sobol"}).radiance;
    for (size_t i = 0; i < image.size(); ++i) EXPECT_NEAR(image.mean(i), 0.7, 1e-12);
  }
}

// Samples of a pixel's own agree with shared ones, also where the film cuts a filter.
TEST(SharedPlaces, OfNegativeLobesAgreeWithOwnSamples) {
  const TempFiles files;
  SceneParts parts = small_scene(files);
  for (const char* film : {R"(<rfilter type="mitchell"/>)", R"(<rfilter type="lanczos"/>)"}) {
    parts.film = film;
    const Scene scene = make_scene(files, parts);
    RunSettings settings = run_settings(512);
    const Moments shared = render(scene, settings, {.generator = "sobol"}).radiance;
    settings.seed = 7;
    const Moments own = render(scene, settings, {.generator = "independent"}).radiance;
    EXPECT_GE(compare_moments(shared, own).p_largest, 1e-5) << film;
  }
}

TEST(Seeds, Matter) {
  const TempFiles files;
  const Scene scene = make_scene(files, small_scene(files));
  RunSettings other = run_settings(4);
  other.seed = 4;
  const Moments a = render(scene, run_settings(4)).radiance;
  const Moments b = render(scene, other).radiance;
  size_t equal = 0;
  for (size_t i = 0; i < a.size(); ++i) equal += a.mean(i) == b.mean(i);
  EXPECT_LT(equal, a.size() / 10);
}

class Crop : public testing::TestWithParam<std::string> {};

TEST_P(Crop, IsAPartOfTheFullImage) {
  const TempFiles files;
  SceneParts parts = small_scene(files);
  parts.film = GetParam();
  const Scene full = make_scene(files, parts);
  constexpr int kX = 13, kY = 5, kWidth = 19, kHeight = 15;
  Scene crop = full;
  crop.film.crop_x = kX;
  crop.film.crop_y = kY;
  crop.film.crop_width = kWidth;
  crop.film.crop_height = kHeight;
  const auto cut = [&](size_t i) {
    const size_t x = i / 3 % kWidth + kX;
    const size_t y = i / 3 / kWidth + kY;
    return (y * parts.width + x) * 3 + i % 3;
  };
  const Moments image = render(full, run_settings(2)).radiance;
  const Moments part = render(crop, run_settings(2)).radiance;
  ASSERT_EQ(part.size(), size_t{3 * kWidth * kHeight});
  for (size_t i = 0; i < part.size(); ++i) EXPECT_EQ(part.mean(i), image.mean(cut(i)));

  // The camera term has samples of its own for every film, the others are repeated.
  const GradientResult a = run_gradient(full, run_settings(64));
  const GradientResult b = run_gradient(crop, run_settings(64));
  for (size_t k = 0; k < a.parameters.size(); ++k) {
    for (const size_t term : {a.term("interior"), a.term("boundary")}) {
      const Moments& whole = a.parameters[k].terms[term];
      const Moments& piece = b.parameters[k].terms[term];
      // But for the order of sums.
      for (size_t i = 0; i < piece.size(); ++i) {
        EXPECT_NEAR(piece.mean(i), whole.mean(cut(i)), 1e-12 * (1 + std::fabs(piece.mean(i))));
      }
    }
    const Moments& whole = a.parameters[k].terms[a.term("camera")];
    const Moments& piece = b.parameters[k].terms[a.term("camera")];
    double difference = 0;
    double variance = 0;
    double magnitude = 0;
    for (size_t i = 0; i < piece.size(); ++i) {
      difference += piece.mean(i) - whole.mean(cut(i));
      variance += piece.variance(i) + whole.variance(cut(i));
      magnitude += std::fabs(piece.mean(i));
    }
    EXPECT_GT(magnitude, 0);
    EXPECT_LT(std::fabs(difference) / std::sqrt(variance), 5);
  }
}

INSTANTIATE_TEST_SUITE_P(
    , Crop,
    testing::Values(R"(<rfilter type="box"/>)",
                    R"(<rfilter type="gaussian"/><boolean name="sample_border" value="true"/>)"),
    [](const auto& test) { return test.index == 0 ? "box" : "gaussian"; });

TEST(NonFinite, IsCountedAndLocated) {
  const TempFiles files;
  SceneParts parts = small_scene(files);
  parts.width = parts.height = 8;
  parts.body += square("blinding", 1, 90, {-1, 2.8, 0}, area_light("blaze", "1, 0, 0"));
  Scene scene = make_scene(files, parts);
  // More than an image can hold.
  scene.shapes.back().radiance.r = 1e308;
  const RenderResult r = render(scene, run_settings(16));
  EXPECT_GT(r.non_finite.count, 0u);
  ASSERT_FALSE(r.non_finite.first.empty());
  const NonFinite::SampleId place = r.non_finite.first[0];
  EXPECT_GE(place.x, 0);
  EXPECT_LT(place.x, 8);
  EXPECT_LT(place.sample, 16);
  EXPECT_EQ(place.term, "radiance");
  EXPECT_LE(r.non_finite.first.size(), 10u);
  for (size_t i = 0; i < r.radiance.size(); ++i) EXPECT_TRUE(std::isfinite(r.radiance.mean(i)));

  const GradientResult g = run_gradient(scene, run_settings(16));
  EXPECT_GT(g.non_finite.count, 0u);
  for (const ParameterGradient& p : g.parameters) {
    for (size_t i = 0; i < p.total.size(); ++i) EXPECT_TRUE(std::isfinite(p.total.mean(i)));
  }
}

// Stopped after some batches: exactly the image of that many samples.
TEST(Interruption, KeepsWhatIsDone) {
  const TempFiles files;
  const Scene scene = make_scene(files, small_scene(files));
  std::atomic<bool> stop = false;
  RunSettings settings = run_settings(64);
  settings.interrupted = &stop;
  settings.progress = [&](double done) { stop = done > 0.2; };
  const RenderResult r = render(scene, settings);
  EXPECT_GE(r.spp, 8);
  EXPECT_LE(r.spp, 14);
  EXPECT_EQ(r.radiance.samples(), r.spp);
  expect_same(r.radiance, render(scene, run_settings(static_cast<int>(r.spp))).radiance);

  stop = false;
  const GradientResult g = run_gradient(scene, settings);
  EXPECT_GE(g.spp, 8);
  EXPECT_LE(g.spp, 14);
  const GradientResult whole = run_gradient(scene, run_settings(static_cast<int>(g.spp)));
  expect_same(g.parameters[0].total, whole.parameters[0].total);

  stop = false;
  const DifferenceResult d = finite_differences(scene, "ball.translate.x", 0.01, 8, settings);
  EXPECT_GE(d.spp, 8);
  EXPECT_LE(d.spp, 14);

  stop = true;
  settings.progress = nullptr;
  EXPECT_EQ(render(scene, settings).spp, 0);
}

// Whatever the time allows, the result is that of a run with the same number of samples.
TEST(TimeLimit, GivesTheBitsOfARunWithThatManySamples) {
  const TempFiles files;
  const Scene scene = make_scene(files, small_scene(files));
  RunSettings limited = run_settings(1 << 30, 2);
  limited.seconds = 0.3;
  const GradientResult g = run_gradient(scene, limited);
  EXPECT_GE(g.spp, 1);
  EXPECT_GE(g.seconds, g.setup_seconds);
  const GradientResult whole = run_gradient(scene, run_settings(static_cast<int>(g.spp)));
  EXPECT_EQ(whole.spp, g.spp);
  expect_same(g.parameters[0].total, whole.parameters[0].total);

  const auto differences = [&](const RunSettings& settings) {
    return central_differences(scene, {{find_parameter(scene, "ball.translate.x"), {0.01}, {{1}}}},
                               8, settings, true);
  };
  const CentralDifferences d = differences(limited);
  EXPECT_GE(d.spp, 1);
  expect_same(d.estimates[0][0].total,
              differences(run_settings(static_cast<int>(d.spp))).estimates[0][0].total);
}

TEST(TimeLimit, IsNoMoreThanTheSamples) {
  const TempFiles files;
  const Scene scene = make_scene(files, small_scene(files));
  RunSettings settings = run_settings(3);
  settings.seconds = 3600;
  EXPECT_EQ(render(scene, settings).spp, 3);
  settings.seconds = 1e-9;  // one sample per pixel all the same
  EXPECT_EQ(render(scene, settings).spp, 1);
  EXPECT_EQ(run_gradient(scene, settings).spp, 1);
  settings.least_spp = 2;
  EXPECT_EQ(run_gradient(scene, settings).spp, 2);
}

}  // namespace
}  // namespace limn
