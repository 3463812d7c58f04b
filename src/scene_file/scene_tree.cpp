// Resolves <default>, <include>, <path> and $name.
#include "src/scene_file/scene_tree.h"

#include <algorithm>
#include <filesystem>
#include <set>

#include "limn/core/names.h"
#include "src/base/text.h"
#include "src/scene_file/old_format.h"

namespace limn {

namespace fs = std::filesystem;

namespace {

// Limits against endless includes and substitutions. Not tuned: far above real scenes.
constexpr int kMaxIncludeDepth = 15;
constexpr size_t kMaxFiles = 1000;
constexpr size_t kMaxPaths = 64;
constexpr size_t kMaxText = size_t{1} << 25;         // bytes of all files
constexpr size_t kMaxSubstituted = size_t{1} << 24;  // characters that parameters put in

bool is_word(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
}

std::string known_parameters(const std::map<std::string, std::string, std::less<>>& values) {
  std::vector<std::string> names;
  for (const auto& [name, value] : values) names.push_back(name);
  return known_names(names, "none are defined");
}

template <class IsThere>
std::string find_input(const std::string& name, const std::string& mentioned_in,
                       const std::vector<std::string>& search_path, const IsThere& is_there) {
  std::error_code error;
  std::vector<fs::path> candidates{fs::path(mentioned_in).parent_path() / name};
  for (const std::string& directory : search_path) candidates.push_back(fs::path(directory) / name);
  for (const fs::path& path : candidates) {  // an absolute name replaces what it is appended to
    if (is_there(path, error)) return path.string();
  }
  if (name.find('\\') == std::string::npos) return "";
  std::string slashes = name;  // of a name written on Windows
  std::replace(slashes.begin(), slashes.end(), '\\', '/');
  return find_input(slashes, mentioned_in, search_path, is_there);
}

class TreeLoader {
 public:
  TreeLoader(const SceneInput& input, ErrorList& errors)
      : errors_(errors),
        defines_(input.defines),
        values_(input.defines.begin(), input.defines.end()) {
    tree_.search_path = input.paths;
  }

  SceneTree load(const std::string& file, const std::string* text) {
    tree_.search_path.insert(tree_.search_path.begin(), fs::path(file).parent_path().string());
    tree_.root = text ? parse_xml(file, *text) : parse_file(file, {file});
    const bool is_old = upgrade(tree_.root, tree_.warnings);
    expand(tree_.root, 0, true);
    if (is_old) upgrade_values(tree_.root, tree_.warnings);
    if (is_incomplete_) throw InputErrors();
    check_defines(file);
    return std::move(tree_);
  }

 private:
  // Replaces $name, the longest known name first; \$ stands for a dollar sign.
  std::string substitute(const XmlAttribute& attribute) {
    std::string result;
    const std::string& text = attribute.value;
    for (size_t i = 0; i < text.size(); ++i) {
      if (text.compare(i, 2, "\\$") == 0) {
        result += text[++i];
      } else if (text[i] == '$') {
        const std::string name = parameter_at(text, i + 1, attribute.where);
        used_.insert(name);
        const std::string& value = values_.at(name);
        substituted_ += value.size();
        if (substituted_ > kMaxSubstituted) {
          throw InputError(attribute.where, "parameters put in more than 16777216 characters");
        }
        result += value;
        i += name.size();
      } else {
        result += text[i];
      }
    }
    return result;
  }

  std::string parameter_at(const std::string& text, size_t begin, const SourceLocation& where) {
    // Names that begin the text come before it in sorted order, the longest last.
    std::string_view rest = std::string_view(text).substr(begin);
    for (auto i = values_.upper_bound(rest); i != values_.begin();) {
      const std::string& name = (--i)->first;
      const auto [end, ignored] = std::mismatch(rest.begin(), rest.end(), name.begin(), name.end());
      const auto common = static_cast<size_t>(end - rest.begin());
      if (common == name.size()) return name;
      rest = rest.substr(0, common);
      i = values_.upper_bound(rest);
    }
    size_t end = begin;
    while (end < text.size() && is_word(text[end])) ++end;
    if (is_incomplete_) throw InputErrors();  // what is missing may define it
    throw InputError(where, "undefined parameter \"$" + text.substr(begin, end - begin) + "\" (" +
                                known_parameters(values_) + ")");
  }

  void expand(XmlElement& element, int include_depth, bool is_root) {
    for (XmlAttribute& attribute : element.attributes) {
      const bool is_read = errors_.keep([&] { attribute.value = substitute(attribute); });
      element.failed = element.failed || !is_read;
    }
    std::vector<XmlElement> children = std::move(element.children);
    element.children.clear();
    for (XmlElement& child : children) {
      if (child.name == "default" || child.name == "path" || child.name == "include") {
        const bool is_obeyed = errors_.keep([&] {
          if (!is_root && child.name != "default") {
            throw InputError(child.where, "<" + child.name + "> belongs directly under <scene>");
          }
          expand(child, include_depth, false);
          if (child.failed) throw InputErrors();
          obey(child, element, include_depth);
        });
        if (is_obeyed) continue;
        is_incomplete_ = true;
        lacks_path_ = lacks_path_ || child.name == "path";
      } else {
        expand(child, include_depth, false);
        element.children.push_back(std::move(child));
      }
    }
  }

