// Folders of fits: JSON for people and reports, CBOR for states, meshes and pictures.
#include "tools/limn/fit_folder.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <set>

#include "limn/core/error.h"
#include "limn/core/parameter.h"
#include "limn/integrators/mesh_distance.h"
#include "limn/integrators/parts.h"
#include "limn/integrators/render.h"
#include "tools/limn/command_support.h"
#include "tools/limn/table.h"
#include "tools/limn/terminal.h"

// Vectors as a list of their numbers.
template <class T>
struct nlohmann::adl_serializer<std::vector<limn::Vec3<T>>> {
  static void to_json(json& list, const std::vector<limn::Vec3<T>>& vectors) {
    list = json::array();
    for (const limn::Vec3<T>& v : vectors) {
      for (int k = 0; k < 3; ++k) list.push_back(static_cast<double>(v[k]));
    }
  }
  static void from_json(const json& list, std::vector<limn::Vec3<T>>& vectors) {
    vectors.resize(list.size() / 3);
    for (size_t i = 0; i < 3 * vectors.size(); ++i) {
      vectors[i / 3][static_cast<int>(i % 3)] = static_cast<T>(list[i].get<double>());
    }
  }
};

namespace limn {

// Fields by their names, for writing and reading.
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(ViewArguments, scene, defines, sensor, target, mask, alpha,
                                   fingerprints)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(FitState::Numbers, values, first, second, natural_step, lambda)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(FitState::Shape, positions, normals, faces)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(FitState::View, camera, shapes, pivots, values, courses, texels)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(FitState, steps, parameters, moves, changes, views)

namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr int kFormat = 8;                  // of fit.json and state.cbor
constexpr size_t kDistanceSamples = 10000;  // on each surface; not tuned

// Calls visit(name, member) for what is no row of the table of options: reading and writing go over
// one list.
template <class Arguments, class Visit>
void visit_arguments(Arguments& a, const Visit& visit) {
  visit("views", a.views);
  visit("parameters", a.options.parameters);
  visit("bounds", a.bounds);
  visit("shading", a.shading);
  visit("spp", a.spp);
  visit("seed", a.seed);
  visit("steps", a.steps);
  visit("snapshots", a.snapshots);
  visit("truth", a.truth);
}

json to_json(const FitArguments& a) {
  json j;
  visit_arguments(a, [&](const char* name, const auto& member) { j[name] = member; });
  visit_options(a.options, [&]<class T>(const T& value, const Option& option) {
    if constexpr (Choice<T>) {
      j[option.name] = word_of(value, option);
    } else if constexpr (std::same_as<T, Method>) {
      j[option.name] = value.name();
    } else {
      j[option.name] = value;
    }
  });
  return j;
}

FitArguments arguments_from(const json& j) {
  FitArguments a;
  visit_arguments(a, [&](const char* name, auto& member) { j.at(name).get_to(member); });
  visit_options(a.options, [&]<class T>(T& value, const Option& option) {
    const json& given = j.at(option.name);
    if constexpr (Choice<T>) {
      set_word(value, option, given.get<std::string>());
    } else if constexpr (std::same_as<T, Method>) {
      value = given.get<std::string>();
    } else {
      given.get_to(value);
    }
  });
  return a;
}

std::string read_whole(const std::string& file) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream) throw InputError({file}, "cannot be read: no fit was interrupted in this folder");
  return {std::istreambuf_iterator<char>(stream), {}};
}

FitBounds parse_bounds(const std::string& text) {
  const size_t equals = text.rfind('='), comma = text.rfind(',');
  try {
    if (equals == text.npos || comma == text.npos || comma < equals) throw std::logic_error("");
    size_t used = 0;
    const std::string low = text.substr(equals + 1, comma - equals - 1);
    const std::string high = text.substr(comma + 1);
    FitBounds bounds{text.substr(0, equals), std::stod(low, &used), 0};
    if (used != low.size()) throw std::logic_error("");
    bounds.most = std::stod(high, &used);
    if (used != high.size()) throw std::logic_error("");
    return bounds;
  } catch (const std::logic_error&) {  // no number, or too large a one
    throw InputError("--bounds: \"" + text + "\" is not NAME=LEAST,MOST, as in glow.radiance=0,5");
  }
}

