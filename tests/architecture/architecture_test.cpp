// label: unit
// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "architecture/rules.hpp"

namespace architecture_test {
namespace {

namespace fs = std::filesystem;
using architecture::Table;
using architecture::violations;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

const fs::path root = PALPATE_SOURCE_DIR;

std::string contents(const fs::path& path) {
  std::ifstream file(path);
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

Table the_table() { return architecture::read_table(contents(root / "docs/architecture.md")); }

std::vector<fs::path> sources_below(const fs::path& folder) {
  std::vector<fs::path> files;
  if (!fs::exists(folder)) return files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    const std::string extension = entry.path().extension().string();
    if (extension == ".hpp" || extension == ".cpp" || extension == ".h") files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

TEST(Architecture, TableNamesEveryRoomAndHasNoCycle) {
  const Table table = the_table();
  for (const auto& entry : fs::directory_iterator(root / "palpate")) {
    if (entry.is_directory()) {
      EXPECT_TRUE(table.contains(entry.path().filename().string())) << entry.path();
    }
  }
  EXPECT_THAT(architecture::rooms_on_a_cycle(table), IsEmpty());
}

TEST(Architecture, NoRoomForOddsAndEnds) {
  for (const char* folder : {"palpate", "cli", "tests", "python"}) {
    if (!fs::exists(root / folder)) continue;
    for (auto entry = fs::recursive_directory_iterator(root / folder); entry != fs::recursive_directory_iterator(); ++entry) {
      const std::string name = entry->path().stem().string();
      if (name == "node_modules") entry.disable_recursion_pending();  // other people's, fetched for a test
      for (const char* drawer : {"utils", "util", "utilities", "common", "helpers", "helper", "misc"}) {
        EXPECT_NE(name, drawer) << entry->path();
      }
    }
  }
}

TEST(Architecture, EveryFileObeysTheTable) {
  const Table table = the_table();
  std::size_t files = 0;
  for (const char* folder : {"palpate", "cli", "python"}) {
    for (const fs::path& path : sources_below(root / folder)) {
      ++files;
      for (const std::string& violation : violations(fs::relative(path, root).generic_string(), contents(path), table)) {
        ADD_FAILURE() << violation;
      }
    }
  }
  EXPECT_GT(files, 10u);
}

// The rules themselves, on made-up files: each must be able to fail.
const std::string spdx = "// SPDX-License-Identifier: Apache-2.0\n";

TEST(ArchitectureRules, UpwardArrowIsFound) {
  const Table table = the_table();
  EXPECT_THAT(violations("palpate/fem/a.cpp", spdx + "#include \"palpate/estimation/fit.hpp\"\n", table),
              ElementsAre(HasSubstr("arrow fem -> estimation")));
  EXPECT_THAT(violations("palpate/core/a.hpp", spdx + "#include \"palpate/geometry/x.hpp\"\n", table), SizeIs(1));
  EXPECT_THAT(violations("palpate/estimation/a.cpp", spdx + "#include \"palpate/identify.hpp\"\n", table), SizeIs(1));
  EXPECT_THAT(violations("palpate/fem/a.cpp", spdx + "#include \"palpate/geometry/x.hpp\"\n", table), IsEmpty());
}

TEST(ArchitectureRules, FilesPrintingClocksAndAbortAreFound) {
  const Table table = the_table();
  for (const char* line : {"#include <iostream>", "#include <fstream>", "#include <cstdio>", "#include <filesystem>",
                           "void f() { std::printf(\"x\"); }", "void f() { abort(); }", "void f() { assert(1); }",
                           "auto t = std::chrono::steady_clock::now();", "auto e = std::getenv(\"HOME\");",
                           "std::random_device r;", "void f() { fmt::print(\"x\"); }",
                           "#include <sys/stat.h>", "void* f() { return mmap(0, 1, 1, 2, 3, 0); }"}) {
    EXPECT_THAT(violations("palpate/fem/a.cpp", spdx + line + "\n", table), SizeIs(testing::Ge(1u))) << line;
    EXPECT_THAT(violations("cli/a.cpp", spdx + line + "\n", table), IsEmpty()) << line;
  }
  EXPECT_THAT(violations("palpate/fem/a.cpp", spdx + "#include <sys/mman.h>\n", table), IsEmpty());
  EXPECT_THAT(violations("palpate/io/a.cpp", spdx + "#include <fstream>\n", table), IsEmpty());
  EXPECT_THAT(violations("palpate/io/a.cpp", spdx + "#include <iostream>\n", table), SizeIs(1));
}

TEST(ArchitectureRules, SolversBesideTheResponseAreFound) {
  const Table table = the_table();
  for (const char* path : {"palpate/estimation/a.cpp", "palpate/prediction/a.hpp", "palpate/suggest.cpp", "cli/a.cpp"}) {
    EXPECT_THAT(violations(path, spdx + "fem::Statics s(mesh, law, boundary);\n", table), ElementsAre(HasSubstr("fem::Response"))) << path;
    EXPECT_THAT(violations(path, spdx + "std::unique_ptr<fem::ContactStatics> s;\n", table), SizeIs(1)) << path;
    EXPECT_THAT(violations(path, spdx + "fem::Response r; fem::StaticsOptions o;\n", table), IsEmpty()) << path;
  }
  EXPECT_THAT(violations("palpate/lab/a.cpp", spdx + "fem::Statics s(mesh, law, boundary);\n", table), IsEmpty());
}

TEST(ArchitectureRules, WordsInCommentsAndStringsAreNoCode) {
  const Table table = the_table();
  EXPECT_THAT(
      violations("palpate/fem/a.cpp",
                 spdx + "// do not abort() here\n/* printf() */ const char* s = \"std::cout \\\" abort()\";\n", table),
      IsEmpty());
  EXPECT_THAT(violations("palpate/fem/a.cpp", spdx + "char q = '\"'; void f() { abort(); }\n", table), SizeIs(1));
}

TEST(ArchitectureRules, MissingLicenceUnknownRoomAndCyclesAreFound) {
  const Table table = the_table();
  EXPECT_THAT(violations("palpate/fem/a.cpp", "int a;\n", table), ElementsAre(HasSubstr("SPDX")));
  EXPECT_THAT(violations("palpate/attic/a.cpp", spdx, table), ElementsAre(HasSubstr("not in the table")));
  const Table cyclic = {{"a", {{"b"}, false}}, {"b", {{"a"}, false}}, {"c", {{}, false}}};
  EXPECT_THAT(architecture::rooms_on_a_cycle(cyclic), ElementsAre("a", "b"));
}

}  // namespace
}  // namespace architecture_test
