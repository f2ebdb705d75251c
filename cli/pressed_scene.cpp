// SPDX-License-Identifier: Apache-2.0
#include "cli/pressed_scene.hpp"

#include <fmt/format.h>

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <vector>

#include "palpate/core/error.hpp"
#include "palpate/estimation/held_body.hpp"
#include "palpate/estimation/held_patch.hpp"
#include "palpate/estimation/load_columns.hpp"
#include "palpate/estimation/rigid_tool.hpp"
#include "palpate/fem/boundary.hpp"

namespace palpate::cli {
namespace {

bool has_place(const Tool& tool) { return tool.shape != ToolShape::vertices && tool.shape != ToolShape::platen; }

/// As ForwardModel::given_way_along has it, with the compliance that the fit found.
prediction::RigidWay way_given(const LearnedObject& learned, const Tool& tool, const Load& load) {
  prediction::RigidWay way;
  const TetMesh& mesh = *learned.object.rest.volume;
  for (const Support& support : learned.object.supports) {
    double compliance_m_per_n = support.compliance_m_per_n;
    for (const Nuisance& found : learned.answer.nuisances)
      if (found.name == "support_compliance[" + support.name + "]") compliance_m_per_n += found.value;
    if (!(compliance_m_per_n > 0)) continue;
    const estimation::HeldPatch patch(mesh, support);
    way.pivot_m = patch.middle_m;
    way.per_newton.topRows<3>() = compliance_m_per_n * Mat3::Identity();
    if (!has_place(tool)) break;
    // Along an axis that a narrow support does not hold it against turning, it does not turn.
    const Eigen::CompleteOrthogonalDecomposition<Mat3> turning(patch.turning_m2);
    const Vec3 arm_m = load.contact_m - patch.middle_m;
    for (int d = 0; d < 3; ++d)
      way.per_newton.block<3, 1>(3, d) = compliance_m_per_n * turning.solve(Vec3(arm_m.cross(Vec3::Unit(d))));
    break;
  }
  return way;
}

/// What the free motions are where the load acts, 3 x f: of a patch its mean.
MatrixX free_motions_at(const PressedScene& scene, const TetMesh& mesh, const Load& load) {
  if (!scene.around.moves_a_tool()) return scene.boundary.forces.leftCols(3).transpose() * scene.free_motions;
  Index nearest = 0;
  (mesh.nodes_m.rowwise() - load.contact_m.transpose()).rowwise().squaredNorm().minCoeff(&nearest);
  return scene.free_motions.middleRows<3>(3 * nearest);
}

constexpr double rounding = 1e-6;

}  // namespace

bool moves_rigidly(const Identification& answer, const Tool& tool) {
  if (tool.shape == ToolShape::platen) return true;
  const auto named = [&](const StepFit& step) { return step.tool == tool.name; };
  const bool known = std::any_of(answer.steps.begin(), answer.steps.end(), named);  // earlier versions do not say
  return std::any_of(answer.steps.begin(), answer.steps.end(),
                     [&](const StepFit& step) { return (!known || named(step)) && std::isfinite(step.force_predicted_n); });
}

PressedScene pressed_scene(const LearnedObject& learned, const Tool& tool, const Load& load, bool rigid) {
  const Recording& object = learned.object;
  const TetMesh& mesh = *object.rest.volume;
  PressedScene scene;
  const bool touches = rigid && estimation::touches_rigidly(tool);
  const bool moves_nodes = rigid && !touches;
  if (object.free) {
    if (moves_nodes)
      throw Error("a platen presses an object against something, and this one was learned free; press it with another tool, or learn it on what holds it",
                  "tools." + tool.name);
    scene.boundary.inertia_relief = true;
    scene.boundary.motions.resize(3 * mesh.nodes_m.rows(), 0);
    scene.free_motions.resize(3 * mesh.nodes_m.rows(), 0);
  } else {
    std::vector<const Tool*> platens;
    if (moves_nodes) platens.push_back(&tool);
    estimation::HeldBody held = estimation::hold(mesh, object.supports, platens);
    scene.boundary.constraints = std::move(held.constraints);
    scene.boundary.motions = std::move(held.motions);
    scene.free_motions = std::move(held.free_motions);
    scene.around.contacts = std::move(held.contacts);
    scene.around.gives_way = way_given(learned, tool, load);
  }
  scene.around.contact_m = has_place(tool) ? load.contact_m : scene.around.gives_way.pivot_m;
  if (moves_nodes) scene.around.platen = 0;
  if (touches) {
    scene.around.tool = scene.around.contacts.size();
    scene.around.contacts.push_back(estimation::rigid_tool(mesh, tool, load));
  }

  std::vector<Eigen::Triplet<double>> entries;
  int columns = 0;
  const auto put = [&](const Eigen::SparseMatrix<double>& three) {
    for (int c = 0; c < 3; ++c)
      for (Eigen::SparseMatrix<double>::InnerIterator it(three, c); it; ++it)
        entries.emplace_back(int(it.row()), columns + c, it.value());
    columns += 3;
  };
  if (!rigid) put(estimation::load_columns(mesh, tool, load));
  // Of a shape that was seen while it sagged, the weight is in the shape; it still holds down what may lift off.
  const bool lies = !scene.around.contacts.empty() && object.density_kg_m3 > 0;
  if ((object.rest.state == RestState::stress_free || lies) && object.environment.gravity_m_s2.norm() > 0) {
    if (!(object.density_kg_m3 > 0))
      throw Error("gravity acts, so the density is needed", "model/recording.yaml: density_kg_m3");
    put(fem::body_force(mesh));
    scene.background = object.density_kg_m3 * object.environment.gravity_m_s2;
  }
  scene.boundary.forces.resize(3 * mesh.nodes_m.rows(), columns);
  scene.boundary.forces.setFromTriplets(entries.begin(), entries.end());
  return scene;
}

double unheld_n(const PressedScene& scene, const TetMesh& mesh, const Load& load, const Vec3& force_n) {
  if (scene.free_motions.cols() == 0 || scene.around.platen) return 0;
  return (free_motions_at(scene, mesh, load).transpose() * force_n).norm();
}

void must_be_held(const PressedScene& scene, const TetMesh& mesh, const Load& load, const std::string& where) {
  if (scene.free_motions.cols() == 0) return;
  if (scene.background.size() > 0) {
    const VectorX weight = scene.boundary.forces.rightCols(3) * scene.background;
    if ((scene.free_motions.transpose() * weight).cwiseAbs().maxCoeff() > rounding * weight.lpNorm<1>())
      throw Error("the supports leave the object free to slide, and its weight pulls it that way; learn it again with the support that holds it",
                  "model/recording.yaml: supports");
  }
  if (!(unheld_n(scene, mesh, load, load.direction) > rounding)) return;
  const MatrixX there = free_motions_at(scene, mesh, load);
  const Vec3 way = (there * (there.transpose() * load.direction)).normalized().unaryExpr([](double one) { return std::abs(one) < 1e-9 ? 0.0 : one; });
  throw Error(fmt::format("nothing holds the object along {:.3g} {:.3g} {:.3g}: it would slide away. Push across that, or learn it with a support that "
                          "holds it (bonded, or a table or wall with friction)",
                          way.x(), way.y(), way.z()),
              where);
}

}  // namespace palpate::cli
