// label: unit
// SPDX-License-Identifier: Apache-2.0
// The frame of the command line, seen from outside as a user and a script see it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "palpate/fem/materials.hpp"
#include "said_by.hpp"
#include "temporary_folder.hpp"

namespace command_line_test {
namespace {

using palpate::test::Said;
using palpate::test::said_by;
using palpate::test::TemporaryFolder;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

struct Outcome {
  int exit_code = -1;
  std::string out, err;
};

Outcome palpate(const std::string& arguments) {
  const TemporaryFolder files("command_line");
  const auto errors = files / "stderr";
  const Said said = said_by(std::string(PALPATE_CLI) + " " + arguments + " 2>" + errors.string());
  std::ifstream file(errors);
  std::stringstream text;
  text << file.rdbuf();
  std::filesystem::remove(errors);
  return {said.exit_code, said.text, text.str()};
}

std::vector<std::string> verbs() {
  std::vector<std::string> names;
  std::istringstream lines(palpate("--help").out);
  bool in_table = false;
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("Options:")) continue;
    if (!line.empty() && !line.starts_with(' ') && line.ends_with(':')) in_table = true;
    if (in_table && line.starts_with("  ") && line[2] != ' ') names.push_back(line.substr(2, line.find(' ', 2) - 2));
  }
  return names;
}

TEST(CommandLine, NewcomerIsToldThreeThingsToTry) {
  const Outcome outcome = palpate("");
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_THAT(outcome.err, HasSubstr("palpate demo"));
  EXPECT_THAT(outcome.err, HasSubstr("palpate info"));
  EXPECT_THAT(outcome.err, HasSubstr("palpate estimate"));
  EXPECT_THAT(outcome.out, IsEmpty());
}

// docs/recording-format.md sends people there.
TEST(CommandLine, HelpOfEstimateListsEveryLaw) {
  const std::string help = palpate("estimate --help").out;
  for (const palpate::fem::MaterialLaw* law : palpate::fem::material_table()) EXPECT_THAT(help, HasSubstr(std::string(law->name()))) << law->name();
}

TEST(CommandLine, MistypedVerbGetsSuggestionAndUsageCode) {
  const Outcome outcome = palpate("docter");
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("Did you mean `doctor`?"));
}

// The library names the field that is wrong; the program knows which option sets it.
TEST(CommandLine, OptionThatCuresIsNamed) {
  const TemporaryFolder files("cure");
  const std::string out = " -o " + (files / "out").string();
  EXPECT_THAT(palpate("record --object ball --wall" + out).err, HasSubstr("let it stand rough (`--stands rough`)"));
  std::ofstream(files / "small.obj") << "v 0 0 0\nv 0.01 0 0\nv 0 0.01 0\nv 0 0 0.01\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";
  const Outcome small = palpate("record --object " + (files / "small.obj").string() + out);
  EXPECT_EQ(small.exit_code, 3);
  EXPECT_THAT(small.err, HasSubstr("(`--object-size`)"));
}

TEST(CommandLine, MistypedOptionGetsSuggestionAndUsageCode) {
  const Outcome outcome = palpate("doctor --treads 2");
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("Did you mean `--threads`?"));
}

TEST(CommandLine, OptionsThatWouldHaveNoSayAreRefused) {
  for (const char* wrong : {"record --demo --object ball -o nowhere", "record --demo --force-limit 3 -o nowhere",
                            "record --demo --resume -o nowhere", "record --driver x.so --object ball -o nowhere",
                            "suggest nowhere --direction 0 0 -1", "estimate nowhere -o out --young-modulus-start -5"}) {
    const Outcome outcome = palpate(wrong);
    EXPECT_EQ(outcome.exit_code, 2) << wrong;
    EXPECT_THAT(outcome.err, HasSubstr("--")) << wrong;
  }
}

TEST(CommandLine, FarFetchedWordGetsNoSuggestion) {
  const Outcome outcome = palpate("xylophone");
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, Not(HasSubstr("Did you mean")));
}

TEST(CommandLine, WrongUsageAnswersAProgramInJson) {
  const Outcome outcome = palpate("doctor --nonsense --json");
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.out, HasSubstr("\"exit_code\": 2"));
  EXPECT_THAT(outcome.out, HasSubstr("\"kind\": \"usage\""));
}

TEST(CommandLine, DoctorJsonIsOneObjectAndQuietSilencesPeoplesText) {
  const Outcome outcome = palpate("--quiet doctor --json");
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_TRUE(outcome.out.starts_with("{"));
  EXPECT_THAT(outcome.out, HasSubstr("\"healthy\": true"));
  EXPECT_THAT(outcome.err, IsEmpty());
}

