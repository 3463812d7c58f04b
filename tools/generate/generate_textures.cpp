// Textures for the bsdfs of scenes: linear reflectances.
#include <algorithm>
#include <cmath>

#include "tools/generate/generate_kinds.h"
#include "tools/generate/generate_parts.h"

namespace limn {
namespace {

using Colour = Rgb<double>;

// colour(u, v) at the middle of every texel, u to the right and v down, both in [0, 1].
template <class F>
Image make_texture(int width, int height, const F& colour) {
  Image image(width, height, 3);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const Colour c = colour((x + 0.5) / width, (y + 0.5) / height);
      for (int k = 0; k < 3; ++k) {
        image.at(x, y, k) = static_cast<float>(std::clamp(c[k], 0.01, 0.95));
      }
    }
  }
  return image;
}

Colour board_colour(double u, double v) {
  constexpr int kBoards = 7;
  const double at = v * kBoards;
  const double board = std::floor(at);
  const double across = at - board;
  // Lines of growth: rings about an axis far below, drawn long.
  const double wander = noise({3 * u + 17 * board, 2.5 * across, 5 * board});
  const double ring =
      std::fabs(across - 0.5 + 0.35 * noise({9.1 * board, 2, 1})) * 9 + 1.6 * wander;
  const double late = std::pow(0.5 + 0.5 * std::sin(2 * kPi * ring), 3);
  const double fibre = noise({30 * u + 7 * board, 90 * across, board}) +
                       0.6 * noise({90 * u, 260 * across, board + 40});
  const double tone = 1 + 0.16 * noise({4.7 * board, 0.3, 8}) + 0.09 * fibre - 0.3 * late;
  const double gap = std::min(across, 1 - across) < 0.012 ? 0.3 : 1;
  return Colour{0.36, 0.19, 0.085} * (tone * gap);
}

// Linen with stripes along both directions; u and v over the whole cloth.
Colour linen_colour(double u, double v) {
  constexpr double kThreads = 170, kChecks = 7;
  const double a = std::sin(kPi * kThreads * u), b = std::sin(kPi * kThreads * v);
  const double weave = 0.9 + 0.1 * std::max(a * a, b * b) + 0.05 * noise({190 * u, 30 * v, 2}) +
                       0.05 * noise({30 * u, 190 * v, 5});
  const auto stripe = [](double x) {
    const double at = x * kChecks - std::floor(x * kChecks);
    const bool broad = std::fabs(at - 0.5) < 0.11;
    const bool fine = std::fabs(std::fabs(at - 0.5) - 0.17) < 0.014;
    return broad || fine ? 1.0 : 0.0;
  };
  const double dyed = 0.5 * (stripe(u) + stripe(v));
  const Colour plain{0.78, 0.74, 0.66}, blue{0.05, 0.11, 0.24};
  return (plain * (1 - dyed) + blue * dyed) * weave;
}

}  // namespace

Image make_boards() { return make_texture(1024, 1024, board_colour); }

Image make_linen() { return make_texture(1024, 1024, linen_colour); }

}  // namespace limn
