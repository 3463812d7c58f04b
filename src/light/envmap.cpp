// Environment maps: radiance from an image.
#include <fmt/format.h>

#include "limn/core/check.h"
#include "limn/core/environment.h"
#include "limn/core/mis_compensation.h"
#include "src/light/environment_map.h"
#include "src/light/types.h"

namespace limn {
namespace {

// A rotated map. Copies share the texels, which are immutable.
class MapEnvironment final : public Environment {
 public:
  MapEnvironment(std::shared_ptr<const EnvironmentMap> map, const Vec3d axes[3], double scale,
                 std::string file)
      : map_(std::move(map)),
        drawn_by_(map_),
        axes_{axes[0], axes[1], axes[2]},
        scale_(scale),
        file_(std::move(file)) {}

  Rgb<double> radiance(const Vec3<double>& d) const override {
    return map_->radiance(map_->locate(map_from_world(d))) * scale_.v;
  }
  Rgb<Dual> radiance(const Vec3<Dual>& d) const override {
    const auto place = map_->locate(map_from_world(d));
    return moving({value(place.x), value(place.y)}, map_->radiance(place) * scale_);
  }
  void sample_directions(std::span<const Numbers> u, std::span<Drawn> drawn) const override;
  double pdf_solid_angle(const Vec3d& d) const override {
    const Vec3d v = map_from_world(d);
    return drawn_by_->pdf_solid_angle(density(), map_->locate(v), v);
  }
  std::array<double, 2> find(const Vec3d& d) const override {
    const auto place = map_->locate(map_from_world(d));
    map_->fetch(place, density());
    return {place.x, place.y};
  }
  void find_each(std::span<const Found> found) const override;
  Rgb<double> radiance_at(const Vec3d& d, const std::array<double, 2>& place) const override {
    DCHECK(is_place(d, place));
    return map_->radiance<double>({place[0], place[1]}) * scale_.v;
  }
  void look(const Vec3d& d, const std::array<double, 2>& place,
            Sight<double>& sight) const override {
    look(d, {place[0], place[1]}, scale_.v, sight);
  }
  void look(const Vec3d& d, const std::array<double, 2>& place, Sight<Dual>& sight) const override {
    look(d, {place[0], place[1]}, scale_, sight);
    if (texels_move_) sight.radiance = moving({place[0], place[1]}, sight.radiance);
  }
  bool is_uniform() const override { return false; }
  double mean_luminance() const override { return map_->mean_luminance() * scale_.v; }

  std::optional<Grid> grid() const override {
    return Grid{axes_[1], -axes_[2], axes_[0], map_->width(), map_->height()};
  }

  std::vector<ParameterRef> parameters() override { return {{"scale", {&scale_}}}; }
  Map map() const override { return {map_->width(), map_->height(), map_->mean_magnitude()}; }
  Image texels() const override { return map_->texels(); }
  void set_texels(const Image& texels) override {
    map_ = drawn_by_ = std::make_shared<EnvironmentMap>(texels);
    if (!file_.ends_with(kChanged)) file_ += kChanged;
  }
  void add_texel_tangents(const Image& velocity, int lane) override {
    auto& tangents = tangents_[static_cast<size_t>(lane)];
    Image sum = velocity;
    if (tangents) {
      const Image before = tangents->texels();
      for (size_t i = 0; i < sum.data.size(); ++i) sum.data[i] += before.data[i];
    }
    tangents = std::make_shared<EnvironmentMap>(sum);
    texels_move_ = true;
  }
  std::array<TexelWeight, 4> texel_weights(const Vec3d& d) const override {
    auto weights = map_->weights(map_->locate(map_from_world(d)));
    for (TexelWeight& w : weights) w.weight *= scale_.v;
    return weights;
  }
  std::shared_ptr<Environment> clone() const override {
    return std::make_shared<MapEnvironment>(*this);
  }
  std::shared_ptr<Environment> drawn_by(const MapEnvironment& other) const {
    const auto copy = std::make_shared<MapEnvironment>(*this);
    copy->drawn_by_ = other.drawn_by_;
    return copy;
  }
  std::shared_ptr<Environment> with_peaks() const {
    const auto copy = std::make_shared<MapEnvironment>(*this);
    copy->follows_ = EnvironmentMap::Follows::kPeaks;
    copy->density();  // made now, not among the first samples
    return copy;
  }
  std::string describe() const override {
    return fmt::format("envmap, {} ({} x {}), scale {:g}", file_, map_->width(), map_->height(),
                       scale_.v);
  }

 private:
  Rgb<double> drawn_value(const LightSample& sample) const override {
    return map_->radiance<double>({sample.place[0], sample.place[1]}) * scale_.v;
  }
  Rgb<Dual> drawn_dual(const LightSample& sample) const override {
    const EnvironmentMap::Point<double> place{sample.place[0], sample.place[1]};
    return moving(place, map_->radiance<double>(place) * scale_);
  }
  static constexpr const char* kChanged = ", changed";

