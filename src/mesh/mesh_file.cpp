// Mesh files by extension, and vector fields on a mesh's vertices.
#include "src/mesh/mesh_file.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>

#include "limn/core/names.h"
#include "src/base/text.h"

namespace limn {

namespace {

std::string ending(const std::string& file) {
  return lower_case(std::filesystem::path(file).extension().string());
}

// A line without any number may be of a file that no message should quote.
Vec3d parse_vector(const SourceLocation& where, std::string_view line) {
  const std::vector<std::string_view> words = split(line, " \t\r,");
  if (words.size() != 3 || std::none_of(words.begin(), words.end(), parse_double)) {
    throw InputError(where, "expected three numbers \"x y z\"");
  }
  Vec3d v;
  for (int k = 0; k < 3; ++k) {
    const int column = static_cast<int>(words[k].data() - line.data()) + 1;
    const SourceLocation word{where.file, where.line, column};
    const std::optional<double> number = parse_double(words[k]);
    if (!number) throw InputError(word, "not a number: \"" + std::string(words[k]) + "\"");
    if (!std::isfinite(*number)) throw InputError(word, "the vector is not finite");
    if (std::fabs(*number) > std::numeric_limits<float>::max()) {
      throw InputError(word, "a number is beyond a float's range (3.4e38)");
    }
    v[k] = *number;
  }
  return v;
}

}  // namespace

bool is_mesh_file(const std::string& file) {
  return ending(file) == ".obj" || ending(file) == ".ply";
}

RawMesh parse_mesh(const std::string& file) {
  return ending(file) == ".ply" ? parse_ply(file) : parse_obj(file);
}

Mesh read_mesh(const std::string& file, bool face_normals) {
  return build_mesh(parse_mesh(file), {Matrix4{}, face_normals, false}, nullptr);
}

std::vector<Vec3d> read_vertex_vectors(const std::string& file) {
  if (is_mesh_file(file)) return parse_mesh(file).positions;
  const std::string text = read_whole_file(file);
  std::vector<Vec3d> vectors;
  std::string_view rest = text;
  for (int line = 1; !rest.empty(); ++line) {
    const size_t end = std::min(rest.find('\n'), rest.size());
    const std::string_view content = rest.substr(0, end);
    rest.remove_prefix(std::min(end + 1, rest.size()));
    const bool blank = content.find_first_not_of(" \t\r") == content.npos;
    if (!blank && content[0] != '#') vectors.push_back(parse_vector({file, line}, content));
  }
  return vectors;
}

}  // namespace limn
