// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

namespace palpate::cli {

/// "linear, corotational, ...": all that there are.
std::string material_list();

/// What is wrong with a material's name and which there are, or nothing.
std::optional<std::string> wrong_material(const std::string& name);

}  // namespace palpate::cli