  const MapDensity& density() const { return drawn_by_->density(follows_); }
  // Adds the derivatives with respect to texels.
  Rgb<Dual> moving(const EnvironmentMap::Point<double>& place, Rgb<Dual> radiance) const {
    if (!texels_move_) return radiance;
    for (int lane = 0; lane < kLanes; ++lane) {
      if (!tangents_[static_cast<size_t>(lane)]) continue;
      const Rgb<double> v = tangents_[static_cast<size_t>(lane)]->radiance(place);
      for (int c = 0; c < 3; ++c) radiance[c].d[lane] += v[c] * scale_.v;
    }
    return radiance;
  }
  template <class S>
  void look(const Vec3d& d, const EnvironmentMap::Point<double>& place, const S& scale,
            Sight<S>& sight) const {
    DCHECK(is_place(d, {place.x, place.y}));
    sight.radiance = map_->radiance(place) * scale;
    sight.pdf = drawn_by_->pdf_solid_angle(density(), place, map_from_world(d));
  }
  // Up to rounding.
  [[maybe_unused]] bool is_place(const Vec3d& d, const std::array<double, 2>& place) const {
    const Vec3d v = map_from_world(d);
    const auto there = map_->locate(v);
    const double columns = std::remainder(place[0] - there.x, map_->width());
    return std::fabs(columns) * std::hypot(v.x, v.z) < 1e-9 * map_->width() &&
           std::fabs(place[1] - there.y) < 1e-9 * map_->height();
  }
  template <class S>
  Vec3<S> map_from_world(const Vec3<S>& d) const {
    return {dot(d, axes_[0]), dot(d, axes_[1]), dot(d, axes_[2])};
  }

  std::shared_ptr<const EnvironmentMap> map_;
  std::shared_ptr<const EnvironmentMap> drawn_by_;  // has the density of directions
  EnvironmentMap::Follows follows_ = EnvironmentMap::Follows::kRadiance;
  Vec3d axes_[3];  // the map's axes in world space
  Dual scale_;
  std::string file_;
  bool texels_move_ = false;
  std::array<std::shared_ptr<const EnvironmentMap>, kLanes> tangents_;  // null: zero in that lane
};

void MapEnvironment::sample_directions(std::span<const Numbers> u, std::span<Drawn> drawn) const {
  wide::for_blocks(u.size(), [&](size_t first, size_t last) {
    const auto number = [&](int k) {
      return wide::gather([&](int i) { return u[std::min(first + i, last - 1)][k]; });
    };
    const EnvironmentMap::Drawn map = drawn_by_->sample(density(), number(0), number(1));
    const wide::Vec& v = map.direction;
    const wide::Vec w = axes_[0] * v.x + axes_[1] * v.y + axes_[2] * v.z;
    for (size_t i = first; i < last; ++i) {
      const int k = static_cast<int>(i - first);
      drawn[i] = {wide::lane(w, k), map.pdf[k], {map.place.x[k], map.place.y[k]}};
    }
  });
}

void MapEnvironment::find_each(std::span<const Found> found) const {
  wide::for_blocks(found.size(), [&](size_t first, size_t last) {
    const wide::Vec d =
        wide::gather_vectors([&](int i) { return found[std::min(first + i, last - 1)].d; });
    const auto place = map_->locate(map_from_world(d));
    for (size_t i = first; i < last; ++i) {
      const int k = static_cast<int>(i - first);
      map_->fetch({place.x[k], place.y[k]}, density());
      *found[i].place = {place.x[k], place.y[k]};
    }
  });
}

}  // namespace

std::shared_ptr<Environment> make_map_environment(const Image& image, double scale, double turn,
                                                  const std::string& file) {
  const double angle = turn * (kPi / 180), c = std::cos(angle), s = std::sin(angle);
  const Vec3d axes[3] = {{c, 0, -s}, {0, 1, 0}, {s, 0, c}};
  return std::make_shared<MapEnvironment>(std::make_shared<EnvironmentMap>(image), axes, scale,
                                          file);
}

std::shared_ptr<Environment> drawn_alike(const std::shared_ptr<Environment>& moved,
                                         const Environment& unmoved) {
  const auto* map = dynamic_cast<const MapEnvironment*>(moved.get());
  return map ? map->drawn_by(dynamic_cast<const MapEnvironment&>(unmoved)) : moved;
}

std::shared_ptr<Environment> mis_compensated(const std::shared_ptr<Environment>& environment) {
  const auto* map = dynamic_cast<const MapEnvironment*>(environment.get());
  return map ? map->with_peaks() : environment;
}

void read_envmap(Properties& properties, Scene& scene, Shape*) {
  const std::string file = properties.file("filename");
  const double scale = properties.number("scale", 1);
  if (!std::isfinite(scale)) properties.fail("scale", "must be finite");
  Vec3d axes[3];
  read_axes(properties, "an envmap", axes);
  properties.boolean("mis_compensation", false);  // changes the noise alone
  const Image image = read_image(file);
  check_finite(image, file, "the environment map");
  scene.environment =
      std::make_shared<MapEnvironment>(std::make_shared<EnvironmentMap>(image), axes, scale, file);
}

}  // namespace limn
