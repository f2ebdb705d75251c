// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/report/figures.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <numbers>

#include "palpate/core/error.hpp"
#include "palpate/report/canvas.hpp"
#include "palpate/report/object_picture.hpp"
#include "palpate/report/payload.hpp"
#include "palpate/report/regions.hpp"
#include "report/pressed_block.hpp"

namespace figures_test {
namespace {

using namespace palpate;
using testing::HasSubstr;
using testing::Not;

std::string data(const Identification& id) {
  const Recording recording = pressed_block::recording();
  return report::payload(id, &recording, {}).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

TEST(Regions, HoldTheirShareOfANormalDensity) {
  const int n = 201;
  report::Grid density(n, std::vector<double>(n));
  std::vector<double> axis;
  for (int i = 0; i < n; ++i) axis.push_back(-5 + 10.0 * i / (n - 1));
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      density[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)] =
          std::exp(-(axis[static_cast<std::size_t>(i)] * axis[static_cast<std::size_t>(i)] +
                     axis[static_cast<std::size_t>(j)] * axis[static_cast<std::size_t>(j)]) /
                   2);
    }
  }
  for (const double share : {0.68, 0.95}) {
    const auto outlines = report::region_outlines(density, report::density_threshold(density, axis, axis, share));
    ASSERT_EQ(outlines.size(), 1u);
    const double radius = std::sqrt(-2 * std::log(1 - share));  // of the disc that holds the share
    for (const auto& spot : outlines[0]) {
      EXPECT_NEAR(std::hypot(report::along(axis, spot.x), report::along(axis, spot.y)), radius, 0.03);
    }
  }
}

TEST(Regions, CloseAtTheBorderAndKeepSeparatePeaksApart) {
  const report::Grid edge = {{1, 0.5, 0}, {1, 0.5, 0}, {1, 0.5, 0}};
  ASSERT_EQ(report::region_outlines(edge, 0.4).size(), 1u);
  const report::Grid saddle = {{1, 0}, {0, 1}};
  EXPECT_EQ(report::region_outlines(saddle, 0.5).size(), 2u);
}

TEST(Canvas, FilledShapesCoverTheirArea) {
  const auto canvas = report::png_canvas(20, 20, 3);
  canvas->box({5, 5}, 10.5, 4.2, {0, 0, 0});
  // A dark pixel share of the page must be 10.5 x 4.2 of 20 x 20: read back through the SVG-independent PNG.
  const std::string png = canvas->bytes();
  ASSERT_TRUE(png.starts_with("\x89PNG"));
  const auto twice = report::png_canvas(20, 20, 3);
  twice->box({5, 5}, 10.5, 4.2, {0, 0, 0});
  EXPECT_EQ(png, twice->bytes());
  const auto other = report::png_canvas(20, 20, 3);
  other->box({5, 5}, 10.4, 4.2, {0, 0, 0});  // a tenth of a point is seen in the coverage of the edge
  EXPECT_NE(png, other->bytes());
}

TEST(ObjectPicture, ShowsTheStepThatMovedMost) {
  const auto id = pressed_block::identification();
  const auto drawn = report::draw_object(nlohmann::json::parse(data(id)), 300, 240);
  ASSERT_EQ(drawn.picture.width, 300);
  EXPECT_NEAR(drawn.largest_displacement_m, 0.04, 0.004);
  std::size_t covered = 0, dark = 0, arrow = 0;
  for (std::size_t i = 0; i < drawn.picture.rgba.size(); i += 4) {
    const auto* p = &drawn.picture.rgba[i];
    covered += p[3] > 200 ? 1 : 0;
    dark += p[3] > 200 && p[2] > p[0] + 40 && p[0] < 60 ? 1 : 0;  // the dimple
    arrow += p[3] > 200 && p[0] > 150 && p[1] < 40 ? 1 : 0;
  }
  EXPECT_GT(covered, 300u * 240u / 4);
  EXPECT_GT(dark, 200u);
  EXPECT_GT(arrow, 100u);
}

TEST(Figures, EveryFigureComesAsSvgAndPngAndTheSameTwice) {
  const std::string text = data(pressed_block::identification());
  const auto first = report::figures(text), second = report::figures(text);
  ASSERT_EQ(first.size(), 9u);
  for (std::size_t i = 0; i < first.size(); ++i) {
    EXPECT_TRUE(first[i].svg.starts_with("<svg")) << first[i].name;
    EXPECT_TRUE(first[i].svg.ends_with("</svg>\n")) << first[i].name;
    EXPECT_TRUE(first[i].png.starts_with("\x89PNG")) << first[i].name;
    EXPECT_EQ(first[i].png, second[i].png);
    EXPECT_EQ(first[i].svg, second[i].svg);
  }
}

TEST(Figures, UnitsAreOnEveryAxis) {
  for (const auto& figure : report::figures(data(pressed_block::identification()))) {
    const bool has_unit = figure.svg.find("(mm)") != std::string::npos || figure.svg.find("(kPa)") != std::string::npos ||
                          figure.svg.find("(%)") != std::string::npos;
    EXPECT_TRUE(has_unit) << figure.name;
  }
}

TEST(Figures, WithoutDataFiguresAreLeftOut) {
  Identification id;
  EXPECT_TRUE(report::figures(data(id)).empty());
  EXPECT_THROW(report::figures("{}"), Error);
  EXPECT_THROW(report::figures("no json"), Error);
}

TEST(Figures, SitesThatWerePushedOnceAreNotShownTwice) {
  auto id = pressed_block::identification({.cells = 3, .pushes = 2, .steps = 3, .points = 20});
  id.per_site = id.per_push;
  for (const auto& figure : report::figures(data(id))) EXPECT_NE(figure.name, "per_site");
}

TEST(Figures, LongNamesAreCutBetweenLettersAndKeepTheirRegion) {
  auto id = pressed_block::identification({.cells = 3, .pushes = 2, .steps = 3, .points = 20});
  id.per_push[0].region = "Druckversuch \xc3\xa4\xc3\xa4\xc3\xa4\xc3\xa4\xc3\xa4\xc3\xa4\xc3\xa4\xc3\xa4\xc3\xa4\xc3\xa4\xc3\xa4\xc3\xa4\xc3\xa4\xc3\xa4";
  id.budget[0].input = "camera_rotation_of_the_wrist";
  id.budget[0].regions = {{"upper half", 3}, {"lower half", 2}};
  std::string all;
  for (const auto& figure : report::figures(data(id))) {
    EXPECT_NO_THROW(nlohmann::json(figure.svg).dump()) << figure.name << ": not UTF-8";
    all += figure.svg;
  }
  EXPECT_THAT(all, testing::AllOf(HasSubstr("..., upper half"), HasSubstr("..., lower half")));
}

TEST(Figures, HostileNamesStayText) {
  auto id = pressed_block::identification({.cells = 3, .pushes = 2, .steps = 3, .points = 20});
  id.budget[0].input = "<script>&\x01";
  id.per_push[0].region = "\xe6\x8e\xa8\xff";
  for (const auto& figure : report::figures(data(id))) EXPECT_THAT(figure.svg, Not(HasSubstr("<script")));
}

}  // namespace
}  // namespace figures_test
