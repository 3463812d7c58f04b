// Frames of lights as meshes of edges without faces.
#include "integrators/terms/light_frames.h"

#include <algorithm>
#include <cmath>

namespace limn {
namespace {

// Of the scene's size: what is nearer to a light than its frame hides it.
constexpr double kNear = 0x1p-16;

// distance: of the corners along the light's axis.
EdgeMesh frame_of(const FramedLight& light, double distance) {
  EdgeMesh mesh;
  mesh.planes.resize(1);  // of no area: no face is around these edges
  mesh.face_offsets = {0};
  for (const Vec3<Dual>& corner : light.corners()) {
    const Vec3<Dual> x = light.origin().v + corner * Dual(distance);
    mesh.positions.push_back(value(x));
    mesh.tangents.push_back({x.x.d, x.y.d, x.z.d});
    mesh.extent = std::max({mesh.extent, std::fabs(x.x.v), std::fabs(x.y.v), std::fabs(x.z.v)});
  }
  for (uint32_t k = 0; k < 4; ++k) {
    Edge edge;
    edge.vertices = {VertexId(k), VertexId((k + 1) % 4)};
    edge.faces = {FaceId(0), FaceId{}};
    edge.edge_class = EdgeClass::kBoundary;
    mesh.edges.push_back(edge);
    mesh.face_offsets.push_back(0);
  }
  return mesh;
}

}  // namespace

LightFrames::LightFrames(const Scene& scene, const EdgeSamplerInput& edges) : edges_(edges) {
  const auto framed = [](const auto& light) {
    return dynamic_cast<const FramedLight*>(light.get());
  };
  if (std::none_of(scene.delta_lights.begin(), scene.delta_lights.end(), framed)) return;
  all_ = edges;
  const double size = scene.shapes.empty() ? 1 : bounds_of(scene).diagonal();
  for (const auto& light : scene.delta_lights) {
    EdgeMesh none;
    none.face_offsets = {0};
    const FramedLight* const of = framed(light);
    all_->objects.push_back(of ? frame_of(*of, kNear * size) : none);
  }
}

const FramedLight* light_of_frame(const Scene& scene, const EdgeSamplerInput& edges,
                                  ShapeId object) {
  const size_t first = edges.objects.size();
  if (object.index() < first) return nullptr;
  return dynamic_cast<const FramedLight*>(scene.delta_lights[object.index() - first].get());
}

}  // namespace limn
