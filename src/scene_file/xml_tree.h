#pragma once
// XML as a plain tree with a place for everything in it.
#include <string>
#include <vector>

#include "limn/core/error.h"

namespace limn {

struct XmlAttribute {
  std::string name;
  std::string value;
  SourceLocation where;  // of its name
};

struct XmlElement {
  std::string name;
  SourceLocation where;  // of its "<"
  std::vector<XmlAttribute> attributes;
  std::vector<XmlElement> children;

  // Null if there is none of this name.
  const XmlAttribute* find(const std::string& attribute) const;
};

// Parses `text`, the content of `file`, and returns its root. InputError at the place of what is
// malformed: also for text between elements, repeated attributes, entities other than XML's five,
// elements nested more than 64 deep, and more than 64 attributes.
XmlElement parse_xml(const std::string& file, const std::string& text);

}  // namespace limn
