// SPDX-License-Identifier: Apache-2.0
// A tool that slid over the object (Step::slipped): from there on it touches elsewhere, and its travel counts from elsewhere. Both
// are then unknowns of their own, so that nothing of a push has to be left out.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "palpate/core/identification.hpp"
#include "palpate/core/recording.hpp"
#include "palpate/estimation/objective.hpp"
#include "palpate/estimation/optimise.hpp"

namespace palpate::estimation {

/// What of a push keeps its place up to its next slip: "[NAME]", from the first slip on "[NAME, slipped]", then
/// "[NAME, slipped 2 times]". Ending of the names of unknowns.
std::string stretch_of(const Push& push, std::size_t step);

/// True from a push's first slip on.
bool after_slip(const Push& push, std::size_t step);

/// How far a tool may have slid, across the push and deeper, as one standard deviation: half its radius, since what slid further
/// fell off what it pressed; 5 mm for a tool without one.
double slip_std_m(const Tool& tool);

/// Contacts from a push's first slip on have at least this standard deviation (Load::contact_std_m). For tools whose force is given.
void free_contacts_after_slips(Recording& recording);

/// The same slips in another recording of the same pushes (on a finer mesh, of another shape).
void take_slips(const Recording& from, Recording& to);

/// The slip that explains most, all that was fitted free to follow: contact and zero of the travel different from some step of a
/// push on (score test of up to three added unknowns; an unknown that there is none of is left out). Nothing where an E that
/// changes with the load explains about as much: then the law is wrong, or nobody can tell.
/// @param objective  in which contacts may shift and travels have a zero, evaluated at `optimum`
/// @param moving     what was fitted and is not held at a bound
/// @param factor     information factor of robust rows
/// @param misfit     chi2 per degree of freedom, where it is above one
/// @param otherwise_chi2  what something else explains: a slip has to explain more
std::optional<Slip> find_slip(const Objective& objective, const Optimum& optimum, const std::vector<int>& moving, double factor,
                              double misfit, double otherwise_chi2 = 0);

/// Fits, and while that finds a slip (Identification::slip) fits again with it in the recording: twice at most. The verdict
/// `contact_slipped` then says what was found and what E would be without.
/// @param recording  gets the slips that were found
/// @param fit        of that recording as it is then; what was found before, nullptr the first time
Identification fit_with_slips(Recording& recording, const std::function<Identification(const Identification* before)>& fit);

}  // namespace palpate::estimation