std::string fingerprint_of(const Image& image) {
  std::vector<double> numbers{double(image.width), double(image.height), double(image.channels)};
  numbers.insert(numbers.end(), image.data.begin(), image.data.end());
  return fingerprint(numbers);
}

// Of all that a view was read from, by what it is; of fields by the parameter's name.
std::map<std::string, std::string> fingerprints_of(const FitView& view,
                                                   const std::vector<std::string>& parameters) {
  std::map<std::string, std::string> all{{"scene", fingerprint(view.scene)},
                                         {"target", fingerprint_of(view.target)},
                                         {"mask", fingerprint_of(view.mask)}};
  for (const std::string& name : parameters) {
    if (field_files({name}).empty()) continue;
    try {
      all[name] = fingerprint(view.scene, {find_parameter(view.scene, name)});
    } catch (const UnknownParameter&) {  // of another view
    }
  }
  return all;
}

// That map of texels in the first view that has it; null if the name is another kind of parameter.
const TexelMap* with_map(const Fit& fit, const std::string& name) {
  for (const FitView& view : fit.views()) {
    try {
      const Parameter parameter = find_parameter_or_array(view.scene, name);
      if (parameter.array.size() == 3) return parameter.texel_map(view.scene);
    } catch (const UnknownParameter&) {  // of another view
    }
  }
  return nullptr;
}

// Shapes whose vertices are fitted or moved, each from the first view that has it.
std::vector<const Shape*> fitted_shapes(const Fit& fit,
                                        const std::vector<std::string>& parameters) {
  std::vector<const Shape*> shapes;
  for (const FitView& view : fit.views()) {
    const Scene& scene = view.scene;
    const std::vector<const Shape*> earlier = shapes;
    for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
      const auto moves = [&](const std::string& name) {
        try {
          return !find_parameter_or_array(scene, name).velocities(scene, ShapeId(s)).empty();
        } catch (const UnknownParameter&) {  // of another view
          return false;
        }
      };
      const auto same = [&](const Shape* other) { return other->id == scene.shapes[s].id; };
      if (std::any_of(earlier.begin(), earlier.end(), same)) continue;
      if (!std::any_of(parameters.begin(), parameters.end(), moves)) continue;
      shapes.push_back(&scene.shapes[s]);
    }
  }
  return shapes;
}

// A line per step.
std::string csv_text(const json& history, const std::vector<FitScalar>& scalars) {
  std::string csv = "step,loss,stderr,step_size,halvings,sigma,seconds";
  for (const FitScalar& s : scalars) csv += "," + s.name;
  csv += "\n";
  for (const json& r : history) {
    const json& error = r.at("stderr");
    csv += fmt::format("{},{:.9g},{},{:.9g},{},{:.9g},{:.3f}", r.at("step").get<int64_t>(),
                       r.at("loss").get<double>(),
                       error.is_null() ? "" : fmt::format("{:.3g}", error.get<double>()),
                       r.at("step_size").get<double>(), r.at("halvings").get<int>(),
                       r.at("sigma").get<double>(), r.at("seconds").get<double>());
    for (const FitScalar& s : scalars) {
      csv += fmt::format(",{:.9g}", r.at("values").at(s.name).get<double>());
    }
    csv += "\n";
  }
  return csv;
}

}  // namespace

FitOptions FitArguments::all_options() const {
  FitOptions all = options;
  for (const std::string& text : bounds) all.bounds.push_back(parse_bounds(text));
  // A fit at rest goes on to its next remeshing: it must not go past its end.
  std::erase_if(all.remesh, [&](int64_t step) { return step > steps; });
  return all;
}

