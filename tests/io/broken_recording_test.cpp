// label: unit
// SPDX-License-Identifier: Apache-2.0
// Every way in which recordings were seen to be broken: each is an Error that names the file (and the line or field) and the
// cure.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/broken_bytes.hpp"
#include "io/recording_folder.hpp"
#include "palpate/io/depth_file.hpp"
#include "palpate/io/recording.hpp"

namespace palpate::io::broken_recording_test {
namespace {

using namespace palpate::io::test;
using testing::AllOf;
using testing::HasSubstr;

class BrokenRecording : public testing::Test {
 protected:
  BrokenRecording() : folder("broken") { put_cube_recording(folder); }

  void change_index(const std::string& from, const std::string& to) {
    folder.put("recording.yaml", replaced(index_text, from, to));
  }

  /// The message names `where` and `cure`.
  void expect_refused(const std::string& where, const std::string& cure) {
    try {
      read_recording(folder.path());
      ADD_FAILURE() << "was accepted";
    } catch (const Error& error) {
      EXPECT_NE(error.where().find(where), std::string::npos) << error.what();
      EXPECT_NE(error.message().find(cure), std::string::npos) << error.what();
    }
  }

  void expect_accepted() { EXPECT_NO_THROW(read_recording(folder.path())); }

  TemporaryFolder folder;
};

TEST_F(BrokenRecording, TheRecordingItselfIsWhole) { expect_accepted(); }

TEST_F(BrokenRecording, NoFolder) {
  EXPECT_THROW(read_recording(folder.path() / "nowhere"), Error);
  std::filesystem::remove(folder.path() / "recording.yaml");
  expect_refused("broken", "recording.yaml");
}

TEST_F(BrokenRecording, ASecondDocumentIsNotPassedOver) {
  folder.put("recording.yaml", index_text + std::string("---\npushes: []\n"));
  expect_refused("recording.yaml", "more than one document");
}

TEST_F(BrokenRecording, AFileThatIsNone) {
  folder.put("recording.yaml", "notes of Tuesday\nthe foam was softer\n");
  expect_refused("recording.yaml:1", "holds no keys with values");
  change_index("tools:\n", "tools:\n  - hand\nregions:\n  - a word\n  - another\n");
  expect_refused("recording.yaml:", "keys and values are expected here");
}

TEST_F(BrokenRecording, AFileOfAnotherKind) {
  folder.put("cow.obj", "v 0 0 0\n");
  try {
    read_recording(folder.path() / "cow.obj");
    ADD_FAILURE() << "a mesh was taken for a recording";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("cow.obj: is no recording"));
    EXPECT_THAT(error.what(), testing::HasSubstr("palpate model"));
  }
}

TEST_F(BrokenRecording, MissingFile) {
  std::filesystem::remove(folder.path() / "clouds/b.xyz");
  expect_refused("frames.csv:3: cloud", "there is no file 'clouds/b.xyz'");
  change_index("rest.msh", "rast.msh");
  expect_refused("recording.yaml:4: rest.volume_mesh", "there is no file 'rast.msh'");
}

TEST_F(BrokenRecording, FilesOutsideTheFolder) {
  change_index("rest.msh", "../rest.msh");
  expect_refused("recording.yaml:4", "outside the recording's folder");
  change_index("rest.msh", "/etc/rest.msh");
  expect_refused("recording.yaml:4", "outside the recording's folder");
}

TEST_F(BrokenRecording, Regions) {
  const auto with = [&](const std::string& lines) {
    folder.put("recording.yaml", replaced(index_text, "tools:\n", "regions:\n" + lines + "tools:\n"));
  };
  const std::string rest = "  - {name: b, kind: rest}\n";
  with("  - {name: a, kind: elements, elements: [0, 4]}\n" + rest);
  const Recording recording = read_recording(folder.path());
  EXPECT_EQ(recording.regions.at(0).elements, (std::vector<Index>{0, 4}));
  with(rest);
  expect_refused("recording.yaml:9: regions", "two regions or more");
  with("  - {name: b, kind: box, min_m: [0, 0, 0], max_m: [1, 1, 0.05]}\n" + rest);
  expect_refused("regions[1].name", "already");
  with("  - {name: a, kind: box, min_m: [0, 0, 0], max_m: [1, 0, 0.05]}\n" + rest);
  expect_refused("regions[0].max_m", "larger than min_m");
  with("  - {name: a, kind: box, min_m: [1, 0, 0], max_m: [2, 1, 1]}\n" + rest);
  expect_refused("regions[0]", "passes the object by");
  with("  - {name: a, kind: ball}\n" + rest);
  expect_refused("regions[0].kind", "box");
  with("  - {name: a, kind: elements, elements: [5]}\n" + rest);
  expect_refused("regions[0].elements", "element 5 is not in the volume mesh, which has 5");
  with("  - {name: a, kind: elements, elements: [1, 1]}\n" + rest);
  expect_refused("regions[0]", "named twice");
  with("  - {name: a, kind: elements}\n" + rest);
  expect_refused("regions[0]", "either 'file' or 'elements'");
  with("  - {name: a, kind: points}\n" + rest);
  expect_refused("regions[0]", "'points_m'");
  with("  - {name: a, kind: points, points_m: []}\n" + rest);
  expect_refused("regions[0].points_m", "no point");
  with("  - {name: a, kind: points, vertices: [8]}\n" + rest);
  expect_refused("regions[0]", "vertex 8 is not in the rest mesh");
  with("  - {name: a, kind: points, vertices: [1]}\n" + rest);
  expect_refused("regions", "leave no rest");
  with("  - {name: a, kind: points, points_m: [[50, 0, 0]]}\n  - {name: b, kind: points, vertices: [1]}\n");
  expect_refused("regions[0]", "in metres?");
  with("  - {name: a, kind: rest}\n" + rest);
  expect_refused("regions[1].kind", "takes the rest already");
  with("  - {name: a, kind: rest, young_modulus_pa: 3}\n" + rest);
  expect_refused("regions[0]", "young_modulus_pa");
  folder.put("part.csv", "0\n1,7\n");
  with("  - {name: a, kind: elements, file: part.csv}\n" + rest);
  expect_refused("part.csv", "element 7 is not in the volume mesh");
}

TEST_F(BrokenRecording, NotANumber) {
  folder.put("clouds/b.xyz", cloud_text() + "nan 0 0\n");
  expect_refused("b.xyz:26", "not finite");
  put_cube_recording(folder);
  folder.put("frames.csv", replaced(folder.get("frames.csv"), "0.5,0,-2", "0.5,nan,-2"));
  expect_refused("frames.csv:3: force_y_n", "not a finite number");
  put_cube_recording(folder);
  change_index("sigma_m: 0.0005", "sigma_m: .nan");
  expect_refused("recording.yaml:16", "not a finite number");
  put_cube_recording(folder);
  folder.put("rest.msh", replaced(folder.get("rest.msh"), "0.1", "nan"));
  expect_refused("rest.msh", "not a finite number");
}

TEST_F(BrokenRecording, MeshInMillimetres) {
  MeshData mesh = cube();
  mesh.points_m *= 1000;
  folder.put("rest.msh", mesh_format_named("msh22").write(mesh));
  expect_refused("rest.msh", "scale_to_m: 0.001");
  change_index("state:", "scale_to_m: 0.001\n  state:");
  expect_accepted();
}

TEST_F(BrokenRecording, MeshAThousandTimesTooSmall) {
  MeshData mesh = cube();
  mesh.points_m *= 0.001;
  folder.put("rest.msh", mesh_format_named("msh22").write(mesh));
  expect_refused("rest.msh", "accept_size: true");
}

TEST_F(BrokenRecording, ASizeThatIsMeantIsAccepted) {
  MeshData mesh = cube();
  mesh.points_m *= 1000;
  folder.put("rest.msh", mesh_format_named("msh22").write(mesh));
  folder.put("clouds/a.xyz", cloud_text(1000));
  folder.put("clouds/b.xyz", cloud_text(990));
  change_index("rest:", "accept_size: true\nrest:");
  expect_accepted();
}

TEST_F(BrokenRecording, CloudInMillimetres) {
  folder.put("clouds/b.xyz", cloud_text(1000));
  expect_refused("frames.csv:3", "millimetres");
  folder.put("clouds/b.xyz", cloud_text(0.001));
  expect_refused("frames.csv:3", "metres");
}

constexpr const char* camera_text = R"(cameras:
  - {name: top, width_px: 8, height_px: 6, fx_px: 10, fy_px: 10, cx_px: 3.5, cy_px: 2.5, depth_unit_m: 0.001,
     T_base_camera: {position_m: [0.05, 0.05, 0.6], quaternion_xyzw: [1, 0, 0, 0]}, noise: {model: constant, sigma_m: 0.002}}
pushes:
  - name: seen
    steps:
      - time_s: 0
        loads: [{tool: tip, force_n: [0, 0, -1]}]
        observations: [{kind: depth, camera: top, file: depth.png}]
)";

