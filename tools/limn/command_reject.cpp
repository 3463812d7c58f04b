// limn reject: measures what samplers reject, draws it, writes pictures and figures.
#include "tools/limn/command_reject.h"
#include "limn/core/make_bsdf.h"

#include "tools/limn/commands.h"
#include "tools/limn/report_script.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "limn/core/error.h"
#include "limn/core/names.h"
#include "limn/core/parallel.h"
#include "limn/edgetree/edge_sampler_types.h"
#include "limn/edgetree/quadric_chart.h"
#include "tools/limn/reject/reject_figures.h"
#include "tools/limn/reject/reject_pictures.h"
#include "tools/limn/terminal.h"

namespace limn {
namespace {

using nlohmann::json;

constexpr int kDraws = 100;  // per point, for the acceptance rate

json to_json(const Vec3d& v) { return {v.x, v.y, v.z}; }

// ---- What is looked at.

Scene scene_of_mesh(const std::string& file) {
  Scene scene;
  scene.file = file;
  Shape shape;
  shape.mesh = read_mesh(file, false);
  shape.bsdf = make_diffuse(Rgb<double>{0.5, 0.5, 0.5});
  scene.shapes.push_back(std::move(shape));
  return scene;
}

EdgeMesh edges_of(const Shape& shape) {
  return build_edge_mesh(shape.mesh, shape.bsdf->side(false) == nullptr);
}

// The shape of this id, or the one with the most edges; leaves it alone in the scene.
EdgeMesh keep_one_shape(Scene& scene, const std::string& id) {
  EdgeMesh chosen;
  size_t index = scene.shapes.size();
  std::vector<std::string> known;
  for (size_t i = 0; i < scene.shapes.size(); ++i) {
    const std::string& name = scene.shapes[i].id;
    known.push_back(name);
    if (!id.empty() && name != id) continue;
    EdgeMesh edges = edges_of(scene.shapes[i]);
    if (index < scene.shapes.size() && edges.edges.size() <= chosen.edges.size()) continue;
    chosen = std::move(edges);
    index = i;
  }
  if (index == scene.shapes.size())
    throw InputError({scene.file}, id.empty() ? "the scene has no shapes"
                                              : fmt::format("no shape has the id \"{}\" ({})", id,
                                                            known_names(known)));
  Shape shape = std::move(scene.shapes[index]);
  scene.shapes.clear();
  scene.shapes.push_back(std::move(shape));
  return chosen;
}

struct Sphere {
  Vec3d center;
  double radius = 0;
};
Sphere sphere_around(const EdgeMesh& mesh) {
  Bounds bounds;
  for (const Edge& edge : mesh.edges)
    for (const VertexId vertex : edge.vertices) bounds.extend(mesh.position(vertex));
  Sphere sphere{bounds.center()};
  for (const Edge& edge : mesh.edges)
    for (const VertexId vertex : edge.vertices)
      sphere.radius = std::max(sphere.radius, length(mesh.position(vertex) - sphere.center));
  return sphere;
}

// ---- Methods.

std::vector<EdgeSamplerType> chosen_types(const std::vector<std::string>& names) {
  const auto has_test = [](const EdgeSamplerType& type) {
    return type.make({}, 1)->rejection_tree() != nullptr;
  };
  std::vector<EdgeSamplerType> types;
  for (const std::string& name : names) {
    types.push_back(edge_sampler_type(name));
    if (has_test(types.back())) continue;
    std::vector<std::string> known;
    for (const EdgeSamplerType& type : edge_sampler_types()) {
      if (has_test(type)) known.push_back(type.name);
    }
    throw InputError("--methods: \"" + name + "\" is no sampler with a rejection test (" +
                     known_names(known) + ")");
  }
  return types;
}

// ---- The run.

// About z.
Vec3d turned(const Vec3d& v, double degrees) {
  const double c = std::cos(degrees * kPi / 180), s = std::sin(degrees * kPi / 180);
  return {c * v.x - s * v.y, s * v.x + c * v.y, v.z};
}

// The pictures' colours, for legends.
json colors_json() {
  json colors = {{"edge_silhouette", css(kSilhouetteColor)},
                 {"edge_false_accept", css(kFalseAcceptColor)},
                 {"edge_false_positive", css(kDeadEndColor)},
                 {"node", css(kNodeColor)},
                 {"point", css(kPointColor)}};
  const char* verdicts[] = {"true_reject", "true_accept", "false_accept", "missed"};
  for (int k = 0; k < kVerdicts; ++k) colors[verdicts[k]] = css(kVerdictColors[k]);
  return colors;
}

class Rejection {
 public:
  Rejection(const CommonOptions& common, const RejectCommand& command)
      : common_(common),
        command_(command),
        threads_(thread_count(common.run.threads)),
        types_(chosen_types(command.methods)),
        scene_(is_mesh_file(common.scene) ? scene_of_mesh(common.scene)
                                          : load_scene(common, warnings_)),
        progress_(progress_bar("reject", common.quiet)) {
    input_.objects.push_back(keep_one_shape(scene_, command.shape));
    tracer_ = make_embree_tracer(scene_, threads_);
    sphere_ = sphere_around(input_.objects[0]);
    seed_ = common.run.seed.value_or(scene_.seed);
    queries_ = queries_around(input_.objects[0], command.points, seed_);
  }

