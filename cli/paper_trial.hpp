// SPDX-License-Identifier: Apache-2.0
// One seeded scene of the paper, answered by both methods: same mesh, solver, points, start and threads.
#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "cli/paper_methods.hpp"
#include "palpate/core/identification.hpp"
#include "palpate/core/progress.hpp"
#include "palpate/lab/paper_scenes.hpp"

namespace palpate::cli {

inline constexpr double no_value = std::numeric_limits<double>::quiet_NaN();

struct SampleAnswer {
  std::string push;
  double force_n = 0, travel_m = 0;
  MethodAnswer paper, palpate;
};

/// E where one push acts: by the paper's method from this push alone, by ours as the region's where the object has regions.
struct SiteAnswer {
  std::string site;
  double young_modulus_pa = 0;  ///< the truth there
  MethodAnswer paper, palpate;
};

/// What an answer expects at the travel of a step: NaN where it expects nothing.
struct Expectation {
  double force_n = 0;
  double surface_m = 0;  ///< rms of the seen points to the expected surface, under the step's force
  double dent_m = no_value;  ///< rms of the true surface, where it moved, to the expected one
};

/// A push that no method has seen, at one of its forces.
struct UnusedStep {
  double force_n = 0, travel_m = 0;  ///< true force, measured travel (NaN: it says nothing)
  Expectation paper, palpate, other;
  double surface_still_m = 0;  ///< rms of the seen points to the surface at rest
  double dent_still_m = no_value;  ///< rms of the true surface, where it moved, to the one at rest
};

/// What the sensors of a loaded step read.
struct ForceReading {
  std::string push;
  double force_n = 0, travel_m = 0;
};

/// The seen points of the hardest step laid on the surface that an E gives.
struct RegistrationPicture {
  double young_modulus_pa = 0, rms_m = 0;
  Points simulated_m, registered_m;  ///< thinned
};

/// What both methods come to from a start that is not the one they have by themselves.
struct StartAnswer {
  double young_modulus_pa = 0, poisson_ratio = 0;
  MethodAnswer paper, palpate;
};

/// A picture as PNG, base64.
struct PaperView {
  std::string what;
  int width = 0, height = 0;  ///< pixels
  std::string png;
};

/// The paper's error function over (E, nu), m2; rows = E. One column, of the nu that was found, where a solve is dear.
struct ErrorSurface {
  VectorX young_modulus_pa, poisson_ratio;
  MatrixX error_m2;
  double at_found_m2 = 0;  ///< where the paper's method ended
  double smallest_m2() const { return error_m2.minCoeff(); }
};

struct TrialAnswer {
  std::uint64_t seed = 0;
  std::string failed;                         ///< why it is not whole; empty: it is. What was answered before stays
  double young_modulus_pa = no_value, poisson_ratio = no_value;  ///< the truth; NaN: there is none
  Index tetrahedra = 0;
  double truth_s = 0, model_s = 0, total_s = 0;  ///< by the clock: the lab's pushes, the object's model, and all
  MethodAnswer paper = no_answer(), palpate = no_answer();
  MethodAnswer paper_coarse = no_answer();    ///< the paper's method on linear tetrahedra of the same mesh; only where asked for
  std::string other_law;                      ///< that palpate fitted as well; empty: none
  MethodAnswer other = no_answer();
  int left_out = 0;                           ///< samples whose loads are too high for the model (deep_loads.hpp): by neither method
  std::vector<ForceReading> readings;
  std::vector<SiteAnswer> sites;              ///< only of an object with regions
  std::vector<std::string> as_one_verdicts;   ///< of ours when it takes such an object for homogeneous; only where asked for
  std::vector<UnusedStep> unused;
  std::string unused_stop;                    ///< why there is none
  std::vector<RegistrationPicture> pictures;  ///< only where asked for
  std::vector<PaperView> views;               ///< only where asked for
  std::vector<SampleAnswer> samples;          ///< each sample alone; only where asked for
  ErrorSurface surface;                       ///< only where asked for
  std::vector<StartAnswer> starts;            ///< only where asked for
};

struct TrialOptions {
  bool samples_alone = false;  ///< each of them
  int surface_points = 0;      ///< a side of the error surface; 0 = none
  bool other_starts = false;   ///< beside a surface of more than one nu, and not of a shape that is a guess
  bool pictures = false;       ///< registrations, verdicts, linear tetrahedra, and what ours says of an object with regions that it is not told of
  bool coarse = false;         ///< a look in minutes (ModelChoice)
  int threads = 1;
};

/// What all seeds of a scene share.
struct SharedModels {
  SharedModel fine, linear, other;
  std::map<std::string, estimation::FitMemory> sites;  ///< of the paper's method, which answers from one push alone
  lab::PressedMemory truths;
};

/// A method that ends with an error has no answer, and the other one answers all the same.
/// @param shared  used and filled; nullptr: nothing is kept
/// @param out     filled as far as it comes
/// @throws Error when there is no truth or no model of the object.
void run_trial(const lab::PaperScene& scene, std::uint64_t seed, const TrialOptions& options, SharedModels* shared,
               const OnProgress& progress, TrialAnswer& out);

}  // namespace palpate::cli