FitFolder::FitFolder(const std::string& folder, const FitArguments& arguments)
    : folder_(folder), arguments_(arguments) {}

std::string FitFolder::file(const std::string& name) const {
  return (fs::path(folder_) / name).string();
}

FitFolder FitFolder::read(const std::string& folder) {
  FitFolder found(folder, {});
  const std::string file = found.file("fit.json");
  try {
    const json j = json::parse(read_whole(file));
    if (j.value("format", 0) != kFormat) {
      throw InputError({file}, "was written by another version of limn: begin another fit");
    }
    found.arguments_ = arguments_from(j.at("arguments"));
    found.history_ = j.at("history").get<json::array_t>();
    found.snapshots_ = j.at("snapshots").get<json::array_t>();
  } catch (const json::exception& error) {
    throw InputError({file}, std::string("is not what a fit writes: ") + error.what());
  }
  if (found.arguments_.views.empty()) {
    throw InputError({file}, "is not what a fit writes: it has no views");
  }
  return found;
}

void FitFolder::check_inputs(const std::vector<FitView>& views) const {
  for (size_t v = 0; v < views.size(); ++v) {
    const ViewArguments& view = arguments_.views[v];
    const auto now = fingerprints_of(views[v], arguments_.options.parameters);
    const std::map<std::string, std::string> files{
        {"scene", view.scene}, {"target", view.target}, {"mask", view.mask}};
    for (const auto& [what, then] : view.fingerprints) {
      const auto found = now.find(what);
      if (found != now.end() && found->second == then) continue;
      // A field is named by its parameter.
      const auto file = files.find(what);
      throw InputError({file == files.end() ? what : file->second},
                       "is not as it was when the fit in " + folder_ +
                           " began: put it back, or begin another fit");
    }
  }
}

void FitFolder::prepare(const std::vector<FitView>& views) {
  std::error_code failed;
  if (fs::exists(file("state.cbor"), failed)) {
    throw InputError({folder_}, "holds a fit already: go on with --resume " + folder_ +
                                    ", or take another folder");
  }
  fs::create_directories(folder_, failed);
  std::vector<PlannedFile> files;
  for (const char* name : {"fit.json", "state.cbor", "history.csv"}) {
    files.push_back({"-o", file(name)});
  }
  std::vector<std::string> inputs{arguments_.truth};
  for (const ViewArguments& view : arguments_.views) {
    inputs.push_back(view.target);
    inputs.push_back(view.mask);
  }
  for (const std::string& field : field_files(arguments_.options.parameters))
    inputs.push_back(field);
  for (const FitView& view : views) check_outputs(files, view.scene, inputs);
  for (size_t v = 0; v < views.size(); ++v) {
    arguments_.views[v].fingerprints = fingerprints_of(views[v], arguments_.options.parameters);
  }
}

void FitFolder::restore(Fit& fit) {
  const std::string name = file("state.cbor");
  const std::string bytes = read_whole(name);
  try {
    fit.restore(json::from_cbor(bytes).get<FitState>());
  } catch (const json::exception& error) {
    throw InputError({name}, std::string("is not the state of a fit: ") + error.what());
  } catch (const InputError&) {
    throw InputError({name}, "is the state of another fit: of other parameters or meshes");
  }
  const auto forget = [&](json& list) {
    json kept = json::array();
    for (const json& entry : list) {
      if (entry.at("step").get<int64_t>() < fit.steps() + (&list == &snapshots_ ? 1 : 0)) {
        kept.push_back(entry);
      }
    }
    list = std::move(kept);
  };
  try {
    forget(history_);
    forget(snapshots_);
    csv_text(history_, fit.scalars());  // all that is read of them later
  } catch (const json::exception& error) {
    throw InputError({file("fit.json")},
                     std::string("is not what this fit writes: ") + error.what());
  }
}

