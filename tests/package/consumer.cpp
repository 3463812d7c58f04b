// A small program that uses the installed library: renders a scene and prints the mean of its red
// channel, with its standard error.
#include <cmath>
#include <cstdio>

#include "limn/core/scene.h"
#include "limn/integrators/render.h"

int main(int, char** argv) {
  const limn::Scene scene = limn::read_scene(argv[1], {}, nullptr);
  limn::RunSettings settings;
  settings.spp = 256;
  const limn::Moments image = limn::render(scene, settings).radiance;
  double sum = 0, variance = 0;
  for (size_t i = 0; i < image.size(); i += 3) {
    sum += image.mean(i);
    variance += image.variance(i);
  }
  const double pixels = static_cast<double>(image.size()) / 3;
  std::printf("%.9g %.9g\n", sum / pixels, std::sqrt(variance) / pixels);
}
