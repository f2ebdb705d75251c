// SPDX-License-Identifier: Apache-2.0
// `palpate export OUT --to SIMULATOR`: the learned object for other simulators, and what CalculiX says about it.
#include <fmt/format.h>

#include <cstdlib>
#include <filesystem>
#include <memory>
#include <sstream>

#include "cli/learned_object.hpp"
#include "cli/number_checks.hpp"
#include "cli/paths.hpp"
#include "cli/verbs.hpp"
#include "palpate/core/error.hpp"
#include "palpate/fem/response.hpp"
#include "palpate/io/exporters.hpp"
#include "palpate/io/file.hpp"
#include "palpate/prediction/predict.hpp"

namespace palpate::cli {
namespace {

namespace fs = std::filesystem;

struct Options {
  fs::path result, out;
  std::string to;
  double density_kg_m3 = 0;
  std::vector<double> gravity;
  bool verify = false;
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

VectorX solved_here(const io::ExportModel& model, int threads) {
  fem::Boundary boundary;
  for (const Index node : model.fixed) boundary.constraints.push_back({node, Mat3::Identity(), 3});
  const Eigen::Index size = 3 * model.mesh.nodes_m.rows();
  boundary.forces.resize(size, 1);
  for (const auto& [node, force] : model.forces_n)
    for (int d = 0; d < 3; ++d) boundary.forces.coeffRef(3 * node + d, 0) += force(d);
  boundary.motions.resize(size, 0);
  fem::Response::Options options;
  options.statics.threads = threads;
  if (!model.regions.empty()) {
    const Index count = static_cast<Index>(model.regions.size());
    options.statics.region = model.region;
    options.statics.region_stiffness.resize(count);
    options.statics.region_poisson.resize(count);
    for (Index r = 0; r < count; ++r) {
      const io::ExportRegion& one = model.regions[static_cast<std::size_t>(r)];
      options.statics.region_stiffness(r) = one.young_modulus_pa / model.young_modulus_pa;
      options.statics.region_poisson(r) = r > 0 ? one.poisson_ratio : std::nan("");
    }
  }
  const fem::Response response(model.mesh, "linear", std::move(boundary), Eigen::SparseMatrix<double>(0, size), options);
  fem::ResponseQuery query{model.young_modulus_pa, model.poisson_ratio, VectorX::Ones(1), VectorX(0)};
  query.derivatives = false;
  const fem::ResponseState at = response.solve(query);
  if (!at.converged) throw Error("finds no equilibrium under the test load: " + at.reason, "--verify");
  return at.solution->displacement_m;
}

/// One word for the shell.
std::string quoted(const std::string& text) {
  std::string word = "'";
  for (const char c : text) word += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return word + "'";
}

/// CalculiX solves its own file under a test load; largest difference over the largest displacement.
double difference_to_calculix(io::ExportModel model, const fs::path& folder, int threads) {
  if (std::system("command -v ccx > /dev/null 2>&1") != 0)
    throw Error("ccx is not installed (Debian: calculix-ccx)", "--verify");
  if (model.fixed.empty()) throw Error("nothing holds the object, so that a static solver has no answer", "--verify");
  add_test_load(model);
  fs::create_directories(folder);
  for (const auto& [name, bytes] : io::export_files(io::exporter_named("calculix"), model))
    io::write_file(folder / name, bytes);
  if (std::system(("cd " + quoted(folder.string()) + " && ccx object > ccx.log 2>&1").c_str()) != 0)
    throw Error("ccx failed; see ccx.log", folder.string());
  const VectorX ours = solved_here(model, threads);
  std::istringstream lines(io::read_file(folder / "object.dat"));
  double largest = 0;
  Eigen::Index seen = 0;
  for (std::string line; std::getline(lines, line);) {
    long node = 0;
    double u[3];
    if (std::sscanf(line.c_str(), "%ld %lf %lf %lf", &node, &u[0], &u[1], &u[2]) != 4) continue;
    if (node < 1 || 3 * node > ours.size()) throw Error("names a node that is not there", (folder / "object.dat").string());
    for (int d = 0; d < 3; ++d) largest = std::max(largest, std::abs(u[d] - ours(3 * (node - 1) + d)));
    ++seen;
  }
  if (3 * seen != ours.size()) throw Error("does not hold every node", (folder / "object.dat").string());
  return largest / ours.cwiseAbs().maxCoeff();
}

int run(const Options& given, Session& session) {
  const io::Exporter& exporter = io::exporter_named(given.to);
  must_take_files(given.out);
  const LearnedObject learned = load_learned_object(given.result);
  std::optional<Vec3> gravity_m_s2;
  if (given.gravity.size() == 3) gravity_m_s2 = Vec3(given.gravity[0], given.gravity[1], given.gravity[2]);
  const io::ExportModel model = export_model(learned, given.density_kg_m3, gravity_m_s2);
  const io::ExportFiles files = io::export_files(exporter, model);
  fs::create_directories(given.out);
  nlohmann::json names = nlohmann::json::array();
  for (const auto& [name, bytes] : files) {
    io::write_file(given.out / name, bytes);
    names.push_back(name);
  }
  session.say(fmt::format("{}: {}", exporter.name, exporter.about));
  const bool coarser = model.mesh.tetrahedra.cols() == 10 && !exporter.quadratic;
  if (coarser)
    session.warn(
        "linear tetrahedra of the same corners were written: they act stiffer than the quadratic ones that were fitted");
  if (learned.object.rest.state != RestState::stress_free && learned.object.environment.gravity_m_s2.norm() > 0) {
    if (given.gravity.empty())
      session.say("gravity is left out: the shape was measured with its weight on and has sagged already");
    else if (model.gravity_m_s2.norm() > 0)
      session.warn("the shape was measured with its weight on: under gravity it sags once more");
  }
  session.say(fmt::format("open {}", (given.out / exporter.main_file).string()));
  nlohmann::json json = {{"to", exporter.name},
                         {"files", names},
                         {"main_file", exporter.main_file},
                         {"young_modulus_pa", model.young_modulus_pa},
                         {"poisson_ratio", model.poisson_ratio},
                         {"density_kg_m3", model.density_kg_m3},
                         {"regions", model.regions.size()},
                         {"fixed_nodes", model.fixed.size()},
                         {"elements", coarser ? "corners" : "as_fitted"}};
  int code = exit_done;
  if (given.verify) {
    if (given.to != "calculix") throw Error("only CalculiX is asked so far (--to calculix)", "--verify");
    constexpr double agrees = 1e-5;
    const double difference = difference_to_calculix(model, given.out / "verify", session.thread_count());
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
  auto given = std::make_shared<Options>();
  std::string list;
  for (const io::Exporter& one : io::exporters()) list += "\n  " + one.name + ": " + one.about;
  app.add_option("result", given->result, "folder that `palpate estimate` wrote")->required();
  app.add_option("--to", given->to, "simulator:" + list)->required();
  app.add_option("-o,--out", given->out, "folder for its files")->required();
  app.add_option("--density", given->density_kg_m3, "kg/m3, for simulators of motion (that of the recording)")
      ->check(positive_number());
  app.add_option("--gravity", given->gravity, "X Y Z in m/s2 (that of the recording; none where the shape was measured with its weight on)")->expected(3)->type_name("");
  app.add_flag("--verify", given->verify, "calculix: let ccx solve the exported model under a test load and compare");
  return [given](Session& session) { return run(*given, session); };
}

}  // namespace palpate::cli
