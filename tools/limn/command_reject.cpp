// limn reject: measures what samplers reject, and draws it over slices of space.
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <numeric>

#include "limn/core/error.h"
#include "limn/core/image.h"
#include "limn/core/make_bsdf.h"
#include "limn/core/names.h"
#include "limn/core/parallel.h"
#include "limn/core/ray_tracer.h"
#include "limn/edgetree/edge_sampler_types.h"
#include "limn/edgetree/quadric_chart.h"
#include "limn/edgetree/rejection.h"
#include "tools/limn/command_support.h"
#include "tools/limn/commands.h"
#include "tools/limn/output_files.h"
#include "tools/limn/table.h"
#include "tools/limn/terminal.h"

namespace limn {
namespace {

using nlohmann::json;

constexpr int kDraws = 100;  // per point, for the acceptance rate

struct RejectCommand {
  std::string output;  // folder
  std::string shape;   // id; "" for the one with the most edges
  // Those whose rejection differs.
  std::vector<std::string> methods = {"forest", "quadric", "quadric:quadrics=off", "li2019"};
  std::optional<uint32_t> node;  // of the first method's tree
  uint32_t node_edges = 256;     // a node of about this size, if none is named
  double extent = 1.3;           // half-width of slices in radii of the mesh
  double distance = 0.5;         // between them
  int size = 768;                // of pictures, pixels
  int points = 400;              // for the counts by depth and the acceptance rate
  bool report = true;
  std::string command_line;
};

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

// ---- Figures.

// What was measured of one sampler.
struct RejectVariant {
  std::string name, description;
  Match match;  // its node
  RejectionNode node{};
  std::vector<VerdictCounts> slices;
  ReachCounts counts;  // from many points
  AcceptanceRate hits;

  // How often a test rejected what holds an edge of E(p), and edges of E(p) that were not reached.
  uint64_t missed() const {
    uint64_t sum = counts.missed;
    for (const VerdictCounts& slice : slices) sum += slice[static_cast<int>(NodeVerdict::kMissed)];
    for (const DepthCounts& depth : counts.by_depth) sum += depth.missed;
    return sum;
  }
  std::string slice_file(size_t i) const {
    return fmt::format("{}_slice_{}.png", file_part(name), i);
  }
  // Edges where a descent can end over those of E(p) among them.
  double reached_per_silhouette() const {
    const auto reached = static_cast<double>(counts.silhouettes + counts.false_accepts);
    return counts.silhouettes > 0 ? reached / static_cast<double>(counts.silhouettes) : 0;
  }
};

constexpr const char* kVerdictNames[kVerdicts] = {"true_reject", "true_accept", "false_accept",
                                                  "missed"};
// sRGB, 0xrrggbb; they differ in lightness, too, for the colour-blind.
constexpr uint32_t kVerdictColors[kVerdicts] = {0xd9d9d9, 0x2f6fb7, 0xf28e2b, 0xd6006e};

uint64_t points_of(const VerdictCounts& counts) {
  return std::accumulate(counts.begin(), counts.end(), uint64_t{0});
}

json to_json(const RejectVariant& v) {
  json slices = json::array(), depths = json::array();
  for (size_t i = 0; i < v.slices.size(); ++i) {
    slices.push_back({{"picture", v.slice_file(i)}, {"points", points_of(v.slices[i])}});
    for (int k = 0; k < kVerdicts; ++k) slices.back()[kVerdictNames[k]] = v.slices[i][k];
  }
  for (const DepthCounts& c : v.counts.by_depth) {
    depths.push_back({{"depth", depths.size() + 1},
                      {"nodes_tested", c.tested},
                      {"accepted", c.accepted},
                      {"false_accepts", c.false_accepts},
                      {"missed", c.missed}});
  }
  return {{"name", v.name},
          {"description", v.description},
          {"node",
           {{"index", v.match.node},
            {"depth", v.node.depth},
            {"edges", v.node.end - v.node.begin},
            {"overlap", v.match.overlap}}},
          {"slices", slices},
          {"missed", v.missed()},
          {"reached_per_silhouette", v.reached_per_silhouette()},
          {"hit_rate", v.hits.mean},
          {"hit_rate_stderr", v.hits.standard_error},
          {"by_depth", depths}};
}

void print_table(std::span<const RejectVariant> variants) {
  Table table({{"method", true},
               {"node's edges"},
               {"rejected"},
               {"accepted"},
               {"false positives"},
               {"reached per silhouette"},
               {"acceptance rate"}});
  for (const RejectVariant& v : variants) {
    Table::Row row{v.name, std::to_string(v.node.end - v.node.begin)};
    VerdictCounts sum{};  // of both slices
    for (const VerdictCounts& slice : v.slices) {
      for (int k = 0; k < kVerdicts; ++k) sum[k] += slice[k];
    }
    for (int k = 0; k + 1 < kVerdicts; ++k) {
      const double share = static_cast<double>(sum[k]) / static_cast<double>(points_of(sum));
      row.push_back(fmt::format("{:.2f} %", 100 * share));
    }
    row.push_back(fmt::format("{:.2f}", v.reached_per_silhouette()));
    row.push_back(fmt::format("{:.4f} +- {:.4f}", v.hits.mean, v.hits.standard_error));
    table.add(std::move(row));
  }
  fmt::print("\n{}", table.text());
}

// ---- The run.

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
    seed_ = common.run.seed.value_or(scene_.seed);
    queries_ = queries_around(input_.objects[0], command.points, seed_);
  }

