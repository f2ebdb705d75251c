// label: unit
// SPDX-License-Identifier: Apache-2.0
// `palpate record` as a process that is stopped, killed, left by its reader, asked to go on with something else, or given what
// cannot be: no recorded step is lost, nothing moves that need not, and every refusal has its cure.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "cli/running_program.hpp"
#include "io/recording_folder.hpp"
#include "palpate/io/message_source.hpp"
#include "palpate/io/recording.hpp"

namespace palpate::io::record_test {
namespace {

using namespace palpate::io::test;
namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

const std::string scene = PALPATE_SOURCE_DIR "/examples/driver/scene";
const std::string spring = PALPATE_SPRING_ROBOT;
constexpr int numbers = 1, usage = 2, input = 3;

class Record : public RunningProgram {
 protected:
  std::vector<std::string> record(const std::string& driver, std::vector<std::string> more = {}) const {
    std::vector<std::string> words{"record", "--driver", driver, "--scene", scene, "-o", path("recording"), "--force-limit", "6"};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  std::vector<std::string> with_contact(const std::string& driver, std::vector<std::string> more = {}) const {
    std::vector<std::string> words = record(driver, {"--contact", "0.5", "0", "0.1"});
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  Recording made() const { return read_recording(folder.path() / "recording"); }
};

// The lab's objects are pushed where the user wants, too: on their surface, and there only.
TEST_F(Record, TheLabPushesWhereItIsAsked) {
  std::vector<std::string> words{"record", "--object", "cube", "--material", "linear", "-o", path("lab"), "--travel-limit", "0.003", "--unloading-steps", "0"};
  const auto with = [&](std::vector<std::string> more) {
    std::vector<std::string> all = words;
    all.insert(all.end(), more.begin(), more.end());
    return all;
  };
  EXPECT_EQ(palpate(with({"--contact", "0.64", "0", "0.17"})), usage);
  EXPECT_THAT(said, HasSubstr("--contact: (0.6400 0.0000 0.1700) lies 20.0 mm beside the object"));
  EXPECT_EQ(palpate(with({"--direction", "0", "0", "-1"})), usage);
  EXPECT_THAT(said, HasSubstr("--contact"));
  EXPECT_FALSE(fs::exists(path("lab")));
  ASSERT_EQ(palpate(with({"--contact", "0.64", "0", "0.1495"})), 0) << said;
  const Recording made = read_recording(folder.path() / "lab");
  ASSERT_EQ(made.pushes.size(), 1u);
  const Step& pressed = made.pushes[0].steps.at(1);
  ASSERT_EQ(pressed.loads.size(), 1u);
  EXPECT_LT((pressed.loads[0].contact_m - Vec3(0.64, 0, 0.15)).norm(), 2e-3);
  EXPECT_LT((pressed.loads[0].direction + Vec3::UnitZ()).norm(), 1e-9);
}

TEST_F(Record, CtrlCStopsTheArmWhereItStandsAndKeepsEveryFinishedStep) {
  const pid_t child = start(with_contact(PALPATE_PATIENT_ROBOT, {"--json"}));
  ASSERT_TRUE(says(": 2.")) << said;  // the first step under load
  kill(child, SIGINT);
  EXPECT_EQ(wait_for(child), numbers) << said;
  EXPECT_THAT(said, HasSubstr("stopped: stopped by the user (stopped on request)"));
  EXPECT_TRUE(folder.get("calls").ends_with("stop\n")) << "nothing moves after it";
  const Recording recording = made();
  EXPECT_TRUE(check_recording(recording).empty());
  ASSERT_EQ(recording.pushes.size(), 1u);
  EXPECT_GE(recording.pushes[0].steps.size(), 2u);
  EXPECT_LT(recording.pushes[0].steps.size(), 7u) << "it was not whole yet";
  EXPECT_THAT(said, HasSubstr("\"steps\": " + std::to_string(recording.pushes[0].steps.size())));
}

// As does a terminal that is closed with whoever was to watch.
TEST_F(Record, AClosedTerminalStopsTheArm) {
  const pid_t child = start(with_contact(PALPATE_PATIENT_ROBOT));
  ASSERT_TRUE(says(": 2.")) << said;
  kill(child, SIGHUP);
  EXPECT_EQ(wait_for(child), numbers) << said;
  EXPECT_TRUE(folder.get("calls").ends_with("stop\n")) << "nothing moves after it";
  EXPECT_TRUE(check_recording(made()).empty());
}

// A name with a slip in it began a new run, and the arm moved.
TEST_F(Record, NothingGoesOnWhereNothingIs) {
  EXPECT_EQ(palpate(with_contact(spring, {"--resume"})), input);
  EXPECT_THAT(said, HasSubstr("holds nothing to go on with"));
  EXPECT_FALSE(fs::exists(path("recording")));
  EXPECT_FALSE(fs::exists(path("calls")));
}

TEST_F(Record, TheWayAroundTheObjectIsWiderThanTheTool) {
  EXPECT_EQ(palpate(with_contact(spring, {"--clearance", "0.001"})), usage);
  EXPECT_THAT(said, HasSubstr("--clearance: 0.001 m is not more than the radius of the tool"));
  EXPECT_FALSE(fs::exists(path("recording")));
}

// From 0.15 m above the place where the push begins: 7.5 s of the robot's clock.
TEST_F(Record, CtrlCOnALongWayStopsItThere) {
  const pid_t child = start(with_contact(PALPATE_PATIENT_ROBOT));
  const auto motions = [&] {
    const std::string calls = fs::exists(path("calls")) ? folder.get("calls") : "";
    return std::count(calls.begin(), calls.end(), '\n');
  };
  for (int waited = 0; motions() < 5 && waited < 3000; ++waited) usleep(10000);
  const auto before = motions();
  ASSERT_GE(before, 5);
  ASSERT_LT(before, 12) << "in the middle of it";
  kill(child, SIGINT);
  EXPECT_EQ(wait_for(child), numbers) << said;
  EXPECT_THAT(said, HasSubstr("stopped on request"));
  EXPECT_TRUE(folder.get("calls").ends_with("stop\n"));
  EXPECT_LE(motions(), before + 3) << "the piece that it was at, one that had begun meanwhile, and the stop";
  EXPECT_FALSE(fs::exists(path("recording")));
}

TEST_F(Record, KilledItGoesOnAsIfNothingHadBeen) {
  const pid_t child = start(with_contact(PALPATE_PATIENT_ROBOT));
  ASSERT_TRUE(says(": 4.")) << said;
  kill(child, SIGKILL);
  EXPECT_EQ(wait_for(child), 1000 + SIGKILL);
  const std::size_t before = read_recording_unchecked(folder.path() / "recording").pushes.at(0).steps.size();
  EXPECT_GE(before, 3u);  // rest, 2 N, 4 N
  ASSERT_EQ(palpate(with_contact(spring, {"--resume"})), 0) << said;
  const Recording recording = made();
  EXPECT_TRUE(check_recording(recording).empty());
  ASSERT_EQ(recording.pushes.size(), 1u);
  ASSERT_EQ(recording.pushes[0].steps.size(), 7u);  // rest, 2, 4, 6 N, two on the way back, rest
  double time_s = -1;
  for (const Step& step : recording.pushes[0].steps) {
    EXPECT_GT(step.time_s, time_s);
    time_s = step.time_s;
  }
}

TEST_F(Record, KilledItsRawBagHoldsWhatWasSaidAndGoesOn) {
  const auto forces_s = [&] {
    const MessageSource bag = read_bag(path("raw"));
    EXPECT_TRUE(bag.warnings.empty()) << bag.warnings.front();
    std::vector<double> times_s;
    for (const Message& one : bag.messages)
      if (bag.topics[one.topic].name == "/wrench") times_s.push_back(1e-9 * double(one.log_time_ns));
    return times_s;
  };
  const pid_t child = start(with_contact(PALPATE_PATIENT_ROBOT, {"--raw-bag", path("raw")}));
  ASSERT_TRUE(says(": 4.")) << said;
  kill(child, SIGKILL);
  wait_for(child);
  const std::vector<double> before = forces_s();
  ASSERT_GT(before.size(), 100u) << "free air and two steps";
  ASSERT_EQ(palpate(with_contact(spring, {"--resume", "--raw-bag", path("raw")})), 0) << said;
  EXPECT_THAT(said, Not(HasSubstr("holds only what")));
  const std::vector<double> after = forces_s();
  ASSERT_GT(after.size(), before.size() + 100);
  EXPECT_TRUE(std::equal(before.begin(), before.end(), after.begin()));
  EXPECT_GT(after[before.size()], before.back()) << "its clock does not go back";

  ASSERT_EQ(palpate(with_contact(spring, {"--contact", "0.52", "0.01", "0.1", "--resume", "--raw-bag", path("late")})), 0) << said;
  EXPECT_THAT(said, HasSubstr("--raw-bag: holds only what the sensors say from now on"));
}

// The arm stays as it was, pressed into the object from the first step under load to the last.
TEST_F(Record, KilledAtEveryStepItGoesOnFromWhereTheTipStands) {
  const auto words = [&](std::vector<std::string> more = {}) {
    more.insert(more.end(), {"--settling-window", "0.4", "--settling-rate", "0.2", "--free-air-samples", "20"});
    return with_contact(PALPATE_PATIENT_ROBOT, more);
  };
  int pressed = 0;
  for (std::size_t step = 0; step < 7; ++step) {
    fs::remove_all(path("recording"));
    fs::remove(path("tip"));
    said.clear();
    const pid_t child = start(words());
    for (std::size_t k = 0; k <= step; ++k) ASSERT_TRUE(says("push 1 (")) << said;
    kill(child, SIGKILL);
    const int ended = wait_for(child);
    EXPECT_TRUE(ended == 1000 + SIGKILL || (step == 6 && ended == 0)) << step << ", " << ended << ": after its last step it may be quicker than we";
    const std::size_t before = read_recording_unchecked(folder.path() / "recording").pushes.at(0).steps.size();
    EXPECT_EQ(before, step + 1);
    double x_m = 0, y_m = 0, z_m = 0;
    std::ifstream(path("tip")) >> x_m >> y_m >> z_m;
    pressed += z_m < 0.1;
    ASSERT_EQ(palpate(words({"--resume"})), 0) << step << ": " << said;
    const Recording recording = made();
    EXPECT_TRUE(check_recording(recording).empty());
    ASSERT_EQ(recording.pushes.size(), 1u);
    ASSERT_EQ(recording.pushes[0].steps.size(), 7u) << step;  // rest, 2, 4, 6 N, two on the way back, rest
    const std::vector<double> expected_n{0, 2, 4, 6, 4, 2, 0};
    double time_s = -1;
    for (std::size_t k = 0; k < 7; ++k) {
      const Step& one = recording.pushes[0].steps[k];
      EXPECT_GT(one.time_s, time_s);
      time_s = one.time_s;
      EXPECT_EQ(one.unloading, k > 3);
      ASSERT_EQ(one.loads.size(), k == 0 || k == 6 ? 0u : 1u) << step;
      if (one.loads.empty()) continue;
      // The tare is free air's, though the arm was found pressed: force and travel lie on one line through zero.
      const double force_n = -one.loads[0].force_n->z(), travel_m = std::get<ToolTravel>(one.observations.front()).travel_m;
      EXPECT_NEAR(force_n, expected_n[k], 1.3) << step << ", " << k << ": two motions of 0.4 N and what noise does";
      EXPECT_NEAR(force_n, 800 * travel_m, 0.3) << step << ", " << k;
    }
  }
  EXPECT_EQ(pressed, 5) << "all but the first and the last";
}

// What follows must not err as the beginning did: a resumed run would count the same noise twice.
TEST_F(Record, TheLabErrsAnewWhereItGoesOn) {
  const std::vector<std::string> words{"record", "--object", "cube", "--young-modulus", "20000", "--force-limit", "4", "--force-step", "2",
                                       "--contact", "0.58", "0", "0.15", "-o", path("recording")};
  ASSERT_EQ(palpate(words), 0) << said;
  std::vector<std::string> more = words;
  more.insert(more.end(), {"--contact", "0.63", "0", "0.15", "--resume"});
  ASSERT_EQ(palpate(more), 0) << said;
  const Recording recording = made();
  ASSERT_EQ(recording.pushes.size(), 2u);
  const auto image = [&](std::size_t push) { return std::get<DepthFrame>(recording.pushes[push].steps.front().observations.back()).depth_m; };
  const DepthImage first = image(0), second = image(1);
  ASSERT_EQ(first.size(), second.size());
  Index same = 0, seen = 0;
  for (Index i = 0; i < first.size(); ++i) {
    seen += first.data()[i] > 0 && second.data()[i] > 0;
    same += first.data()[i] > 0 && first.data()[i] == second.data()[i];
  }
  EXPECT_GT(seen, 10000);
  EXPECT_LT(same, seen / 5) << "the table in the picture, to the last digit of the sensor";
}

TEST_F(Record, ItsTruthIsThereStepByStep) {
  const std::vector<std::string> words{"record",         "--object",      "cube", "-o", path("recording"), "--young-modulus", "20000",
                                       "--force-limit", "5", "--force-step", "2"};
  const pid_t child = start(words);
  ASSERT_TRUE(says(": 4.") || says(": 5.")) << said;
  kill(child, SIGKILL);
  wait_for(child);
  const auto truth_of_every_step = [&] {
    const nlohmann::json truth = nlohmann::json::parse(folder.get("recording.truth.json"));
    std::size_t steps = 0, known = 0;
    for (const Push& push : read_recording_unchecked(folder.path() / "recording").pushes)
      for (const Step& step : push.steps) {
        ++steps;
        for (const auto& one : truth.at("steps"))
          if (one.at("push") == push.name && std::abs(one.at("time_s").get<double>() - step.time_s) < 1e-9) ++known;
      }
    EXPECT_EQ(known, steps);
    return steps;
  };
  const std::size_t before = truth_of_every_step();
  EXPECT_GE(before, 3u);
  const std::string index = folder.get("recording/recording.yaml");
  std::vector<std::string> other = words;
  other.insert(other.end(), {"--resume", "--poisson-ratio", "0.11"});
  EXPECT_EQ(palpate(other), input);
  EXPECT_THAT(said, HasSubstr("cannot go on: poisson_ratio was"));
  other = words;
  other[2] = "ball";
  other.push_back("--resume");
  EXPECT_EQ(palpate(other), input);
  EXPECT_THAT(said, HasSubstr("cannot go on: its object is cube, and this command has ball"));
  EXPECT_EQ(folder.get("recording/recording.yaml"), index);
  other = words;
  other.push_back("--resume");
  ASSERT_EQ(palpate(other), 0) << said;
  EXPECT_GT(truth_of_every_step(), before);
  EXPECT_EQ(made().pushes.size(), 2u);
}

TEST_F(Record, GoesOnWithTheSameThingOnly) {
  ASSERT_EQ(palpate(with_contact(spring, {"--contact", "0.52", "0.01", "0.1"})), 0) << said;
  const std::string index = folder.get("recording/recording.yaml");
  const auto refused = [&](std::vector<std::string> words, const std::string& why) {
    words.push_back("--resume");
    EXPECT_EQ(palpate(words), input) << why;
    EXPECT_THAT(said, HasSubstr("cannot go on"));
    EXPECT_THAT(said, HasSubstr(why));
    EXPECT_THAT(said, HasSubstr("or choose another folder"));
    EXPECT_EQ(folder.get("recording/recording.yaml"), index) << why;
  };
  refused(record(spring, {"--contact", "0.52", "0.01", "0.1"}), "push 1: ");
  refused(record(spring, {"--contact", "0.5", "0", "0.1", "--contact", "0.5", "0.02", "0.1"}), "push 2: ");
  refused(with_contact(spring, {"--direction", "0.05", "0", "-1"}), "push 1: direction");
  const std::string text = read_file(fs::path(scene) / "recording.yaml");
  const auto other_scene = [&](const std::string& from, const std::string& to) {
    folder.put("scene/recording.yaml", replaced(text, from, to));
    folder.put("scene/plate.obj", read_file(fs::path(scene) / "plate.obj"));
    std::vector<std::string> words = with_contact(spring);
    words[4] = path("scene");
    return words;
  };
  refused(other_scene("plate on a spring", "ball"), "its object is plate on a spring, and this command has ball");
  refused(other_scene("radius_m: 0.01", "radius_m: 0.012"), "tool stick: radius_m is 0.01, and this command has 0.012");
  refused(other_scene("normal: [0, 0, 1], tol", "normal: [0, 1, 0], tol"), "support table: normal");
  refused(other_scene("material: linear", "material: foam"), "model's material is linear, and this command has foam");
  const auto thicker = other_scene("name:", "name:");
  std::ofstream(folder / "scene/plate.obj", std::ios::app) << "v 0.5 0 0.11\n";
  refused(thicker, "rest shape");
  ASSERT_EQ(palpate(with_contact(spring, {"--contact", "0.52", "0.01", "0.1", "--contact", "0.51", "0", "0.1", "--resume"})), 0) << said;
  EXPECT_EQ(made().pushes.size(), 3u) << "more pushes of the same thing are welcome";
}

TEST_F(Record, TheSameSeedGivesTheSameBytes) {
  // All in one place, then moved: a bag's robot names its meshes by the folder that it was written to.
  const auto record_with = [&](const std::string& name, const std::string& threads) {
    fs::create_directories(path("here"));
    const int code = palpate({"--seed", "7", "--threads", threads, "record", "--object", "cube", "--contact", "0.58", "0", "0.15", "--travel-limit",
                              "0.004", "--unloading-steps", "1", "--views", "3", "-o", path("here/recording"), "--bag", path("here/bag"),
                              "--raw-bag", path("here/raw")});
    fs::rename(path("here"), path(name));
    return code;
  };
  ASSERT_EQ(record_with("one", "1"), 0) << said;
  ASSERT_EQ(record_with("again", "1"), 0) << said;
  ASSERT_EQ(record_with("two", "2"), 0) << said;
  int compared = 0;
  for (const auto& entry : fs::recursive_directory_iterator(path("one"))) {
    if (!entry.is_regular_file()) continue;
    const fs::path file = fs::relative(entry.path(), path("one"));
    for (const std::string other : {"again", "two"}) {
      EXPECT_TRUE(read_file(entry.path()) == read_file(path(other) / file)) << file << ", " << other;
      ++compared;
    }
  }
  EXPECT_GT(compared, 10);
  for (const char* what : {"recording/recording.yaml", "recording.truth.json", "bag/mapping.yaml", "raw/mapping.yaml"})
    EXPECT_TRUE(fs::exists(fs::path(path("one")) / what)) << what;
}

TEST_F(Record, ASlipBeforeAnyLoadIsNoSuccess) {
  const std::vector<std::string> words{"record", "--object", "cube", "--young-modulus", "20000", "--slip-at", "0.002", "--force-step", "20",
                                       "--slip-sideways", "0.001", "--slip-least-force", "0.1", "--contact", "0.6", "0", "0.15",
                                       "-o", path("recording"), "--bag", path("bag")};
  EXPECT_EQ(palpate(words), numbers) << said;
  EXPECT_THAT(said, HasSubstr("before any step under load, so nothing can be estimated from it"));
  EXPECT_THAT(said, Not(HasSubstr("Next: palpate estimate")));
  const Recording slipped = read_recording_unchecked(folder.path() / "recording");
  for (const Step& step : slipped.pushes.at(0).steps) EXPECT_TRUE(step.loads.empty());
  palpate({"info", path("bag")});
  EXPECT_THAT(said, Not(HasSubstr("is not in the bag")));
}

TEST_F(Record, TheReportHasWhatTheProtocolFound) {
  ASSERT_EQ(palpate(with_contact(spring, {"--json", "--bag", path("bag")})), 0) << said;
  const std::size_t begins = said.find("{\n"), ends = said.rfind("\n}") + 2;
  ASSERT_LT(begins, ends);
  const nlohmann::json told = nlohmann::json::parse(said.substr(begins, ends - begins)).at("pushes").at(0);
  EXPECT_EQ(told.at("overshoot_n"), 0);
  EXPECT_NEAR(told.at("contact_m").at(2).get<double>(), 0.1, 1e-3);
  EXPECT_LT(told.at("drift_n").get<double>(), 0.02);
  EXPECT_EQ(told.at("drift_n_s").size(), 3u);
  EXPECT_LT(told.at("changed_share").get<double>(), 2e-4);
}

TEST_F(Record, NobodyListensAndThePushGoesOn) {
  const pid_t child = start(with_contact(PALPATE_PATIENT_ROBOT, {"--json"}));
  ASSERT_TRUE(says("push 1")) << said;
  std::fclose(messages_);  // as `2>&1 | head -1` does
  int status = 0;
  waitpid(child, &status, 0);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << status;
  EXPECT_EQ(made().pushes.at(0).steps.size(), 7u);
  // Started without the streams: messages must not run into the recording's files.
  fs::remove_all(path("recording"));
  const std::string command = std::string("'") + PALPATE_CLI + "' --json record --driver '" + spring + "' --scene '" + scene + "' -o '" +
                              path("recording") + "' --contact 0.5 0 0.1 --force-limit 6 <&- >&- 2>&-";
  ASSERT_EQ(std::system(command.c_str()), 0);
  EXPECT_TRUE(check_recording(made()).empty());
}

TEST_F(Record, OutputsThatCannotBeWrittenAreToldBeforeAnythingMoves) {
  const auto refused = [&](const std::vector<std::string>& words, const std::string& why, int code = input) {
    fs::remove(path("calls"));
    EXPECT_EQ(palpate(words), code) << said;
    EXPECT_THAT(said, HasSubstr(why));
    EXPECT_FALSE(fs::exists(path("calls"))) << why << ": the robot has moved";
    EXPECT_FALSE(fs::exists(path("recording"))) << why;
  };
  refused(with_contact(PALPATE_PATIENT_ROBOT, {"--bag", "/proc/bag"}), "/proc/bag: ");
  refused(with_contact(PALPATE_PATIENT_ROBOT, {"--raw-bag", "/proc/bag"}), "/proc/bag: ");
  refused(with_contact(PALPATE_PATIENT_ROBOT, {"--bag", path("bag"), "--raw-bag", path("bag") + "/"}), "written already", usage);
  refused(with_contact(PALPATE_PATIENT_ROBOT, {"--bag", path("recording")}), "written already", usage);
  const std::vector<std::string> lab{"record", "-o", path("recording"), "--truth"};
  for (const std::string truth : {"/proc/nowhere/truth.json", "/proc"}) {
    std::vector<std::string> words = lab;
    words.push_back(truth);
    refused(words, "/proc");
    words.insert(words.begin() + 1, "--demo");
    refused(words, "/proc");
  }
  std::ofstream(path("file")) << "words\n";
  refused({"record", "-o", path("recording"), "--truth", path("file") + "/truth.json"}, "is a file");
}

TEST_F(Record, APushOutOfReachIsNamedWithItsPlaceAndLeavesNothing) {
  EXPECT_EQ(palpate(record(spring, {"--contact", "0.9", "0", "0.1"})), numbers) << said;
  EXPECT_THAT(said, HasSubstr("push 1: nothing was recorded: the robot refused to move there: a limit, or out of reach"));
  EXPECT_THAT(said, HasSubstr("at (0.9000 0.0000 0.1000) along"));
  EXPECT_THAT(said, HasSubstr("try another contact or direction"));
  EXPECT_EQ(said.find("refused"), said.rfind("refused")) << "once is enough";
  EXPECT_THAT(said, Not(HasSubstr("palpate estimate")));
  EXPECT_FALSE(fs::exists(path("recording"))) << "it would stand in the way of the next try";
  EXPECT_EQ(palpate(record(spring, {"--contact", "0.9", "0", "0.1", "--contact", "0.5", "0", "0.1"})), numbers);
  EXPECT_THAT(said, HasSubstr("palpate estimate"));
  EXPECT_EQ(made().pushes.size(), 1u);
}

TEST_F(Record, WhatIsMistypedIsToldInWords) {
  const auto refused = [&](const std::vector<std::string>& words, const std::string& why, int code = usage) {
    EXPECT_EQ(palpate(words), code) << said;
    EXPECT_THAT(said, HasSubstr(why));
    EXPECT_THAT(said, Not(HasSubstr("Could not convert")));
    EXPECT_FALSE(fs::exists(path("recording"))) << why;
  };
  for (const std::string wrong : {"-1", "abc", "1.5", "18446744073709551616"})
    refused({"--seed", wrong, "record", "-o", path("recording")},
            "--seed: must be a whole number from 0 to 18446744073709551615, is " + wrong);
  refused({"record", "--contact", "0.5", "0", "-o", path("recording"), "--driver", spring},
          "--contact: needs three numbers, X Y Z: where to push, in metres, base frame; `-o` is none");
  refused(record(spring, {"--contact", "0.5", "0"}), "where to push, in metres, base frame");
  refused(record(spring, {"--contact", "0.5", "0", "0.1", "--direction", "0", "down", "1"}), "--direction: needs three numbers");
  refused(record(spring, {"--contact", "0.5", "0", "0.1", "0.2"}), "0.2");
  refused(with_contact(spring, {"--increment", "0.02"}), "(`--increment`)", input);
  refused({"record", "--demo", "--contact-threshold", "1", "-o", path("recording")}, "--contact-threshold");
}

TEST_F(Record, AMistypedSensorIsToldWithItsFile) {
  ASSERT_EQ(palpate(with_contact(spring, {"--unloading-steps", "0"})), 0) << said;
  const std::string file = path("recording") + "/recording.yaml";
  std::string bytes = io::read_file(file);
  const auto at = bytes.find("noise: {model: ");
  ASSERT_NE(at, std::string::npos) << bytes.substr(0, 2000);
  bytes.replace(at, bytes.find_first_of(",}", at) - at, "noise: {model: realsens_d435");
  if (const auto sigma = bytes.find(", sigma_m: ", at); sigma < bytes.find('}', at)) bytes.erase(sigma, bytes.find_first_of(",}", sigma + 1) - sigma);
  io::write_file(file, bytes);
  EXPECT_EQ(palpate({"info", path("recording")}), input);
  EXPECT_THAT(said, HasSubstr("recording.yaml: cameras: noise.model: no noise model is called 'realsens_d435'; did you mean 'realsense_d435'?"));
}

TEST_F(Record, ThresholdsOfThePushAreTheUsers) {
  ASSERT_EQ(palpate(with_contact(spring, {"--unloading-steps", "0", "--contact-std", "0.002", "--increment", "0.001"})), 0) << said;
  const Recording recording = made();
  ASSERT_EQ(recording.pushes.at(0).steps.size(), 5u);  // rest, 2, 4, 6 N, rest
  EXPECT_EQ(recording.pushes[0].steps[1].loads.at(0).contact_std_m, 0.002);
  EXPECT_NEAR(recording.pushes[0].travel_offset_std_m, 0.0005, 1e-5) << "half an increment";
  for (const std::string verb : {"record", "explore"}) {
    ASSERT_EQ(palpate({verb, "--help"}), 0);
    for (const char* option : {"--force-limit FLOAT:POSITIVE=50", "--settling-timeout", "--slip-sideways", "--contact-threshold",
                               "--contact-std", "--increment", "Limits of a push", "A robot of your own"})
      EXPECT_THAT(said, HasSubstr(option)) << verb;
  }
}

TEST_F(Record, ExploreKnowsItsLawBeforeItMoves) {
  const std::vector<std::string> words{"explore", "--driver", PALPATE_PATIENT_ROBOT, "--scene", scene, "-o", path("explored")};
  std::vector<std::string> rubber = words;
  rubber.insert(rubber.end(), {"--law", "rubber"});
  EXPECT_EQ(palpate(rubber), usage) << said;
  EXPECT_THAT(said, HasSubstr("--law: no material is called 'rubber'"));
  EXPECT_FALSE(fs::exists(path("calls")));
  EXPECT_FALSE(fs::exists(path("explored"))) << "the next try finds its folder free";
  folder.put("explored/recording/recording.yaml", "of an earlier run\n");
  EXPECT_EQ(palpate(words), input);
  EXPECT_THAT(said, HasSubstr("choose another folder or remove it"));
}

}  // namespace
}  // namespace palpate::io::record_test
