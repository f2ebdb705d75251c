// label: oracle
// SPDX-License-Identifier: Apache-2.0
// What `palpate paper` gives both methods.
#include "cli/paper_inputs.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "estimation/coverage_rows.hpp"
#include "palpate/fem/boundary.hpp"
#include "palpate/geometry/triangle_tree.hpp"

namespace palpate::cli::paper_inputs_test {
namespace {

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
  const Prepared prepared = prepare(observed(recording), {}, nullptr, {}, nullptr);
  ASSERT_TRUE(prepared.finer);
  EXPECT_LT(off_m(ball.surface, prepared.finer->object.mesh), 0.8 * off_m(ball.surface, prepared.object.mesh));
}

}  // namespace
}  // namespace palpate::cli::paper_inputs_test
