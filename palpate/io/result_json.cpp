// SPDX-License-Identifier: Apache-2.0
// result.json, written and read: each noun has its pair of functions side by side, so that no field is forgotten in one.
#include <array>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "palpate/core/error.hpp"
#include "palpate/io/result.hpp"
#include "palpate/io/result_parts.hpp"

namespace palpate::io {
namespace {

using nlohmann::json;

constexpr const char* result_format = "palpate-result/1";
constexpr std::array<std::pair<const char*, Termination>, 5> termination_names = {
    {{"converged", Termination::converged},
     {"max_iterations", Termination::max_iterations},
     {"cancelled", Termination::cancelled},
     {"no_progress", Termination::no_progress},
     {"failed", Termination::failed}}};

/// JSON knows no NaN and no infinity.
json number(double value) { return std::isfinite(value) ? json(value) : json(nullptr); }
double number(const json& value) { return value.is_null() ? std::numeric_limits<double>::quiet_NaN() : value.get<double>(); }
double number_at(const json& object, const char* key) { return number(object.at(key)); }

template <typename Vector>
json list(const Vector& values) {
  json result = json::array();
  for (Eigen::Index i = 0; i < values.size(); ++i) result.push_back(number(values[i]));
  return result;
}
VectorX vector_from(const json& values) {
  VectorX result(static_cast<Eigen::Index>(values.size()));
  for (std::size_t i = 0; i < values.size(); ++i) result[static_cast<Eigen::Index>(i)] = number(values[i]);
  return result;
}
Vec3 vec3_from(const json& values) {
  const VectorX result = vector_from(values);
  if (result.size() != 3) throw Error("three numbers are expected");
  return result;
}

json rows(const MatrixX& matrix) {
  json result = json::array();
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) result.push_back(list(VectorX(matrix.row(i))));
  return result;
}
MatrixX matrix_from(const json& values) {
  if (values.empty()) return {};
  MatrixX result(static_cast<Eigen::Index>(values.size()), static_cast<Eigen::Index>(values[0].size()));
  for (std::size_t i = 0; i < values.size(); ++i) {
    const VectorX row = vector_from(values[i]);
    if (row.size() != result.cols()) throw Error("the rows of a matrix differ in length");
    result.row(static_cast<Eigen::Index>(i)) = row;
  }
  return result;
}

json from(const Parameter& one) {
  return {{"name", one.name},
          {"region", one.region},
          {"unit", one.unit},
          {"value", number(one.value)},
          {"std", number(one.std)},
          {"lower_95", number(one.lower_95)},
          {"upper_95", number(one.upper_95)},
          {"determined", one.determined}};
}
Parameter parameter_from(const json& object) {
  return {object.at("name"),
          object.at("region"),
          object.at("unit"),
          number_at(object, "value"),
          number_at(object, "std"),
          number_at(object, "lower_95"),
          number_at(object, "upper_95"),
          object.at("determined")};
}

json from(const Nuisance& one) {
  return {{"name", one.name},
          {"unit", one.unit},
          {"value", number(one.value)},
          {"std", number(one.std)},
          {"lower_95", number(one.lower_95)},
          {"upper_95", number(one.upper_95)},
          {"prior_std", number(one.prior_std)},
          {"pull", number(one.pull)}};
}
Nuisance nuisance_from(const json& object) {
  return {object.at("name"),
          object.at("unit"),
          number_at(object, "value"),
          number_at(object, "std"),
          number_at(object, "lower_95"),
          number_at(object, "upper_95"),
          number_at(object, "prior_std"),
          number_at(object, "pull")};
}

json from(const Verdict& one) { return {{"code", one.code}, {"message", one.message}}; }
Verdict verdict_from(const json& object) { return {object.at("code"), object.at("message")}; }

json from(const FitSummary& fit) {
  return {{"rms_m", number(fit.rms_m)},
          {"chi2_per_dof", number(fit.chi2_per_dof)},
          {"points_used", fit.points_used},
          {"pushes", fit.pushes},
          {"steps", fit.steps},
          {"iterations", fit.iterations},
          {"solves", fit.solves},
          {"load_cases", fit.load_cases}};
}
FitSummary fit_from(const json& object) {
  FitSummary fit;
  fit.rms_m = number_at(object, "rms_m");
  fit.chi2_per_dof = number_at(object, "chi2_per_dof");
  fit.points_used = object.at("points_used");
  fit.pushes = object.at("pushes");
  fit.steps = object.at("steps");
  fit.iterations = object.at("iterations");
  fit.solves = object.at("solves");
  fit.load_cases = object.value("load_cases", fit.solves);  // earlier versions did not say
  return fit;
}

json from(const HeldOut& one) {
  return {{"available", one.available},
          {"what", one.what},
          {"force_error", number(one.force_error)},
          {"surface_rms_m", number(one.surface_rms_m)},
          {"baseline_no_deformation_rms_m", number(one.baseline_no_deformation_rms_m)},
          {"baseline_last_step_rms_m", number(one.baseline_last_step_rms_m)},
          {"fitted_rms_m", number(one.fitted_rms_m)},
          {"deformation_explained", number(one.deformation_explained)}};
}
HeldOut held_out_from(const json& object) {
  const auto later = [&](const char* key) { return object.contains(key) ? number_at(object, key) : HeldOut::unknown; };
  return {object.at("available"),
          object.at("what"),
          number_at(object, "force_error"),
          number_at(object, "surface_rms_m"),
          number_at(object, "baseline_no_deformation_rms_m"),
          number_at(object, "baseline_last_step_rms_m"),
          later("fitted_rms_m"),  // earlier versions did not say
          later("deformation_explained")};
}

json from(const YoungAtLoad& one) {
  json object = from(one.young);
  object["force_n"] = number(one.force_n);
  object["travel_m"] = number(one.travel_m);
  object["strain"] = number(one.strain);
  object["indentation"] = number(one.indentation);
  return object;
}
YoungAtLoad young_at_load_from(const json& object) {
  return {parameter_from(object), number_at(object, "force_n"), number_at(object, "travel_m"), number_at(object, "strain"),
          number_at(object, "indentation")};
}

json from(const LawFit& one) {
  return {{"law", one.law},
          {"usable", one.usable},
          {"message", one.message},
          {"young_modulus_pa", number(one.young_modulus_pa)},
          {"poisson_ratio", number(one.poisson_ratio)},
          {"chi2", number(one.chi2)},
          {"chi2_per_dof", number(one.chi2_per_dof)},
          {"held_out", from(one.held_out)},
          {"held_out_chi2", number(one.held_out_chi2)}};
}
LawFit law_fit_from(const json& object) {
  LawFit fit;
  fit.law = object.at("law");
  fit.usable = object.at("usable");
  fit.message = object.at("message");
  fit.young_modulus_pa = number_at(object, "young_modulus_pa");
  fit.poisson_ratio = number_at(object, "poisson_ratio");
  fit.chi2 = number_at(object, "chi2");
  fit.chi2_per_dof = number_at(object, "chi2_per_dof");
  fit.held_out = held_out_from(object.at("held_out"));
  fit.held_out_chi2 = number_at(object, "held_out_chi2");
  return fit;
}

json from(const BudgetEntry& one) {
  json object = {{"input", one.input},
                 {"young_modulus_percent", number(one.young_modulus_percent)},
                 {"poisson_shift", number(one.poisson_shift)}};
  for (const RegionShare& share : one.regions)
    object["regions"].push_back({{"region", share.region}, {"young_modulus_percent", number(share.young_modulus_percent)}});
  if (!one.off_by.empty()) object["off_by"] = one.off_by;
  if (!one.field.empty()) object["field"] = one.field;
  return object;
}
BudgetEntry budget_from(const json& object) {
  BudgetEntry entry{object.at("input"), number_at(object, "young_modulus_percent"), number_at(object, "poisson_shift")};
  for (const json& share : object.value("regions", json::array()))
    entry.regions.push_back({share.at("region"), number_at(share, "young_modulus_percent")});
  entry.off_by = object.value("off_by", "");
  entry.field = object.value("field", "");
  return entry;
}

json from(const StepFit& one) {
  return {{"push", one.push},
          {"step", one.step},
          {"tool", one.tool},
          {"used", one.used},
          {"force_n", list(one.force_n)},
          {"contact_m", list(one.contact_m)},
          {"tool_radius_m", number(one.tool_radius_m)},
          {"travel_m", number(one.travel_m)},
          {"travel_predicted_m", number(one.travel_predicted_m)},
          {"travel_predicted_std_m", number(one.travel_predicted_std_m)},
          {"force_measured_n", number(one.force_measured_n)},
          {"force_predicted_n", number(one.force_predicted_n)},
          {"force_predicted_std_n", number(one.force_predicted_std_n)}};
}
StepFit step_from(const json& object) {
  StepFit step;
  step.push = object.at("push");
  step.step = object.at("step");
  step.tool = object.value("tool", "");
  step.used = object.at("used");
  step.force_n = vec3_from(object.at("force_n"));
  step.contact_m = vec3_from(object.at("contact_m"));
  step.tool_radius_m = number_at(object, "tool_radius_m");
  step.travel_m = number_at(object, "travel_m");
  step.travel_predicted_m = number_at(object, "travel_predicted_m");
  if (object.contains("travel_predicted_std_m")) step.travel_predicted_std_m = number_at(object, "travel_predicted_std_m");
  step.force_measured_n = number_at(object, "force_measured_n");
  step.force_predicted_n = number_at(object, "force_predicted_n");
  step.force_predicted_std_n = number_at(object, "force_predicted_std_n");
  return step;
}

json from(const FitIteration& one) {
  return {{"young_modulus_pa", number(one.young_modulus_pa)},
          {"poisson_ratio", number(one.poisson_ratio)},
          {"cost", number(one.cost)},
          {"round", one.round}};
}
FitIteration iteration_from(const json& object) {
  return {number_at(object, "young_modulus_pa"), number_at(object, "poisson_ratio"), number_at(object, "cost"),
          object.value("round", 0)};
}

template <typename T>
json array_from(const std::vector<T>& items) {
  json result = json::array();
  for (const T& item : items) result.push_back(from(item));
  return result;
}
template <typename Read>
auto all_of(const json& array, Read read) {
  std::vector<decltype(read(array))> result;
  for (const json& item : array) result.push_back(read(item));
  return result;
}

}  // namespace

