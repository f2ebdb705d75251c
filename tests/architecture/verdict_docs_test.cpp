// label: unit
// SPDX-License-Identifier: Apache-2.0
// Every verdict that the source can say stands in the tables of both pages, and these hold no other.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <regex>
#include <set>
#include <sstream>
#include <string>

namespace verdict_docs_test {
namespace {

namespace fs = std::filesystem;

std::string contents(const fs::path& path) {
  std::ifstream file(path);
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

/// Codes of verdicts as they are made: `verdicts.push_back({"code", ...`, `out.push_back({"code", ...`, `return {"code", ...` and
/// `Verdict{"code", ...`.
std::set<std::string> codes_in(const std::string& source) {
  static const std::regex made(R"re((?:verdicts\.push_back\(\s*\{|out\.push_back\(\s*\{|return \{|Verdict\{)\s*"([a-z_]+)"\s*,)re");
  std::set<std::string> codes;
  for (std::sregex_iterator one(source.begin(), source.end(), made), end; one != end; ++one) codes.insert((*one)[1]);
  return codes;
}

std::set<std::string> codes_in_source() {
  std::set<std::string> codes;
  for (const auto& entry : fs::recursive_directory_iterator(fs::path(PALPATE_SOURCE_DIR) / "palpate/estimation"))
    if (entry.path().extension() == ".cpp") codes.merge(codes_in(contents(entry.path())));
  return codes;
}

/// First column of the table below the heading "Verdicts".
std::set<std::string> codes_in_page(const std::string& page) {
  const std::size_t begin = page.find("\n## Verdicts\n");
  if (begin == std::string::npos) return {};
  const std::string part = page.substr(begin + 1, page.find("\n## ", begin + 1) - begin - 1);
  static const std::regex row("\n\\| `([a-z_]+)` \\|");
  std::set<std::string> codes;
  for (std::sregex_iterator one(part.begin(), part.end(), row), end; one != end; ++one) codes.insert((*one)[1]);
  return codes;
}

class VerdictPage : public testing::TestWithParam<const char*> {};

TEST_P(VerdictPage, ListsWhatTheSourceSaysAndNothingElse) {
  const std::set<std::string> page = codes_in_page(contents(fs::path(PALPATE_SOURCE_DIR) / "docs" / GetParam()));
  const std::set<std::string> source = codes_in_source();
  for (const std::string& code : source) EXPECT_TRUE(page.contains(code)) << code << " is said and not explained";
  for (const std::string& code : page) EXPECT_TRUE(source.contains(code)) << code << " is explained and never said";
}

INSTANTIATE_TEST_SUITE_P(Docs, VerdictPage, testing::Values("uncertainty.md", "how-to-push.md"),
                         [](const auto& page) { return std::string(page.param).substr(0, 3); });

// The test itself must be able to fail.
TEST(VerdictCodes, AreFoundHoweverTheyAreMade) {
  EXPECT_THAT(codes_in(R"(out.push_back({"a_b", "A."}); answer.verdicts.push_back(
          {"c_d", "C."}); return Verdict{"e_f", x}; return {"g_h", y}; out.push_back({name, "i_j"});)"),
              testing::ElementsAre("a_b", "c_d", "e_f", "g_h"));
  EXPECT_THAT(codes_in_page("\n## Other\n| `x_y` | z |\n## Verdicts\n| code |\n|---|\n| `a_b` | A |\n| `c_d` | `no_code` |\n\n## End\n| `e_f` | E |\n"),
              testing::ElementsAre("a_b", "c_d"));
  EXPECT_GT(codes_in_source().size(), 25u);
}

}  // namespace
}  // namespace verdict_docs_test
