// label: unit
// SPDX-License-Identifier: Apache-2.0
// The page in a browser without a window. Needs node, viewer/node_modules (npm install) and Chromium; says so and skips
// without.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "palpate/report/report.hpp"
#include "report/pressed_block.hpp"
#include "temporary_folder.hpp"

namespace browser_test {
namespace {

namespace fs = std::filesystem;
const fs::path viewer = fs::path(PALPATE_SOURCE_DIR) / "viewer";

bool runs(const std::string& command) { return std::system((command + " >/dev/null 2>&1").c_str()) == 0; }

class Browser : public testing::Test {
 protected:
  void SetUp() override {
    if (!runs("node --version")) GTEST_SKIP() << "no node: the page is not tested in a browser";
    if (!fs::exists(viewer / "node_modules/playwright-core"))
      GTEST_SKIP() << "run `npm install --no-package-lock` in viewer/ to test the page in a browser";
    if (!runs("chromium --version")) GTEST_SKIP() << "no chromium: the page is not tested in a browser";
  }

  /// Runs one check of viewer/test/page.mjs on a page; its complaints are on stderr.
  int check(const std::string& name, const palpate::Identification& id, const palpate::Recording* recording) {
    const fs::path page = folder_ / "report.html";
    palpate::report::write_report(id, recording, page);
    const int status =
        std::system(("node " + (viewer / "test/page.mjs").string() + " " + name + " " + page.string() + " 1>&2").c_str());
    return WEXITSTATUS(status);
  }

  const palpate::test::TemporaryFolder files_{"browser"};
  const fs::path folder_ = files_.path();
};

TEST_F(Browser, PageShowsTheAnswerAndTheSliderMovesTheMesh) {
  const auto recording = pressed_block::recording();
  EXPECT_EQ(check("whole", pressed_block::identification(), &recording), 0);
}

TEST_F(Browser, PageWithoutWebGlSaysSoAndKeepsTheFigures) {
  EXPECT_EQ(check("without_webgl", pressed_block::identification(), nullptr), 0);
}

TEST_F(Browser, HostileNamesNeitherRunNorBreakTheLayout) {
  auto id = pressed_block::identification({.cells = 4, .pushes = 2, .steps = 3, .points = 50});
  auto recording = pressed_block::recording();
  const std::string hostile = "</script><script>window.hacked=1</script><img src=x onerror='window.hacked=1'>" +
                              std::string(300, 'W') + " \xd7\xa9\xd7\x9c\xd7\x95\xd7\x9d \xe6\x8e\xa8 \xf0\x9f\xa7\xb8";
  recording.source = hostile;
  recording.tools[0].name = hostile;
  recording.warnings = {hostile};
  recording.input_hashes[hostile] = hostile;
  id.verdicts.push_back({hostile, hostile});
  id.budget.push_back({hostile, 3, 0});
  id.nuisances.push_back({hostile, "m", 1, 1, 0, 2, 1, 1});
  id.provenance[hostile] = hostile;
  id.prediction.what = hostile;
  for (std::size_t i = 0; i < 3; ++i) id.steps[i].push = hostile;
  EXPECT_EQ(check("hostile", id, &recording), 0);
}

TEST_F(Browser, LivePageFollowsARunningEstimate) {
  if (std::string(PALPATE_CLI).empty()) GTEST_SKIP() << "the program is not built";
  const fs::path recording = folder_ / "recording", out = folder_ / "out";
  fs::remove_all(recording);
  fs::remove_all(out);
  const std::string program = PALPATE_CLI;
  ASSERT_TRUE(runs(program + " record --demo -o " + recording.string()));
  const std::string estimate =
      program + " estimate " + recording.string() + " -o " + out.string() + " --element tet4 --refine none --serve 0";
  const int status = std::system(
      ("node " + (viewer / "test/page.mjs").string() + " live " + (out / "result.json").string() + " " + estimate + " 1>&2")
          .c_str());
  EXPECT_EQ(WEXITSTATUS(status), 0);
}

TEST_F(Browser, LargeRecordingIsThinnedWithAWordAndTurns) {
  EXPECT_EQ(check("speed", pressed_block::identification({.cells = 92, .pushes = 1, .steps = 10, .points = 30000}), nullptr),
            0);
}

}  // namespace
}  // namespace browser_test
