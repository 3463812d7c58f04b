// Ray tracing with Embree 3 or 4; the only file that includes it.
#if __has_include(<embree3/rtcore.h>)
#include <embree3/rtcore.h>
#else
#include <embree4/rtcore.h>
#endif

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <mutex>
#include <string>
#include <type_traits>

#include "limn/core/blur_tracer.h"
#include "limn/core/box_tree.h"
#include "limn/core/check.h"
#include "limn/core/error.h"
#include "limn/core/exposure.h"
#include "limn/core/face_overlaps.h"
#include "limn/core/parallel.h"
#include "limn/core/ray_tracer.h"
#include "limn/core/touch.h"

namespace limn {
namespace {

// What versions 3 and 4 call differently. A filter is the context's in 3, the query's in 4.
#if RTC_VERSION_MAJOR == 3
using QueryContext = RTCIntersectContext;
constexpr int kFilterOfQuery = RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION;
void start(QueryContext& context, RTCFilterFunctionN filter) {
  rtcInitIntersectContext(&context);
  context.filter = filter;
}
void go_together(QueryContext& context) { context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT; }
void intersect(RTCScene scene, QueryContext& context, RTCRayHit& query) {
  rtcIntersect1(scene, &context, &query);
}
void occlude(RTCScene scene, QueryContext& context, RTCRay& query) {
  rtcOccluded1(scene, &context, &query);
}
void intersect(const int* valid, RTCScene scene, QueryContext& context, RTCRayHit8& queries) {
  rtcIntersect8(valid, scene, &context, &queries);
}
void occlude(const int* valid, RTCScene scene, QueryContext& context, RTCRay8& queries) {
  rtcOccluded8(valid, scene, &context, &queries);
}
#else
struct QueryContext {
  RTCRayQueryContext base;
  RTCFilterFunctionN filter;
  bool together;
};
constexpr int kFilterOfQuery = RTC_SCENE_FLAG_FILTER_FUNCTION_IN_ARGUMENTS;
void start(QueryContext& context, RTCFilterFunctionN filter) {
  rtcInitRayQueryContext(&context.base);
  context.filter = filter;
  context.together = false;
}
void go_together(QueryContext& context) { context.together = true; }
template <class Arguments>
void set(Arguments& arguments, QueryContext& context) {
  arguments.context = &context.base;
  arguments.filter = context.filter;
  unsigned flags = RTC_RAY_QUERY_FLAG_NONE;
  if (context.filter) flags |= RTC_RAY_QUERY_FLAG_INVOKE_ARGUMENT_FILTER;
  if (context.together) flags |= RTC_RAY_QUERY_FLAG_COHERENT;
  arguments.flags = static_cast<RTCRayQueryFlags>(flags);
}
void intersect(RTCScene scene, QueryContext& context, RTCRayHit& query) {
  RTCIntersectArguments arguments;
  rtcInitIntersectArguments(&arguments);
  set(arguments, context);
  rtcIntersect1(scene, &query, &arguments);
}
void occlude(RTCScene scene, QueryContext& context, RTCRay& query) {
  RTCOccludedArguments arguments;
  rtcInitOccludedArguments(&arguments);
  set(arguments, context);
  rtcOccluded1(scene, &query, &arguments);
}
void intersect(const int* valid, RTCScene scene, QueryContext& context, RTCRayHit8& queries) {
  RTCIntersectArguments arguments;
  rtcInitIntersectArguments(&arguments);
  set(arguments, context);
  rtcIntersect8(valid, scene, &queries, &arguments);
}
void occlude(const int* valid, RTCScene scene, QueryContext& context, RTCRay8& queries) {
  RTCOccludedArguments arguments;
  rtcInitOccludedArguments(&arguments);
  set(arguments, context);
  rtcOccluded8(valid, scene, &queries, &arguments);
}
#endif
constexpr size_t kPacket = RayTracer::kTogether;

struct Context {
  QueryContext base;  // must be first: Embree passes back a pointer to it
  const Ray* ray;
  const Scene* scene;
  const DuplicateFaces* copies;
  // Coplanar and near faces of the ray's start face and of its end face.
  std::span<const FaceRef> beside_start, beside_end;
  double reach;  // hits nearer to an end of the ray may be rounding
};

// True if the ray ignores the set of duplicates that `face` represents.
bool is_skipped_place(const Context& context, FaceRef face) {
  const Ray& ray = *context.ray;
  const auto is_here = [&](FaceRef other) {
    return other.shape.valid() && context.copies->first(other) == face;
  };
  return is_here(ray.start) || is_here(ray.end) ||
         std::any_of(ray.skip_faces.begin(), ray.skip_faces.end(), is_here) ||
         !context.copies->met(face, ray.direction, ray.skip_emitters);
}

bool is_skipped(const Context& context, FaceRef face) {
  const Ray& ray = *context.ray;
  const auto is_among = [&](std::span<const FaceRef> faces) {
    return std::find(faces.begin(), faces.end(), face) != faces.end();
  };
  if (is_among(context.beside_start) || is_among(context.beside_end)) return true;
  if (!context.copies->empty()) return is_skipped_place(context, face);
  if (face == ray.start || face == ray.end) return true;
  if (ray.skip_emitters && context.scene->shape(face.shape).is_emitter) return true;
  return is_among(ray.skip_faces);
}

// True if a ray that leaves `point` of face `from` towards `direction` cannot meet `face`, because
// all of that lies in the plane of `from` or behind it, up to the rounding of positions. False for
// points off that plane. Near a side of `from` Embree's floats may meet its neighbour all the same.
bool is_behind(const Scene& scene, FaceRef from, const Vec3d& point, const Vec3d& direction,
               FaceRef face) {
  const auto a = face_corners<double>(scene.shape(from.shape).mesh, from.face);
  const auto b = face_corners<double>(scene.shape(face.shape).mesh, face.face);
  Vec3d n = normalize(cross(a[1] - a[0], a[2] - a[0]));
  if (dot(n, direction) < 0) n = -n;
  const double tolerance = touch_tolerance(largest_coordinate(a), largest_coordinate(b));
  return std::fabs(dot(n, point - a[0])) <= tolerance &&
         std::all_of(b.begin(), b.end(),
                     [&](const Vec3d& x) { return dot(n, x - a[0]) <= tolerance; });
}

// True if rounding makes the ray meet a neighbour of its start or end face where it leaves the one
// or arrives on the other.
bool is_rounding(const Context& context, FaceRef face, double t) {
  const Ray& ray = *context.ray;
  if (t <= context.reach && ray.start.shape.valid() &&
      is_behind(*context.scene, ray.start, ray.origin, ray.direction, face))
    return true;
  return t >= ray.t_max - context.reach && ray.end.shape.valid() &&
         is_behind(*context.scene, ray.end, ray.origin + ray.direction * ray.t_max, -ray.direction,
                   face);
}

// The face that Embree names. Shapes in coordinates of their own are instances, and so are all
// together that stand still: that has a number behind the shapes'.
FaceRef face_of(const Scene& scene, uint32_t instance, uint32_t geometry, uint32_t primitive) {
  return {ShapeId(instance < scene.shapes.size() ? instance : geometry), FaceId(primitive)};
}

void reject_skipped(const RTCFilterFunctionNArguments* arguments) {
  const auto& context = *reinterpret_cast<const Context*>(arguments->context);
  // Rays are traced one at a time.
  const FaceRef face =
      face_of(*context.scene, RTCHitN_instID(arguments->hit, 1, 0, 0),
              RTCHitN_geomID(arguments->hit, 1, 0), RTCHitN_primID(arguments->hit, 1, 0));
  if (is_skipped(context, face) || is_rounding(context, face, RTCRayN_tfar(arguments->ray, 1, 0)))
    arguments->valid[0] = 0;
}

struct PacketContext {
  QueryContext base;  // first, as in Context
  std::array<Context, kPacket> rays;
};

void reject_skipped_of_packet(const RTCFilterFunctionNArguments* arguments) {
  const auto& packet = *reinterpret_cast<const PacketContext*>(arguments->context);
  const unsigned n = arguments->N;
  for (unsigned i = 0; i < n; ++i) {
    if (arguments->valid[i] == 0) continue;
    const Context& context = packet.rays[RTCRayN_id(arguments->ray, n, i)];
    const FaceRef face =
        face_of(*context.scene, RTCHitN_instID(arguments->hit, n, i, 0),
                RTCHitN_geomID(arguments->hit, n, i), RTCHitN_primID(arguments->hit, n, i));
    if (is_skipped(context, face) || is_rounding(context, face, RTCRayN_tfar(arguments->ray, n, i)))
      arguments->valid[i] = 0;
  }
}

RTCRay to_embree(const Ray& ray, const Vec3d& origin) {
  // The only place where rays enter Embree, which may crash on invalid ones.
  if (!is_traceable(ray)) [[unlikely]]
    throw UntraceableRay();
  // The rounding error of a unit direction in floats is below this.
  DCHECK_LE(std::fabs(length_squared(ray.direction) - 1), 0x1p-20);
  // Writes four numbers at once, as Embree reads them: four narrow stores would stall its wide
  // load.
  using Four [[gnu::vector_size(16)]] = float;
  const Four from = {static_cast<float>(ray.origin.x - origin.x),
                     static_cast<float>(ray.origin.y - origin.y),
                     static_cast<float>(ray.origin.z - origin.z), static_cast<float>(ray.t_min)};
  const Four along = {static_cast<float>(ray.direction.x), static_cast<float>(ray.direction.y),
                      static_cast<float>(ray.direction.z), 0};
  RTCRay r;
  std::memcpy(&r.org_x, &from, sizeof(from));
  std::memcpy(&r.dir_x, &along, sizeof(along));
  r.tfar =
      ray.t_max > 3e38 ? std::numeric_limits<float>::infinity() : static_cast<float>(ray.t_max);
  r.mask = ~0u;
  r.id = 0;
  r.flags = 0;
  return r;
}

// Hits within this share of the scene's size of an end of the ray may be rounding: the rounding of
// floats, 2^-22, over the cosines of rays that graze less than 2^-10. Others are not looked at.
constexpr double kReach = 0x1p-12;

// The origin of Embree's coordinates: nonzero on axes where the scene is far from 0 compared with
// its size. Subtraction is exact for floats between half and twice this value (Sterbenz 1974). Ray
// origins thus keep their precision.
Vec3d origin_of(const Scene& scene, const Bounds& bounds) {
  Vec3d origin;
  if (scene.shapes.empty()) return origin;
  const Vec3d center = bounds.center();
  constexpr double kFar = 8;  // in diagonals; must be at least 1 (Sterbenz), else not tuned
  for (int k = 0; k < 3; ++k)
    if (std::fabs(center[k]) > kFar * bounds.diagonal()) origin[k] = static_cast<float>(center[k]);
  return origin;
}

// Coordinates for a mesh of slivers that lie askew; none for other meshes.
std::optional<OrientedBox> frame_of(const Mesh& mesh) {
  constexpr size_t kMost = 4096;  // faces that tell slivers; not tuned
  std::vector<FaceCorners> faces;
  const size_t step = mesh.faces.size() / kMost + 1;
  for (size_t f = 0; f < mesh.faces.size(); f += step)
    faces.push_back(face_corners<double>(mesh, FaceId(static_cast<uint32_t>(f))));
  return box_of_slivers(faces);
}

struct Release {
  void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
  void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
  void operator()(RTCGeometry geometry) const { rtcReleaseGeometry(geometry); }
};
template <class Handle>
using Owned = std::unique_ptr<std::remove_pointer_t<Handle>, Release>;

// Embree's first error message. Any of its threads may report.
class EmbreeErrors {
 public:
  // Embree's callback; `self` is an EmbreeErrors.
  static void note(void* self, RTCError /*code*/, const char* text) {
    auto& errors = *static_cast<EmbreeErrors*>(self);
    const std::lock_guard lock(errors.mutex_);
    if (errors.first_.empty()) errors.first_ = text && *text ? text : "unknown error";
  }
  void check() {
    const std::lock_guard lock(mutex_);
    if (!first_.empty()) throw InputError("Embree: " + first_);
  }