  int run() {
    measure_all();
    if (measured_.empty()) {
      fmt::print(stderr, "\ninterrupted before the first method was done: nothing is written\n");
      return kInterrupted;
    }
    for (const Measured& method : measured_) write(method, draw(method));
    write_png(file("overview.png"), draw_overview(), 1);
    write_figures();
    if (!common_.quiet) print();
    if (command_.report) write_report(command_.output, common_.quiet);
    return status();
  }

 private:
  std::string file(const std::string& name) const { return command_.output + "/" + name; }
  const EdgeMesh& mesh() const { return input_.objects[0]; }
  Subject subject() const { return {scene_, *tracer_, input_, threads_}; }

  // The first method chooses the node, and with it the places that all are looked at.
  void choose_places(const RejectionTree& tree) {
    const size_t count = tree.nodes().size();
    if (count == 0) throw InputError({common_.scene}, "the mesh has no edges");
    if (command_.node && *command_.node >= count)
      throw InputError(fmt::format("--node {}: {} has nodes 0 to {}", *command_.node,
                                   types_[0].name, count - 1));
    const auto few = std::span(queries_).first(std::min<size_t>(queries_.size(), 64));
    node_ = command_.node ? *command_.node : balanced_node(input_, tree, command_.node_edges, few);
    const auto edges = tree.edges(node_);
    node_edges_.assign(edges.begin(), edges.end());
    node_depth_ = tree.nodes()[node_].depth;
    patch_ = patch_of(input_, edges);
    slices_ = slices_around(patch_, command_.extent * sphere_.radius,
                            command_.distance * sphere_.radius, command_.size);
    choose_view();
  }

  // In front of the narrower side, a little above.
  Vec3d default_point(const Frame& around) const {
    double s_extent = 0, t_extent = 0;
    for (const Vec3d& x : mesh().positions) {
      s_extent = std::max(s_extent, std::fabs(dot(x - sphere_.center, around.s)));
      t_extent = std::max(t_extent, std::fabs(dot(x - sphere_.center, around.t)));
    }
    const Vec3d narrow = s_extent < t_extent ? Vec3d{1, 0, 0.4} : Vec3d{0, 1, 0.4};
    const Vec3d direction = normalize(around.to_world(turned(narrow, -15)));
    return sphere_.center + direction * (1.25 * sphere_.radius);
  }

