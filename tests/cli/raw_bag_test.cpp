// label: unit
// SPDX-License-Identifier: Apache-2.0
// What the lab's sensors said all the while, cut into steps again, against what the push protocol recorded itself.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "io/read_back.hpp"
#include "io/recording_folder.hpp"
#include "io/rosbag2_metadata.hpp"

namespace palpate::io {
namespace {

using namespace palpate::io::test;

class RawBag : public testing::TestWithParam<const char*> {};

TEST_P(RawBag, GivesTheStepsOfTheProtocol) {
  if (std::string(PALPATE_CLI).empty()) GTEST_SKIP() << "the command line program is not built";
  const TemporaryFolder folder("raw_bag");
  const std::string base = folder.path().string();
  const std::string command = std::string("'") + PALPATE_CLI + "' --quiet record -o '" + base +
                              "/folder' --raw-bag '" + base + "/raw' " + GetParam() + " 2> '" + base + "/err'";
  ASSERT_EQ(std::system(command.c_str()), 0) << folder.get("err");
  const Recording protocol = read_recording(folder.path() / "folder");
  BagMapping mapping = read_mapping(folder.path() / "raw/mapping.yaml");
  const MessageSource bag = read_bag(folder.path() / "raw");
  EXPECT_TRUE(bag.warnings.empty()) << bag.warnings.front();
  EXPECT_EQ(rosbag2_metadata(folder.path() / "raw").messages, bag.messages.size());
  const SensorStreams streams = read_streams(bag, mapping);
  const Recording found = acquisition::recording_from(mapping.plan, streams).recording;
  EXPECT_TRUE(check_recording(found).empty());
  ASSERT_EQ(found.pushes.size(), protocol.pushes.size());
  // The protocol records steps that are hardly above the threshold of contact, 0.3 N; whether they are found is chance.
  const auto pressed = [](const Recording& recording) {
    std::vector<const Step*> out;
    for (const Push& push : recording.pushes)
      for (const Step& step : push.steps)
        if (!step.loads.empty() && step.loads[0].force_n->norm() > 0.4) out.push_back(&step);
    return out;
  };
  const std::vector<const Step*> expected = pressed(protocol), steps = pressed(found);
  ASSERT_GE(expected.size(), 3u);
  ASSERT_EQ(steps.size(), expected.size());
  const auto travel_of = [](const Step& step) {
    for (const Observation& one : step.observations)
      if (const auto* travel = std::get_if<ToolTravel>(&one)) return travel->travel_m;
    return std::nan("");
  };
  for (std::size_t i = 0; i < steps.size(); ++i) {
    // The sensor's noise is 0.05 N: means over 0.5 s of 50 Hz and tares over a second differ by a few hundredths.
    EXPECT_LT((*steps[i]->loads[0].force_n - *expected[i]->loads[0].force_n).norm(), 0.06) << i;
    // The protocol traces contact back to zero force, the bag's steps start where the force leaves its noise: up to three
    // increments of 0.5 mm later.
    EXPECT_LT((steps[i]->loads[0].contact_m - expected[i]->loads[0].contact_m).norm(), 0.0016);
    EXPECT_NEAR(travel_of(*steps[i]), travel_of(*expected[i]), 0.0016);
    EXPECT_EQ(steps[i]->unloading, expected[i]->unloading);
    bool seen = false;
    for (const Observation& one : steps[i]->observations) seen |= std::holds_alternative<DepthFrame>(one);
    EXPECT_TRUE(seen);
  }
}

/// The ball is so soft under the pad that its force leaves the noise over half a second.
INSTANTIATE_TEST_SUITE_P(Objects, RawBag,
                         testing::Values("--seed 5 --young-modulus 20000 --force-limit 5", "--seed 3 --object ball --travel-limit 0.006"),
                         [](const auto& one) { return one.index == 0 ? "cube" : "ball"; });

}  // namespace
}  // namespace palpate::io
