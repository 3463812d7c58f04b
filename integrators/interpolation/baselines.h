#pragma once
// Methods that interpolation is compared with: signed distances from the outline (after Wang et al.
// 2009), and rays drawn where the sky is bright and open (after Bashford-Rogers et al. 2013).
#include <vector>

#include "integrators/interpolation/radiance_tables.h"
#include "integrators/interpolation/sky_mesh.h"
#include "limn/core/camera.h"
#include "limn/core/discrete_distribution.h"
#include "limn/core/shading.h"
#include "limn/integrators/run.h"

namespace limn {

class SignedDistances {
 public:
  // Makes the distances of all vertices of the mesh.
  SignedDistances(const Environment& sky, const SkyMesh& mesh, const Contours& contours,
                  int threads);
  // The irradiance at a point of a triangle, whose normal is n.
  Rgb<double> light(const SkyMesh& mesh, const SkyMesh::Spot& spot, const Vec3d& n) const;

 private:
  struct Cell {
    Vec3d w;         // its middle
    SkyLight light;  // of the sky in it
  };
  std::vector<Cell> cells_;
  std::vector<std::vector<float>> distances_;  // vertices by cells, over a cell's height
};

class OpenSkyRays {
 public:
  // The scene and its tracer must outlive it.
  OpenSkyRays(const Scene& scene, const RayTracer& tracer, const CameraView<double>& camera);
  // Light that is scattered to the viewer: by one ray to the sky and one by the BSDF, combined.
  Rgb<double> sample(const SurfacePoint<double>& surface, const Vec3d& up,
                     const Scattering<double>& scattering, Rng rng, RayCount& rays) const;

 private:
  double pdf(const Vec3d& w) const;
  bool open(const SurfacePoint<double>& surface, const Vec3d& up, const Vec3d& w,
            RayCount& rays) const;
  const Scene& scene_;
  const RayTracer& tracer_;
  DiscreteDistribution cells_;
};

}  // namespace limn
