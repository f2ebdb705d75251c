// SPDX-License-Identifier: Apache-2.0
#include "python/check.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string_view>

#include "palpate/core/recording_values.hpp"
#include "palpate/geometry/mesh_checks.hpp"
#include "palpate/identify.hpp"
#include "python/arguments.hpp"
#include "python/python_calls.hpp"

namespace palpate::python {
namespace {

/// @throws Error for what `palpate check --help` would refuse
estimation::SelfCheckOptions check_options(Options& from) {
  estimation::SelfCheckOptions options;
  bool rigid = false;
  std::optional<double> stiffness_relative_std;
  from.take("stiffness_n_per_m", options.stiffness_n_per_m);
  from.take("rigid", rigid);
  from.take("stiffness_relative_std", stiffness_relative_std);
  from.take("placed_std_m", options.placed_std_m);
  from.take("placed_std_rad", options.placed_std_rad);
  from.take("touch_std_m", options.touch_std_m);
  from.all_taken();
  const auto need = [](bool good, const char* name, const char* rule) {
    if (!good) throw Error(rule, name);
  };
  need(rigid != options.stiffness_n_per_m.has_value(), "stiffness_n_per_m", "say what was pushed: stiffness_n_per_m of a spring, or rigid=True");
  need(!(rigid && stiffness_relative_std), "stiffness_relative_std", "is of a spring; a rigid block has none");
  options.stiffness_relative_std = stiffness_relative_std.value_or(options.stiffness_relative_std);
  const auto is_positive = [](double value) { return value > 0 && std::isfinite(value); };
  const auto from_zero = [](double value) { return value >= 0 && std::isfinite(value); };
  need(rigid || is_positive(*options.stiffness_n_per_m), "stiffness_n_per_m", "must be a number above 0, in N/m");
  need(from_zero(options.stiffness_relative_std), "stiffness_relative_std", "must be 0 or a number above it; 0.01 is 1 %");
  need(from_zero(options.placed_std_m), "placed_std_m", "must be 0 or a number above it, in metres");
  need(from_zero(options.placed_std_rad), "placed_std_rad", "must be 0 or a number above it, in radians");
  need(is_positive(options.touch_std_m), "touch_std_m", "must be a number above 0, in metres");
  return options;
}

TriMesh body_of(const Recording& recording) {
  if (recording.rest.surface) return *recording.rest.surface;
  if (recording.rest.volume) return geometry::boundary_surface(*recording.rest.volume).surface;
  throw Error("has neither surface nor volume; give the body's shape where it stands in the base frame", "recording.rest");
}

/// As the exit code of `palpate check`: what is not determined is no fault of the rig.
bool is_consistent(const estimation::SelfCheck& check) {
  constexpr std::array<std::string_view, 3> faults = {"does_not_fit", "camera_sees_something_else", "touch_misses_body"};
  return check.converged && std::all_of(check.errors.begin(), check.errors.end(), [](const auto& error) { return error.consistent; }) &&
         std::none_of(check.verdicts.begin(), check.verdicts.end(),
                      [&](const Verdict& verdict) { return std::find(faults.begin(), faults.end(), verdict.code) != faults.end(); });
}

}  // namespace

py::object check_with(const py::object& given, const py::dict& options) {
  const Recording recording = recording_of(given);
  Options from(options);
  const estimation::SelfCheckOptions asked = check_options(from);
  demand_right_values(wrong_values(recording));  // of files their readers say it; a body need not be fit for an estimate
  return to_python(without_lock(py::none(), [&](const OnProgress&) {
    RigCheck check{estimation::self_check(recording, body_of(recording), observe(recording), asked), false};
    check.consistent = is_consistent(check);
    return check;
  }));
}

}  // namespace palpate::python
