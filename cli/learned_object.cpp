// SPDX-License-Identifier: Apache-2.0
#include "cli/learned_object.hpp"

#include <set>
#include <utility>

#include "cli/paths.hpp"
#include "palpate/core/error.hpp"
#include "palpate/estimation/held_body.hpp"
#include "palpate/fem/boundary.hpp"
#include "palpate/fem/materials.hpp"
#include "palpate/fem/regions.hpp"
#include "palpate/io/part_folder.hpp"
#include "palpate/io/recording.hpp"
#include "palpate/io/result.hpp"
#include "palpate/report/report.hpp"

namespace palpate::cli {

namespace fs = std::filesystem;

namespace {

/// Nodes that supports hold altogether (bonded ones), and along one axis alone.
void hold(const Recording& object, io::ExportModel& model) {
  std::set<Index> nodes;
  std::set<std::pair<Index, int>> sliding;
  for (const Support& support : object.supports) {
    if (support.contact != ContactLaw::bonded && !slides_along(support)) continue;
    for (const Index node : fem::support_nodes(*object.rest.volume, support)) {
      if (support.contact == ContactLaw::bonded)
        nodes.insert(node);
      else
        sliding.emplace(node, *slides_along(support));
    }
  }
  model.fixed = {nodes.begin(), nodes.end()};
  for (const auto& one : sliding)
    if (!nodes.contains(one.first)) model.sliding.push_back(one);
}

}  // namespace

void write_learned_object(const Identified& found, const Recording& recording, const fs::path& out) {
  const io::PartFolder model(out / "model");
  io::write_model(found.answer, found.volume, model.path(), found.region);
  { const io::RecordingWriter object(model.path(), found.object); }
  report::write_report(found.answer, &recording, out / "report.html");
  io::write_result(found.answer, out, model.path());  // last: an earlier result stays until all of this one is there
}

LearnedObject load_learned_object(const fs::path& given) {
  must_be_result(given);
  std::error_code code;
  const fs::path clean = given.lexically_normal();
  fs::path out = clean.filename().empty() ? clean.parent_path() : clean;
  if (!fs::exists(out / "result.json", code) && fs::exists(out.parent_path() / "result.json", code))
    out = out.parent_path();  // OUT/model
  LearnedObject learned;
  learned.answer = io::read_result(out);
  try {
    fem::material_law(learned.answer.material);
  } catch (const Error& unknown) {
    throw Error(unknown.message(), (out / "result.json").string() + ": material " + learned.answer.material);
  }
  if (!fs::exists(out / "model" / "recording.yaml", code))
    throw Error("holds no model/recording.yaml; run `palpate estimate` again", out.string());
  io::check_model(out);
  learned.object = io::read_recording_unchecked(out / "model");
  if (!learned.object.rest.volume) throw Error("holds no volume mesh", (out / "model").string());
  return learned;
}

prediction::Elasticity elasticity_of(const LearnedObject& learned) {
  prediction::Elasticity elasticity = prediction::elasticity_of(learned.answer);
  if (elasticity.regions.empty()) return elasticity;
  std::vector<std::string> named;
  for (const Region& region : learned.object.regions) named.push_back(region.name);
  if (named != elasticity.regions)
    throw Error("tells other regions apart than the result does; run `palpate estimate` again", "model/recording.yaml: regions");
  elasticity.region = fem::regions_of(*learned.object.rest.volume, learned.object.regions, &*learned.object.rest.volume);
  return elasticity;
}

std::optional<int> slides_along(const Support& support) {
  if (support.contact != ContactLaw::frictionless || estimation::lifts_off(support)) return std::nullopt;
  constexpr double rounding = 1e-9;
  int axis = 0;
  const double along = support.plane.normal.normalized().cwiseAbs().maxCoeff(&axis);
  return along > 1 - rounding ? std::optional<int>(axis) : std::nullopt;
}

io::ExportModel export_model(const LearnedObject& learned, double density_kg_m3, const std::optional<Vec3>& gravity_m_s2) {
  if (gravity_m_s2 && !(gravity_m_s2->norm() <= 100))
    throw Error("must be three numbers in m/s2, 0 0 -9.81 on earth, and at most 100 together", "gravity");
  io::ExportModel model;
  const prediction::Elasticity elasticity = elasticity_of(learned);
  model.mesh = *learned.object.rest.volume;
  model.law = elasticity.material;
  model.law_parameters = elasticity.extra;
  if (elasticity.extra.size() == 0) {  // those that were not fitted stand at where they begin
    const auto parameters = fem::material_law(elasticity.material).extra_parameters();
    model.law_parameters.resize(static_cast<Index>(parameters.size()));
    for (std::size_t i = 0; i < parameters.size(); ++i) model.law_parameters(static_cast<Index>(i)) = parameters[i].initial;
  }
  model.young_modulus_pa = elasticity.young_modulus_pa;
  model.poisson_ratio = elasticity.poisson_ratio;
  for (std::size_t r = 0; r < elasticity.regions.size(); ++r) {
    const Index at = static_cast<Index>(r);
    model.regions.push_back({elasticity.regions[r], elasticity.young_modulus_of(at), elasticity.poisson_ratio_of(at)});
  }
  model.region = elasticity.region;
  model.density_kg_m3 = density_kg_m3 > 0 ? density_kg_m3 : learned.object.density_kg_m3;
  // A shape that was measured with its weight on has sagged already: under gravity it would sag once more.
  const bool sags = learned.object.rest.state == RestState::stress_free;
  if (gravity_m_s2)
    model.gravity_m_s2 = *gravity_m_s2;
  else if (sags)
    model.gravity_m_s2 = learned.object.environment.gravity_m_s2;
  hold(learned.object, model);
  return model;
}

}  // namespace palpate::cli
