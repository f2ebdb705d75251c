// SPDX-License-Identifier: Apache-2.0
// OUT/exploration.json: what `explore` was promised and found, push by push. It grows with every push, so that a run that goes on
// still knows what an earlier one was promised.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "palpate/explore.hpp"

namespace palpate::cli {

/// "13.2 kPa", or by region.
std::string moduli_words(const std::vector<Parameter>& young);

/// What is not known (of pushes of an earlier run) is null.
nlohmann::json json_of(const ExploredPush& push);

/// "a list in random order over the same 24 pushes is expected to need 5, the best place alone 3".
std::string words_of(const FixedLists& lists, int max_pushes);
nlohmann::json json_of(const FixedLists& lists);

class ExplorationFile {
 public:
  explicit ExplorationFile(std::filesystem::path file) : file_(std::move(file)) {}
  /// Takes over what the file says of the pushes that were recorded. A file that is none says nothing.
  void go_on(const std::vector<Push>& recorded);
  /// Once there is an estimate after it. What was said of the same push by the run that made it is left as it is.
  void add(const ExploredPush& push);
  /// Of every push that counts, in their order.
  nlohmann::json pushes(const Explored& run) const;
  /// Once it has ended.
  void write(const nlohmann::json& whole) const;

 private:
  std::filesystem::path file_;
  nlohmann::json told_ = nlohmann::json::array();
};

}  // namespace palpate::cli
