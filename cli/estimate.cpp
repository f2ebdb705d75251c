// SPDX-License-Identifier: Apache-2.0
// `palpate estimate RECORDING -o OUT`: result.json, model/ and report.html, and the answer in words.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>

#include "cli/bag_recording.hpp"
#include "cli/learned_object.hpp"
#include "cli/live_report.hpp"
#include "cli/material_names.hpp"
#include "cli/number_checks.hpp"
#include "cli/paths.hpp"
#include "cli/verbs.hpp"
#include "palpate/core/error.hpp"
#include "palpate/identify.hpp"
#include "palpate/io/result.hpp"
#include "palpate/report/words.hpp"
#include "palpate/suggest.hpp"

namespace palpate::cli {
namespace {

struct EstimateArguments {
  std::filesystem::path recording, mapping, out;
  std::string method = "palpate", material, element, refine, regions = "recorded";
  std::vector<double> poisson_range;
  std::optional<double> poisson_ratio, young_start_pa;
  double mesh_tolerance = 0.01;
  int max_iterations = 60;
  bool poisson_by_region = false, budget = false, compare_laws = false, all_loads = false, no_slips = false;
  LiveOptions live;
};

/// Seconds a stage, from the progress reports: the library itself reads no clock.
class StageClock {
 public:
  void enter(const std::string& stage) {
    const auto now = std::chrono::steady_clock::now();
    if (!stage_.empty()) seconds_[stage_] += std::chrono::duration<double>(now - since_).count();
    stage_ = stage;
    since_ = now;
  }
  std::map<std::string, double> finish() {
    enter("");
    return seconds_;
  }

