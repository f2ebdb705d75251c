// label: contract
// SPDX-License-Identifier: Apache-2.0
// What every exporter promises; and what CalculiX says about its file.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <regex>
#include <sstream>

#include "fem/fem_meshes.hpp"
#include "io/recording_folder.hpp"
#include "palpate/core/error.hpp"
#include "palpate/fem/boundary.hpp"
#include "palpate/fem/materials.hpp"
#include "palpate/fem/regions.hpp"
#include "palpate/fem/statics.hpp"
#include "palpate/io/exporters.hpp"
#include "palpate/io/mesh_file.hpp"
#include "palpate/io/xml.hpp"

namespace palpate::io::export_contract_test {
namespace {

using namespace palpate::io::test;
using testing::HasSubstr;

/// A bar of cubes, five tetrahedra each, clamped below and pulled aside on top.
ExportModel bar(bool quadratic = false, double nu = 0.3) {
  ExportModel model;
  model.name = "bar";
  constexpr double height_m = 0.08;
  model.mesh = fem::block_mesh(2, 2, 4, Vec3(0.04, 0.04, height_m));
  if (quadratic) model.mesh = fem::to_quadratic(model.mesh);
  model.young_modulus_pa = 5e4;
  model.poisson_ratio = nu;
  model.density_kg_m3 = 120;
  std::vector<Index> top;
  for (Eigen::Index i = 0; i < model.mesh.nodes_m.rows(); ++i) {
    if (model.mesh.nodes_m(i, 2) < 1e-9) model.fixed.push_back(Index(i));
    if (model.mesh.nodes_m(i, 2) > height_m - 1e-9) top.push_back(Index(i));
  }
  for (const Index one : top) model.forces_n.emplace_back(one, Vec3(0.3, 0, -0.2) / double(top.size()));
  return model;
}

/// Its upper half stiffer and of another nu.
ExportModel in_halves(ExportModel model) {
  model.regions = {{"lower -- <half>", model.young_modulus_pa, model.poisson_ratio}, {"upper", 3 * model.young_modulus_pa, 0.15}};
  for (Eigen::Index t = 0; t < model.mesh.tetrahedra.rows(); ++t)
    model.region.push_back(fem::element_centre(model.mesh, static_cast<Index>(t)).z() < 0.04 ? 0 : 1);
  return model;
}

/// The same static problem in our own solver.
VectorX solved(const ExportModel& model) {
  fem::Boundary boundary;
  for (const Index node : model.fixed) boundary.constraints.push_back({node, Mat3::Identity(), 3});
  const Eigen::Index size = 3 * model.mesh.nodes_m.rows();
  boundary.forces.resize(size, 1);
  for (const auto& [node, force] : model.forces_n)
    for (int d = 0; d < 3; ++d) boundary.forces.coeffRef(3 * node + d, 0) += force(d);
  boundary.motions.resize(size, 0);
  fem::StaticsOptions options;
  options.region = model.region;
  if (!model.regions.empty()) {
    options.region_stiffness = Eigen::Vector2d(1, model.regions[1].young_modulus_pa / model.young_modulus_pa);
    options.region_poisson = Eigen::Vector2d(std::nan(""), model.regions[1].poisson_ratio);
  }
  const fem::Statics statics(model.mesh, model.law, boundary, options);
  const auto at = statics.solve(model.young_modulus_pa, model.poisson_ratio, VectorX::Ones(1), VectorX(0), nullptr, model.law_parameters);
  EXPECT_TRUE(at.converged) << at.reason;
  return at.displacement_m;
}

class EveryExporter : public testing::TestWithParam<Exporter> {};

std::string all_text(const ExportFiles& files) {
  std::string text;
  for (const auto& [name, bytes] : files) text += bytes;
  return text;
}

TEST_P(EveryExporter, WritesItsMainFileAndTheSameTwice) {
  for (const bool quadratic : {false, true}) {
    const ExportFiles files = export_files(GetParam(), bar(quadratic));
    EXPECT_TRUE(files.count(GetParam().main_file));
    EXPECT_EQ(files, export_files(GetParam(), bar(quadratic)));
    EXPECT_EQ(all_text(files).find("nan"), std::string::npos);
  }
  EXPECT_GT(GetParam().about.size(), 10u);
}

TEST_P(EveryExporter, XmlIsWellFormedAndMeshesComeBack) {
  const ExportModel model = bar();
  for (const auto& [name, bytes] : export_files(GetParam(), model)) {
    if (bytes.starts_with("<")) {
      EXPECT_NO_THROW(parse_xml(bytes, name)) << name;
    }
    if (name.ends_with(".vtk") || name.ends_with(".msh")) {
      const MeshData back = parse_mesh(bytes, name);
      EXPECT_LT((back.points_m - model.mesh.nodes_m).cwiseAbs().maxCoeff(), 1e-12);
      EXPECT_EQ(back.tetrahedra, model.mesh.tetrahedra);
    }
  }
}

TEST_P(EveryExporter, RefusesWhatIsNoMaterialOrNoMesh) {
  const auto refuses = [&](auto change) {
    ExportModel model = bar();
    change(model);
    EXPECT_THROW(export_files(GetParam(), model), Error);
  };
  refuses([](ExportModel& m) { m.young_modulus_pa = 0; });
  refuses([](ExportModel& m) { m.poisson_ratio = 0.5; });
  refuses([](ExportModel& m) { m.poisson_ratio = std::nan(""); });
  refuses([](ExportModel& m) { m.mesh.tetrahedra.resize(0, 4); });
  refuses([](ExportModel& m) { m.mesh.tetrahedra(0, 0) = 100000; });
  refuses([](ExportModel& m) { m.fixed.push_back(-1); });
  if (GetParam().needs_density) {
    refuses([](ExportModel& m) { m.density_kg_m3 = 0; });
  }
}

TEST_P(EveryExporter, ChangesWithEAndNu) {
  ExportModel stiffer = bar(), other_nu = bar();
  stiffer.young_modulus_pa *= 2;
  other_nu.poisson_ratio = 0.4;
  const std::string as_is = all_text(export_files(GetParam(), bar()));
  EXPECT_NE(all_text(export_files(GetParam(), stiffer)), as_is);
  EXPECT_NE(all_text(export_files(GetParam(), other_nu)), as_is);
}

/// As learned with a law; alpha is foam's.
ExportModel of_law(ExportModel model, const std::string& law) {
  model.law = law;
  if (law == "foam") model.law_parameters = VectorX::Constant(1, 6.0);
  return model;
}

/// Whoever learned a law must be able to know whether the file holds it.
TEST_P(EveryExporter, WritesTheLawThatItSaysItDoes) {
  std::map<std::string, std::string> seen;
  for (const std::string& law : GetParam().laws) {
    EXPECT_NO_THROW(fem::material_law(law)) << law;
    EXPECT_EQ(written_law(GetParam(), law), law);
    const auto [same, fresh] = seen.emplace(all_text(export_files(GetParam(), of_law(bar(), law))), law);
    EXPECT_TRUE(fresh) << law << " is written as " << same->second;
  }
  if (GetParam().laws.empty()) {
    EXPECT_EQ(written_law(GetParam(), "neo_hookean"), "");
    return;
  }
  for (const fem::MaterialLaw* law : fem::material_table()) {
    const std::string name(law->name()), there = written_law(GetParam(), name);
    const bool has = std::find(GetParam().laws.begin(), GetParam().laws.end(), name) != GetParam().laws.end();
    EXPECT_EQ(there, has ? name : GetParam().laws.front());
    EXPECT_EQ(all_text(export_files(GetParam(), of_law(bar(), name))), all_text(export_files(GetParam(), of_law(bar(), there))));
  }
}

TEST_P(EveryExporter, TakesRegionsOrSaysWhoDoes) {
  const ExportModel model = in_halves(bar());
  if (!GetParam().by_region) {
    try {
      export_files(GetParam(), model);
      FAIL() << "wrote one stiffness for two";
    } catch (const Error& error) {
      EXPECT_THAT(error.message(), HasSubstr("has 2 regions; calculix, "));
    }
    return;
  }
  const std::string text = all_text(export_files(GetParam(), model));
  for (const std::size_t r : {0, 1}) {
    ExportModel other = model, other_nu = model;
    other.regions[r].young_modulus_pa *= 1.1;
    other_nu.regions[r].poisson_ratio += 0.05;
    EXPECT_NE(all_text(export_files(GetParam(), other)), text);
    EXPECT_NE(all_text(export_files(GetParam(), other_nu)), text);
  }
  for (const auto& [name, bytes] : export_files(GetParam(), model)) {
    if (bytes.starts_with("<")) {
      EXPECT_NO_THROW(parse_xml(bytes, name)) << name;
    }
  }
  ExportModel wrong = model;
  wrong.region.pop_back();
  EXPECT_THROW(export_files(GetParam(), wrong), Error);
  wrong = model;
  wrong.regions[1].poisson_ratio = 0.5;
  EXPECT_THROW(export_files(GetParam(), wrong), Error);
}

INSTANTIATE_TEST_SUITE_P(Exporters, EveryExporter,
                         testing::ValuesIn(std::vector<Exporter>(exporters().begin(), exporters().end())),
                         [](const auto& one) { return one.param.name; });

TEST(Exporters, AMistypedNameIsAnswered) {
  try {
    exporter_named("mujocco");
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.message(), HasSubstr("did you mean 'mujoco'"));
  }
}

double number_after(const std::string& text, const std::string& key) {
  const std::size_t at = text.find(key);
  EXPECT_NE(at, std::string::npos) << key;
  return std::strtod(text.c_str() + at + key.size(), nullptr);
}

/// Shear modulus and half of lambda are what MuJoCo's energy holds: 2 lambda' = lambda.
TEST(Exporters, MujocosConstantsMeanOurs) {
  const std::string text = export_files(exporter_named("mujoco"), bar()).at("object.xml");
  const double young = number_after(text, "young=\""), nu = number_after(text, "poisson=\"");
  EXPECT_NEAR(young / (2 * (1 + nu)), 5e4 / 2.6, 1e-6);
  EXPECT_NEAR(2 * young * nu / ((1 + nu) * (1 - 2 * nu)), 5e4 * 0.3 / (1.3 * 0.4), 1e-6);
}

TEST(Exporters, BulletsConstantsMeanOurs) {
  const std::string text = export_files(exporter_named("bullet"), bar()).at("object.py");
  const double mu = number_after(text, "NeoHookeanMu="), lambda = number_after(text, "NeoHookeanLambda=");
  EXPECT_NEAR(mu, 4.0 / 3 * 5e4 / 2.6, 1e-6);
  EXPECT_NEAR(lambda, 5e4 * 0.3 / (1.3 * 0.4) + 5.0 / 6 * 5e4 / 2.6, 1e-6);
}

TEST(Exporters, MidpointsGiveTheirLoadToTheEdgesEnds) {
  const ExportModel quadratic = bar(true), linear = with_linear_elements(quadratic, LinearElements::corners);
  EXPECT_EQ(linear.mesh.nodes_m, bar().mesh.nodes_m);
  EXPECT_EQ(linear.mesh.tetrahedra, bar().mesh.tetrahedra);
  EXPECT_EQ(linear.fixed, bar().fixed);
  Vec3 before = Vec3::Zero(), after = Vec3::Zero();
  for (const auto& [node, force] : quadratic.forces_n) before += force;
  for (const auto& [node, force] : linear.forces_n) after += force;
  EXPECT_LT((before - after).norm(), 1e-14);
}

/// Every node stays, held and loaded as it was; the children are the right way round and fill what their parents filled.
TEST(Exporters, EightForEachQuadraticTetrahedronAreNearToIt) {
  ExportModel quadratic = in_halves(bar(true));
  quadratic.mesh.nodes_m += 0.002 * (quadratic.mesh.nodes_m.array() * 90).sin().matrix().rowwise().reverse();  // curved edges
  const ExportModel eight = with_linear_elements(quadratic, LinearElements::split), corners = with_linear_elements(quadratic, LinearElements::corners);
  EXPECT_EQ(eight.mesh.nodes_m, quadratic.mesh.nodes_m);
  EXPECT_EQ(eight.mesh.tetrahedra.rows(), 8 * quadratic.mesh.tetrahedra.rows());
  EXPECT_EQ(eight.fixed, quadratic.fixed);
  EXPECT_EQ(eight.region.size(), 8 * quadratic.region.size());
  double least_m3 = 1;
  for (Eigen::Index t = 0; t < eight.mesh.tetrahedra.rows(); ++t) {
    const auto at = [&](int k) { return Vec3(eight.mesh.nodes_m.row(eight.mesh.tetrahedra(t, k))); };
    least_m3 = std::min(least_m3, (at(1) - at(0)).cross(at(2) - at(0)).dot(at(3) - at(0)) / 6);
  }
  EXPECT_GT(least_m3, 0);
  EXPECT_NEAR(fem::volume(eight.mesh) / fem::volume(quadratic.mesh), 1, 0.01);
  const auto compliance = [](const ExportModel& model) {
    const VectorX u = solved(model);
    double work = 0;
    for (const auto& [node, force] : model.forces_n) work += force.dot(u.segment<3>(3 * node));
    return work;
  };
  const double fitted = compliance(quadratic);
  EXPECT_LT(compliance(eight) / fitted, 1);
  EXPECT_LT(1 - compliance(eight) / fitted, 0.5 * (1 - compliance(corners) / fitted));
}

/// A clamped bar slides on a smooth plane at its side: of that plane's nodes one direction is held.
TEST(Exporters, NodesThatSlideAreHeldAlongOneAxis) {
  ExportModel model = bar(true);
  for (Eigen::Index i = 0; i < model.mesh.nodes_m.rows(); ++i)
    if (model.mesh.nodes_m(i, 0) < 1e-9 && model.mesh.nodes_m(i, 2) > 1e-9) model.sliding.emplace_back(Index(i), 0);
  EXPECT_THAT(export_files(exporter_named("febio"), model).at("object.feb"),
              testing::AllOf(HasSubstr("node_set=\"slides1\""), HasSubstr("<x_dof>1</x_dof>\n      <y_dof>0</y_dof>")));
  if (std::system("command -v ccx > /dev/null 2>&1") != 0) GTEST_SKIP() << "no ccx";
  const TemporaryFolder folder("ccx_slides");
  for (const auto& [name, bytes] : export_files(exporter_named("calculix"), model)) folder.put(name, bytes);
  ASSERT_EQ(std::system(("cd '" + folder.path().string() + "' && OMP_NUM_THREADS=1 ccx object > out 2>&1").c_str()), 0);
  std::istringstream lines(folder.get("object.dat"));
  double along = 0, across = 0;
  for (std::string line; std::getline(lines, line);) {
    long node = 0;
    double u[3];
    if (std::sscanf(line.c_str(), "%ld %lf %lf %lf", &node, &u[0], &u[1], &u[2]) != 4) continue;
    if (std::find(model.sliding.begin(), model.sliding.end(), std::pair(Index(node - 1), 0)) == model.sliding.end()) continue;
    along = std::max(along, std::abs(u[0]));
    across = std::max(across, std::abs(u[2]));
  }
  EXPECT_EQ(along, 0);
  EXPECT_GT(across, 1e-6);
}

TEST_P(EveryExporter, CarriesGravityOrSaysWhoSetsIt) {
  ExportModel model = bar();
  model.gravity_m_s2 = Vec3(0.5, 0, -9.25);
  EXPECT_EQ(all_text(export_files(GetParam(), model)) != all_text(export_files(GetParam(), bar())), GetParam().carries_gravity);
  EXPECT_EQ(GetParam().gravity_set_by.empty(), GetParam().carries_gravity);
  model.density_kg_m3 = 0;
  if (GetParam().carries_gravity) {
    EXPECT_THROW(export_files(GetParam(), model), Error) << "a weight without a density";
  }
}

TEST_P(EveryExporter, HoldsNodesOrListsThem) {
  const auto lists = [&](const ExportModel& model) {
    ExportModel loose = model;
    loose.fixed.clear();
    const ExportFiles files = export_files(GetParam(), model);
    EXPECT_NE(files, export_files(GetParam(), loose));
    return files.count("held_nodes.txt") > 0;
  };
  ExportModel foot = bar(), scattered = bar();
  scattered.fixed.push_back(Index(scattered.mesh.nodes_m.rows() / 2));
  EXPECT_EQ(lists(foot), GetParam().holds == Holds::nothing);
  EXPECT_EQ(lists(scattered), GetParam().holds != Holds::nodes);
}

/// Drake holds what lies strictly inside the half space; the plane stands between held and free nodes, also of a turned bar.
TEST(Exporters, DrakesWallHoldsTheFootAlone) {
  ExportModel model = bar();
  model.mesh.nodes_m = model.mesh.nodes_m * Mat3(Eigen::AngleAxisd(0.7, Vec3(1, 2, 0.5).normalized())).transpose();
  const auto wall = held_half_space(model);
  ASSERT_TRUE(wall);
  for (Eigen::Index i = 0; i < model.mesh.nodes_m.rows(); ++i) {
    const bool inside = (model.mesh.nodes_m.row(i).transpose() - wall->point_m).dot(wall->normal) < 0;
    EXPECT_EQ(inside, std::find(model.fixed.begin(), model.fixed.end(), Index(i)) != model.fixed.end());
  }
  EXPECT_THAT(export_files(exporter_named("drake"), model).at("object.sdf"), HasSubstr("<drake:wall_boundary_condition>"));
  model.fixed.push_back(Index(model.mesh.nodes_m.rows() / 2));
  EXPECT_FALSE(held_half_space(model));
}

/// The file is solved by CalculiX itself; displacements of both elements agree with ours.
TEST(Exporters, CalculixSolvesItsFileToTheSameDisplacements) {
  if (std::system("command -v ccx > /dev/null 2>&1") != 0) GTEST_SKIP() << "no ccx";
  for (const auto& [quadratic, halves] : {std::pair(false, false), std::pair(true, false), std::pair(false, true), std::pair(true, true)}) {
    ExportModel model = bar(quadratic, quadratic ? 0.45 : 0.3);
    if (halves) model = in_halves(model);
    // Rounding leaves such numbers in real meshes; their many letters once were cut off in the middle of the exponent.
    model.mesh.nodes_m = (model.mesh.nodes_m.array() == 0).select(-2.77555756156289e-17, model.mesh.nodes_m.array());
    const TemporaryFolder folder("ccx");
    for (const auto& [name, bytes] : export_files(exporter_named("calculix"), model)) folder.put(name, bytes);
    ASSERT_EQ(std::system(("cd '" + folder.path().string() + "' && OMP_NUM_THREADS=1 ccx object > out 2>&1").c_str()), 0);
    const std::string printed = folder.get("object.dat");
    const VectorX ours = solved(model);
    std::istringstream lines(printed);
    std::size_t compared = 0;
    double largest = 0;
    for (std::string line; std::getline(lines, line);) {
      long node = 0;
      double u[3];
      if (std::sscanf(line.c_str(), "%ld %lf %lf %lf", &node, &u[0], &u[1], &u[2]) != 4) continue;
      for (int d = 0; d < 3; ++d) largest = std::max(largest, std::abs(u[d] - ours(3 * (node - 1) + d)));
      ++compared;
    }
    EXPECT_EQ(compared, std::size_t(model.mesh.nodes_m.rows()));
    EXPECT_LT(largest, 2e-6 * ours.cwiseAbs().maxCoeff()) << "7 digits are printed";
  }
}

/// More than a tenth of the bar's length aside: laws part by much more than the digits that are printed.
TEST(Exporters, CalculixBearsLargeLoadsWithEveryLawAsWeDo) {
  if (std::system("command -v ccx > /dev/null 2>&1") != 0) GTEST_SKIP() << "no ccx";
  std::map<std::string, double> aside_m;
  for (const char* learned : {"neo_hookean_isochoric", "stvk", "foam"}) {
    ExportModel model = in_halves(of_law(bar(true), learned));
    for (auto& [node, force] : model.forces_n) force *= 4;
    const TemporaryFolder folder("ccx_law");
    for (const auto& [name, bytes] : export_files(exporter_named("calculix"), model)) folder.put(name, bytes);
    ASSERT_EQ(std::system(("cd '" + folder.path().string() + "' && OMP_NUM_THREADS=1 ccx object > out 2>&1").c_str()), 0) << learned << folder.get("out");
    model = of_law(model, written_law(exporter_named("calculix"), learned));
    if (model.law != "foam") model.law_parameters.resize(0);
    const VectorX ours = solved(model);
    VectorX theirs = VectorX::Constant(ours.size(), std::nan(""));  // of all increments the last stays
    std::istringstream lines(folder.get("object.dat"));
    for (std::string line; std::getline(lines, line);) {
      long node = 0;
      double u[3];
      if (std::sscanf(line.c_str(), "%ld %lf %lf %lf", &node, &u[0], &u[1], &u[2]) != 4) continue;
      for (int d = 0; d < 3; ++d) theirs(3 * (node - 1) + d) = u[d];
    }
    aside_m[learned] = ours.cwiseAbs().maxCoeff();
    EXPECT_GT(aside_m[learned], 0.008) << learned;
    EXPECT_LT((theirs - ours).cwiseAbs().maxCoeff(), 5e-6 * aside_m[learned]) << learned;
  }
  EXPECT_EQ(aside_m["foam"], aside_m["neo_hookean_isochoric"]) << "ccx has no foam that works";
  EXPECT_GT(std::abs(aside_m["foam"] / aside_m["stvk"] - 1), 0.005);
}

/// Without it the body is none that anything can touch.
TEST(Exporters, UsdsMeshCollides) {
  EXPECT_THAT(export_files(exporter_named("usd"), bar()).at("object.usda"), HasSubstr("\"PhysicsDeformableBodyAPI\", \"PhysicsCollisionAPI\""));
}

TEST(Exporters, FebioHasTheNeoHookeanLawItself) {
  const auto text = [](const std::string& law) { return export_files(exporter_named("febio"), of_law(bar(), law)).at("object.feb"); };
  EXPECT_THAT(text("neo_hookean"), HasSubstr("type=\"neo-Hookean\""));
  EXPECT_THAT(text("stvk"), HasSubstr("type=\"isotropic elastic\""));
  EXPECT_THAT(text("neo_hookean"), HasSubstr("<E>50000</E>\n      <v>0.3</v>"));
}

/// MuJoCo itself lets the exported bar sag under its weight until it rests; small enough that strains are small.
TEST(Exporters, MujocoComesToRestWhereWeDo) {
  const std::string peer = std::string(PALPATE_SOURCE_DIR) + "/tests/io/peer";
  if (std::system("node --version > /dev/null 2>&1") != 0) GTEST_SKIP() << "no node";
  if (!std::filesystem::exists(peer + "/node_modules/@mujoco/mujoco")) GTEST_SKIP() << "run `npm install` in tests/io/peer";
  ExportModel model = bar();
  model.forces_n.clear();
  model.gravity_m_s2 = Vec3(1, 0, 0);  // sideways: the bar bends
  const TemporaryFolder folder("mujoco");
  for (const auto& [name, bytes] : export_files(exporter_named("mujoco"), model)) folder.put(name, bytes);
  ASSERT_EQ(std::system(("node '" + peer + "/solve_mujoco.mjs' '" + folder.path().string() + "' 2 > '" +
                         folder.path().string() + "/out.json'")
                            .c_str()),
            0);
  const nlohmann::json out = nlohmann::json::parse(folder.get("out.json"));
  const std::vector<double> at = out["vertices"];
  // MuJoCo lumps the mass equally on the vertices.
  const auto nodes = model.mesh.nodes_m.rows();
  const double mass_kg = model.density_kg_m3 * fem::volume(model.mesh) / double(nodes);
  for (Index i = 0; i < nodes; ++i) model.forces_n.emplace_back(i, mass_kg * model.gravity_m_s2);
  const VectorX ours = solved(model);
  ASSERT_EQ(Eigen::Index(at.size()), ours.size());
  double largest = 0;
  for (Eigen::Index i = 0; i < ours.size(); ++i)
    largest = std::max(largest, std::abs(at[std::size_t(i)] - model.mesh.nodes_m(i / 3, i % 3) - ours(i)));
  EXPECT_LT(largest, 0.005 * ours.cwiseAbs().maxCoeff()) << "0.05 % measured; with E and nu as they are it is 9.9 %";
}

}  // namespace
}  // namespace palpate::io::export_contract_test
