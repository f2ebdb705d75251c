// SPDX-License-Identifier: Apache-2.0
// Seeded recordings of known truth for tests/estimation/coverage_test.cpp: a soft object on a table, a pad that presses it in
// six levels and not at all, a depth camera. The truth is solved on a mesh of its own, much finer than what the fit builds from
// the recorded surface, and drawn from the priors that the recording states.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "estimation/calculix_response.hpp"
#include "estimation/coverage_rows.hpp"
#include "estimation/finer_near.hpp"
#include "estimation/random_field.hpp"
#include "fem/calculix.hpp"
#include "palpate/estimation/fit.hpp"
#include "palpate/estimation/fit_on_fine_mesh.hpp"
#include "palpate/estimation/mesh_error.hpp"
#include "palpate/fem/boundary.hpp"
#include "palpate/fem/linear_response.hpp"
#include "palpate/geometry/embedding.hpp"
#include "palpate/geometry/stand_on.hpp"
#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/identify.hpp"
#include "palpate/lab/random.hpp"
#include "palpate/reconstruction/build_object.hpp"

namespace palpate::coverage {

/// One recording, ready for estimation::fit.
struct Draw {
  Recording recording;
  estimation::Inputs inputs;
  double young_pa = 0, poisson = 0;
};

class Scene {
 public:
  static constexpr double sigma_m = 2e-3;
  static constexpr int levels = 6, points = 2000, calculix_points = 9;
  static constexpr int places = 20;  ///< of contacts that moved: one after the other serves a seed
  /// Truths are solved by CalculiX (C3D10) instead of our own solver, on the same mesh of theirs. May change between draws.
  bool by_calculix = false;
  double noise = 1;  ///< of the depths, in sigma_m: 0 shows what meshes do to the answer

  /// @param fine  elements across the pad's radius of the true mesh (the fit's has three)
  Scene(SceneSpec given, int fine, int true_tetrahedra) : spec_(std::move(given)) {
    recording_.rest.surface = spec_.surface;
    recording_.supports = spec_.supports;
    recording_.model.material = "linear";
    Tool pad;
    pad.name = "pad";
    pad.shape = ToolShape::disc;
    pad.radius_m = spec_.pad_radius_m;
    recording_.tools = {pad};
    Row shifts;
    shifts.contact_m = 1e-3;
    Recording pushed = with_push(shifts, 1);
    const Recording given_recording = pushed;
    object_ = build_simulated_object(pushed);
    const estimation::FillAnew anew = fill_anew(given_recording, pushed);
    recording_ = pushed;
    recording_.pushes.clear();

    reconstruction::BuildOptions filling;
    filling.mesh.tetrahedra = true_tetrahedra;
    filling.mesh.finer = {{spec_.contact_m, 1.1 * spec_.pad_radius_m, spec_.pad_radius_m / fine}};
    // Where a round object is glued is as sharp as the pad's rim: half the fit's edges.
    for (const Support& support : spec_.supports) {
      if (support.kind != SupportKind::plane) continue;
      for (auto near : geometry::finer_at_feet(support.plane, spec_.surface)) {
        near.edge_m *= 0.5;
        filling.mesh.finer.push_back(near);
      }
    }
    auto built = reconstruction::build_object(spec_.surface, spec_.supports, filling);
    supports_ = built.model.supports;
    mesh_ = fem::to_quadratic(built.model.volume);
    const TriMesh seen = finer_near(spec_.surface, spec_.contact_m, 2 * spec_.pad_radius_m, 1.2e-3, 6e-3);
    surface_ = estimation::SimulatedSurface::embedded(mesh_, seen, geometry::embed(seen.vertices_m, mesh_));
    tree_ = std::make_unique<geometry::TriangleTree>(seen);
    at_contact_.at_m = {spec_.contact_m};

    normals_ = Points::Zero(seen.vertices_m.rows(), 3);
    for (Index t = 0; t < seen.triangles.rows(); ++t) {
      const auto corner = [&](int k) { return Vec3(seen.vertices_m.row(seen.triangles(t, k))); };
      const Vec3 area = (corner(1) - corner(0)).cross(corner(2) - corner(0));
      for (int k = 0; k < 3; ++k) normals_.row(seen.triangles(t, k)) += area.transpose();
    }
    normals_.rowwise().normalize();
    // The picture is thinned to about the wished number of points.
    lab::Random none(0);
    const RayCloud all = look(seen.vertices_m, Pose::Identity(), Vec3::Zero(), false, 1000000, none);
    for (Index i = 0; i < all.range_m.size(); ++i)
      centre_m_ += (all.origins_m.row(i) + all.range_m(i) * all.directions.row(i)).transpose() / double(all.range_m.size());
    stride_px_ = std::max(1, static_cast<int>(stride_px_ * std::sqrt(double(all.range_m.size()) / points)));

    // As identify does, once for all recordings: the mesh errs by no more than is tolerated of a clean one.
    Draw clean = draw(rows().front(), 1);
    estimation::FitOptions quick;
    quick.cross_checks = quick.stresses = false;
    estimation::fit_on_fine_mesh(clean.recording, object_, clean.inputs, quick, IdentifyOptions{}.mesh_tolerance, nullptr, {}, anew, &finer_);
    recording_ = clean.recording;
    recording_.pushes.clear();
    // Columns for contacts that may have shifted serve every row.
    const Recording shifted = with_push(shifts, 1);
    estimation::Unknowns unknowns;
    memory_.model = estimation::ForwardModel(shifted, object_, unknowns, statics_options(shifted, object_, {})).solved();
  }

