// SPDX-License-Identifier: Apache-2.0
// A push on a learned object that nobody has made yet, as a front asks for it.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cli/learned_object.hpp"
#include "palpate/prediction/predict.hpp"

namespace palpate::cli {

struct AskedPush {
  std::optional<Vec3> contact_m;  ///< base frame, on the surface at rest; of a tool that is `vertices` nothing
  Vec3 direction = -Vec3::UnitZ();
  std::optional<double> force_n, travel_m;  ///< one of them, along the direction
  double radius_m = 0;                      ///< of the pressed patch; 0: the tool's
  std::string tool;                         ///< of the recording; empty: its only one, or a disc of that radius
  std::string option = "--";                ///< what stands before a field's name in messages
};

struct PredictedPush {
  Tool tool;
  Load load;  ///< with the contact on the surface
  prediction::Elasticity elasticity;
  prediction::Prediction found;
  std::vector<std::string> warnings;
};

/// @throws Error for a push that no tool can make there: beside the surface, out of the object, on a support, further or harder than
///         the object bears; naming the field
PredictedPush predict_push(const LearnedObject& learned, const AskedPush& asked, int threads);

}  // namespace palpate::cli