 private:
  std::string stage_;
  std::chrono::steady_clock::time_point since_{};
  std::map<std::string, double> seconds_;
};

IdentifyOptions identify_options(const EstimateArguments& given, const Session& session) {
  IdentifyOptions options;
  options.method = given.method;
  options.regions = given.regions;
  if (!given.material.empty()) options.material = given.material;
  if (!given.element.empty()) options.element = given.element;
  if (!given.refine.empty()) options.refine = given.refine;
  if (given.poisson_range.size() == 2 && !(0 <= given.poisson_range[0] && given.poisson_range[0] < given.poisson_range[1]))
    throw Error(fmt::format("must be a range within 0 and 0.4995, the lower end first, is {:g} to {:g}", given.poisson_range[0], given.poisson_range[1]),
                "--poisson-range");
  if (given.poisson_range.size() == 2) options.poisson_range = {given.poisson_range[0], given.poisson_range[1]};
  if (given.poisson_ratio) options.poisson_fixed = *given.poisson_ratio;
  options.poisson_by_region = given.poisson_by_region;
  if (given.young_start_pa) options.fit.young_start_pa = *given.young_start_pa;
  options.mesh_tolerance = given.mesh_tolerance;
  options.all_loads = given.all_loads;
  options.slips = !given.no_slips;
  options.fit.max_iterations = given.max_iterations;
  options.fit.compare_laws = given.compare_laws;
  options.fit.threads = session.thread_count();
  return options;
}

/// Before the object is meshed, which may take minutes.
void check_material(const std::string& material, const std::string& where) {
  if (const auto wrong = wrong_material(material)) throw Error(*wrong, where);
}

/// Of E, of every region's where there are several, and of nu.
std::string budget_words(const BudgetEntry& entry) {
  std::string young = fmt::format("{:6.2f} % of E", entry.young_modulus_percent);
  for (std::size_t r = 0; r < entry.regions.size(); ++r) {
    const std::string one = fmt::format("{:6.2f} % of E of {}", entry.regions[r].young_modulus_percent, entry.regions[r].region);
    young = r == 0 ? one : young + "   " + one;
  }
  return fmt::format("{}   {:.4f} of nu", young, entry.poisson_shift);
}

void tell(Session& session, const HeldOut& held_out) {
  if (!held_out.available) return;
  std::string words;
  if (std::isfinite(held_out.deformation_explained)) words += fmt::format(" {:.3g} % of the deformation foretold,", 100 * held_out.deformation_explained);
  if (held_out.surface_rms_m > 0)
    words += fmt::format(" surface {} rms ({} had nothing moved{}),", report::quantity(held_out.surface_rms_m, "m"),
                         report::quantity(held_out.baseline_no_deformation_rms_m, "m"),
                         std::isfinite(held_out.fitted_rms_m)
                             ? fmt::format("; {} in the fit that has seen it", report::quantity(held_out.fitted_rms_m, "m"))
                             : std::string());
  if (std::isfinite(held_out.force_error)) words += fmt::format(" force within {:.2g} %,", 100 * held_out.force_error);
  if (words.empty()) return;
  words.back() = ' ';
  session.say(fmt::format("held out           {}:{}", held_out.what, words.substr(0, words.size() - 1)));
}

void tell(Session& session, const std::vector<LawFit>& laws) {
  if (laws.empty()) return;
  session.say("laws               fitted to the same data on one mesh; the highest loads predicted from the lower ones:");
  for (const LawFit& fit : laws) {
    if (!fit.usable) {
      session.say(fmt::format("  {:<16} {}", fit.law, fit.message));
      continue;
    }
    const HeldOut& higher = fit.held_out;
    session.say(fmt::format("  {:<16} E {}, nu {:.3f};{}{} chi2 of these loads {:.0f}, of the fit {:.0f}", fit.law,
                            report::quantity(fit.young_modulus_pa, "Pa"), fit.poisson_ratio,
                            std::isfinite(higher.force_error) ? fmt::format(" force within {:.2g} %,", 100 * higher.force_error) : "",
                            std::isfinite(higher.surface_rms_m) ? fmt::format(" surface {} rms,", report::quantity(higher.surface_rms_m, "m")) : "",
                            fit.held_out_chi2, fit.chi2));
  }
}

/// Whoever states no standard deviations has narrow intervals: what is not in them, in one line.
void tell_exact(Session& session, const Identification& answer) {
  constexpr std::size_t most_named = 4;
  constexpr double least_percent = 0.05;
  std::vector<BudgetEntry> exact = answer.budget_if;
  std::erase_if(exact, [](const BudgetEntry& one) { return !(one.young_modulus_percent > least_percent); });
  if (exact.empty()) return;
  std::stable_sort(exact.begin(), exact.end(), [](const auto& a, const auto& b) { return a.young_modulus_percent > b.young_modulus_percent; });
  std::string names;
  double squares = 0;
  for (std::size_t k = 0; k < exact.size(); ++k) {
    squares += exact[k].young_modulus_percent * exact[k].young_modulus_percent;
    if (k < most_named) names += (k > 0 ? ", " : "") + exact[k].input;
  }
  if (exact.size() > most_named) names += fmt::format(" and {} more", exact.size() - most_named);
  session.say(fmt::format("taken as exact     {}: were each off by a typical size, E would be off by {:.2g} % (--budget says which and how to state it)",
                          names, std::sqrt(squares)));
}

void tell(Session& session, const EstimateArguments& given, const Identification& answer) {
  for (const auto& parameter : answer.parameters) {
    const bool young = parameter.name == "young_modulus" && parameter.region.empty();
    const std::string label = young ? "Young's modulus E"
                              : parameter.name == "poisson_ratio" && parameter.region.empty() ? "Poisson ratio nu"
                                                                                               : report::parameter_title(parameter);
    if (!std::isfinite(parameter.lower_95)) {
      session.say(fmt::format("{:<18} {}   (this method gives no interval)", label, report::quantity(parameter.value, parameter.unit)));
      continue;
    }
    if (parameter.lower_95 == parameter.upper_95) {
      session.say(fmt::format("{:<18} {}   (given)", label, report::quantity(parameter.value, parameter.unit)));
      continue;
    }
    const double resolution = (parameter.upper_95 - parameter.lower_95) / 30;
    session.say(fmt::format("{:<18} {}   95 % interval {}{}", label, report::quantity(parameter.value, parameter.unit, resolution),
                            report::interval(parameter.lower_95, parameter.upper_95, parameter.unit),
                            parameter.determined ? "" : "   (hardly determined by these data)"));
  }
  const std::string lengths = std::isfinite(answer.fit.rms_m) ? fmt::format("residuals {} rms over ", report::quantity(answer.fit.rms_m, "m")) : "";
  session.say(fmt::format("fit                {}{} values; chi2 per degree of freedom {:.3g}, 1 where noise is as stated", lengths,
                          answer.fit.points_used, answer.fit.chi2_per_dof));
  const auto mesh = answer.provenance.find("mesh"), error = answer.provenance.find("mesh's error in E");
  if (mesh != answer.provenance.end() && error != answer.provenance.end()) {
    const bool known = error->second != "not estimated";
    const bool as_given = answer.provenance.at("refine") == "none";
    session.say(fmt::format("mesh               {}; its own error {}", mesh->second,
                            known ? "of about " + error->second + " of E is taken out, half of it stays in the interval"
                                  : std::string("was not estimated and is not in the interval") +
                                        (as_given ? " (--refine auto does both)" : "")));
  }
  tell(session, answer.prediction);
  tell(session, answer.laws);
  if (given.budget) {
    session.say("error budget       what each input's uncertainty does to E and nu:");
    for (const auto& entry : answer.budget) session.say(fmt::format("  {:<24} {}", entry.input, budget_words(entry)));
    if (!answer.budget_if.empty())
      session.say("not in the interval, since the recording states it as exact; what it would do were it off by that much:");
    for (const auto& entry : answer.budget_if)
      session.say(fmt::format("  {:<24} {}   if off by {} (in the interval with {})", entry.input, budget_words(entry), entry.off_by, entry.field));
  }
  if (!given.budget) tell_exact(session, answer);
  for (const auto& verdict : answer.verdicts) session.warn(fmt::format("{}: {}", verdict.code, verdict.message));
}

int estimate(Session& session, const EstimateArguments& given) {
  StageClock clock;
  must_leave_recording(given.out, given.recording);
  must_take_files(given.out);
  if (!given.material.empty()) check_material(given.material, "--material");
  LiveReport live(given.live, session, given.recording.filename().string());
  const OnProgress show = live.watch(session.progress());
  const OnProgress progress = [&](std::string_view stage, double share) {
    clock.enter(std::string(stage));
    return show ? show(stage, share) : true;
  };
  progress("read", 0);
  std::vector<acquisition::ClockOffset> clocks;
  const Recording recording = load_recording(session, given.recording, given.mapping, &clocks);
  for (const auto& warning : recording.warnings) session.warn(warning);
  if (given.material.empty()) check_material(recording.model.material, given.recording.string() + ": model.material");
  IdentifyOptions options = identify_options(given, session);
  options.fit.on_estimate = live.on_estimate(recording);
  Identified found = identify(recording, options, progress);
  for (const std::string& warning : found.object.warnings)  // of the shape, once it was filled
    if (std::find(recording.warnings.begin(), recording.warnings.end(), warning) == recording.warnings.end()) session.warn(warning);
  name_push_for_poisson(recording, found, session.thread_count(), progress);
  Identification& answer = found.answer;
  answer.provenance["recording path"] = std::filesystem::absolute(given.recording).lexically_normal().string();
  answer.provenance["seed"] = std::to_string(session.seed);
  for (const acquisition::ClockOffset& one : clocks) answer.provenance["clock of " + one.sensor] = to_words(one);
  progress("write", 0);
  if (answer.termination == Termination::cancelled) {
    session.warn("stopped before the end: nothing was written");
    return exit_numbers;
  }
  answer.timing_s = clock.finish();
  write_learned_object(found, recording, given.out);
  if (!answer.parameters.empty()) tell(session, given, answer);
  session.say(fmt::format("written            {}", (given.out / "report.html").string()));
  session.result(io::result_json(answer));
  live.finish(answer, recording, (given.out / "report.html").string());
  return answer.termination == Termination::converged ? exit_done : exit_numbers;
}

}  // namespace

Run verbs::estimate(CLI::App& app) {
  auto given = std::make_shared<EstimateArguments>();
  app.add_option("recording", given->recording, "folder of the recording, or a bag: MCAP, rosbag2 (a folder or .db3), ROS 1")
      ->required();
  app.add_option("--mapping", given->mapping, "what a bag's topics mean (default: mapping.yaml beside it)");
  app.add_option("-o,--out", given->out, "folder for result.json, model/ and report.html")->required();
  app.add_option("--method", given->method, "palpate, or paper: the algorithm of Frank et al. 2010 as a baseline")
      ->check(CLI::IsMember({"palpate", "paper"}));
  app.add_option("--material", given->material, "material law (overrides the recording's): " + material_list());
  app.add_option("--element", given->element, "tet4, tet10 or auto (overrides the recording's)")
      ->check(CLI::IsMember({"tet4", "tet10", "auto"}));
  app.add_option("--refine", given->refine, "none or auto: finer under the tool (overrides the recording's)")
      ->check(CLI::IsMember({"none", "auto"}));
  app.add_option("--mesh-tolerance", given->mesh_tolerance,
                 "with refine auto: fit again on a finer mesh while the mesh's own share of E is above this (0.01 = 1 %)")
      ->check(positive_number());
  app.add_option("--regions", given->regions,
                 "parts with an E of their own: recorded (what the recording says), by-site (one around each site that was pushed) or none")
      ->check(CLI::IsMember({"recorded", "by-site", "none"}));
  app.add_option("--poisson-range", given->poisson_range, "range of the uniform prior on nu, e.g. 0.3 0.4995")->expected(2)->check(poisson_number());
  app.add_option("--poisson-ratio", given->poisson_ratio, "take nu as known")->check(poisson_number());
  app.add_flag("--poisson-by-region", given->poisson_by_region, "every region has a nu of its own; without it they share one");
  app.add_option("--young-modulus-start", given->young_start_pa, "start of E in Pa (default: found from the data)")
      ->check(positive_number());
  app.add_option("--max-iterations", given->max_iterations, "most iterations of the fit")->check(positive_number());
  app.add_flag("--compare-laws", given->compare_laws,
               "fit linear, neo_hookean and foam to the same data and predict the highest loads from the lower ones, also where E does not drift with the load");
  app.add_flag("--all-loads", given->all_loads,
               "fit also loads whose mean pressure is above 0.4 E, which are left out by themselves (a simulated patch caves in there): slow, and far off");
  app.add_flag("--no-slips", given->no_slips,
               "take the tool to touch where the recording says all the time, also where the data say that it slid");
  app.add_flag("--budget", given->budget, "print what each input's uncertainty does to E and nu");
  given->live.add_to(app);
  return [given](Session& session) { return estimate(session, *given); };
}

}  // namespace palpate::cli
