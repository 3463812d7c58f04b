"""Faults, each a text that occurs once in its file and what replaces it, with the tests of its part.

program: a test program of tests/CMakeLists.txt; tests: a filter of GoogleTest.
"""

from dataclasses import dataclass

POWER = "test_term_power"
TERMS = "integrators/terms/"


@dataclass(frozen=True)
class Fault:
    part: str
    name: str
    file: str
    old: str
    new: str
    program: str
    tests: str = "*"


FAULTS = [
    Fault("interior", "score of a moving direction lost", "integrators/paths/path_vertices.h",
          "  detail::add_score<S>(walk, value(walk.throughput) * (1 / pdf));\n", "",
          "test_moving_directions", "MovingDirections.*"),
    Fault("interior", "throughput not divided by survival", "integrators/paths/path_vertices.h",
          "  walk.throughput = walk.throughput * (1 / survival);\n", "",
          "test_furnace"),

    Fault("camera", "wrong sign", TERMS + "film_edges.cpp",
          "if (dot(turn, side) < 0) {", "if (dot(turn, side) > 0) {", POWER, "*/camera"),
    Fault("camera", "every eighth edge lost", TERMS + "camera_edges.cpp",
          "    if (!view.viewpoint->is_candidate(mesh, id.edge)) continue;\n",
          "    if (e % 8 == 3 || !view.viewpoint->is_candidate(mesh, id.edge)) continue;\n", POWER,
          "*/camera"),
    Fault("camera", "density x 1.1", TERMS + "camera_edges.cpp",
          "point.density = draw.probability /", "point.density = 1.1 * draw.probability /",
          POWER, "*/camera"),
    Fault("camera", "edges seen from the center of the lens", TERMS + "lens_edges.cpp",
          "view_.at(lens), edge)", "view_.at({}), edge)", "test_sensors", "Lens.Shows*"),
    Fault("camera", "density through a lens x 1.1", TERMS + "lens_edges.cpp",
          "point.density = draw.probability /", "point.density = 1.1 * draw.probability /",
          "test_sensors", "Lens.Shows*"),
    Fault("camera", "edges of clip planes lost", TERMS + "camera_edges.cpp",
          "for (uint32_t c = 0; c < clips_.size(); ++c) add_clip(c);", "",
          "test_crossings"),
    Fault("camera", "edges inside textures lost", "integrators/edges/scene_edges.cpp",
          "if (segments.empty()) continue;", "continue;", "test_texture_edges"),

    Fault("boundary", "texture looked up on its edge", TERMS + "edge_difference.cpp",
          "const double step = by / (", "const double step = 0 * by / (", "test_texture_edges"),
    Fault("boundary", "density x 1.1", TERMS + "vertex_edges.cpp",
          "1 / (view.distance * view.distance * view.distance *",
          "1 / (1.1 * view.distance * view.distance * view.distance *", POWER, "*/boundary"),
    Fault("boundary", "one distance fewer", TERMS + "vertex_edges.cpp",
          "view.distance * view.distance * view.distance *", "view.distance * view.distance *",
          POWER, "*/boundary"),
    Fault("boundary", "weight after roulette lost", TERMS + "lane_sinks.cpp",
          "  rate_ = rate_ * (1 / probability);\n", "", "test_moving_directions", "WeakDraws.*"),
    Fault("boundary", "farther face in front", TERMS + "edge_difference.cpp",
          "return slope_a < slope_b;", "return slope_a > slope_b;", "test_touching_shapes"),

    Fault("direct", "weight of a piece x 1.1", TERMS + "direct_edges.cpp",
          "drawn.push_back(point_at(pieces[i], u, weight / total * points));",
          "drawn.push_back(point_at(pieces[i], u, 1.1 * weight / total * points));",
          POWER, "*/light_sets"),
    Fault("direct", "`turn x (1 - share)` with the other sign", TERMS + "lane_sinks.cpp",
          "v = v * form.share - ray.turn.velocity", "v = v * form.share + ray.turn.velocity",
          POWER, "*Turns*"),

    Fault("penumbra", "density x 1.1", TERMS + "penumbra.cpp",
          "result.density = pdf * std::fabs(dot(line.n, omega))",
          "result.density = 1.1 * pdf * std::fabs(dot(line.n, omega))", POWER, "*Penumbra*"),
    Fault("penumbra", "cosine dropped", TERMS + "penumbra.cpp",
          "result.density = pdf * std::fabs(dot(line.n, omega))", "result.density = pdf",
          POWER, "*Penumbra*"),
    Fault("penumbra", "roulette of small shares lost", TERMS + "penumbra_lines.cpp",
          "std::max(share, kLeastShare)", "share", POWER, "*Penumbra*"),
    Fault("penumbra", "density of directions x 1.5", "integrators/lights/light_regions.cpp",
          "return distance * distance / (region.hull.area * cosine);",
          "return 1.5 * distance * distance / (region.hull.area * cosine);",
          "test_light_regions", "LightRegions.*"),

    Fault("shadow", "cosine dropped", TERMS + "shadow_boundary.cpp",
          "form.scale = point.m * cosine /", "form.scale = point.m /", POWER, "*/shadow"),
    Fault("shadow", "measure x 1.1", TERMS + "shadow_edges.cpp",
          "const double m = (line.infinite ? 1 : 1 + s) / std::fabs(slope);",
          "const double m = 1.1 * (line.infinite ? 1 : 1 + s) / std::fabs(slope);",
          POWER, "*/shadow"),
    Fault("shadow", "every fourth edge lost", TERMS + "shadow_edges.cpp",
          "if (edge.sign == 0) continue;", "if (edge.sign == 0 || e % 4 == 1) continue;",
          POWER, "*/shadow"),

    Fault("filter", "x 1.05", TERMS + "filter.cpp",
          "const double peak = layer.weight * film_.filter.eval(0) /",
          "const double peak = 1.05 * layer.weight * film_.filter.eval(0) /", POWER, "*Filter*"),
    Fault("filter", "cut at the end of the film dropped", TERMS + "filter.cpp",
          "const double cut = kTaper * rng.uniform();", "const double cut = 0;",
          "test_moving_directions", "FilmMotion.*"),

    Fault("specular", "samples counted twice", TERMS + "glare_edges.cpp",
          "return view.count > 0 && cap_of", "return false && cap_of",
          "test_regions", "MirroredLight.*"),
    Fault("specular", "mixture's density", "integrators/lights/mirrored_light.cpp",
          "mixture.share * sum + (1 - mixture.share) * scattered",
          "mixture.share * sum + scattered", "test_regions", "MirroredLight.*"),

    Fault("MIS", "density of an area light x 1.5", "src/light/area.cpp",
          "return view.distance * view.distance * inverse_area_ * probability / cosine;",
          "return 1.5 * view.distance * view.distance * inverse_area_ * probability / cosine;",
          "test_lights"),
    Fault("MIS", "density of a map x 1.1", "src/light/map_density.cpp",
          "return mix(mix(c[0], c[1], along), mix(c[2], c[3], along), down) *",
          "return 1.1 * mix(mix(c[0], c[1], along), mix(c[2], c[3], along), down) *",
          "test_environment_sampling"),

    Fault("exact film", "centroid shifted", "integrators/film/pixel_parts.cpp",
          "part.my += area * (first.y + p.y + q.y) / 3;",
          "part.my += area * (first.y + p.y + q.y) / 2.9;", "test_visible_regions", "ExactFilm.*"),
    Fault("exact film", "corner on a cut lost", "src/regions/convex_region.cpp",
          "if (next == 0) part.push_back({after.at, here > 0 ? by : by.other()});", "",
          "test_visible_regions"),

    Fault("bounds", "forest's dual boxes 25 % too wide", "edgetree/bounds/forest_fit.cpp",
          "half = 0.5 * (high - low);", "half = 0.625 * (high - low);", "test_quadric", "Fits.*"),
    Fault("bounds", "forest's boxes too wide", "edgetree/forest/forest_build.cpp",
          "std::ceil((high + 1) * 0.5 * kBoxSteps + kMargin)",
          "std::ceil((1.25 * high + 1) * 0.5 * kBoxSteps + kMargin)", "test_forest", "Forest.*"),
    Fault("boundary", "last tree under shared nodes lost", "edgetree/forest/forest_build.cpp",
          "for (size_t i = kApart; i < trees.size(); ++i) {",
          "for (size_t i = kApart; i + 1 < trees.size(); ++i) {", "test_forest", "*ManyObjects*"),
    Fault("differences", "smooth rays with equal shares", "src/bsdf/smooth.cpp",
          "return weight < 0.25 * sum ? 0.1 : weight < 0.75 * sum ? 0.5 : 0.9;",
          "return 0.5 + 0 * weight;", "test_smooth_lobes"),
    Fault("bounds", "quadric boxes 25 % too wide", "edgetree/quadric/quadric_fit.cpp",
          "half = 0.5 * (high - low);", "half = 0.625 * (high - low);", "test_quadric", "Fits.*"),
    Fault("bounds", "quadrics 25 % too wide", "edgetree/bounds/pair_fit.cpp",
          "static_cast<float>(high + kRounding)",
          "static_cast<float>(high + 0.25 * (high - low) + kRounding)", "test_quadric", "Fits.*"),

    Fault("rejection", "silhouettes rejected near a side", "edgetree/forest/forest_query.cpp",
          "abs(plane.g[1]) + abs(plane.g[2]) + abs(plane.g[3]) + at.error;",
          "0.9f * (abs(plane.g[1]) + abs(plane.g[2]) + abs(plane.g[3])) + at.error;",
          "test_rejection"),

    Fault("lobes", "density along an edge x 1.1", "edgetree/lobe/ltc_edge.cpp",
          "return scale * std::max(0.0, w.z) / (r2 * r2);",
          "return 1.1 * scale * std::max(0.0, w.z) / (r2 * r2);", "test_ltc"),
    Fault("lobes", "GGX x 1.02", "src/bsdf/microfacet.h",
          "return a2 / (q * q * kPi);", "return a2 / (q * q * kPi) * 1.02;",
          "test_bsdf_sampling"),

    Fault("reverse", "angle derivative of normals lost", "src/mesh/normals_adjoint.cpp",
          "      adjoints[i].angles[c] += dot(s, shape.normal);\n", "",
          "test_tape", "ShadingNormals.*"),
    Fault("reverse", "film points x 1.1", "integrators/backward/adjoint_sinks.cpp",
          "const double weight = weighed(adjoint_, amount) * form_->scale * share_;",
          "const double weight = 1.1 * weighed(adjoint_, amount) * form_->scale * share_;",
          POWER, "*Reverse*/camera"),
    Fault("reverse", "ends of an edge swapped", "integrators/backward/edge_motion.cpp",
          "contribute_end(tape, point.edge, 0, g * (1 - point.t));",
          "contribute_end(tape, point.edge, 0, g * point.t);", POWER, "*Reverse*/boundary"),
    Fault("reverse", "ray of a vertex lost", "integrators/backward/adjoint_sinks.cpp",
          "    seeds_.add(p_, g);\n", "", POWER, "*Reverse*/boundary"),

    Fault("statistics", "variance x 0.9", "integrators/estimates/moments.cpp",
          "squares_[i] += n * n * (1 - share) * before * before;",
          "squares_[i] += 0.9 * n * n * (1 - share) * before * before;", "test_runs",
          "Batches.*:*GrowingBatches*"),
    Fault("statistics", "Student's quantile", "integrators/estimates/statistics.cpp",
          "(8 * degrees + 1) / (8 * degrees + 3)", "(8 * degrees + 3) / (8 * degrees + 1)",
          "test_metrics"),
    Fault("merge", "last shard's cost lost", "integrators/estimates/batch_record.cpp",
          "  largest.square = number();\n", "  largest.squares = number();\n",
          "test_program", "Parts.*"),
    Fault("readers", "negative OBJ indices off by one", "src/mesh/read_obj.cpp",
          "static_cast<int64_t>(count) + index);", "static_cast<int64_t>(count) + index - 1);",
          "test_mesh"),
    Fault("readers", "beam width", "src/light/spot.cpp",
          "0.75 * cutoff", "0.7 * cutoff", "test_scene"),
    Fault("closed light", "side x 1.02", "integrators/lights/polygon_light.cpp",
          "sum += arc.s * (0.5 * arc.angle);", "sum += arc.s * (0.51 * arc.angle);",
          "test_closed_light"),
    Fault("lifted start", "hollow faces lifted", "include/limn/core/surface_point.h",
          "above < 0 ? -1 : kHollowLift;", "-1;", "test_lifted_points"),
    Fault("differences", "one-sided step", "integrators/methods/differences.cpp",
          "weights[j] / (2 * steps[j]);", "weights[j] / steps[j];", "test_compare"),
    Fault("fit", "memory of L-BFGS lost", "integrators/fit/quasi_newton.cpp",
          "add_multiple(r, weights[i] - other, steps[i]);", "add_multiple(r, -other, steps[i]);",
          "test_fit"),
]