  const SceneSpec& spec() const { return spec_; }
  const estimation::SimulatedObject& object() const { return object_; }
  /// The same object twice as fine, for what the mesh does to the answer.
  const estimation::FinerModel* finer(const Recording& drawn) {
    if (!finer_) return nullptr;
    finer_->recording.pushes = drawn.pushes;
    finer_->recording.rest.surface_std_m = drawn.rest.surface_std_m;
    finer_->recording.rest.surface_correlation_m = drawn.rest.surface_correlation_m;
    return &*finer_;
  }
  estimation::FitMemory& memory() { return memory_; }
  Index true_tetrahedra() const { return static_cast<Index>(mesh_.tetrahedra.rows()); }
  /// Of the truth between the Poisson ratios that it is solved at, relative to the largest motion.
  double solver_error() const {
    double error = 0;
    for (const Truths* truths : {&at_contact_, &moved_}) {
      if (truths->response) error = std::max(error, truths->response->interpolation_error());
      for (const auto& [place, calculix] : truths->calculix) error = std::max(error, calculix.error());
    }
    return error;
  }

  Draw draw(const Row& row, std::uint64_t seed) {
    enum Stream : std::uint64_t { of_truth, of_contact, of_tare, of_pose, of_rest, of_points, of_noise, of_correlated, of_outliers };
    lab::Random truth(seed, of_truth);
    Draw out;
    out.young_pa = 1e4 * std::exp(truth.uniform() * std::log(10.0));
    out.poisson = truth.uniform(recording_.model.poisson_lower, recording_.model.poisson_upper);

    Truths& truths = row.contact_m > 0 ? moved_ : at_contact_;
    if (row.contact_m > 0 && moved_by_m_ != row.contact_m) {
      moved_ = {};
      moved_by_m_ = row.contact_m;
      for (std::uint64_t place = 1; place <= places; ++place)
        moved_.at_m.emplace_back(spec_.contact_m + row.contact_m * across(lab::Random(place, of_contact).normal3()));
    }
    const std::size_t place = (seed - 1) % truths.at_m.size();
    const Vec3 contact_m = truths.at_m[place];
    const Unit unit = unit_response(truths, place, out.poisson);
    // The pad's mean motion along the push is the depth at the highest level.
    const double per_newton_m = spec_.direction.dot(unit.pad * spec_.direction) / out.young_pa;
    const double highest_n = row.depth_m / per_newton_m;
    out.recording = with_push(row, highest_n);

    lab::Random tare_random(seed, of_tare), pose_random(seed, of_pose), rest_random(seed, of_rest), point_random(seed, of_points),
        noise_random(seed, of_noise), wave_random(seed, of_correlated), outlier_random(seed, of_outliers);
    const Vec3 tare_n = row.tare_share * highest_n * tare_random.normal3();
    Points rest_m = surface_.rest().vertices_m;
    if (row.rest_m > 0) {
      const std::array<RandomField, 3> field{RandomField(row.rest_m, row.rest_length_m, rest_random),
                                             RandomField(row.rest_m, row.rest_length_m, rest_random),
                                             RandomField(row.rest_m, row.rest_length_m, rest_random)};
      for (Index v = 0; v < rest_m.rows(); ++v) {
        const Vec3 x = rest_m.row(v), n = normals_.row(v);
        rest_m.row(v) += n.dot(Vec3(field[0].at(x), field[1].at(x), field[2].at(x))) * n.transpose();
      }
    }
    for (const Step& step : out.recording.pushes[0].steps) {
      const bool pressed = !step.loads.empty();
      const Vec3 force_n = pressed ? Vec3(*step.loads[0].force_n + tare_n) : Vec3(Vec3::Zero());
      Points moved = rest_m;
      const VectorX u = unit.moved * (force_n / out.young_pa);
      for (Index v = 0; v < moved.rows(); ++v) moved.row(v) += u.segment<3>(3 * v).transpose();
      const Vec3 tip_m = contact_m + unit.pad * force_n / out.young_pa;
      const Vec3 turn = row.pose_rad * pose_random.normal3();
      Pose frame = Pose::Identity();
      if (turn.norm() > 0) frame.rotate(Eigen::AngleAxisd(turn.norm(), turn.normalized()));
      frame = Eigen::Translation3d(centre_m_ + row.pose_m * pose_random.normal3()) * frame * Eigen::Translation3d(-centre_m_);

      estimation::RayObservation seen;
      seen.rays = look(moved, frame, tip_m, pressed, points, point_random);
      seen.pose_std_m = row.pose_m;
      seen.pose_std_rad = row.pose_rad;
      const RandomField waves(row.correlated_m, row.correlated_length_m, wave_random);
      for (Index i = 0; i < seen.rays.range_m.size(); ++i) {
        const Vec3 hit = (seen.rays.origins_m.row(i) + seen.rays.range_m(i) * seen.rays.directions.row(i)).transpose();
        seen.rays.range_m(i) += noise * sigma_m * noise_random.normal();
        if (row.correlated_m > 0) seen.rays.range_m(i) += waves.at(hit);
        if (row.outlier_share > 0 && outlier_random.uniform() < row.outlier_share)
          seen.rays.range_m(i) += (outlier_random.uniform() < 0.5 ? -1 : 1) * outlier_random.uniform(0.01, 0.06);
      }
      out.inputs.push_back({seen});
    }
    return out;
  }

