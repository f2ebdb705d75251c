// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/reduced_system.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <cmath>

#include "palpate/core/error.hpp"
#include "palpate/geometry/union_find.hpp"

namespace palpate::fem {

ReducedSystem::ReducedSystem(const BlockPattern& pattern, const std::vector<Constraint>& constraints, MatrixX rigid_border,
                             const Points& nodes_m, int threads, int loads_expected)
    : nodes_(static_cast<Index>(nodes_m.rows())),
      kept_(pattern.nodes, 0),
      special_(pattern.nodes, -1),
      constraints_(constraints),
      factor_(SparseFactor::Options{false, 3, threads}),
      nodes_m_(nodes_m),
      threads_(threads),
      loads_expected_(loads_expected) {
  for (const Constraint& c : constraints_) {
    if (c.count == 3) {
      kept_[c.node] = -1;
    } else if (c.count > 0) {
      special_[c.node] = static_cast<int>(partial_.size());
      partial_.push_back({c.axes, c.count});
    }
  }
  for (Index i = 0; i < pattern.nodes; ++i)
    if (kept_[i] >= 0) {
      kept_[i] = static_cast<Index>(kept_nodes_.size());
      kept_nodes_.push_back(i);
    }
  analyse(pattern);
  if (rigid_border.cols() == 0) return;

  const Eigen::HouseholderQR<MatrixX> qr(rigid_border);
  border_ = MatrixX::Zero(3 * pattern.nodes, rigid_border.cols());
  border_.topRows(3 * nodes_) = qr.householderQ() * MatrixX::Identity(rigid_border.rows(), rigid_border.cols());
  // Three nodes that span the body carry the springs.
  const Vec3 middle = nodes_m.colwise().mean().transpose();
  Index a = 0, b = 0, c = 0;
  (nodes_m.rowwise() - middle.transpose()).rowwise().squaredNorm().maxCoeff(&a);
  (nodes_m.rowwise() - nodes_m.row(a)).rowwise().squaredNorm().maxCoeff(&b);
  double best = -1;
  const Vec3 axis = (nodes_m.row(b) - nodes_m.row(a)).transpose().normalized();
  for (Index i = 0; i < nodes_; ++i) {
    const double distance = axis.cross((nodes_m.row(i) - nodes_m.row(a)).transpose()).squaredNorm();
    if (distance > best) {
      best = distance;
      c = i;
    }
  }
  for (Index node : {a, b, c})
    for (int k = 0; k < 3; ++k) spring_dofs_.push_back(3 * node + k);
}

VectorX ReducedSystem::prescribed_part(const VectorX& u) const {
  VectorX part = VectorX::Zero(u.size());
  for (const Constraint& c : constraints_) {
    const Vec3 value = u.segment<3>(3 * c.node);
    for (int k = 0; k < c.count; ++k) part.segment<3>(3 * c.node) += c.axes.col(k).dot(value) * c.axes.col(k);
  }
  return part;
}

VectorX ReducedSystem::free_part(const VectorX& force) const {
  if (border_.cols() > 0) return force - border_.topRows(3 * nodes_) * (border_.topRows(3 * nodes_).transpose() * force);
  return force - prescribed_part(force);
}

void ReducedSystem::analyse(const BlockPattern& pattern) {
  const Index n = 3 * static_cast<Index>(kept_nodes_.size());
  std::vector<int> outer{0}, inner;
  for (Index node : kept_nodes_) {
    for (int c = 0; c < 3; ++c) {
      for (Index p = pattern.column_start[node]; p < pattern.column_start[node + 1]; ++p) {
        const Index row = kept_[pattern.row[p]];
        if (row < 0) continue;
        for (int r = pattern.row[p] == node ? c : 0; r < 3; ++r) inner.push_back(3 * row + r);
      }
      outer.push_back(static_cast<int>(inner.size()));
    }
  }
  const std::vector<double> values(inner.size(), 0.0);
  lower_ = Eigen::Map<const Eigen::SparseMatrix<double>>(n, n, static_cast<Index>(inner.size()), outer.data(), inner.data(),
                                                         values.data());
}

void ReducedSystem::fill(const BlockPattern& pattern, const BlockValues& blocks, double shift) {
  double* value = lower_.valuePtr();
  const int* outer = lower_.outerIndexPtr();
  double diagonal_sum = 0;
  for (Index reduced = 0; reduced < static_cast<Index>(kept_nodes_.size()); ++reduced) {
    const Index node = kept_nodes_[reduced];
    const int special_column = special_[node];
    double* column[3] = {value + outer[3 * reduced], value + outer[3 * reduced + 1], value + outer[3 * reduced + 2]};
    for (Index p = pattern.column_start[node]; p < pattern.column_start[node + 1]; ++p) {
      const Index row = pattern.row[p];
      if (kept_[row] < 0) continue;
      Mat3 block = Eigen::Map<const Mat3>(&blocks[9 * static_cast<std::size_t>(p)]);
      const int special_row = special_[row];
      if (row == node && shift != 0 && node < nodes_) block.diagonal() *= 1 + shift;
      if (special_row >= 0 || special_column >= 0) {
        const double keep = block.trace() / 3;
        if (special_row >= 0) {
          block = partial_[special_row].axes.transpose() * block;
          block.topRows(partial_[special_row].count).setZero();
        }
        if (special_column >= 0) {
          block = block * partial_[special_column].axes;
          block.leftCols(partial_[special_column].count).setZero();
        }
        if (row == node)
          for (int k = 0; k < partial_[special_row].count; ++k) block(k, k) = keep;
      }
      if (row == node) {
        if (node < nodes_) diagonal_sum += block.trace();
        for (int c = 0; c < 3; ++c)
          for (int r = c; r < 3; ++r) *column[c]++ = block(r, c);
      } else {
        for (int c = 0; c < 3; ++c)
          for (int r = 0; r < 3; ++r) *column[c]++ = block(r, c);
      }
    }
  }
  if (!spring_dofs_.empty()) {
    spring_ = diagonal_sum / static_cast<double>(3 * nodes_);
    for (Index dof : spring_dofs_) value[outer[dof]] += spring_;
  }
}

bool ReducedSystem::factorise(const BlockPattern& pattern, const BlockValues& blocks, double shift, int negative) {
  use_indefinite_ = false;
  if (negative == 0) {
    if (!analysed_) factor_.analyse(lower_);
    analysed_ = true;
    fill(pattern, blocks, shift);
    if (factor_.factorise(lower_)) return complete_border();
    if (border_.cols() == 0) return false;
  }
  // A free body under compression may be stable although its springs alone do not hold it: the inertia of the whole bordered
  // matrix decides. Stable means that only pressures and the six multipliers are negative.
  if (!factorise_indefinite(pattern, blocks, shift)) return false;
  auto found = static_cast<Index>(indefinite_->negative_pivots());
  if (border_.cols() > 0) {
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(schur_, Eigen::EigenvaluesOnly);
    found += static_cast<Index>((eigen.eigenvalues().array() > 0).count());
  }
  return found == negative + border_.cols();
}

bool ReducedSystem::factorise_indefinite(const BlockPattern& pattern, const BlockValues& blocks, double shift) {
  if (!indefinite_) {
    indefinite_.emplace(SparseFactor::Options{true, 3, threads_});
    indefinite_->analyse(lower_);
  }
  use_indefinite_ = true;
  fill(pattern, blocks, shift);
  return indefinite_->factorise(lower_) && complete_border();
}

void ReducedSystem::solve_reduced(MatrixX& reduced) const {
  if (reduced.rows() > 0) (use_indefinite_ ? *indefinite_ : factor_).solve_in_place(reduced);
}

bool ReducedSystem::complete_border() {
  if (border_.cols() == 0) return true;
  // [K_s  B  -E; B' 0 0; E' 0 -1/spring] with E'u = w / spring: eliminate u, keep the 15 x 15 Schur complement.
  const Index border = static_cast<Index>(border_.cols()), springs = static_cast<Index>(spring_dofs_.size());
  MatrixX columns = MatrixX::Zero(border_.rows(), border + springs);
  columns.leftCols(border) = border_;
  for (Index s = 0; s < springs; ++s) columns(spring_dofs_[s], border + s) = -1;
  border_solution_ = columns;
  solve_reduced(border_solution_);
  schur_ = columns.transpose() * border_solution_;
  schur_.bottomRightCorner(springs, springs).diagonal().array() -= 1 / spring_;
  schur_inverse_ = schur_.inverse();
  return schur_inverse_.allFinite();
}

MatrixX ReducedSystem::reduce(const MatrixX& full) const {
  MatrixX reduced(3 * kept_nodes_.size(), full.cols());
  for (std::size_t i = 0; i < kept_nodes_.size(); ++i) {
    if (kept_nodes_[i] < nodes_)
      reduced.middleRows<3>(3 * i) = full.middleRows<3>(3 * kept_nodes_[i]);
    else
      reduced.middleRows<3>(3 * i).setZero();
  }
  for (const Constraint& c : constraints_)
    if (c.count > 0 && c.count < 3) {
      auto rows = reduced.middleRows<3>(3 * kept_[c.node]);
      rows = (c.axes.transpose() * rows).eval();
      rows.topRows(c.count).setZero();
    }
  return reduced;
}

MatrixX ReducedSystem::expand(const MatrixX& reduced) const {
  MatrixX full = MatrixX::Zero(3 * nodes_, reduced.cols());
  for (std::size_t i = 0; i < kept_nodes_.size() && kept_nodes_[i] < nodes_; ++i)
    full.middleRows<3>(3 * kept_nodes_[i]) = reduced.middleRows<3>(3 * i);
  for (const Constraint& c : constraints_)
    if (c.count > 0 && c.count < 3) {
      auto rows = full.middleRows<3>(3 * c.node);
      rows = (c.axes * rows).eval();
    }
  return full;
}

MatrixX ReducedSystem::solve(const MatrixX& right_hand_sides) const {
  if (right_hand_sides.cols() == 0) return MatrixX::Zero(3 * nodes_, 0);
  MatrixX reduced = reduce(right_hand_sides);
  solve_reduced(reduced);
  if (border_.cols() > 0) {
    const Index border = static_cast<Index>(border_.cols()), springs = static_cast<Index>(spring_dofs_.size());
    MatrixX t(border + springs, reduced.cols());
    t.topRows(border) = border_.transpose() * reduced;
    for (Index s = 0; s < springs; ++s) t.row(border + s) = -reduced.row(spring_dofs_[s]);
    reduced -= border_solution_ * (schur_inverse_ * t);
  }
  return expand(reduced);
}

bool ReducedSystem::takes_any_method() const {
  // Pressures stand behind the mesh's nodes: their matrix is not definite.
  return border_.cols() == 0 && static_cast<Index>(kept_.size()) == nodes_;
}

UnknownPlacement ReducedSystem::placement() const {
  UnknownPlacement out{Points(lower_.cols(), 3), Points::Zero(lower_.cols(), 3)};
  for (Index reduced = 0; reduced < static_cast<Index>(kept_nodes_.size()); ++reduced) {
    const Index node = kept_nodes_[static_cast<std::size_t>(reduced)];
    const int special = special_[static_cast<std::size_t>(node)];
    for (int k = 0; k < 3; ++k) {
      out.point_m.row(3 * reduced + k) = nodes_m_.row(node);
      if (special < 0)
        out.direction(3 * reduced + k, k) = 1;
      else if (k >= partial_[static_cast<std::size_t>(special)].count)  // what is held takes part in no rigid motion
        out.direction.row(3 * reduced + k) = partial_[static_cast<std::size_t>(special)].axes.col(k).transpose();
    }
  }
  return out;
}

void ReducedSystem::set_matrix(const BlockPattern& pattern, const BlockValues& blocks, double shift) {
  if (!any_) {
    LinearSolver::Options options;
    options.threads = threads_;
    options.expected = loads_expected_;
    any_.emplace(options);
    any_->analyse(lower_, placement());
  }
  fill(pattern, blocks, shift);
  any_->set_matrix(lower_);
}

LinearSolver::Outcome ReducedSystem::solve_by_any(const MatrixX& right_hand_sides, double tolerance, MatrixX& du) {
  MatrixX reduced = reduce(right_hand_sides);
  const LinearSolver::Outcome outcome = any_->solve_in_place(reduced, nullptr, tolerance);
  du = expand(reduced);
  return outcome;
}

MatrixX rigid_motions(const Points& nodes_m) {
  const Vec3 low = nodes_m.colwise().minCoeff().transpose(), high = nodes_m.colwise().maxCoeff().transpose();
  const Vec3 centre = 0.5 * (low + high);
  const double size = std::max((high - low).norm(), 1e-300);
  MatrixX modes = MatrixX::Zero(3 * nodes_m.rows(), 6);
  for (Index i = 0; i < nodes_m.rows(); ++i) {
    const Vec3 arm = (nodes_m.row(i).transpose() - centre) / size;
    for (int k = 0; k < 3; ++k) {
      modes(3 * i + k, k) = 1;
      modes.block<3, 1>(3 * i, 3 + k) = Vec3::Unit(k).cross(arm);
    }
  }
  return modes;
}

namespace {

/// A node's part; -1 for nodes of no element, which nothing has to hold.
std::vector<Index> connected_parts(const TetMesh& mesh, Index& count) {
  geometry::UnionFind parts(mesh.nodes_m.rows());
  for (Index e = 0; e < mesh.tetrahedra.rows(); ++e)
    for (int a = 1; a < mesh.tetrahedra.cols(); ++a) parts.join(mesh.tetrahedra(e, 0), mesh.tetrahedra(e, a));
  std::vector<Index> label(mesh.nodes_m.rows(), -1), part(mesh.nodes_m.rows(), -1);
  std::vector<char> used(mesh.nodes_m.rows(), 0);
  for (Index i = 0; i < mesh.tetrahedra.size(); ++i) used[mesh.tetrahedra.data()[i]] = 1;
  count = 0;
  for (std::size_t i = 0; i < part.size(); ++i) {
    if (used[i] == 0) continue;
    const Index root = parts.root(static_cast<Index>(i));
    if (label[root] < 0) label[root] = count++;
    part[i] = label[root];
  }
  return part;
}

std::string describe(const Eigen::Matrix<double, 6, 1>& motion) {
  static const char* const names[6] = {"translation along x", "translation along y", "translation along z",
                                       "rotation about x",    "rotation about y",    "rotation about z"};
  Index largest = 0;
  motion.cwiseAbs().maxCoeff(&largest);
  return names[largest];
}

}  // namespace

void check_supported(const TetMesh& mesh, const std::vector<Constraint>& constraints) {
  const MatrixX modes = rigid_motions(mesh.nodes_m);
  Index parts = 0;
  const std::vector<Index> part = connected_parts(mesh, parts);
  std::vector<Eigen::Matrix<double, 6, 6>> gram(parts, Eigen::Matrix<double, 6, 6>::Zero());
  for (const Constraint& c : constraints) {
    if (part[c.node] < 0) continue;
    const MatrixX rows = c.axes.leftCols(c.count).transpose() * modes.middleRows<3>(3 * c.node);
    gram[part[c.node]] += rows.transpose() * rows;
  }
  for (Index p = 0; p < parts; ++p) {
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>> eigen(gram[p]);
    const double largest = eigen.eigenvalues()(5);
    if (eigen.eigenvalues()(0) > 1e-9 * largest && largest > 0) continue;
    const std::string motion = describe(eigen.eigenvectors().col(0));
    const std::string which =
        parts > 1 ? " of part " + std::to_string(p + 1) + " of " + std::to_string(parts) + " of the mesh" : "";
    throw Error("the supports leave the " + motion + which + " free: hold more nodes, or say that the object is free",
                "supports");
  }
}

}  // namespace palpate::fem
