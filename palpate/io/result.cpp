// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/result.hpp"

#include <cmath>
#include <nlohmann/json.hpp>

#include "palpate/core/error.hpp"
#include "palpate/io/file.hpp"
#include "palpate/io/mesh_file.hpp"

namespace palpate::io {
namespace {

using nlohmann::json;

json number(double value) { return std::isfinite(value) ? json(value) : json(nullptr); }

json json_of(const Parameter& p) {
  return {{"name", p.name},
          {"region", p.region},
          {"unit", p.unit},
          {"value", number(p.value)},
          {"std", number(p.std)},
          {"lower_95", number(p.lower_95)},
          {"upper_95", number(p.upper_95)},
          {"determined", p.determined}};
}

json json_of(const Nuisance& n) {
  return {{"name", n.name},
          {"unit", n.unit},
          {"value", number(n.value)},
          {"std", number(n.std)},
          {"lower_95", number(n.lower_95)},
          {"upper_95", number(n.upper_95)},
          {"prior_std", number(n.prior_std)},
          {"pull", number(n.pull)}};
}

json json_of(const BudgetEntry& entry) {
  return {{"input", entry.input},
          {"young_modulus_percent", number(entry.young_modulus_percent)},
          {"poisson_shift", number(entry.poisson_shift)}};
}

json json_of(const Verdict& verdict) { return {{"code", verdict.code}, {"message", verdict.message}}; }

template <class Range>
json list_of(const Range& range) {
  json list = json::array();
  for (const auto& each : range) list.push_back(json_of(each));
  return list;
}

std::string word(Termination termination) {
  switch (termination) {
    case Termination::converged: return "converged";
    case Termination::max_iterations: return "max_iterations";
    case Termination::cancelled: return "cancelled";
    case Termination::no_progress: return "no_progress";
    case Termination::failed: return "failed";
  }
  return "failed";
}

void make_folder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw Error("the folder cannot be made (" + error.message() + "); give another one", folder.string());
}

}  // namespace

json result_json(const Identification& answer) {
  json covariance = json::array();
  for (Index r = 0; r < answer.covariance.rows(); ++r) {
    json row = json::array();
    for (Index c = 0; c < answer.covariance.cols(); ++c) row.push_back(number(answer.covariance(r, c)));
    covariance.push_back(row);
  }
  const HeldOut& held = answer.prediction;
  json prediction = {{"available", held.available}};
  if (held.available) {
    prediction.update({{"held_out", held.what},
                       {"force_error", number(held.force_error)},
                       {"surface_rms_m", number(held.surface_rms_m)},
                       {"baseline_no_deformation_rms_m", number(held.baseline_no_deformation_rms_m)},
                       {"baseline_last_step_rms_m", number(held.baseline_last_step_rms_m)}});
  }
  return {{"format", "palpate-result/1"},
          {"method", answer.method},
          {"material", answer.material},
          {"parameters", list_of(answer.parameters)},
          {"covariance", {{"of", {"log young_modulus", "poisson_ratio"}}, {"matrix", covariance}}},
          {"nuisances", list_of(answer.nuisances)},
          {"verdicts", list_of(answer.verdicts)},
          {"fit",
           {{"rms_m", number(answer.fit.rms_m)},
            {"chi2_per_dof", number(answer.fit.chi2_per_dof)},
            {"points_used", answer.fit.points_used},
            {"pushes", answer.fit.pushes},
            {"steps", answer.fit.steps},
            {"iterations", answer.fit.iterations},
            {"solves", answer.fit.solves}}},
          {"prediction", prediction},
          {"budget", list_of(answer.budget)},
          {"per_push", list_of(answer.per_push)},
          {"termination", word(answer.termination)},
          {"message", answer.message},
          {"provenance", answer.provenance},
          {"timing_s", answer.timing_s}};
}

void write_result(const Identification& answer, const std::filesystem::path& folder) {
  make_folder(folder);
  write_file(folder / "result.json", result_json(answer).dump(2) + "\n");
}

void write_model(const Identification& answer, const TetMesh& volume, const std::filesystem::path& folder) {
  make_folder(folder);
  write_mesh(folder / "mesh.vtu", volume);
  write_mesh(folder / "mesh.msh", volume);
  json parameters = json::object();
  for (const auto& parameter : answer.parameters) parameters[parameter.name] = number(parameter.value);
  const json material = {{"format", "palpate-material/1"},
                         {"law", answer.material},
                         {"small_strain", parameters},
                         {"units", {{"young_modulus", "Pa"}, {"poisson_ratio", "1"}}}};
  write_file(folder / "material.json", material.dump(2) + "\n");
}

}  // namespace palpate::io
