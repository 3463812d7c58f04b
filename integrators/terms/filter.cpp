// What moving positions on the film change in the pixels themselves. A pixel is the integral of
// w f over the film, w its normalised filter, f the radiance there. Positions may move with the
// parameter, dx/dtheta = V(x): the substitution changes no integral, so
//   dI/dtheta = integral of w df/dtheta along (1, V)  +  integral of f div(w V),
// where the first, edges included, is what the other terms add when the camera's rays move with x
// and edges move with v - V. The second is this term. For a V along x, the same for all of a
// pixel, with w = w_x w_y and w_x rising up to its center and falling behind it, layer by layer:
//   integral of f dw_x/dx dx = w_x(0) * mean over u in [0, 1] of f(l(u)) - f(r(u)),
// [l, r] being where w_x >= u w_x(0), cut by what the film has of it. Where w_x ends at once V
// comes to rest (FilmMotion), which is the mean over cuts d in [0, kTaper] before that end. Both
// paths of a pair take the same random numbers: the term is a difference of images a pixel apart,
// without the bias of one. So where detail slides that is finer than a pixel, a V that follows it
// leaves little noise.
#include "integrators/paths/camera_path.h"
#include "integrators/paths/path_follow.h"
#include "integrators/terms/term_table.h"

namespace limn {
namespace {

// Half the width of a layer, a place across, and their weight: their density, layers uniform in u,
// over that of what is drawn.
struct Layer {
  double half, across, weight = 1;
};

// Far out a gaussian holds so little that single pixels would hardly ever meet the edges there that
// other terms do: a tenth is drawn by width.
Layer draw_gaussian(const Filter& filter, const FilterTable& table, const Film::Range& range,
                    double u, double v) {
  constexpr double kByWidth = 0.1;  // not tuned
  const double variance = filter.stddev * filter.stddev, radius = filter.radius;
  const double floor = std::exp(-radius * radius / (2 * variance));
  const double width = range.upper - range.lower;
  Layer layer{};
  if (u < kByWidth) {
    layer.half = radius * (u / kByWidth);
    layer.across = range.lower + width * v;
  } else {
    layer.half =
        std::sqrt(-2 * variance * std::log(floor + (u - kByWidth) / (1 - kByWidth) * (1 - floor)));
    layer.across = table.quantile(range.lower, range.upper, v);
  }
  const double density =
      layer.half / variance * std::exp(-layer.half * layer.half / (2 * variance)) / (1 - floor) *
      filter.eval(layer.across) / (filter.integral(range.upper) - filter.integral(range.lower));
  layer.weight = density / ((1 - kByWidth) * density + kByWidth / (radius * width));
  return layer;
}

// A filter with negative lobes has no layers: pairs are drawn by their width.
Layer draw_signed(const Filter& filter, const FilterTable& table, const Film::Range& range,
                  double u, double v) {
  const double half = filter.radius * u, across = table.quantile(range.lower, range.upper, v);
  return {half, across,
          -filter.slope(half) / filter.eval(0) * filter.radius *
              table.weight(range.lower, range.upper, across)};
}

// u, v in [0, 1); range: across the layers.
Layer draw_layer(const Filter& filter, const FilterTable& table, const Film::Range& range, double u,
                 double v) {
  switch (filter.kind) {
    case Filter::Kind::kBox:
      return {filter.radius, table.quantile(range.lower, range.upper, v)};
    case Filter::Kind::kTent:
      return {filter.radius * (1 - u), table.quantile(range.lower, range.upper, v)};
    case Filter::Kind::kCubic:
    case Filter::Kind::kLanczos:
      return draw_signed(filter, table, range, u, v);
    case Filter::Kind::kGaussian:
      break;
  }
  return draw_gaussian(filter, table, range, u, v);
}

double weight_of(const Lanes& motion, const Lanes& scale) {
  double sum = 0;
  for (int k = 0; k < kLanes; ++k) sum += std::fabs(motion[k]) * scale[k];
  return sum;
}

class FilterTerm final : public Term {
 public:
  explicit FilterTerm(TermInput& input)
      : context_(input.context),
        film_(context_.scene.film),
        lane_scale_(input.lane_scale),
        camera_(context_.scene.camera),
        filter_(film_.filter) {}

