// SPDX-License-Identifier: Apache-2.0
#include "cli/exported_object.hpp"

#include <fmt/format.h>

#include <cmath>

#include "palpate/report/words.hpp"

namespace palpate::cli {
namespace {

/// Small strains agree everywhere; where the laws part, the user must know by how much.
void tell_law(const LearnedObject& learned, const io::Exporter& exporter, int threads, ExportedObject& out) {
  out.law = io::written_law(exporter, out.model.law);
  if (out.law == out.model.law) return;
  if (out.law.empty()) {
    out.warnings.push_back(fmt::format("what law acts there is the reader's choice; {} was learned, and E and nu are those of its small strains",
                                       out.model.law));
    return;
  }
  out.laws = compare_laws(learned, out.model, out.law, threads);
  const std::string differs = fmt::format("the law there is {}, and {} was learned", out.law, out.model.law);
  const std::string cure = fmt::format("`palpate estimate --material {}` learns the law of {}", out.law, exporter.name);
  if (!out.laws) {
    out.warnings.push_back(fmt::format("{}: they agree at small strains only; {}", differs, cure));
    return;
  }
  const LawComparison& at = *out.laws;
  const std::string push = fmt::format("under the hardest push that it was learned from ({}, {})", at.push, report::quantity(at.force_n, "N"));
  if (!at.other_m) {
    out.warnings.push_back(fmt::format("{}: {} it finds no equilibrium, where the learned law moves the patch by {}; {}", differs, push,
                                       report::quantity(at.learned_m, "m"), cure));
    return;
  }
  const double more = *at.other_m / at.learned_m - 1;
  constexpr double same = 0.01;
  const std::string folded = at.inverted_elements > 0 ? ", and it folds: elements turn inside out" : "";
  const std::string moved = fmt::format("{}: {} it moves the patch by {}, the learned one by {} ({:+.1f} %){}", differs, push,
                                        report::quantity(*at.other_m, "m"), report::quantity(at.learned_m, "m"), 100 * more, folded);
  if (std::abs(more) < same)
    out.notes.push_back(moved);
  else
    out.warnings.push_back(moved + "; " + cure);
}

void tell_elements(const io::Exporter& exporter, ExportedObject& out) {
  if (out.model.mesh.tetrahedra.cols() == 10 && !exporter.quadratic)
    out.warnings.push_back("linear tetrahedra of the same corners were written: they act stiffer than the quadratic ones that were fitted");
}

void tell_gravity(const LearnedObject& learned, const ExportChoice& choice, ExportedObject& out) {
  if (learned.object.rest.state == RestState::stress_free || !(learned.object.environment.gravity_m_s2.norm() > 0)) return;
  if (!choice.gravity_m_s2)
    out.notes.push_back("gravity is left out: the shape was measured with its weight on and has sagged already");
  else if (out.model.gravity_m_s2.norm() > 0)
    out.warnings.push_back("the shape was measured with its weight on: under gravity it sags once more");
}

}  // namespace

ExportedObject exported_object(const LearnedObject& learned, const io::Exporter& exporter, const ExportChoice& choice, int threads) {
  ExportedObject out;
  out.model = export_model(learned, choice.density_kg_m3, choice.gravity_m_s2);
  out.files = io::export_files(exporter, out.model);
  tell_law(learned, exporter, threads, out);
  tell_elements(exporter, out);
  tell_gravity(learned, choice, out);
  return out;
}

}  // namespace palpate::cli
