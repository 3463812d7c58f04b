// Images as textures. The texel of column i, row j has its center at u = (i + 1/2) / W,
// v = (j + 1/2) / H, row 0 at v = 0, as in Mitsuba.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "limn/core/image.h"
#include "limn/core/names.h"
#include "src/texture/texels.h"
#include "src/texture/types.h"

namespace limn {
namespace {

enum class Wrap { kRepeat, kMirror, kClamp };

// Two neighbours along one axis, and how far a point lies from the first towards the second.
template <class S>
struct Neighbours {
  uint32_t first, second;
  S share;
};

// The texel that column -1 to `size` stands for (-1 to 2 size, mirrored).
inline uint32_t wrapped(int i, int size, Wrap wrap) {
  if (wrap == Wrap::kRepeat) return static_cast<uint32_t>(i < 0 ? size - 1 : i >= size ? 0 : i);
  if (wrap == Wrap::kMirror && i >= size) i = 2 * size - 1 - i;
  return static_cast<uint32_t>(std::clamp(i, 0, size - 1));
}

// x: texture coordinate along an axis of `size` texels, in units of the image.
template <class S>
S reduced(const S& x, Wrap wrap) {
  const double v = value(x);
  if (wrap == Wrap::kRepeat) return x - std::floor(v);
  if (wrap == Wrap::kMirror) return x - 2 * std::floor(v / 2);
  return v >= 0 && v <= 1 ? x : S(v > 0 ? 1.0 : 0.0);  // beyond, both neighbours are the same
}

template <class S>
[[gnu::always_inline]] inline Neighbours<S> neighbours(const S& x, int size, Wrap wrap) {
  const S place = reduced(x, wrap) * static_cast<double>(size) - 0.5;
  const double first = std::floor(value(place));
  const int i = static_cast<int>(first);
  return {wrapped(i, size, wrap), wrapped(i + 1, size, wrap), place - first};
}

uint32_t nearest(double x, int size, Wrap wrap) {
  const double place = std::floor(reduced(x, wrap) * size);
  return wrapped(static_cast<int>(place), size, wrap);
}

struct Settings {
  bool nearest = false;
  Wrap wrap = Wrap::kRepeat;
  UvTransform to_uv;
  std::string file;
};

class Bitmap final : public Texture {
 public:
  Bitmap(std::shared_ptr<const Texels> texels, Settings settings)
      : texels_(std::move(texels)), settings_(std::move(settings)) {}

  Rgb<double> eval(const TexturePoint<double>& point) const override {
    return of_use(lookup(*texels_, settings_.to_uv(point.uv)));
  }
  Rgb<Dual> eval(const TexturePoint<Dual>& point) const override {
    const std::array<Dual, 2> uv = settings_.to_uv(point.uv);
    Rgb<Dual> v = lookup(*texels_, uv);
    for (int lane = 0; lane < kLanes && texels_move_; ++lane) {
      const auto& tangents = tangents_[static_cast<size_t>(lane)];
      if (!tangents) continue;
      const Rgb<double> d = lookup(*tangents, std::array{value(uv[0]), value(uv[1])});
      for (int c = 0; c < 3; ++c) v[c].d[lane] += d[c];
    }
    return of_use(v);
  }
  void fetch(const TexturePoint<double>& point) const override {
    if (texels_->count() < kFewTexels) return;
    const std::array<double, 2> uv = settings_.to_uv(point.uv);
    const auto x = neighbours(uv[0], texels_->width(), settings_.wrap);
    const auto y = neighbours(uv[1], texels_->height(), settings_.wrap);
    texels_->fetch({x.first, x.second}, {y.first, y.second});
  }
  std::shared_ptr<Texture> for_numbers() const override {
    const auto copy = std::make_shared<Bitmap>(*this);
    copy->of_numbers_ = true;
    return copy;
  }
  Rgb<double> mean() const override { return of_use(texels_->mean()); }
  Range range() const override { return {texels_->least(), texels_->most()}; }
  bool discontinuous_between_texels() const override { return settings_.nearest; }
  // Borders of texels. Where both sides have one value, radiance is continuous.
  bool add_discontinuities(const std::array<std::array<double, 2>, 3>& uv, size_t most,
                           Discontinuities& lines) const override {
    if (!settings_.nearest) return true;
    return add_grid_lines(uv, settings_.to_uv, {texels_->width(), texels_->height()}, most, lines);
  }
  bool has_period_one() const override {
    return settings_.wrap == Wrap::kRepeat && settings_.to_uv.keeps_integers();
  }

  Map map() const override {
    return {texels_->width(), texels_->height(), texels_->mean_magnitude(), valid_.least,
            valid_.most};
  }
  Image texels() const override { return texels_->image(); }
  void set_texels(const Image& texels) override {
    texels_ = std::make_shared<Texels>(texels);
    if (!settings_.file.ends_with(kChanged)) settings_.file += kChanged;
  }
  void add_texel_tangents(const Image& velocity, int lane) override {
    auto& tangents = tangents_[static_cast<size_t>(lane)];
    Image sum = velocity;
    if (tangents) {
      const Image before = tangents->image();
      for (size_t i = 0; i < sum.data.size(); ++i) sum.data[i] += before.data[i];
    }
    tangents = std::make_shared<Texels>(sum);
    texels_move_ = true;
  }
  TexelWeights texel_weights(const TexturePoint<double>& point) const override {
    const std::array<double, 2> uv = settings_.to_uv(point.uv);
    if (settings_.nearest) return {{{nearest_texel(uv), 1}, {0, 0}, {0, 0}, {0, 0}}};
    const auto x = neighbours(uv[0], texels_->width(), settings_.wrap);
    const auto y = neighbours(uv[1], texels_->height(), settings_.wrap);
    const auto at = corners(x, y);
    return {{{at[0], (1 - x.share) * (1 - y.share)},
             {at[1], x.share * (1 - y.share)},
             {at[2], (1 - x.share) * y.share},
             {at[3], x.share * y.share}}};
  }

