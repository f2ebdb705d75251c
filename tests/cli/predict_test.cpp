// label: unit
// SPDX-License-Identifier: Apache-2.0
// `palpate predict` and `palpate export` of a learned block: pushes that make no sense are refused, gravity acts once.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "estimation/pushed_block.hpp"
#include "palpate/io/file.hpp"
#include "palpate/io/recording.hpp"
#include "said_by.hpp"
#include "temporary_folder.hpp"

namespace palpate::predict_test {
namespace {

using testing::HasSubstr;

using Outcome = test::Said;

class LearnedBlock : public testing::Test {
 protected:
  void SetUp() override {
    Recording recording = estimation::pushed_block_recording();
    recording.rest.volume = estimation::kuhn_block(4, 3, 2, estimation::block_size_m);
    recording.rest.state = RestState::under_gravity;
    recording.density_kg_m3 = 500;
    recording.environment.gravity_m_s2 = Vec3(0, 0, -9.81);
    recording.model.material = "linear";
    recording.model.refine = "none";
    estimation::PushedBlock truth;
    truth.finer = 1;
    truth.points = 200;
    truth.material = "linear";
    const auto clouds = estimation::clouds_of(truth, recording);
    for (std::size_t s = 0; s < clouds.size(); ++s) {
      recording.pushes[0].steps[s].time_s = static_cast<double>(s);
      recording.pushes[0].steps[s].observations = {std::get<PointCloud>(clouds[s][0])};
    }
    io::write_recording(recording, files_ / "recording");
    ASSERT_EQ(run("estimate " + (files_ / "recording").string() + " -o " + (files_ / "result").string() + " --quiet").exit_code, 0);
  }
  Outcome run(const std::string& arguments) const { return test::said_by(std::string(PALPATE_CLI) + " " + arguments + " 2>&1"); }
  Outcome predict(const std::string& arguments) const { return run("predict " + (files_ / "result").string() + " --radius 0.006 " + arguments); }

