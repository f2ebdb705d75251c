// SPDX-License-Identifier: Apache-2.0
// What the rows of a depth image or a cloud say, as a quadratic form of where the surface's vertices lie and of the term's own
// unknowns. A residual changes with the three vertices of a triangle only, so the form is sparse: to ask it takes a few per cent
// of what casting the rays again does, and it is right as long as rays meet the triangles that they met.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "palpate/estimation/normal_equations.hpp"
#include "palpate/estimation/terms/term.hpp"

namespace palpate::estimation {

/// Which vertices of a surface are neighbours: where a quadratic form of their places has 3 x 3 blocks.
struct SurfacePattern {
  explicit SurfacePattern(const TriMesh& surface);
  Triangles triangles;
  Index vertices = 0;
  std::vector<std::array<Index, 2>> edges;           ///< vertices, the lower one first
  std::vector<std::array<std::size_t, 3>> edges_of;  ///< a triangle: between its corners 0 and 1, 1 and 2, 2 and 0
};

class SurfaceQuadratic {
 public:
  /// @param rows  of a term, made at `there` and `unknowns` with TermView::surface_slopes
  SurfaceQuadratic(const SurfacePattern& pattern, const TermRows& rows, const Loss& loss, const StepPrediction& there,
                   const VectorX& unknowns);

  /// Unknowns of the term beside the prediction's columns: pose of the frame, offset of the camera, modes of the rest surface's error.
  const std::vector<int>& own() const { return own_; }
  /// Unknown k has the number moved[k] now. False: one is gone.
  bool renumber(const std::vector<int>& moved);

  /// How far a vertex or a point of the frame has moved at most since, m.
  double moved_m(const StepPrediction& there, const VectorX& unknowns, const Unknowns& list) const;
  /// No less than that, of a prediction's coordinates, which may be all of the surface that it has; infinite where they do not tell.
  double moved_at_most_m(const StepPrediction& there, const VectorX& unknowns, const Unknowns& list) const;

  /// True where the prediction's coordinates (StepPrediction::in_span) are those that the rows were made with: its d_surface may
  /// be empty.
  bool shares_span(const StepPrediction& there) const {
    return span_ && there.in_span && there.in_span->is_along(span_->span, span_->loads);
  }

  /// Adds cost, slope and curvature at another prediction. @param places  where in `out` are: the prediction's columns, the own
  /// unknowns
  void add_to(const StepPrediction& there, const VectorX& unknowns, const std::vector<int>& places, Evaluation& out);

 private:
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  struct Seen;
  double of_frame_m(const VectorX& unknowns, const Unknowns& list) const;
  template <int width>
  void gather(const Seen& seen);
  /// What the rows of one facet say.
  struct FacetSum {
    Eigen::Matrix<double, FacetSlopes::shares, FacetSlopes::shares> block = decltype(block)::Zero();
    Eigen::Matrix<double, FacetSlopes::shares, 1> slope = decltype(slope)::Zero();
    bool any = false;  ///< row that counts
  };
  static std::vector<FacetSum> summed_by_facet(const TermRows& rows, const VectorX& weight);
  void gather_facets(const Seen& seen, const std::vector<FacetSum>& sums);
  void gather_noise(const Seen& seen, double each);
  void append_modes(const StepPrediction& there);
  /// Columns `from` to `from + width` of the blocks times `columns`; beyond the last one they count as zero.
  template <int width>
  void multiply(const RowMajor& columns, Index from, RowMajor& out) const;
  RowMajor times_blocks(const RowMajor& columns) const;
  MatrixX shrunk(const MatrixX& of_places) const { return noise_->shrunk(of_places) / noise_weight_; }
  /// The form of coordinates in place of vertices.
  struct InSpan {
    RowMajor block, cross;  ///< coordinates x coordinates, x own
    VectorX slope;
  };
  InSpan summed_up() const;
  /// @param follow  of the form's variables a row: how they follow the prediction's columns, and last how far they have moved
  /// @param bent  the form's block times that  @param cross, slope  the form's, of its variables
  void add_form(const RowMajor& follow, const RowMajor& bent, const RowMajor& cross, const VectorX& slope, const VectorX& unknowns,
                const std::vector<int>& places, Evaluation& out) const;

  std::vector<int> own_;
  VectorX own_at_;
  std::vector<Index> seen_;  ///< vertices that a row looks at: the only ones below
  std::vector<std::array<Index, 2>> edges_;  ///< between two of them, the lower one first
  Points seen_m_;       ///< without the rest surface's error, whose modes are unknowns of their own
  Points seen_there_m_;  ///< with it
  double radius_m_ = 0;
  bool robust_ = false;
  double cost_ = 0;
  double bend_ = 1;  ///< curvature of the loss over the weights, on average: Tukey's bends less than its weights say
  std::vector<Mat3> vertex_blocks_, edge_blocks_;
  RowMajor cross_;  ///< 3 seen x own
  MatrixX own_block_;
  VectorX surface_slope_, own_slope_;
  std::shared_ptr<const SharedNoise> noise_;  ///< nullptr: none
  double noise_weight_ = 1;                   ///< of the rows over those that it was made with
  Eigen::SparseMatrix<double, Eigen::RowMajor> noise_surface_;  ///< places x 3 seen: what its modes and the rows have in common
  std::optional<SpanPlace> span_;  ///< of the surface then, without derivatives; nothing: there is no span
  std::optional<InSpan> in_span_;  ///< made when it is first of use
};

}  // namespace palpate::estimation
