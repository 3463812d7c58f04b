// Signed distances of fixed directions; a path map of the sky.
#include "integrators/interpolation/baselines.h"

#include <algorithm>
#include <cmath>

#include "integrators/paths/camera_path.h"
#include "limn/core/parallel.h"

namespace limn {
namespace {

constexpr int kRows = 32;        // of directions of signed distances
constexpr int kSkyRows = 128;    // of cells of the sky that rays are drawn from
constexpr int kMapRows = 16;     // of the map of where it is open
constexpr double kFloor = 0.05;  // of the mean, where no path was open

Vec3d direction(double column, double row, int rows) {
  const double phi = column * (kPi / rows), theta = row * (kPi / rows);
  return {std::sin(theta) * std::cos(phi), std::cos(theta), std::sin(theta) * std::sin(phi)};
}

size_t cell_of(const Vec3d& w, int rows) {
  const double turn = std::atan2(w.z, w.x) / (2 * kPi);
  const double theta = std::acos(std::clamp(w.y, -1.0, 1.0)) / kPi;
  const int column =
      std::min(static_cast<int>((turn < 0 ? turn + 1 : turn) * 2 * rows), 2 * rows - 1);
  const int row = std::min(static_cast<int>(theta * rows), rows - 1);
  return static_cast<size_t>(row) * 2 * rows + column;
}

double solid_angle(size_t cell, int rows) {
  const auto row = static_cast<double>(cell / (2 * rows));
  return (std::cos(row * kPi / rows) - std::cos((row + 1) * kPi / rows)) * kPi / rows;
}

double distance_to_arc(const Vec3d& w, const Vec3d& a, const Vec3d& b) {
  const Vec3d n = cross(a, b);
  const double size = length(n);
  if (size > 0 && dot(cross(n, a), w) > 0 && dot(cross(b, n), w) > 0) {
    return std::asin(std::min(1.0, std::fabs(dot(n, w)) / size));
  }
  return std::acos(std::clamp(std::fmax(dot(w, a), dot(w, b)), -1.0, 1.0));
}

Vec3d about(const Vec3d& n, double u1, double u2) {
  const double z = std::sqrt(u1), r = std::sqrt(1 - u1), phi = 2 * kPi * u2;
  return Frame(n).to_world({r * std::cos(phi), r * std::sin(phi), z});
}

}  // namespace

SignedDistances::SignedDistances(const Environment& sky, const SkyMesh& mesh,
                                 const Contours& contours, int threads) {
  constexpr int kFine = 8;  // directions of a cell along each side
  for (int j = 0; j < kRows; ++j) {
    for (int i = 0; i < 2 * kRows; ++i) {
      Cell cell{direction(i + 0.5, j + 0.5, kRows), {}};
      const double share = solid_angle(cells_.size(), kRows) / (kFine * kFine);
      for (int k = 0; k < kFine * kFine; ++k) {
        const Vec3d w =
            direction(i + (k % kFine + 0.5) / kFine, j + (k / kFine + 0.5) / kFine, kRows);
        const Rgb<double> light = sky.radiance(w) * share;
        for (int c = 0; c < 3; ++c) {
          const auto l = static_cast<float>(light[c]);
          cell.light.x[c] += l * static_cast<float>(w.x);
          cell.light.y[c] += l * static_cast<float>(w.y);
          cell.light.z[c] += l * static_cast<float>(w.z);
        }
      }
      cells_.push_back(cell);
    }
  }
  distances_.resize(mesh.vertices().size());
  parallel_for(distances_.size(), threads, [&](size_t v) {
    const ContourPoint& at = mesh.vertices()[v].at;
    DirectionLoops loops;
    view_of(mesh.skies()[v], at.p, loops);
    for (const Cell& cell : cells_) {
      double least = kPi;
      loops.for_segments([&](const Vec3d& a, const Vec3d& b) {
        least = std::min(least, distance_to_arc(cell.w, a, b));
      });
      const bool open = dot(at.up, cell.w) > 0 && contours.count(at, cell.w, nullptr) == 0;
      distances_[v].push_back(static_cast<float>((open ? least : -least) * (kRows / kPi)));
    }
  });
}

// A cell counts by how far its middle lies within, over its height.
Rgb<double> SignedDistances::light(const SkyMesh& mesh, const SkyMesh::Spot& spot,
                                   const Vec3d& n) const {
  const auto& v = mesh.patches()[spot.patch].vertices;
  const float* d[] = {distances_[v[0]].data(), distances_[v[1]].data(), distances_[v[2]].data()};
  const auto a = static_cast<float>(spot.weights[0]), b = static_cast<float>(spot.weights[1]);
  const auto c = static_cast<float>(spot.weights[2]);
  SkyLight sum{};
  for (size_t i = 0; i < cells_.size(); ++i) {
    const float share = a * d[0][i] + b * d[1][i] + c * d[2][i] + 0.5f;
    if (share > 0) sum = sum + cells_[i].light * std::min(share, 1.0f);
  }
  return sum.along(n);
}

OpenSkyRays::OpenSkyRays(const Scene& scene, const RayTracer& tracer,
                         const CameraView<double>& camera)
    : scene_(scene), tracer_(tracer) {
  const Film& film = scene.film;
  std::vector<double> open(2 * kMapRows * kMapRows);
  RayCount rays;
  double found = 0;
  for (int y = 0; y < film.crop_height; y += 2) {
    for (int x = 0; x < film.crop_width; x += 2) {
      const auto start = camera.ray(film.crop_x + x + 0.5, film.crop_y + y + 0.5);
      Hit hit;
      const Ray ray = camera_ray(scene, start);
      if (!is_traceable(ray) || !tracer.closest(ray, hit)) continue;
      const auto surface = surface_on_ray<double>(scene, hit.face, start.origin, start.direction);
      const Vec3d up = dot(surface.n_g, start.direction) < 0 ? surface.n_s : -surface.n_s;
      Rng rng(1, static_cast<uint64_t>(y), static_cast<uint64_t>(x));
      for (int k = 0; k < 4; ++k) {
        const double u = rng.uniform();
        const Vec3d w = about(up, u, rng.uniform());
        if (this->open(surface, up, w, rays)) open[cell_of(w, kMapRows)] += 1, found += 1;
      }
    }
  }
  const double floor = kFloor * std::max(found, 1.0) / static_cast<double>(open.size());
  for (int j = 0; j < kSkyRows; ++j) {
    for (int i = 0; i < 2 * kSkyRows; ++i) {
      const Vec3d w = direction(i + 0.5, j + 0.5, kSkyRows);
      double bright = 0;
      for (int k = 0; k < 4; ++k) {
        const auto l = scene.environment->radiance(
            direction(i + 0.25 + 0.5 * (k % 2), j + 0.25 + 0.5 * (k / 2), kSkyRows));
        bright += std::fabs(luminance(l)) + 1e-6;
      }
      const size_t map = cell_of(w, kMapRows);
      cells_.add(bright * solid_angle(cells_.size(), kSkyRows) * (floor + open[map]) /
                 solid_angle(map, kMapRows));
    }
  }
}

bool OpenSkyRays::open(const SurfacePoint<double>& surface, const Vec3d& up, const Vec3d& w,
                       RayCount& rays) const {
  if (!(dot(up, w) > 0)) return false;
  Ray ray{surface.p, w};
  ray.start = surface.start();
  ++rays.shadow;
  return !tracer_.occluded(ray);
}

double OpenSkyRays::pdf(const Vec3d& w) const {
  const size_t cell = cell_of(w, kSkyRows);
  return cells_.probability(cell) / solid_angle(cell, kSkyRows);
}

Rgb<double> OpenSkyRays::sample(const SurfacePoint<double>& surface, const Vec3d& up,
                                const Scattering<double>& scattering, Rng rng,
                                RayCount& rays) const {
  Rgb<double> sum;
  const auto add = [&](const Vec3d& w) {
    const double by_bsdf =
        scattering.bsdf().pdf_solid_angle(scattering.normal(), scattering.wi(), w, scattering.at());
    const Rgb<double> f = scattering.eval(w);
    if (is_black(f) || !open(surface, up, w, rays)) return;
    sum += f * scene_.environment->radiance(w) * (1 / (pdf(w) + by_bsdf));
  };
  const double u1 = rng.uniform(), u2 = rng.uniform();
  const DiscreteDistribution::Draw draw = cells_.sample(u1);
  const auto row = static_cast<double>(draw.index / (2 * kSkyRows));
  const auto column = static_cast<double>(draw.index % (2 * kSkyRows));
  const double c0 = std::cos(row * kPi / kSkyRows), c1 = std::cos((row + 1) * kPi / kSkyRows);
  const double cosine = c0 + (c1 - c0) * draw.fraction;
  add(direction(column + u2, std::acos(cosine) * kSkyRows / kPi, kSkyRows));
  const double u3 = rng.uniform(), u4 = rng.uniform();
  const auto wo =
      scattering.bsdf().sample(scattering.normal(), scattering.wi(), u3, u4, scattering.at());
  if (wo) add(*wo);
  return sum;
}

}  // namespace limn
