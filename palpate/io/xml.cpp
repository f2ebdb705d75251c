// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/xml.hpp"

#include <cctype>

#include "palpate/io/scanner.hpp"

namespace palpate::io {
namespace {

constexpr int deepest = 100;

class XmlParser {
 public:
  XmlParser(std::string_view bytes, const std::string& name) : text_(bytes), file_(bytes, name) {}

  XmlElement document() {
    if (text_.substr(0, 3) == "\xEF\xBB\xBF") at_ = 3;
    skip_between();
    if (!starts("<")) fail("expected '<'; it is not an XML file");
    XmlElement root = element(0);
    skip_between();
    if (at_ != text_.size()) fail("text after the end of the document");
    return root;
  }

 private:
  bool starts(std::string_view prefix) const { return text_.substr(at_, prefix.size()) == prefix; }
  void blanks() {
    while (at_ < text_.size() && std::isspace(static_cast<unsigned char>(text_[at_]))) advance(1);
  }
  void advance(std::size_t count) {
    for (std::size_t i = 0; i < count && at_ < text_.size(); ++i) line_ += text_[at_++] == '\n';
  }
  [[noreturn]] void fail(const std::string& what) {
    file_.seek(std::min(at_, text_.size()));
    file_.fail(what);
  }
  void skip_past(std::string_view end) {
    const std::size_t found = text_.find(end, at_);
    if (found == std::string_view::npos) fail("the file ends before '" + std::string(end) + "'; it is cut off");
    advance(found + end.size() - at_);
  }
  /// Comments, processing instructions and the document type line.
  void skip_between() {
    for (blanks(); starts("<!") || starts("<?"); blanks()) {
      if (starts("<!--")) {
        skip_past("-->");
      } else if (starts("<?")) {
        skip_past("?>");
      } else {
        const std::size_t end = text_.find('>', at_);
        if (text_.substr(at_, end - at_).find('[') != std::string_view::npos) fail("document type definitions are not read");
        skip_past(">");
      }
    }
  }
  std::string name() {
    const std::size_t start = at_;
    while (at_ < text_.size() && (std::isalnum(static_cast<unsigned char>(text_[at_])) ||
                                  std::string_view("_-.:").find(text_[at_]) != std::string_view::npos))
      ++at_;
    if (at_ == start) fail("expected a name");
    return std::string(text_.substr(start, at_ - start));
  }
  std::string resolved(std::string_view raw) {
    std::string result;
    result.reserve(raw.size());
    for (std::size_t i = 0; i < raw.size(); ++i) {
      if (raw[i] != '&') {
        result += raw[i];
        continue;
      }
      const std::size_t end = raw.find(';', i);
      const std::string_view entity = end == std::string_view::npos ? std::string_view() : raw.substr(i + 1, end - i - 1);
      if (entity == "lt")
        result += '<';
      else if (entity == "gt")
        result += '>';
      else if (entity == "amp")
        result += '&';
      else if (entity == "quot")
        result += '"';
      else if (entity == "apos")
        result += '\'';
      else if (!entity.empty() && entity[0] == '#')
        result += '?';  // no name or number that we need is spelt so
      else
        fail("unknown entity '&" + std::string(entity.substr(0, 20)) + "'");
      i = end;
    }
    return result;
  }

  XmlElement element(int depth) {
    if (depth > deepest) fail("elements are nested too deeply");
    XmlElement result;
    result.line = line_;
    advance(1);  // <
    result.name = name();
    for (blanks(); at_ < text_.size() && text_[at_] != '>' && text_[at_] != '/'; blanks()) {
      const std::string key = name();
      blanks();
      if (!starts("=")) fail("expected '=' after attribute '" + key + "'");
      advance(1);
      blanks();
      const char quote = at_ < text_.size() ? text_[at_] : '\0';
      if (quote != '"' && quote != '\'') fail("expected a quoted value of attribute '" + key + "'");
      const std::size_t end = text_.find(quote, at_ + 1);
      if (end == std::string_view::npos) fail("the file ends within attribute '" + key + "'; it is cut off");
      if (!result.attributes.emplace(key, resolved(text_.substr(at_ + 1, end - at_ - 1))).second)
        fail("attribute '" + key + "' is there twice");
      advance(end + 1 - at_);
    }
    if (starts("/>")) {
      advance(2);
      return result;
    }
    if (!starts(">")) fail("the file ends within element '" + result.name + "'; it is cut off");
    advance(1);
    while (true) {
      const std::size_t next = text_.find('<', at_);
      if (next == std::string_view::npos) fail("the file ends within element '" + result.name + "'; it is cut off");
      result.text += resolved(text_.substr(at_, next - at_));
      advance(next - at_);
      if (starts("</")) {
        advance(2);
        if (name() != result.name) fail("element '" + result.name + "' is closed by another name");
        blanks();
        if (!starts(">")) fail("expected '>'");
        advance(1);
        return result;
      }
      if (starts("<![CDATA[")) {
        advance(9);
        const std::size_t start = at_;
        skip_past("]]>");
        result.text += text_.substr(start, at_ - 3 - start);
      } else if (starts("<!--")) {
        skip_past("-->");
      } else if (starts("<?")) {
        skip_past("?>");
      } else {
        result.children.push_back(element(depth + 1));
      }
    }
  }

  std::string_view text_;
  Scanner file_;
  std::size_t at_ = 0, line_ = 1;
};

}  // namespace

const XmlElement* XmlElement::child(std::string_view wanted) const {
  for (const XmlElement& one : children) {
    if (one.name == wanted) return &one;
  }
  return nullptr;
}

std::string XmlElement::attribute(const std::string& key, const std::string& otherwise) const {
  const auto found = attributes.find(key);
  return found == attributes.end() ? otherwise : found->second;
}

XmlElement parse_xml(std::string_view bytes, const std::string& name) { return XmlParser(bytes, name).document(); }

std::string xml_escaped(std::string_view text) {
  std::string result;
  for (const char letter : text) {
    switch (letter) {
      case '<':
        result += "&lt;";
        break;
      case '>':
        result += "&gt;";
        break;
      case '&':
        result += "&amp;";
        break;
      case '"':
        result += "&quot;";
        break;
      default:
        result += letter;
    }
  }
  return result;
}

}  // namespace palpate::io