TEST_F(BrokenRecording, DepthUnitWrongByAThousand) {
  const std::string with_camera = index_text.substr(0, index_text.find("pushes:")) + camera_text;
  folder.put("depth.png", depth_png(DepthImage::Constant(6, 8, 0.5f), 0.001));
  folder.put("recording.yaml", with_camera);
  expect_accepted();
  for (const char* unit : {"depth_unit_m: 1", "depth_unit_m: 0.000001"}) {
    folder.put("recording.yaml", replaced(with_camera, "depth_unit_m: 0.001", unit));
    expect_refused("recording.yaml:17", "depth_unit_m");
  }
}

TEST_F(BrokenRecording, CutOffPng) {
  const std::string png = depth_png(DepthImage::Constant(6, 8, 0.5f), 0.001);
  folder.put("recording.yaml", index_text.substr(0, index_text.find("pushes:")) + camera_text);
  folder.put("depth.png", png.substr(0, png.size() / 2));
  expect_refused("depth.png", "cut off");
  folder.put("depth.png", depth_png(DepthImage::Constant(6, 9, 0.5f), 0.001));
  expect_refused("depth.png", "9 x 6 pixels");
  folder.put("depth.png", depth_npy(DepthImage::Zero(6, 8)));
  expect_refused("depth.png", "no pixel");
}

