// label: oracle
// SPDX-License-Identifier: Apache-2.0
// `palpate predict` presses an object with what it was learned with: a tool that moves as a rigid body, a table that it may lift off,
// a support that gives way. What the fit says of a push, and closed forms, are the measure.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>

#include "estimation/pushed_block.hpp"
#include "palpate/io/file.hpp"
#include "palpate/io/recording.hpp"
#include "said_by.hpp"
#include "temporary_folder.hpp"

namespace palpate::predict_as_learned_test {
namespace {

using testing::HasSubstr;

struct Outcome : test::Said {
  nlohmann::json json;
  double value(const char* of) const { return json.at(of).at("value"); }
};

class AsLearned : public testing::Test {
 protected:
  Outcome run(const std::string& arguments, const char* said = "2>&1") const {
    Outcome out{test::said_by(std::string(PALPATE_CLI) + " " + arguments + " " + said), {}};
    const auto brace = out.text.find('{');
    if (brace != std::string::npos) out.json = nlohmann::json::parse(out.text.substr(brace), nullptr, false);
    return out;
  }
  void learn(Recording recording) const {
    recording.name = "block";
    recording.model.mesh = "as_given";
    recording.model.refine = "none";
    recording.model.material = "linear";
    recording.model.poisson_fixed = poisson;
    for (std::size_t s = 0; s < recording.pushes[0].steps.size(); ++s) recording.pushes[0].steps[s].time_s = static_cast<double>(s);
    std::filesystem::remove_all(files_ / "recording");
    io::write_recording(recording, files_ / "recording");
    const Outcome learned = run("estimate " + (files_ / "recording").string() + " -o " + result() + " --quiet");
    ASSERT_EQ(learned.exit_code, 0) << learned.text;
  }
  std::string result() const { return (files_ / "result").string(); }
  Outcome predict(const std::string& arguments) const {
    Outcome out = run("predict " + result() + " --json --quiet " + arguments, "2>/dev/null");
    EXPECT_EQ(out.exit_code, 0) << out.text;
    return out;
  }
  nlohmann::json last_step() const { return nlohmann::json::parse(io::read_file(files_ / "result" / "result.json")).at("steps").back(); }
  /// As earlier versions wrote them.
  void forget_tools() const {
    nlohmann::json json = nlohmann::json::parse(io::read_file(files_ / "result" / "result.json"));
    for (auto& step : json.at("steps")) step.erase("tool");
    io::write_file(files_ / "result" / "result.json", json.dump());
  }

