// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/names_of_unknowns.hpp"

#include <algorithm>

#include "palpate/estimation/forward_model_parts.hpp"
#include "palpate/estimation/slips.hpp"

namespace palpate::estimation {
namespace {

std::string with(std::string ending, const std::string& more) {
  ending.insert(ending.size() - 1, ", " + more);
  return ending;
}

}  // namespace

std::vector<std::string> tools_of(const Push& push) {
  std::vector<std::string> tools;
  for (const Step& step : push.steps)
    for (const Load& load : step.loads)
      if (std::find(tools.begin(), tools.end(), load.tool) == tools.end()) tools.push_back(load.tool);
  if (tools.empty()) tools.emplace_back();
  return tools;
}

std::string of_push(const Push& push, const std::string& tool) {
  const std::string ending = "[" + push.name + "]";
  return tool == tools_of(push).front() ? ending : with(ending, tool);
}

std::string of_stretch(const Push& push, std::size_t step, const std::string& tool) {
  const std::string ending = stretch_of(push, step);
  return tool == tools_of(push).front() ? ending : with(ending, tool);
}

std::string of_contact(const Push& push, std::size_t step, const Load& load) {
  const std::string stretch = stretch_of(push, step), here = key_of(load);
  std::vector<std::string> places;  // of this tool, before or at this load
  for (std::size_t s = 0; s <= step; ++s) {
    if (stretch_of(push, s) != stretch) continue;
    for (const Load& other : push.steps[s].loads) {
      if (other.tool != load.tool) continue;
      const std::string there = key_of(other);
      if (std::find(places.begin(), places.end(), there) == places.end()) places.push_back(there);
    }
  }
  const auto number = std::find(places.begin(), places.end(), here) - places.begin() + 1;
  return number == 1 ? of_stretch(push, step, load.tool) : with(stretch, load.tool + " " + std::to_string(number));
}

std::string of_load(const Push& push, std::size_t step, std::size_t load) {
  const std::string ending = "[" + push.name + ":" + std::to_string(step) + "]";
  if (load == 0) return ending;
  const std::vector<Load>& loads = push.steps[step].loads;
  const std::string& tool = loads[load].tool;
  const auto same = std::count_if(loads.begin(), loads.begin() + static_cast<std::ptrdiff_t>(load), [&](const Load& one) { return one.tool == tool; });
  return with(ending, same == 0 ? tool : tool + " " + std::to_string(same + 1));
}

std::string of_frame(int before) { return before == 0 ? "frame" : "frame" + std::to_string(before + 1); }

std::string of_camera(const Push& push, const std::string& camera, int before) {
  if (camera.empty() && before > 0) return "[" + push.name + ", " + of_frame(before) + "]";
  return camera.empty() || camera == "0" ? "[" + push.name + "]" : "[" + push.name + ", camera " + camera + "]";
}

}  // namespace palpate::estimation