  void choose_view() {
    const Frame around(normalize(command_.up));
    point_ = command_.point.value_or(default_point(around));
    const Vec3d to_point = point_ - sphere_.center;
    const double distance = length(to_point);
    // A little aside from the point, so that the outline that it sees lies across the picture.
    Vec3d aside = turned(around.to_local(distance > 0 ? to_point / distance : around.s), 40);
    aside.z = 0.35;
    const Vec3d view = command_.view.value_or(around.to_world(aside));
    // Mesh and point; the mesh alone if the point is far.
    std::vector<Vec3d> shown = mesh().positions;
    if (distance < 3 * sphere_.radius) shown.push_back(point_);
    const Camera camera = camera_for(shown, view, command_.up, command_.size);
    reach_view_.emplace(scene_, *tracer_, camera, threads_);
    clay_ = reach_view_->picture();
  }

  // One method: its tree, what was found, and the verdicts over the slices.
  struct Measured {
    std::unique_ptr<EdgeSampler> sampler;
    std::unique_ptr<RejectionTree> tree;
    RejectVariant figures;
    std::vector<PlacedSlice> slices;
  };

  void measure_all() {
    for (const EdgeSamplerType& type : types_) {
      std::optional<Measured> method = measure(type);
      if (!method) break;
      measured_.push_back(std::move(*method));
    }
    if (progress_ && is_done()) progress_(1);
  }

  // Nothing if interrupted.
  std::optional<Measured> measure(const EdgeSamplerType& type) {
    Measured method;
    method.sampler = type.make(input_, threads_);
    method.tree = method.sampler->rejection_tree();
    const RejectionTree& tree = *method.tree;
    if (node_edges_.empty()) choose_places(tree);
    RejectVariant& v = method.figures;
    v.name = type.name;
    v.description = type.description;
    v.match = best_match(input_, tree, node_edges_);
    v.node = tree.nodes()[v.match.node];
    for (const Slice& slice : slices_) {
      method.slices.push_back({slice, judge_slice(input_, tree, v.match.node, slice, threads_)});
      v.slices.push_back(count(method.slices.back().verdicts));
      if (!go_on(0.2 * static_cast<double>(method.slices.size()))) return std::nullopt;
    }
    v.reach = reach_from(input_, tree, point_);
    v.counts = count_reach(input_, tree, queries_, threads_);
    if (!go_on(0.8)) return std::nullopt;
    v.hits = acceptance_rate(*method.sampler, queries_, kDraws, seed_, threads_);
    if (!go_on(0.95)) return std::nullopt;
    return method;
  }

  struct Pictures {
    std::vector<Image> slices;
    Image edges;
  };
  Pictures draw(const Measured& method) const {
    const RejectVariant& v = method.figures;
    Pictures pictures;
    for (const auto& [slice, verdicts] : method.slices)
      pictures.slices.push_back(
          slice_picture(subject(), *method.tree, v.match.node, slice, verdicts));
    pictures.edges = reach_picture(*reach_view_, clay_, mesh(), v.reach, point_);
    return pictures;
  }

  void write(const Measured& method, const Pictures& pictures) const {
    const std::string& name = method.figures.name;
    for (size_t i = 0; i < pictures.slices.size(); ++i)
      write_png(file(slice_file(name, i)), pictures.slices[i], 1);
    write_png(file(edges_file(name)), pictures.edges, 1);
  }

  bool is_done() const { return measured_.size() == types_.size(); }

  // Shows how much of the current method is done; false if interrupted.
  bool go_on(double part) const {
    if (progress_)
      progress_((static_cast<double>(measured_.size()) + part) /
                static_cast<double>(types_.size()));
    return !interrupt_flag().load();
  }

  // With the verdicts of the first method.
  Image draw_overview() const {
    std::vector<Vec3d> shown = mesh().positions;
    for (const Slice& slice : slices_)
      for (int k = 0; k < 4; ++k)
        shown.push_back(slice.point(k % 2 * slice.size, k / 2 * slice.size));
    const Vec3d view = patch_.across * 0.75 + patch_.bend * 0.6 + patch_.normal * 0.35;
    const Camera camera = camera_for(shown, view, command_.up, command_.size);
    return overview_picture({scene_, *tracer_, camera, threads_}, mesh(), node_edges_,
                            measured_[0].slices);
  }

  std::vector<RejectVariant> variants() const {
    std::vector<RejectVariant> all;
    for (const Measured& method : measured_) all.push_back(method.figures);
    return all;
  }

