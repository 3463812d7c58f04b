#pragma once
#include <string>

namespace limn {

// An output file that is written under a temporary name in the same folder. commit() renames it;
// without commit() nothing remains. A symbolic link remains, and its target is written.
class OutputFile {
 public:
  explicit OutputFile(const std::string& file);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  const std::string& temporary() const { return temporary_; }
  // Writes `bytes` to the temporary file; InputError if it fails, for example on a full disk.
  void write(const std::string& bytes) const;
  void commit();  // InputError if the file cannot be renamed

 private:
  std::string file_, temporary_;
  bool committed_ = false;
};

}  // namespace limn
