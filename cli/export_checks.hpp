// SPDX-License-Identifier: Apache-2.0
// What palpate's own solver says of a model that goes to another simulator: how far the law or the elements that are written
// there move it, against those that were fitted.
#pragma once

#include <optional>
#include <string>

#include "cli/learned_object.hpp"
#include "palpate/fem/statics.hpp"

namespace palpate::cli {

/// What the model's own `fixed` and `forces_n` say; one column of forces.
fem::Boundary export_boundary(const io::ExportModel& model);

struct OwnAnswer {
  bool converged = false;
  std::string reason;
  VectorX displacement_m;  ///< 3n
  int inverted_elements = 0;
};

/// An equilibrium of the model's mesh with the first column of forces whole, of a law that need not be the model's.
OwnAnswer solved_here(const io::ExportModel& model, const std::string& law, fem::Boundary boundary, fem::StaticsOptions options);

/// The hardest push that the object was learned from, with the learned law and with another.
struct LawComparison {
  std::string push;
  double force_n = 0;
  double learned_m = 0;            ///< how far the patch goes along the force
  std::optional<double> other_m;  ///< nothing: no equilibrium is found
  int inverted_elements = 0;      ///< of the other
};

/// Nothing where no push is known, where the object is too large to be solved for a remark, or where the learned law itself finds no
/// equilibrium. Supports are those that were fitted with, held in both directions.
std::optional<LawComparison> compare_laws(const LearnedObject& learned, const io::ExportModel& model, const std::string& other, int threads);

/// How much stiffer the elements that are written are than those that were fitted, under the patch of that push (0.05: 5 %), both
/// linear; nothing as above.
std::optional<double> stiffer_elements(const LearnedObject& learned, const io::ExportModel& model, const io::Exporter& exporter,
                                       io::LinearElements elements, int threads);

/// Rigid motions that nothing in the model holds.
int rigid_motions_left(const io::ExportModel& model);

}  // namespace palpate::cli
