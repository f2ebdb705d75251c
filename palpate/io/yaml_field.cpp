// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/yaml_field.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "palpate/core/error.hpp"
#include "palpate/io/scanner.hpp"

namespace palpate::io {
namespace {

std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, replaced});
    }
  }
  return row[b.size()];
}

std::string listed(const std::vector<std::string>& words) {
  std::string result;
  for (const std::string& word : words) {
    if (!result.empty()) result += ", ";
    result += word;
  }
  return result;
}

std::string shortened(const std::string& word) { return word.size() > 60 ? word.substr(0, 60) + "..." : word; }

}  // namespace

std::optional<std::string> nearest_word(std::string_view word, const std::vector<std::string>& known) {
  std::optional<std::string> best;
  std::size_t least = word.size() / 3 + 2;  // a third of the letters may be wrong
  if (word.size() > 100) return best;
  for (const std::string& one : known) {
    // A forgotten unit ("radius" for "radius_m") counts as near.
    const bool prefix = word.size() >= 4 && (one.substr(0, word.size()) == word || word.substr(0, one.size()) == one);
    const std::size_t distance = prefix ? 1 : edit_distance(word, one);
    if (distance < least) least = distance, best = one;
  }
  return best;
}

YamlField YamlField::parse(const std::string& bytes, const std::string& name) {
  const auto file = std::make_shared<const std::string>(name);
  try {
    const std::vector<YAML::Node> documents = YAML::LoadAll(bytes);
    if (documents.empty() || !documents[0].IsDefined() || documents[0].IsNull())
      throw Error("is empty; see docs/recording-format.md for what belongs in it", name);
    if (documents.size() > 1)
      throw Error("holds more than one document; take out the line `---` between them, or give each a file of its own",
                  name + ":" + std::to_string(documents[1].Mark().line + 1));
    const YAML::Node& root = documents[0];
    return {root, "", file};
  } catch (const YAML::Exception& problem) {
    throw Error("is not valid YAML: " + problem.msg + "; mend this line, or give another file if this was not meant to be one",
                name + ":" + std::to_string(problem.mark.line + 1));
  }
}

std::string YamlField::file_and_line() const { return *file_ + ":" + std::to_string(node_.Mark().line + 1); }

std::string YamlField::where() const {
  std::string result = file_and_line();
  if (!path_.empty()) result += ": " + path_;
  return result;
}

void YamlField::fail(const std::string& what) const { throw Error(what, where()); }

void YamlField::fail_choice(const std::string& word, const std::vector<std::string>& known) const {
  const auto near = nearest_word(word, known);
  fail("'" + shortened(word) + "' is unknown" + (near ? "; did you mean '" + *near + "'?" : "") + " It is one of " +
       listed(known));
}

void YamlField::fail_name(const std::string& kind, const std::string& list, const std::vector<std::string>& known) const {
  const auto near = nearest_word(text(), known);
  fail("there is no " + kind + " '" + shortened(text()) + "' in '" + list + "'" +
       (near ? "; did you mean '" + *near + "'?" : known.empty() ? ", which has none" : "; there are " + listed(known)));
}

std::string YamlField::text() const {
  if (!node_.IsScalar()) fail("a single word is expected");
  return node_.Scalar();
}

double YamlField::number() const {
  if (!node_.IsScalar()) fail("a number is expected");
  const std::string& word = node_.Scalar();
  if (word == ".nan" || word == ".NaN" || word == ".NAN" || word.find(".inf") != std::string::npos)
    fail("is " + word + ", not a finite number");
  const auto value = parse_number(word);
  if (!value) fail("'" + shortened(word) + "' is not a number; write the number alone, its unit is in the key");
  if (!std::isfinite(*value)) fail("is " + word + ", not a finite number");
  return *value;
}

double YamlField::positive() const {
  const double value = number();
  if (!(value > 0)) fail("is " + text() + ", it must be larger than 0");
  return value;
}

double YamlField::non_negative() const {
  const double value = number();
  if (value < 0) fail("is " + text() + ", it must not be negative");
  return value;
}

double YamlField::within(const PhysicalRange& range) const {
  const double value = range.least > 0 ? positive() : range.least == 0 ? non_negative() : number();
  if (value >= range.least && value <= range.most) return value;
  const std::string unit = *range.unit == '\0' ? "" : std::string(" ") + range.unit;
  fail(fmt::format("is {}{}, which cannot be: {:g} to {:g}{} is possible; {}", shortened(text()), unit, range.least, range.most,
                   unit, range.slip));
}