  const test::TemporaryFolder files_{"learned_block"};
};

TEST_F(LearnedBlock, IsPressedOnItsSurfaceAndIntoIt) {
  const Outcome good = predict("--contact 0.03 0.02 0.03 --force 0.1");
  EXPECT_EQ(good.exit_code, 0) << good.text;
  EXPECT_THAT(good.text, HasSubstr("travel"));
  const struct {
    const char *arguments, *said;
    int exit_code;
  } bad[] = {
      {"--contact 0.03 0.02 0.05 --force 0.1", "away from the object's surface; the nearest place on it is 0.03 0.02 0.03", 3},
      {"--contact 0.03 0.02 0.03 --direction 0 0 1 --force 0.1", "points out of the object", 3},
      {"--contact 0 0.02 0.015 --direction 1 0 0 --force 0.1", "a support holds the object", 3},
      {"--contact 0.03 0.02 0.03 --force 1e12", "no such object stands that", 3},
      {"--contact 0.03 0.02 0.03 --travel 40", "further than the object is large", 3},
      {"--contact 0.03 0.02 0.03 --force -5", "must be a number above 0, is -5", 2},
      {"--contact 0.03 0.02 0.03 --force 0", "must be a number above 0", 2},
      {"--contact 0.03 0.02 0.03 --travel nan", "must be a number above 0", 2},
      {"--contact nan 0.02 0.03 --force 1", "must be a finite number", 2},
  };
  for (const auto& one : bad) {
    const Outcome outcome = predict(one.arguments);
    EXPECT_EQ(outcome.exit_code, one.exit_code) << one.arguments << outcome.text;
    EXPECT_THAT(outcome.text, HasSubstr(one.said)) << one.arguments;
  }
}

/// How the volume change is integrated depends on what was expected of nu, as in the fit, and not on what was found: there would be a jump.
TEST_F(LearnedBlock, AnswersSmoothlyInThePoissonRatio) {
  const auto file = files_ / "result" / "result.json";
  nlohmann::json result = nlohmann::json::parse(io::read_file(file));
  double travel_m[2] = {};
  for (const int above : {0, 1}) {
    for (auto& parameter : result.at("parameters"))
      if (parameter.at("name") == "poisson_ratio") parameter["value"] = above != 0 ? 0.4501 : 0.4499;
    io::write_file(file, result.dump());
    const Outcome outcome = run("predict " + (files_ / "result").string() + " --contact 0.045 0.02 0.03 --force 0.12 --json --quiet");
    ASSERT_EQ(outcome.exit_code, 0) << outcome.text;
    travel_m[above] = nlohmann::json::parse(outcome.text).at("travel_m").at("value");
  }
  EXPECT_NEAR(travel_m[1] / travel_m[0], 1, 5e-4);
}

/// Learned with up to 0.12 N on a disc of 12 mm, 265 Pa.
TEST_F(LearnedBlock, PressedHarderThanItWasLearnedIsSaid) {
  const std::string there = "--contact 0.03 0.02 0.03 --force ", said = "times as hard as any push that the object was learned from";
  const Outcome as_learned = predict(there + "0.03"), harder = predict(there + "0.1");
  EXPECT_EQ(as_learned.exit_code, 0) << as_learned.text;
  EXPECT_THAT(as_learned.text, testing::Not(HasSubstr(said)));
  EXPECT_EQ(harder.exit_code, 0) << harder.text;
  EXPECT_THAT(harder.text, testing::AllOf(HasSubstr("3.3 " + said), HasSubstr("884 Pa"), HasSubstr("265 Pa")));
}

/// A force of a nanonewton moves it by little, which is no support.
TEST_F(LearnedBlock, YieldsToTheSmallestForce) {
  const Outcome outcome = predict("--contact 0.03 0.02 0.03 --force 1e-9 --json");
  EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
  EXPECT_THAT(outcome.text, HasSubstr("\"stiffness_n_m\""));
  EXPECT_THAT(predict("--contact 0.03 0.02 0.03 --force 1e-9").text, HasSubstr("1.00e-09 N"));
}

/// The shape was measured with its weight on: a simulator that pulls at it again would let it sag twice.
TEST_F(LearnedBlock, ThatHasSaggedAlreadyIsExportedWithoutGravity) {
  const std::string to = "export " + (files_ / "result").string() + " --to calculix -o ";
  const Outcome plain = run(to + (files_ / "plain").string());
  EXPECT_EQ(plain.exit_code, 0) << plain.text;
  EXPECT_THAT(plain.text, HasSubstr("gravity is left out"));
  EXPECT_THAT(io::read_file(files_ / "plain" / "object.inp"), testing::Not(HasSubstr("GRAV")));
  const Outcome asked = run(to + "\"" + (files_ / "asked's").string() + "\" --gravity 0 0 -9.81");
  EXPECT_EQ(asked.exit_code, 0) << asked.text;
  EXPECT_THAT(asked.text, HasSubstr("sags once more"));
  EXPECT_THAT(io::read_file(files_ / "asked's" / "object.inp"), HasSubstr("GRAV"));
}

/// SOFA's law is not the learned one, and both are solved to say what that does; CalculiX has it.
TEST_F(LearnedBlock, IsExportedWithTheLawThatItWasLearnedWithOrItIsSaid) {
  const std::string result = "export " + (files_ / "result").string() + " --json -o " + (files_ / "out").string() + " --to ";
  const Outcome sofa = run(result + "sofa"), calculix = run(result + "calculix");
  EXPECT_EQ(sofa.exit_code, 0) << sofa.text;
  EXPECT_THAT(sofa.text, testing::AllOf(HasSubstr("the law there is corotational, and linear was learned"), HasSubstr("hardest push"),
                                        HasSubstr("\"law\": \"corotational\""), HasSubstr("\"material\": \"linear\"")));
  const nlohmann::json json = nlohmann::json::parse(sofa.text.substr(sofa.text.find("{\n")));
  EXPECT_NEAR(json["hardest_push"]["travel_m"].get<double>() / json["hardest_push"]["learned_travel_m"].get<double>(), 1, 0.05);
  EXPECT_THAT(calculix.text, testing::AllOf(HasSubstr("\"law\": \"linear\""), testing::Not(HasSubstr("the law there"))));
}

/// Drake's world pulls with 9.81 m/s2 unless it is told, and its files have no place for a node.
TEST_F(LearnedBlock, IsExportedWithWhatItsFilesLackSaid) {
  const std::string out = " --json -o " + (files_ / "out").string(), result = "export " + (files_ / "result").string();
  const Outcome drake = run(result + " --to drake" + out), asked = run(result + " --to drake --gravity 0 0 -9.81" + out), usd = run(result + " --to usd" + out);
  EXPECT_THAT(drake.text, testing::AllOf(HasSubstr("set_gravity_vector() to 0 0 0 m/s2, since"), testing::Not(HasSubstr("gravity is left out"))));
  EXPECT_THAT(asked.text, testing::AllOf(HasSubstr("to 0 0 -9.81 m/s2"), HasSubstr("sags once more")));
  EXPECT_THAT(drake.text, testing::AllOf(testing::Not(HasSubstr("held_nodes")), testing::Not(HasSubstr("\"fixed_nodes\": 0"))));
  EXPECT_THAT(usd.text, testing::AllOf(HasSubstr("nodes that supports hold are free in object.usda"), HasSubstr("\"fixed_nodes\": 0")));
  EXPECT_TRUE(std::filesystem::exists(files_ / "out" / "held_nodes.txt"));

  std::string recording = io::read_file(files_ / "result" / "model" / "recording.yaml");
  const auto at = recording.find("density_kg_m3:");
  ASSERT_NE(at, std::string::npos) << recording;
  recording.insert(at, "# ");
  for (const auto& [there, weightless] : {std::pair<std::string, std::string>("gravity_m_s2: [0, 0, -9.81]", "gravity_m_s2: [0, 0, 0]"),
                                          {"state: under_gravity", "state: stress_free"}}) {
    ASSERT_NE(recording.find(there), std::string::npos) << recording;
    recording.replace(recording.find(there), there.size(), weightless);
  }
  io::write_file(files_ / "result" / "model" / "recording.yaml", recording);
  const Outcome light = run(result + " --to calculix --gravity 0 0 -9.81" + out);
  EXPECT_EQ(light.exit_code, 3) << light.text;
  EXPECT_THAT(light.text, testing::AllOf(HasSubstr("gravity needs the object's density"), HasSubstr("--density")));
}

/// What holds an object in its recording need not be in a file; nor does a static solver answer where nothing holds it.
TEST_F(LearnedBlock, IsExportedWithTheSupportsThatAreLeftOutSaid) {
  const auto file = files_ / "result" / "model" / "recording.yaml";
  const std::string recording = io::read_file(file), result = "export " + (files_ / "result").string() + " -o " + (files_ / "out").string() + " --to ";
  const auto from = recording.find("supports:"), to = recording.find("\n", recording.find("\n", from) + 1);
  ASSERT_NE(from, std::string::npos);
  const auto with = [&](const std::string& kind, const std::string& contact) {
    std::string other = recording;
    other.replace(from, to - from, "supports:\n  - {kind: " + kind + ", name: \"foot\", point_m: [0, 0, 0], normal: [0, 0, 1], tolerance_m: 0.0001, contact: " + contact + "}");
    io::write_file(file, other);
  };
  with("plane", "frictionless");
  const Outcome slides = run(result + "calculix"), sofa = run(result + "sofa");
  EXPECT_THAT(slides.text, testing::AllOf(HasSubstr("holds 3 of the 6 rigid motions"), testing::Not(HasSubstr("is not written"))));
  EXPECT_THAT(io::read_file(files_ / "out" / "object.inp"), HasSubstr("SLIDES3, 3, 3"));
  EXPECT_THAT(sofa.text, HasSubstr("support 'foot' is not written: what it holds slides"));
  with("table", "frictionless");
  EXPECT_THAT(run(result + "calculix").text, testing::AllOf(HasSubstr("support 'foot' is not written: it only pushes"), HasSubstr("holds 6 of the 6")));
}

TEST_F(LearnedBlock, WhoseLawNobodyKnowsIsNotExported) {
  const auto file = files_ / "result" / "result.json";
  std::string bytes = io::read_file(file);
  const std::string law = "\"material\":\"linear\"", spaced = "\"material\": \"linear\"";
  const auto at = bytes.find(law) != std::string::npos ? bytes.find(law) : bytes.find(spaced);
  ASSERT_NE(at, std::string::npos);
  bytes.replace(bytes.find("linear", at), 6, "jelly");
  io::write_file(file, bytes);
  const Outcome outcome = run("export " + (files_ / "result").string() + " --to calculix -o " + (files_ / "out").string());
  EXPECT_EQ(outcome.exit_code, 3);
  EXPECT_THAT(outcome.text, HasSubstr("result.json: material jelly: no material is called 'jelly'; choose one of linear"));
  EXPECT_FALSE(std::filesystem::exists(files_ / "out"));
}

/// Of two estimates neither has anything of the other.
TEST_F(LearnedBlock, BelongsToItsResult) {
  namespace fs = std::filesystem;
  const std::string press = " --radius 0.006 --contact 0.03 0.02 0.03 --force 0.1";
  const std::string again = "estimate " + (files_ / "recording").string() + " --poisson-ratio 0.3 --quiet -o ";
  const std::string before = io::read_file(files_ / "result" / "result.json");

  // A second estimate that does not come to its end leaves the first as it was.
  const std::string mesh = io::read_file(files_ / "result" / "model" / "material.json");
  fs::remove(files_ / "result" / "report.html");
  fs::create_directories(files_ / "result" / "report.html" / "in_the_way");
  EXPECT_EQ(run(again + (files_ / "result").string()).exit_code, 3);
  EXPECT_EQ(io::read_file(files_ / "result" / "result.json"), before);
  EXPECT_EQ(io::read_file(files_ / "result" / "model" / "material.json"), mesh);
  EXPECT_FALSE(fs::exists(files_ / "result" / "model.part"));
  EXPECT_EQ(predict("--contact 0.03 0.02 0.03 --force 0.1").exit_code, 0);

  ASSERT_EQ(run(again + (files_ / "other").string()).exit_code, 0);
  EXPECT_EQ(run("predict " + (files_ / "other").string() + press).exit_code, 0);
  fs::remove_all(files_ / "other" / "model");
  fs::copy(files_ / "result" / "model", files_ / "other" / "model", fs::copy_options::recursive);
  for (const std::string& verb : {"predict " + (files_ / "other").string() + press,
                                  "export " + (files_ / "other").string() + " --to calculix -o " + (files_ / "out").string()}) {
    const Outcome outcome = run(verb);
    EXPECT_EQ(outcome.exit_code, 3) << verb;
    EXPECT_THAT(outcome.text, testing::AllOf(HasSubstr("other/model/material.json"), HasSubstr("other/result.json"))) << verb;
  }

  // An earlier version's result says nothing of its model.
  nlohmann::json old = nlohmann::json::parse(io::read_file(files_ / "other" / "result.json"));
  old.erase("model_sha256");
  io::write_file(files_ / "other" / "result.json", old.dump());
  EXPECT_EQ(run("predict " + (files_ / "other").string() + press).exit_code, 0);
}

}  // namespace
}  // namespace palpate::predict_test
