// label: unit
// SPDX-License-Identifier: Apache-2.0
// Recordings whose numbers can all be read and cannot be: each is refused with the field, the value and the likely mistake.
// What is only odd is said and read.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/recording_folder.hpp"
#include "palpate/core/error.hpp"
#include "palpate/io/depth_file.hpp"
#include "palpate/io/recording.hpp"

namespace palpate::io::absurd_recording_test {
namespace {

using namespace palpate::io::test;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

const std::string whole_index = R"(format: palpate-recording/1
name: cube
rest: {volume_mesh: rest.msh, state: stress_free}
supports:
  - {kind: vertices, file: fixed.csv}
tools:
  - {name: ball, shape: disc, radius_m: 0.02, contact: bonded}
cameras:
  - {name: top, width_px: 8, height_px: 6, fx_px: 10, fy_px: 10, cx_px: 3.5, cy_px: 2.5, depth_unit_m: 0.001,
     T_base_camera: {position_m: [0.05, 0.05, 0.6], quaternion_xyzw: [1, 0, 0, 0]}, noise: {model: constant, sigma_m: 0.002}}
environment: {planes: [{point_m: [0, 0, 0], normal: [0, 0, 1]}]}
pushes:
  - name: seen
    steps:
      - time_s: 0
        loads: [{tool: ball, force_n: [0, 0, -1], contact_m: [0.05, 0.05, 0.1], force_std_n: 0.02}]
        observations: [{kind: depth, camera: top, file: depth.png, time_s: 0.1}]
      - time_s: 1
        loads: [{tool: ball, force_n: [0, 0, -2], contact_m: [0.05, 0.05, 0.1]}]
        observations:
          - {kind: depth, camera: top, file: depth1.png, time_s: 1.1}
          - {kind: travel, travel_m: 0.002, sigma_m: 0.0005}
          - {kind: wrench, force_n: [0, 0, -2.1], force_sigma_n: 0.05}
)";

class AbsurdRecording : public testing::Test {
 protected:
  AbsurdRecording() : folder("absurd") {
    put_cube_recording(folder);
    folder.put("depth.png", depth_png(DepthImage::Constant(6, 8, 0.5f), 0.001));
    folder.put("depth1.png", depth_png(DepthImage::Constant(6, 8, 0.501f), 0.001));
    folder.put("recording.yaml", whole_index);
  }

  std::string refusal_with(const std::string& from, const std::string& to) {
    folder.put("recording.yaml", replaced(whole_index, from, to));
    try {
      read_recording(folder.path());
    } catch (const Error& error) {
      return error.what();
    }
    return "accepted";
  }

  std::vector<std::string> warnings_with(const std::string& from, const std::string& to) {
    folder.put("recording.yaml", replaced(whole_index, from, to));
    return read_recording(folder.path()).warnings;
  }

