#pragma once
// XML as a plain tree with source locations.
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
  bool failed = false;  // an error in its attributes is reported: their values mean nothing

  // Null if absent.
  const XmlAttribute* find(const std::string& attribute) const;
};

// Parses `text`, the content of `file`, and returns the root. InputError at the location of the
// error: malformed XML, text between elements, repeated attributes, entities other than XML's five,
// more than 64 levels of nesting, more than 64 attributes.
XmlElement parse_xml(const std::string& file, const std::string& text);

}  // namespace limn
