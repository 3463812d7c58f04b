#pragma once
// First pass over a scene file: substitutes parameters, includes files, collects search paths.
#include <map>
#include <string>
#include <vector>

#include "src/scene_file/error_list.h"
#include "src/scene_file/xml_tree.h"

namespace limn {

// The root element after <default>, <include>, <path> and $name are resolved.
struct SceneTree {
  XmlElement root;
  // Directories of <path>, the latest first; the scene's own; those of the command line.
  std::vector<std::string> search_path;
  std::vector<std::string> files;     // all files read, in order
  std::vector<std::string> warnings;  // whole lines
};

// What a user adds to a scene file.
struct SceneInput {
  const std::map<std::string, std::string>& defines;  // of -D
  const std::vector<std::string>& paths;              // directories to search last
};

// Defines override <default>; unused ones are errors. An included file has the root <scene>,
// whose content replaces the include, or any other element. text: the content of `file`, which then
// need not exist; null: reads the file. Errors after which the rest has a meaning go to `errors`,
// others are thrown.
SceneTree load_scene_tree(const std::string& file, const SceneInput& input, const std::string* text,
                          ErrorList& errors);

// The first existing file of: `name` if absolute; in the directory of the referring file; in the
// search path; then of `name` with \ as /. "" if none exists.
std::string find_input_file(const std::string& name, const std::string& mentioned_in,
                            const std::vector<std::string>& search_path);

// InputError at the first attribute of `element` that is not in `known`, or at the element if one
// of `required` is missing.
void check_attributes(const XmlElement& element, const std::vector<std::string>& known,
                      const std::vector<std::string>& required);

}  // namespace limn
