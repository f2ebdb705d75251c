// SPDX-License-Identifier: Apache-2.0
// From the unknowns to what the sensors should see: one static equilibrium a step, its surface in the base frame, the
// platens' reactions, and the exact derivatives of all of it to every unknown that the step depends on.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "palpate/core/recording.hpp"
#include "palpate/estimation/prediction_change.hpp"
#include "palpate/estimation/rigid_offset.hpp"
#include "palpate/estimation/simulated_surface.hpp"
#include "palpate/estimation/surface_field.hpp"
#include "palpate/estimation/unknowns.hpp"
#include "palpate/fem/response.hpp"
#include "palpate/geometry/surface_edges.hpp"
#include "palpate/geometry/triangle_tree.hpp"

namespace palpate::estimation {

struct StepIndex {
  std::size_t push = 0, step = 0;
};

/// Where a step leads the surface of a linear body, as coordinates: a vertex moves by the sum of the acting unit loads' fields,
/// one a coordinate.
struct SpanPlace {
  std::shared_ptr<const fem::ResponseSpan> span;
  std::vector<Index> loads;  ///< unit loads that act
  VectorX at;
  MatrixX d_at;  ///< coordinates x StepPrediction::columns

  bool is_along(const std::shared_ptr<const fem::ResponseSpan>& other, const std::vector<Index>& others) const {
    return span == other && loads == others;
  }
  VectorX moved_m() const;  ///< 3v
  /// No vertex is further than this from where other coordinates along the same fields put it.
  double at_most_from_m(const VectorX& other) const;
};

/// One column of every derivative below is one unknown.
struct StepPrediction {
  bool converged = false;
  std::string reason;
  Points surface_m;           ///< simulated surface vertices, base frame; empty where coordinates in `in_span` were enough
  std::vector<int> columns;   ///< unknowns that the step depends on
  MatrixX d_surface;          ///< 3v x columns; empty after ForwardModel::predict_in_span where `in_span` says the same
  std::optional<SpanPlace> in_span;  ///< what surface and d_surface say; nothing: they are no such sum
  VectorX travel_m;           ///< a load: mean motion of its patch along the load's direction (work-conjugate)
  MatrixX d_travel;           ///< loads x columns
  std::vector<Vec3> force_n;  ///< a load: resultant on the object, base frame
  std::vector<Eigen::Matrix<double, 3, Eigen::Dynamic>> d_force;  ///< a load: 3 x columns
  int inverted_elements = 0;                                      ///< -1: not counted, ask ForwardModel::inverted_elements

  // Slow error of the rest surface: surface_m holds it; its many columns are not in d_surface but follow from its basis.
  const SurfaceField* field = nullptr;  ///< nullptr: none
  int field_unknown = -1;               ///< first of its coefficients
  Points field_directions;              ///< a vertex: along which the field moves it, base frame
  Points material_m;                    ///< surface without the field: what markers are fixed to
  MatrixX d_material;                   ///< as d_surface, of material_m; empty where it is the same
  const Points& markers_m() const { return field != nullptr ? material_m : surface_m; }
  const MatrixX& d_markers() const { return d_material.size() > 0 ? d_material : d_surface; }
};

/// What of a step's surface is made where it is a sum of fields.
enum class SurfacePart { coordinates, place, derivatives };

/// A load of known force: what of it acts and where.
struct ActingForce {
  Vec3 force_n = Vec3::Zero();  ///< on the object, base frame: the reading without what the sensor errs by
  /// From where the tip touched to the resultant, across the push: a shifted contact, and a patch that goes around an edge.
  Vec3 lever_m = Vec3::Zero();
  std::vector<int> unknowns;  ///< that the two depend on, one a column
  Eigen::Matrix<double, 3, Eigen::Dynamic> d_force, d_lever;
};

/// The object as the solver sees it.
struct SimulatedObject {
  TetMesh mesh;
  SimulatedSurface surface;
  std::string material = "neo_hookean";
  std::vector<int> region;                ///< an element: which of `region_names`; empty: one
  std::vector<std::string> region_names;  ///< empty: one
};

/// Of a linear body's answers between the Poisson ratios that it is solved at, relative to the largest: 0.2 micrometres of 20 mm.
inline constexpr double small_response_error = 1e-5;

class ForwardModel {
 public:
  /// What was solved for and does not depend on what was measured: bodies, a linear one's answers to unit loads over nu, the
  /// modes of the rest surface's error.
  struct Solved;