  bool uses_moved_pixels() const override { return moves_; }
  void move_film(const FilmMotionAt& motion) override { moves_ = motion != nullptr; }
  void add_at_pixels(std::span<const MovedPixel> pixels, TermCost& cost,
                     std::span<Rgb<Lanes>> sums) const override;
  double work(const TermCost& cost) const override {
    return kRayCost * static_cast<double>(cost.rays);
  }

 private:
  // Rays of paths without derivatives take so much of the time of others.
  static constexpr double kRayCost = 0.5;

  struct Pair {
    FilmPosition left, right;
    Lanes weight;  // of what the left one sees more
  };
  Pair draw(const MovedPixel& pixel) const;

  const PathContext& context_;
  const Film& film_;
  Lanes lane_scale_;
  CameraView<double> camera_;
  FilterTable filter_;
  bool moves_ = false;
};

// One axis, by how far positions move along it.
FilterTerm::Pair FilterTerm::draw(const MovedPixel& pixel) const {
  Rng rng = pixel.key.at(Purpose::kFilm, 1);
  const double along_x = weight_of(pixel.motion.x, lane_scale_);
  const double along_y = weight_of(pixel.motion.y, lane_scale_);
  const double share_x = along_x / (along_x + along_y);
  const bool is_x = rng.uniform() < share_x;
  const auto columns = film_.range_x(pixel.at.x), rows = film_.range_y(pixel.at.y);
  const auto& along = is_x ? columns : rows;
  const auto& across = is_x ? rows : columns;
  const double u = rng.uniform(), v = rng.uniform();
  const Layer layer = draw_layer(film_.filter, filter_, across, u, v);
  const double cut = kTaper * rng.uniform();
  const double lower = along.lower + (ends_at_once(film_.filter, along.lower) ? cut : 0);
  const double upper = along.upper - (ends_at_once(film_.filter, along.upper) ? cut : 0);
  const auto place = [&](double offset) {
    const double x = is_x ? offset : layer.across, y = is_x ? layer.across : offset;
    return FilmPosition{pixel.at.x + 0.5 + x, pixel.at.y + 0.5 + y};
  };
  const double peak = layer.weight * film_.filter.eval(0) /
                      (film_.filter.integral(along.upper) - film_.filter.integral(along.lower));
  return {place(std::max(-layer.half, lower)), place(std::min(layer.half, upper)),
          (is_x ? pixel.motion.x * (peak / share_x) : pixel.motion.y * (peak / (1 - share_x)))};
}

void FilterTerm::add_at_pixels(std::span<const MovedPixel> pixels, TermCost& cost,
                               std::span<Rgb<Lanes>> sums) const {
  using Tracer = PathTracer<double, NoVisitor>;
  static_assert(2 * kMostMovedPixels <= Tracer::kMostWalks);
  std::array<Pair, kMostMovedPixels> pairs;
  std::array<StartRay<double>, 2 * kMostMovedPixels> starts;
  std::vector<Tracer::Walk> walks;
  walks.reserve(2 * pixels.size());
  for (size_t i = 0; i < pixels.size(); ++i) {
    pairs[i] = draw(pixels[i]);
    for (const FilmPosition& at : {pairs[i].left, pairs[i].right}) {
      const auto ray = camera_.ray(at.x, at.y);
      starts[walks.size()] = {camera_ray(context_.scene, ray), ray.origin, ray.direction};
      walks.emplace_back(pixels[i].key, 0, nullptr);
    }
  }
  RayCount rays;
  Tracer tracer(context_, rays);
  tracer.follow_rays({starts.data(), walks.size()}, walks);
  cost.add(rays);
  cost.samples += pixels.size();
  for (size_t i = 0; i < pixels.size(); ++i) {
    const auto &left = walks[2 * i], &right = walks[2 * i + 1];
    for (int c = 0; c < 3; ++c) {
      const double more = left.failed || right.failed
                              ? std::numeric_limits<double>::quiet_NaN()
                              : left.sums.radiance[c] - right.sums.radiance[c];
      sums[i][c] = pairs[i].weight * more;
    }
  }
}

}  // namespace

std::unique_ptr<Term> make_filter_term(TermInput& input) {
  return std::make_unique<FilterTerm>(input);
}

}  // namespace limn