bool FitFolder::at_rest(const Fit& fit) const {
  if (history_.empty() || !history_.back().value("at_rest", false)) return false;
  const auto& remesh = arguments_.options.remesh;
  return std::none_of(remesh.begin(), remesh.end(),
                      [&](int64_t step) { return step > fit.steps() && step <= arguments_.steps; });
}

void FitFolder::add(const FitRecord& r, const Fit& fit) {
  json scalars = json::object();
  const auto list = fit.scalars();
  for (size_t i = 0; i < list.size(); ++i) scalars[list[i].name] = r.values[i];
  history_.push_back({{"step", r.step},
                      {"loss", r.loss},
                      {"stderr", number(r.error)},
                      {"views", r.view_losses},
                      {"step_size", r.step_size},
                      {"halvings", r.halvings},
                      {"sigma", r.sigma},
                      {"evaluations", r.evaluations},
                      {"at_rest", r.at_rest},
                      {"values", scalars},
                      {"seconds", r.seconds}});
}

json FitFolder::mesh_figures(const Shape& s, const std::string& name, int threads) const {
  write_file(file(name), ply_text(s.mesh));
  json figures = {{"shape", s.id}, {"file", name}, {"crossings", count_crossings(s.mesh, threads)}};
  const auto inside_out = count_inside_out(s.mesh, threads);
  figures["inside_out"] = inside_out ? json(*inside_out) : json(nullptr);
  if (arguments_.truth.empty()) return figures;
  const Mesh truth = read_mesh(arguments_.truth, true);
  const double diagonal = bounds_of(truth).diagonal();
  const MeshDistance d = mesh_distance(s.mesh, truth, kDistanceSamples, 0, threads);
  figures["chamfer"] = d.chamfer / diagonal;
  figures["hausdorff"] = d.hausdorff / diagonal;
  figures["hausdorff_95"] = d.hausdorff_95 / diagonal;
  figures["normal_angle"] = d.normal_angle * 180 / kPi;
  return figures;
}

void FitFolder::print_snapshot(const Fit& fit, const json& meshes) {
  std::vector<Table::Column> columns;
  Table::Row cells;
  const auto add = [&](const std::string& heading, size_t width, const std::string& cell) {
    columns.push_back({heading, false, width});
    cells.push_back(cell);
  };
  const json last = history_.empty() ? json::object() : history_.back();
  const auto figure = [](const json& of, const char* key, auto format) {
    const auto at = of.find(key);
    return at == of.end() || at->is_null() ? "-" : fmt::format(format, at->template get<double>());
  };
  add("step", 6, std::to_string(fit.steps()));
  add("loss", 10, figure(last, "loss", FMT_STRING("{:.4g}")));
  add("std. error", 10, figure(last, "stderr", FMT_STRING("{:.1g}")));
  if (arguments_.options.blur_steps > 0)
    add("sigma", 10, figure(last, "sigma", FMT_STRING("{:.3g}")));
  for (const FitScalar& s : fit.scalars()) add(s.name, 12, fmt::format("{:.6g}", s.value));
  for (const json& mesh : meshes) {
    const std::string shape = mesh.at("shape").get<std::string>();
    add(shape + ": crossings", 0, figure(mesh, "crossings", FMT_STRING("{:.0f}")));
    add("inside out", 0, figure(mesh, "inside_out", FMT_STRING("{:.0f}")));
    if (!mesh.contains("chamfer")) continue;
    add("chamfer / diagonal", 0, figure(mesh, "chamfer", FMT_STRING("{:.4f}")));
    add("normals [degrees]", 0, figure(mesh, "normal_angle", FMT_STRING("{:.1f}")));
  }
  clear_progress();
  if (!told_negative_ && !history_.empty() && history_.back().at("loss").get<double>() < 0) {
    fmt::print("the loss is an unbiased estimate: near zero, noise takes single ones below it\n");
    told_negative_ = true;
  }
  const Table table(columns);
  const std::string headings = table.heading_line();
  if (headings != headings_) fmt::print("{}", headings);
  headings_ = headings;
  fmt::print("{}", table.line(cells));
}