 private:
  std::mutex mutex_;
  std::string first_;
};

class EmbreeDevice {
 public:
  EmbreeDevice() {
    // Without a number of threads: Embree would limit all of TBB to the machine's cores by it.
    device_.reset(rtcNewDevice(nullptr));
    if (!device_) throw InputError("Embree cannot start on this machine");
    rtcSetDeviceErrorFunction(device_.get(), EmbreeErrors::note, &errors_);
  }
  RTCDevice get() const { return device_.get(); }
  void check() { errors_.check(); }

 private:
  EmbreeErrors errors_;  // must be declared before the device that reports to it
  Owned<RTCDevice> device_;
};

}  // namespace

// Shapes that stand still, ready to be traced.
struct KeptShapes {
  EmbreeDevice device;
  std::mutex mutex;  // of all below
  Vec3d origin;
  std::vector<bool> still;                                          // of each shape: it is here
  std::vector<SharedVector<Vec3f>> positions;                       // of each shape
  std::vector<std::pair<uint32_t, Owned<RTCGeometry>>> geometries;  // by their numbers

  // Whether its shapes are those of the scene; what has moved is no longer one.
  bool holds(const Scene& scene, const Vec3d& scene_origin) {
    bool same = !positions.empty() && origin == scene_origin;
    for (size_t s = 0; s < scene.shapes.size(); ++s) {
      if (still.size() == s) still.push_back(!scene.exposure->shapes[s].moves());
      if (!same || !still[s]) continue;
      still[s] = positions[s] == scene.shapes[s].mesh.positions;
      same = still[s];
    }
    return same;
  }
};

std::shared_ptr<KeptShapes> make_kept_shapes() { return std::make_shared<KeptShapes>(); }

namespace {

class EmbreeTracer final : public RayTracer {
 public:
  EmbreeTracer(const Scene& scene, int threads, std::shared_ptr<const CoincidentFaces> faces)
      : scene_(scene),
        faces_(faces             ? std::move(faces)
               : has_none(scene) ? scene.exposure->no_overlaps
                                 : std::make_shared<CoincidentFaces>(scene, threads)),
        copies_(faces_->copies),
        overlaps_(faces_->overlaps),
        settles_(!copies_.empty() || !overlaps_.empty()),
        bounds_(bounds_of(scene)),
        origin_(origin_of(scene, bounds_)),
        reach_(kReach * bounds_.diagonal()),
        device_(device_of(scene)),
        rtc_scene_(make_scene(quality())) {
    const std::vector<bool> held = attach_kept(threads);
    for (uint32_t i = 0; i < scene.shapes.size(); ++i) {
      if (held[i]) continue;
      const Owned<RTCGeometry> geometry = make_shape(ShapeId(i), threads);
      attach(rtc_scene_.get(), geometry.get(), i);
    }
    commit(rtc_scene_.get(), threads);
  }