 private:
  /// Surface rows and mean motion of the pad for unit forces along x, y, z at E = 1.
  struct Unit {
    MatrixX moved;  // 3v x 3
    Mat3 pad;
  };

  Vec3 across(const Vec3& x) const { return x - spec_.direction.dot(x) * spec_.direction; }

  Recording with_push(const Row& row, double highest_n) const {
    Recording recording = recording_;
    recording.rest.surface_std_m = row.rest_m;
    recording.rest.surface_correlation_m = row.rest_length_m;
    Push push;
    push.name = "push";
    push.force_tare_std_n = row.tare_share * highest_n;
    for (int level = 0; level <= levels; ++level) {
      Step step;
      step.time_s = level;
      if (level > 0) {
        Load load;
        load.tool = "pad";
        load.direction = spec_.direction;
        load.contact_m = spec_.contact_m;
        load.contact_std_m = row.contact_m;
        load.force_n = highest_n * level / levels * spec_.direction;
        step.loads = {load};
      }
      push.steps.push_back(step);
    }
    recording.pushes = {push};
    return recording;
  }

  std::vector<Index> held_nodes() const {
    std::set<Index> held;
    for (const Support& support : supports_) {
      for (Index node : fem::support_nodes(mesh_, support)) held.insert(node);
    }
    return {held.begin(), held.end()};
  }

