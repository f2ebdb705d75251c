// label: oracle
// SPDX-License-Identifier: Apache-2.0
// What the studies of `palpate paper` show on one seed, against the truth of the lab.
#include "cli/paper_studies.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "cli/paper_inputs.hpp"
#include "estimation/coverage_rows.hpp"
#include "palpate/fem/boundary.hpp"
#include "palpate/geometry/triangle_tree.hpp"

namespace palpate::cli::paper_studies_test {
namespace {

bool holds(const StudyRow& row) {
  return row.palpate.lower_95_pa <= row.young_modulus_pa && row.young_modulus_pa <= row.palpate.upper_95_pa;
}

TEST(PaperStudies, APointLoadPutsBothMethodsOffAndPalpatesOwnModelDoesNot) {
  const auto rows = study_of("meshes")->run({}, {});
  ASSERT_EQ(rows.size(), 7u);
  const StudyRow &point = rows[0], &finer = rows[1], &own = rows[5], &to_surface = rows[6];
  // A point has no size but the mesh's: E goes where that puts it.
  EXPECT_GT(std::abs(std::log(finer.paper.young_modulus_pa / point.paper.young_modulus_pa)), 0.3);
  EXPECT_GT(std::abs(std::log(finer.palpate.young_modulus_pa / point.palpate.young_modulus_pa)), 0.3);
  EXPECT_GT(std::abs(std::log(point.palpate.young_modulus_pa / rows[2].palpate.young_modulus_pa)), 0.3) << "the same mesh under the patch";
  EXPECT_FALSE(point.palpate.verdicts.empty()) << "a wrong load must not pass in silence";
  EXPECT_TRUE(holds(own));
  EXPECT_TRUE(own.palpate.verdicts.empty());
  // What the metric does is apart from mesh and load.
  EXPECT_TRUE(std::isfinite(to_surface.paper.young_modulus_pa));
  EXPECT_NE(to_surface.paper.young_modulus_pa, own.paper.young_modulus_pa);
}

/// Root mean square of how far the surface's vertices lie from the mesh's outline.
double off_m(const TriMesh& surface, const TetMesh& mesh) {
  const geometry::TriangleTree outline({mesh.nodes_m, fem::boundary_triangles(mesh)});
  double sum_m2 = 0;
  for (Index v = 0; v < surface.vertices_m.rows(); ++v) sum_m2 += outline.closest(surface.vertices_m.row(v)).squared_distance_m2;
  return std::sqrt(sum_m2 / static_cast<double>(surface.vertices_m.rows()));
}

// Where a mesh leaves a round object's surface it errs, too: the one that shows its error leaves it less.
TEST(PaperInputs, TheFinerMeshFollowsARoundSurface) {
  const coverage::SceneSpec ball = coverage::ball_top();
  Recording recording;
  recording.rest.surface = ball.surface;
  recording.supports = ball.supports;
  Tool pad;
  pad.name = "pad";
  pad.shape = ToolShape::disc;
  pad.radius_m = ball.pad_radius_m;
  recording.tools = {pad};
  Load load;
  load.tool = pad.name;
  load.contact_m = ball.contact_m;
  load.direction = ball.direction;
  load.force_n = ball.direction;
  Push push;
  push.steps.resize(2);
  push.steps[1].loads = {load};
  recording.pushes = {push};
  const Prepared prepared = prepare(recording, {}, nullptr, {}, nullptr);
  ASSERT_TRUE(prepared.finer);
  EXPECT_LT(off_m(ball.surface, prepared.finer->object.mesh), 0.8 * off_m(ball.surface, prepared.object.mesh));
}

}  // namespace
}  // namespace palpate::cli::paper_studies_test