  /// Registers log E, nu and every nuisance that belongs to loads and supports in `unknowns` (which must be empty).
  /// `recording` must outlive this object.
  /// @param earlier  of a model of the same object, held in the same way, that has done its work: it is used again where law,
  ///                 options and contacts are the same, else made anew
  /// @param response_tolerance  of a linear body's answers between the Poisson ratios that it is solved at, relative
  /// @param poisson_expected  a linear body is made ready for these ratios alone; others cost a factorisation each
  /// @throws Error when a load names no tool, or supports leave a motion free that a load works on.
  ForwardModel(const Recording& recording, SimulatedObject object, Unknowns& unknowns, fem::StaticsOptions options = {},
               std::shared_ptr<Solved> earlier = nullptr, double response_tolerance = small_response_error,
               std::optional<std::pair<double, double>> poisson_expected = std::nullopt);
  ~ForwardModel();
  const std::shared_ptr<Solved>& solved() const { return solved_; }
  /// For a model of the same surface whose body is another: the modes of the rest surface's error alone, which take seconds.
  std::shared_ptr<Solved> surface_modes() const;

  std::size_t step_count() const { return steps_.size(); }
  const Step& step(std::size_t s) const;
  const Push& push(std::size_t s) const;
  /// @throws Error when no tool has this name.
  const Tool& tool(const std::string& name) const;
  /// What stick and arm behind a tool yield more than stated, m/N; -1 where that is exactly known.
  int compliance_unknown(const std::string& tool) const {
    const auto known = compliance_.find(tool);
    return known == compliance_.end() ? -1 : known->second;
  }
  StepIndex index(std::size_t s) const { return steps_[s]; }
  const SimulatedObject& object() const { return object_; }
  /// Of the surface at rest, made when it is first asked for (by one thread): others copy it.
  std::shared_ptr<const geometry::TriangleTree> rest_tree() const;
  std::shared_ptr<const std::vector<geometry::SurfaceEdge>> surface_edges() const;  ///< the same

  /// Solves step s. Starts from the last solution of this step, moved along its derivatives to the new unknowns.
  /// @param derivatives  false: surface, readings and converged only (the paper's method differentiates numerically)
  StepPrediction predict(std::size_t s, const VectorX& unknowns, bool derivatives = true);

  /// The same with StepPrediction::in_span, where the surface is a sum of a linear body's fields: where nothing turns the body or
  /// lets it slide, once nu's range was solved for. Where it is not, all is there as `predict` has it.
  /// @param part  of the surface what is wanted beside the coordinates: each more costs several times as much
  StepPrediction predict_in_span(std::size_t s, const VectorX& unknowns, SurfacePart part);
  /// Adds the surface to a prediction that was made with coordinates alone, at the same unknowns.
  void add_surface(std::size_t s, const VectorX& unknowns, StepPrediction& predicted) const;

  /// Puts a prediction's surface to where the object would be if nothing deformed it: its clamp, its support and the rest surface's error
  /// as these unknowns have them.
  void undeform(std::size_t s, const VectorX& unknowns, StepPrediction& predicted) const;

  /// Elements whose volume is gone at these unknowns; solves the step in full where the prediction cannot rule them out.
  int inverted_elements(std::size_t s, const VectorX& unknowns);

  /// The step that presses hardest, solved in full from rest, and with its loads stepped up: how far the model's own answer is from
  /// that, and whether another equilibrium exists. Nothing for an object in rigid contact.
  std::optional<fem::Certificate> certify(const VectorX& unknowns);

