// A file in the folder under flock(2), which says whose it is.
#include "tools/limn/folder_lock.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <filesystem>
#include <fstream>
#include <string>

#include "limn/core/error.h"

namespace limn {

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
