// References: made, written, and refused where they belong to something else.
#include "limn/integrators/reference.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "integrators/compare/edge_events.h"
#include "limn/core/error.h"

namespace limn {
namespace {

namespace fs = std::filesystem;

// Names of attributes that say what the reference belongs to, and how a user knows them.
const std::vector<std::pair<std::string, std::string>> kNames = {
    {"limn.identity.scene", "content of the scene file"},
    {"limn.identity.data", "content of the scene's meshes and maps"},
    {"limn.identity.defines", "defines"},
    {"limn.identity.parameter", "parameter"},
    {"limn.identity.terms", "terms"},
    {"limn.identity.shading", "shading"},
    {"limn.identity.film", "film and crop"},
};

std::string spoken_name(const std::string& attribute) {
  for (const auto& [name, spoken] : kNames) {
    if (name == attribute) return spoken;
  }
  return attribute;
}

// FNV-1a, 64 bits.
uint64_t hash_files(const std::vector<std::string>& files) {
  uint64_t hash = 0xcbf29ce484222325ull;
  const auto add = [&](unsigned char byte) { hash = (hash ^ byte) * 0x100000001b3ull; };
  for (const std::string& file : files) {
    std::ifstream stream(file, std::ios::binary);
    std::vector<char> buffer(1 << 16);
    uint64_t size = 0;
    do {
      stream.read(buffer.data(), static_cast<std::streamsize>(buffer.size()));
      const auto got = static_cast<size_t>(stream.gcount());
      for (size_t i = 0; i < got; ++i) add(static_cast<unsigned char>(buffer[i]));
      size += got;
    } while (stream);
    if (stream.bad() || !stream.eof()) throw InputError({file}, "cannot read the file");
    for (int i = 0; i < 8; ++i) add(static_cast<unsigned char>(size >> (8 * i)));
  }
  return hash;
}

// The parameter's name; vector fields come as files, whose content counts.
std::string parameter_identity(const std::string& parameter, std::vector<std::string>& files) {
  const size_t colon = parameter.find(':');
  if (colon == std::string::npos) return parameter;
  files.push_back(parameter.substr(colon + 1));
  return parameter.substr(0, colon);
}

// The terms that the default method computes for these options.
std::string join_terms(const MethodInput& input) {
  if (input.terms.empty()) return "all";
  std::string text;
  for (const std::string& name : input.terms) text += (text.empty() ? "" : ",") + name;
  return text;
}

std::string stderr_file(const std::string& file) {
  return fs::path(file).replace_extension("").string() + "_stderr.exr";
}

std::string join_numbers(const std::vector<double>& values) {
  std::string text;
  for (const double v : values) text += fmt::format("{}{:.17g}", text.empty() ? "" : " ", v);
  return text;
}

std::vector<double> split_numbers(const std::string& text) {
  std::istringstream stream(text);
  std::vector<double> values;
  for (double v; stream >> v;) values.push_back(v);
  return values;
}

using Attributes = std::map<std::string, std::string>;

Attributes attributes_of(const std::string& file) {
  Attributes attributes;
  for (const ImageAttribute& a : read_exr_attributes(file)) attributes[a.name] = a.value;
  return attributes;
}

// "" if all is equal.
std::string differences(const Attributes& attributes, const Identity& identity) {
  std::string text;
  for (const auto& [name, value] : identity) {
    const std::string& theirs = attributes.at(name);
    if (theirs == value) continue;
    text += fmt::format("\n  {}: \"{}\" there, \"{}\" here", spoken_name(name), theirs, value);
  }
  return text;
}

bool is_reference(const Attributes& attributes, const Identity& identity) {
  for (const auto& [name, value] : identity) {
    if (attributes.count(name) == 0) return false;
  }
  return true;
}

std::vector<double> read_values(const std::string& file, const Film& film) {
  const Image image = read_exr(file);
  if (image.width != film.crop_width || image.height != film.crop_height || image.channels != 3) {
    throw InputError({file},
                     fmt::format("is {} x {} with {} channels, not {} x {} with 3", image.width,
                                 image.height, image.channels, film.crop_width, film.crop_height));
  }
  return {image.data.begin(), image.data.end()};
}

void read_header(const Attributes& attributes, const Film& film, Reference& r) {
  r.method = attributes.at("limn.method");
  r.spp = std::stoll(attributes.at("limn.spp"));
  r.seed = std::stoull(attributes.at("limn.seed"));
  r.seconds = std::stod(attributes.at("limn.seconds"));
  r.asked_seconds = std::stod(attributes.at("limn.asked_seconds"));
  const int block = std::stoi(attributes.at("limn.block"));
  r.blocks.sums = sum_blocks(r.image, film.crop_width, film.crop_height, block);
  r.blocks.variances = split_numbers(attributes.at("limn.block_variances"));
  r.edges = split_numbers(attributes.at("limn.block_edges"));
  r.blocks.degrees = std::stod(attributes.at("limn.block_degrees"));
  r.blocks.event = std::stod(attributes.at("limn.block_event"));
}

Reference read_matching(const std::string& file, const Attributes& attributes, const Film& film) {
  const std::string errors = stderr_file(file);
  if (!fs::exists(errors)) {
    throw InputError({file}, "the file of its standard errors is missing: " + errors);
  }
  if (attributes_of(errors) != attributes) {
    throw InputError({file}, "the file of its standard errors is of another run: " + errors);
  }
  Reference r;
  r.image = read_values(file, film);
  r.variance = read_values(errors, film);
  for (double& v : r.variance) v *= v;
  r.cached = true;
  try {
    read_header(attributes, film, r);
  } catch (const std::logic_error&) {  // a number that is none, or an attribute that is missing
    throw InputError({file}, "the header of the reference is damaged");
  }
  const size_t blocks = r.blocks.sums.size();
  if (r.blocks.variances.size() != blocks || r.edges.size() != blocks) {
    throw InputError({file}, "the header of the reference is damaged: figures of blocks");
  }
  return r;
}

}  // namespace

Identity identify(const MethodInput& input, const std::map<std::string, std::string>& defines) {
  const Scene& scene = input.scene;
  std::vector<std::string> data = scene.data_files;
  const std::string parameter = parameter_identity(input.parameter, data);
  std::string given;
  for (const auto& [name, value] : defines) {
    given += fmt::format("{}{}={}", given.empty() ? "" : " ", name, value);
  }
  const Film& f = scene.film;
  const std::string values[] = {
      fmt::format("{:016x}", hash_files(scene.xml_files)),
      fmt::format("{:016x}", hash_files(data)),
      given,
      parameter,
      join_terms(input),
      scene.shading == ShadingModel::kMitsuba ? "mitsuba" : "continuous",
      fmt::format("{} x {} at {}, {}", f.crop_width, f.crop_height, f.crop_x, f.crop_y),
  };
  Identity identity;
  for (size_t i = 0; i < kNames.size(); ++i) identity.push_back({kNames[i].first, values[i]});
  return identity;
}

Reference make_reference(const MethodInput& input, const RunSettings& settings) {
  const Method method(Task::kCompare);
  RunSettings at_least_two = settings;
  at_least_two.least_spp = 2;  // for variances
  const GradientResult result = gradient(input.scene, input.options(method), at_least_two);
  const ParameterGradient& g = result.parameters[0];
  Reference r;
  r.image = means(g.total);
  r.variance = variances(g.total);
  r.blocks = block_sums(result);
  for (size_t b = 0; b < g.total_blocks.size(); ++b) {
    r.edges.push_back(edge_magnitude(result, g, b));
  }
  for (size_t b = 0; b < r.blocks.variances.size(); ++b) {
    r.blocks.variances[b] = std::max(r.blocks.variances[b], r.edges[b] * r.blocks.event);
  }
  r.method = method.name();
  r.spp = result.spp;
  r.seed = settings.seed;
  r.seconds = result.seconds;
  const bool interrupted = settings.interrupted && *settings.interrupted;
  r.asked_seconds = interrupted ? result.seconds : settings.seconds;
  r.non_finite = result.non_finite;
  return r;
}

void write_reference(const std::string& file, const Reference& reference, const Identity& identity,
                     const Film& film, int block) {
  std::vector<ImageAttribute> attributes = {
      {"limn.method", reference.method},
      {"limn.spp", std::to_string(reference.spp)},
      {"limn.seed", std::to_string(reference.seed)},
      {"limn.seconds", fmt::format("{}", reference.seconds)},
      {"limn.asked_seconds", fmt::format("{}", reference.asked_seconds)},
      {"limn.block", std::to_string(block)},
      {"limn.block_degrees", fmt::format("{}", reference.blocks.degrees)},
      {"limn.block_event", fmt::format("{}", reference.blocks.event)},
      {"limn.block_variances", join_numbers(reference.blocks.variances)},
      {"limn.block_edges", join_numbers(reference.edges)}};
  for (const auto& [name, value] : identity) attributes.push_back({name, value});
  std::vector<double> errors = reference.variance;
  for (double& e : errors) e = std::sqrt(e);
  // The image comes last: one that is there has its errors beside it.
  write_exr(stderr_file(file), to_image(errors, film), false, attributes);
  write_exr(file, to_image(reference.image, film), false, attributes);
}

Reference read_reference(const std::string& file, const Identity& identity, const Film& film) {
  const Attributes attributes = attributes_of(file);
  if (!is_reference(attributes, identity)) {
    throw InputError({file},
                     "is not a reference: its header does not say what it belongs to (limn compare "
                     "writes references)");
  }
  const std::string different = differences(attributes, identity);
  if (!different.empty()) {
    throw InputError({file}, "the reference belongs to something else:" + different);
  }
  return read_matching(file, attributes, film);
}

std::optional<Reference> find_reference(const std::string& file, const Identity& identity,
                                        const Film& film, double seconds, std::string& why) {
  why.clear();
  if (!fs::exists(file)) return std::nullopt;
  try {
    Reference reference = read_reference(file, identity, film);
    if (reference.asked_seconds >= seconds) return reference;
    why = fmt::format("{}: the reference took {:.3g} s, less than the {:.3g} s asked for", file,
                      reference.asked_seconds, seconds);
  } catch (const InputError& error) {
    why = error.what();
  }
  return std::nullopt;
}

}  // namespace limn
