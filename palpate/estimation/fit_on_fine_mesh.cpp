// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/fit_on_fine_mesh.hpp"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <list>
#include <optional>
#include <sstream>
#include <string>

#include "palpate/estimation/mesh_error.hpp"
#include "palpate/fem/materials.hpp"

namespace palpate::estimation {
namespace {

/// What the mesh does to E, as a share; nothing where it is not known.
/// @param finer  what showed it
std::optional<double> mesh_error(const Identification& answer, const std::optional<FinerModel>& finer) {
  for (const BudgetEntry& entry : answer.budget) {
    if (entry.input == "mesh" && finer) return entry.young_modulus_percent / 100 / finer->unsure;
  }
  return std::nullopt;
}

std::string mesh_words(const SimulatedObject& object) {
  return std::to_string(object.mesh.tetrahedra.rows()) + " " + (object.mesh.tetrahedra.cols() == 10 ? "tet10" : "tet4") +
         ", " + std::to_string(object.mesh.nodes_m.rows()) + " nodes";
}

struct Excess {
  double young = 0;  // share of E
  double share = 0;  // of what is borne
};

/// Small strains, which are asked what a mesh does, have said less than half of it where strains were large
/// (docs/uncertainty.md, "Do the intervals hold the truth?"): a body that is not linear is fitted on a finer mesh sooner.
double share_borne(const SimulatedObject& object) {
  return fem::material_law(object.material).is_linear() ? 1 : 0.35;
}

/// Of what a mesh does to E, in the region that bears it least.
/// @param tolerance  what is borne of E where the change is told right
/// @param borne      share of that which is borne
Excess most_excess(const MeshDoubt& found, const AnswerShift& by_mesh, double tolerance, double borne) {
  constexpr double hardly = 1.0 / 3;  // of all else: a mesh's error below that widens the interval by a twentieth at most
  Excess most;
  for (std::size_t r = 0; r < found.young_std.size(); ++r) {
    const double young = std::abs(by_mesh.of_region(static_cast<Index>(r)).log_young);
    const double share = young / (borne * std::max(tolerance, hardly * found.young_std[r]));
    if (share > most.share) most = {young, share};
  }
  return most;
}

struct BetterMesh {
  FinerModel mesh;
  std::optional<FinerModel> finer;
};

/// @param shows  what the mesh of `at` and `on` does to the answer
/// @returns nothing where there is none, or the caller asked to stop
std::optional<BetterMesh> better_mesh(const Recording& at, const SimulatedObject& on, const FinerModel& shows,
                                      const MeshDoubt& found, double tolerance, const FillAnew& fill_anew) {
  constexpr Index most_nodes = 40000;  // of a mesh that is fitted with
  AnswerShift elsewhere = shows.elsewhere;
  if (const auto under_tools = shows.everywhere ? finer_under_tools(at, on) : std::nullopt) {
    const auto there = found.shown_by(*under_tools);
    if (!there) return std::nullopt;
    elsewhere = found.shift.plus(there->times(-1));
    // Too much would be left after refining under the tools, and the mesh that showed the error is at hand.
    if (most_excess(found, elsewhere, tolerance, share_borne(on)).share > 0.8 && shows.object.mesh.nodes_m.rows() <= most_nodes) {
      auto finer = finer_under_tools(shows.recording, shows.object);
      if (finer) finer->elsewhere = elsewhere.times(shows.left());
      return BetterMesh{shows, std::move(finer)};
    }
  }
  auto better = refined_within(at, on, share_borne(on) * tolerance, fill_anew);
  if (!better) return std::nullopt;
  // A mesh that is filled anew would lose what was refined under the tools.
  auto finer = better->everywhere || !fill_anew ? finer_model(better->recording, better->object, fill_anew)
                                                : finer_under_tools(better->recording, better->object);
  if (finer && !finer->everywhere)
    finer->elsewhere = elsewhere.times(better->everywhere ? better->left() : 1);
  return BetterMesh{std::move(*better), std::move(finer)};
}

}  // namespace

Identification fit_on_fine_mesh(Recording& recording, SimulatedObject& object, const Inputs& observed,
                                const FitOptions& options, double mesh_tolerance, ShapeDoubt* doubt,
                                const OnProgress& progress, const FillAnew& fill_anew,
                                std::optional<FinerModel>* last_finer) {
  constexpr int most_refinements = 3;
  const auto percent = [](double share) {
    std::ostringstream text;
    text << std::setprecision(2) << 100 * share << " %";
    return text.str();
  };
  FitOptions fit_options = options;
  std::string history;
  Identification first;  // what the search of the first mesh said of its starts
  std::optional<FinerModel> finer;
  if (recording.model.refine == "auto") finer = finer_model(recording, object, fill_anew);
  for (int refinements = 0;;) {
    struct Taken : BetterMesh {
      FinerMesh both;
    };
    std::list<Taken> taken;
    bool too_coarse = false;
    fit_options.take_finer = [&](const MeshDoubt& found) -> const FinerMesh* {
      const Excess excess = most_excess(found, found.shift, mesh_tolerance, share_borne(object));
      too_coarse = share_borne(object) * excess.share > 1;
      if (excess.share <= 1 || refinements == most_refinements) return nullptr;
      const FinerModel& shows = taken.empty() ? *finer : *taken.back().finer;
      const Recording& at = taken.empty() ? recording : taken.back().mesh.recording;
      const SimulatedObject& on = taken.empty() ? object : taken.back().mesh.object;
      auto next = better_mesh(at, on, shows, found, mesh_tolerance, fill_anew);
      if (!next) return nullptr;
      ++refinements;
      history += mesh_words(on) + ": " + percent(excess.young) + " of E; ";
      Taken& now = taken.emplace_back();
      now.mesh = std::move(next->mesh);
      now.finer = std::move(next->finer);
      now.both = {&now.mesh, now.finer ? &*now.finer : nullptr};
      return &now.both;
    };
    Identification answer =
        fit(recording, object, observed, fit_options, progress, finer ? &*finer : nullptr, nullptr, doubt);
    if (!taken.empty()) {
      recording = std::move(taken.back().mesh.recording);
      object = std::move(taken.back().mesh.object);
      finer = std::move(taken.back().finer);
    }
    if (!taken.empty() && answer.covariance.size() == 0 && answer.termination == Termination::converged) {
      fit_options.young_start_pa = answer.parameters[0].value;
      fit_options.poisson_start = answer.parameters[1].value;
      if (!fit_options.start_is_answer) {
        first.provenance = std::move(answer.provenance);
        first.verdicts = std::move(answer.verdicts);
      }
      fit_options.start_is_answer = true;
      continue;
    }
    answer.provenance.merge(first.provenance);
    answer.verdicts.insert(answer.verdicts.begin(), first.verdicts.begin(), first.verdicts.end());
    const std::optional<double> error = mesh_error(answer, finer);
    answer.provenance["mesh"] = mesh_words(object);
    answer.provenance["mesh's error in E"] = error ? percent(*error) : "not estimated";
    if (!history.empty()) answer.provenance["coarser meshes"] = history.substr(0, history.size() - 2);
    if (too_coarse && error) {
      answer.verdicts.push_back(
          {"mesh_too_coarse", "The mesh is estimated to put E off by " + percent(*error) +
                                  ", and no finer one can be had: that is taken out of the answer, and the interval "
                                  "holds " + percent(finer->unsure * *error) + " for it; give a finer volume mesh to be rid of it."});
    }
    if (last_finer != nullptr) *last_finer = std::move(finer);
    return answer;
  }
}

}  // namespace palpate::estimation
