// label: unit
// SPDX-License-Identifier: Apache-2.0
// `palpate demo` removes what it wrote itself, and nothing else: not a recording of somebody else's that has the same name.
#include "cli/demo_mark.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "palpate/core/error.hpp"
#include "temporary_folder.hpp"

namespace palpate::cli::demo_mark_test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class DemoMark : public testing::Test {
 protected:
  void put(const std::string& file, const std::string& text) const {
    fs::create_directories((out / file).parent_path());
    std::ofstream(out / file) << text;
  }
  /// What a demonstration leaves.
  void demonstrate() const {
    fs::create_directories(out);
    mark_demo(out);
    put("recording/recording.yaml", "name: foam_cube\n");
    put("recording/depth/step_0001.png", "pixels");
    put("truth.json", "{}");
    mark_demo(out);
    put("result.json", "{}");  // made anew by whoever estimates
  }
  std::string refusal() const {
    try {
      must_take_demo(out);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }
  const test::TemporaryFolder folder{"demo_mark"};
  const fs::path out = folder.path() / "out";
};

TEST_F(DemoMark, TakesWhatIsNotThereOrEmptyOrItsOwn) {
  EXPECT_EQ(refusal(), "");
  fs::create_directories(out);
  EXPECT_EQ(refusal(), "");
  demonstrate();
  EXPECT_EQ(refusal(), "");
  put("notes.txt", "a user's own, which no demonstration touches");
  EXPECT_EQ(refusal(), "");
}

TEST_F(DemoMark, LeavesAloneWhatExploreOrAUserWrote) {
  put("recording/recording.yaml", "name: foam_cube\n");
  put("truth.json", "{}");
  EXPECT_THAT(refusal(), HasSubstr("choose another folder"));
  put("demo.json", "{}");
  EXPECT_THAT(refusal(), HasSubstr("choose another folder")) << "a file of that name is no mark";
  put("demo.json", "no json");
  EXPECT_THAT(refusal(), HasSubstr("choose another folder"));
}

TEST_F(DemoMark, LeavesAloneWhatWasPutInOrChangedSince) {
  demonstrate();
  put("recording/push003_step0001_1.png", "a push that a user added");
  EXPECT_THAT(refusal(), HasSubstr("push003_step0001_1.png: is not as `palpate demo` wrote it"));
  fs::remove(out / "recording/push003_step0001_1.png");
  EXPECT_EQ(refusal(), "");
  put("recording/recording.yaml", "name: mine\n");
  EXPECT_THAT(refusal(), HasSubstr("recording.yaml"));
  fs::remove_all(out / "recording");
  EXPECT_EQ(refusal(), "") << "what is gone is not missed";
  fs::create_directory_symlink(folder.path(), out / "recording");
  EXPECT_THAT(refusal(), HasSubstr("recording"));
}

}  // namespace
}  // namespace palpate::cli::demo_mark_test
