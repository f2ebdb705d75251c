// SPDX-License-Identifier: Apache-2.0
// From nodal displacements to internal forces, energy and tangent. Everything that depends on the mesh alone (shape function
// gradients, sparsity, where each element block goes) is computed once.
#pragma once

#include <vector>

#include "palpate/core/math.hpp"
#include "palpate/core/mesh.hpp"
#include "palpate/fem/materials.hpp"
#include "palpate/fem/sparse_factor.hpp"
#include "palpate/fem/statics.hpp"

namespace palpate::fem {

/// Symmetric matrix of 3 x 3 blocks, lower triangle by block columns (row block >= column block, rows ascending, the
/// diagonal block first and stored whole). Blocks are column-major.
struct BlockPattern {
  Index nodes = 0;
  std::vector<Index> column_start;  ///< nodes + 1
  std::vector<Index> row;           ///< one a block
  Index block_count() const { return static_cast<Index>(row.size()); }
};
using BlockValues = std::vector<double>;  ///< 9 a block

/// y = A x of a symmetric block matrix.
VectorX multiply(const BlockPattern& pattern, const BlockValues& values, const Eigen::Ref<const VectorX>& x);

/// With Dilatation::averaged the volume change theta of quadratic tetrahedra is projected on continuous linear functions
/// (Taylor-Hood, Q theta = sum N_i p_i, M p = integral of N theta): the energy kappa/2 (Q theta)^2 stays a function of u
/// alone, and its tangent K + kappa B' M^-1 B is factorised as the quasi-definite [K B'; B -M/kappa]. The pattern then has
/// one more block node for every corner, of which the first unknown is the pressure and the two others are idle.
class Assembly {
 public:
  /// @param region  an element: its region, 0 and up; empty: one
  /// @throws Error on indices out of range, an inside-out or degenerate element, regions that do not fit the mesh, or a column
  ///         count other than 4 or 10.
  explicit Assembly(const TetMesh& mesh, Dilatation dilatation = Dilatation::pointwise, std::vector<int> region = {});

  /// Factors on the regions' energies. With averaged dilatation they weigh the projection too, so that the energy stays one
  /// function of u. Linear in the factors otherwise. @throws Error unless there is one positive number a region
  void set_region_stiffness(const VectorX& stiffness);
  /// Poisson ratios of regions that have their own (NaN: that of the moduli asked with; empty: all of them). Averaged dilatations
  /// are then weighed with each region's bulk term as well. @throws Error unless there is one number a region, in (-1, 0.5)
  void set_region_poisson(const VectorX& poisson);
  int region_count() const { return static_cast<int>(stiffness_.size()); }  ///< 0: they were not given
  bool has_own_poisson() const { return region_poisson_.size() > 0; }

  Index node_count() const { return nodes_; }
  Index element_count() const { return static_cast<Index>(connectivity_.rows()); }
  const BlockPattern& pattern() const { return pattern_; }
  double volume_m3() const { return volume_; }

  /// Energy [J] and internal forces (3n, newton) of the displacement u (3n). Infinity, and forces undefined, where the law
  /// does not exist. `inverted` counts elements with J <= 0 at a quadrature point.
  double energy_and_forces(const MaterialLaw& law, const Moduli& m, const VectorX& u, VectorX& forces,
                           int* inverted = nullptr) const;

  /// Largest Frobenius norm of the displacement gradient in a quadrature point. Below 1 no element is inside out.
  double largest_gradient(const VectorX& u) const;

  /// Tangent stiffness in the pattern's blocks.
  void tangent(const MaterialLaw& law, const Moduli& m, const VectorX& u, BlockValues& blocks) const;

  /// Product of the tangent in `blocks` (the last one assembled) with a displacement.
  VectorX multiply(const BlockValues& blocks, const VectorX& x) const;
  /// Negative pivots of a stable body's tangent (those of its pressures).
  int expected_negative_pivots() const { return expected_negative_; }
  /// The tangent of a linear law is not linear in (lambda, mu).
  bool is_mixed() const { return pressures_ > 0; }