  /// Von Mises stress at the surface's vertices, Pa; empty without an equilibrium. Solves the step unless its last
  /// solution's derivatives lead there: what moves by less than a tenth.
  VectorX von_mises_pa(std::size_t s, const VectorX& unknowns);

  /// Several workers may predict at the same time, each on its own contiguous range of steps: first step of worker w (w ==
  /// workers(): one past the last). Answers depend on the number of workers only through where solves start from.
  std::size_t first_step_of(std::size_t worker) const { return worker * steps_.size() / workers_; }
  std::size_t workers() const { return workers_; }

  /// A step's load as a share of the highest so far: what supports that give way have given way by.
  const std::vector<double>& load_shares() const { return effort_; }
  bool gives_way() const { return !spread_.empty(); }

  /// A non-linear step whose solution would move by at most this share of itself since it was last solved follows its
  /// derivatives and is not solved anew: wrong by about the share's square. 0 (the default): every prediction is a solution.
  void set_reuse(double share) { reuse_ = share; }
  /// The largest square of such a share in the steps' last predictions: how far they are from solutions, relative.
  double reuse_error() const;

  /// True where a load's contact is not exactly known.
  bool contact_shifts(std::size_t s, std::size_t load) const { return contact_shift_[s][load] >= 0; }
  /// Force and lever of a step's load; nothing where its motion is imposed or no force acts. Asks for no solution.
  std::optional<ActingForce> acting_force(std::size_t s, std::size_t load, const VectorX& unknowns) const;

  /// How far from Load::contact_m these unknowns put the contact of a step's load, across the push; zero where it cannot shift.
  Vec3 contact_found_m(std::size_t s, std::size_t load, const VectorX& unknowns) const;

  /// True where answers are sums of answers to unit loads: a prediction costs next to nothing.
  bool superposes() const { return linear_; }

  /// True where the object touches something that only pushes, or a rigid tool.
  bool touches() const { return contact_; }

  /// Starts where another model of the same object and steps was last solved, on the same mesh or another one.
  void start_from(const ForwardModel& other);

  /// Added to every prediction from here on, a step each (none: as it is): what a finer mesh says.
  using Changes = std::vector<std::optional<PredictionChange>>;
  void set_changes(Changes changes) { changes_ = std::move(changes); }
  const Changes& changes() const { return changes_; }

  /// Forgets warm starts, so that the next answer does not depend on what was asked before.
  void forget();
  /// What was solved for each step alone: its memory, where many steps are asked once each.
  void forget_steps();

  /// Equilibria that were asked for.
  int solves() const;
  /// Load cases that the finite elements were solved for (FitSummary::load_cases), here and not by an earlier model.
  int load_cases() const;

 private:
  struct Body;          // one Response: a set of platens and its columns of loads
  struct Coefficients;  // of a step: a, b and their derivatives
  struct SolvedAt;      // an answer, and the unknowns that it is at
  struct Memory;        // of a step: where it was last solved
  using SolvedAtPtr = std::shared_ptr<const SolvedAt>;