  /// Truths of contacts at a few places, solved for together: over nu, so that each factor serves all of them.
  struct Truths {
    std::vector<Vec3> at_m;
    Eigen::SparseMatrix<double> watched;  // the surface, and the pad's mean motion at each place
    std::unique_ptr<fem::Statics> statics;
    std::unique_ptr<fem::LinearResponse> response;  // made when they are first asked for, as are a place's by CalculiX
    std::map<std::size_t, CalculixResponse> calculix;
  };

  void prepare(Truths& truths) const {
    fem::Boundary boundary;
    for (Index node : held_nodes()) boundary.constraints.push_back({node, Mat3::Identity(), 3});
    std::vector<Eigen::Triplet<double>> forces;
    for (std::size_t place = 0; place < truths.at_m.size(); ++place) {
      const Eigen::SparseMatrix<double> here = fem::spread_over_patch(mesh_, truths.at_m[place], spec_.pad_radius_m);
      for (int axis = 0; axis < 3; ++axis)
        for (Eigen::SparseMatrix<double>::InnerIterator it(here, axis); it; ++it) forces.emplace_back(it.row(), int(3 * place) + axis, it.value());
    }
    boundary.forces.resize(3 * mesh_.nodes_m.rows(), Eigen::Index(3 * truths.at_m.size()));
    boundary.forces.setFromTriplets(forces.begin(), forces.end());
    boundary.motions.resize(boundary.forces.rows(), 0);
    Eigen::SparseMatrix<double, Eigen::RowMajor> rows = surface_.rows(static_cast<Index>(mesh_.nodes_m.rows()));
    const Eigen::Index seen = rows.rows();
    rows.conservativeResize(seen + boundary.forces.cols(), rows.cols());
    rows.bottomRows(boundary.forces.cols()) = Eigen::SparseMatrix<double, Eigen::RowMajor>(boundary.forces.transpose());
    truths.watched = rows;
    fem::StaticsOptions options;
    options.dilatation = fem::Dilatation::averaged;
    truths.statics = std::make_unique<fem::Statics>(mesh_, "linear", std::move(boundary), options);
    fem::LinearResponse::Options over_nu;
    over_nu.poisson_lower = recording_.model.poisson_lower;
    over_nu.poisson_upper = recording_.model.poisson_upper;
    over_nu.tolerance = 1e-5;
    over_nu.memory_limit_bytes = 4e9;
    truths.response = std::make_unique<fem::LinearResponse>(*truths.statics, truths.watched, over_nu);
  }

  /// Watched rows for unit forces along x, y, z at E = 1, at one place.
  MatrixX solved_by_calculix(const Truths& truths, std::size_t place, double poisson) const {
    constexpr double young_pa = 1e4;  // its digits are few, but not those of the exponent
    const Eigen::SparseMatrix<double> forces = fem::spread_over_patch(mesh_, truths.at_m[place], spec_.pad_radius_m);
    MatrixX moved(truths.watched.rows(), 3);
    for (int axis = 0; axis < 3; ++axis) {
      const VectorX u = fem::calculix_displacements(mesh_, held_nodes(), VectorX(forces.col(axis)), false, young_pa, poisson);
      if (!u.allFinite()) throw std::runtime_error("CalculiX (ccx) gave no displacements");
      moved.col(axis) = young_pa * (truths.watched * u);
    }
    return moved;
  }

  Unit unit_response(Truths& truths, std::size_t place, double poisson) const {
    if (!truths.response) prepare(truths);
    const Eigen::Index surface = truths.watched.rows() - Eigen::Index(3 * truths.at_m.size()), first = Eigen::Index(3 * place);
    if (!by_calculix) {
      const auto answers = truths.response->at(poisson);
      const MatrixX& moved = answers->force;
      return {moved.block(0, first, surface, 3), moved.block<3, 3>(surface + first, first)};
    }
    if (!truths.calculix.contains(place)) {
      truths.calculix.emplace(place, CalculixResponse([&](double nu) { return solved_by_calculix(truths, place, nu); },
                                                      recording_.model.poisson_lower, recording_.model.poisson_upper, calculix_points));
    }
    const MatrixX moved = truths.calculix.at(place).at(poisson);
    return {moved.topRows(surface), moved.middleRows<3>(surface + first)};
  }

