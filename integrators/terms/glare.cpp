// Prototype.
#include "integrators/terms/glare.h"

#include <cmath>
#include <cstdio>
#include <cstdlib>

namespace limn {

Glare::Glare(const Scene& scene) {
  if (!scene.environment) return;
  const char* text = getenv("GLARE");
  boost_ = text ? atof(text) : 0;
  if (boost_ <= 0) return;
  rest_ = scene.environment->mean_luminance();
  const auto patches = find_bright_patches(*scene.environment);
  for (const Shape& shape : scene.shapes) {
    const Mesh& mesh = shape.mesh;
    const Bsdf* bsdf = shape.bsdf->side(true);
    if (!bsdf || bsdf->describe().find("conductor") == std::string::npos) continue;
    if (mesh.faces.size() > 2) continue;
    const auto corner = [&](int i) { return cast<double>(mesh.positions[mesh.faces[0][i]]); };
    const Vec3d n = normalize(cross(corner(1) - corner(0), corner(2) - corner(0)));
    for (const BrightPatch& patch : patches) {
      const Vec3d s = patch.cap.axis;
      if (dot(s, n) <= 0.01) continue;
      Image image;
      image.bsdf = bsdf;
      image.n = n;
      image.s = s;
      image.w = s - n * (2 * dot(s, n));
      image.center = (corner(1) + corner(2)) * 0.5;
      image.radius = 0.5 * length(corner(1) - corner(2));
      image.power = patch.luminance * 2 * kPi * (1 - patch.cap.cosine) * 0.8;
      if (images_.size() < kMost) images_.push_back(image);
    }
  }
}

bool Glare::seen(const Image& image, const Vec3d& x) {
  return dot(x - image.center, image.n) > 1e-3 * image.radius;
}

double Glare::pdf(const Image& image, const Vec3d& w) {
  return dot(w, image.n) < 0 ? image.bsdf->pdf_solid_angle(image.n, image.s, -w) : 0;
}

std::optional<Vec3d> Glare::draw(const Mix& mix, double u, double u1, double u2) const {
  for (int i = 0; i < mix.count; ++i) {
    u -= mix.part[i];
    if (u >= 0 && i + 1 < mix.count) continue;
    const Image& image = images_[mix.index[i]];
    const auto wo = image.bsdf->sample(image.n, image.s, u1, u2);
    if (!wo) return {};
    return -*wo;
  }
  return {};
}

}  // namespace limn
