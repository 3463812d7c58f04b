// Output files that are written completely or not at all.
#include "limn/core/output_file.h"

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <system_error>

#include "limn/core/error.h"

namespace limn {

namespace {

// What a link leads to, if there is a file or not.
std::filesystem::path behind_links(std::filesystem::path file) {
  constexpr int kMostLinks = 40;  // Linux's own
  std::error_code failed;
  for (int i = 0; i < kMostLinks && std::filesystem::is_symlink(file, failed); ++i) {
    const std::filesystem::path target = std::filesystem::read_symlink(file, failed);
    file = file.parent_path() / target;  // the target itself where it is absolute
  }
  return file;
}

}  // namespace

OutputFile::OutputFile(const std::string& file)
    : file_(behind_links(file).string()),
      temporary_(file_ + "." + std::to_string(getpid()) + ".tmp") {
  const std::filesystem::path folder = std::filesystem::path(file_).parent_path();
  std::error_code ignored;
  if (!folder.empty() && !std::filesystem::is_directory(folder, ignored)) {
    throw InputError(SourceLocation{file}, "cannot write: no such folder");
  }
}

OutputFile::~OutputFile() {
  std::error_code ignored;
  if (!committed_) std::filesystem::remove(temporary_, ignored);
}

void OutputFile::write(const std::string& bytes) const {
  std::ofstream stream(temporary_, std::ios::binary);
  stream.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  stream.close();
  if (!stream) throw InputError(SourceLocation{file_}, "cannot write: is the disk full?");
}

void OutputFile::commit() {
  std::error_code error;
  std::filesystem::rename(temporary_, file_, error);
  if (error) throw InputError(SourceLocation{file_}, "cannot write: " + error.message());
  committed_ = true;
}

}  // namespace limn
