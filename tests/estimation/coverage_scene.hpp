// SPDX-License-Identifier: Apache-2.0
// Seeded recordings of known truth for tests/estimation/coverage_test.cpp: a soft object on a table, a pad that presses it in
// six levels and not at all, a depth camera. The truth is solved on a mesh of its own, much finer than what the fit builds from
// the recorded surface, and drawn from the priors that the recording states.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "fem/calculix.hpp"
#include "palpate/estimation/fit.hpp"
#include "palpate/estimation/mesh_error.hpp"
#include "palpate/fem/boundary.hpp"
#include "palpate/fem/linear_response.hpp"
#include "palpate/geometry/embedding.hpp"
#include "palpate/geometry/stand_on.hpp"
#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/identify.hpp"
#include "palpate/io/mesh_file.hpp"
#include "palpate/lab/box_surface.hpp"
#include "palpate/lab/implicit_surface.hpp"
#include "palpate/lab/random.hpp"
#include "palpate/reconstruction/build_object.hpp"

namespace palpate::coverage {

/// What is wrong with a recording: a row of the table. Each is drawn with the standard deviation that the recording states.
struct Row {
  std::string name;
  double outlier_share = 0;
  double tare_share = 0;  ///< of the highest force
  double pose_m = 0, pose_rad = 0;
  double rest_m = 0, rest_length_m = 0.04;
  double contact_m = 0;
  double correlated_m = 0, correlated_length_m = 0.015;
  double depth_m = 0.02;
};

inline std::vector<Row> rows() {
  constexpr double degree = EIGEN_PI / 180;
  std::vector<Row> all(8);
  all[0].name = "clean";
  all[1].name = "outliers", all[1].outlier_share = 0.05;
  all[2].name = "tare", all[2].tare_share = 0.02;
  all[3].name = "pose", all[3].pose_m = 1e-3, all[3].pose_rad = 0.2 * degree;
  all[4].name = "rest", all[4].rest_m = 5e-4;
  all[5].name = "contact", all[5].contact_m = 4e-3;
  all[6].name = "correlated", all[6].correlated_m = 3e-4;
  all[7] = {"all", 0.05, 0.02, 1e-3, 0.2 * degree, 5e-4, 0.04, 4e-3, 3e-4, 0.015, 0.04};
  return all;
}

struct SceneSpec {
  std::string name;
  TriMesh surface;
  std::vector<Support> supports;
  Vec3 contact_m, direction, eye_m;
  double pad_radius_m = 0.015;
};

inline Support table() {
  Support support;
  support.name = "table";
  support.kind = SupportKind::plane;
  support.select = NodeSelection::plane;
  return support;
}

inline SceneSpec cube_top() {
  return {"cube_top", lab::box_surface({-0.075, -0.075, 0}, {0.075, 0.075, 0.15}, 10), {table()}, {0, 0, 0.15}, -Vec3::UnitZ(),
          {0.3, -0.35, 0.55}};
}

inline SceneSpec ball_top() {
  const Vec3 centre(0, 0, 0.065);
  return {"ball_top",
          lab::implicit_surface([centre](const Vec3& p) { return (p - centre).norm() - 0.075; },
                                {Vec3(-0.085, -0.085, 0), Vec3(0.085, 0.085, 0.15), 0.004}),
          {table()}, {0, 0, 0.14}, -Vec3::UnitZ(), {0.3, -0.35, 0.5}};
}

inline SceneSpec bar_oblique() {
  return {"bar_oblique", lab::box_surface({-0.03, -0.03, 0}, {0.03, 0.03, 0.18}, 12), {table()}, {0, 0, 0.18},
          Vec3(1, 0, -1).normalized(), {-0.3, -0.35, 0.5}};
}

/// The optional data's teddy, standing, 0.3 m high, pushed into the belly.
inline std::optional<SceneSpec> teddy_belly() {
  const std::filesystem::path file = std::filesystem::path(PALPATE_SHARED_DIR) / "data/meshes/teddy_autoknit.obj";
  if (!std::filesystem::exists(file)) return std::nullopt;
  SceneSpec spec;
  spec.name = "teddy_belly";
  const TriMesh given = io::read_tri_mesh(file);
  spec.surface = given;
  spec.surface.vertices_m.col(1) = -given.vertices_m.col(2);  // y is up in the file
  spec.surface.vertices_m.col(2) = given.vertices_m.col(1);
  spec.surface.vertices_m *= 0.3 / (given.vertices_m.col(1).maxCoeff() - given.vertices_m.col(1).minCoeff());
  const double foot_m = spec.surface.vertices_m.col(2).minCoeff();
  spec.surface.vertices_m.col(2).array() -= foot_m;
  Support glue;
  glue.name = "glue";
  glue.kind = SupportKind::box;
  glue.select = NodeSelection::box;
  glue.box_min_m = Vec3(-1, -1, -0.01);
  glue.box_max_m = Vec3(1, 1, 0.02);
  spec.supports = {glue};
  const auto hit = geometry::TriangleTree(spec.surface).cast({0, -1, 0.12}, Vec3::UnitY());
  spec.contact_m = Vec3(0, -1 + hit->range_m, 0.12);
  spec.direction = Vec3::UnitY();
  spec.eye_m = Vec3(0.35, -0.5, 0.3);
  return spec;
}

inline std::vector<SceneSpec> scenes() {
  std::vector<SceneSpec> all{cube_top(), ball_top(), bar_oblique()};
  if (auto teddy = teddy_belly()) all.push_back(*teddy);
  return all;
}

/// Every triangle near a place in four, until none there is longer.
inline TriMesh finer_near(TriMesh mesh, const Vec3& place_m, double radius_m, double edge_m, double elsewhere_m) {
  std::vector<Vec3> points;
  for (Index v = 0; v < mesh.vertices_m.rows(); ++v) points.push_back(mesh.vertices_m.row(v));
  std::vector<std::array<Index, 3>> triangles;
  for (Index t = 0; t < mesh.triangles.rows(); ++t)
    triangles.push_back({mesh.triangles(t, 0), mesh.triangles(t, 1), mesh.triangles(t, 2)});
  // Longest edges are halved, both of their triangles at once, so that no crack opens.
  for (bool again = true; again;) {
    again = false;
    std::map<std::pair<Index, Index>, Index> middle;
    const auto at = [&](Index i) -> const Vec3& { return points[static_cast<std::size_t>(i)]; };
    std::vector<std::pair<Index, Index>> longest;
    for (const auto& t : triangles) {
      std::pair<Index, Index> edge;
      double length_m = 0;
      for (std::size_t k = 0; k < 3; ++k) {
        const Index a = t[k], b = t[(k + 1) % 3];
        // Ties go to the lower pair of indices, so that neighbours agree.
        const double d = (at(a) - at(b)).norm();
        if (d > length_m * (1 + 1e-9)) length_m = d, edge = std::minmax(a, b);
      }
      longest.push_back(edge);
      const double away_m = std::max(0.0, ((at(t[0]) + at(t[1]) + at(t[2])) / 3 - place_m).norm() - radius_m);
      if (length_m > std::min(elsewhere_m, edge_m + 0.3 * away_m) && middle.emplace(edge, -1).second) again = true;
    }
    for (auto& [edge, node] : middle) {
      node = static_cast<Index>(points.size());
      points.push_back(0.5 * (at(edge.first) + at(edge.second)));
    }
    std::vector<std::array<Index, 3>> next;
    const auto split = [&](const auto& self, const std::array<Index, 3>& t) -> void {
      for (std::size_t k = 0; k < 3; ++k) {
        const auto cut = middle.find(std::minmax(t[k], t[(k + 1) % 3]));
        if (cut == middle.end()) continue;
        self(self, {t[k], cut->second, t[(k + 2) % 3]});
        self(self, {cut->second, t[(k + 1) % 3], t[(k + 2) % 3]});
        return;
      }
      next.push_back(t);
    };
    for (const auto& t : triangles) split(split, t);
    triangles = std::move(next);
  }
  mesh.vertices_m.resize(static_cast<Index>(points.size()), 3);
  for (std::size_t i = 0; i < points.size(); ++i) mesh.vertices_m.row(static_cast<Index>(i)) = points[i];
  mesh.triangles.resize(static_cast<Index>(triangles.size()), 3);
  for (std::size_t i = 0; i < triangles.size(); ++i)
    mesh.triangles.row(static_cast<Index>(i)) << triangles[i][0], triangles[i][1], triangles[i][2];
  return mesh;
}

/// Smooth random field with covariance std^2 exp(-d^2 / (2 length^2)), by random Fourier features.
class RandomField {
 public:
  RandomField(double std, double length_m, lab::Random& random) {
    constexpr int waves = 250;
    wave_.resize(waves, 3);
    phase_.resize(waves);
    for (int k = 0; k < waves; ++k) {
      wave_.row(k) = random.normal3() / length_m;
      phase_(k) = random.uniform(0, 2 * EIGEN_PI);
    }
    size_ = std * std::sqrt(2.0 / waves);
  }
  double at(const Vec3& x_m) const { return size_ * (wave_ * x_m + phase_).array().cos().sum(); }

