#pragma once
#include <string>

namespace limn {

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
