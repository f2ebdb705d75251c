// label: unit
// SPDX-License-Identifier: Apache-2.0
// Paths that are not what a verb needs: exit code 3 at once, and a sentence that names the cure.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

#include "temporary_folder.hpp"

namespace paths_test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class Paths : public testing::Test {
 protected:
  void SetUp() override {
    fs::create_directories(folder_ / "empty");
    std::ofstream(folder_ / "file") << "not empty\n";
    std::ofstream(folder_ / "cube.obj") << "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
    std::ofstream(folder_ / "result.json") << "{}";
  }

  /// What the program says on stderr; `code_` is how it ended.
  std::string say(const std::string& arguments) {
    const fs::path said = folder_ / "said";
    const std::string command = "cd " + folder_.string() + " && " + PALPATE_CLI + " " + arguments + " >" +
                                (folder_ / "out.json").string() + " 2>" + said.string();
    const int status = std::system(command.c_str());
    code_ = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    std::stringstream text;
    text << std::ifstream(said).rdbuf();
    return text.str();
  }

  const palpate::test::TemporaryFolder files_{"paths"};
  const fs::path folder_ = files_.path();
  int code_ = -1;
};

TEST_F(Paths, MissingInputsAreSaidWithWhatIsWanted) {
  for (const std::string verb : {"estimate /nonexistent -o new", "info /nonexistent", "suggest /nonexistent"}) {
    const std::string said = say(verb);
    EXPECT_EQ(code_, 3) << verb;
    EXPECT_THAT(said, HasSubstr("/nonexistent: there is no such file or folder")) << verb;
    EXPECT_THAT(said, HasSubstr("a recording is a folder with recording.yaml in it")) << verb;
  }
  for (const std::string verb : {"report /nonexistent", "predict /nonexistent --contact 0 0 0 --force 1",
                                 "export /nonexistent --to calculix -o new"}) {
    EXPECT_THAT(say(verb), HasSubstr("give the folder that `palpate estimate")) << verb;
    EXPECT_EQ(code_, 3) << verb;
  }
  EXPECT_THAT(say("model /nonexistent.obj -o new"), HasSubstr("give a mesh file, or the folder of a recording"));
  EXPECT_EQ(code_, 3);
  EXPECT_FALSE(fs::exists(folder_ / "new")) << "a run that could not begin left a folder behind";
}

TEST_F(Paths, MistypedNamesAreGuessed) {
  EXPECT_THAT(say("info emtpy"), HasSubstr("Did you mean `empty`?"));
  EXPECT_THAT(say("model " + (folder_ / "cub.obj").string() + " -o new"),
              HasSubstr("Did you mean `" + (folder_ / "cube.obj").string() + "`?"));
  EXPECT_THAT(say("info xyzzy"), testing::Not(HasSubstr("Did you mean")));
}

TEST_F(Paths, FoldersAndFilesInEachOthersPlaceAreSaid) {
  EXPECT_THAT(say("info empty"), HasSubstr("holds no recording.yaml"));
  EXPECT_EQ(code_, 3);
  EXPECT_THAT(say("predict empty/ --contact 0 0 0 --force 1"),
              HasSubstr("is not a whole result"));  // OUT beside: its result
  EXPECT_EQ(code_, 3);
  fs::remove(folder_ / "result.json");
  EXPECT_THAT(say("predict empty --contact 0 0 0 --force 1"), HasSubstr("holds no result.json; give the folder that"));
  EXPECT_EQ(code_, 3);
  EXPECT_THAT(say("report file"), HasSubstr("no report of palpate"));
  EXPECT_EQ(code_, 3);
}

TEST_F(Paths, OutputsThatCannotBeWrittenAreRefusedBeforeTheWorkBegins) {
  // The recording is not even looked for: an hour of fitting must not end at a closed door.
  for (const std::string verb : {"estimate /nonexistent -o file", "estimate /nonexistent -o file/below",
                                 "record --demo -o file", "explore -o file", "demo -o file", "model cube.obj -o file"}) {
    const std::string said = say(verb);
    EXPECT_EQ(code_, 3) << verb << said;
    EXPECT_THAT(said, HasSubstr("is a file, so nothing can be written into it; give the name of a folder")) << verb;
  }
  say("estimate /nonexistent -o /proc/palpate");
  EXPECT_EQ(code_, 3);
  if (geteuid() != 0) {
    EXPECT_THAT(say("estimate /nonexistent -o /usr/palpate"), HasSubstr("may not be written by you"));
  }
}

// What `estimate` writes replaces model/ and fit/: a recording in there would be gone.
TEST_F(Paths, ARecordingIsNotOverwrittenByItsResult) {
  fs::create_directories(folder_ / "bear" / "model");
  std::ofstream(folder_ / "bear" / "model" / "recording.yaml") << "format: palpate-recording/1\n";
  for (const std::string out : {"bear", "bear/", "bear/model"}) {
    EXPECT_THAT(say("estimate bear/model -o " + out), HasSubstr("would be overwritten")) << out;
    EXPECT_EQ(code_, 3);
  }
  EXPECT_TRUE(fs::is_regular_file(folder_ / "bear" / "model" / "recording.yaml"));
  EXPECT_FALSE(fs::exists(folder_ / "bear" / "fit"));
}

TEST_F(Paths, APlaceWhereNothingCanBeMadeIsToldBeforeTheWork) {
  EXPECT_THAT(say("estimate /nonexistent -o /proc/nowhere/out"), testing::AnyOf(HasSubstr("cannot be made"), HasSubstr("may not be written")));
  EXPECT_EQ(code_, 3);
  say("estimate /nonexistent -o new/deep");
  EXPECT_FALSE(std::filesystem::exists(folder_ / "new")) << "nothing is left of the trial";
  std::ofstream(folder_ / "taken") << "words";
  EXPECT_THAT(say("paper --quick -o " + (folder_ / "taken").string()), HasSubstr("is a file"));
  EXPECT_EQ(code_, 3);
}

TEST_F(Paths, ErrorsAreJsonForPrograms) {
  say("estimate /nonexistent -o new --json");
  const auto said = nlohmann::json::parse(std::ifstream(folder_ / "out.json"));
  EXPECT_EQ(said["exit_code"], 3);
  EXPECT_EQ(said["error"]["where"], "/nonexistent");
  EXPECT_EQ(said["error"]["kind"], "input");
}

TEST_F(Paths, MistypedMaterialIsGuessedBeforeAnythingIsRead) {
  EXPECT_THAT(say("estimate /nonexistent -o new --material neo_hokean"), HasSubstr("did you mean 'neo_hookean'?"));
  EXPECT_EQ(code_, 2);
}

TEST_F(Paths, PortThatIsTakenIsSaidBeforeAnythingIsRead) {
  // A port below 1024 or one in use: both have a cure in the sentence. Port 0 is always free.
  const std::string said = say("estimate /nonexistent -o new --serve 0 --quiet");
  EXPECT_THAT(said, HasSubstr("live view          http://127.0.0.1:"));  // was asked for, so also with --quiet
  EXPECT_THAT(say("estimate /nonexistent -o new --serve 70000"), HasSubstr("--serve"));
  EXPECT_EQ(code_, 2);
  EXPECT_THAT(say("estimate /nonexistent -o new --serve 0 --serve-address here"), HasSubstr("give numbers as in 127.0.0.1"));
  EXPECT_EQ(code_, 3);
}

}  // namespace
}  // namespace paths_test
