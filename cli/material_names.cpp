// SPDX-License-Identifier: Apache-2.0
#include "cli/material_names.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "cli/mistyped.hpp"
#include "palpate/fem/materials.hpp"

namespace palpate::cli {
namespace {

std::vector<std::string> material_names() {
  std::vector<std::string> names;
  for (const fem::MaterialLaw* law : fem::material_table()) names.emplace_back(law->name());
  return names;
}

}  // namespace

std::string material_list() { return fmt::format("{}", fmt::join(material_names(), ", ")); }

std::optional<std::string> wrong_material(const std::string& name) {
  const std::vector<std::string> names = material_names();
  if (std::find(names.begin(), names.end(), name) != names.end()) return std::nullopt;
  const auto meant = did_you_mean(name, names);
  return fmt::format("no material is called '{}';{} they are {}", name, meant ? fmt::format(" did you mean '{}'?", *meant) : "",
                     material_list());
}

}  // namespace palpate::cli
