// SPDX-License-Identifier: Apache-2.0
// A strict view of a YAML document: every question names its key, every failure names file, line and field, and what was
// not asked for is unknown.
#pragma once

#include <yaml-cpp/yaml.h>

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "palpate/core/math.hpp"
#include "palpate/core/physical_range.hpp"

namespace palpate::io {

/// The known word nearest to a mistyped one, if near enough: fewest insertions, deletions and replacements.
std::optional<std::string> nearest_word(std::string_view word, const std::vector<std::string>& known);

/// A key without a value, or with `~`: a mistake in what a user writes; other programs write it of what they leave out.
enum class KeysWithoutValue { refused, left_out };

class YamlField {
 public:
  /// Parses a document. Throws Error with file and line.
  static YamlField parse(const std::string& bytes, const std::string& name);

  const std::string& path() const { return path_; }  ///< "pushes[0].steps[2]"
  std::string where() const;                         ///< "recording.yaml:12: pushes[0].steps[2]"
  std::string file_and_line() const;
  [[noreturn]] void fail(const std::string& what) const;

  bool is_map() const { return node_.IsMap(); }
  bool is_list() const { return node_.IsSequence(); }
  bool is_scalar() const { return node_.IsScalar(); }

  std::string text() const;
  double number() const;  ///< finite
  double positive() const;
  double non_negative() const;
  double within(const PhysicalRange& range) const;  ///< as that quantity can be; names value, range and likely mistake
  int whole(int least, int most) const;
  bool boolean() const;
  Vec3 vector3() const;
  Vec3 unit_vector() const;  ///< normalised; an error when its length is not 1 within 1 %
  std::vector<double> numbers() const;
  std::vector<YamlField> items() const;                            ///< of a list
  /// Of a map with free keys; none twice.
  std::vector<std::pair<std::string, YamlField>> entries(KeysWithoutValue empty = KeysWithoutValue::refused) const;
  template <typename Enum>
  Enum choice(std::span<const std::pair<const char*, Enum>> table) const {
    const std::string word = text();
    std::vector<std::string> known;
    for (const auto& [name, value] : table) {
      if (word == name) return value;
      known.emplace_back(name);
    }
    fail_choice(word, known);
  }

  /// Of a word that is no name in `list` ("tools"), of which each is a `kind` ("tool").
  [[noreturn]] void fail_name(const std::string& kind, const std::string& list, const std::vector<std::string>& known) const;

 private:
  friend class YamlKeys;
  YamlField(YAML::Node node, std::string path, std::shared_ptr<const std::string> file)
      : node_(std::move(node)), path_(std::move(path)), file_(std::move(file)) {}
  [[noreturn]] void fail_choice(const std::string& word, const std::vector<std::string>& known) const;
  YAML::Node node_;
  std::string path_;
  std::shared_ptr<const std::string> file_;
};

/// The keys of one map. Ask for each known key, then call `finish`, which refuses what nobody asked for.
class YamlKeys {
 public:
  explicit YamlKeys(const YamlField& map, KeysWithoutValue empty = KeysWithoutValue::refused);
  YamlField required(const std::string& key, const std::string& cure = {});
  std::optional<YamlField> optional(const std::string& key);
  bool has(const std::string& key) const;
  void finish() const;
  const YamlField& map() const { return map_; }

  double number_or(const std::string& key, double otherwise);
  double within_or(const std::string& key, double otherwise, const PhysicalRange& range);
  std::string text_or(const std::string& key, const std::string& otherwise);
  bool boolean_or(const std::string& key, bool otherwise);

 private:
  YamlField map_;
  std::vector<std::pair<std::string, YamlField>> entries_;
  std::vector<std::string> asked_;
};

}  // namespace palpate::io
