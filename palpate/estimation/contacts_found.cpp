// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/contacts_found.hpp"

#include <algorithm>

#include "palpate/core/error.hpp"
#include "palpate/estimation/load_columns.hpp"
#include "palpate/estimation/rigid_tool.hpp"

namespace palpate::estimation {

std::optional<Recording> with_contacts_found(const Recording& recording, const ForwardModel& model, const VectorX& unknowns) {
  constexpr double as_good_as_linear = 0.1;  // of the tool's size
  double furthest = 0;
  for (std::size_t s = 0; s < model.step_count(); ++s) {
    for (std::size_t l = 0; l < model.step(s).loads.size(); ++l) {
      Load load = model.step(s).loads[l];
      const Vec3 before_m = load.contact_found_m;
      load.contact_found_m = model.contact_found_m(s, l, unknowns);
      const Tool& tool = model.tool(load.tool);
      const double size_m = tool.radius_m > 0 ? tool.radius_m : tool.length_m;
      const double off = size_m > 0 ? (load.contact_found_m - before_m).norm() / size_m : 0;
      if (off > as_good_as_linear) {
        try {
          load.travel_m ? void(rigid_tool(model.object().mesh, tool, load)) : void(load_columns(model.object().mesh, tool, load));
        } catch (const Error&) {
          return std::nullopt;
        }
      }
      furthest = std::max(furthest, off);
    }
  }
  if (furthest < as_good_as_linear) return std::nullopt;
  std::optional<Recording> there = recording;
  for (std::size_t s = 0; s < model.step_count(); ++s) {
    std::vector<Load>& loads = there->pushes[model.index(s).push].steps[model.index(s).step].loads;
    for (std::size_t l = 0; l < loads.size(); ++l) loads[l].contact_found_m = model.contact_found_m(s, l, unknowns);
  }
  return there;
}

}  // namespace palpate::estimation
