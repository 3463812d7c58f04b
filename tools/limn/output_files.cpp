// What a command writes: names that collide, places that cannot be written, leftovers.
#include "tools/limn/output_files.h"

#include <cctype>
#include <filesystem>
#include <fstream>

#include "limn/core/error.h"
#include "limn/core/image.h"
#include "limn/core/output_file.h"

namespace limn {
namespace {

namespace fs = std::filesystem;

bool same_file(const std::string& a, const std::string& b) {
  std::error_code failed;
  if (fs::equivalent(a, b, failed)) return true;  // also by links
  return fs::weakly_canonical(a, failed) == fs::weakly_canonical(b, failed);
}

bool is_device(const std::string& file) {
  std::error_code failed;
  return fs::exists(file, failed) && !fs::is_regular_file(file, failed) &&
         !fs::is_directory(file, failed);
}

std::string properties(const char* type, const std::string& prefix) {
  std::string text;
  for (const char axis : {'x', 'y', 'z'}) {
    text += std::string("property ") + type + " " + prefix + axis + "\n";
  }
  return text;
}

std::string stem_of(const std::string& file) { return fs::path(file).stem().string(); }

// Whether limn wrote it for this -o.
bool is_own(const fs::path& file, const std::string& output) {
  try {
    for (const ImageAttribute& a : read_exr_attributes(file.string())) {
      if (a.name == kOutputAttribute) return a.value == output_name(output);
    }
  } catch (const InputError&) {
  }
  return false;
}

}  // namespace

void write_file(const std::string& file, const std::string& bytes) {
  if (is_device(file)) {
    std::ofstream stream(file, std::ios::binary);
    stream << bytes;
    stream.close();
    if (!stream) throw InputError({file}, "cannot be written");
    return;
  }
  OutputFile output(file);
  output.write(bytes);
  output.commit();
}

void check_writable(const std::string& file) {
  std::error_code failed;
  if (fs::is_directory(file, failed)) throw InputError({file}, "cannot be written: it is a folder");
  fs::create_directories(fs::absolute(file).parent_path(), failed);
  if (failed) throw InputError({file}, "cannot be written");
  const bool existed = fs::exists(file, failed);
  if (!std::ofstream(file, std::ios::app)) throw InputError({file}, "cannot be written");
  if (!existed) fs::remove(fs::canonical(file, failed), failed);  // what a link leads to
}

void check_json(const std::string& file) {
  if (!file.empty() && !is_device(file)) check_writable(file);
}

std::vector<std::string> field_files(const std::vector<std::string>& parameters) {
  std::vector<std::string> files;
  for (const std::string& parameter : parameters) {
    const size_t colon = parameter.find(':');
    if (colon != std::string::npos) files.push_back(parameter.substr(colon + 1));
  }
  return files;
}

std::string file_part(const std::string& name) {
  std::string part = name;
  for (char& c : part) {
    if (!std::isalnum(static_cast<unsigned char>(c)) && c != '.' && c != '-') c = '_';
  }
  return part;
}

void check_outputs(const std::vector<PlannedFile>& files, const Scene& scene,
                   const std::vector<std::string>& inputs) {
  for (size_t i = 0; i < files.size(); ++i) {
    const auto& [option, file] = files[i];
    if (file.empty() || is_device(file)) continue;
    for (size_t k = 0; k < i; ++k) {
      if (files[k].file.empty() || !same_file(file, files[k].file)) continue;
      throw InputError({file},
                       files[k].option == option
                           ? "two outputs (" + option + ") would have this name"
                           : files[k].option + " and " + option + " would both write this file");
    }
    for (const auto* read : {&scene.xml_files, &scene.data_files, &inputs}) {
      for (const std::string& input : *read) {
        if (!same_file(file, input)) continue;
        throw InputError({file}, option + " would write over a file that is read");
      }
    }
    check_writable(file);
  }
}

std::string output_name(const std::string& output) { return stem_of(output); }

std::string ply_text(const Mesh& mesh, const std::vector<VertexVectors>& vectors) {
  std::string bytes = "ply\nformat binary_little_endian 1.0\nelement vertex " +
                      std::to_string(mesh.positions.size()) + "\n" + properties("float", "");
  for (const VertexVectors& v : vectors) bytes += properties("double", v.prefix);
  bytes += "element face " + std::to_string(mesh.faces.size()) +
           "\nproperty list uchar uint vertex_indices\nend_header\n";
  for (size_t v = 0; v < mesh.positions.size(); ++v) {
    for (int k = 0; k < 3; ++k) append(bytes, mesh.positions[v][k]);
    for (const VertexVectors& of : vectors) {
      for (int k = 0; k < 3; ++k) append(bytes, of.values[v][k]);
    }
  }
  for (const FaceIndices& face : mesh.faces) {
    append(bytes, uint8_t{3});
    for (const uint32_t v : face) append(bytes, v);
  }
  return bytes;
}

void remove_stale(const std::string& output, const std::vector<std::string>& written) {
  const std::string stem = stem_of(output);
  std::error_code failed;
  std::vector<fs::path> stale;
  for (const auto& entry : fs::directory_iterator(fs::absolute(output).parent_path(), failed)) {
    const fs::path& file = entry.path();
    if (file.extension() != ".exr" || !entry.is_regular_file(failed)) continue;
    const std::string name = file.stem().string();
    if (name != stem && !name.starts_with(stem + "_")) continue;
    bool new_one = false;
    for (const std::string& w : written) new_one = new_one || same_file(file.string(), w);
    if (!new_one && is_own(file, output)) stale.push_back(file);
  }
  for (fs::path file : stale) {
    fs::remove(file, failed);
    // Pictures tell nothing of themselves; this one was written with its image.
    file.replace_extension(".png");
    bool new_one = false;
    for (const std::string& w : written) new_one = new_one || same_file(file.string(), w);
    if (!new_one) fs::remove(file, failed);
  }
}

}  // namespace limn
