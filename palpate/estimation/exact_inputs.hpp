// SPDX-License-Identifier: Apache-2.0
// What a recording states as exactly known is in no interval. Here it is taken to err by a typical size: what would that do to E and nu?
#pragma once

#include <string>
#include <vector>

#include "palpate/core/identification.hpp"
#include "palpate/estimation/fit.hpp"
#include "palpate/estimation/unknowns.hpp"

namespace palpate::estimation {

/// By how much each of them is taken to err. docs/uncertainty.md has the table, and where the sizes come from.
struct TypicalErrors {
  double contact_m = 1e-3;           ///< across the push, each push's by itself
  double radius_share = 0.1;         ///< of a tool's radius
  double force_share = 0.01;         ///< of the sensor's scale; of the push's highest force for its tare
  double travel_m = 5e-4;            ///< where contact began
  double compliance_m_per_n = 1e-5;  ///< or a tenth of what is stated, if that is more
  double density_share = 0.05;
  double time_s = 0.01;
  double support_m_per_n = 1e-5;  ///< or a tenth of what is stated, if that is more
  double spread_share = 0.01;  ///< of the rim's radius
  double camera_m = 1e-3, camera_rad = 0.2 * M_PI / 180;
  double depth_m = 1e-3;
  double marker_m = 5e-4;  ///< of a marker's place at rest
};

/// An input that is stated as exact, as unknowns of a model in which it is not.
struct ExactInput {
  std::string input;   ///< as error_budget calls what it groups
  std::string off_by;  ///< in words
  std::string field;   ///< of the recording, that would make it a nuisance
  struct Way {
    std::vector<std::string> unknowns;  ///< that move together
    double size = 0;
  };
  std::vector<Way> ways;  ///< independent of each other
};

/// Gives everything that is stated as exact a standard deviation (which one says nothing: the model gets the unknowns).
/// @param more, more_inputs  copies of the recording and its inputs; what is uncertain in them already stays as it is
std::vector<ExactInput> free_exact_inputs(const Recording& recording, const Inputs& inputs, const TetMesh& mesh, Recording& more,
                                          Inputs& more_inputs, const TypicalErrors& errors = {});

/// One step of Gauss and Newton from the optimum for each of them, everything that was fitted free to follow. Independent ways are added
/// in squares. What no step depends on is left out.
/// @param unknowns   of the model in which nothing is exact, and the curvature of the cost over all of them
/// @param moving     what was fitted and is not held at a bound, among them (log E first)
/// @param regions    their names, where there are several
std::vector<BudgetEntry> budget_if(const std::vector<ExactInput>& exact, const Unknowns& unknowns, const MatrixX& curvature,
                                   const std::vector<int>& moving, const std::vector<std::string>& regions);

}  // namespace palpate::estimation
