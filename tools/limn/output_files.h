#pragma once
// The files that a command writes: checked before long work, and none of an older run beside them.
#include <array>
#include <bit>
#include <string>
#include <vector>

#include "limn/core/scene.h"

namespace limn {

// The attribute of every EXR that names what -o said, so that a later run knows what is its own.
inline constexpr const char* kOutputAttribute = "limn.output";

// What a run will write, with the option that says so: ("-o", "a/b.exr").
struct PlannedFile {
  std::string option, file;
};
// InputError where two of the files are one, one is a file that the scene is made of, or one cannot
// be written. Their folders are made where they are not there.
// inputs: further files that are read.
void check_outputs(const std::vector<PlannedFile>& files, const Scene& scene,
                   const std::vector<std::string>& inputs = {});
// The files in parameters' names (SHAPE.vertex_positions:FILE).
std::vector<std::string> field_files(const std::vector<std::string>& parameters);
// A name of the scene as a part of a file's: what is no letter, digit, dot or minus becomes "_".
std::string file_part(const std::string& name);
// InputError if the file cannot be written. Its folder is made.
void check_writable(const std::string& file);
// The same unless it is a device or "".
void check_json(const std::string& file);

// All of a file, which appears whole or not at all; a device (/dev/stdout) takes the bytes as they
// come. InputError if it cannot be written.
void write_file(const std::string& file, const std::string& bytes);

// The number's bytes as they lie in memory, which is little-endian.
template <class T>
void append(std::string& bytes, const T& value) {
  static_assert(std::endian::native == std::endian::little);
  const auto raw = std::bit_cast<std::array<char, sizeof(T)>>(value);
  bytes.append(raw.data(), raw.size());
}
// A PLY file of the mesh, with further vectors of its vertices as properties PREFIXx, ...
struct VertexVectors {
  std::string prefix;
  const std::vector<Vec3d>& values;  // V
};
std::string ply_text(const Mesh& mesh, const std::vector<VertexVectors>& vectors = {});

// Images beside `output` that an earlier run wrote for the same -o, and that are not among
// `written`: standard errors, other parameters, counts of samples; with their pictures. Files that
// limn did not write stay.
void remove_stale(const std::string& output, const std::vector<std::string>& written);
// The value of kOutputAttribute for this -o.
std::string output_name(const std::string& output);

// Makes FOLDER/report.html with Python, or says what is missing for it.
void write_report(const std::string& folder, bool quiet);

// One process at a time works in a folder: made where it is not there, and locked while this lives.
// The lock goes with its process, however that ends.
class FolderLock {
 public:
  // InputError that names the other process, or if nothing can be written there.
  explicit FolderLock(const std::string& folder);
  ~FolderLock();
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  bool try_to_lock();

  std::string file_;
  int descriptor_ = -1;
};

}  // namespace limn
