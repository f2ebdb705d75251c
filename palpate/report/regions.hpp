// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "palpate/report/canvas.hpp"

namespace palpate::report {

using Grid = std::vector<std::vector<double>>;  ///< rows of equal length

/// The density above which `share` of the probability lies; `u` and `v` are the axes (rows, columns) it is a density over.
double density_threshold(const Grid& density, const std::vector<double>& u, const std::vector<double>& v, double share);

/// Closed outlines of {density > level} by marching squares, x = fractional row, y = fractional column, clamped to the grid.
std::vector<std::vector<Spot>> region_outlines(const Grid& density, double level);

/// Value at a fractional place of an axis.
double along(const std::vector<double>& axis, double place);

}  // namespace palpate::report
