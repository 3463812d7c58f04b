#pragma once
// Files that live as long as a test.
#include <filesystem>
#include <fstream>
#include <random>
#include <string>

namespace limn {

class TempFiles {
 public:
  TempFiles() {
    std::random_device random;
    directory_ = std::filesystem::temp_directory_path() /
                 ("limn_test_" + std::to_string(random()) + std::to_string(random()));
    std::filesystem::create_directories(directory_);
  }
  ~TempFiles() {
    std::error_code ignored;
    std::filesystem::remove_all(directory_, ignored);
  }
  TempFiles(const TempFiles&) = delete;
  TempFiles& operator=(const TempFiles&) = delete;

  std::string path(const std::string& name) const { return (directory_ / name).string(); }
  // Writes `content` and returns the path.
  std::string write(const std::string& name, const std::string& content) const {
    std::ofstream(path(name), std::ios::binary) << content;
    return path(name);
  }

 private:
  std::filesystem::path directory_;
};

}  // namespace limn
