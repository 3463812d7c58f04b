#include "limn/core/lights.h"

#include <algorithm>

#include "limn/core/shading.h"

namespace limn {

Lights::Lights(const Scene& scene) : scene_(scene), inverse_area_(scene.shapes.size(), 0.0) {
  for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
    const Shape& shape = scene.shapes[s];
    if (!shape.is_emitter) continue;
    AreaLight light{s, 0, {}};
    for (uint32_t f = 0; f < shape.mesh.faces.size(); ++f) {
      const auto c = face_corners<double>(shape.mesh, f);
      light.area += 0.5 * length(cross(c[1] - c[0], c[2] - c[0]));
      light.cumulative.push_back(light.area);
    }
    inverse_area_[s] = 1 / light.area;
    area_lights_.push_back(std::move(light));
  }
  count_ = area_lights_.size() + (scene.environment ? 1 : 0);
}

bool Lights::sample(const Vec3d& p, Rng& rng, LightSample& sample) const {
  const double choice = rng.uniform() * count_;
  const size_t index = std::min(static_cast<size_t>(choice), count_ - 1);
  if (index < area_lights_.size()) return sample_area(area_lights_[index], p, rng, sample);
  const double u1 = rng.uniform();
  const double u2 = rng.uniform();
  sample.wo = scene_.environment->sample(u1, u2);
  sample.distance = 1e300;
  sample.pdf = pdf_environment(sample.wo);
  sample.face = {};
  return sample.pdf > 0;
}

bool Lights::sample_area(const AreaLight& light, const Vec3d& p, Rng& rng,
                         LightSample& sample) const {
  const double target = rng.uniform() * light.area;
  const auto found = std::upper_bound(light.cumulative.begin(), light.cumulative.end(), target);
  const auto face = static_cast<uint32_t>(
      std::min<size_t>(found - light.cumulative.begin(), light.cumulative.size() - 1));
  const double root = std::sqrt(rng.uniform());
  const double b2 = root * rng.uniform();
  const auto c = face_corners<double>(scene_.shapes[light.shape].mesh, face);
  const Vec3d y = c[0] + (c[1] - c[0]) * (1 - root) + (c[2] - c[0]) * b2;
  sample.distance = length(y - p);
  if (sample.distance == 0) return false;
  sample.wo = (y - p) / sample.distance;
  sample.face = {light.shape, face};
  const Vec3d n = cross(c[1] - c[0], c[2] - c[0]);
  const double n_length = length(n);
  if (n_length == 0 || dot(n, sample.wo) >= 0) return false;
  sample.pdf = pdf_face(sample.face, n / n_length, sample.wo, sample.distance);
  return true;
}

double Lights::pdf_face(FaceRef face, const Vec3d& n_g, const Vec3d& wo, double distance) const {
  const double cosine = std::fabs(dot(n_g, wo));
  return distance * distance * inverse_area_[face.shape] / (cosine * count_);
}

double Lights::pdf_environment(const Vec3d& wo) const {
  return scene_.environment->pdf_solid_angle(wo) / count_;
}

}  // namespace limn
