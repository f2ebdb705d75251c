// label: unit
// SPDX-License-Identifier: Apache-2.0
// An object whose shape is seen in a bag's own images.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/made_up_recording.hpp"
#include "io/read_back.hpp"
#include "palpate/core/error.hpp"
#include "palpate/io/bag_write.hpp"

namespace palpate::io::bag_views_test {
namespace {

using namespace palpate::io::test;
using testing::AllOf;
using testing::HasSubstr;

// Views had to be written as files by hand, though the bag holds them.
TEST(BagViews, TheObjectUntouchedMayBeSeenInTheBagItself) {
  const TemporaryFolder folder("bag_views");
  write_bag(made_up(), folder.path() / "bag");
  const std::string text = folder.get("bag/mapping.yaml");
  const auto complaint = [&](const std::string& from, const std::string& to) -> std::string {
    folder.put("bag/mapping.yaml", std::string(text).replace(text.find(from), from.size(), to));
    try {
      read_back(folder.path() / "bag");
    } catch (const Error& error) {
      return error.what();
    }
    return "nothing";
  };

  const DepthFrame* first = nullptr;
  const Recording recorded = read_back(folder.path() / "bag");
  for (const Observation& one : recorded.pushes.at(0).steps.at(0).observations)
    if (first == nullptr) first = std::get_if<DepthFrame>(&one);
  ASSERT_NE(first, nullptr);
  const std::size_t from = text.find("volume_mesh: "), to = text.find_first_of(",\n}", from);
  ASSERT_NE(from, std::string::npos);
  const std::string mesh = text.substr(from, to - from);
  folder.put("bag/mapping.yaml", std::string(text).replace(from, to - from, "views_at_s: [" + std::to_string(first->time_s) + "]"));
  const Recording seen = read_back(folder.path() / "bag");
  ASSERT_EQ(seen.rest.views.size(), 1u);
  EXPECT_EQ(seen.rest.views[0].depth_m, first->depth_m);
  EXPECT_TRUE(seen.rest.views[0].T_base_camera.isApprox(first->T_base_camera, 1e-9));
  EXPECT_FALSE(seen.rest.volume);
  EXPECT_EQ(seen.pushes.at(0).steps.at(0).observations.size(), recorded.pushes.at(0).steps.at(0).observations.size());

  EXPECT_THAT(complaint(mesh, "views_at_s: []"), AllOf(HasSubstr("rest.views_at_s"), HasSubstr("names no time")));
  EXPECT_THAT(complaint(mesh, "views_at_s: [5000]"), AllOf(HasSubstr("rest.views_at_s"), HasSubstr("there is no view at 5000.000 s")));
  EXPECT_THAT(complaint(mesh, mesh + "\n  views_at_s: [1]"), HasSubstr("'views_at_s' (times of the bag's own images)"));
}

}  // namespace
}  // namespace palpate::io::bag_views_test