  std::vector<ParameterRef> parameters() override { return {}; }
  std::shared_ptr<Texture> clone() const override { return std::make_shared<Bitmap>(*this); }
  std::string describe() const override {
    const char* const wraps[] = {"", ", mirror", ", clamp"};  // of Wrap
    return fmt::format("bitmap {} ({} x {}){}{}{}", settings_.file, texels_->width(),
                       texels_->height(), settings_.nearest ? ", nearest" : "",
                       wraps[static_cast<int>(settings_.wrap)], settings_.to_uv.describe());
  }

 private:
  static constexpr const char* kChanged = ", changed";
  static constexpr size_t kFewTexels = 1 << 16;  // mostly in the cache anyway; not tuned

  template <class S>
  Rgb<S> of_use(const Rgb<S>& c) const {
    return of_numbers_ ? grey(luminance(c)) : c;
  }
  template <class S>
  std::array<uint32_t, 4> corners(const Neighbours<S>& x, const Neighbours<S>& y) const {
    const auto width = static_cast<uint32_t>(texels_->width());
    const uint32_t upper = y.first * width, lower = y.second * width;
    return {upper + x.first, upper + x.second, lower + x.first, lower + x.second};
  }
  uint32_t nearest_texel(const std::array<double, 2>& uv) const {
    const uint32_t row = nearest(uv[1], texels_->height(), settings_.wrap);
    return row * static_cast<uint32_t>(texels_->width()) +
           nearest(uv[0], texels_->width(), settings_.wrap);
  }
  // texels: of this size. The slope at the center of a texel is that to its right, or below.
  template <class S>
  Rgb<S> lookup(const Texels& texels, const std::array<S, 2>& uv) const {
    if (settings_.nearest) {
      const Rgb<double> c = texels.texel(nearest(value(uv[0]), texels.width(), settings_.wrap),
                                         nearest(value(uv[1]), texels.height(), settings_.wrap));
      return {c.r, c.g, c.b};
    }
    const Neighbours<S> x = neighbours(uv[0], texels.width(), settings_.wrap);
    const Neighbours<S> y = neighbours(uv[1], texels.height(), settings_.wrap);
    const std::array<FourDoubles, 4> c = texels.square({x.first, x.second}, {y.first, y.second});
    if constexpr (std::is_same_v<S, double>) {
      const FourDoubles top = c[0] + x.share * (c[1] - c[0]);
      const FourDoubles bottom = c[2] + x.share * (c[3] - c[2]);
      const FourDoubles v = top + y.share * (bottom - top);
      return {v[0], v[1], v[2]};
    }
    Rgb<S> v;
    for (int k = 0; k < 3; ++k) {
      const S top = c[0][k] + x.share * (c[1][k] - c[0][k]);
      const S bottom = c[2][k] + x.share * (c[3][k] - c[2][k]);
      v[k] = top + y.share * (bottom - top);
    }
    return v;
  }

  std::shared_ptr<const Texels> texels_;
  Settings settings_;
  bool texels_move_ = false;
  std::array<std::shared_ptr<const Texels>, kLanes> tangents_;  // null: zero in that lane
};

// The index of a word among those that are known.
size_t read_choice(Properties& properties, const std::string& name,
                   const std::vector<std::string>& known) {
  const std::string word = properties.string(name, known[0]);
  const auto found = std::find(known.begin(), known.end(), word);
  if (found == known.end()) properties.fail(name, unknown_name("value", word, known));
  return static_cast<size_t>(found - known.begin());
}

}  // namespace

std::shared_ptr<Texture> read_bitmap(Properties& properties) {
  Settings settings;
  settings.file = properties.file("filename");
  settings.nearest = read_choice(properties, "filter_type", {"bilinear", "nearest"}) == 1;
  settings.wrap =
      static_cast<Wrap>(read_choice(properties, "wrap_mode", {"repeat", "mirror", "clamp"}));
  settings.to_uv = read_to_uv(properties);
  // These choose how texels are stored: here, always as their file has them.
  read_choice(properties, "format", {"auto", "variant", "float16", "fp16", "uint8"});
  properties.boolean("accel", true);
  const bool raw = properties.boolean("raw", false);
  std::shared_ptr<const void>& texels =
      properties.shared(settings.file + (raw ? " (raw texels)" : " (texels)"));
  if (!texels) {
    StoredImage image = read_stored_image(settings.file);
    check_finite(image, settings.file, "the texture");
    if (raw) image.srgb = false;
    texels = std::make_shared<Texels>(image);
  }
  return std::make_shared<Bitmap>(std::static_pointer_cast<const Texels>(texels),
                                  std::move(settings));
}

}  // namespace limn
