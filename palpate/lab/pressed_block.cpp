// SPDX-License-Identifier: Apache-2.0
#include "palpate/lab/pressed_block.hpp"

#include <cmath>
#include <string>
#include <vector>

#include "palpate/core/error.hpp"
#include "palpate/fem/boundary.hpp"
#include "palpate/fem/statics.hpp"
#include "palpate/lab/graded_block.hpp"

namespace palpate::lab {

struct PressedBlock::Impl {
  explicit Impl(const PressedBlockOptions& given) : options_(given) {
    const PressedBlockOptions& options = options_;
    const Vec3& size = options.size_m;
    // The mesh is made for a pad on its top: a block that is pressed at its side lies on its back while it is solved.
    if (options.at_side) R_base_mesh_ << 0, 0, -1, 0, 1, 0, 1, 0, 0;
    const Vec3 direction = R_base_mesh_.transpose() * options.direction;
    if (std::abs(direction.norm() - 1) > 1e-6 || std::abs(direction.y()) > 1e-9 || !(direction.z() < -0.1))
      throw Error("must have unit length, lie in the plane y = 0 and point into the face", "PressedBlockOptions.direction");
    GradedBlockOptions block;
    if (options.at_side) {
      block.min_m = {0, 0, -0.5 * size.x()};
      block.max_m = {size.z(), 0.5 * size.y(), 0.5 * size.x()};
    } else {
      block.min_m = {-0.5 * size.x(), 0, 0};
      block.max_m = {0.5 * size.x(), 0.5 * size.y(), size.z()};
    }
    block.contact_m = {options.site_m, 0, block.max_m.z()};
    block.contact_radius_m = options.pad_radius_m;
    block.cells_in_radius = options.cells_in_radius;
    block.largest_cell_m *= options.cell_share;
    block.edge_cell_m *= options.cell_share;
    mesh_ = fem::to_quadratic(graded_block(block));
    const std::vector<Index> under_pad = contact_nodes(mesh_, block);

    fem::Boundary boundary;
    for (Index n = 0; n < Index(mesh_.nodes_m.rows()); ++n) {
      if (mesh_.nodes_m(n, options.at_side ? 0 : 2) < 1e-9) {
        boundary.constraints.push_back({n, Mat3::Identity(), 3});
      } else if (mesh_.nodes_m(n, 1) < 1e-9) {
        Mat3 axes;
        axes << Vec3::UnitY(), Vec3::UnitZ(), Vec3::UnitX();
        boundary.constraints.push_back({n, axes, 1});
      }
    }
    // Uniform traction on a flat quadratic face: a third of its force at each midpoint, nothing at the corners.
    std::vector<char> inside(std::size_t(mesh_.nodes_m.rows()), 0);
    for (const Index n : under_pad) inside[std::size_t(n)] = 1;
    share_ = VectorX::Zero(mesh_.nodes_m.rows());
    const Tetrahedra faces = fem::boundary_faces(mesh_);
    for (Eigen::Index f = 0; f < faces.rows(); ++f) {
      if (!inside[std::size_t(faces(f, 0))] || !inside[std::size_t(faces(f, 1))] || !inside[std::size_t(faces(f, 2))])
        continue;
      const Vec3 a = mesh_.nodes_m.row(faces(f, 0)), b = mesh_.nodes_m.row(faces(f, 1)), c = mesh_.nodes_m.row(faces(f, 2));
      const double area = 0.5 * (b - a).cross(c - a).norm();
      for (int k = 3; k < 6; ++k) share_(faces(f, k)) += area / 3;
    }
    share_ /= share_.sum();
    std::vector<Eigen::Triplet<double>> entries;
    for (Index n = 0; n < Index(share_.size()); ++n)
      for (int k = 0; k < 3; k += 2)
        if (share_(n) != 0) entries.emplace_back(3 * n + k, 0, share_(n) * direction(k));
    boundary.forces.resize(3 * mesh_.nodes_m.rows(), 1);
    boundary.forces.setFromTriplets(entries.begin(), entries.end());

    fem::StaticsOptions statics;
    if (options.poisson_ratio > 0.45) statics.dilatation = fem::Dilatation::averaged;
    statics.residual_tolerance = 1e-7;  // five orders below the sensors' errors
    follows_ = options.material == "foam";
    if (!follows_) {
      statics_ = std::make_unique<fem::Statics>(mesh_, options.material, std::move(boundary), statics);
    } else {
      boundary_ = boundary;
      options_of_statics_ = statics;
      statics.max_load_steps = 0;
      near_ = std::make_unique<fem::Statics>(mesh_, options.material, std::move(boundary), statics);
    }
    half_surface_ = fem::boundary_triangles(mesh_);
  }