  bool closest(const Ray& ray, Hit& hit) const override {
    Context context = make_context(ray);
    RTCRayHit query;
    query.ray = to_embree(ray, origin_);
    query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    intersect(rtc_scene_.get(), context.base, query);
    const bool found = query.hit.geomID != RTC_INVALID_GEOMETRY_ID;
    if (found) {
      hit.face = face_of(scene_, query.hit.instID[0], query.hit.geomID, query.hit.primID);
      hit.t = query.ray.tfar;
      settle(ray, hit);
    }
    if (!settles_) [[likely]]
      return found;
    Hit left = found ? hit : Hit{{}, ray.t_max};
    if (!overlaps_.leave(ray, left)) return found;
    hit = left;
    return true;
  }

  bool occluded(const Ray& ray) const override {
    if (settles_ && is_hidden_by_near(ray)) [[unlikely]]
      return true;
    Context context = make_context(ray);
    RTCRay query = to_embree(ray, origin_);
    occlude(rtc_scene_.get(), context.base, query);
    return query.tfar < 0;
  }

  void closest_each(std::span<RayQuery> queries) const override {
    for_packets(
        queries, [&](auto packet) { closest_packet(packet); },
        [&](RayQuery& query) { closest_alone(query); });
  }

  void occluded_each(std::span<RayQuery> queries) const override {
    for_packets(
        queries, [&](auto packet) { occluded_packet(packet); },
        [&](RayQuery& query) { occluded_alone(query); });
  }

