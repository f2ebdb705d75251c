// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/fit_on_fine_mesh.hpp"

#include <algorithm>
#include <iomanip>
#include <list>
#include <optional>
#include <sstream>
#include <string>

#include "palpate/estimation/mesh_error.hpp"

namespace palpate::estimation {
namespace {

/// What the mesh does to E, as a share; nothing where it is not known.
std::optional<double> mesh_error(const Identification& answer) {
  for (const BudgetEntry& entry : answer.budget) {
    if (entry.input == "mesh") return entry.young_modulus_percent / 100 / mesh_left_over;
  }
  return std::nullopt;
}

std::string mesh_words(const SimulatedObject& object) {
  return std::to_string(object.mesh.tetrahedra.rows()) + " " + (object.mesh.tetrahedra.cols() == 10 ? "tet10" : "tet4") +
         ", " + std::to_string(object.mesh.nodes_m.rows()) + " nodes";
}

}  // namespace

Identification fit_on_fine_mesh(Recording& recording, SimulatedObject& object, const Inputs& observed,
                                const FitOptions& options, double mesh_tolerance, ShapeDoubt* doubt,
                                const OnProgress& progress, const FillAnew& fill_anew) {
  constexpr int most_refinements = 3;
  constexpr double hardly = 1.0 / 3;  // of all else: a mesh's error below that widens the interval by a twentieth at most
  const auto percent = [](double share) {
    std::ostringstream text;
    text << std::setprecision(2) << 100 * share << " %";
    return text.str();
  };
  FitOptions fit_options = options;
  std::string history;
  for (int refinements = 0;;) {
    std::optional<FinerModel> finer;
    if (recording.model.refine == "auto") finer = finer_model(recording, object, fill_anew);
    struct Taken {
      std::optional<FinerModel> mesh, finer;
      FinerMesh both;
    };
    std::list<Taken> taken;
    bool too_coarse = false;
    fit_options.take_finer = [&](const std::vector<YoungDoubt>& doubts) -> const FinerMesh* {
      const auto most = std::max_element(doubts.begin(), doubts.end(), [&](const YoungDoubt& a, const YoungDoubt& b) {
        const auto over = [&](const YoungDoubt& d) { return d.by_mesh / std::max(mesh_tolerance, hardly * d.by_all_else); };
        return over(a) < over(b);
      });
      const double error = most->by_mesh;
      too_coarse = error > std::max(mesh_tolerance, hardly * most->by_all_else);
      if (!too_coarse || refinements == most_refinements) return nullptr;
      const Recording& at = taken.empty() ? recording : taken.back().mesh->recording;
      const SimulatedObject& on = taken.empty() ? object : taken.back().mesh->object;
      std::optional<FinerModel> better = refined_within(at, on, mesh_tolerance, fill_anew);
      if (!better) return nullptr;
      ++refinements;
      history += mesh_words(on) + ": " + percent(error) + " of E; ";
      Taken& now = taken.emplace_back();
      now.mesh = std::move(better);
      now.finer = finer_model(now.mesh->recording, now.mesh->object, fill_anew);
      now.both = {&*now.mesh, now.finer ? &*now.finer : nullptr};
      return &now.both;
    };
    Identification answer =
        fit(recording, object, observed, fit_options, progress, finer ? &*finer : nullptr, nullptr, doubt);
    if (!taken.empty()) {
      recording = std::move(taken.back().mesh->recording);
      object = std::move(taken.back().mesh->object);
    }
    if (!taken.empty() && answer.covariance.size() == 0 && answer.termination == Termination::converged) {
      fit_options.young_start_pa = answer.parameters[0].value;
      fit_options.poisson_start = answer.parameters[1].value;
      fit_options.start_is_answer = true;
      continue;
    }
    const std::optional<double> error = mesh_error(answer);
    answer.provenance["mesh"] = mesh_words(object);
    answer.provenance["mesh's error in E"] = error ? percent(*error) : "not estimated";
    if (!history.empty()) answer.provenance["coarser meshes"] = history.substr(0, history.size() - 2);
    if (too_coarse && error) {
      answer.verdicts.push_back(
          {"mesh_too_coarse", "The mesh is estimated to put E off by " + percent(*error) +
                                  ", and no finer one can be had: that is taken out of the answer, and the interval "
                                  "holds half of it; give a finer volume mesh to be rid of it."});
    }
    return answer;
  }
}

}  // namespace palpate::estimation
