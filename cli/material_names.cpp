// SPDX-License-Identifier: Apache-2.0
#include "cli/material_names.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "cli/mistyped.hpp"
#include "palpate/fem/materials.hpp"

namespace palpate::cli {

std::optional<std::string> wrong_material(const std::string& name) {
  std::vector<std::string> names;
  for (const fem::MaterialLaw* law : fem::material_table()) names.emplace_back(law->name());
  if (std::find(names.begin(), names.end(), name) != names.end()) return std::nullopt;
  const auto meant = did_you_mean(name, names);
  return fmt::format("no material is called '{}';{} they are {}", name, meant ? fmt::format(" did you mean '{}'?", *meant) : "",
                     fmt::join(names, ", "));
}

}  // namespace palpate::cli