json result_json(const Identification& answer) {
  json object;
  object["format"] = result_format;
  object["method"] = answer.method;
  object["material"] = answer.material;
  object["parameters"] = array_from(answer.parameters);
  object["nuisances"] = array_from(answer.nuisances);
  object["covariance"] = rows(answer.covariance);
  object["verdicts"] = array_from(answer.verdicts);
  object["fit"] = from(answer.fit);
  object["prediction"] = from(answer.prediction);
  object["budget"] = array_from(answer.budget);
  object["budget_if"] = array_from(answer.budget_if);
  object["per_push"] = array_from(answer.per_push);
  object["per_site"] = array_from(answer.per_site);
  object["per_load"] = array_from(answer.per_load);
  object["laws"] = array_from(answer.laws);
  object["termination"] = "failed";
  for (const auto& [name, value] : termination_names) {
    if (value == answer.termination) object["termination"] = name;
  }
  object["message"] = answer.message;
  object["provenance"] = answer.provenance;
  object["timing_s"] = json::object();
  for (const auto& [stage, seconds] : answer.timing_s) object["timing_s"][stage] = number(seconds);
  object["steps"] = array_from(answer.steps);
  object["posterior"] = {{"young_modulus_pa", list(answer.posterior.young_modulus_pa)},
                         {"poisson_ratio", list(answer.posterior.poisson_ratio)},
                         {"density", rows(answer.posterior.density)}};
  object["trace"] = array_from(answer.trace);
  return object;
}

