// SPDX-License-Identifier: Apache-2.0
// Slow error of the rest surface, the same at every step: a smooth random displacement of the surface, seen along its normals.
// Frames at rest tell it apart from what the forces do.
#pragma once

#include <memory>
#include <mutex>

#include "palpate/core/mesh.hpp"

namespace palpate::estimation {

/// Offset of surface vertex v along its normal: basis.row(v) . c with independent standard normal coefficients c. The prior is
/// a Gaussian process: covariance of two vertices std_m^2 (n . n') exp(-|x - x'|^2 / (2 correlation_m^2)), in the low rank of
/// points that lie everywhere within 0.65 correlation lengths (Quinonero-Candela and Rasmussen 2005, section 4: subset of
/// regressors), cut to the principal modes that hold 99.5 % of the variance.
class SurfaceField {
 public:
  /// @throws Error when std_m or correlation_m is not positive, or the surface is empty.
  SurfaceField(const TriMesh& rest, double std_m, double correlation_m);

  Index modes() const { return static_cast<Index>(basis_.cols()); }
  const MatrixX& basis() const { return basis_; }    ///< vertices x modes, metres per unit coefficient
  /// basis() times coefficients; the last answer is kept, since all steps of an evaluation ask alike. May be asked by several threads at once.
  std::shared_ptr<const VectorX> offset_m(const VectorX& coefficients) const;
  const Points& normals() const { return normals_; }  ///< of the rest surface, a vertex
  double std_m() const { return std_m_; }

 private:
  double std_m_;
  Points normals_;
  MatrixX basis_;
  mutable std::mutex mutex_;
  mutable VectorX last_coefficients_;
  mutable std::shared_ptr<const VectorX> last_offset_m_;
};

}  // namespace palpate::estimation
