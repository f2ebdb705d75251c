// SPDX-License-Identifier: Apache-2.0
// Figures of the page of `palpate paper`, as SVG; empty where a trial has nothing for one.
#pragma once

#include <string>

#include "cli/paper_trial.hpp"

namespace palpate::cli {

/// Fig. 3: seen points on the surface that each E gives, from the side.
std::string registration_figure(const TrialAnswer& trial);
/// Fig. 4: the error over (E, nu), both paths on it.
std::string surface_figure(const TrialAnswer& trial);
/// Fig. 6: the error over E alone, at the nu where the paper's method ended.
std::string error_figure(const TrialAnswer& trial);
/// Fig. 5: measured force over travel.
std::string force_figure(const TrialAnswer& trial);
/// Fig. 6, 8 and 9: E of every sample alone, by both methods, with ours' interval; lines: all samples jointly.
std::string samples_figure(const TrialAnswer& trial);

}  // namespace palpate::cli