  enum class Wanted { surface, derivatives, in_span, coordinates };
  StepPrediction unchanged(std::size_t s, const VectorX& unknowns, Wanted wanted);
  /// What the tools should read, without derivatives.
  void add_readings(std::size_t s, const Body& body, const Coefficients& c, const VectorX& unknowns, const fem::ResponseState& at,
                    StepPrediction& out) const;
  std::optional<SpanPlace> place_in_span(std::size_t s, const Body& body, const Coefficients& c, const VectorX& unknowns) const;
  int unit_load_cases() const;
  /// False: no equilibrium, and `out` says why.
  bool solve_step(std::size_t s, Body& body, const Coefficients& c, const VectorX& unknowns, bool derivatives,
                  fem::ResponseState& seen);
  VectorX lent_start(std::size_t s) const;  // of a step that another model lent a solution of
  bool solve_contact_step(std::size_t s, Body& body, const Coefficients& c, const VectorX& unknowns, bool derivatives,
                          fem::ResponseState& seen);
  SolvedAtPtr contact_state(std::size_t s, Body& body, const VectorX& unknowns, bool derivatives);
  SolvedAtPtr solve_contact(Body& body, const Coefficients& c, const VectorX& unknowns, bool derivatives, const SolvedAtPtr& start,
                            const SolvedAtPtr& before, const SolvedAtPtr& known, std::size_t worker);
  SolvedAtPtr lying(std::size_t s, Body& body, const VectorX& unknowns, bool derivatives);
  void add_contacts(Body& body, const Push& push, std::vector<fem::RigidContact> supports, fem::Response::Options& options);
  void add_path_columns(std::size_t s, const Body& body, const VectorX& unknowns, Coefficients& c) const;
  std::size_t first_step_of_push(std::size_t s) const { return s - steps_[s].step; }
  /// False: too far from where the step was last solved.
  bool follow(std::size_t s, const VectorX& unknowns, fem::ResponseState& seen);
  /// What acts in a step, as the body is asked.
  fem::ResponseQuery query(const Coefficients& c, const VectorX& unknowns, bool derivatives) const;

  std::size_t worker_of(std::size_t s) const;
  VectorX region_stiffness(const VectorX& unknowns) const;
  VectorX region_poisson(const VectorX& unknowns) const;
  std::vector<int> parameter_columns() const;
  void place_surface(std::size_t s, const VectorX& unknowns, const VectorX& moved_m, StepPrediction& out) const;
  /// Forgets bodies that lack columns of a contact.
  void drop_if_unfit(std::map<std::string, std::unique_ptr<Body>>& bodies) const;
  Body& body_of(const Push& push, std::size_t worker);
  const Body& body_of(std::size_t s) const;  // one that was made
  Coefficients coefficients(std::size_t s, const Body& body, const VectorX& unknowns) const;
  void drop_what_nothing_holds(std::size_t s, const Body& body, const VectorX& unknowns, Coefficients& c) const;
  std::string why_unheld(double sideways_n, double std_n) const;
  void prepare_slide(Body& body) const;
  void add_slide_unknowns(Unknowns& unknowns);
  void slide(std::size_t s, const Body& body, const VectorX& unknowns, const std::vector<int>& columns, bool derivatives,
             fem::ResponseState& at) const;
  struct ToolErrors {  // what the sensors of a tool err by all along a push: unknowns, or -1
    int tare = -1, cross_talk = -1;  // first of three, first of two
    int travel_offset = -1;
    Vec3 tare_axis = Vec3::Zero();  // zero: three unknowns, else one along this axis
  };
  const ToolErrors& errors_of(std::size_t s, std::size_t l) const { return tool_errors_[errors_of_[s][l]]; }
  /// By how much a true force is more than its reading, apart from the scale: true = (1 + force_scale) * read + tare.
  static Vec3 tare_n(const ToolErrors& errors, const VectorX& unknowns);
  /// What a tool whose motion is imposed presses with, and its derivatives.
  static Vec3 driven_force_n(const Body& body, const Load& load, const fem::ResponseState& at);
  /// What the sensor reads of a true force without tare, as a share of it: the same whether the force was given or is asked for, so
  /// that pushes of both kinds share one scale.
  double read_of_true(const VectorX& unknowns) const;
  static Eigen::Matrix<double, 3, Eigen::Dynamic> d_driven_force(const Body& body, const Load& load, const fem::ResponseState& at);
  struct TrueForce;  // of a load: its reading without what the sensor errs by
  TrueForce true_force(std::size_t s, std::size_t l, const VectorX& unknowns) const;
  struct LoadPart;  // of one load: columns that work together
  /// Of a patch, weighted with its pressure.
  static Vec3 mean_motion(const std::vector<LoadPart>& parts, const fem::ResponseState& at);
  std::vector<LoadPart> load_parts(std::size_t s, std::size_t l, const Body& body, const VectorX& unknowns) const;
  RigidOffset clamp_pose(std::size_t s, const VectorX& unknowns) const;
  /// Where the object stands as a whole: its clamp's pose, and how far its support has given way.
  RigidOffset clamp_offset(std::size_t s, const VectorX& unknowns) const;
  bool moves_as_a_whole(std::size_t s) const { return clamp_[s] >= 0 || !given_way_.empty(); }
  using RigidMotion = Eigen::Matrix<double, 6, 1>;  // translation of the pivot, rotation vector
  struct WholeMotion {
    int unknown;
    RigidMotion along;
  };
  std::vector<WholeMotion> whole_motions(std::size_t s) const;  // derivatives of clamp_offset
  void prepare_yielding_support(Unknowns& unknowns);
  double given_way_along(std::size_t s, const Load& load) const;
  double support_compliance(const VectorX& unknowns) const;

