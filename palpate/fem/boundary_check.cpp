// SPDX-License-Identifier: Apache-2.0
#include <Eigen/QR>

#include "palpate/core/error.hpp"
#include "palpate/fem/statics.hpp"

namespace palpate::fem {

Boundary checked(const TetMesh& mesh, Boundary boundary) {
  const Index n = static_cast<Index>(mesh.nodes_m.rows());
  std::vector<char> used(n, 0), constrained(n, 0);
  for (Index e = 0; e < mesh.tetrahedra.rows(); ++e)
    for (int a = 0; a < mesh.tetrahedra.cols(); ++a) used[mesh.tetrahedra(e, a)] = 1;
  for (Constraint& c : boundary.constraints) {
    if (c.node < 0 || c.node >= n)
      throw Error("names node " + std::to_string(c.node) + ", the mesh has " + std::to_string(n), "boundary.constraints");
    if (c.count < 0 || c.count > 3) throw Error("count must be 0 to 3", "boundary.constraints");
    if (constrained[c.node]) throw Error("node " + std::to_string(c.node) + " is constrained twice", "boundary.constraints");
    constrained[c.node] = 1;
    const auto given = c.axes.leftCols(c.count);
    if (!(given.transpose() * given).isApprox(MatrixX::Identity(c.count, c.count), 1e-6) && c.count > 0)
      throw Error("axes of node " + std::to_string(c.node) + " are not orthonormal", "boundary.constraints");
    if (c.count > 0) {
      const Eigen::HouseholderQR<Eigen::Matrix<double, 3, Eigen::Dynamic>> qr(given);
      const Mat3 q = qr.householderQ();
      c.axes.rightCols(3 - c.count) = q.rightCols(3 - c.count);
      if (c.count == 3) c.axes.setIdentity();
    }
  }
  if (boundary.inertia_relief && !boundary.constraints.empty())
    throw Error("a free object (inertia relief) cannot have constraints as well", "boundary.inertia_relief");
  for (Index i = 0; i < n; ++i)
    if (!used[i] && !constrained[i]) boundary.constraints.push_back({i, Mat3::Identity(), 3});
  const auto sized = [n](Eigen::SparseMatrix<double>& columns, const char* name) {
    if (columns.cols() == 0) columns.resize(3 * n, 0);
    if (columns.rows() != 3 * n)
      throw Error("needs " + std::to_string(3 * n) + " rows, has " + std::to_string(columns.rows()), name);
  };
  sized(boundary.forces, "boundary.forces");
  sized(boundary.motions, "boundary.motions");
  for (Index k = 0; k < boundary.motions.outerSize(); ++k)
    for (Eigen::SparseMatrix<double>::InnerIterator it(boundary.motions, k); it; ++it)
      if (it.value() != 0 && !constrained[it.row() / 3])
        throw Error("moves node " + std::to_string(it.row() / 3) + ", which no constraint holds", "boundary.motions");
  return boundary;
}

}  // namespace palpate::fem