void FitFolder::add_snapshot(const Fit& fit, const RunSettings& settings, int spp, bool quiet) {
  const bool again = !snapshots_.empty() && snapshots_.back().at("step") == fit.steps();
  if (again && spp == 0) return;  // its pictures stay
  json snapshot = {{"step", fit.steps()}, {"meshes", json::array()}, {"pictures", json::array()}};
  std::set<std::string> names;
  for (const Shape* shape : fitted_shapes(fit, arguments_.options.parameters)) {
    std::string name = fmt::format("step_{:05}_{}", fit.steps(), file_part(shape->id));
    // Ids that differ may be one as names of files.
    while (!names.insert(name).second) name += "_";
    snapshot["meshes"].push_back(mesh_figures(*shape, name + ".ply", settings.threads));
  }
  for (const std::string& name : arguments_.options.parameters) {
    const TexelMap* map = with_map(fit, name);
    if (!map) continue;
    std::string base = fmt::format("step_{:05}_{}", fit.steps(), file_part(name));
    while (!names.insert(base).second) base += "_";
    const Image texels = map->texels();
    write_exr(file(base + ".exr"), texels, false, {});
    write_png(file(base + ".png"), texels, 1);
    snapshot["maps"].push_back({{"name", name}, {"file", base + ".exr"}});
  }
  for (size_t v = 0; v < fit.views().size() && spp > 0; ++v) {
    const FitView& view = fit.views()[v];
    RunSettings own = settings;
    own.spp = spp;
    own.progress = nullptr;
    // Where the fit sees a function without noise, so do its pictures.
    RenderOptions seen;
    seen.points = arguments_.options.backward.points;
    const bool faces = seen.points == FilmPoints::kFaces;
    if (faces) seen.method = loss_method(arguments_.options.backward.method);
    const RenderResult image = render(view.scene, own, seen);
    if (image.spp < (faces ? 1 : spp)) break;  // interrupted
    const Film& film = view.scene.film;
    const std::string name = fmt::format("step_{:05}_view_{}.png", fit.steps(), v);
    // Images of coverage_of() are less by 1.
    const auto write = [&](const std::string& to, Image picture) {
      for (float& value : picture.data) value += arguments_.views[v].alpha ? 1 : 0;
      write_png(file(to), picture, 1);
    };
    write(name, mean_image(image.radiance, film.crop_width, film.crop_height));
    snapshot["pictures"].push_back(name);
    write(fmt::format("view_{}_target.png", v), view.target);
  }
  // A run that goes on has one of where it was interrupted.
  if (again) snapshots_.erase(snapshots_.size() - 1);
  snapshots_.push_back(snapshot);
  if (quiet) return;
  print_snapshot(fit, snapshot["meshes"]);
  std::fflush(stdout);  // also where it goes to a file: the next one may be an hour away
}

void FitFolder::write(const Fit& fit, const std::string& status,
                      const std::vector<std::string>& warnings) {
  json targets = json::array(), scalars = json::array();
  for (size_t v = 0; v < fit.views().size(); ++v) {
    targets.push_back(fmt::format("view_{}_target.png", v));
  }
  for (const FitScalar& s : fit.scalars()) {
    scalars.push_back({{"name", s.name}, {"unit", s.unit}, {"value", s.value}});
  }
  const json all = {{"kind", "fit"},        {"format", kFormat},
                    {"status", status},     {"arguments", to_json(arguments_)},
                    {"steps", fit.steps()}, {"scalars", scalars},
                    {"targets", targets},   {"warnings", warnings},
                    {"history", history_},  {"snapshots", snapshots_}};
  write_file(file("fit.json"), all.dump(1) + "\n");
  write_file(file("history.csv"), csv_text(history_, fit.scalars()));
  const std::vector<uint8_t> state = json::to_cbor(json(fit.state()));
  write_file(file("state.cbor"), std::string(state.begin(), state.end()));
}

}  // namespace limn