  void press(double force_n) {
    if (follows_ && reach(force_n, *near_).empty()) return;
    if (!statics_) statics_ = std::make_unique<fem::Statics>(mesh_, options_.material, boundary_, options_of_statics_);
    const std::string reason = reach(force_n, *statics_);
    if (!reason.empty())
      throw Error("the true block found no equilibrium under " + std::to_string(force_n) + " N (" + reason + "): press less deep", "PressedBlock");
  }

  /// A foam, which softens, has folds all along its way: it is found from rest after minutes, and beyond the most that it bears not
  /// at all. Other laws stiffen again and are pressed.
  bool follow(double force_n) {
    if (follows_) return reach(force_n, *near_).empty();
    press(force_n);
    return true;
  }

  /// Deforms the block by a force (newton, on the whole of it), from the last state, extrapolated; why it did not get there, or
  /// nothing.
  std::string reach(double force_n, const fem::Statics& statics) {
    const VectorX coefficient = VectorX::Constant(1, 0.5 * force_n);
    const VectorX start = displacement_m_.size() ? VectorX(force_n / force_n_ * displacement_m_) : VectorX();
    const VectorX extra = Eigen::Map<const VectorX>(options_.extra.data(), Eigen::Index(options_.extra.size()));
    fem::Equilibrium state = statics.solve(options_.young_modulus_pa, options_.poisson_ratio, coefficient, VectorX(0),
                                           start.size() ? &start : nullptr, extra);
    if (!state.converged) return state.reason;
    displacement_m_ = std::move(state.displacement_m);
    force_n_ = force_n;
    return {};
  }

  /// Mean motion of the pad's face into the block.
  double travel_m() const {
    double travel = 0;
    const Vec3 direction = R_base_mesh_.transpose() * options_.direction;
    for (Eigen::Index n = 0; n < share_.size(); ++n) travel += share_(n) * displacement_m_.segment<3>(3 * n).dot(direction);
    return travel;
  }

  /// Both halves, deformed, in the base frame.
  TriMesh surface() const {
    const Eigen::Index n = mesh_.nodes_m.rows();
    TriMesh whole;
    whole.vertices_m.resize(2 * n, 3);
    for (Eigen::Index i = 0; i < n; ++i) {
      Vec3 p = mesh_.nodes_m.row(i);
      if (displacement_m_.size()) p += displacement_m_.segment<3>(3 * i);
      whole.vertices_m.row(i) = options_.base_centre_m + R_base_mesh_ * p;
      whole.vertices_m.row(n + i) = options_.base_centre_m + R_base_mesh_ * Vec3(p.x(), -p.y(), p.z());
    }
    std::vector<Eigen::RowVector3i> kept;
    for (Eigen::Index t = 0; t < half_surface_.rows(); ++t) {
      const auto corner = half_surface_.row(t);
      if (mesh_.nodes_m(corner(0), 1) < 1e-9 && mesh_.nodes_m(corner(1), 1) < 1e-9 && mesh_.nodes_m(corner(2), 1) < 1e-9)
        continue;  // the cut through the middle
      kept.emplace_back(corner(0), corner(1), corner(2));
      kept.emplace_back(int(n) + corner(0), int(n) + corner(2), int(n) + corner(1));
    }
    whole.triangles.resize(Eigen::Index(kept.size()), 3);
    for (std::size_t t = 0; t < kept.size(); ++t) whole.triangles.row(Eigen::Index(t)) = kept[t];
    return whole;
  }

  PressedBlockOptions options_;
  Mat3 R_base_mesh_ = Mat3::Identity();
  TetMesh mesh_;  // in its own frame: pressed at its highest face
  Triangles half_surface_;
  VectorX share_;           // of the pad's force, a node
  VectorX displacement_m_;  // empty = at rest
  double force_n_ = 0;
  bool follows_ = false;
  std::unique_ptr<fem::Statics> near_, statics_;  // without and with the way from rest; the latter once it is needed, where both are
  fem::Boundary boundary_;
  fem::StaticsOptions options_of_statics_;
};

PressedBlock::PressedBlock(const PressedBlockOptions& options) : impl_(std::make_unique<Impl>(options)) {}
PressedBlock::~PressedBlock() = default;
PressedBlock::PressedBlock(PressedBlock&&) noexcept = default;
PressedBlock& PressedBlock::operator=(PressedBlock&&) noexcept = default;
void PressedBlock::press(double force_n) { impl_->press(force_n); }
bool PressedBlock::follow(double force_n) { return impl_->follow(force_n); }
double PressedBlock::force_n() const { return impl_->force_n_; }
double PressedBlock::travel_m() const { return impl_->displacement_m_.size() ? impl_->travel_m() : 0.0; }
TriMesh PressedBlock::surface() const { return impl_->surface(); }
Index PressedBlock::nodes() const { return Index(impl_->mesh_.nodes_m.rows()); }
const TetMesh& PressedBlock::mesh() const { return impl_->mesh_; }

}  // namespace palpate::lab
