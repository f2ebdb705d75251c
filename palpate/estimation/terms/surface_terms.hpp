// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/estimation/terms/term.hpp"

namespace palpate::estimation {

std::unique_ptr<Term> make_cloud_term(const PointCloud& cloud, const TermContext& context);
std::unique_ptr<Term> make_ray_term(const RayObservation& rays, const TermContext& context);
std::unique_ptr<Term> make_marker_term(const Markers& markers, const TermContext& context);
std::unique_ptr<Term> make_travel_term(const ToolTravel& travel, const TermContext& context);
std::unique_ptr<Term> make_wrench_term(const Wrench& wrench, const TermContext& context);

/// Index of the step's load that an observation of `tool` belongs to. @throws Error when it is not clear.
std::size_t load_of(const TermContext& context, const std::string& tool, const std::string& what);

/// "[push:step]" for the names of nuisances.
std::string step_suffix(const TermContext& context);

/// Six unknowns of a frame's pose, or -1 when it is exactly known.
int add_frame_pose(const TermContext& context, double pose_std_m, double pose_std_rad);

}  // namespace palpate::estimation