TEST(CommandLine, DoctorFailsWithCureWhereNothingCanBeWritten) {
  const std::string command =
      "cd /proc && " + std::string(PALPATE_CLI) + " doctor 2>&1 >/dev/null | grep -A1 'FAILED  current' | grep -q -- '->'";
  EXPECT_EQ(std::system(command.c_str()), 0);
  const int status = std::system(("cd /proc && " + std::string(PALPATE_CLI) + " doctor --quiet").c_str());
  EXPECT_EQ(WEXITSTATUS(status), 1);
}

TEST(CommandLine, EveryVerbsHelpEndsWithAnExampleThatNamesIt) {
  const std::vector<std::string> names = verbs();
  ASSERT_GE(names.size(), 2u);
  for (const std::string& name : names) {
    const Outcome outcome = palpate(name + " --help");
    EXPECT_EQ(outcome.exit_code, 0) << name;
    const std::size_t example = outcome.out.rfind("Example:");
    ASSERT_NE(example, std::string::npos) << name;
    EXPECT_THAT(outcome.out.substr(example), HasSubstr("palpate " + name));
  }
}

TEST(CommandLine, EveryVerbTakesJsonAndAnswersWrongUsageInIt) {
  for (const std::string& name : verbs()) {
    const Outcome outcome = palpate(name + " --json --no-such-option");
    EXPECT_EQ(outcome.exit_code, 2) << name;
    EXPECT_TRUE(outcome.out.starts_with("{")) << name;
    EXPECT_THAT(outcome.out, HasSubstr("no such option")) << name;
  }
}

TEST(CommandLine, ProgressIsQuietLinesWhereThereIsNoTerminal) {
  const TemporaryFolder files("quiet_lines");
  const auto folder = files / "out";
  const Outcome outcome = palpate("record --demo -o " + folder.string());
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_THAT(outcome.err, HasSubstr("pressing the object ...\n"));
  EXPECT_THAT(outcome.err, Not(HasSubstr("\r")));
  EXPECT_THAT(outcome.err, Not(HasSubstr("%")));
  std::filesystem::remove_all(folder);
  EXPECT_THAT(palpate("record --demo --quiet -o " + folder.string()).err, IsEmpty());
  std::filesystem::remove_all(folder);
}

TEST(CommandLine, ProgressOnATerminalSaysStageAndShare) {
  if (std::system("script -qec true /dev/null >/dev/null 2>&1") != 0)
    GTEST_SKIP() << "no script(1), or no pseudo-terminals (/dev/pts): there is no terminal to show it on";
  const TemporaryFolder files("on_a_terminal");
  const auto folder = files / "out";
  const std::string seen = said_by("script -qec '" + std::string(PALPATE_CLI) + " record --demo -o " + folder.string() + "' /dev/null").text;
  EXPECT_THAT(seen, testing::ContainsRegex("pressing the object +[0-9]+ %"));
  EXPECT_THAT(seen, HasSubstr("\r"));
  std::filesystem::remove_all(folder);
}

TEST(CommandLine, BashCompletionOffersVerbsAndTheirOptions) {
  const TemporaryFolder files("completion");
  const auto script = files / "palpate.bash";
  ASSERT_EQ(palpate("completion bash > " + script.string()).exit_code, 0);
  const auto complete = [&](const std::string& words, int at) {
    return said_by("bash -c '. " + script.string() + "; COMP_WORDS=(" + words + "); COMP_CWORD=" + std::to_string(at) + "; _palpate; echo ${COMPREPLY[@]}'").text;
  };
  EXPECT_THAT(complete("palpate doc", 1), HasSubstr("doctor"));
  EXPECT_THAT(complete("palpate doctor --th", 2), HasSubstr("--threads"));
}

TEST(CommandLine, ZshAndFishCompletionNameEveryVerb) {
  for (const std::string shell : {"zsh", "fish"}) {
    const Outcome outcome = palpate("completion " + shell);
    EXPECT_EQ(outcome.exit_code, 0);
    for (const std::string& name : verbs()) EXPECT_THAT(outcome.out, HasSubstr(name)) << shell;
  }
}

TEST(CommandLine, VersionIsTheProjects) {
  const Outcome outcome = palpate("--version");
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_THAT(outcome.out, HasSubstr("palpate 0."));
}

}  // namespace
}  // namespace command_line_test
