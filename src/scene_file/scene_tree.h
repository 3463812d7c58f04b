#pragma once
// First pass over a scene file: parameters substituted, includes spliced in, search paths gathered.
#include <map>
#include <string>
#include <vector>

#include "src/scene_file/xml_tree.h"

namespace limn {

// The root with nothing left in it of <default>, <include>, <path> and $name.
struct SceneTree {
  XmlElement root;
  std::vector<std::string> search_path;  // directories of <path>, the latest first
  std::vector<std::string> files;        // all that were read, in order
};

// `defines` override <default>; one that nothing refers to is an error. An included file has the
// root <scene>, whose content takes the include's place, or any other element.
// text: stands for the content of `file`, which need not be there; null: it is read.
SceneTree load_scene_tree(const std::string& file,
                          const std::map<std::string, std::string>& defines,
                          const std::string* text);

// The first of these that exists: `name` itself if absolute; in the directory of the file that
// mentions it; in the search path. "" if none does.
std::string find_input_file(const std::string& name, const std::string& mentioned_in,
                            const std::vector<std::string>& search_path);

// InputError at the first attribute of `element` that is not among `known`, or at the element if
// one of `required` is missing.
void check_attributes(const XmlElement& element, const std::vector<std::string>& known,
                      const std::vector<std::string>& required);

}  // namespace limn
