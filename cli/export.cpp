// SPDX-License-Identifier: Apache-2.0
// `palpate export OUT --to SIMULATOR`: the learned object for other simulators, and what CalculiX says about it.
#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <sstream>
#include <vector>

#include "cli/exported_object.hpp"
#include "cli/number_checks.hpp"
#include "cli/paths.hpp"
#include "cli/verbs.hpp"
#include "palpate/core/error.hpp"
#include "palpate/io/exporters.hpp"
#include "palpate/io/file.hpp"

namespace palpate::cli {
namespace {

namespace fs = std::filesystem;

struct ExportArguments {
  fs::path result, out;
  std::string to;
  double density_kg_m3 = 0;
  std::vector<double> gravity;
  bool verify = false;
  std::string elements = "split";
};

/// A load that bends and shears whatever is there: a thousandth of E times the object's size squared, on every free node.
void add_test_load(io::ExportModel& model) {
  const Vec3 size = model.mesh.nodes_m.colwise().maxCoeff() - model.mesh.nodes_m.colwise().minCoeff();
  const Vec3 total = 1e-3 * model.young_modulus_pa * size.squaredNorm() * Vec3(0.6, 0.3, -0.74);
  const std::vector<Index>& fixed = model.fixed;
  std::vector<Index> loaded;
  for (Index i = 0; i < model.mesh.nodes_m.rows(); ++i)
    if (!std::binary_search(fixed.begin(), fixed.end(), i)) loaded.push_back(i);
  for (const Index node : loaded) model.forces_n.emplace_back(node, total / double(loaded.size()));
  model.gravity_m_s2.setZero();
}

/// One word for the shell.
std::string quoted(const std::string& text) {
  std::string word = "'";
  for (const char c : text) word += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return word + "'";
}

/// CalculiX solves its own file under a test load, we the same with the law that is written there; largest difference over the
/// largest displacement.
double difference_to_calculix(io::ExportModel model, const std::string& law, const fs::path& folder, int threads) {
  if (std::system("command -v ccx > /dev/null 2>&1") != 0)
    throw Error("ccx is not installed (Debian: calculix-ccx)", "--verify");
  if (rigid_motions_left(model) > 0) throw Error("nothing holds the object, so that a static solver has no answer", "--verify");
  add_test_load(model);
  fs::create_directories(folder);
  for (const auto& [name, bytes] : io::export_files(io::exporter_named("calculix"), model))
    io::write_file(folder / name, bytes);
  if (std::system(("cd " + quoted(folder.string()) + " && ccx object > ccx.log 2>&1").c_str()) != 0)
    throw Error("ccx failed; see ccx.log", folder.string());
  fem::StaticsOptions options;
  options.threads = threads;
  const OwnAnswer own = solved_here(model, law, export_boundary(model), options);
  if (!own.converged) throw Error("finds no equilibrium under the test load: " + own.reason, "--verify");
  const VectorX& ours = own.displacement_m;
  std::istringstream lines(io::read_file(folder / "object.dat"));
  VectorX theirs = VectorX::Constant(ours.size(), std::nan(""));  // of several increments the last stays
  for (std::string line; std::getline(lines, line);) {
    long node = 0;
    double u[3];
    if (std::sscanf(line.c_str(), "%ld %lf %lf %lf", &node, &u[0], &u[1], &u[2]) != 4) continue;
    if (node < 1 || 3 * node > ours.size()) throw Error("names a node that is not there", (folder / "object.dat").string());
    for (int d = 0; d < 3; ++d) theirs(3 * (node - 1) + d) = u[d];
  }
  if (!theirs.allFinite()) throw Error("does not hold every node", (folder / "object.dat").string());
  return (theirs - ours).cwiseAbs().maxCoeff() / ours.cwiseAbs().maxCoeff();
}

const io::Exporter& exporter_of(const std::string& simulator) {
  try {
    return io::exporter_named(simulator);
  } catch (const Error& error) {
    throw Error("'" + simulator + "' " + error.message(), "--to");
  }
}

int run(const ExportArguments& given, Session& session) {
  const io::Exporter& exporter = exporter_of(given.to);
  must_take_files(given.out);
  const LearnedObject learned = load_learned_object(given.result);
  ExportChoice choice;
  choice.density_kg_m3 = given.density_kg_m3;
  if (given.gravity.size() == 3) choice.gravity_m_s2 = Vec3(given.gravity[0], given.gravity[1], given.gravity[2]);
  choice.elements = given.elements == "corners" ? io::LinearElements::corners : io::LinearElements::split;
  const ExportedObject exported = exported_object(learned, exporter, choice, session.thread_count());
  const io::ExportModel& model = exported.model;
  fs::create_directories(given.out);
  nlohmann::json names = nlohmann::json::array();
  for (const auto& [name, bytes] : exported.files) {
    io::write_file(given.out / name, bytes);
    names.push_back(name);
  }
  session.say(fmt::format("{}: {}", exporter.name, exporter.about));
  for (const std::string& note : exported.notes) session.say(note);
  for (const std::string& warning : exported.warnings) session.warn(warning);
  const bool linear = model.mesh.tetrahedra.cols() == 10 && !exporter.quadratic;
  session.say(fmt::format("open {}", (given.out / exporter.main_file).string()));
  nlohmann::json json = {{"to", exporter.name},
                         {"files", names},
                         {"main_file", exporter.main_file},
                         {"material", model.law},
                         {"law", nullptr},
                         {"young_modulus_pa", model.young_modulus_pa},
                         {"poisson_ratio", model.poisson_ratio},
                         {"density_kg_m3", model.density_kg_m3},
                         {"regions", model.regions.size()},
                         {"fixed_nodes", exported.holds ? exported.written.fixed.size() : 0},
                         {"sliding_nodes", exporter.slides ? exported.written.sliding.size() : 0},
                         {"carries_gravity", exporter.carries_gravity},
                         {"elements", linear ? given.elements : "as_fitted"},
                         {"stiffer_by", nullptr}};
  if (exported.stiffer) json["stiffer_by"] = *exported.stiffer;
  if (!exported.law.empty()) json["law"] = exported.law;
  if (exported.laws) {
    const LawComparison& at = *exported.laws;
    json["hardest_push"] = {{"push", at.push}, {"force_n", at.force_n}, {"learned_travel_m", at.learned_m}, {"travel_m", nullptr}, {"inverted_elements", at.inverted_elements}};
    if (at.other_m) json["hardest_push"]["travel_m"] = *at.other_m;
  }
  int code = exit_done;
  if (given.verify) {
    if (given.to != "calculix") throw Error("only CalculiX is asked so far (--to calculix)", "--verify");
    constexpr double agrees = 1e-5;
    const double difference = difference_to_calculix(model, exported.law, given.out / "verify", session.thread_count());
    session.say(fmt::format("ccx moves every node as we do, to {:.1e} of the largest displacement", difference));
    json["difference_to_calculix"] = difference;
    if (!(difference < agrees)) {
      session.warn(fmt::format("that is more than {:.0e}: do not trust the file", agrees));
      code = exit_numbers;
    }
  }
  session.result(json);
  return code;
}

}  // namespace

Run verbs::export_(CLI::App& app) {
  auto given = std::make_shared<ExportArguments>();
  std::string list;
  for (const io::Exporter& one : io::exporters()) list += "\n  " + one.name + ": " + one.about;
  app.add_option("result", given->result, "folder that `palpate estimate` wrote")->required();
  app.add_option("--to", given->to, "simulator:" + list)->required();
  app.add_option("-o,--out", given->out, "folder for its files")->required();
  app.add_option("--density", given->density_kg_m3, "kg/m3, for simulators of motion (that of the recording)")
      ->check(positive_number());
  app.add_option("--gravity", given->gravity, "X Y Z in m/s2 (that of the recording; none where the shape was measured with its weight on)")->expected(3)->type_name("");
  app.add_option("--elements", given->elements, "of simulators that take no quadratic tetrahedra: split (each in eight, near to what was fitted) or corners (an eighth of them, stiffer)")
      ->check(CLI::IsMember({"split", "corners"}))
      ->type_name("")
      ->capture_default_str();
  app.add_flag("--verify", given->verify, "calculix: let ccx solve the exported model under a test load and compare");
  return [given](Session& session) { return run(*given, session); };
}

}  // namespace palpate::cli