  int run() {
    for (const EdgeSamplerType& type : types_) {
      if (!measure(type)) break;
    }
    if (variants_.empty()) {
      fmt::print(stderr, "\ninterrupted before the first method was done: nothing is written\n");
      return kInterrupted;
    }
    if (progress_ && is_done()) progress_(1);
    write_figures();
    if (!common_.quiet) print();
    if (command_.report) write_report(command_.output, common_.quiet);
    return status();
  }

 private:
  std::string file(const std::string& name) const { return command_.output + "/" + name; }
  const EdgeMesh& mesh() const { return input_.objects[0]; }
  bool is_done() const { return variants_.size() == types_.size(); }

  // The first method chooses the node, and with it the slices that all are looked at in.
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
    const double radius = radius_of(mesh());
    slices_ = slices_around(patch_of(input_, edges), command_.extent * radius,
                            command_.distance * radius, command_.size);
  }

  // False if interrupted.
  bool measure(const EdgeSamplerType& type) {
    const std::unique_ptr<EdgeSampler> sampler = type.make(input_, threads_);
    const std::unique_ptr<RejectionTree> tree = sampler->rejection_tree();
    if (node_edges_.empty()) choose_places(*tree);
    RejectVariant v;
    v.name = type.name;
    v.description = type.description;
    v.match = best_match(input_, *tree, node_edges_);
    v.node = tree->nodes()[v.match.node];
    std::vector<std::vector<NodeVerdict>> verdicts;
    for (const Slice& slice : slices_) {
      verdicts.push_back(judge_slice(input_, *tree, v.match.node, slice, threads_));
      v.slices.push_back(count(verdicts.back()));
      if (!go_on(0.4 * static_cast<double>(v.slices.size()))) return false;
    }
    v.counts = count_reach(input_, *tree, queries_, threads_);
    if (!go_on(0.9)) return false;
    v.hits = acceptance_rate(*sampler, queries_, kDraws, seed_, threads_);
    if (!go_on(0.95)) return false;
    for (size_t i = 0; i < verdicts.size(); ++i)
      write_png(file(v.slice_file(i)), picture(slices_[i], verdicts[i]), 1);
    if (chart_.is_null()) chart_ = chart_json(type.name, *tree, v.match.node);
    variants_.push_back(std::move(v));
    return true;
  }

  // A colour for each verdict, darker inside of the mesh.
  Image picture(const Slice& slice, const std::vector<NodeVerdict>& verdicts) const {
    Image image(slice.size, slice.size, 3);
    parallel_for(slice.size, threads_, [&](size_t y) {
      for (int x = 0; x < slice.size; ++x) {
        const size_t i = y * slice.size + x;
        const double light = is_inside(slice, x, static_cast<int>(y)) ? 0.72 : 1;
        for (int c = 0; c < 3; ++c) {
          const uint32_t byte = kVerdictColors[static_cast<int>(verdicts[i])] >> (16 - 8 * c) & 255;
          image.data[3 * i + c] = static_cast<float>(light * srgb_decode(byte / 255.0));
        }
      }
    });
    return image;
  }
  // In a closed mesh: what a ray meets first is seen from behind.
  bool is_inside(const Slice& slice, int x, int y) const {
    if (!mesh().one_sided_closed) return false;
    const Ray ray{slice.point(x + 0.5, y + 0.5), normalize(cross(slice.right, slice.up))};
    Hit hit;
    return tracer_->closest(ray, hit) && dot(mesh().plane(hit.face.face).n, ray.direction) > 0;
  }

  // Shows how much of the current method is done; false if interrupted.
  bool go_on(double part) const {
    if (progress_)
      progress_((static_cast<double>(variants_.size()) + part) /
                static_cast<double>(types_.size()));
    return !interrupt_flag().load();
  }

  // The quadrics of the node, if the method has them.
  static json chart_json(const std::string& method, const RejectionTree& tree, uint32_t node) {
    const auto* charted = dynamic_cast<const ChartedTree*>(&tree);
    const auto chart = charted ? charted->chart(node) : std::nullopt;
    if (!chart) return nullptr;
    json edges = json::array();
    for (const auto& [a, b] : chart->edges) edges.push_back({to_json(a), to_json(b)});
    return {{"method", method},        {"linear", chart->linear},
            {"square", chart->square}, {"product", chart->product},
            {"low", chart->low},       {"high", chart->high},
            {"edges", edges}};
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
        {"node", {{"index", node_}, {"depth", node_depth_}, {"edges", node_edges_.size()}}},
        {"points", queries_.size()},
        {"chart", chart_},
        {"status", is_done() ? "done" : "interrupted"}};
    for (int k = 0; k < kVerdicts; ++k)
      report["colors"][kVerdictNames[k]] = fmt::format("#{:06x}", kVerdictColors[k]);
    for (const RejectVariant& v : variants_) report["variants"].push_back(to_json(v));
    write_json(file("reject.json"), report.dump(2));
  }

  void print() const {
    fmt::print("{}: {} edges; node {} of {}, at depth {}, has {}\n", common_.scene,
               mesh().edges.size(), node_, types_[0].name, node_depth_, node_edges_.size());
    print_table(variants_);
  }

  int status() const {
    int result = is_done() ? kSuccess : kInterrupted;
    if (result == kInterrupted)
      fmt::print(stderr, "interrupted: {} of {} methods are done\n", variants_.size(),
                 types_.size());
    for (const RejectVariant& variant : variants_) {
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
  uint64_t seed_ = 0;
  std::vector<EdgeQuery> queries_;
  uint32_t node_ = 0, node_depth_ = 0;
  std::vector<EdgeRef> node_edges_;
  std::array<Slice, 2> slices_;
  std::vector<RejectVariant> variants_;
  json chart_;
};

void add_reject_options(CLI::App& app, RejectCommand& command) {
  app.add_option("-o,--output", command.output, "Folder for pictures, figures and report")
      ->required()
      ->type_name("FOLDER");
  app.add_option("--methods", command.methods,
                 "Edge samplers to examine; the first one's tree chooses the node")
      ->delimiter(',')
      ->capture_default_str();
  app.add_option("--shape", command.shape,
                 "Id of the shape to examine (default: the shape with the most edges)");
  app.add_option(
         "--node-edges", command.node_edges,
         "Choose a node of about this many edges that is accepted about as often as rejected")
      ->check(within(1, 1 << 30))
      ->capture_default_str();
  app.add_option(
         "--node", command.node,
         "Number of the node to examine in the first method's tree, in place of --node-edges")
      ->check(within(0, 1u << 31));
  app.add_option("--extent", command.extent, "Half-width of the slices, in radii of the mesh")
      ->check(within(1e-3, 1e3))
      ->capture_default_str();
  app.add_option("--distance", command.distance, "Distance of the slices, in radii of the mesh")
      ->check(within(0.0, 1e3))
      ->capture_default_str();
  app.add_option("--size", command.size, "Width and height of pictures, in pixels")
      ->check(within(16, 8192))
      ->capture_default_str();
  app.add_option(
         "--points", command.points,
         "Points around the mesh from which acceptance rates and counts by depth are measured")
      ->check(within(2, 1 << 24))
      ->capture_default_str();
  app.add_flag_callback(
      "--no-report", [&] { command.report = false; }, "Write no report.html");
}

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
