// SPDX-License-Identifier: Apache-2.0
// `palpate suggest RESULT|RECORDING`: which push would tell the most about E and nu, before the first touch too.
#include "palpate/suggest.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>

#include "cli/bag_recording.hpp"
#include "cli/learned_object.hpp"
#include "cli/number_checks.hpp"
#include "cli/push_words.hpp"
#include "cli/verbs.hpp"
#include "palpate/core/error.hpp"
#include "palpate/estimation/target_plan.hpp"
#include "palpate/io/recording.hpp"
#include "palpate/recording_oddities.hpp"
#include "palpate/report/words.hpp"

namespace palpate::cli {
namespace {

namespace fs = std::filesystem;

struct SuggestArguments {
  fs::path given, recording, mapping;
  std::string goal = "both";
  SuggestOptions suggest;
  std::vector<double> contact, direction;
  int show = 10, then = 3;
  std::optional<double> young_modulus_within, poisson_ratio_within;
};

constexpr int longest_plan = 30;

struct Known {
  Recording recording;  ///< of a result: the object as it was fitted
  std::optional<Identification> answer;
};

Known read(Session& session, const SuggestArguments& given, std::vector<std::string>& warnings) {
  std::error_code code;
  Known known;
  const bool is_result = fs::exists(given.given / "result.json", code) || given.given.filename() == "result.json";
  if (!is_result) {
    known.recording = load_recording_unchecked(session, given.given, given.mapping);
    const auto said = std::ptrdiff_t(known.recording.warnings.size());  // as it was read
    warn_of_oddities(known.recording);  // an estimate has told them
    warnings.assign(known.recording.warnings.begin() + said, known.recording.warnings.end());
    if (!known.recording.pushes.empty())
      warnings.push_back("what the recording's pushes say is not used: run `palpate estimate` first and give its result");
    return known;
  }
  LearnedObject learned =
      load_learned_object(given.given.filename() == "result.json" ? given.given.parent_path() : given.given);
  known.answer = std::move(learned.answer);
  fs::path recording = given.recording;
  const auto path = known.answer->provenance.find("recording path");
  if (recording.empty() && path != known.answer->provenance.end() && fs::exists(path->second, code))
    recording = path->second;
  if (recording.empty()) {
    warnings.push_back("the recording is not where it was: give it with --recording, for its cameras and sensors");
    known.recording = std::move(learned.object);
  } else {
    known.recording = as_fitted(std::move(learned.object), load_recording_unchecked(session, recording, given.mapping));
  }
  return known;
}

/// Every Young's modulus that is known, with its interval.
std::string moduli_words(const estimation::PushRanking& ranking) {
  std::string words;
  const estimation::Knowledge& known = ranking.knowledge;
  for (Index r = 0; r < ranking.so_far.region_log_young_std.size(); ++r) {
    const std::string name = known.regions.empty() ? "" : known.regions[std::size_t(r)] + " ";
    words += fmt::format("{}{}{}, 95 % within {}", r == 0 ? "" : "; ", name, report::quantity(known.young_modulus_of(static_cast<int>(r)), "Pa"),
                         percent_95(ranking.so_far.region_log_young_std(r)));
  }
  return words;
}

nlohmann::json moduli_json(const estimation::Knowledge& known) {
  if (known.regions.empty()) return known.young_modulus_pa;
  nlohmann::json regions;
  for (std::size_t r = 0; r < known.regions.size(); ++r) regions[known.regions[r]] = known.young_modulus_of(static_cast<int>(r));
  return regions;
}

/// What the rows of the table promise, as far as it is printed.
std::string promise_words(const estimation::RatedPush& push, estimation::PushGoal goal) {
  std::string words;
  if (goal != estimation::PushGoal::poisson_ratio) words += percent_95(push.expected.region_log_young_std(push.region));
  if (goal != estimation::PushGoal::young_modulus) words += " " + plain_95(push.expected.poisson_std);
  return words;
}

/// "1 to 3, 6 to 7": rows that promise the same to the last digit that is printed. Empty: there are none.
std::string ties(const estimation::PushRanking& ranking, std::size_t shown) {
  std::string words;
  for (std::size_t first = 0, after = 0; first < shown; first = after) {
    after = first + 1;
    while (after < shown && promise_words(ranking.pushes[after], ranking.goal) == promise_words(ranking.pushes[first], ranking.goal)) ++after;
    if (after > first + 1) words += fmt::format("{}{} to {}", words.empty() ? "" : ", ", first + 1, after);
  }
  return words;
}

double young_std_there(const estimation::RatedPush& push) { return push.expected.region_log_young_std(push.region); }

nlohmann::json vector_json(const Vec3& v) { return {v.x(), v.y(), v.z()}; }

nlohmann::json json_of(const estimation::RatedPush& push, const PushScene& scene) {
  const auto& regions = scene.simulated.region_names;
  nlohmann::json json = {
      {"contact_m", vector_json(push.candidate.contact_m)},
      {"direction", vector_json(push.candidate.direction)},
      {"force_n", push.force_n},
      {"travel_m", push.travel_m},
      {"steps", push.steps},
      {"seen_share", push.seen_share},
      {"region", push.expected.region_log_young_std.size() > 1 ? nlohmann::json(regions[std::size_t(push.region)]) : nlohmann::json()},
      {"view", push.view < 0 ? nlohmann::json() : nlohmann::json(scene.viewpoints[std::size_t(push.view)].name)},
      {"expected", spread_json(push.expected)}};
  return json;
}

/// The fewest pushes that make the intervals as narrow as was asked for, as indices of the ranking.
std::vector<std::size_t> pushes_to_target(const SuggestArguments& given, const estimation::PushRanking& ranking, Session& session,
                                          nlohmann::json& json) {
  constexpr double any = 1e6;
  const estimation::SpreadTarget target{given.young_modulus_within.value_or(any), given.poisson_ratio_within.value_or(any)};
  json["target_reached"] = true;
  if (target.miss(ranking.so_far) <= 1) {
    session.say("the intervals are as narrow as was asked for already");
    return {};
  }
  const auto hardest = estimation::hardest_pushes(ranking);
  std::vector<estimation::RatedPush> pushes;
  for (const std::size_t i : hardest) pushes.push_back(ranking.pushes[i]);
  estimation::TargetPlan plan = estimation::plan_for_target(ranking.knowledge, pushes, target, longest_plan);
  for (std::size_t& push : plan.order) push = hardest[push];
  json["target_reached"] = plan.reached;
  if (plan.reached) return plan.order;
  const std::string why =
      fmt::format("{} pushes come to E within {} and nu within {}, which is not as narrow as was asked for: no push takes away "
                  "what is not known of the force's scale, the mesh, the unseen side and the foot, and what else they share only as far as they tell of it (`palpate estimate --budget`)",
                  longest_plan, percent_95(plan.expected.log_young_std), plain_95(plan.expected.poisson_std));
  session.warn(why);
  json["warnings"].push_back(why);
  return {};
}

int run(const SuggestArguments& given, Session& session) {
  std::vector<std::string> warnings;
  Known known = read(session, given, warnings);
  SuggestOptions options = given.suggest;
  if (const std::string why = known.answer ? why_not_to_build_on(*known.answer) : ""; !why.empty()) {
    options.young_modulus_pa = estimation::after_fit(known.recording, *known.answer).young_modulus_pa;
    known.answer.reset();
    warnings.push_back("the result is not built on, its E is a guess only and pushes are ranked as before the first touch (" + why +
                       "). Estimate again without that push, or push anew");
  }
  options.goal = estimation::push_goal(given.goal);
  options.threads = session.thread_count();
  options.candidates.seed = session.seed;
  if (given.contact.size() == 3) {
    estimation::PushCandidate one;
    one.contact_m = Vec3(given.contact[0], given.contact[1], given.contact[2]);
    if (given.direction.size() == 3) one.direction = Vec3(given.direction[0], given.direction[1], given.direction[2]);
    if (!(one.direction.norm() > 0)) throw Error("must not be zero", "--direction");
    one.direction.normalize();
    options.only = {one};
  }
  const OnProgress progress = session.progress();
  const PushScene scene = prepare_pushes(known.recording, options, progress);
  warnings.insert(warnings.end(), scene.warnings.begin(), scene.warnings.end());
  const estimation::PushRanking ranking = suggest(scene, known.answer ? &*known.answer : nullptr, options, progress);
  if (Session::interrupted()) return exit_numbers;
  for (const std::string& warning : warnings) session.warn(warning);

  const auto& knowledge = ranking.knowledge;
  const bool in_regions = knowledge.regions.size() > 1;
  if (knowledge.touched)
    session.say(fmt::format("known so far     E {}; nu {:.3f}, 95 % within {}", moduli_words(ranking), knowledge.poisson_ratio,
                            plain_95(ranking.so_far.poisson_std)));
  else
    session.say(fmt::format(
        "before the first touch: E is taken as {} (--young-modulus), nu as {:.2f}; forces go with E, intervals hardly do",
        report::quantity(knowledge.young_modulus_pa, "Pa"), knowledge.poisson_ratio));
  if (ranking.too_soft > 0)
    session.say(fmt::format("left out         {} pushes along which the supports do not hold the object", ranking.too_soft));
  if (ranking.pushes.empty()) {
    session.warn(
        fmt::format("none of {} possible pushes is in view: give more viewpoints (--views)", scene.candidates.size()));
    session.result({{"format", "palpate-suggestion/1"}, {"pushes", nlohmann::json::array()}});
    return exit_numbers;
  }
  const auto& best = ranking.pushes.front();
  session.say(fmt::format("suggested        {}; then E{} within {}, nu within {} (95 %)", push_words(best, scene), in_regions ? " there" : "",
                          percent_95(young_std_there(best)), plain_95(best.expected.poisson_std)));
  session.say("  no  contact (m)                 along                  force     travel   in view  E within  nu within");
  const bool several_views = scene.viewpoints.size() > 1;
  for (std::size_t i = 0; i < ranking.pushes.size() && i < std::size_t(given.show); ++i) {
    const auto& push = ranking.pushes[i];
    session.say(
        fmt::format("  {:>2}  {:+.4f} {:+.4f} {:+.4f}   {:+.2f} {:+.2f} {:+.2f}   {:>9} {:>9}   {:4.0f} %   {:>7}   {:>7}{}{}",
                    i + 1, push.candidate.contact_m.x(), push.candidate.contact_m.y(), push.candidate.contact_m.z(),
                    push.candidate.direction.x(), push.candidate.direction.y(), push.candidate.direction.z(),
                    report::quantity(push.force_n, "N"), report::quantity(push.travel_m, "m"), 100 * push.seen_share,
                    percent_95(young_std_there(push)), plain_95(push.expected.poisson_std),
                    in_regions ? "   " + knowledge.regions[std::size_t(push.region)] : "",
                    several_views && push.view >= 0 ? "   " + scene.viewpoints[std::size_t(push.view)].name : ""));
  }
  if (const std::string same = ties(ranking, std::min(ranking.pushes.size(), std::size_t(given.show))); !same.empty())
    session.say("  no " + same + " promise the same within rounding: their order says nothing, take the one that is easiest to make");
  nlohmann::json json = {{"format", "palpate-suggestion/1"},
                         {"goal", given.goal},
                         {"tool", scene.tool},
                         {"touched", knowledge.touched},
                         {"young_modulus_pa", moduli_json(knowledge)},
                         {"poisson_ratio", knowledge.poisson_ratio},
                         {"so_far", spread_json(ranking.so_far)},
                         {"pushes", nlohmann::json::array()},
                         {"sequence", nlohmann::json::array()},
                         {"refused", scene.refused},
                         {"out_of_view", ranking.out_of_view},
                         {"not_held", ranking.too_soft},
                         {"warnings", warnings}};
  for (const auto& push : ranking.pushes) json["pushes"].push_back(json_of(push, scene));
  for (const auto& viewpoint : scene.viewpoints) {
    nlohmann::json one = {{"name", viewpoint.name}};
    if (viewpoint.T_base_camera)
      for (int r = 0; r < 4; ++r)
        one["T_base_camera"].push_back({viewpoint.T_base_camera->matrix()(r, 0), viewpoint.T_base_camera->matrix()(r, 1),
                                        viewpoint.T_base_camera->matrix()(r, 2), viewpoint.T_base_camera->matrix()(r, 3)});
    json["views"].push_back(one);
  }
  std::vector<const estimation::RatedPush*> made;
  const bool with_target = given.young_modulus_within || given.poisson_ratio_within;
  const auto order =
      with_target ? pushes_to_target(given, ranking, session, json) : estimation::plan_sequence(ranking, given.then);
  if (order.size() > 1) session.say(in_regions ? "one after another (E of the least known region):" : "one after another:");
  for (std::size_t n = 0; n < order.size(); ++n) {
    const estimation::RatedPush& push = ranking.pushes[order[n]];
    made.push_back(&push);
    const auto after = estimation::expected_after(knowledge, made);
    json["sequence"].push_back({{"push", order[n]}, {"expected", spread_json(after)}});
    if (order.size() > 1 || with_target)
      session.say(fmt::format("  {} push{}: no {}{}, then E within {}, nu within {}", n + 1, n == 0 ? "  " : "es",
                              order[n] + 1,
                              order[n] < std::size_t(given.show) ? "" : " (" + push_words(push, scene) + ")",
                              percent_95(after.log_young_std), plain_95(after.poisson_std)));
  }
  session.result(json);
  return exit_done;
}

}  // namespace

Run verbs::suggest(CLI::App& app) {
  auto given = std::make_shared<SuggestArguments>();
  auto& limits = given->suggest.candidates.limits;
  app.add_option("given", given->given, "what `palpate estimate` wrote, or a recording (before the first touch)")
      ->required();
  app.add_option("--recording", given->recording,
                 "that the result came from, for its cameras and sensors (default: where it was)");
  app.add_option("--mapping", given->mapping, "what a bag's topics mean (default: mapping.yaml beside it)");
  app.add_option("--for", given->goal, "young-modulus, poisson-ratio or both: whose interval is to shrink")
      ->check(CLI::IsMember({"young-modulus", "poisson-ratio", "both"}))
      ->capture_default_str();
  app.add_option("--contact", given->contact, "rate this place instead, X Y Z in metres, base frame")
      ->expected(3)
      ->type_name("");
  app.add_option("--direction", given->direction, "of that push, into the object (0 0 -1)")->expected(3)->type_name("")
      ->needs("--contact");
  app.add_option("--tool", given->suggest.tool, "tool of the recording (its only round one)");
  app.add_option("--tip-link", given->suggest.tip_link,
                 "of the recording's robot, z along the push: only what its joints reach is compared (found from the pushes)");
  app.add_option("--young-modulus", given->suggest.young_modulus_pa, "guess before the first touch, Pa")
      ->check(positive_number())
      ->capture_default_str();
  app.add_option("--force-limit", limits.force_n, "of the robot, N")->check(positive_number())->capture_default_str();
  app.add_option("--travel-limit", limits.travel_m, "of the robot, m")->check(positive_number())->capture_default_str();
  app.add_option("--pressure-limit", limits.pressure_over_young, "mean pressure under the tool over Young's modulus")
      ->check(positive_number())
      ->capture_default_str();
  app.add_option("--tilt-limit", limits.tilt_rad, "between push and surface normal, rad: beyond it the tool slips")
      ->check(CLI::Range(0.0, 1.39))
      ->capture_default_str();
  app.add_option("--stick", limits.stick_length_m, "length from the tip to the hand, m")
      ->check(number_from_zero())
      ->capture_default_str();
  app.add_option("--hand-radius", limits.hand_radius_m, "of what follows behind the stick, m")
      ->check(number_from_zero())
      ->capture_default_str();
  app.add_option("--contacts", given->suggest.candidates.contacts, "places that are compared")
      ->check(CLI::Range(1, 500))
      ->capture_default_str();
  app.add_option("--tilts", given->suggest.candidates.tilts, "slanted directions at each place, besides the straight one")
      ->check(CLI::Range(0, 12))
      ->capture_default_str();
  app.add_option("--views", given->suggest.viewpoints, "further places of the camera that are compared, around the object")
      ->check(CLI::Range(0, 24));
  app.add_option("--show", given->show, "rows of the table")->check(positive_number())->capture_default_str();
  app.add_option("--young-modulus-within", given->young_modulus_within,
                 "plan the fewest pushes until half of the 95 % interval over E is no wider than this, instead of --then")
      ->check(positive_number());
  app.add_option("--poisson-ratio-within", given->poisson_ratio_within, "the same for half of the interval of nu")
      ->check(positive_number());
  app.add_option("--then", given->then, "pushes that are planned one after another")
      ->check(CLI::Range(0, 20))
      ->capture_default_str();
  return [given](Session& session) { return run(*given, session); };
}

}  // namespace palpate::cli