TEST_F(BrokenRecording, FlippedTetrahedron) {
  MeshData mesh = cube();
  std::swap(mesh.tetrahedra(2, 0), mesh.tetrahedra(2, 1));
  folder.put("rest.msh", mesh_format_named("msh22").write(mesh));
  expect_refused("rest.msh",
                 "1 of 5 tetrahedra are turned inside out and 0 are flat, the first is number 2; swap two corners");
  mesh = cube();
  mesh.points_m.row(7) = mesh.points_m.row(6);
  folder.put("rest.msh", mesh_format_named("msh22").write(mesh));
  expect_refused("rest.msh", "flat");
}

TEST_F(BrokenRecording, EmptyCloud) {
  for (const char* bytes : {"", "\n", "# nothing\n"}) {
    folder.put("clouds/b.xyz", bytes);
    expect_refused("b.xyz", "empty");
  }
}

TEST_F(BrokenRecording, NoSupports) {
  change_index("supports:\n  - {kind: vertices, file: fixed.csv}\n", "");
  expect_refused("recording.yaml", "'supports: free'");
  change_index("supports:\n  - {kind: vertices, file: fixed.csv}\n", "supports: []\n");
  expect_refused("recording.yaml:6", "'supports: free'");
  change_index("supports:\n  - {kind: vertices, file: fixed.csv}\n", "supports: free\n");
  expect_accepted();
}