  bool overlap(FaceRef a, FaceRef b) const override { return settles_ && overlaps_.contains(a, b); }
  void settle(const Ray& ray, Hit& hit) const override {
    if (settles_) [[unlikely]]
      overlaps_.settle(ray, hit);
  }

 private:
  // Few rays are faster one by one, with the same bits.
  template <class Packet, class Alone>
  static void for_packets(std::span<RayQuery> queries, const Packet& packet, const Alone& alone) {
    constexpr size_t kFewest = 4;  // not tuned
    while (!queries.empty()) {
      const auto next = queries.first(std::min(kPacket, queries.size()));
      if (next.size() >= kFewest) {
        packet(next);
      } else {
        std::for_each(next.begin(), next.end(), alone);
      }
      queries = queries.subspan(next.size());
    }
  }
  // The origin of Embree's coordinates for a ray, so moved that it starts above its face by four
  // roundings of its own coordinates: then almost no ray meets that face. By the scene's size, rays
  // would start beyond what is close to them in large scenes.
  Vec3d origin_for(const RayQuery& query) const {
    if (!query.ray.start.shape.valid()) return origin_;
    const Vec3d& n = query.normal;
    const Vec3d from = query.ray.origin - origin_;
    const double largest = std::max({std::fabs(from.x), std::fabs(from.y), std::fabs(from.z)});
    return origin_ - n * std::copysign(0x1p-22 * largest, dot(n, query.ray.direction));
  }
  // Writes the rays of a packet. Sets valid to 0 for rays that cannot be traced.
  template <class Rays>
  void put(std::span<RayQuery> queries, int* valid, Rays& rays) const {
    for (size_t i = 0; i < kPacket; ++i) {
      valid[i] = i < queries.size() && is_traceable(queries[i].ray) ? -1 : 0;
      if (valid[i] == 0) continue;
      const Ray& ray = queries[i].ray;
      const Vec3d from = ray.origin - origin_for(queries[i]);
      rays.org_x[i] = static_cast<float>(from.x);
      rays.org_y[i] = static_cast<float>(from.y);
      rays.org_z[i] = static_cast<float>(from.z);
      rays.dir_x[i] = static_cast<float>(ray.direction.x);
      rays.dir_y[i] = static_cast<float>(ray.direction.y);
      rays.dir_z[i] = static_cast<float>(ray.direction.z);
      rays.tnear[i] = static_cast<float>(ray.t_min);
      rays.tfar[i] =
          ray.t_max > 3e38 ? std::numeric_limits<float>::infinity() : static_cast<float>(ray.t_max);
      rays.time[i] = 0;
      rays.mask[i] = ~0u;
      rays.id[i] = static_cast<unsigned>(i);
      rays.flags[i] = 0;
    }
  }
  // Whether rays go side by side, as a camera's and those to a lamp without extent do: a packet
  // then descends Embree's tree as one, which takes 0.4 of the time and finds the same hits, but
  // for which face a ray meets exactly at an edge. Others would take 1.4 of it. Not tuned.
  bool go_side_by_side(std::span<const RayQuery> queries) const {
    constexpr double kCosine = 0.99, kShare = 1.0 / 64;  // of the scene's size, for their origins
    const Ray& first = queries.front().ray;
    const double reach = kShare * bounds_.diagonal();
    return std::all_of(queries.begin(), queries.end(), [&](const RayQuery& query) {
      return dot(query.ray.direction, first.direction) > kCosine &&
             length_squared(query.ray.origin - first.origin) < reach * reach;
    });
  }
  // Takes the hit that a ray has without a filter. A ray that meets a face that it ignores, which
  // is rare, is traced again.
  void take(RayQuery& query, FaceRef face, double t) const {
    query.found = face.shape.valid();
    if (query.found) {
      query.hit = {face, t};
      const Context own = make_context(query.ray);
      if (own.base.filter && (is_skipped(own, face) || is_rounding(own, face, t))) {
        query.found = closest(query.ray, query.hit);
        return;
      }
      settle(query.ray, query.hit);
    }
    if (!settles_) [[likely]]
      return;
    Hit left = query.found ? query.hit : Hit{{}, query.ray.t_max};
    if (!overlaps_.leave(query.ray, left)) return;
    query.hit = left;
    query.found = true;
  }
  void closest_alone(RayQuery& query) const {
    query.failed = !is_traceable(query.ray);
    if (query.failed) return;
    RTCRayHit one;
    one.ray = to_embree(query.ray, origin_for(query));
    one.hit.geomID = one.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    QueryContext context;
    start(context, nullptr);
    intersect(rtc_scene_.get(), context, one);
    const bool found = one.hit.geomID != RTC_INVALID_GEOMETRY_ID;
    take(query,
         found ? face_of(scene_, one.hit.instID[0], one.hit.geomID, one.hit.primID) : FaceRef{},
         one.ray.tfar);
  }
  void closest_packet(std::span<RayQuery> queries) const {
    alignas(32) int valid[kPacket];
    RTCRayHit8 packet;
    put(queries, valid, packet.ray);
    for (size_t i = 0; i < kPacket; ++i)
      packet.hit.geomID[i] = packet.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
    QueryContext context;
    start(context, nullptr);
    if (go_side_by_side(queries)) go_together(context);
    intersect(valid, rtc_scene_.get(), context, packet);
    for (size_t i = 0; i < queries.size(); ++i) {
      queries[i].failed = valid[i] == 0;
      if (queries[i].failed) continue;
      const bool found = packet.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID;
      take(queries[i],
           found ? face_of(scene_, packet.hit.instID[0][i], packet.hit.geomID[i],
                           packet.hit.primID[i])
                 : FaceRef{},
           packet.ray.tfar[i]);
    }
  }
  void occluded_alone(RayQuery& query) const {
    query.failed = !is_traceable(query.ray);
    query.found = !query.failed && settles_ && is_hidden_by_near(query.ray);
    if (query.failed || query.found) return;
    Context context = make_context(query.ray);
    RTCRay one = to_embree(query.ray, origin_for(query));
    occlude(rtc_scene_.get(), context.base, one);
    query.found = one.tfar < 0;
  }
  void occluded_packet(std::span<RayQuery> queries) const {
    alignas(32) int valid[kPacket];
    RTCRay8 packet;
    put(queries, valid, packet);
    PacketContext context;
    bool skips = false;
    for (size_t i = 0; i < queries.size(); ++i) {
      queries[i].failed = valid[i] == 0;
      queries[i].found = settles_ && valid[i] != 0 && is_hidden_by_near(queries[i].ray);
      if (queries[i].found) valid[i] = 0;
      context.rays[i] = make_context(queries[i].ray);
      skips |= context.rays[i].base.filter != nullptr;
    }
    start(context.base, skips ? reject_skipped_of_packet : nullptr);
    if (go_side_by_side(queries)) go_together(context.base);
    occlude(valid, rtc_scene_.get(), context.base, packet);
    for (size_t i = 0; i < queries.size(); ++i) {
      if (valid[i] != 0) queries[i].found = packet.tfar[i] < 0;
    }
  }
  static bool has_none(const Scene& scene) { return scene.exposure && scene.exposure->no_overlaps; }
  // True if a coplanar or near face of the ray's end, or a near face of its start, occludes it.
  bool is_hidden_by_near(const Ray& ray) const {
    if (ray.end.shape.valid() &&
        (overlaps_.is_hidden(ray.end, ray) || overlaps_.arrives_hidden(ray)))
      return true;
    Hit hit{{}, ray.t_max};
    return overlaps_.leave(ray, hit);
  }
  // Embree receives faces with area only (it rounds corners relative to the ray's origin and could
  // hit a line), and of duplicates the representative.
  bool is_traced(const Mesh& mesh, FaceRef face) const {
    return has_area(mesh, mesh.face(face.face)) && copies_.first(face) == face;
  }
  // A moving scene is traced at one time only: building quickly counts more.
  RTCBuildQuality quality() const {
    return is_moving(scene_) ? RTC_BUILD_QUALITY_MEDIUM : RTC_BUILD_QUALITY_HIGH;
  }
  static std::shared_ptr<EmbreeDevice> device_of(const Scene& scene) {
    if (!scene.exposure || !scene.exposure->kept_shapes) return std::make_shared<EmbreeDevice>();
    return {scene.exposure->kept_shapes, &scene.exposure->kept_shapes->device};
  }
  Owned<RTCScene> make_scene(RTCBuildQuality quality) {
    Owned<RTCScene> made(rtcNewScene(device_->get()));
    device_->check();
    rtcSetSceneFlags(made.get(),
                     static_cast<RTCSceneFlags>(RTC_SCENE_FLAG_ROBUST | kFilterOfQuery));
    rtcSetSceneBuildQuality(made.get(), quality);
    return made;
  }
  // On the threads of this call alone.
  void commit(RTCScene rtc_scene, int threads) {
    parallel_for(1, threads, [&](size_t) { rtcJoinCommitScene(rtc_scene); });
    device_->check();
  }
  void attach(RTCScene rtc_scene, RTCGeometry geometry, uint32_t number) {
    rtcAttachGeometryByID(rtc_scene, geometry, number);
    device_->check();
  }
  Owned<RTCGeometry> make_instance(RTCScene of, const Vec3f (&columns)[4]) {
    Owned<RTCGeometry> instance(rtcNewGeometry(device_->get(), RTC_GEOMETRY_TYPE_INSTANCE));
    device_->check();
    rtcSetGeometryInstancedScene(instance.get(), of);
    rtcSetGeometryTransform(instance.get(), 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, columns);
    rtcCommitGeometry(instance.get());
    return instance;
  }
  // Slivers that lie askew get coordinates along their sides. Otherwise a ray may meet the
  // axis-aligned boxes of all faces of a cylinder.
  Owned<RTCGeometry> make_shape(ShapeId id, int threads) {
    const auto frame = frame_of(scene_.shape(id).mesh);
    if (!frame) {
      auto shared = share_triangles(id);
      return shared ? std::move(shared)
                    : make_triangles(id, [&](const Vec3d& x) { return x - origin_; });
    }
    const auto& [center, axes, half] = *frame;
    const Owned<RTCScene> own = make_scene(quality());
    // Named, as Clang before 16 captures no structured bindings by itself.
    const auto along_axes = [&center = center, &axes = axes](const Vec3d& x) {
      const Vec3d arm = x - center;
      return Vec3d{dot(axes[0], arm), dot(axes[1], arm), dot(axes[2], arm)};
    };
    const Owned<RTCGeometry> triangles = make_triangles(id, along_axes);
    attach(own.get(), triangles.get(), 0);
    commit(own.get(), threads);
    return make_instance(own.get(), {cast<float>(axes[0]), cast<float>(axes[1]),
                                     cast<float>(axes[2]), cast<float>(center - origin_)});
  }
  // Embree reads the mesh's own arrays, if it takes all of them as they are: null if not, or if the
  // geometry outlives this tracer. As it reads 16 bytes of the last vertex, there must be room.
  Owned<RTCGeometry> share_triangles(ShapeId id) {
    const Mesh& mesh = scene_.shape(id).mesh;
    const bool kept = scene_.exposure && scene_.exposure->kept_shapes;
    if (kept || origin_ != Vec3d{} || mesh.positions.capacity() == mesh.positions.size()) return {};
    for (uint32_t i = 0; i < mesh.faces.size(); ++i)
      if (!is_traced(mesh, {id, FaceId(i)})) return {};
    Owned<RTCGeometry> geometry(rtcNewGeometry(device_->get(), RTC_GEOMETRY_TYPE_TRIANGLE));
    device_->check();
    rtcSetSharedGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                               mesh.positions.data(), 0, sizeof(Vec3f), mesh.positions.size());
    rtcSetSharedGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                               mesh.faces.data(), 0, sizeof(FaceIndices), mesh.faces.size());
    device_->check();
    shared_.emplace_back(mesh.positions, mesh.faces);
    rtcCommitGeometry(geometry.get());
    return geometry;
  }
  template <class Place>
  Owned<RTCGeometry> make_triangles(ShapeId id, const Place& place) {
    const Mesh& mesh = scene_.shape(id).mesh;
    Owned<RTCGeometry> geometry(rtcNewGeometry(device_->get(), RTC_GEOMETRY_TYPE_TRIANGLE));
    device_->check();
    auto* vertices = static_cast<Vec3f*>(
        rtcSetNewGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                sizeof(Vec3f), mesh.positions.size()));
    auto* faces = static_cast<FaceIndices*>(
        rtcSetNewGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                sizeof(FaceIndices), mesh.faces.size()));
    device_->check();
    std::transform(mesh.positions.begin(), mesh.positions.end(), vertices,
                   [&](const Vec3f& x) { return cast<float>(place(cast<double>(x))); });
    for (uint32_t i = 0; i < mesh.faces.size(); ++i) {
      const FaceIndices& face = mesh.faces[i];
      faces[i] = is_traced(mesh, {id, FaceId(i)}) ? face : FaceIndices{face[0], face[0], face[0]};
    }
    rtcCommitGeometry(geometry.get());
    return geometry;
  }
  // Attaches what is kept of other times; returns which shapes these are. Duplicates depend on
  // what moves.
  std::vector<bool> attach_kept(int threads) {
    std::vector<bool> none(scene_.shapes.size());
    if (!scene_.exposure || !scene_.exposure->kept_shapes || !copies_.empty()) return none;
    KeptShapes& kept = *scene_.exposure->kept_shapes;
    const std::lock_guard lock(kept.mutex);
    if (!kept.holds(scene_, origin_)) keep(kept, threads);
    for (const auto& [number, geometry] : kept.geometries) {
      attach(rtc_scene_.get(), geometry.get(), number);
    }
    return kept.still;
  }
  void keep(KeptShapes& kept, int threads) {
    kept.origin = origin_;
    kept.positions.clear();
    kept.geometries.clear();
    size_t faces = 0;
    for (uint32_t i = 0; i < scene_.shapes.size(); ++i) {
      const Mesh& mesh = scene_.shapes[i].mesh;
      kept.positions.push_back(mesh.positions);
      if (!kept.still[i]) continue;
      kept.geometries.emplace_back(i, make_shape(ShapeId(i), threads));
      faces += mesh.faces.size();
    }
    // Rays take longer into an instance than it takes to build anew what has fewer. Not tuned.
    constexpr size_t kMany = 4096;
    if (faces < kMany) return;
    const Owned<RTCScene> all = make_scene(RTC_BUILD_QUALITY_HIGH);
    std::erase_if(kept.geometries, [&](const auto& shape) {
      const bool alone = frame_of(scene_.shapes[shape.first].mesh).has_value();
      if (!alone) attach(all.get(), shape.second.get(), shape.first);
      return !alone;
    });
    commit(all.get(), threads);
    kept.geometries.emplace_back(
        static_cast<uint32_t>(scene_.shapes.size()),
        make_instance(all.get(), {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0}}));
  }
  Context make_context(const Ray& ray) const {
    Context context;
    const bool skips = ray.start.shape.valid() || ray.end.shape.valid() ||
                       !ray.skip_faces.empty() || ray.skip_emitters;
    start(context.base, skips ? reject_skipped : nullptr);
    context.ray = &ray;
    context.scene = &scene_;
    context.copies = &copies_;
    context.reach = reach_;
    if (!overlaps_.empty()) [[unlikely]] {
      context.beside_start = overlaps_.around(ray.start);
      context.beside_end = overlaps_.around(ray.end);
    }
    return context;
  }

  const Scene& scene_;
  std::shared_ptr<const CoincidentFaces> faces_;
  const DuplicateFaces& copies_;
  const FaceOverlaps& overlaps_;
  bool settles_;  // duplicates, coplanar or near faces exist
  Bounds bounds_;
  Vec3d origin_;  // origin of Embree's coordinates
  double reach_;
  std::shared_ptr<EmbreeDevice> device_;
  // The arrays that Embree reads, kept alive should the scene change.
  std::vector<std::pair<SharedVector<Vec3f>, SharedVector<FaceIndices>>> shared_;
  Owned<RTCScene> rtc_scene_;
};

