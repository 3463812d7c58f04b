#pragma once
// Rays through a point of an edge past faces so near to it that a ray of floats cannot tell on
// which side of them it runs (FacesAround::near). The tracer skips these; here they are met in
// double precision, relative to the point on the edge, where nothing is lost.
#include "limn/core/ray_tracer.h"
#include "limn/edgetree/edges.h"

namespace limn {

// As RayTracer::closest, for a ray that passes through the point y of an edge at t = `distance` (0
// if it starts there) and that skips around.all: the near faces among them are met all the same,
// but not at y. A hit before y may lack its face and distance (0).
bool closest_at_edge(const RayTracer& tracer, const Scene& scene, const FacesAround& around,
                     const Vec3d& y, double distance, const Ray& ray, Hit& hit);
// As RayTracer::occluded, for a ray that starts at a point of an edge and skips around.all.
bool occluded_from_edge(const RayTracer& tracer, const Scene& scene, const FacesAround& around,
                        const Ray& ray);

}  // namespace limn
