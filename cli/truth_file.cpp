// SPDX-License-Identifier: Apache-2.0
#include "cli/truth_file.hpp"

#include <fmt/format.h>

#include <cmath>
#include <fstream>
#include <string>
#include <system_error>

#include "palpate/core/error.hpp"
#include "palpate/io/file.hpp"

namespace palpate::cli {

void write_json_aside(const nlohmann::json& json, const std::filesystem::path& file) {
  std::error_code code;
  if (file.has_parent_path()) std::filesystem::create_directories(file.parent_path(), code);
  io::write_file(file, json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n");  // paths need not be UTF-8
}

void TruthFile::go_on(const std::vector<Push>& recorded) {
  if (!known_) return;
  std::ifstream stream(file_);
  const nlohmann::json before = nlohmann::json::parse(stream, nullptr, false);
  if (!before.is_object()) return;
  try {
    go_on_from(before, recorded);
  } catch (const nlohmann::json::exception&) {
    throw Error("is damaged; put it aside, or record into another folder", file_.string());
  }
}

void TruthFile::go_on_from(const nlohmann::json& before, const std::vector<Push>& recorded) {
  for (const char* field : {"object", "young_modulus_pa", "poisson_ratio", "material", "regions"}) {
    const nlohmann::json then = before.value(field, nlohmann::json()), now = known_->value(field, nlohmann::json());
    if (then != now)
      throw Error(fmt::format("cannot go on: {} was {} and is {} now; give the --seed and the options that it was begun with", field,
                              then.dump(), now.dump()),
                  file_.string());
  }
  const auto is_recorded = [&](const nlohmann::json& one) {
    for (const Push& push : recorded)
      for (const Step& step : push.steps)
        if (one.value("push", "") == push.name && std::abs(one.value("time_s", -1.0) - step.time_s) < 1e-6) return true;
    return false;
  };
  for (const nlohmann::json& one : before.value("steps", nlohmann::json::array()))
    if (is_recorded(one)) (*known_)["steps"].push_back(one);
}

void TruthFile::add(const nlohmann::json& step) {
  if (!known_) return;
  (*known_)["steps"].push_back(step);
  write_json_aside(*known_, file_);
}

}  // namespace palpate::cli