 private:
  Eigen::Matrix<double, Eigen::Dynamic, 3> wave_;
  VectorX phase_;
  double size_ = 0;
};

/// One recording, ready for estimation::fit.
struct Draw {
  Recording recording;
  estimation::Inputs inputs;
  double young_pa = 0, poisson = 0;
};

class Scene {
 public:
  static constexpr double sigma_m = 2e-3;
  static constexpr int levels = 6, points = 2000;
  /// Truths are solved by CalculiX (C3D10) instead of our own solver, on the same mesh of theirs.
  bool by_calculix = false;

  /// @param fine  elements across the pad's radius of the true mesh (the fit's has three)
  Scene(SceneSpec given, int fine) : spec_(std::move(given)) {
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
    finer_ = estimation::finer_model(pushed, object_, fill_anew(given_recording, pushed));
    // Columns for contacts that may have shifted serve every row.
    estimation::Unknowns unknowns;
    memory_.model = estimation::ForwardModel(pushed, object_, unknowns, statics_options(pushed, object_, {})).solved();
    recording_ = pushed;
    recording_.pushes.clear();

    reconstruction::BuildOptions filling;
    filling.mesh.tetrahedra = 24000;
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
    statics_ = statics_at(spec_.contact_m, watched_);
    fem::LinearResponse::Options options;
    options.poisson_lower = recording_.model.poisson_lower;
    options.poisson_upper = recording_.model.poisson_upper;
    options.tolerance = 1e-5;
    response_ = std::make_unique<fem::LinearResponse>(*statics_, watched_, options);

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
  double solver_error() const { return response_->interpolation_error(); }

  Draw draw(const Row& row, std::uint64_t seed) {
    enum Stream : std::uint64_t { of_truth, of_contact, of_tare, of_pose, of_rest, of_points, of_noise, of_correlated, of_outliers };
    lab::Random truth(seed, of_truth);
    Draw out;
    out.young_pa = 1e4 * std::exp(truth.uniform() * std::log(10.0));
    out.poisson = truth.uniform(recording_.model.poisson_lower, recording_.model.poisson_upper);

    Vec3 contact_m = spec_.contact_m;
    if (row.contact_m > 0) {
      lab::Random random(seed, of_contact);
      contact_m += row.contact_m * across(random.normal3());
    }
    const Unit unit = unit_response(contact_m, out.poisson);
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
        seen.rays.range_m(i) += sigma_m * noise_random.normal();
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

  std::unique_ptr<fem::Statics> statics_at(const Vec3& contact_m, Eigen::SparseMatrix<double>& watched) const {
    fem::Boundary boundary;
    for (Index node : held_nodes()) boundary.constraints.push_back({node, Mat3::Identity(), 3});
    boundary.forces = fem::spread_over_patch(mesh_, contact_m, spec_.pad_radius_m);
    boundary.motions.resize(boundary.forces.rows(), 0);
    Eigen::SparseMatrix<double, Eigen::RowMajor> rows = surface_.rows(static_cast<Index>(mesh_.nodes_m.rows()));
    const Eigen::Index seen = rows.rows();
    rows.conservativeResize(seen + 3, rows.cols());
    rows.bottomRows(3) = Eigen::SparseMatrix<double, Eigen::RowMajor>(boundary.forces.transpose());
    watched = rows;
    fem::StaticsOptions options;
    options.dilatation = fem::Dilatation::averaged;
    return std::make_unique<fem::Statics>(mesh_, "linear", std::move(boundary), options);
  }

  Unit unit_response(const Vec3& contact_m, double poisson) {
    Unit out;
    if (by_calculix) {
      constexpr double young_pa = 1e4;  // its digits are few, but not those of the exponent
      Eigen::SparseMatrix<double> watched;
      const auto statics = statics_at(contact_m, watched);
      const Eigen::SparseMatrix<double> forces = fem::spread_over_patch(mesh_, contact_m, spec_.pad_radius_m);
      MatrixX moved(watched.rows(), 3);
      for (int axis = 0; axis < 3; ++axis) {
        const VectorX u = fem::calculix_displacements(mesh_, held_nodes(), VectorX(forces.col(axis)), false, young_pa, poisson);
        if (!u.allFinite()) throw std::runtime_error("CalculiX (ccx) gave no displacements");
        moved.col(axis) = young_pa * (watched * u);
      }
      out.moved = moved.topRows(moved.rows() - 3);
      out.pad = moved.bottomRows<3>();
    } else if (contact_m == spec_.contact_m) {
      const auto known = response_->at(poisson);
      out.moved = known->force.topRows(known->force.rows() - 3);
      out.pad = known->force.bottomRows<3>();
    } else {
      Eigen::SparseMatrix<double> watched;
      const auto statics = statics_at(contact_m, watched);
      const fem::UnitResponses solved = statics->unit_responses(poisson, watched);
      out.moved = solved.force.topRows(solved.force.rows() - 3);
      out.pad = solved.force.bottomRows<3>();
    }
    return out;
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
  Eigen::SparseMatrix<double> watched_;
  std::unique_ptr<fem::Statics> statics_;
  std::unique_ptr<fem::LinearResponse> response_;
  std::unique_ptr<geometry::TriangleTree> tree_;
  Points normals_;
  Vec3 centre_m_ = Vec3::Zero();  // of what the camera sees at rest
  int stride_px_ = 2;
};

}  // namespace palpate::coverage