TEST_F(BrokenRecording, SupportThatHoldsNothing) {
  change_index("{kind: vertices, file: fixed.csv}", "{kind: plane, point_m: [0, 0, -0.01], normal: [0, 0, 1]}");
  expect_refused("recording.yaml:7", "the nearest is 10 mm away");
  change_index("{kind: vertices, file: fixed.csv}", "{kind: box, min_m: [1, 1, 1], max_m: [2, 2, 2]}");
  expect_refused("recording.yaml:7", "no node lies in the box");
}

TEST_F(BrokenRecording, EveryLoadZeroAndNoGravity) {
  folder.put("frames.csv", replaced(folder.get("frames.csv"), "0.5,0,-2", "0,0,0"));
  expect_refused("broken", "gravity_m_s2 and density_kg_m3");
  change_index("tools:", "density_kg_m3: 1000\nenvironment: {gravity_m_s2: [0, 0, -9.81]}\ntools:");
  expect_accepted();
  folder.put("recording.yaml", replaced(folder.get("recording.yaml"), "stress_free", "under_gravity"));
  expect_refused("broken", "stress-free shape");
}

TEST_F(BrokenRecording, GravityWithoutDensity) {
  change_index("tools:", "environment: {gravity_m_s2: [0, 0, -9.81]}\ntools:");
  expect_refused("recording.yaml:8: environment.gravity_m_s2", "density_kg_m3");
}

TEST_F(BrokenRecording, DuplicateStep) {
  const std::string frames = folder.get("frames.csv");
  folder.put("frames.csv", frames + "1,0.5,0,-2,clouds/b.xyz\n");
  expect_refused("frames.csv:4", "remove one");
  folder.put("frames.csv", frames + "2,0.5,0,-2,clouds/b.xyz\n");
  expect_refused("frames.csv:4", "'clouds/b.xyz' is used by");
  folder.put("clouds/c.xyz", cloud_text(0.97));
  folder.put("frames.csv", frames + "1,0.5,0,-2,clouds/c.xyz\n");
  expect_refused("frames.csv:4: time_s", "a step is there twice");
  folder.put("frames.csv", frames + "0.5,0.5,0,-2,clouds/c.xyz\n");
  expect_refused("frames.csv:4: time_s", "order the steps by time");
}

TEST_F(BrokenRecording, UnknownKeys) {
  change_index("supports:", "suports:");
  expect_refused("recording.yaml", "is 'suports' in line 7 meant?");
  change_index("element: tet4", "elemnt: tet4");
  expect_refused("recording.yaml:10: model.elemnt", "did you mean 'element'?");
  change_index("element: tet4", "element: tet5");
  expect_refused("recording.yaml:10: model.element", "did you mean 'tet4'?");
  change_index("force_relative_std: 0.02", "force_relative: 0.02");
  expect_refused("recording.yaml:15", "did you mean 'force_relative_std'?");
  change_index("sigma_m: 0.0005", "sigma_mm: 0.5");
  expect_refused("recording.yaml:16", "sigma_m");
  change_index("tool: tip", "tool: tap");
  expect_refused("recording.yaml:15", "did you mean 'tip'?");
  change_index("kind: cloud", "kind: clouds");
  expect_refused("recording.yaml:16", "did you mean 'cloud'?");
}

TEST_F(BrokenRecording, UnknownColumns) {
  folder.put("frames.csv", replaced(folder.get("frames.csv"), "force_x_n", "force_x"));
  expect_refused("frames.csv", "force_x_n");
  put_cube_recording(folder);
  folder.put("frames.csv", "time_s,force_x_n,force_y_n,force_z_n,cloud,temperature_c\n0,1,0,0,clouds/a.xyz,20\n");
  expect_refused("frames.csv:1", "column 'temperature_c' is unknown");
}

TEST_F(BrokenRecording, DoubledKeysAndBrokenYaml) {
  change_index("name: cube\n", "name: cube\nname: ball\n");
  expect_refused("recording.yaml:3", "twice");
  change_index("  state: stress_free", "  state: [stress_free");
  expect_refused("recording.yaml:", "YAML");
  folder.put("recording.yaml", "");
  expect_refused("recording.yaml", "empty");
}

