// SPDX-License-Identifier: Apache-2.0
#include "cli/exported_object.hpp"

#include <fmt/format.h>

#include <cmath>

#include "palpate/estimation/held_body.hpp"
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

void tell_elements(const LearnedObject& learned, const io::Exporter& exporter, const ExportChoice& choice, int threads, ExportedObject& out) {
  out.stiffer = stiffer_elements(learned, out.model, exporter, choice.elements, threads);
  const bool linear = out.model.mesh.tetrahedra.cols() == 10 && !exporter.quadratic;
  if (!linear && !(out.stiffer && std::abs(*out.stiffer) > 0.01)) return;
  const std::string by = out.stiffer ? fmt::format("{:.1f} % {}", 100 * std::abs(*out.stiffer), *out.stiffer < 0 ? "softer" : "stiffer") : "stiffer";
  const bool split = choice.elements == io::LinearElements::split;
  if (!linear)
    out.warnings.push_back(fmt::format("near nu = 0.5 the elements there act {} under the hardest push than the ones with averaged volume change that were fitted", by));
  else
    out.warnings.push_back(fmt::format("linear tetrahedra were written, {}: under the hardest push they act {} than the quadratic ones that were fitted{}",
                                       split ? "eight for each" : "of the corners alone", by,
                                       split ? "" : "; `--elements split` comes nearer"));
}

std::string numbers(const Vec3& g) { return fmt::format("{:g} {:g} {:g} m/s2", g.x(), g.y(), g.z()); }

void tell_gravity(const LearnedObject& learned, const io::Exporter& exporter, const ExportChoice& choice, ExportedObject& out) {
  const bool sagged = learned.object.rest.state != RestState::stress_free && learned.object.environment.gravity_m_s2.norm() > 0;
  const bool falls = out.model.gravity_m_s2.norm() > 0;
  const std::string why = "the shape was measured with its weight on and has sagged already";
  if (!exporter.carries_gravity)
    out.warnings.push_back(fmt::format("its files carry no gravity: set it by {} to {}{}", exporter.gravity_set_by, numbers(out.model.gravity_m_s2),
                                       sagged && !falls ? ", since " + why : ""));
  else if (sagged && !choice.gravity_m_s2)
    out.notes.push_back("gravity is left out: " + why);
  else if (exporter.needs_density && !falls && !choice.gravity_m_s2)
    out.warnings.push_back("gravity is 0 in what is written, as in the recording's environment: nothing falls there; `--gravity 0 0 -9.81` (Python: "
                           "gravity_m_s2) says otherwise");
  if (sagged && falls) out.warnings.push_back("the shape was measured with its weight on: under gravity it sags once more");
}

/// Whatever held the object in the fit and does not there.
void tell_supports(const LearnedObject& learned, const io::Exporter& exporter, ExportedObject& out) {
  const auto not_written = [&](const Support& support, const std::string& why) {
    out.warnings.push_back(fmt::format("support '{}' is not written: {}", support.name, why));
  };
  for (const Support& support : learned.object.supports) {
    const bool bonded = support.contact == ContactLaw::bonded;
    if (estimation::lifts_off(support))
      not_written(support, "it only pushes, and files have no contact; put a rigid plane there");
    else if (!bonded && !slides_along(support))
      not_written(support, "what it holds slides, along no plane across an axis");
    else if (!bonded && !exporter.slides)
      not_written(support, "what it holds slides, and nodes of these files are held altogether or not at all");
    else if (support.compliance_m_per_n > 0)
      out.warnings.push_back(fmt::format("support '{}' gives way by {:g} m/N and is written as rigid", support.name, support.compliance_m_per_n));
  }
  const io::ExportModel& written = out.written;
  out.holds = !written.fixed.empty() &&
              (exporter.holds == io::Holds::nodes || (exporter.holds == io::Holds::half_space && io::held_half_space(written)));
  if (!written.fixed.empty() && !out.holds)
    out.warnings.push_back(fmt::format("the {} nodes that supports hold are free in {}: {}. held_nodes.txt lists them", written.fixed.size(), exporter.main_file,
                                       exporter.holds == io::Holds::nothing ? "the format holds none" : "it can hold those beyond a plane, and these are not"));
  // A solver of motion lets it fall; a static one has no answer.
  const int left = exporter.needs_density ? 0 : rigid_motions_left(written);
  if (left > 0)
    out.warnings.push_back(fmt::format("nothing in {} holds {} of the 6 rigid motions, so that a static solver finds no equilibrium: hold nodes there",
                                       exporter.main_file, left));
}

}  // namespace

ExportedObject exported_object(const LearnedObject& learned, const io::Exporter& exporter, const ExportChoice& choice, int threads) {
  ExportedObject out;
  out.model = export_model(learned, choice.density_kg_m3, choice.gravity_m_s2);
  out.written = io::written_model(exporter, out.model, choice.elements);
  out.files = exporter.write(out.written);
  tell_law(learned, exporter, threads, out);
  tell_elements(learned, exporter, choice, threads, out);
  tell_supports(learned, exporter, out);
  tell_gravity(learned, exporter, choice, out);
  return out;
}

}  // namespace palpate::cli