  // Executes <default>, <path> or <include>.
  void obey(const XmlElement& order, XmlElement& parent, int include_depth) {
    if (order.name == "default") {
      check_attributes(order, {"name", "value"}, {"name", "value"});
      const std::string& name = order.find("name")->value;
      if (name.empty()) throw InputError(order.where, "<default>: the name is empty");
      values_.try_emplace(name, order.find("value")->value);
    } else if (order.name == "path") {
      add_path(order);
    } else {
      include(order, parent, include_depth);
    }
  }

  void add_path(const XmlElement& order) {
    check_attributes(order, {"value"}, {"value"});
    const XmlAttribute& value = *order.find("value");
    const std::string directory = find_input(
        value.value, value.where.file, tree_.search_path,
        [](const fs::path& path, std::error_code& e) { return fs::is_directory(path, e); });
    if (directory.empty()) {
      throw InputError(value.where, "no such directory: \"" + value.value + "\"");
    }
    if (++path_elements_ > kMaxPaths) throw InputError(order.where, "more than 64 of <path>");
    tree_.search_path.insert(tree_.search_path.begin(), directory);
  }

  void include(const XmlElement& order, XmlElement& parent, int depth) {
    check_attributes(order, {"filename"}, {"filename"});
    const XmlAttribute& name = *order.find("filename");
    const std::string file = find_input_file(name.value, name.where.file, tree_.search_path);
    if (file.empty() && lacks_path_) throw InputErrors();  // it may be there
    if (file.empty()) throw InputError(name.where, "no such file: \"" + name.value + "\"");
    if (depth >= kMaxIncludeDepth) {
      throw InputError(name.where, "files are included more than 15 deep");
    }
    XmlElement root = parse_file(file, name.where);
    const bool is_scene = root.name == "scene";
    const bool is_old = is_scene && upgrade(root, tree_.warnings);
    expand(root, depth + 1, is_scene);
    if (is_old) upgrade_values(root, tree_.warnings);
    if (!is_scene) {
      parent.children.push_back(std::move(root));
      return;
    }
    std::move(root.children.begin(), root.children.end(), std::back_inserter(parent.children));
  }

  XmlElement parse_file(const std::string& file, const SourceLocation& mentioned) {
    if (tree_.files.size() == kMaxFiles) {
      throw InputError(mentioned, "more than 1000 files are included");
    }
    std::error_code error;
    const uintmax_t size = fs::file_size(file, error);
    if (!error && size > kMaxText - text_) {
      throw InputError(mentioned, "the scene's files have more than 33554432 bytes of XML");
    }
    const std::string text = read_whole_file(file);
    text_ += std::min(text.size(), kMaxText - text_);
    tree_.files.push_back(file);
    return parse_xml(file, text);
  }

  void check_defines(const std::string& file) {
    auto known = values_;
    for (const auto& [name, value] : defines_) {
      if (!used_.count(name)) known.erase(name);
    }
    for (const auto& [name, value] : defines_) {
      if (used_.count(name)) continue;
      errors_.keep([&, &name = name, &value = value] {
        throw InputError({file}, "-D " + name + "=" + value + ": the scene has no parameter \"$" +
                                     name + "\" (" + known_parameters(known) + ")");
      });
    }
  }

  ErrorList& errors_;
  const std::map<std::string, std::string>& defines_;
  std::map<std::string, std::string, std::less<>> values_;
  std::set<std::string> used_;
  size_t text_ = 0, substituted_ = 0, path_elements_ = 0;
  bool is_incomplete_ = false;  // a <default>, <include> or <path> failed
  bool lacks_path_ = false;     // a <path> did
  SceneTree tree_;
};

}  // namespace

void check_attributes(const XmlElement& element, const std::vector<std::string>& known,
                      const std::vector<std::string>& required) {
  for (const XmlAttribute& a : element.attributes) {
    if (std::find(known.begin(), known.end(), a.name) == known.end()) {
      throw InputError(a.where,
                       "<" + element.name + ">: " + unknown_name("attribute", a.name, known));
    }
  }
  for (const std::string& name : required) {
    if (!element.find(name)) {
      throw InputError(element.where,
                       "<" + element.name + ">: attribute \"" + name + "\" is missing");
    }
  }
}

std::string find_input_file(const std::string& name, const std::string& mentioned_in,
                            const std::vector<std::string>& search_path) {
  return find_input(name, mentioned_in, search_path, [](const fs::path& path, std::error_code& e) {
    return fs::is_regular_file(path, e);
  });
}

SceneTree load_scene_tree(const std::string& file, const SceneInput& input, const std::string* text,
                          ErrorList& errors) {
  return TreeLoader(input, errors).load(file, text);
}

}  // namespace limn
