// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/report/report.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <regex>

#include "palpate/core/error.hpp"
#include "palpate/report/thinning.hpp"
#include "palpate/report/words.hpp"
#include "report/pressed_block.hpp"
#include "temporary_folder.hpp"

namespace report_test {
namespace {

using namespace palpate;
using nlohmann::json;
using testing::HasSubstr;
using testing::Not;

json data_of(const std::string& page) {
  const palpate::test::TemporaryFolder folder("report");
  const auto file = folder / "page.html";
  std::ofstream(file, std::ios::binary) << page;
  return json::parse(report::read_report_data(file));
}

TEST(Words, QuantitiesCarryUnitsAndSensibleDigits) {
  EXPECT_EQ(report::quantity(20312, "Pa"), "20.3 kPa");
  EXPECT_EQ(report::quantity(20312, "Pa", 1), "20.312 kPa");
  EXPECT_EQ(report::quantity(1.5e6, "Pa"), "1.50 MPa");
  EXPECT_EQ(report::quantity(0.00124, "m"), "1.24 mm");
  EXPECT_EQ(report::quantity(0.45, ""), "0.450");
  EXPECT_EQ(report::quantity(-1e-12, "N", 0.1), "0.0 N");
  EXPECT_EQ(report::quantity(std::nan(""), "Pa"), "unknown");
  EXPECT_EQ(report::interval(19520, 21120, "Pa"), "19.52 to 21.12 kPa");
  EXPECT_EQ(report::interval(0.2, 0.41, ""), "0.200 to 0.410");
  EXPECT_EQ(report::interval(12540, 13360, "Pa"), "12.54 to 13.36 kPa");
}

/// A wide interval has a lower end, a narrow one no more digits than anybody reads, and what is tiny is not zero.
TEST(Words, EndsThatAreFarApartOrCloseTogether) {
  EXPECT_EQ(report::interval(0.000304, 0.135, "m"), "0.30 to 135 mm");
  EXPECT_EQ(report::interval(300, 200000, "Pa"), "300 Pa to 200 kPa");
  EXPECT_EQ(report::interval(0, 0.31, ""), "0.00 to 0.31");
  EXPECT_EQ(report::interval(-0.0004, 0.31, ""), "0.00 to 0.31");
  EXPECT_EQ(report::interval(147.96790873, 147.96790875, "Pa"), "147.97 to 147.97 Pa");
  EXPECT_EQ(report::quantity(1e-9, "N"), "1.00e-09 N");
  EXPECT_EQ(report::quantity(0, "N"), "0.00 N");
  EXPECT_EQ(report::quantity(0.0021, "N"), "0.00210 N");
  EXPECT_EQ(report::interval(1e-9, 3e-9, "N"), "1.00e-09 to 3.00e-09 N");
}

TEST(Words, AnswerSaysWhatIsNotDeterminedAndWhatFailed) {
  Identification id = pressed_block::identification();
  EXPECT_EQ(report::answer(id),
            "Young's modulus is 20.30 kPa (95 % interval 19.52 to 21.12 kPa). "
            "The Poisson ratio is 0.310 (95 % interval 0.210 to 0.410).");
  Identification given = id;
  given.parameters[1].lower_95 = given.parameters[1].upper_95 = given.parameters[1].value;
  EXPECT_THAT(report::answer(given), HasSubstr("The Poisson ratio was given as 0.310."));
  id.parameters[1].determined = false;
  EXPECT_THAT(report::answer(id), HasSubstr("The Poisson ratio is not determined by these pushes"));
  id.termination = Termination::max_iterations;
  EXPECT_THAT(report::answer(id), HasSubstr("Take this with care"));
  EXPECT_THAT(report::answer(Identification{}), HasSubstr("There is no answer"));
}

TEST(Thinning, Base64IsThatOfRfc4648) {
  const auto encoded = [](const std::string& text) {
    return report::base64({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
  };
  EXPECT_EQ(encoded(""), "");
  EXPECT_EQ(encoded("f"), "Zg==");
  EXPECT_EQ(encoded("fo"), "Zm8=");
  EXPECT_EQ(encoded("foobar"), "Zm9vYmFy");
  const auto back = report::from_base64("Zm9vYmE=");
  EXPECT_EQ(std::string(back.begin(), back.end()), "fooba");
}

TEST(Thinning, ClusteredMeshStaysWithinLimitAndClose) {
  const TriMesh fine = pressed_block::block(60);
  const auto coarse = report::thin(fine, 1500);
  EXPECT_LE(coarse.kept.size(), 1500u);
  EXPECT_GT(coarse.kept.size(), 600u);
  EXPECT_GT(coarse.triangles.rows(), 1000);
  EXPECT_LT(coarse.triangles.maxCoeff(), static_cast<Index>(coarse.kept.size()));
  double area = 0;  // of a cube: clustering keeps faces plane but may cut edges
  for (Eigen::Index t = 0; t < coarse.triangles.rows(); ++t) {
    const auto corner = [&](int k) -> Vec3 {
      return fine.vertices_m.row(coarse.kept[static_cast<std::size_t>(coarse.triangles(t, k))]);
    };
    area += 0.5 * (corner(1) - corner(0)).cross(corner(2) - corner(0)).norm();
  }
  EXPECT_NEAR(area, 6 * pressed_block::edge_m * pressed_block::edge_m, 0.05 * area);
}

TEST(Thinning, SpreadKeepsEndsAndOrder) {
  EXPECT_EQ(report::spread(3, 5), (std::vector<std::size_t>{0, 1, 2}));
  EXPECT_EQ(report::spread(101, 3), (std::vector<std::size_t>{0, 50, 100}));
}

TEST(Report, CarriesEveryNumberOfTheAnswerInFull) {
  const auto id = pressed_block::identification();
  const auto recording = pressed_block::recording();
  const json data = data_of(report::html(id, &recording));
  EXPECT_EQ(data["parameters"][0]["value"].get<double>(), pressed_block::young_pa);
  EXPECT_EQ(data["fit"]["rms_m"].get<double>(), id.fit.rms_m);
  EXPECT_EQ(data["steps"].size(), id.steps.size());
  EXPECT_EQ(data["title"], "pressed_block");
  EXPECT_EQ(data["verdicts"][0]["code"], "nuisance_beyond_prior");
  std::size_t counted = data["histogram"]["beyond"].get<std::size_t>();
  for (const auto& count : data["histogram"]["counts"]) counted += count.get<std::size_t>();
  EXPECT_EQ(counted, id.fit.points_used);
}

TEST(Report, OfTheFolderOneStandsInHasTheRecordingsName) {
  for (const char* here : {".", "./", "..", ""}) {
    Recording recording = pressed_block::recording();
    recording.name = "sponge", recording.source = here;
    const json data = data_of(report::html(pressed_block::identification(), &recording));
    EXPECT_EQ(data["title"], "sponge") << here;
    EXPECT_EQ(data["scene"]["source"], "sponge") << here;
  }
}

TEST(Report, QuantisedSurfaceIsWithinAFewMicrometres) {
  const auto id = pressed_block::identification();
  const json data = data_of(report::html(id, nullptr));
  const auto bytes = report::from_base64(data["steps"][7]["surface"].get<std::string>());
  ASSERT_EQ(bytes.size(), static_cast<std::size_t>(id.surface.vertices_m.rows()) * 6);
  const double size = data["box"]["size_m"];
  // Vertices come in the order in which the triangles name them first.
  const Index first = id.surface.triangles(0, 0);
  for (int axis = 0; axis < 3; ++axis) {
    const auto k = static_cast<std::size_t>(2 * axis);
    const double x = data["box"]["origin_m"][static_cast<std::size_t>(axis)].get<double>() +
                     size * (bytes[k] + 256 * bytes[k + 1]) / 65535;
    EXPECT_NEAR(x, id.steps[7].surface_m(first, axis), size / 65535);
  }
}

TEST(Report, NeedsNothingFromOutside) {
  const std::string page = report::html(pressed_block::identification(), nullptr);
  const std::regex outside(R"((src|href)\s*=\s*["']?\s*(https?:)?//|@import|url\(\s*["']?https?:)", std::regex::icase);
  EXPECT_FALSE(std::regex_search(page, outside));
  EXPECT_THAT(page, HasSubstr("default-src 'none'"));
  EXPECT_THAT(page, Not(HasSubstr("<!--palpate:")));
}

TEST(Report, HostileNamesStayText) {
  auto id = pressed_block::identification({.cells = 2, .pushes = 1, .steps = 2, .points = 10});
  auto recording = pressed_block::recording();
  const std::string hostile = "</script><script>alert(1)</script><!--<img src=x onerror=alert(2)>&quot;'\"";
  recording.source = hostile;
  recording.tools[0].name = hostile;
  recording.warnings = {hostile, std::string("\xff\xfe broken bytes \xe2\x80\xa8 line")};
  id.verdicts[0].message = hostile;
  id.material = hostile;
  for (auto& step : id.steps) step.push = hostile;
  const std::string page = report::html(id, &recording);
  EXPECT_THAT(page, Not(HasSubstr("<script>alert")));
  EXPECT_THAT(page, Not(HasSubstr("<img src=x")));
  EXPECT_EQ(data_of(page)["material"], hostile);  // yet nothing is lost
}

TEST(Report, LargeRecordingIsThinnedToThreeMegabytesWithAWord) {
  // 101 k triangles, 300 k points.
  auto id = pressed_block::identification({.cells = 92, .pushes = 1, .steps = 10, .points = 30000});
  const std::string page = report::html(id, nullptr);
  EXPECT_LE(page.size(), 3'000'000u);
  EXPECT_GT(page.size(), 1'200'000u);
  const std::string words = data_of(page)["thinned"].dump();
  EXPECT_THAT(words, HasSubstr("of 101568 triangles"));
  EXPECT_THAT(words, HasSubstr("of 300000 points"));
}

TEST(Report, EmptyAndHalfKnownResultsStillMakeAPage) {
  EXPECT_THAT(report::html(Identification{}, nullptr), HasSubstr("There is no answer"));
  auto id = pressed_block::identification({.cells = 2, .pushes = 1, .steps = 1, .points = 0});
  id.steps[0].travel_m = std::nan("");
  id.posterior = {};
  const json data = data_of(report::html(id, nullptr));
  EXPECT_TRUE(data["steps"][0]["travel_m"].is_null());
  EXPECT_TRUE(data["posterior"].is_null());
}

TEST(Report, SameInputSamePage) {
  const auto id = pressed_block::identification();
  EXPECT_EQ(report::html(id, nullptr), report::html(id, nullptr));
}

TEST(Report, WriteFailsWithTheFilesName) {
  try {
    report::write_report(pressed_block::identification({.cells = 2}), nullptr, "/nonexistent_folder/report.html");
    FAIL() << "wrote into a folder that is not there";
  } catch (const Error& error) {
    EXPECT_THAT(error.where(), HasSubstr("/nonexistent_folder/report.html"));
  }
}

}  // namespace
}  // namespace report_test
