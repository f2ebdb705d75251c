// SPDX-License-Identifier: Apache-2.0
#include "cli/option_hints.hpp"

#include <fmt/format.h>

#include <string_view>

namespace palpate::cli {
namespace {

struct Hint {
  std::string_view field;  ///< what an error's `where` ends with
  std::string_view option;
};

constexpr Hint hints[] = {
    {"ObjectOptions.stands", "--stands rough"},
    {"ObjectOptions.region_ratio", "--region-ratio"},
    {": extent_m", "--object-size"},
    {"result: regions", "--regions none"},
    {"PushOptions.increment_m", "--increment"},
    {"PushOptions.look_every_m", "--look-every"},
    {"TetrahedraliseOptions: tetrahedra", "--tetrahedra"},
    {"TetrahedraliseOptions: finer.edge_m", "--finer"},
    {"PushOptions.settling_timeout_s", "--settling-timeout"},
    {"SlipOptions.force_drop", "--slip-force-drop"},
    {"export: density_kg_m3", "--density"},
};

}  // namespace

std::string with_option(const Error& error) {
  for (const Hint& hint : hints)
    if (error.where().ends_with(hint.field)) return fmt::format("{} (`{}`)", error.message(), hint.option);
  return error.message();
}

}  // namespace palpate::cli
