// The one door to Embree 3.
#include <embree3/rtcore.h>

#include <algorithm>
#include <string>

#include "limn/core/error.h"
#include "limn/core/ray_tracer.h"

namespace limn {
namespace {

struct Context {
  RTCIntersectContext base;  // first: Embree hands back a pointer to it
  const Ray* ray;
  const Scene* scene;
};

bool is_skipped(const Context& context, FaceRef face) {
  const Ray& ray = *context.ray;
  if (face == ray.start) return true;
  if (ray.skip_emitters && context.scene->shapes[face.shape].is_emitter) return true;
  if (face.shape != ray.skip_shape) return false;
  return std::find(ray.skip_faces.begin(), ray.skip_faces.end(), face.face) != ray.skip_faces.end();
}

void reject_skipped(const RTCFilterFunctionNArguments* arguments) {
  const auto& context = *reinterpret_cast<const Context*>(arguments->context);
  // Only single rays are traced.
  const FaceRef face{RTCHitN_geomID(arguments->hit, 1, 0), RTCHitN_primID(arguments->hit, 1, 0)};
  if (is_skipped(context, face)) arguments->valid[0] = 0;
}

RTCRay to_embree(const Ray& ray) {
  RTCRay r{};
  r.org_x = static_cast<float>(ray.origin.x);
  r.org_y = static_cast<float>(ray.origin.y);
  r.org_z = static_cast<float>(ray.origin.z);
  r.dir_x = static_cast<float>(ray.direction.x);
  r.dir_y = static_cast<float>(ray.direction.y);
  r.dir_z = static_cast<float>(ray.direction.z);
  r.tnear = static_cast<float>(ray.t_min);
  r.tfar =
      ray.t_max > 3e38 ? std::numeric_limits<float>::infinity() : static_cast<float>(ray.t_max);
  r.mask = ~0u;
  return r;
}

class EmbreeTracer final : public RayTracer {
 public:
  EmbreeTracer(const Scene& scene, int threads) : scene_(scene) {
    const std::string config = "threads=" + std::to_string(threads);
    device_ = rtcNewDevice(config.c_str());
    if (!device_) throw InputError("Embree cannot start on this machine");
    rtc_scene_ = rtcNewScene(device_);
    rtcSetSceneFlags(
        rtc_scene_,
        static_cast<RTCSceneFlags>(RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION));
    rtcSetSceneBuildQuality(rtc_scene_, RTC_BUILD_QUALITY_HIGH);
    for (size_t i = 0; i < scene.shapes.size(); ++i) attach(scene.shapes[i].mesh, i);
    rtcCommitScene(rtc_scene_);
  }
  ~EmbreeTracer() override {
    rtcReleaseScene(rtc_scene_);
    rtcReleaseDevice(device_);
  }
  EmbreeTracer(const EmbreeTracer&) = delete;
  EmbreeTracer& operator=(const EmbreeTracer&) = delete;

  bool closest(const Ray& ray, Hit& hit) const override {
    Context context = make_context(ray);
    RTCRayHit query;
    query.ray = to_embree(ray);
    query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    rtcIntersect1(rtc_scene_, &context.base, &query);
    if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return false;
    hit.face = {query.hit.geomID, query.hit.primID};
    hit.t = query.ray.tfar;
    return true;
  }

  bool occluded(const Ray& ray) const override {
    Context context = make_context(ray);
    RTCRay query = to_embree(ray);
    rtcOccluded1(rtc_scene_, &context.base, &query);
    return query.tfar < 0;
  }

 private:
  void attach(const Mesh& mesh, size_t id) {
    RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* vertices = static_cast<Vec3f*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                sizeof(Vec3f), mesh.positions.size()));
    auto* faces = static_cast<FaceIndices*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                sizeof(FaceIndices), mesh.faces.size()));
    if (!vertices || !faces) throw InputError("Embree ran out of memory");
    std::copy(mesh.positions.begin(), mesh.positions.end(), vertices);
    std::copy(mesh.faces.begin(), mesh.faces.end(), faces);
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(rtc_scene_, geometry, static_cast<unsigned>(id));
    rtcReleaseGeometry(geometry);
  }
  Context make_context(const Ray& ray) const {
    Context context;
    rtcInitIntersectContext(&context.base);
    const bool skips =
        ray.start.shape != UINT32_MAX || !ray.skip_faces.empty() || ray.skip_emitters;
    if (skips) context.base.filter = reject_skipped;
    context.ray = &ray;
    context.scene = &scene_;
    return context;
  }

  const Scene& scene_;
  RTCDevice device_ = nullptr;
  RTCScene rtc_scene_ = nullptr;
};

}  // namespace

std::unique_ptr<RayTracer> make_embree_tracer(const Scene& scene, int threads) {
  return std::make_unique<EmbreeTracer>(scene, threads);
}

}  // namespace limn