  /// Exact ranges of the pixels that see the object past the stick (8 mm thick), at most `most`.
  RayCloud look(const Points& surface_m, const Pose& frame, const Vec3& tip_m, bool pressed, int most, lab::Random& random) {
    tree_->refit(surface_m);
    constexpr double focal_px = 606;
    constexpr int width = 640, height = 480;
    const Vec3 z = (0.5 * (spec_.contact_m + Vec3(spec_.contact_m.x(), spec_.contact_m.y(), 0)) - spec_.eye_m).normalized();
    const Vec3 x = z.cross(Vec3::UnitZ()).normalized(), y = z.cross(x);
    const Vec3 eye_m = frame * spec_.eye_m;
    std::vector<Vec3> directions;
    std::vector<double> ranges;
    std::vector<std::array<Index, 2>> pixels;
    for (int row = 0; row < height; row += stride_px_) {
      for (int column = 0; column < width; column += stride_px_) {
        const Vec3 nominal = (z + (column - 320) / focal_px * x + (row - 240) / focal_px * y).normalized();
        const Vec3 direction = frame.linear() * nominal;
        const auto hit = tree_->cast(eye_m, direction);
        if (!hit || hit->range_m < 0) continue;
        if (pressed && meets_stick(eye_m, direction, hit->range_m, tip_m)) continue;
        directions.push_back(nominal);
        ranges.push_back(hit->range_m);
        pixels.push_back({column, row});
      }
    }
    // Every place of the picture keeps its share.
    while (static_cast<int>(ranges.size()) > most) {
      const std::size_t out = static_cast<std::size_t>(random.uniform() * double(ranges.size()));
      std::swap(ranges[out], ranges.back()), std::swap(directions[out], directions.back()), std::swap(pixels[out], pixels.back());
      ranges.pop_back(), directions.pop_back(), pixels.pop_back();
    }
    RayCloud rays;
    const Index count = static_cast<Index>(ranges.size());
    rays.origins_m = spec_.eye_m.transpose().replicate(count, 1);
    rays.directions.resize(count, 3);
    rays.range_m.resize(count);
    rays.pixel.resize(count, 2);
    rays.sigma_m = VectorX::Constant(count, sigma_m);
    for (Index i = 0; i < count; ++i) {
      const auto at = static_cast<std::size_t>(i);
      rays.directions.row(i) = directions[at];
      rays.range_m(i) = ranges[at];
      rays.pixel.row(i) << pixels[at][0], pixels[at][1];
    }
    return rays;
  }

  /// Does the ray pass within the stick's radius before it hits the object?
  bool meets_stick(const Vec3& eye_m, const Vec3& direction, double range_m, const Vec3& tip_m) const {
    constexpr double stick_m = 0.008;
    for (double back_m = 0; back_m < 0.4; back_m += 0.004) {
      const Vec3 at = tip_m - back_m * spec_.direction - eye_m;
      const double along = at.dot(direction);
      if (along < range_m + stick_m && (at - along * direction).norm() < stick_m) return true;
    }
    return false;
  }

  SceneSpec spec_;
  Recording recording_;  // as the fit sees it, without pushes
  estimation::SimulatedObject object_;
  std::optional<estimation::FinerModel> finer_;
  estimation::FitMemory memory_;

  TetMesh mesh_;  // of the truth
  std::vector<Support> supports_;
  estimation::SimulatedSurface surface_;
  Truths at_contact_, moved_;
  double moved_by_m_ = 0;  // standard deviation of the places in moved_
  std::unique_ptr<geometry::TriangleTree> tree_;
  Points normals_;
  Vec3 centre_m_ = Vec3::Zero();  // of what the camera sees at rest
  int stride_px_ = 2;
};

}  // namespace palpate::coverage
