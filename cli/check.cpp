// SPDX-License-Identifier: Apache-2.0
// `palpate check RECORDING --stiffness K | --rigid`: pushes on a spring of known stiffness or a rigid block say what is
// wrong with force scale, compliance and the camera's place before any Young's modulus is believed.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "cli/bag_recording.hpp"
#include "cli/number_checks.hpp"
#include "cli/verbs.hpp"
#include "palpate/core/error.hpp"
#include "palpate/estimation/self_check.hpp"
#include "palpate/geometry/mesh_checks.hpp"
#include "palpate/identify.hpp"
#include "palpate/recording_oddities.hpp"

namespace palpate::cli {
namespace {

struct CheckArguments {
  std::filesystem::path recording, mapping;
  double stiffness_n_per_m = 0;
  bool rigid = false;
  estimation::SelfCheckOptions check;
};

/// "+6.1 %"
std::string written(const estimation::CheckedError& error, double value) {
  if (error.unit == "1") return fmt::format("{:+.2f} %", 100 * value);
  if (error.unit == "m") return fmt::format("{:+.3f} mm", 1e3 * value);
  constexpr double degrees = 57.29577951308232;  // EIGEN_PI is a long double, which is printed with all its digits
  if (error.unit == "rad") return fmt::format("{:+.3f} deg", value * degrees);
  if (error.unit == "m/N") return fmt::format("{:+.4f} mm/N", 1e3 * value);
  return fmt::format("{:+.3f} {}", value, error.unit);
}

TriMesh body_of(const Recording& recording) {
  if (recording.rest.surface) return *recording.rest.surface;
  if (recording.rest.volume) return geometry::boundary_surface(*recording.rest.volume).surface;
  throw Error("give the body's shape in the base frame as rest.surface_mesh", "rest");
}

template <typename Vector>
std::vector<double> number_list(const Vector& of) {
  return {of.data(), of.data() + of.size()};
}

/// Where the camera of the first image stands by what was found.
std::string camera_as_found(const Recording& recording, const Pose& correction) {
  for (const auto& push : recording.pushes)
    for (const auto& step : push.steps)
      for (const auto& observation : step.observations) {
        const auto* frame = std::get_if<DepthFrame>(&observation);
        if (frame == nullptr) continue;
        const Pose found = correction * frame->T_base_camera;
        const Eigen::Quaterniond turned(found.linear());
        const Vec3 at = found.translation();
        return fmt::format("; by it the first image's T_base_camera is position_m: [{:.4f}, {:.4f}, {:.4f}], quaternion_xyzw: [{:.4f}, {:.4f}, {:.4f}, {:.4f}]",
                           at.x(), at.y(), at.z(), turned.x(), turned.y(), turned.z(), turned.w());
      }
  return "";
}

int run(const CheckArguments& given, Session& session) {
  if (given.rigid == (given.stiffness_n_per_m > 0))
    throw Error("say what was pushed: --stiffness N_PER_M of a spring, or --rigid", "--stiffness");
  Recording recording = load_recording_unchecked(session, given.recording, given.mapping);
  // Its images are compared with the body: an arm in them is taken for it, too.
  const std::size_t said = recording.warnings.size();
  warn_of_oddities(recording);
  for (std::size_t i = said; i < recording.warnings.size(); ++i) session.warn(recording.warnings[i]);
  estimation::SelfCheckOptions options = given.check;
  if (!given.rigid) options.stiffness_n_per_m = given.stiffness_n_per_m;
  const estimation::SelfCheck check = estimation::self_check(recording, body_of(recording), observe(recording), options);

  session.say(fmt::format("{}: {} travels, {} first touches, {} rays; chi2 per degree of freedom {:.2f}",
                          given.rigid ? "a rigid block" : fmt::format("a spring of {:g} N/m", given.stiffness_n_per_m),
                          check.travels, check.touches, check.rays, check.chi2_per_dof));
  nlohmann::json json = {{"format", "palpate-check/1"},        {"converged", check.converged},
                         {"chi2_per_dof", check.chi2_per_dof}, {"travel_rms_m", check.travel_rms_m},
                         {"depth_rms_m", check.depth_rms_m},   {"errors", nlohmann::json::array()},
                         {"verdicts", nlohmann::json::array()}};
  bool fine = check.converged;
  std::string undetermined;
  for (const auto& error : check.errors) {
    const bool open = !error.determined && !error.name.starts_with("force_tare");
    if (open) undetermined += (undetermined.empty() ? "" : ", ") + error.name;
    const std::string stated =
        error.stated_std > 0 ? "stated within " + written(error, error.stated_std).substr(1) : "stated as exact";
    session.say(fmt::format("  {:<24} {:>14} +- {:<12} {:<26} {}", error.name, written(error, error.value),
                            written(error, error.std).substr(1), stated,
                            open ? "not determined" : error.consistent ? "consistent" : "NOT CONSISTENT"));
    json["errors"].push_back({{"name", error.name},
                              {"unit", error.unit},
                              {"value", error.value},
                              {"std", error.std},
                              {"lower_95", error.lower_95},
                              {"upper_95", error.upper_95},
                              {"stated_std", error.stated_std},
                              {"determined", error.determined},
                              {"consistent", error.consistent}});
    fine = fine && error.consistent;
  }
  if (check.rays > 0) {
    json["hand_eye_pivot_m"] = number_list(check.pivot_m);
    for (int row = 0; row < 4; ++row) json["hand_eye_correction"].push_back(number_list(VectorX(check.hand_eye_correction.matrix().row(row))));
    session.say(fmt::format("hand_eye is about {:.3f} {:.3f} {:.3f} m, the body's middle{}", check.pivot_m.x(), check.pivot_m.y(), check.pivot_m.z(),
                            camera_as_found(recording, check.hand_eye_correction)));
  }
  for (const auto& verdict : check.verdicts) {
    session.warn(fmt::format("{}: {}", verdict.code, verdict.message));
    json["verdicts"].push_back({{"code", verdict.code}, {"message", verdict.message}});
    fine = fine && verdict.code != "does_not_fit" && verdict.code != "camera_sees_something_else" && verdict.code != "touch_misses_body";
  }
  if (!check.message.empty()) session.warn(check.message);
  if (fine && undetermined.empty())
    session.say("all of this is consistent with what the recording states");
  else if (fine)
    session.say("what these pushes determine is consistent with what the recording states; nothing is known of " + undetermined);
  json["consistent"] = fine;
  session.result(json);
  return fine ? exit_done : exit_numbers;
}

}  // namespace

Run verbs::check(CLI::App& app) {
  auto given = std::make_shared<CheckArguments>();
  app.add_option("recording", given->recording,
                 "of pushes on the known body: forces, travels, and depth images if there is a camera")
      ->required();
  app.add_option("--mapping", given->mapping, "what a bag's topics mean (default: mapping.yaml beside it)");
  auto* const stiffness =
      app.add_option("--stiffness", given->stiffness_n_per_m, "of the spring along every push, N/m; its plate is the recording's surface")
          ->check(positive_number());
  app.add_flag("--rigid", given->rigid, "the body does not give way at all");
  app.add_option("--stiffness-std", given->check.stiffness_relative_std, "how well the stiffness is known, relative")
      ->needs(stiffness)
      ->check(number_from_zero())
      ->capture_default_str();
  app.add_option("--placed-within", given->check.placed_std_m,
                 "standard deviation of the body's place in the robot's frame, m (0: exact)")
      ->check(number_from_zero());
  app.add_option("--turned-within", given->check.placed_std_rad, "of its orientation, rad (0: exact)")
      ->check(number_from_zero());
  app.add_option("--touch-within", given->check.touch_std_m, "of the tip at first contact along the push, m")
      ->check(positive_number())
      ->capture_default_str();
  return [given](Session& session) { return run(*given, session); };
}

}  // namespace palpate::cli
