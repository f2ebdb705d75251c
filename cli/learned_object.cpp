// SPDX-License-Identifier: Apache-2.0
#include "cli/learned_object.hpp"

#include <set>

#include "cli/paths.hpp"
#include "palpate/core/error.hpp"
#include "palpate/fem/boundary.hpp"
#include "palpate/fem/materials.hpp"
#include "palpate/fem/regions.hpp"
#include "palpate/io/recording.hpp"
#include "palpate/io/result.hpp"

namespace palpate::cli {

namespace fs = std::filesystem;

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

std::vector<Index> held_nodes(const Recording& object) {
  std::set<Index> nodes;
  for (const Support& support : object.supports) {
    if (support.contact != ContactLaw::bonded) continue;
    for (const Index node : fem::support_nodes(*object.rest.volume, support)) nodes.insert(node);
  }
  return {nodes.begin(), nodes.end()};
}

}  // namespace palpate::cli