TEST_F(BrokenRecording, IndicesOutsideTheMesh) {
  folder.put("fixed.csv", "0\n1\n8\n");
  expect_refused("fixed.csv", "vertex 8 is not in the rest mesh, which has 8");
  put_cube_recording(folder);
  change_index("vertices: [6, 7]", "vertices: [6, 70]");
  expect_refused("recording.yaml:9", "vertex 70");
}

TEST_F(BrokenRecording, WrongWords) {
  change_index("force_relative_std: 0.02", "force_relative_std: 2 %");
  expect_refused("recording.yaml:15", "not a number");
  change_index("force_relative_std: 0.02", "force_relative_std: -0.02");
  expect_refused("recording.yaml:15", "must not be negative");
  change_index("palpate-recording/1", "palpate-recording/2");
  expect_refused("recording.yaml:1: format", "palpate-recording/1");
  change_index("palpate-recording/1", "palpate-mapping/1");
  expect_refused("recording.yaml:1: format", "--mapping");
}

TEST_F(BrokenRecording, TravelInMillimetres) {
  change_index("loads: [{tool: tip, force_relative_std: 0.02}]", "loads: [{tool: tip}]");
  folder.put("recording.yaml",
             replaced(folder.get("recording.yaml"), "observations: [", "observations: [{kind: travel, sigma_m: 0.001}, "));
  folder.put(
      "frames.csv",
      "time_s,force_x_n,force_y_n,force_z_n,cloud,observed_travel_m\n0,0,0,0,clouds/a.xyz,0\n1,0,0,-2,clouds/b.xyz,4\n");
  expect_refused("frames.csv:3", "millimetres");
}

/// What contradicts itself is found in memory as it is on disk.
TEST(ContradictoryRecording, PlatensAndSignsAreJudged) {
  Recording recording;
  recording.source = "block";
  const MeshData mesh = cube();
  recording.rest.volume = TetMesh{mesh.points_m, mesh.tetrahedra};
  Support table;
  table.kind = SupportKind::plane;
  table.plane.normal = Vec3::UnitZ();
  recording.supports = {table};
  Tool press;
  press.name = "press";
  press.shape = ToolShape::platen;
  press.plane.point_m = Vec3(0, 0, 0.1);
  press.plane.normal = -Vec3::UnitZ();
  recording.tools = {press};
  Push push;
  push.name = "down";
  for (int k = 0; k < 3; ++k) {
    Step step;
    step.source = "block: step";
    Load load;
    load.tool = "press";
    load.direction = -Vec3::UnitZ();
    load.travel_m = 0.001 * k;
    step.loads = {load};
    Wrench force;
    force.force_n = Vec3(0, 0, -2.0 * k);
    force.force_sigma_n = 0.1;
    step.observations = {force};
    push.steps.push_back(step);
  }
  recording.pushes = {push};
  const auto said = [](const Recording& one) {
    std::string all;
    for (const Problem& problem : check_recording(one)) all += problem.where + ": " + problem.what + "\n";
    return all;
  };
  EXPECT_EQ(said(recording), "");
  Recording wrong = recording;
  for (Step& step : wrong.pushes[0].steps) step.loads[0].travel_m = -*step.loads[0].travel_m;
  EXPECT_THAT(said(wrong), AllOf(HasSubstr("push 'down'"), HasSubstr("opposite signs")));
  for (Step& step : wrong.pushes[0].steps) std::get<Wrench>(step.observations[0]).force_n *= -1;
  EXPECT_EQ(said(wrong), "") << "a glued plate may pull";
  wrong = recording;
  wrong.tools[0].plane.point_m.z() = 0.12;
  EXPECT_THAT(said(wrong), AllOf(HasSubstr("tools.press"), HasSubstr("from the object")));
  wrong = recording;
  wrong.tools[0].plane.normal = Vec3::UnitZ();
  EXPECT_THAT(said(wrong), HasSubstr("points away from the object"));
}

