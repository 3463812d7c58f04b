#pragma once
#include <string>

namespace limn {

// Writes under a temporary name in the same folder; commit() renames it to the wanted one. Without
// commit nothing is left behind.
class OutputFile {
 public:
  explicit OutputFile(const std::string& file);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  const std::string& temporary() const { return temporary_; }
  // All of the temporary file; InputError if it cannot be written, as on a full disk.
  void write(const std::string& bytes) const;
  void commit();  // InputError if the file cannot be put in place

 private:
  std::string file_, temporary_;
  bool committed_ = false;
};

}  // namespace limn
