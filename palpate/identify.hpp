// SPDX-License-Identifier: Apache-2.0
// The door: a recording in, elasticity with intervals and verdicts out. The body of `identify` reads like the paper
// (Frank et al., IROS 2010, section VI), one stage a line; each stage is public and may be called alone.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "palpate/core/identification.hpp"
#include "palpate/core/progress.hpp"
#include "palpate/core/recording.hpp"
#include "palpate/estimation/finer_model.hpp"
#include "palpate/estimation/fit.hpp"
#include "palpate/estimation/shape_error.hpp"
#include "palpate/reconstruction/build_object.hpp"

namespace palpate {

struct IdentifyOptions {
  std::string method = "palpate";  ///< or "paper": the paper's own algorithm, as a baseline
  // What is set here overrides the recording's `model`.
  std::optional<std::string> material, element, refine;
  std::string regions = "recorded";  ///< or "by-site": one around each site that was pushed; or "none"
  std::optional<std::pair<double, double>> poisson_range;
  std::optional<double> poisson_fixed;
  bool poisson_by_region = false;  ///< every region has its own nu, also where the recording says that they share one
  /// With `refine: auto`: while what the mesh does to E is estimated to be more than this share, and more than a third of all
  /// else that is not known of E, the object is fitted again on a finer mesh.
  double mesh_tolerance = 0.01;
  bool slips = true;       ///< fits again with a slip of the tool that was found (estimation/slips.hpp)
  bool all_loads = false;  ///< fits also loads under which a patch of even pressure caves in (estimation/deep_loads.hpp)
  estimation::FitOptions fit;
};

struct Identified {
  Identification answer;
  TetMesh volume;  ///< the simulated mesh at rest, for a simulation-ready model
  std::vector<int> region;  ///< an element of it: which of the answer's Young's moduli; empty: one
  Recording object;  ///< rest.volume = that mesh, with supports, tools, gravity and law as they were simulated; no pushes
};

/// @throws Error when no answer can exist: what() names the file or field and the cure.
Identified identify(const Recording& recording, const IdentifyOptions& options = {}, const OnProgress& progress = {});

/// The recording with the options' overrides in its `model`. @throws Error for an unknown element, refinement or range.
Recording with_overrides(Recording recording, const IdentifyOptions& options);

/// Stage 1: what the sensors of each step say, in the base frame: depth images become rays, without the pixels that show
/// planes of the environment or nothing near the object.
/// @param masked_m  if given: one entry a step, some of what the masks took away near the object, for figures
estimation::Inputs observe(const Recording& recording, std::vector<Points>* masked_m = nullptr);

/// The object at rest out of the views of it, the recording's (rest.views) and those of the pushes before contact, closed on the
/// table. Poses with a prior are corrected where the object was seen from all around.
/// @throws Error as reconstruction::build_object.
reconstruction::BuiltObject build_from_views(const Recording& recording, const reconstruction::BuildOptions& options = {},
                                             reconstruction::Completion completion = reconstruction::Completion::mirrored,
                                             const OnProgress& progress = {});

/// What views alone do not settle of a shape that they showed: what later stages have to doubt.
struct ShapeOfViews {
  double strip_m = 0;  ///< height above the table below which no view showed an object that was seen from all around; else 0
  int symmetries = 0;  ///< of one that was seen from one side, its own that were found
};

/// Stage 2: the object as the solver sees it: volume mesh, element, simulated surface. Says the chosen element in the
/// recording's model, and what was built (surface, volume, supports with the tolerance that their nodes need) in the recording.
/// @param completion  of a side that no view of rest.views shows
/// @param seen        if given: a vertex of rest.surface as built, 1 where a view showed it; empty where the shape was given
/// @param views       if given: what is known of a shape that views showed
estimation::SimulatedObject build_simulated_object(Recording& recording, const OnProgress& progress = {},
                                                   reconstruction::Completion completion = reconstruction::Completion::mirrored,
                                                   std::vector<char>* seen = nullptr, ShapeOfViews* views = nullptr);

/// Stage 3, of an object that views leave partly unseen: takes out the rays that show what no view of it at rest showed, for a
/// guess is nothing to compare with. Returns the share of its surface that was not seen; 0 where that is too little to matter.
/// @param built  the recording as build_simulated_object left it, with `seen`
double drop_unseen_side(const Recording& built, const std::vector<char>& seen, estimation::Inputs& observed);

/// How a given surface is filled with a finer mesh than it was; empty where there is no such surface, or where the mesh follows it
/// exactly, so that halving its edges shows all that is wrong with it.
/// @param given  the recording before its object was built
/// @param built  as build_simulated_object left it
estimation::FillAnew fill_anew(const Recording& given, const Recording& built);

/// What a view of it did not show; nothing where it showed nothing of it.
/// @param given  the recording before its object was built
/// @param built  as build_simulated_object left it, with `seen`
std::optional<estimation::UnseenSide> unseen_side(const Recording& given, const Recording& built, const std::vector<char>& seen);

/// What else may stand where nobody looked: all that was hidden, and less than what is fitted.
/// @param given  the recording before its object was built
/// @param symmetries  of the fitted shape: a flat back contradicts several
estimation::ShapeDoubt other_shapes(const Recording& given, double unseen_share, int symmetries);

/// The foot of an object that was seen from all around down to `strip_m` above what it stands on; nothing where it stands on nothing.
/// @param built  as build_simulated_object left it, with `views.strip_m`
std::optional<estimation::FootDoubt> foot_doubt(const Recording& built, double strip_m);

}  // namespace palpate
