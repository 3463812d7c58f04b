#pragma once
// Scenes of a white floor with bodies over it, and images of them by the methods that look around.
#include <string>
#include <vector>

#include "limn/integrators/render.h"
#include "support/meshes.h"
#include "support/scenes.h"

namespace limn {

struct Body {
  Mesh mesh;
  double scale = 1;
  Vec3d offset{0, 0, 0};
};
// The floor is the first shape, with y = 0, the bodies are "body0", ...; `more`: lights, further
// shapes. All in units of `unit`, moved by `shift`.
Scene over_floor(const TempFiles& files, const std::vector<Body>& bodies, bool smooth = false,
                 const std::string& more = "", double unit = 1, const Vec3d& shift = {});

// A sky with a sun; returns the emitter.
std::string make_sun(const TempFiles& files, const std::string& id);

// Each method with a seed of its own.
RenderResult run(const Scene& scene, const std::string& method, int spp, RenderOptions options = {},
                 int threads = 1);

// Errors that neighbouring samples' points share make scores smaller than normal, never larger.
void expect_alike(const RenderResult& a, const RenderResult& b, const std::string& what);

}  // namespace limn
