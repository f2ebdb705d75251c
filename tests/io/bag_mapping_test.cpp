// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/bag_mapping.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/bag_files.hpp"
#include "io/made_up_recording.hpp"
#include "io/read_back.hpp"
#include "palpate/core/error.hpp"
#include "palpate/io/bag_survey.hpp"
#include "palpate/io/bag_write.hpp"

namespace palpate::io {
namespace {

using namespace palpate::io::test;
using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;

class Mapping : public testing::Test {
 protected:
  void SetUp() override {
    write_bag(made_up(), folder.path() / "bag");
    text = folder.get("bag/mapping.yaml");
  }
  /// What is said when the mapping is changed in one place.
  std::string complaint(const std::string& from, const std::string& to) {
    EXPECT_NE(text.find(from), std::string::npos) << from;
    std::string changed = text;
    changed.replace(changed.find(from), from.size(), to);
    folder.put("bag/mapping.yaml", changed);
    try {
      read_back(folder.path() / "bag");
    } catch (const Error& error) {
      return error.what();
    }
    return "nothing";
  }
  TemporaryFolder folder{"bag_mapping"};
  std::string text;
};

TEST_F(Mapping, ErrorsNameFileLineFieldAndCure) {
  const struct {
    const char *from, *to;
    std::vector<const char*> said;
  } cases[] = {
      {"palpate-mapping/1", "palpate-mapping/9", {"mapping.yaml:1: format", "palpate-mapping/1"}},
      {"frames: {base", "framse: {base", {"key 'frames' is missing", "is 'framse' in line"}},
      {"frames: {base: base", "frames: {bse: base", {"key 'base' is missing", "frames"}},
      {"wrench: /wrench", "wrench: /wrenhc", {"topics.wrench", "no topic '/wrenhc'", "did you mean '/wrench'"}},
      {"wrench: /wrench", "wrench: wrench", {"topics.wrench", "starts with '/'"}},
      {"wrench: /wrench", "wrench: /tf", {"topics.wrench", "tf2_msgs/msg/TFMessage", "geometry_msgs/msg/WrenchStamped"}},
      {"image: /camera_1/depth/image",
       "image: /camera_1/depth/imge",
       {"topics.depth[0].image", "did you mean '/camera_1/depth/image'"}},
      {"force_on_object", "force_on_objct", {"wrench.reports", "did you mean 'force_on_object'"}},
      {"tare: none", "tare: {from_s: 2, to_s: 1}", {"wrench.tare.to_s", "later"}},
      {"by: marks", "by: mark", {"steps.by", "did you mean 'marks'"}},
      {"by: marks", "by: times", {"steps.pushes[0]", "at_s"}},
      {"marks: /palpate/marks", "joints: /tf", {"steps.by", "topics.marks"}},
      {"window_s: 0.03", "window_s: -1", {"steps.window_s", "larger than 0"}},
      {"window_s: 0.03", "windw_s: 0.03", {"steps.windw_s", "did you mean 'window_s'"}},
      {"tool: \"stick\"", "tool: \"stik\"", {"steps.pushes[0].tool", "did you mean 'stick'"}},
      {"tip: tip", "tip: tcp", {"frames", "'tcp'", "is not connected", "camera_1"}},
      {"rest.vtu", "rst.vtu", {"rest.volume_mesh", "rst.vtu"}},
  };
  for (const auto& one : cases) {
    const std::string said = complaint(one.from, one.to);
    for (const char* part : one.said) EXPECT_THAT(said, HasSubstr(part)) << one.from << " -> " << one.to;
  }
}

/// The same messages in another container.
TEST_F(Mapping, ADatabaseGivesTheSameRecording) {
  const MessageSource bag = read_bag(folder.path() / "bag");
  std::vector<TestMessage> messages;
  for (const Message& one : bag.messages)
    messages.push_back({bag.topics[one.topic].name, bag.topics[one.topic].type, one.log_time_ns, std::string(one.data)});
  std::reverse(messages.begin(), messages.end());
  BagMapping mapping = read_mapping(folder.path() / "bag/mapping.yaml");
  const SensorStreams streams = read_streams(parse_bag(sqlite_bytes(messages), "b.db3"), mapping);
  const Recording a = read_back(folder.path() / "bag"), b = acquisition::recording_from(mapping.plan, streams).recording;
  ASSERT_EQ(a.pushes.size(), b.pushes.size());
  for (std::size_t p = 0; p < a.pushes.size(); ++p) {
    ASSERT_EQ(a.pushes[p].steps.size(), b.pushes[p].steps.size());
    for (std::size_t i = 0; i < a.pushes[p].steps.size(); ++i) {
      const Step &x = a.pushes[p].steps[i], &y = b.pushes[p].steps[i];
      EXPECT_EQ(x.time_s, y.time_s);
      ASSERT_EQ(x.observations.size(), y.observations.size());
      if (!x.loads.empty()) {
        EXPECT_EQ(*x.loads[0].force_n, *y.loads[0].force_n);
      }
    }
  }
}

TEST_F(Mapping, ADamagedMessageIsLeftOutWithAWord) {
  const MessageSource bag = read_bag(folder.path() / "bag");
  MessageSource hurt = bag;
  for (Message& one : hurt.messages) {
    if (hurt.topics[one.topic].name != "/wrench") continue;
    one.data = one.data.substr(0, 9);
    break;
  }
  BagMapping mapping = read_mapping(folder.path() / "bag/mapping.yaml");
  const SensorStreams streams = read_streams(hurt, mapping);
  EXPECT_THAT(streams.warnings, Contains(AllOf(HasSubstr("1 of 12"), HasSubstr("/wrench"))));
}

TEST_F(Mapping, StampsOfASimulationAreBroughtToTheRecordersClock) {
  MessageSource late = read_bag(folder.path() / "bag");
  for (Message& one : late.messages) one.log_time_ns += 1'700'000'000'000'000'000;
  BagMapping mapping = read_mapping(folder.path() / "bag/mapping.yaml");
  const SensorStreams streams = read_streams(late, mapping);
  EXPECT_THAT(streams.warnings, Contains(HasSubstr("differ by")));
  const Recording back = acquisition::recording_from(mapping.plan, streams).recording;
  EXPECT_EQ(back.pushes[0].steps[1].loads.size(), 1u);
  EXPECT_NEAR(back.pushes[0].steps[1].loads[0].force_n->z(), -1.7, 1e-12);
}

TEST_F(Mapping, ASurveySuggestsAMappingThatNamesWhatIsThere) {
  const BagSurvey found = survey(read_bag(folder.path() / "bag"));
  EXPECT_TRUE(found.missing.empty()) << found.missing.front();
  for (const char* part :
       {"wrench: /wrench", "image: /camera_1/depth/image, info: /camera_1/depth/camera_info", "base: base, tip: tip"})
    EXPECT_THAT(found.mapping, HasSubstr(part));
  // Filled in, it is a mapping.
  std::string filled = found.mapping;
  const std::string mesh = "FILL_IN.stl";
  filled.replace(filled.find("surface_mesh: " + mesh), 14 + mesh.size(), "volume_mesh: rest.vtu");
  folder.put("bag/filled.yaml", filled);
  EXPECT_NO_THROW(read_mapping(folder.path() / "bag/filled.yaml"));
}

TEST(Survey, SaysWhatIsMissing) {
  const MessageSource empty = parse_bag(mcap_bytes({}, McapWriter::Compression::none), "a");
  const BagSurvey found = survey(empty);
  EXPECT_THAT(found.missing, Contains(HasSubstr("no force")));
  EXPECT_THAT(found.missing, Contains(HasSubstr("/tf")));
  EXPECT_THAT(found.missing, Contains(HasSubstr("depth image")));
  EXPECT_THAT(found.mapping, HasSubstr("wrench: FILL_IN"));
}

}  // namespace
}  // namespace palpate::io
