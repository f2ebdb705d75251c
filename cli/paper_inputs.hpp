// SPDX-License-Identifier: Apache-2.0
// What both methods of `palpate paper` are given: the same object, points and steps.
#pragma once

#include <functional>
#include <memory>
#include <optional>

#include "palpate/core/progress.hpp"
#include "palpate/estimation/deep_loads.hpp"
#include "palpate/estimation/finer_model.hpp"
#include "palpate/estimation/fit.hpp"
#include "palpate/estimation/shape_error.hpp"
#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/lab/paper_scenes.hpp"

namespace palpate::cli {

/// A recording and what its images show: they take a second each, and one look at them serves every model.
struct Observed {
  Recording recording;
  estimation::Inputs inputs;
};
Observed observed(Recording recording);

/// A recording with its object built and its points ready.
struct Prepared {
  Recording recording;
  estimation::SimulatedObject object;
  estimation::Inputs inputs;
  std::shared_ptr<estimation::FinerModel> finer;  ///< that shows what the mesh does to the answer; nullptr: it cannot be had
  std::shared_ptr<estimation::ShapeDoubt> doubt;  ///< of an object that was completed: for the method that has intervals
};

/// What seeds of a scene share: the same object on the same mesh, pressed at the same places.
struct SharedModel {
  std::optional<Prepared> built;  ///< without inputs
  estimation::FitMemory palpate, paper, unused;
};

/// How the object is modelled.
struct ModelChoice {
  Index tetrahedra = 0;       ///< 0: as many as the program takes by itself, fine under the pad
  double edge_m = 0;          ///< where these are given: of those under the pad; 0: like all others (coarse: finer than its radius)
  bool linear = false;        ///< linear elements, not quadratic ones
  bool planar_back = false;   ///< an unseen side is completed as in the paper, and taken for true
  bool planar_agrees = false; ///< it is completed like that because the pushes agree better with it
  bool point_load = false;    ///< forces act on the node that is nearest to their contact
  bool coarse = false;        ///< for a look: nobody asks what the mesh and an unseen side do to the answer, and there are fewer points
};
ModelChoice choice_of(const lab::PaperScene& scene, bool coarse);
/// For a look: four samples a push, as deep as seven, of a truth on a quarter of its mesh. A push that slips or goes as far as it can
/// keeps its samples.
lab::PaperScene for_a_look(lab::PaperScene scene);

/// Both methods are given every n-th pixel of what lies near the object: about as many points a sample as the paper's time-of-flight
/// camera has (3200).
inline constexpr Index usual_points = 2000;
// For a look: a third of the points, and about the paper's 815 tetrahedra.
inline constexpr Index coarse_points = 700, coarse_tetrahedra = 800;
RayCloud thinned(const RayCloud& all, const geometry::TriangleTree& rest, double near_m, Index most = usual_points);
/// How far from the object at rest a pixel may lie: 25 mm, or the depth of the deepest push and a tenth.
double near_of(const Recording& recording);

/// @param shared  used and filled where the recording gives the shape; nullptr: nothing is kept
/// @param doubt   what a fit of another completion has found of the other shapes; nullptr: nothing yet
Prepared prepare(Observed given, const ModelChoice& choice, SharedModel* shared, const OnProgress& progress,
                 std::shared_ptr<estimation::ShapeDoubt> doubt = nullptr);

/// Some steps of it: keep(push, step) says which.
Prepared part_of(const Prepared& all, const std::function<bool(std::size_t push, std::size_t step)>& keep);

/// The first samples of each push, as all else that was prepared.
Prepared first_samples(Prepared given, const estimation::StepCounts& counts);

/// The same taken for one material, whatever regions it has: the paper's method knows none.
Prepared as_one(Prepared given);
/// The same with another law.
Prepared with_law(Prepared given, std::string_view law);

bool loaded(const Step& step);
/// NaN: the step has none.
double travel_of(const Step& step);

}  // namespace palpate::cli
