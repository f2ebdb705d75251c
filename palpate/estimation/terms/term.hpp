// SPDX-License-Identifier: Apache-2.0
// A measurement term: what one observation of one step says about the unknowns, as whitened residuals with exact derivatives.
// A new sensor joins with one class and one line in terms/table.cpp; tests/estimation/term_contract_test.cpp checks every term's
// derivatives against finite differences.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "palpate/core/lens_scatter.hpp"
#include "palpate/core/recording.hpp"
#include "palpate/estimation/forward_model.hpp"
#include "palpate/estimation/shared_noise.hpp"
#include "palpate/estimation/unknowns.hpp"

namespace palpate::estimation {

/// Depth pixels of one frame as rays in the base frame (made by the room `sensing`).
struct RayObservation {
  RayCloud rays;
  double pose_std_m = 0, pose_std_rad = 0;
  double bias_std_m = 0;  ///< one common depth offset a push and camera
  std::optional<LensScatter> scatter = {};  ///< nothing: the lens spreads no light. One share for all frames
  /// The camera of several frames, whose pose errs alike in all of them, seen from itself; empty: this frame errs alone. What is
  /// common and what is the frame's own have a standard deviation of pose_std each: a calibration errs in the one way, an arm
  /// that carries the camera in the other, and the images tell which.
  std::string camera = {};
  Mat3 R_base_camera = Mat3::Identity();
  /// Rays that pass the simulated object's outline more closely than this do not count: their pixels may mix it with what is
  /// behind, or be those that their mixed neighbours left. 0: all count.
  double outline_margin_rad = 0;
};

using TermInput = std::variant<RayObservation, PointCloud, Markers, ToolTravel, Wrench>;

/// Whether a ray counts: not where it passes the object by, and not where it grazes it, which says little and nothing against
/// the fit.
enum RayChoice : char { passes_by = 0, counts_in = 1, grazes = 2 };

/// How a term looks at what it observed.
struct TermView {
  bool along_rays = true;  ///< false while the surface may still be far away: closest points are used instead of rays
  /// A RayChoice each: rays that count, whatever they meet and how they graze it; the others are not asked about. nullptr: all that meet the
  /// surface at no steeper an angle than the term trusts
  const std::vector<char>* chosen = nullptr;
  bool surface_slopes = false;  ///< TermRows::surface or facets is wanted, by terms that look at the surface
  Index most_points = 0;        ///< closest points are asked of so many, evenly chosen; rows of the others are infinite. 0: of all

  /// Is this one of the points that are asked, out of so many?
  bool asks(Index point, Index count) const {
    return along_rays || most_points <= 0 || count <= most_points || point % (1 + (count - 1) / most_points) == 0;
  }
};

/// How a residual follows the surface that it looks at: it changes by the sum of per_corner.col(k) . motion of corner k.
struct SurfaceSlope {
  Index triangle = -1;  ///< -1: it meets none
  Mat3 per_corner = Mat3::Zero();
};

/// The same where all that rows of one triangle differ in is a few shares, as for rays: where on it they end and how steeply. Row i changes
/// by the sum over k of share(i, k) (own(4 f + k) . change of the term's own unknowns - normal(f) . motion of corner k), f being its
/// facet: the number of its triangle among those that are met. The fourth share has no corner. The rest surface's error moves vertices and is no own unknown.
struct FacetSlopes {
  static constexpr Index shares = 4;
  std::vector<Index> facet;     ///< a row; -1: it meets none
  std::vector<Index> triangle;  ///< a facet. A surface has many that no row meets: of them nothing is kept
  Eigen::Matrix<double, Eigen::Dynamic, shares, Eigen::RowMajor> share;  ///< a row; of those without a facet nothing is said
  Points normal;                                                            ///< a facet, and spare rows
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> own;  ///< facets * shares x own unknowns, and spare rows
};

/// Rows of one term: residual = (observed - predicted) / sigma, jacobian = d residual / d unknowns.
struct TermRows {
  std::vector<int> unknowns;  ///< columns of the jacobian; where `surface` is filled the prediction's come first
  MatrixX jacobian;
  VectorX residual;
  bool robust = false;        ///< may hold outliers: goes through the robust loss
  std::string unit = "1";     ///< of residual * sigma
  VectorX sigma;              ///< a row
  Points observed_m;          ///< at the fitted pose; empty for what is not a point
  Points met_m;               ///< of a depth image or a cloud: what of the simulated surface it is compared with, where the residual is finite
  /// |cosine| between ray and surface normal over the least with which a ray counts, 0 where it passes by; empty: not along rays
  VectorX facing;
  std::vector<SurfaceSlope> surface;  ///< a row; empty: not asked for, or not the term's way
  std::optional<FacetSlopes> facets;  ///< in place of `surface` and `jacobian`, which are empty then
  std::vector<int> cell;      ///< group of neighbours whose errors may be correlated (image or space cell); empty = independent
  std::shared_ptr<const SharedNoise> shared_noise = {};  ///< that the rows are weighed with
};

class Term {
 public:
  virtual ~Term() = default;
  virtual TermRows rows(const StepPrediction& predicted, const VectorX& unknowns, const TermView& view) const = 0;
  /// Unknowns of its own that rows with TermView::surface_slopes have beside the prediction's columns, without the modes of the rest
  /// surface's error.
  virtual std::vector<int> own_unknowns() const { return {}; }
  /// False: rows hang on the prediction's readings alone (forces, travel).
  virtual bool looks_at_surface() const { return true; }
  /// False: rows with TermView::surface_slopes are made of the surface alone, without its derivatives.
  virtual bool needs_surface_derivatives() const { return looks_at_surface(); }
  /// False for what tells of nuisances alone: by itself it is no observation of the object.
  virtual bool is_about_object() const { return true; }
  /// Standard deviation that residuals are divided by, a typical one (for the annealing of the robust loss).
  virtual double typical_sigma() const = 0;
};

struct TermContext {
  const ForwardModel& model;
  std::size_t step = 0;
  Unknowns& unknowns;
  /// Unknowns that several terms share, by name (depth bias of a push and camera, marker offsets): first index.
  std::map<std::string, int>& shared;
  int frame = 0;  ///< of a cloud or depth image: how many of them the step has before it
};

/// Makes the term of an observation and registers its nuisances. nullptr when the observation adds nothing (the reading of a
/// force that is imposed anyway). @throws Error when a standard deviation is missing or not positive.
std::unique_ptr<Term> make_term(const TermInput& input, const TermContext& context);

}  // namespace palpate::estimation