int YamlField::whole(int least, int most) const {
  const double value = number();
  if (value != std::floor(value) || value < least || value > most) {
    fail("is " + shortened(text()) + ", it must be a whole number between " + std::to_string(least) + " and " +
         std::to_string(most));
  }
  return static_cast<int>(value);
}

bool YamlField::boolean() const {
  const std::string word = text();
  if (word == "true") return true;
  if (word == "false") return false;
  fail("'" + shortened(word) + "' is neither true nor false");
}

std::vector<double> YamlField::numbers() const {
  std::vector<double> result;
  for (const YamlField& item : items()) result.push_back(item.number());
  return result;
}

Vec3 YamlField::vector3() const {
  if (!node_.IsSequence() || node_.size() != 3) fail("three numbers are expected: [x, y, z]");
  const std::vector<double> values = numbers();
  return {values[0], values[1], values[2]};
}

Vec3 YamlField::unit_vector() const {
  const Vec3 value = vector3();
  if (std::abs(value.norm() - 1) > 0.01) fail(fmt::format("is a direction: its length must be 1, is {:.4g}", value.norm()));
  return value.normalized();
}

std::vector<YamlField> YamlField::items() const {
  if (!node_.IsSequence()) fail("a list is expected");
  std::vector<YamlField> result;
  std::size_t i = 0;
  for (const YAML::Node& item : node_) result.push_back({item, path_ + "[" + std::to_string(i++) + "]", file_});
  return result;
}

std::vector<std::pair<std::string, YamlField>> YamlField::entries(KeysWithoutValue empty) const {
  if (!node_.IsMap()) {
    if (!path_.empty()) fail("keys and values are expected here");
    fail("holds no keys with values (`key: value`); give another file if this was not meant to be YAML "
         "(docs/recording-format.md)");
  }
  std::vector<std::pair<std::string, YamlField>> result;
  for (const auto& entry : node_) {
    if (!entry.first.IsScalar()) fail("a key must be a single word");
    const std::string& key = entry.first.Scalar();
    YamlField field{entry.second, path_.empty() ? key : path_ + "." + key, file_};
    if (entry.second.IsNull() && empty == KeysWithoutValue::left_out) continue;
    // An empty value has no place of its own in the file.
    if (entry.second.IsNull()) YamlField{entry.first, field.path_, file_}.fail("has no value");
    for (const auto& [other, value] : result) {
      if (other == key) YamlField{entry.first, field.path_, file_}.fail("is there twice; remove one");
    }
    result.emplace_back(key, std::move(field));
  }
  return result;
}

YamlKeys::YamlKeys(const YamlField& map, KeysWithoutValue empty) : map_(map), entries_(map.entries(empty)) {}

bool YamlKeys::has(const std::string& key) const {
  return std::any_of(entries_.begin(), entries_.end(), [&](const auto& entry) { return entry.first == key; });
}

std::optional<YamlField> YamlKeys::optional(const std::string& key) {
  asked_.push_back(key);
  for (const auto& [name, value] : entries_) {
    if (name == key) return value;
  }
  return std::nullopt;
}

YamlField YamlKeys::required(const std::string& key, const std::string& cure) {
  if (auto field = optional(key)) return *field;
  std::string what = "key '" + key + "' is missing";
  for (const auto& [name, value] : entries_) {
    if (std::find(asked_.begin(), asked_.end(), name) == asked_.end() && nearest_word(name, {key})) {
      what += "; is '" + name.substr(0, 40) + "' in line " + std::to_string(value.node_.Mark().line + 1) + " meant?";
    }
  }
  if (!cure.empty()) what += "; " + cure;
  map_.fail(what);
}

void YamlKeys::finish() const {
  for (const auto& [name, value] : entries_) {
    if (std::find(asked_.begin(), asked_.end(), name) != asked_.end()) continue;
    const auto near = nearest_word(name, asked_);
    value.fail("unknown key '" + shortened(name) + "'" + (near ? "; did you mean '" + *near + "'?" : "") +
               " Known here: " + listed(asked_));
  }
}

double YamlKeys::number_or(const std::string& key, double otherwise) {
  const auto field = optional(key);
  return field ? field->number() : otherwise;
}
double YamlKeys::within_or(const std::string& key, double otherwise, const PhysicalRange& range) {
  const auto field = optional(key);
  return field ? field->within(range) : otherwise;
}
std::string YamlKeys::text_or(const std::string& key, const std::string& otherwise) {
  const auto field = optional(key);
  return field ? field->text() : otherwise;
}
bool YamlKeys::boolean_or(const std::string& key, bool otherwise) {
  const auto field = optional(key);
  return field ? field->boolean() : otherwise;
}

}  // namespace palpate::io
