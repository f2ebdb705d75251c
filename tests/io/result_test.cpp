// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/result.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "io/broken_bytes.hpp"
#include "io/recording_folder.hpp"
#include "palpate/io/result_parts.hpp"

namespace palpate::io::result_test {
namespace {

using namespace palpate::io::test;

Identification whole_answer() {
  Identification answer;
  answer.material = "neo_hookean";
  answer.parameters = {{"young_modulus", "", "Pa", 20000.1, 150, 19700, 20300, true},
                       {"poisson_ratio", "", "", 1.0 / 3, 0.01, 0.31, 0.35, false}};
  answer.nuisances = {{"density", "kg/m3", 1100, 20, 1060, 1140, 50, -0.6}};
  answer.covariance = MatrixX::Random(2, 2);
  answer.verdicts = {{"nu_not_determined", "push \"elsewhere\"\n<b>"}};
  answer.fit.rms_m = 0.001;
  answer.fit.points_used = 1234;
  answer.fit.pushes = 2;
  answer.fit.steps = 3;
  answer.fit.iterations = 7;
  answer.fit.solves = 21;
  answer.prediction.available = true;
  answer.prediction.what = "push 2";
  answer.prediction.force_error = std::numeric_limits<double>::quiet_NaN();
  answer.prediction.surface_rms_m = 0.0007;
  answer.prediction.fitted_rms_m = 0.0006;
  answer.prediction.deformation_explained = 0.97;
  answer.budget = {{"force scale", 1.0, 0.001, {{"head", 1.0}, {"body", 0.5}}}};
  answer.budget_if = {{"contact_shift", 0.7, 0.002, {}, "1 mm across the push", "contact_std_m"}};
  answer.per_push = {{"young_modulus", "push 1", "Pa", 19900, 200, 19500, 20300, true}};
  answer.per_load = {{{"young_modulus", "low loads", "Pa", 19900, 200, 19500, 20300, true}, 2.5, 0.004, 0.03, 0.2}};
  LawFit foam;
  foam.law = "foam";
  foam.usable = true;
  foam.young_modulus_pa = 21000;
  foam.chi2 = 1234.5;
  foam.held_out = answer.prediction;
  LawFit linear;
  linear.law = "linear";
  linear.message = "found no equilibrium";
  answer.laws = {foam, linear};
  answer.termination = Termination::no_progress;
  answer.message = "stopped";
  answer.provenance = {{"version", "0.1.0"}, {"input rest.msh", "abc"}};
  answer.timing_s = {{"fit", 1.25}};
  const MeshData tets = cube();
  answer.surface.vertices_m = tets.points_m;
  answer.surface.triangles.resize(2, 3);
  answer.surface.triangles << 0, 1, 2, 0, 2, 3;
  StepFit step;
  step.push = "push 1";
  step.step = 1;
  step.surface_m = tets.points_m * 0.5;
  step.observed_m = Points::Random(4, 3);
  step.residual_m = VectorX::Random(4);
  step.force_n = {1, 2, 3};
  step.travel_m = 0.01;
  step.used = false;
  answer.steps = {step, StepFit()};
  answer.posterior.young_modulus_pa = VectorX::LinSpaced(3, 1e4, 3e4);
  answer.posterior.poisson_ratio = VectorX::LinSpaced(2, 0.1, 0.4);
  answer.posterior.density = MatrixX::Random(3, 2);
  answer.trace = {{1e4, 0.3, 12.5}};
  return answer;
}

TEST(Result, HoldsTheKeysThatProgramsRelyOn) {
  const nlohmann::json object = result_json(whole_answer());
  for (const char* key : {"format", "material", "parameters", "nuisances", "verdicts", "fit", "prediction", "provenance",
                          "timing_s", "per_push", "budget", "budget_if", "covariance"}) {
    EXPECT_TRUE(object.contains(key)) << key;
  }
  for (const char* key : {"name", "region", "unit", "value", "std", "lower_95", "upper_95", "determined"}) {
    EXPECT_TRUE(object["parameters"][0].contains(key)) << key;
  }
  for (const char* key : {"rms_m", "chi2_per_dof", "points_used", "pushes"}) EXPECT_TRUE(object["fit"].contains(key)) << key;
  EXPECT_TRUE(object["nuisances"][0].contains("pull"));
  EXPECT_TRUE(object["prediction"]["force_error"].is_null()) << "JSON knows no NaN";
}

TEST(Result, ComesBackAsItWasWritten) {
  const TemporaryFolder folder("result");
  const Identification answer = whole_answer();
  write_result(answer, folder.path() / "out");
  const Identification back = read_result(folder.path() / "out");
  EXPECT_EQ(result_json(back), result_json(answer));
  EXPECT_EQ(back.covariance, answer.covariance);
  ASSERT_EQ(back.budget[0].regions.size(), 2u);
  EXPECT_EQ(back.budget[0].regions[1].region, "body");
  EXPECT_EQ(back.budget[0].regions[1].young_modulus_percent, 0.5);
  ASSERT_EQ(back.budget_if.size(), 1u);
  EXPECT_EQ(back.budget_if[0].off_by, "1 mm across the push");
  EXPECT_EQ(back.budget_if[0].field, "contact_std_m");
  EXPECT_EQ(back.posterior.density, answer.posterior.density);
  EXPECT_EQ(back.termination, Termination::no_progress);
  EXPECT_TRUE(std::isnan(back.prediction.force_error));
  EXPECT_EQ(back.surface.vertices_m, answer.surface.vertices_m);
  EXPECT_EQ(back.surface.triangles, answer.surface.triangles);
  ASSERT_EQ(back.steps.size(), 2u);
  EXPECT_TRUE(back.steps[0].surface_m.isApprox(answer.steps[0].surface_m, 1e-6));
  EXPECT_TRUE(back.steps[0].observed_m.isApprox(answer.steps[0].observed_m, 1e-6));
  EXPECT_TRUE(back.steps[0].residual_m.isApprox(answer.steps[0].residual_m, 1e-6));
  EXPECT_EQ(back.steps[1].surface_m.rows(), 0);
  EXPECT_EQ(read_result(folder.path() / "out" / "result.json").material, "neo_hookean");
}

/// Its model is moved in, its own; what others put there stays, and nothing unfinished is left.
TEST(Result, KnowsItsModel) {
  namespace fs = std::filesystem;
  TemporaryFolder folder("model");
  const Identification answer = whole_answer();
  const auto said = [&] {
    try {
      check_model(folder.path() / "out");
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  const auto put_model = [&](const std::string& mesh) {
    for (const char* name : {"recording.yaml", "object.vtu", "deep/region.txt"}) folder.put(std::string("new/") + name, "1");
    folder.put("new/rest.vtu", mesh);
  };
  folder.put("out/model/mine.txt", "mine");
  folder.put("out/result.part/mine.txt", "mine");
  put_model("a");
  write_result(answer, folder.path() / "out", folder.path() / "new");
  EXPECT_EQ(folder.get("out/model/rest.vtu"), "a");
  EXPECT_EQ(folder.get("out/model/deep/region.txt"), "1");
  EXPECT_EQ(folder.get("out/model/mine.txt"), "mine");
  EXPECT_EQ(folder.get("out/result.part/mine.txt"), "mine");
  EXPECT_FALSE(fs::exists(folder.path() / "out" / "result.part2"));
  EXPECT_EQ(said(), "");
  folder.put("out/model/recording.yaml", "density_kg_m3: 30");
  folder.put("out/model/object.vtu", "for others");
  EXPECT_EQ(said(), "") << "may be changed by hand";
  folder.put("out/model/rest.vtu", "b");
  EXPECT_THAT(said(), testing::AllOf(testing::HasSubstr("model/rest.vtu: is not the file that"), testing::HasSubstr("out/result.json")));
  fs::remove(folder.path() / "out/model/rest.vtu");
  EXPECT_THAT(said(), testing::HasSubstr("model/rest.vtu"));

  put_model("b");
  write_result(answer, folder.path() / "out", folder.path() / "new");
  EXPECT_EQ(said(), "");
  // What cannot be put in place leaves no result beside a foreign model.
  put_model("c");
  fs::remove(folder.path() / "out/model/rest.vtu");
  folder.put("out/model/rest.vtu/in_the_way", "1");
  EXPECT_THROW(write_result(answer, folder.path() / "out", folder.path() / "new"), Error);
  EXPECT_FALSE(fs::exists(folder.path() / "out" / "result.json"));

  write_result(answer, folder.path() / "old");
  EXPECT_NO_THROW(check_model(folder.path() / "old")) << "one that says nothing of it";
}

TEST(Result, AnAnswerWithoutNumbersIsWrittenToo) {
  const TemporaryFolder folder("nothing");
  write_result(Identification(), folder.path());
  EXPECT_EQ(read_result(folder.path()).message, Identification().message);
}

TEST(Result, BrokenFilesAreRefused) {
  const Reader read = [](std::string_view bytes, const std::string& name) { parse_result(std::string(bytes), name); };
  const std::string whole = result_json(whole_answer()).dump();
  for (const std::string& bytes : truncated(whole)) EXPECT_TRUE(refuses(read, bytes));
  for (const std::string& bytes : garbage()) EXPECT_TRUE(refuses(read, bytes));
  survives(read, damaged(whole, 300));
  EXPECT_TRUE(refuses(read, replaced(whole, "palpate-result/1", "palpate-result/9")));
}

TEST(Result, APartThatIsWrongIsNamedInPlainWords) {
  nlohmann::json damaged = result_json(whole_answer());
  damaged["posterior"]["poisson_ratio"] = "banana";
  try {
    parse_result(damaged.dump(), "file.name");
    ADD_FAILURE() << "was accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.where(), "file.name: posterior");
    EXPECT_EQ(error.message().find("exception"), std::string::npos) << error.what();
  }
}

TEST(Result, ACovarianceThatIsNoSquareIsRefused) {
  nlohmann::json damaged = result_json(whole_answer());
  damaged["covariance"].erase(0);
  try {
    parse_result(damaged.dump(), "file.name");
    ADD_FAILURE() << "was accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.where(), "file.name: covariance");
  }
}

TEST(Model, IsReadyForSimulators) {
  const TemporaryFolder folder("model");
  const MeshData tets = cube();
  write_model(whole_answer(), {tets.points_m, tets.tetrahedra}, folder.path() / "model");
  for (const char* file : {"model/object.vtu", "model/object.msh"}) {
    const TetMesh back = read_tet_mesh(folder.path() / file);
    EXPECT_EQ(back.nodes_m, tets.points_m);
    EXPECT_EQ(back.tetrahedra, tets.tetrahedra);
  }
  const TriMesh surface = read_tri_mesh(folder.path() / "model/surface.obj");
  EXPECT_EQ(surface.vertices_m.rows(), 8);
  EXPECT_EQ(surface.triangles.rows(), 12);
  double volume = 0;  // positive: the faces look outward
  for (Eigen::Index i = 0; i < 12; ++i) {
    const auto corner = [&](Eigen::Index k) { return Vec3(surface.vertices_m.row(surface.triangles(i, k))); };
    volume += corner(0).dot(corner(1).cross(corner(2))) / 6;
  }
  EXPECT_NEAR(volume, 1e-3, 1e-12);
  const nlohmann::json material = nlohmann::json::parse(folder.get("model/material.json"));
  const double young = material["young_modulus_pa"], nu = material["poisson_ratio"], mu = material["shear_modulus_pa"],
               lambda = material["lame_lambda_pa"];
  EXPECT_NEAR(young, mu * (3 * lambda + 2 * mu) / (lambda + mu), 1e-9 * young);
  EXPECT_NEAR(nu, lambda / (2 * (lambda + mu)), 1e-12);
  EXPECT_EQ(material["density_kg_m3"], 1100);
}

TEST(Model, HoldsTheModuliOfEveryElement) {
  const TemporaryFolder folder("model");
  const MeshData tets = cube();
  Identification answer = whole_answer();
  const auto parameter = [](const char* name, const char* region, double value) {
    Parameter one{name, region, "1"};
    one.value = value;
    return one;
  };
  answer.parameters = {parameter("young_modulus", "a", 1e4), parameter("poisson_ratio", "a", 0.2), parameter("young_modulus", "b", 3e4),
                       parameter("poisson_ratio", "b", 0.4)};
  std::vector<int> region(static_cast<std::size_t>(tets.tetrahedra.rows()), 0);
  region.back() = 1;
  write_model(answer, {tets.points_m, tets.tetrahedra}, folder.path() / "model", region);
  // Gmsh's file is text: a number an element under the field's name.
  std::istringstream lines(folder.get("model/object.msh"));
  std::map<std::string, std::vector<double>> fields;
  std::string field;
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("\"")) field = line.substr(1, line.size() - 2);
    if (line.starts_with("$End")) field.clear();
    double element = 0, value = 0;
    std::istringstream words(line);
    if (!field.empty() && words >> element >> value && words.eof()) fields[field].push_back(value);
  }
  for (std::size_t e = 0; e < region.size(); ++e) {
    EXPECT_NEAR(fields["young_modulus_pa"].at(e), region[e] == 0 ? 1e4 : 3e4, 1e-9);
    EXPECT_NEAR(fields["poisson_ratio"].at(e), region[e] == 0 ? 0.2 : 0.4, 1e-12);
  }
}

}  // namespace
}  // namespace palpate::io::result_test