/// They were read past their end.
TEST(ContradictoryRecording, TetrahedraOfAnotherNumberOfNodesAreNotLookedAt) {
  const MeshData mesh = cube();
  for (const Eigen::Index columns : {3, 5, 8}) {
    Recording recording;
    recording.rest.volume = TetMesh{mesh.points_m, Tetrahedra::Constant(1, columns, 7)};
    const auto problems = check_recording(recording);
    ASSERT_EQ(problems.size(), 1u);
    EXPECT_EQ(problems[0].where, "rest.volume.tetrahedra");
    EXPECT_THAT(problems[0].what, HasSubstr("has " + std::to_string(columns) + " columns; a tetrahedron has 4 nodes, or 10"));
  }
}

TEST_F(BrokenRecording, AMarkerThatIsThereTwice) {
  const auto with = [&](const std::string& rest) {
    folder.put("recording.yaml", index_text.substr(0, index_text.find("pushes:")) + "markers: {" + rest +
                                     "}\npushes:\n  - name: seen\n    steps:\n      - time_s: 0\n        loads: [{tool: tip, force_n: [0, 0, -1]}]\n"
                                     "        observations: [{kind: markers, sigma_m: 0.001, file: seen.csv}]\n");
  };
  const std::string whole = "name,x_m,y_m,z_m\na,0,0,0.1\nb,0.1,0,0.1\n";
  folder.put("places.csv", whole);
  folder.put("seen.csv", whole);
  with("rest_m: {a: [0, 0, 0.1], b: [0.1, 0, 0.1]}");
  expect_accepted();
  folder.put("seen.csv", whole + "a,0,0,0.09\n");  // the last row won
  expect_refused("seen.csv:4", "marker 'a' is there twice; remove one");
  with("file: places.csv");
  expect_refused("seen.csv:4 (named in", "marker 'a' is there twice; remove one");
  folder.put("places.csv", whole + "b,0.1,0,0.1\n");
  expect_refused("places.csv:4", "marker 'b' is there twice; remove one");
}

TEST_F(BrokenRecording, AllProblemsAreListed) {
  folder.put("clouds/b.xyz", cloud_text(1000));
  MeshData mesh = cube();
  std::swap(mesh.tetrahedra(2, 0), mesh.tetrahedra(2, 1));
  folder.put("rest.msh", mesh_format_named("msh22").write(mesh));
  EXPECT_EQ(check_recording(read_recording_unchecked(folder.path())).size(), 2u);
  expect_refused("rest.msh", "1 more");
}

TEST_F(BrokenRecording, DamagedIndexFilesAreSurvived) {
  const auto read = [&](const std::string& file, const std::string& bytes) {
    folder.put(file, bytes);
    try {
      read_recording(folder.path());
    } catch (const Error& error) {
      EXPECT_FALSE(error.where().empty());
    }
  };
  for (const char* file : {"recording.yaml", "frames.csv", "fixed.csv"}) {
    put_cube_recording(folder);
    const std::string whole = folder.get(file);
    for (const std::string& bytes : truncated(whole)) read(file, bytes);
    for (const std::string& bytes : damaged(whole, 150)) read(file, bytes);
    for (const std::string& bytes : garbage()) read(file, bytes);
  }
}

TEST_F(BrokenRecording, WindowsLineEndsAreFine) {
  for (const char* file : {"recording.yaml", "frames.csv", "fixed.csv", "clouds/a.xyz"})
    folder.put(file, with_crlf(folder.get(file)));
  expect_accepted();
}

TEST_F(BrokenRecording, ANameThatIsNoneSaysWhichThereAre) {
  const std::string with_camera = index_text.substr(0, index_text.find("pushes:")) + camera_text;
  folder.put("recording.yaml", replaced(with_camera, "camera: top", "camera: left"));
  expect_refused("observations[0].camera", "no camera 'left' in 'cameras'; there are top");
  folder.put("recording.yaml", replaced(with_camera, "tool: tip", "tool: hammer"));
  expect_refused("loads[0].tool", "no tool 'hammer' in 'tools'; there are tip");
}

}  // namespace
}  // namespace palpate::io::broken_recording_test
