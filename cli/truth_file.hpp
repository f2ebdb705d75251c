// SPDX-License-Identifier: Apache-2.0
// What only a simulation knows, in a file of its own beside the recording: it grows step by step, as the recording does.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "palpate/core/recording.hpp"

namespace palpate::cli {

/// Beside the file and renamed, so that nobody ever finds half of it; folders on the way are made.
void write_json_aside(const nlohmann::json& json, const std::filesystem::path& file);

class TruthFile {
 public:
  /// @param known  nothing: the world is real, and no file is written
  TruthFile(std::filesystem::path file, std::optional<nlohmann::json> known) : file_(std::move(file)), known_(std::move(known)) {}

  bool is_known() const { return known_.has_value(); }
  const std::filesystem::path& path() const { return file_; }
  /// Takes over what the file says of the steps that were recorded.
  /// @throws Error where it is the truth of another object: the recording itself does not say what the seed drew
  void go_on(const std::vector<Push>& recorded);
  /// Before the step is recorded: whenever the run is cut off, no recorded step lacks its truth.
  void add(const nlohmann::json& step);

 private:
  void go_on_from(const nlohmann::json& before, const std::vector<Push>& recorded);

  std::filesystem::path file_;
  std::optional<nlohmann::json> known_;
};

}  // namespace palpate::cli
