// label: unit
// SPDX-License-Identifier: Apache-2.0
// What a program gets of a path: a recording in a folder or a bag, checked, or the reason why not.
#include "palpate/load_recording.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/made_up_recording.hpp"
#include "io/recording_folder.hpp"
#include "palpate/core/error.hpp"
#include "palpate/io/bag_write.hpp"
#include "palpate/io/recording.hpp"

namespace palpate::load_recording_test {
namespace {

using namespace io::test;
using testing::HasSubstr;

std::string refusal(const std::filesystem::path& path, const std::filesystem::path& mapping = {}) {
  try {
    load_recording(path, mapping);
  } catch (const Error& error) {
    return error.what();
  }
  return "was accepted";
}

TEST(LoadRecording, AFolderAndABagOfTheSamePushesAreTheSame) {
  const TemporaryFolder folder("load");
  const Recording made = made_up();
  io::write_recording(made, folder.path() / "folder");
  io::write_bag(made, folder.path() / "bag");
  const LoadedRecording of_folder = load_recording(folder.path() / "folder"), of_bag = load_recording(folder.path() / "bag");
  ASSERT_EQ(of_folder.recording.pushes.size(), made.pushes.size());
  ASSERT_EQ(of_bag.recording.pushes.size(), made.pushes.size());
  EXPECT_TRUE(of_folder.clocks.empty());
  for (std::size_t p = 0; p < made.pushes.size(); ++p) {
    ASSERT_EQ(of_bag.recording.pushes[p].steps.size(), made.pushes[p].steps.size());
    for (std::size_t s = 0; s < made.pushes[p].steps.size(); ++s)
      for (std::size_t l = 0; l < made.pushes[p].steps[s].loads.size(); ++l)
        for (const LoadedRecording* loaded : {&of_folder, &of_bag})
          EXPECT_LT((*loaded->recording.pushes[p].steps[s].loads[l].force_n - *made.pushes[p].steps[s].loads[l].force_n).norm(), 1e-12);
  }
}

TEST(LoadRecording, IsCheckedWhenThatIsAskedFor) {
  const TemporaryFolder folder("load_checked");
  put_cube_recording(folder);
  Recording recording = load_recording(folder.path()).recording;
  EXPECT_NO_THROW(check_loaded(recording));
  recording.pushes.at(0).steps.at(0).loads.at(0).tool = "nobody's";
  try {
    check_loaded(recording, "a list");
    ADD_FAILURE() << "was accepted";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("nobody's"));
  }
}

TEST(LoadRecording, SaysWhyNot) {
  const TemporaryFolder folder("load_not");
  io::write_bag(made_up(), folder.path() / "bag");
  EXPECT_THAT(refusal(folder.path() / "nowhere"), HasSubstr("no such file or folder"));
  EXPECT_THAT(refusal({}), HasSubstr("no such file or folder"));
  const std::filesystem::path mapping = mapping_of(folder.path() / "bag");
  ASSERT_FALSE(mapping.empty());
  const std::filesystem::path other = mapping.parent_path() / "other.yaml";
  std::filesystem::rename(mapping, other);
  EXPECT_TRUE(mapping_of(folder.path() / "bag").empty());
  EXPECT_THAT(refusal(folder.path() / "bag"), HasSubstr("say what its topics mean"));
  EXPECT_NO_THROW(load_recording(folder.path() / "bag", other));
  Recording wrong = made_up();
  for (Push& push : wrong.pushes)
    for (Step& step : push.steps)
      for (Observation& one : step.observations)
        if (auto* frame = std::get_if<DepthFrame>(&one)) frame->noise.model = "realsense_d453";
  io::write_recording(wrong, folder.path() / "folder");
  EXPECT_THAT(refusal(folder.path() / "folder"), HasSubstr("did you mean 'realsense_d435'?"));
}

}  // namespace
}  // namespace palpate::load_recording_test