Identification parse_result(const std::string& bytes, const std::string& name) {
  std::string at;  // the last part that was asked for: what is wrong is in it
  try {
    const json object = json::parse(bytes);
    const auto part = [&](const char* key) -> const json& {
      at = key;
      return object.at(key);
    };
    if (part("format") != result_format) {
      throw Error("its format is not " + std::string(result_format), name + ": format");
    }
    Identification answer;
    answer.method = part("method");
    answer.material = part("material");
    answer.parameters = all_of(part("parameters"), parameter_from);
    answer.nuisances = all_of(part("nuisances"), nuisance_from);
    answer.covariance = matrix_from(part("covariance"));
    if (answer.covariance.rows() != answer.covariance.cols())
      throw Error("must have as many columns as rows; write the result again with `palpate estimate`", name + ": covariance");
    answer.verdicts = all_of(part("verdicts"), verdict_from);
    answer.fit = fit_from(part("fit"));
    answer.prediction = held_out_from(part("prediction"));
    answer.budget = all_of(part("budget"), budget_from);
    if (object.contains("budget_if")) answer.budget_if = all_of(part("budget_if"), budget_from);  // earlier versions did not say
    answer.per_push = all_of(part("per_push"), parameter_from);
    if (object.contains("per_site")) answer.per_site = all_of(part("per_site"), parameter_from);
    if (object.contains("per_load")) answer.per_load = all_of(part("per_load"), young_at_load_from);
    if (object.contains("laws")) answer.laws = all_of(part("laws"), law_fit_from);
    for (const auto& [word, value] : termination_names) {
      if (part("termination") == word) answer.termination = value;
    }
    answer.message = part("message");
    answer.provenance = part("provenance").get<std::map<std::string, std::string>>();
    for (const auto& [stage, seconds] : part("timing_s").items()) answer.timing_s[stage] = number(seconds);
    answer.steps = all_of(part("steps"), step_from);
    answer.posterior.young_modulus_pa = vector_from(part("posterior").at("young_modulus_pa"));
    answer.posterior.poisson_ratio = vector_from(part("posterior").at("poisson_ratio"));
    answer.posterior.density = matrix_from(part("posterior").at("density"));
    answer.trace = all_of(part("trace"), iteration_from);
    return answer;
  } catch (const json::exception& problem) {
    const std::string what = problem.what();  // "[json.exception....] and then the words"
    const std::size_t words = what.find("] ");
    throw Error("is not a whole result of this version (" + (words == std::string::npos ? what : what.substr(words + 2)) +
                    "); write it again with `palpate estimate`",
                at.empty() ? name : name + ": " + at);
  } catch (const Error& error) {
    throw Error(error.message(), error.where().empty() ? name : error.where());
  }
}

}  // namespace palpate::io
