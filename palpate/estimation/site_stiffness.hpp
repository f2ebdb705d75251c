// SPDX-License-Identifier: Apache-2.0
// Is an object the same around every place that was pushed? A push at one place bends what lies around the others as well, so
// that the E of single pushes differ by less than the object does; the surface shows where it gives way.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "palpate/core/recording.hpp"

namespace palpate::estimation {

/// What E of the parts around the places that were pushed would be, if each had its own (the score test of as many unknowns).
struct SiteStiffness {
  std::vector<std::string> sites;
  VectorX log_young;   ///< a site: one step of Newton's method from the fit of one E
  double p_value = 1;  ///< chance of differences at least as large where the object is the same everywhere
};

/// Places that were pushed, as regions of what lies nearest to each: where a known force acted through a round tool. Those within
/// the tool's radius are one place; of many, those that lie furthest apart.
/// @returns nothing where that is one place, or where regions are given
std::vector<Region> sites_pushed(const Recording& recording);

/// @param sites       names, the first one's E being that of the object
/// @param first_log_young  of the first site
/// @param log_ratio   of every further site's E over the first one's
/// @param covariance  of these, from the data alone
SiteStiffness site_stiffness(std::vector<std::string> sites, double first_log_young, const VectorX& log_ratio, MatrixX covariance);

}  // namespace palpate::estimation