// Of blurred faces, each as triangles that cover all of it.
class EmbreeBlurTracer final : public BlurTracer {
 public:
  EmbreeBlurTracer(const BlurFaces& faces, int threads)
      : faces_(faces),
        origin_(origin_of(faces.scene(), bounds_of(faces.scene()))),
        pieces_(faces.scene().shapes.size()) {
    rtc_scene_.reset(rtcNewScene(device_.get()));
    device_.check();
    rtcSetSceneFlags(rtc_scene_.get(),
                     static_cast<RTCSceneFlags>(RTC_SCENE_FLAG_ROBUST | kFilterOfQuery));
    rtcSetSceneBuildQuality(rtc_scene_.get(), RTC_BUILD_QUALITY_MEDIUM);
    for (uint32_t s = 0; s < pieces_.size(); ++s) attach(ShapeId(s));
    parallel_for(1, threads, [&](size_t) { rtcJoinCommitScene(rtc_scene_.get()); });
    device_.check();
  }

  void hits(const Ray& ray, std::vector<BlurHit>& hits) const override {
    hits.clear();
    collect(ray, true, hits);
    const double depth = faces_.blur().depth();
    if (depth > 0 && !hits.empty()) {
      // What mixes with the first opaque face: the rays ends behind it.
      Ray cut = ray;
      for (const BlurHit& hit : hits) {
        if (hit.opacity == 1) cut.t_max = std::min(cut.t_max, hit.t + depth);
      }
      hits.clear();
      collect(cut, false, hits);
    }
    if (hits.size() > kMostBlurHits) {
      throw InputError(
          "a ray meets " + std::to_string(hits.size()) + " blurred faces: sigma " +
          std::to_string(faces_.blur().sigma) + " is too large for sides whose median is " +
          std::to_string(median_side(faces_.scene())) + ": take a smaller sigma or a coarser mesh");
    }
    faces_.settle(ray, hits);
  }