  // Of the chosen node, by the first method that has one.
  json chart_json() const {
    for (const Measured& method : measured_) {
      const auto* tree = dynamic_cast<const ChartedTree*>(method.tree.get());
      const auto chart = tree ? tree->chart(method.figures.match.node) : std::nullopt;
      if (!chart) continue;
      json edges = json::array();
      for (const auto& [a, b] : chart->edges) edges.push_back({to_json(a), to_json(b)});
      return {{"method", method.figures.name},
              {"linear", chart->linear},
              {"square", chart->square},
              {"product", chart->product},
              {"low", chart->low},
              {"high", chart->high},
              {"edges", edges}};
    }
    return nullptr;
  }

  void write_figures() const {
    json report = {
        {"kind", "reject"},
        {"command", command_.command_line},
        {"mesh", common_.scene},
        {"shape", scene_.shapes[0].id},
        {"edges", mesh().edges.size()},
        {"seed", seed_},
        {"variants", json::array()},
        {"overview", "overview.png"},
        {"node", {{"index", node_}, {"depth", node_depth_}, {"edges", node_edges_.size()}}},
        {"point", to_json(point_)},
        {"points", queries_.size()},
        {"colors", colors_json()},
        {"chart", chart_json()},
        {"status", is_done() ? "done" : "interrupted"}};
    for (const RejectVariant& v : variants()) report["variants"].push_back(to_json(v));
    write_json(file("reject.json"), report.dump(2));
  }

  void print() const {
    fmt::print("{}: {} edges; node {} of {}, at depth {}, has {}\n", common_.scene,
               mesh().edges.size(), node_, types_[0].name, node_depth_, node_edges_.size());
    print_table(variants());
  }

  int status() const {
    int result = is_done() ? kSuccess : kInterrupted;
    if (result == kInterrupted)
      fmt::print(stderr, "interrupted: {} of {} methods are done\n", measured_.size(),
                 types_.size());
    for (const RejectVariant& variant : variants()) {
      if (variant.missed() == 0) continue;
      fmt::print(
          stderr,
          "error: {} MISSES SILHOUETTES: {} times it rejected what holds one; gradients with it "
          "are biased. See {}\n",
          variant.name, variant.missed(), file("reject.json"));
      result = kDisagree;
    }
    return result;
  }

  const CommonOptions& common_;
  const RejectCommand& command_;
  int threads_;
  std::vector<EdgeSamplerType> types_;
  Warnings warnings_;
  Scene scene_;
  std::function<void(double)> progress_;
  EdgeSamplerInput input_;
  std::unique_ptr<RayTracer> tracer_;
  Sphere sphere_;
  uint64_t seed_ = 0;
  std::vector<EdgeQuery> queries_;
  uint32_t node_ = 0, node_depth_ = 0;
  std::vector<EdgeRef> node_edges_;
  Patch patch_;
  std::array<Slice, 2> slices_;
  Vec3d point_;
  std::optional<MeshView> reach_view_;
  Image clay_;
  std::vector<Measured> measured_;
};

class RejectProgram final : public Command {
 public:
  const char* name() const override { return "reject"; }
  const char* description() const override {
    return "Draw and measure which edges the samplers reject, accept and falsely accept";
  }
  void add_options(CLI::App& app) override {
    add_input_options(app, common_, "scene", "Scene file, or a mesh (.obj, .ply)", "SCENE|MESH");
    add_reject_options(app, command_);
  }
  int run(const std::string& command_line) override {
    command_.command_line = command_line;
    std::error_code failed;
    std::filesystem::create_directories(command_.output, failed);
    if (failed) {
      throw InputError({command_.output}, "the folder cannot be made: " + failed.message());
    }
    watch_interrupt();
    return Rejection(common_, command_).run();
  }

 private:
  CommonOptions common_;
  RejectCommand command_;
};

}  // namespace

std::unique_ptr<Command> make_reject_command() { return std::make_unique<RejectProgram>(); }

}  // namespace limn