  static constexpr double young_pa = 1e4, poisson = 0.3;
  const test::TemporaryFolder files_{"as_learned"};
};

Support base(SupportKind kind, ContactLaw contact) {
  Support support;
  support.name = "base";
  support.kind = kind;
  support.select = NodeSelection::plane;
  support.plane = {Vec3::Zero(), Vec3::UnitZ()};
  support.tolerance_m = 1e-4;
  support.contact = contact;
  if (contact == ContactLaw::friction) support.friction_coefficient = 0.5;
  return support;
}

/// Steps of imposed travel, and the force that was read.
void put_driven_steps(Recording& recording, const Vec3& contact_m, const std::vector<double>& travels_m, const std::function<double(double)>& force_of) {
  auto& steps = recording.pushes[0].steps;
  steps.clear();
  for (const double travel_m : travels_m) {
    Load load;
    load.tool = recording.tools[0].name;
    load.travel_m = travel_m;
    load.contact_m = contact_m;
    Wrench wrench;
    wrench.force_n = Vec3(0, 0, -force_of(travel_m));
    wrench.force_sigma_n = 0.003;
    Step step;
    step.loads = {load};
    step.observations = {wrench};
    steps.push_back(step);
  }
}

/// Hertz: F = 4/3 E / (1 - nu^2) sqrt(R) d^1.5. A uniform pressure over the ball's radius is four times as stiff.
TEST_F(AsLearned, ABallThatWasDrivenPressesAsHertzSays) {
  Recording recording = estimation::pushed_block_recording();
  const Vec3 size_m(0.08, 0.08, 0.05), top_m(0.04, 0.04, 0.05);
  recording.rest.volume = estimation::kuhn_block(8, 8, 5, size_m);
  recording.supports = {base(SupportKind::plane, ContactLaw::bonded)};
  Tool ball;
  ball.name = "ball";
  ball.shape = ToolShape::sphere;
  ball.radius_m = 0.015;
  ball.contact = ContactLaw::frictionless;
  recording.tools = {ball};
  const auto hertz_n = [](double d) { return 4.0 / 3 * young_pa / (1 - poisson * poisson) * std::sqrt(0.015) * std::pow(d, 1.5); };
  put_driven_steps(recording, top_m, {0.001, 0.0015, 0.002}, hertz_n);
  learn(recording);
  const double measured_n = hertz_n(0.002);
  for (const bool earlier : {false, true}) {
    if (earlier) forget_tools();
    const Outcome by_travel = predict("--contact 0.04 0.04 0.05 --travel 0.002");
    EXPECT_NEAR(by_travel.value("force_n") / measured_n, 1, 0.1);
    EXPECT_NEAR(by_travel.value("force_n") / last_step().at("force_predicted_n").get<double>(), 1, 1e-3);
    EXPECT_NEAR(by_travel.json.at("force_n").at("std").get<double>() / last_step().at("force_predicted_std_n").get<double>(), 1, 0.02);
    const Outcome by_force = predict(fmt::format("--contact 0.04 0.04 0.05 --force {}", by_travel.value("force_n")));
    EXPECT_NEAR(by_force.value("travel_m"), 0.002, 2e-6);
    EXPECT_NEAR(by_force.json.at("stiffness_n_m").get<double>() / by_travel.json.at("stiffness_n_m").get<double>(), 1, 1e-3);
  }
  // Who states a patch has its force spread over it.
  EXPECT_GT(predict("--contact 0.04 0.04 0.05 --travel 0.002 --radius 0.015").value("force_n"), 2 * measured_n);
}

/// F = E A d / L.
TEST_F(AsLearned, APlatenFollowsHooke) {
  Recording recording = estimation::pushed_block_recording();
  const Vec3 size_m(0.06, 0.04, 0.03);
  recording.rest.volume = estimation::kuhn_block(4, 3, 2, size_m);
  recording.supports = {base(SupportKind::plane, ContactLaw::frictionless)};
  Tool platen;
  platen.name = "platen";
  platen.shape = ToolShape::platen;
  platen.plane = {Vec3(0, 0, 0.03), -Vec3::UnitZ()};
  platen.contact = ContactLaw::frictionless;
  recording.tools = {platen};
  const auto hooke_n = [&](double d) { return young_pa * size_m.x() * size_m.y() / size_m.z() * d; };
  put_driven_steps(recording, Vec3::Zero(), {0.0005, 0.001}, hooke_n);
  learn(recording);
  EXPECT_NEAR(predict("--travel 0.0008").value("force_n"), hooke_n(0.0008), 1e-4 * hooke_n(0.0008));
  EXPECT_NEAR(predict("--force 0.5").value("travel_m"), 0.5 / hooke_n(1), 1e-8);
}

class PressedByADisc : public AsLearned {
 protected:
  /// Two forces and the travels that were read of them, in the middle of the block's top unless said otherwise.
  Recording pressed(const Support& support, double y_m = 0.02) const {
    Recording recording = estimation::glued_block_recording({Vec3(0, 0, -0.05), Vec3(0, 0, -0.1)}, 0.03, y_m);
    recording.rest.volume = estimation::kuhn_block(4, 3, 2, estimation::block_size_m);
    recording.supports = {support};
    const double travels_m[] = {0.0003, 0.0006};
    for (std::size_t s = 0; s < 2; ++s) recording.pushes[0].steps[s].observations = {ToolTravel{"", travels_m[s], 1e-5}};
    return recording;
  }
  void agrees_with_fit(const std::string& contact, double within = 1e-4) const {
    const double fitted_m = last_step().at("travel_predicted_m");
    const Outcome by_force = predict(contact + " --force 0.1");
    EXPECT_NEAR(by_force.value("travel_m") / fitted_m, 1, within);
    EXPECT_NEAR(by_force.json.at("travel_m").at("std").get<double>() / last_step().at("travel_predicted_std_m").get<double>(), 1, 0.02);
    EXPECT_NEAR(predict(contact + fmt::format(" --travel {}", fitted_m)).value("force_n"), 0.1, 0.1 * within);
  }
};

TEST_F(PressedByADisc, OnATableThatItMayLiftOff) {
  for (const ContactLaw law : {ContactLaw::frictionless, ContactLaw::friction}) {
    learn(pressed(base(SupportKind::table, law)));
    agrees_with_fit("--contact 0.03 0.02 0.03");
  }
}

/// Its weight holds it down, and is no part of the push.
TEST_F(PressedByADisc, OnATableWithItsWeight) {
  Recording recording = pressed(base(SupportKind::table, ContactLaw::friction));
  recording.rest.state = RestState::under_gravity;
  recording.density_kg_m3 = 500;
  recording.environment.gravity_m_s2 = Vec3(0, 0, -9.81);
  learn(recording);
  agrees_with_fit("--contact 0.03 0.02 0.03");
}

TEST_F(PressedByADisc, OnASupportThatGivesWay) {
  Support support = base(SupportKind::plane, ContactLaw::bonded);
  support.compliance_m_per_n = 0.002;
  learn(pressed(support, 0.025));
  agrees_with_fit("--contact 0.03 0.025 0.03", 4e-3);  // the fit also turns the object under the push
  // In the middle all of the object comes down by F times that.
  const Outcome middle = predict("--contact 0.03 0.02 0.03 --force 0.1");
  std::string yaml = io::read_file(files_ / "result" / "model" / "recording.yaml");
  const std::string stated = "compliance_m_per_n: 0.002";
  ASSERT_NE(yaml.find(stated), std::string::npos);
  yaml.replace(yaml.find(stated), stated.size(), "compliance_m_per_n: 0");
  io::write_file(files_ / "result" / "model" / "recording.yaml", yaml);
  const Outcome stiff = predict("--contact 0.03 0.02 0.03 --force 0.1");
  EXPECT_NEAR(middle.value("travel_m") - stiff.value("travel_m"), 0.002 * 0.1, 1e-8);
  EXPECT_NEAR(middle.value("largest_displacement_m") - stiff.value("largest_displacement_m"), 0.002 * 0.1, 1e-6);
}

TEST_F(PressedByADisc, AlongWhatNothingHoldsIsRefused) {
  learn(pressed(base(SupportKind::plane, ContactLaw::frictionless)));
  agrees_with_fit("--contact 0.03 0.02 0.03");
  const Outcome aside = run("predict " + result() + " --contact 0.03 0.02 0.03 --force 0.1 --direction 0.3 0 -1");
  EXPECT_EQ(aside.exit_code, 3);
  EXPECT_THAT(aside.text, testing::AllOf(HasSubstr("nothing holds the object along 1 0 0"), HasSubstr("--direction")));
}

}  // namespace
}  // namespace palpate::predict_as_learned_test
