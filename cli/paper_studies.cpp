// SPDX-License-Identifier: Apache-2.0
#include "cli/paper_studies.hpp"

#include <array>

#include "cli/paper_views.hpp"
#include "palpate/core/error.hpp"
#include "palpate/lab/paper_scenes.hpp"

namespace palpate::cli {
namespace {

estimation::FitOptions options_of(const StudyOptions& study) {
  estimation::FitOptions fit;
  fit.threads = study.threads;
  fit.cross_checks = fit.stresses = false;
  return fit;
}

bool wanted(const OnProgress& progress, std::string_view what) { return !progress || progress(what, 0); }

/// One recording on meshes and under loads as the paper had them, up to the program's own.
std::vector<StudyRow> meshes(const StudyOptions& study, const OnProgress& progress) {
  constexpr Index paper_tetrahedra = 815;
  const lab::PaperScene& whole = lab::paper_scene("cube");
  const lab::PaperTrial trial = lab::make_paper_trial(study.coarse ? for_a_look(whole) : whole, study.seed, progress);
  struct Model {
    const char* what;
    ModelChoice choice;
  };
  const std::array<Model, 6> models{{{"815 linear tetrahedra, the force at a point (as in the paper)",
                                      {.tetrahedra = paper_tetrahedra, .linear = true, .point_load = true}},
                                     {"8 times as many linear tetrahedra, the force at a point",
                                      {.tetrahedra = 8 * paper_tetrahedra, .linear = true, .point_load = true}},
                                     {"815 linear tetrahedra, the pad's patch", {.tetrahedra = paper_tetrahedra, .linear = true}},
                                     {"815 quadratic tetrahedra, the pad's patch", {.tetrahedra = paper_tetrahedra}},
                                     {"palpate's mesh with linear tetrahedra, the pad's patch", {.linear = true}},
                                     {"palpate's mesh and the pad's patch", {}}}};
  const Observed seen = observed(trial.recording);
  std::vector<StudyRow> rows;
  for (const Model& model : models) {
    if (!wanted(progress, model.what)) break;
    const Prepared given = prepare(seen, model.choice, nullptr, progress);
    rows.push_back({model.what, trial.young_modulus_pa, trial.poisson_ratio, by_paper(given, options_of(study), nullptr, progress),
                    by_palpate(given, options_of(study), nullptr, progress)});
    if (&model != &models.back()) continue;
    // The one row in which its metric is another: what that does is apart from mesh and load.
    rows.push_back({"the same, the paper's method measuring to the surface in place of its vertices", trial.young_modulus_pa, trial.poisson_ratio,
                    by_paper(given, options_of(study), nullptr, progress, estimation::PaperDistance::surface), no_answer()});
  }
  return rows;
}

/// What goes wrong without being recorded. Cross-checks are on: it is they who should notice.
std::vector<StudyRow> faults(const StudyOptions& study, const OnProgress& progress) {
  lab::PaperScene scene = lab::paper_scene("cube");
  if (study.coarse) scene.coarse_truth = true;  // a slip takes all samples
  estimation::FitOptions checked = options_of(study);
  checked.cross_checks = true;
  std::vector<lab::PaperFault> all{{.name = "none", .title = "nothing"}};
  all.insert(all.end(), lab::paper_faults().begin(), lab::paper_faults().end());
  std::vector<StudyRow> rows;
  for (const lab::PaperFault& fault : all) {
    if (!wanted(progress, fault.title)) break;
    const lab::PaperTrial trial = lab::make_paper_trial(scene, study.seed, progress, fault);
    const Prepared given = prepare(observed(trial.recording), choice_of(scene, study.coarse), nullptr, progress);
    rows.push_back({std::string(fault.title), trial.young_modulus_pa, trial.poisson_ratio,
                    by_paper(given, options_of(study), nullptr, progress), by_palpate(given, checked, nullptr, progress)});
  }
  return rows;
}

/// Cube and bear, pressed at one site each: their whole shape, and what four images around or one from the front show of it.
std::vector<StudyRow> partial(const StudyOptions& study, const OnProgress& progress) {
  std::vector<StudyRow> rows;
  for (const char* name : {"cube", "teddy"}) {
    lab::PaperScene scene = lab::paper_scene(name);
    scene.region_ratio = 1;
    scene.sites = 1;
    scene.samples = 7;
    if (study.coarse) scene = for_a_look(scene);
    scene.view_azimuth_rad = -2;  // from where the camera watches the push
    scene.view_elevation_rad = 0.6;
    using lab::PaperShape;
    for (const auto shape : {PaperShape::given, PaperShape::four_views, PaperShape::planar_back, PaperShape::one_view}) {
      const std::string object(scene.object);
      const std::string what = object + (shape == PaperShape::given         ? ", its whole shape"
                                         : shape == PaperShape::four_views  ? ", four views joined (as in the paper's fig. 2)"
                                         : shape == PaperShape::planar_back ? ", one view and a planar back side (as in the paper)"
                                                                            : ", one view, completed by palpate");
      if (!wanted(progress, what)) return rows;
      scene.shape = shape;
      const lab::PaperTrial trial = lab::make_paper_trial(scene, study.seed, progress);
      StudyRow& row = rows.emplace_back(StudyRow{what, trial.young_modulus_pa, trial.poisson_ratio, no_answer(), no_answer()});
      try {
        ModelChoice choice = choice_of(scene, study.coarse);
        const Observed seen = observed(trial.recording);
        Prepared given = prepare(seen, choice, nullptr, progress);
        // Palpate does not take a planar back side for true, and is asked all the same; no finer mesh of it can be had.
        const bool planar = shape == PaperShape::planar_back;
        if (planar) given.finer.reset();
        row.palpate = planar ? by_palpate(given, options_of(study), nullptr, progress)
                             : by_palpate_on_better_shape(seen, choice, given, options_of(study), nullptr, progress);
        row.paper = by_paper(given, options_of(study), nullptr, progress);
        if (study.pictures && shape == PaperShape::four_views) row.views = views_of_model(trial.recording, given);
      } catch (const Error& error) {  // what one view shows may make no body: then neither has an answer
        row.paper.failed = row.palpate.failed = error.what();
      }
    }
  }
  return rows;
}

constexpr std::array<Study, 3> table{{
    {"meshes", "What the paper could not know: mesh and point load",
     "One recording of the foam cube, fitted on coarse linear tetrahedra with the force at a point, as the paper did, up to palpate's "
     "own model. Down the rows the method stays and the model changes; across a row the model stays and the method changes.",
     meshes},
    {"faults", "What the paper could not know: what goes wrong unnoticed",
     "The foam cube with one thing wrong at a time, of which the recording says nothing. A verdict that names it is worth more than an "
     "interval that happens to hold.",
     faults},
    {"partial", "A partial model against the whole one",
     "The paper says that a model of what one view shows, with a planar back side, suffices. It also joins four views to a whole one.", partial},
}};

}  // namespace

std::span<const Study> studies() { return table; }

const Study* study_of(std::string_view name) {
  for (const Study& study : table)
    if (study.name == name) return &study;
  return nullptr;
}

}  // namespace palpate::cli
