// SPDX-License-Identifier: Apache-2.0
#include "python/arguments.hpp"

#include <algorithm>
#include <cmath>

#include "cli/material_names.hpp"
#include "palpate/core/thread_count.hpp"

namespace palpate::python {
namespace {

/// Messages name the place in the user's object where a file would be named.
void name_places(Recording& recording, const Place& top) {
  const auto name = [](std::string& source, const Place& place) {
    if (source.empty()) source = place.words();
  };
  const Place pushes("pushes", &top), supports("supports", &top), regions("regions", &top);
  name(recording.source, top);
  name(recording.rest.source, Place("rest", &top));
  for (std::size_t i = 0; i < recording.supports.size(); ++i) name(recording.supports[i].source, Place(i, &supports));
  for (std::size_t i = 0; i < recording.regions.size(); ++i) name(recording.regions[i].source, Place(i, &regions));
  for (std::size_t p = 0; p < recording.pushes.size(); ++p) {
    const Place push(p, &pushes), steps("steps", &push);
    for (std::size_t s = 0; s < recording.pushes[p].steps.size(); ++s) name(recording.pushes[p].steps[s].source, Place(s, &steps));
  }
}

}  // namespace

Recording recording_of(const py::object& given, const char* name) {
  const Place top(name);
  Recording recording = from_python<Recording>(given, top);
  name_places(recording, top);
  if (const auto wrong = cli::wrong_material(recording.model.material)) throw Error(*wrong, std::string(name) + ".model.material");
  return recording;
}

std::filesystem::path path_of(const py::object& given) { return std::string(py::bytes(py::module_::import("os").attr("fsencode")(given))); }

int threads_of(int asked) {
  if (asked < 0) throw Error("must be at least 1, or 0: as many as the machine has", "threads");
  return thread_count(asked);
}

IdentifyOptions identify_options(Options& from) {
  IdentifyOptions options;
  std::optional<std::vector<double>> range;
  int threads = 0;
  from.take("method", options.method);
  from.take("material", options.material);
  from.take("element", options.element);
  from.take("refine", options.refine);
  from.take("regions", options.regions);
  from.take("poisson_range", range);
  from.take("poisson_ratio", options.poisson_fixed);
  from.take("poisson_by_region", options.poisson_by_region);
  from.take("mesh_tolerance", options.mesh_tolerance);
  from.take("slips", options.slips);
  from.take("all_loads", options.all_loads);
  from.take("compare_laws", options.fit.compare_laws);
  from.take("cross_checks", options.fit.cross_checks);
  from.take("young_modulus_start_pa", options.fit.young_start_pa);
  from.take("max_iterations", options.fit.max_iterations);
  from.take("threads", threads);
  options.fit.threads = threads_of(threads);
  if (options.material)
    if (const auto wrong = cli::wrong_material(*options.material)) throw Error(*wrong, "material");
  if (range && range->size() != 2) throw Error("must be two numbers, the lower first", "poisson_range");
  if (range) options.poisson_range = {range->at(0), range->at(1)};
  return options;
}

SuggestedPush suggested(const estimation::RatedPush& push, const PushScene& scene) {
  constexpr double quantile_975 = 1.959963984540054;
  SuggestedPush out{push.candidate.contact_m, push.candidate.direction, push.force_n, push.travel_m, push.steps, "", "", push.seen_share, 0, 0, ""};
  out.words = push_words(push, scene);
  if (push.view >= 0) out.view = scene.viewpoints[std::size_t(push.view)].name;
  if (push.expected.region_log_young_std.size() > 1) out.region = scene.simulated.region_names[std::size_t(push.region)];
  out.young_modulus_within = std::exp(quantile_975 * push.expected.region_log_young_std(push.region)) - 1;
  out.poisson_ratio_within = quantile_975 * push.expected.poisson_std;
  return out;
}

}  // namespace palpate::python
