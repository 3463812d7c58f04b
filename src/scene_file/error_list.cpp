// Joins errors, and limits their number.
#include "src/scene_file/error_list.h"

#include <algorithm>

namespace limn {

namespace {

constexpr size_t kMostErrors = 20;  // not tuned: about a screen

}  // namespace

InputErrors::InputErrors(std::vector<std::string> lines)
    : InputError(""), lines_(std::move(lines)) {
  for (const std::string& line : lines_) text_ += (text_.empty() ? "" : "\n") + line;
  if (lines_.size() < 2) return;
  text_ += "\n" + std::to_string(lines_.size()) + " errors";
  if (lines_.size() >= kMostErrors) text_ += ", and what follows is not read";
}

bool ErrorList::is_full() const { return lines_.size() >= kMostErrors; }

void ErrorList::add(const InputError& error) {
  std::vector<std::string> added{error.what()};
  if (const auto* several = dynamic_cast<const InputErrors*>(&error)) added = several->lines();
  for (std::string& line : added) {
    if (is_full()) return;
    if (std::find(lines_.begin(), lines_.end(), line) == lines_.end()) {
      lines_.push_back(std::move(line));
    }
  }
}

void ErrorList::throw_any() const {
  if (!empty()) throw InputErrors(lines_);
}

}  // namespace limn
