// SPDX-License-Identifier: Apache-2.0
// `palpate predict OUT --contact X Y Z --force F`: what the learned object does under a new push, with bands.
#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>

#include "cli/number_checks.hpp"
#include "cli/paths.hpp"
#include "cli/predicted_push.hpp"
#include "cli/verbs.hpp"
#include "palpate/io/file.hpp"
#include "palpate/io/mesh_file.hpp"
#include "palpate/report/words.hpp"

namespace palpate::cli {
namespace {

struct PredictArguments {
  std::filesystem::path result, out;
  std::vector<double> contact, direction;
  std::optional<double> force_n, travel_m;
  double radius_m = 0;
  std::string tool;
};

nlohmann::json json_of(const prediction::Band& band) {
  return {{"value", band.value}, {"std", band.std}, {"lower_95", band.lower_95}, {"upper_95", band.upper_95}};
}

nlohmann::json regions_json(const prediction::Elasticity& elasticity) {
  nlohmann::json list = nlohmann::json::array();
  for (std::size_t r = 0; r < elasticity.regions.size(); ++r) {
    const Index at = static_cast<Index>(r);
    list.push_back({{"region", elasticity.regions[r]},
                    {"young_modulus_pa", elasticity.young_modulus_of(at)},
                    {"poisson_ratio", elasticity.poisson_ratio_of(at)}});
  }
  return list;
}

MatrixX by_rows(const VectorX& field) { return Eigen::Map<const Points>(field.data(), field.size() / 3, 3); }

int run(const PredictArguments& given, Session& session) {
  end_at_first_interrupt();
  const LearnedObject learned = load_learned_object(given.result);
  AskedPush asked;
  if (given.contact.size() == 3) asked.contact_m = Vec3(given.contact[0], given.contact[1], given.contact[2]);
  if (given.direction.size() == 3) asked.direction = Vec3(given.direction[0], given.direction[1], given.direction[2]);
  asked.force_n = given.force_n;
  asked.travel_m = given.travel_m;
  asked.radius_m = given.radius_m;
  asked.tool = given.tool;
  if (!given.out.empty()) must_take_files(given.out);
  session.progress()("press", 0);
  const PredictedPush push = predict_push(learned, asked, session.thread_count());
  session.progress()("press", 1);
  const auto& [tool, load, elasticity, found, warnings] = push;
  if (!found.converged) {
    session.warn("no equilibrium was found: " + found.reason);
    session.result({{"format", "palpate-prediction/1"}, {"converged", false}, {"reason", found.reason}});
    return exit_numbers;
  }
  for (const std::string& warning : warnings) session.warn(warning);
  constexpr double no_band = 1e-6;  // of the value: what rounding leaves of one
  const auto tell = [&](const char* what, const prediction::Band& band, const char* unit, bool is_given = false) {
    const bool banded = band.std > no_band * std::abs(band.value);
    session.say(fmt::format("{:<20} {}{}", what, report::quantity(band.value, unit),
                            is_given ? "   (given)" : banded ? "   95 % band " + report::interval(band.lower_95, band.upper_95, unit) : "   (whatever E is)"));
  };
  tell("force", found.force_n, "N", given.force_n.has_value());
  tell("travel", found.travel_m, "m", given.travel_m.has_value());
  tell("largest motion", found.largest_displacement_m, "m");
  tell("largest stress", found.largest_von_mises_pa, "Pa");
  session.say(fmt::format("stiffness            {:.4g} N/m (of the force to the travel there)", found.stiffness_n_m));
  nlohmann::json json = {{"format", "palpate-prediction/1"},
                         {"converged", true},
                         {"material", elasticity.material},
                         {"young_modulus_pa", elasticity.young_modulus_pa},
                         {"poisson_ratio", elasticity.poisson_ratio},
                         {"regions", regions_json(elasticity)},
                         {"tool", tool.name},
                         {"contact_m", {load.contact_m.x(), load.contact_m.y(), load.contact_m.z()}},
                         {"direction", {load.direction.x(), load.direction.y(), load.direction.z()}},
                         {"force_n", json_of(found.force_n)},
                         {"travel_m", json_of(found.travel_m)},
                         {"stiffness_n_m", found.stiffness_n_m},
                         {"largest_displacement_m", json_of(found.largest_displacement_m)},
                         {"largest_von_mises_pa", json_of(found.largest_von_mises_pa)},
                         {"inverted_elements", found.inverted_elements}};
  if (!given.out.empty()) {
    std::error_code code;
    std::filesystem::create_directories(given.out, code);
    io::MeshData data;
    data.points_m = learned.object.rest.volume->nodes_m;
    data.tetrahedra = learned.object.rest.volume->tetrahedra;
    data.point_fields["displacement_m"] = by_rows(found.displacement_m);
    data.point_fields["displacement_std_m"] = by_rows(found.displacement_std_m);
    data.point_fields["von_mises_pa"] = found.von_mises_pa;
    data.point_fields["von_mises_std_pa"] = found.von_mises_std_pa;
    io::write_mesh(given.out / "prediction.vtu", data);
    io::write_file(given.out / "prediction.json", json.dump(1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n");
    session.say(fmt::format("written              {}", (given.out / "prediction.vtu").string()));
  }
  session.result(json);
  return exit_done;
}

}  // namespace

Run verbs::predict(CLI::App& app) {
  auto given = std::make_shared<PredictArguments>();
  app.add_option("result", given->result, "folder that `palpate estimate` wrote")->required();
  app.add_option("--contact", given->contact, "where the push acts, X Y Z in metres, base frame (not of a platen)")
      ->check(finite_number())
      ->expected(3)
      ->type_name("");
  app.add_option("--direction", given->direction, "of the push, into the object (0 0 -1; a platen goes along its normal)")->check(finite_number())->expected(3)->type_name("");
  app.add_option("--force", given->force_n, "along the direction, N")->check(positive_number());
  app.add_option("--travel", given->travel_m, "of the pressed patch or the rigid tool along the direction, m, instead of a force")->check(positive_number());
  app.add_option("--tool", given->tool, "tool of the recording (its only one); one whose motion was imposed moves as a rigid body");
  app.add_option("--radius", given->radius_m, "radius of a patch that is pressed evenly, m; with --tool: that tool's own (that of the tool)")
      ->check(positive_number());
  app.add_option("-o,--out", given->out,
                 "folder for prediction.json and prediction.vtu (displacement and stress with bands)");
  return [given](Session& session) { return run(*given, session); };
}

}  // namespace palpate::cli