 private:
  struct Query {
    QueryContext base;  // first, as in Context
    const EmbreeBlurTracer* tracer;
    const Ray* ray;
    std::vector<BlurHit>* hits;
    bool ends;  // at an opaque face
  };
  static void note_hit(const RTCFilterFunctionNArguments* arguments) {
    const auto& query = *reinterpret_cast<const Query*>(arguments->context);
    const ShapeId shape(RTCHitN_geomID(arguments->hit, 1, 0));
    const uint32_t piece = RTCHitN_primID(arguments->hit, 1, 0);
    const FaceId face(query.tracer->pieces_[shape.index()][piece]);
    const auto hit = query.tracer->faces_.meet(*query.ray, {shape, face});
    if (hit) query.hits->push_back(*hit);
    if (!hit || hit->opacity < 1 || !query.ends) arguments->valid[0] = 0;
  }
  void collect(const Ray& ray, bool ends, std::vector<BlurHit>& hits) const {
    Query query;
    start(query.base, note_hit);
    query.tracer = this;
    query.ray = &ray;
    query.hits = &hits;
    query.ends = ends;
    RTCRayHit rtc;
    rtc.ray = to_embree(ray, origin_);
    rtc.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    rtc.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    intersect(rtc_scene_.get(), query.base, rtc);
  }
  void attach(ShapeId id) {
    constexpr double kMargin = 1.01;  // for the rounding to floats, where opacities are almost 0
    const Mesh& mesh = faces_.scene().shape(id).mesh;
    std::vector<Vec3f> corners;
    for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
      if (!has_area(mesh, mesh.faces[f])) continue;
      const std::vector<Vec3d> polygon =
          enlarged_face(face_corners<double>(mesh, FaceId(f)), kMargin * faces_.blur().reach());
      for (size_t k = 2; k < polygon.size(); ++k) {
        for (const Vec3d& x : {polygon[0], polygon[k - 1], polygon[k]}) {
          corners.push_back(cast<float>(x - origin_));
        }
        pieces_[id.index()].push_back(f);
      }
    }
    const Owned<RTCGeometry> geometry(rtcNewGeometry(device_.get(), RTC_GEOMETRY_TYPE_TRIANGLE));
    device_.check();
    auto* vertices = static_cast<Vec3f*>(
        rtcSetNewGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                sizeof(Vec3f), corners.size()));
    auto* faces = static_cast<FaceIndices*>(
        rtcSetNewGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                sizeof(FaceIndices), corners.size() / 3));
    device_.check();
    std::copy(corners.begin(), corners.end(), vertices);
    for (uint32_t k = 0; k < corners.size() / 3; ++k) faces[k] = {3 * k, 3 * k + 1, 3 * k + 2};
    rtcCommitGeometry(geometry.get());
    rtcAttachGeometryByID(rtc_scene_.get(), geometry.get(), id.index());
    device_.check();
  }

  const BlurFaces& faces_;
  Vec3d origin_;
  std::vector<std::vector<uint32_t>> pieces_;  // of each shape: the face of each triangle
  EmbreeDevice device_;
  Owned<RTCScene> rtc_scene_;
};

}  // namespace

std::unique_ptr<BlurTracer> make_blur_tracer(const BlurFaces& faces, int threads) {
  return std::make_unique<EmbreeBlurTracer>(faces, threads);
}

std::unique_ptr<RayTracer> make_embree_tracer(const Scene& scene, int threads) {
  return make_embree_tracer(scene, threads, nullptr);
}

std::unique_ptr<RayTracer> make_embree_tracer(const Scene& scene, int threads,
                                              std::shared_ptr<const CoincidentFaces> faces) {
  return std::make_unique<EmbreeTracer>(scene, threads, std::move(faces));
}

}  // namespace limn
