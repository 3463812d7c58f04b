// What a pilot takes for a part of the light, told by looks whose variances and costs are known.
#include "integrators/pilot/visibility_plan.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>

#include "limn/core/rng.h"

namespace limn {
namespace {

constexpr VisibilityPart kParts[] = {VisibilityPart::kSky};

Film make_film(int width, int height) {
  Film film;
  film.crop_width = width;
  film.crop_height = height;
  return film;
}

// Pixels to the left of `smooth_until` see light that is linear over them, others a step from 0 to
// 1. Lines cost `line_cost` and know what a point sees; a ray sees it with a deviation of `noise`.
struct Looker {
  int smooth_until = 0;
  double line_cost = 100, noise = 1;

  VisibilityProbe operator()(const PixelSample& at, VisibilityPart, int rays, uint64_t number,
                             uint64_t replicate, double reach) const {
    const uint64_t pixel = static_cast<uint64_t>(at.y) << 32 | static_cast<uint32_t>(at.x);
    Rng place = Rng::even(1, pixel, static_cast<uint32_t>(number));
    VisibilityProbe probe;
    probe.x = at.x + 0.5 + reach * (place.uniform() - 0.5);
    probe.y = at.y + 0.5 + reach * (place.uniform() - 0.5);
    const double x = probe.x - at.x;
    double seen = at.x < smooth_until ? x : x > 0.3 ? 1 : 0;
    probe.point_cost = 2;
    probe.cost = rays > 0 ? 2.0 + rays : line_cost;
    Rng rng(2 + replicate, pixel, number);
    for (int k = 0; k < rays; ++k) seen += (rng.uniform() - 0.5) * std::sqrt(12) * noise / rays;
    probe.value = {seen, seen, seen};
    return probe;
  }
};

VisibilityPlan plan_of(const Film& film, const Looker& looker,
                       const std::atomic<bool>* interrupted = nullptr) {
  return plan_visibility(film, kParts, 1, interrupted, looker);
}

VisibilityPlan plan(const Looker& looker, int width = 256, int height = 64, int threads = 1) {
  return plan_visibility(make_film(width, height), kParts, threads, nullptr, looker);
}

TEST(VisibilityPlan, LinesWherePointsAreSmooth) {
  Looker looker;
  looker.smooth_until = 128;
  const VisibilityPlan found = plan(looker);
  EXPECT_EQ(found.look(4, 30, 0).rays, 0);
  EXPECT_GT(found.look(252, 30, 0).rays, 0);
  // The step is where the error is left.
  EXPECT_GT(found.look(252, 30, 0).points, 4 * found.look(4, 30, 0).points);
}

TEST(VisibilityPlan, RaysWhereTheyAreExact) {
  Looker looker;
  looker.smooth_until = 1000;
  looker.noise = 0;
  for (const double cost : {100.0, 1e4}) {
    looker.line_cost = cost;
    EXPECT_GT(plan(looker).look(60, 30, 0).rays, 0);
  }
}

// What is cheap is taken at any noise, and what is dear at none that rays can average away.
TEST(VisibilityPlan, CostsCount) {
  Looker looker;
  looker.line_cost = 4;
  EXPECT_EQ(plan(looker).look(60, 30, 0).rays, 0);
  looker.line_cost = 1e5;
  EXPECT_GT(plan(looker).look(60, 30, 0).rays, 0);
}

// A pixel's three looks by lines mostly miss a narrow step; rays know of it.
TEST(VisibilityPlan, RaysTellOfEdgesThatLinesHaveMissed) {
  struct Narrow : Looker {
    VisibilityProbe operator()(const PixelSample& at, VisibilityPart part, int rays,
                               uint64_t number, uint64_t replicate, double reach) const {
      VisibilityProbe probe = Looker::operator()(at, part, rays, number, replicate, reach);
      if (rays > 0 && probe.x - at.x > 0.9) probe.value = probe.value + Rgb<double>{3, 3, 3};
      return probe;
    }
  };
  Narrow looker;
  looker.smooth_until = 1000;
  const VisibilityPlan found = plan_visibility(make_film(256, 64), kParts, 1, nullptr, looker);
  EXPECT_GT(found.look(60, 30, 0).rays, 0);
  const VisibilityPlan blind = plan(static_cast<const Looker&>(looker));
  EXPECT_EQ(blind.look(60, 30, 0).rays, 0);
}

// One sample that is not finite, by rays or by lines, changes little.
TEST(VisibilityPlan, OneBadSampleDoesNotSpoilIt) {
  struct Broken : Looker {
    double bad = 0;
    bool by_rays = false;
    VisibilityProbe operator()(const PixelSample& at, VisibilityPart part, int rays,
                               uint64_t number, uint64_t replicate, double reach) const {
      VisibilityProbe probe = Looker::operator()(at, part, rays, number, replicate, reach);
      if (at.x / 8 == 5 && at.y / 8 == 5 && number == 0 && replicate == 1 &&
          (rays > 0) == by_rays) {
        probe.value.g = bad;
      }
      return probe;
    }
  };
  Broken looker;
  looker.smooth_until = 128;
  const VisibilityPlan right = plan(static_cast<const Looker&>(looker));
  for (const double bad : {std::nan(""), HUGE_VAL, -HUGE_VAL}) {
    for (const bool by_rays : {true, false}) {
      looker.bad = bad, looker.by_rays = by_rays;
      const VisibilityPlan found = plan_visibility(make_film(256, 64), kParts, 1, nullptr, looker);
      // Behind the windows of means that it lies in all is as it was.
      for (const int x : {4, 252}) {
        EXPECT_EQ(found.look(x, 4, 0).rays, right.look(x, 4, 0).rays) << bad << by_rays;
      }
      EXPECT_GT(found.look(252, 30, 0).points, 4 * found.look(4, 30, 0).points) << bad << by_rays;
    }
  }
}

// Cells count from the crop's corner, and pixels from the film's.
TEST(VisibilityPlan, CropsHaveTheirOwnCells) {
  Looker looker;
  looker.smooth_until = 99 + 128;
  Film film = make_film(258, 35);
  film.crop_x = 99, film.crop_y = 203;
  const VisibilityPlan found = plan_of(film, looker);
  EXPECT_EQ(found.grid.x0, 99);
  EXPECT_EQ(found.grid.y0, 203);
  ASSERT_EQ(found.looks.size(), 33u * 5);
  EXPECT_EQ(&found.look(99, 203, 0), &found.looks.front());
  EXPECT_EQ(&found.look(356, 237, 0), &found.looks.back());
  EXPECT_EQ(found.look(99, 220, 0).rays, 0);
  EXPECT_GT(found.look(356, 220, 0).rays, 0);
}

TEST(VisibilityPlan, FilmsOfLessThanACell) {
  Looker looker;
  for (const auto& [width, height] : {std::pair{1, 1}, {3, 1}, {1, 20}}) {
    looker.smooth_until = 1000;
    EXPECT_EQ(plan(looker, width, height).look(width - 1, height - 1, 0).rays, 0);
    looker.smooth_until = 0;
    EXPECT_GT(plan(looker, width, height).look(width - 1, height - 1, 0).rays, 0);
  }
}

// What an interrupt leaves has all that a plan has.
TEST(VisibilityPlan, Interrupted) {
  const std::atomic<bool> interrupted = true;
  const VisibilityPlan found = plan_of(make_film(65, 37), {}, &interrupted);
  ASSERT_EQ(found.looks.size(), 9u * 5);
  for (const VisibilityLook& look : found.looks) {
    EXPECT_GE(look.rays, 0);
    EXPECT_EQ(look.points, 1);
  }
}

TEST(VisibilityPlan, ThreadsDoNotMatter) {
  Looker looker;
  looker.smooth_until = 30;
  const VisibilityPlan one = plan(looker, 65, 37), three = plan(looker, 65, 37, 3);
  ASSERT_EQ(one.looks.size(), 9u * 5);
  for (size_t i = 0; i < one.looks.size(); ++i) {
    EXPECT_EQ(one.looks[i].rays, three.looks[i].rays);
    EXPECT_EQ(one.looks[i].points, three.looks[i].points);
  }
}

}  // namespace
}  // namespace limn
