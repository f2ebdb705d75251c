// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace palpate::io {

struct XmlElement {
  std::string name;
  std::map<std::string, std::string> attributes;
  std::vector<XmlElement> children;
  std::string text;  ///< of this element alone, entities resolved
  std::size_t line = 0;

  const XmlElement* child(std::string_view wanted) const;  ///< the first, or nullptr
  std::string attribute(const std::string& key, const std::string& otherwise = {}) const;
};

/// The XML that VTK and URDF files are made of: elements, attributes, text, comments, CDATA, the five entities and numeric
/// ones. No document type definitions, hence no entity that grows. Throws Error naming file and line.
XmlElement parse_xml(std::string_view bytes, const std::string& name);

std::string xml_escaped(std::string_view text);

}  // namespace palpate::io