  /// d(internal forces)/dnu at constant E and u; of the regions without a nu of their own.
  VectorX forces_d_poisson(const MaterialLaw& law, const Moduli& m, const VectorX& u) const;
  /// d(internal forces)/d(a region's own nu).
  VectorX forces_d_region_poisson(const MaterialLaw& law, const Moduli& m, const VectorX& u, int region) const;
  /// d(internal forces)/d log of a region's stiffness at constant u.
  VectorX forces_d_log_stiffness(const MaterialLaw& law, const Moduli& m, const VectorX& u, int region) const;
  /// d(internal forces)/d extra[index] at constant u.
  VectorX forces_d_extra(const MaterialLaw& law, const Moduli& m, const VectorX& u, int index) const;

 private:
  template <int N, int Q, typename Function>
  void for_each_point(const VectorX& u, Function&& function) const;
  template <int N, int Q>
  double energy_and_forces_of(const MaterialLaw& law, const Moduli& m, const VectorX& u, VectorX& forces,
                              int* inverted) const;
  template <int N, int Q>
  void tangent_of(const MaterialLaw& law, const Moduli& m, const VectorX& u, BlockValues& blocks) const;
  template <typename Stress>
  VectorX forces_of(const VectorX& u, Stress&& stress) const;
  template <typename Slope>
  std::vector<double> mean_slope(const MaterialLaw& law, const Moduli& m, const VectorX& u, Slope&& weight_slope) const;
  template <typename Moves>
  VectorX forces_d_poisson_of(const MaterialLaw& law, const Moduli& m, const VectorX& u, Moves&& moves) const;
  /// Readies what of_element and bulk_weight say.
  void prepare_regions(const MaterialLaw& law, const Moduli& m) const;
  const Moduli& of_element(const Moduli& m, Index e) const {
    return region_poisson_.size() == 0 ? m : region_moduli_[static_cast<std::size_t>(region_[static_cast<std::size_t>(e)])];
  }
  /// What a point weighs where dilatations are averaged, over its weight elsewhere.
  double bulk_weight(Index e) const {
    return bulk_share_.size() == 0 ? 1.0 : bulk_share_(region_[static_cast<std::size_t>(e)]);
  }
  template <int N, int Q>
  bool average_dilatation(const MaterialLaw& law, const Moduli& m, const VectorX& u) const;

  void build_pattern();
  void build_patches();
  void build_pressures(const TetMesh& mesh);
  void factorise_pressure_mass() const;
  void weigh_dilatations() const;
  template <int N, int Q>
  void add_pressure_blocks(const MaterialLaw& law, const Moduli& m, const VectorX& u, BlockValues& blocks) const;

  Tetrahedra connectivity_;        // nodes of an element in ascending order: local block a >= b is then a lower block
  std::vector<double> gradients_;  // element, quadrature point, node, 3
  std::vector<double> weights_;    // element, quadrature point: volume times the region's stiffness
  std::vector<double> volumes_;    // element, quadrature point; empty: weights_
  std::vector<int> region_;        // element; empty: one region
  VectorX stiffness_;              // a region
  VectorX region_poisson_;         // a region, NaN: it has none of its own; empty: all
  mutable std::vector<Moduli> region_moduli_;  // a region, where some have their own nu: at the moduli of the last call
  mutable VectorX bulk_share_;     // a region: its bulk term over the largest; empty: 1
  mutable double bulk_pa_ = 0;     // the largest one, at the E of the last call
  std::vector<Index> block_of_;    // element, pairs a >= b
  BlockPattern pattern_;
  double volume_ = 0;

  // Patches over which theta is averaged (empty: pointwise).
  struct Patch {
    std::vector<Index> nodes;   // ascending
    std::vector<Index> blocks;  // pairs a >= b of its nodes, as in block_of_
    double volume = 0;
  };
  mutable std::vector<Patch> patches_;  // volumes follow bulk_share_
  std::vector<Index> patch_of_;  // element
  std::vector<Index> slot_;      // element, node: its place in the patch's nodes
  // Pressures at the corners (none: pointwise or linear elements).
  Index nodes_ = 0, pressures_ = 0;
  std::vector<Index> pressure_of_;     // element, corner in the mesh's order
  std::vector<Index> pressure_block_;  // element, corner, node: block of B
  std::vector<Index> mass_block_;      // element, corner pairs a, b: block of M, -1 above the diagonal
  mutable SparseFactor mass_factor_;
  mutable double modulus_ = 0;  // kappa of the last tangent
  mutable int expected_negative_ = 0;
  mutable std::vector<double> mean_;  // averaged theta at each quadrature point, scratch
};

}  // namespace palpate::fem
