// XML parsing; the only file that includes pugixml.
#include "src/scene_file/xml_tree.h"

#include <algorithm>
#include <pugixml.hpp>

namespace limn {

namespace {

constexpr int kMaxDepth = 64;          // of elements; not tuned: far below the stack's limit
constexpr size_t kMaxAttributes = 64;  // of an element; not tuned: no element has more than eight

// Converts byte offsets to lines and columns. A column counts bytes.
class TextPlaces {
 public:
  TextPlaces(const std::string& file, const std::string& text) : file_(file), text_(text) {
    for (size_t i = 0; i < text.size(); ++i) {
      if (text[i] == '\n') line_starts_.push_back(i + 1);
    }
  }
  const std::string& text() const { return text_; }

  SourceLocation at(size_t offset) const {
    const auto next = std::upper_bound(line_starts_.begin(), line_starts_.end(), offset);
    const size_t line = static_cast<size_t>(next - line_starts_.begin());
    return {file_, static_cast<int>(line), static_cast<int>(offset - *(next - 1)) + 1};
  }

 private:
  std::string file_;
  const std::string& text_;
  std::vector<size_t> line_starts_{0};
};

// Rejects unknown entities, which pugixml leaves unchanged, and document type definitions.
void check_entities(const TextPlaces& places, size_t begin, size_t end) {
  const std::string& text = places.text();
  for (size_t i = begin; i < end; ++i) {
    if (text[i] != '&') continue;
    const std::string name = text.substr(i + 1, std::min(text.find(';', i), end) - i - 1);
    if (name == "amp" || name == "lt" || name == "gt" || name == "quot" || name == "apos") continue;
    if (name.starts_with("#")) continue;
    throw InputError(places.at(i), "unknown entity \"&" + name.substr(0, 32) +
                                       ";\" (known: amp, apos, gt, lt, quot, and numbers)");
  }
}

// Offsets of attributes, which pugixml does not report. The well-formed text after an element's
// name is a sequence of `name = "value"`.
std::vector<size_t> attribute_offsets(const TextPlaces& places, size_t offset, size_t count) {
  const std::string& text = places.text();
  static const char* const kSpace = " \t\r\n";
  std::vector<size_t> offsets;
  size_t i = text.find_first_of(" \t\r\n", offset);
  while (offsets.size() < count) {
    i = text.find_first_not_of(kSpace, i);
    offsets.push_back(i);
    const size_t quote = text.find_first_of("\"'", i);
    i = text.find(text[quote], quote + 1) + 1;
    check_entities(places, quote + 1, i - 1);
  }
  return offsets;
}

void convert_attributes(const pugi::xml_node& node, const TextPlaces& places, XmlElement& element) {
  for (const pugi::xml_attribute& a : node.attributes()) {
    if (element.attributes.size() == kMaxAttributes) {
      throw InputError(element.where, "<" + element.name + ">: more than 64 attributes");
    }
    element.attributes.push_back({a.name(), a.value(), {}});
  }
  const auto offsets = attribute_offsets(places, static_cast<size_t>(node.offset_debug()),
                                         element.attributes.size());
  for (size_t i = 0; i < offsets.size(); ++i) {
    XmlAttribute& attribute = element.attributes[i];
    attribute.where = places.at(offsets[i]);
    if (element.find(attribute.name) != &attribute) {
      throw InputError(attribute.where, "<" + element.name + ">: attribute \"" + attribute.name +
                                            "\" is given twice");
    }
  }
}

// Spaces and line ends, and the spaces of width zero that editors leave.
bool is_blank(std::string_view text) {
  for (size_t i = 0; i < text.size();) {
    const bool invisible = text.substr(i, 3) == "\u200b" || text.substr(i, 3) == "\ufeff";
    if (!invisible && std::string_view(" \t\r\n").find(text[i]) == std::string_view::npos) {
      return false;
    }
    i += invisible ? 3 : 1;
  }
  return true;
}

SourceLocation place_of_text(const pugi::xml_node& text, const TextPlaces& places) {
  const size_t begin = static_cast<size_t>(text.offset_debug());
  return places.at(places.text().find_first_not_of(" \t\r\n", begin));
}

XmlElement convert(const pugi::xml_node& node, const TextPlaces& places, int depth) {
  XmlElement element;
  element.name = node.name();
  element.where = places.at(static_cast<size_t>(node.offset_debug()) - 1);
  if (depth > kMaxDepth) {
    throw InputError(element.where, "elements are nested more than 64 deep");
  }
  convert_attributes(node, places, element);
  for (const pugi::xml_node& child : node.children()) {
    if (child.type() == pugi::node_element) {
      element.children.push_back(convert(child, places, depth + 1));
    } else if (child.type() != pugi::node_pcdata || !is_blank(child.value())) {
      throw InputError(place_of_text(child, places),
                       "<" + element.name + ">: text between elements means nothing here");
    }
  }
  return element;
}

}  // namespace

const XmlAttribute* XmlElement::find(const std::string& attribute) const {
  for (const XmlAttribute& a : attributes) {
    if (a.name == attribute) return &a;
  }
  return nullptr;
}

XmlElement parse_xml(const std::string& file, const std::string& text) {
  const TextPlaces places(file, text);
  // pugixml would stop at a NUL character.
  if (const size_t nul = text.find('\0'); nul != text.npos) {
    throw InputError(places.at(nul), "malformed XML: a byte of value 0");
  }
  pugi::xml_document document;
  // Parsed as a fragment: otherwise text beside the root would be dropped silently.
  const pugi::xml_parse_result result = document.load_buffer(
      text.data(), text.size(), pugi::parse_default | pugi::parse_doctype | pugi::parse_fragment,
      pugi::encoding_utf8);
  if (!result) {
    const size_t offset = std::min(static_cast<size_t>(result.offset), text.size());
    throw InputError(places.at(offset), std::string("malformed XML: ") + result.description());
  }
  pugi::xml_node root;
  for (const pugi::xml_node& child : document.children()) {
    if (child.type() == pugi::node_doctype) {
      throw InputError(places.at(static_cast<size_t>(child.offset_debug())),
                       "<!DOCTYPE> is not read: entities are not substituted");
    }
    if (child.type() != pugi::node_element) {
      throw InputError(place_of_text(child, places),
                       root ? "text outside of the root element"
                            : "text before the root element: is this an XML file?");
    }
    if (root) {
      throw InputError(places.at(static_cast<size_t>(child.offset_debug()) - 1),
                       "a second root element <" + std::string(child.name()) + ">");
    }
    root = child;
  }
  if (!root) throw InputError(places.at(0), "malformed XML: No document element found");
  return convert(root, places, 1);
}

}  // namespace limn