  const Recording* recording_;
  SimulatedObject object_;
  fem::StaticsOptions options_;
  double poisson_lower_ = 0, poisson_upper_ = 0;
  std::vector<StepIndex> steps_;
  std::size_t workers_ = 1;
  bool contact_ = false, path_ = false;  // bodies touch what only pushes; a step depends on the steps before
  bool linear_ = false;  // workers share one solver for each set of platens, else each has its own
  std::shared_ptr<Solved> solved_;
  std::vector<Memory> memory_;
  Changes changes_;
  double reuse_ = 0;
  std::vector<double> followed_;  // a step: share of itself by which the last prediction left a solution

  Vec3 clamp_pivot_m_ = Vec3::Zero();
  std::vector<int> clamp_;                       // a step: first of six unknowns, or -1
  std::vector<int> slide_;                       // a step: first of as many unknowns as motions are free, or -1
  std::vector<std::vector<int>> force_error_;    // a step and load: first of three unknowns (imposed travel: the one), or -1
  std::vector<std::vector<int>> contact_shift_;  // a step and load: first of two unknowns, or -1
  std::map<int, Vec3> shift_direction_;          // of the push that such two unknowns are across
  std::vector<std::vector<int>> patch_radius_;   // a step and load: the unknown, or -1
  std::vector<RigidMotion> given_way_;           // a step: how the support moves per m/N that it yields; empty: it does not
  double support_compliance_m_per_n_ = 0;        // as stated
  int support_compliance_unknown_ = -1;          // what it is more than stated, or -1
  std::vector<int> spread_;                      // a support that spreads: the unknown
  std::vector<double> effort_;                   // a step: its load as a share of the highest
  std::vector<ToolErrors> tool_errors_;
  std::vector<std::vector<std::size_t>> errors_of_;  // a step and load: which of them
  int force_scale_ = -1, time_offset_ = -1, density_ = -1;
  std::map<std::string, int> compliance_;  // a tool whose compliance is not exactly known
  int parameters_ = first_ratio;  ///< log E, nu, the regions' ratios and their own nu: the first columns of every derivative
  int first_own_poisson_ = first_ratio;  ///< where the ratios end
  const SurfaceField* field_ = nullptr;  // of solved_; nullptr: none
  int field_unknown_ = -1;
  std::vector<int> solves_;    // a worker
  int load_cases_before_ = 0;  // of unit responses taken over
};

/// Sets how far solutions are reused, for as long as it lives and until another one inside it ends.
class ReuseWhile {
 public:
  ReuseWhile(ForwardModel& model, double share) : model_(model) { model_.set_reuse(share); }
  ~ReuseWhile() { model_.set_reuse(0); }
  ReuseWhile(const ReuseWhile&) = delete;
  ReuseWhile& operator=(const ReuseWhile&) = delete;

 private:
  ForwardModel& model_;
};

}  // namespace palpate::estimation