  TemporaryFolder folder;
};

TEST_F(AbsurdRecording, TheRecordingItselfIsRight) { EXPECT_THAT(warnings_with("cube", "block"), IsEmpty()); }

TEST_F(AbsurdRecording, WhatCannotBeIsRefusedByFieldValueAndLikelyMistake) {
  struct Slip {
    const char *from, *to, *where, *what;
  };
  const Slip slips[] = {
      {"radius_m: 0.02", "radius_m: 1e6", "recording.yaml:7: tools[0].radius_m", "is 1e6 m"},
      {"radius_m: 0.02", "radius_m: 20", "tools[0].radius_m", "millimetres"},
      {"radius_m: 0.02", "radius_m: 1e-12", "tools[0].radius_m", "is 1e-12 m"},
      {"radius_m: 0.02", "radius_m: 0.02, radius_std_m: 0.5", "tools[0].radius_std_m", "larger than the radius"},
      {"radius_m: 0.02", "radius_m: 0.02, compliance_m_per_n: 0.5", "compliance_m_per_n", "mm/N"},
      {"contact: bonded", "contact: friction, friction_coefficient: 1e9", "friction_coefficient", "is 1e9"},
      {"fx_px: 10", "fx_px: 1e9", "cameras[0].fx_px", "is 1e9 px"},
      {"fy_px: 10", "fy_px: 1e-3", "cameras[0].fy_px", "is it in millimetres? It must be in pixels"},
      {"cx_px: 3.5", "cx_px: 1e6", "cameras[0].cx_px", "is 1e6 px"},
      {"sigma_m: 0.002", "sigma_m: 1e9", "cameras[0].noise.sigma_m", "is 1e9 m"},
      {"sigma_m: 0.002", "sigma_m: 1e-15", "cameras[0].noise.sigma_m", "is 1e-15 m"},
      {"sigma_m: 0.002", "sigma_m: 0.002, bias_std_m: 3", "noise.bias_std_m", "millimetres"},
      {"depth_unit_m: 0.001", "depth_unit_m: 0.001, pose_std_rad: 3", "cameras[0].pose_std_rad", "degrees"},
      {"force_std_n: 0.02", "force_relative_std: 2", "loads[0].force_relative_std", "percent"},
      {"force_std_n: 0.02", "force_std_n: 1e12", "loads[0].force_std_n", "is 1e12 N"},
      {"force_std_n: 0.02", "force_rate_n_s: [0, 0, 1e12]", "recording.yaml:15", "1e+12 N/s"},
      {"force_n: [0, 0, -2]", "force_n: [0, 0, -1e12]", "recording.yaml:18", "1e+12 N"},
      {"force_sigma_n: 0.05", "force_sigma_n: 1e9", "observations[2].force_sigma_n", "is 1e9 N"},
      {"sigma_m: 0.0005", "sigma_m: 500", "observations[1].sigma_m", "millimetres"},
      {"name: cube\n", "name: cube\nforce_scale_std: 1e3\n", "force_scale_std", "percent"},
      {"name: cube\n", "name: cube\ntime_offset_std_s: 50\n", "time_offset_std_s", "milliseconds"},
      {"name: cube\n", "name: cube\ndensity_kg_m3: {value: 1000, std: 1e6}\n", "density_kg_m3.std", "larger than the density"},
      {"time_s: 1\n", "time_s: 1.7e18\n", "recording.yaml:18: time_s", "nanoseconds"},
      {"time_s: 1\n", "time_s: -1\n", "recording.yaml:18: time_s", "goes back"},
      {"time_s: 1.1", "time_s: -7", "recording.yaml:18", "time_s of its image goes back, to -7 s"},
      {"time_s: 1\n", "time_s: 1\n        T_base_tip: {position_m: [0, 0, 600], quaternion_xyzw: [1, 0, 0, 0]}\n",
       "recording.yaml:18", "T_base_tip is 600 m from the object"},
      {"{kind: vertices, file: fixed.csv}", "{kind: plane, name: table, point_m: [0, 0, 0], normal: [0, 0, 1], tolerance_m: 0.5}",
       "recording.yaml:5", "every node lies within tolerance_m (500 mm) of the plane of 'table'"},
      {"{kind: vertices, file: fixed.csv}", "{kind: box, name: grip, min_m: [-1, -1, -1], max_m: [1, 1, 1]}", "recording.yaml:5",
       "every node lies in the box of 'grip'"},
      {"normal: [0, 0, 1]", "normal: [0, 0, -1]", "environment.planes[0]", "behind this plane"},
      {"point_m: [0, 0, 0]", "point_m: [0, 0, -750]", "environment.planes[0]", "750 m from the object"},
      {"contact_m: [0.05, 0.05, 0.1], force_std_n: 0.02", "contact_m: [0.05, 0.05, 0.13]", "recording.yaml:15",
       "contact_m [0.05, 0.05, 0.13] is 30 mm from the object's surface, further than 'ball' is wide (20 mm)"},
  };
  for (const Slip& slip : slips) {
    const std::string said = refusal_with(slip.from, slip.to);
    EXPECT_THAT(said, HasSubstr(slip.where)) << slip.to;
    EXPECT_THAT(said, HasSubstr(slip.what)) << slip.to;
  }
}

TEST_F(AbsurdRecording, WhatIsMeasuredTwiceInOneStepIsRefused) {
  const std::string travel = "- {kind: travel, travel_m: 0.002, sigma_m: 0.0005}", line = "\n          ";
  const std::string twice = refusal_with(travel, travel + line + "- {kind: travel, travel_m: 0.003, sigma_m: 0.0005, tool: ball}");
  EXPECT_THAT(twice, HasSubstr("recording.yaml:18"));
  EXPECT_THAT(twice, HasSubstr("the travel of tool 'ball' is observed twice in this step"));
  const std::string wrench = "- {kind: wrench, force_n: [0, 0, -2.1], force_sigma_n: 0.05}";
  const std::string wrenches = refusal_with(wrench, wrench + line + "- {kind: wrench, force_n: [0, 0, -1], force_sigma_n: 0.1}");
  EXPECT_THAT(wrenches, HasSubstr("recording.yaml:18"));
  EXPECT_THAT(wrenches, HasSubstr("two wrenches of tool 'ball' are observed at the same time (1 s)"));
  EXPECT_EQ(refusal_with(wrench, wrench + line + "- {kind: wrench, force_n: [0, 0, -1], force_sigma_n: 0.1, time_s: 1.01}"),
            "accepted")
      << "samples one after the other";
  const auto cell = [](const char* along) {
    return std::string("- {kind: wrench, force_n: -2, force_sigma_n: 0.1, along: ") + along + "}";
  };
  EXPECT_EQ(refusal_with(wrench, cell("[0, 0, 1]") + line + cell("[1, 0, 0]")), "accepted") << "two single-axis cells";
  EXPECT_THAT(refusal_with(wrench, cell("[0, 0, 1]") + line + cell("[0, 0, -1]")), HasSubstr("two wrenches"));
}

TEST_F(AbsurdRecording, WhatIsOnlyOddIsSaidAndRead) {
  EXPECT_THAT(warnings_with("shape: disc", "shape: sphere"),
              ElementsAre(testing::AllOf(HasSubstr("a measured force of 'ball' is taken to press all of its radius"), HasSubstr("it touches about 0.0063 m"))));
  EXPECT_THAT(warnings_with("shape: disc, radius_m: 0.02", "shape: sphere, radius_m: 0.02, radius_std_m: 0.01"), IsEmpty());
  EXPECT_THAT(warnings_with("radius_m: 0.02", "radius_m: 0.5"), ElementsAre(HasSubstr("more than the whole object")));
  EXPECT_THAT(warnings_with("fx_px: 10", "fx_px: 30"), ElementsAre(HasSubstr("pixels are mostly square")));
  EXPECT_THAT(warnings_with("cx_px: 3.5", "cx_px: 20"), testing::Contains(HasSubstr("far from the middle of the image of 8 x 6")));
  EXPECT_THAT(warnings_with("sigma_m: 0.002", "sigma_m: 0.9"), ElementsAre(HasSubstr("nothing is seen so")));
  EXPECT_THAT(warnings_with("sigma_m: 0.002", "sigma_m: 1e-8"), ElementsAre(HasSubstr("finer than any sensor")));
  EXPECT_THAT(warnings_with("force_std_n: 0.02", "force_std_n: 5"), ElementsAre(HasSubstr("worse than itself")));
  EXPECT_THAT(warnings_with("time_s: 1.1", "time_s: 900"), ElementsAre(HasSubstr("of one clock?")));
  EXPECT_THAT(warnings_with("force_n: [0, 0, -1]", "direction: [0, 0, -1], force_n: [0, 0, 1]"),
              ElementsAre(HasSubstr("pulls, against 'direction'")));
  EXPECT_THAT(warnings_with("force_n: [0, 0, -1]", "direction: [1, 0, 0], force_n: [0.2, 0, -1]"), ElementsAre(HasSubstr("points 79 degrees away from 'direction'")));
  EXPECT_THAT(warnings_with("force_n: [0, 0, -1]", "direction: [0.5, 0, -0.8660254], force_n: [0, 0, -1]"), IsEmpty());
  EXPECT_THAT(warnings_with("force_n: [0, 0, -1]", "force_n: [0, 0, -999]"), ElementsAre(HasSubstr("hundred times")));
  EXPECT_THAT(warnings_with("environment: {", "density_kg_m3: 30\nenvironment: {gravity_m_s2: [0, 0, -98.1], "),
              ElementsAre(HasSubstr("gravity_m_s2")));
}

TEST_F(AbsurdRecording, ABallWhoseTravelWasReadWhereverItPressesIsRight) {
  const std::string seen = "[{kind: depth, camera: top, file: depth.png, time_s: 0.1}", both = seen + ", {kind: travel, travel_m: 0.001, sigma_m: 0.0005}";
  folder.put("recording.yaml", replaced(replaced(whole_index, "shape: disc", "shape: sphere"), seen, both));
  EXPECT_THAT(read_recording(folder.path()).warnings, IsEmpty());
}

// An E was found of what a camera of a wrong pose saw elsewhere.
TEST_F(AbsurdRecording, ACameraThatShowsTheObjectNowhereIsSaid) {
  EXPECT_THAT(warnings_with("position_m: [0.05, 0.05, 0.6]", "position_m: [1.5, 0.05, 0.6]"),
              ElementsAre(HasSubstr("none of the 2 images and clouds shows anything where the object is")));
}

TEST_F(AbsurdRecording, APushThatPullsAllTheTimeIsSaid) {
  std::string index = replaced(whole_index, "force_n: [0, 0, -1]", "direction: [0, 0, -1], force_n: [0, 0, 1]");
  index = replaced(index, "force_n: [0, 0, -2]", "direction: [0, 0, -1], force_n: [0, 0, 2]");
  index = replaced(index, "          - {kind: travel, travel_m: 0.002, sigma_m: 0.0005}\n", "");
  folder.put("recording.yaml", replaced(index, "force_n: [0, 0, -2.1]", "force_n: [0, 0, 2.1]"));
  EXPECT_THAT(read_recording(folder.path()).warnings, testing::Contains(HasSubstr("in all of push 'seen'")));
}

TEST_F(AbsurdRecording, AnObjectOfAnySizeTakesToolsOfAnySize) {
  EXPECT_THAT(refusal_with("radius_m: 0.02", "radius_m: 3"), HasSubstr("is 3 m"));
  EXPECT_EQ(refusal_with("name: cube\n", "name: cube\naccept_size: true\n"), "accepted");
  folder.put("recording.yaml",
             replaced(replaced(whole_index, "name: cube\n", "name: cube\naccept_size: true\n"), "radius_m: 0.02", "radius_m: 3"));
  EXPECT_NO_THROW(read_recording(folder.path()));
}

}  // namespace
}  // namespace palpate::io::absurd_recording_test
