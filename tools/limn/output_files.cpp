// What a command writes: names that collide, places that cannot be written, leftovers.
#include "tools/limn/output_files.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>
#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "limn/core/error.h"
#include "limn/core/image.h"
#include "limn/core/output_file.h"
#include "tools/limn/child_process.h"

namespace limn {
namespace {

namespace fs = std::filesystem;

// Files in the order in which they are added, found by any of their names, also by links.
class NamedFiles {
 public:
  NamedFiles() = default;
  explicit NamedFiles(const std::vector<std::string>& files) {
    for (const std::string& file : files) add(file);
  }

  void add(const std::string& file) {
    names_.emplace(canonical(file), count_);
    if (const auto node = node_of(file)) nodes_.emplace(*node, count_);
    ++count_;
  }
  // The number of the first one that is this file; none: count().
  size_t find(const std::string& file) const {
    size_t first = count_;
    if (const auto name = names_.find(canonical(file)); name != names_.end()) first = name->second;
    if (const auto node = node_of(file)) {
      if (const auto at = nodes_.find(*node); at != nodes_.end())
        first = std::min(first, at->second);
    }
    return first;
  }
  bool has(const std::string& file) const { return find(file) < count_; }
  size_t count() const { return count_; }

 private:
  using Node = std::pair<dev_t, ino_t>;

  static std::string canonical(const std::string& file) {
    std::error_code failed;
    return fs::weakly_canonical(file, failed).string();
  }
  // Of a file that exists.
  static std::optional<Node> node_of(const std::string& file) {
    struct stat found;
    if (stat(file.c_str(), &found) != 0) return {};
    return Node(found.st_dev, found.st_ino);
  }

  size_t count_ = 0;
  std::map<std::string, size_t> names_;
  std::map<Node, size_t> nodes_;
};

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

constexpr const char* kScript = "report.py";

// A Python that has matplotlib: Debian's first. "" if there is none.
std::string find_python() {
  for (const char* python : {"/usr/bin/python3", "python3"}) {
    if (run_child({python, "-c", "import matplotlib"}).status == 0) return python;
  }
  return "";
}

void print_missing(const std::string& folder, const std::string& what) {
  fmt::print(stderr, "no report.html: {}\nAll data is in {}\n", what, folder);
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
  NamedFiles read(scene.xml_files), before;
  for (const auto* more : {&scene.data_files, &inputs}) {
    for (const std::string& file : *more) read.add(file);
  }
  std::vector<std::string> options;  // of those before
  for (const auto& [option, file] : files) {
    if (file.empty() || is_device(file)) continue;
    if (const size_t k = before.find(file); k < before.count()) {
      throw InputError({file}, options[k] == option
                                   ? "two outputs (" + option + ") would have this name"
                                   : options[k] + " and " + option + " would both write this file");
    }
    if (read.has(file)) throw InputError({file}, option + " would write over a file that is read");
    check_writable(file);
    before.add(file);
    options.push_back(option);
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
  const NamedFiles now(written);
  std::error_code failed;
  std::vector<fs::path> stale;
  for (const auto& entry : fs::directory_iterator(fs::absolute(output).parent_path(), failed)) {
    const fs::path& file = entry.path();
    if (file.extension() != ".exr" || !entry.is_regular_file(failed)) continue;
    const std::string name = file.stem().string();
    if (name != stem && !name.starts_with(stem + "_")) continue;
    if (!now.has(file.string()) && is_own(file, output)) stale.push_back(file);
  }
  for (fs::path file : stale) {
    fs::remove(file, failed);
    // Pictures tell nothing of themselves; this one was written with its image.
    file.replace_extension(".png");
    if (!now.has(file.string())) fs::remove(file, failed);
  }
}

void write_report(const std::string& folder, bool quiet) {
  const std::string script = tool_script(kScript);
  if (script.empty()) {
    print_missing(folder, "tools/report.py is not beside the program's folder");
    return;
  }
  const std::string python = find_python();
  if (python.empty()) {
    print_missing(
        folder,
        "it needs Python 3 with matplotlib (Debian: apt install python3-matplotlib); then "
        "run\n  python3 " +
            script + " " + folder);
    return;
  }
  const ChildOutcome outcome = run_child({python, script, folder});
  if (outcome.status != 0) {
    print_missing(folder, script + " failed:\n" + outcome.errors);
  } else if (!quiet) {
    fmt::print("{}/report.html: pictures and charts\n", folder);
  }
}

FolderLock::FolderLock(const std::string& folder)
    : file_((std::filesystem::path(folder) / "limn.lock").string()) {
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  if (failed) throw InputError({folder}, "cannot be written");
  while (!try_to_lock()) {
  }
  std::array<char, 256> host{};
  gethostname(host.data(), host.size() - 1);
  std::ofstream(file_) << fmt::format("process {} on {}", getpid(), host.data());
}

// False if the other process removed the file in between.
bool FolderLock::try_to_lock() {
  const std::string folder = std::filesystem::path(file_).parent_path().string();
  descriptor_ = open(file_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (descriptor_ < 0) throw InputError({folder}, "cannot be written");
  if (flock(descriptor_, LOCK_EX | LOCK_NB) == 0) {
    struct stat status {};
    if (fstat(descriptor_, &status) == 0 && status.st_nlink > 0) return true;
    close(descriptor_);
    return false;
  }
  const bool taken = errno == EWOULDBLOCK;
  close(descriptor_);
  if (!taken) return descriptor_ = -1, true;  // a file system without locks
  std::string holder;
  std::getline(std::ifstream(file_), holder);
  throw InputError({folder}, fmt::format("{} works in this folder: wait for it, or take another",
                                         holder.empty() ? "another process" : holder));
}

FolderLock::~FolderLock() {
  unlink(file_.c_str());
  if (descriptor_ >= 0) close(descriptor_);
}

}  // namespace limn
