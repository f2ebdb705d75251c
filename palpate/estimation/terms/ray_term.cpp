// SPDX-License-Identifier: Apache-2.0
// Depth along the camera ray against the exactly ray-cast deformed surface. Unlike a closest point, the residual lies where
// the noise lies, so noise does not bias it. While the surface may still be far off, the closest point gives direction
// instead.
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "palpate/core/error.hpp"
#include "palpate/estimation/grazing.hpp"
#include "palpate/estimation/names_of_unknowns.hpp"
#include "palpate/estimation/terms/surface_terms.hpp"
#include "palpate/geometry/ray_bundle.hpp"

namespace palpate::estimation {
namespace {

// What the fit makes of a recording hangs on means over wide parts of the picture: a cell must hold most of the neighbours
// that a point's error is correlated with (a few times the sensor's correlation length, 5 to 20 pixels), or their effect is
// missed.
constexpr Index cell_px = 48;
constexpr double endless = 1e300;
constexpr double steepest_cosine = 0.17;  // a ray that counts may come to a facet that it grazes: its say is bounded

class RayTerm : public Term {
 public:
  RayTerm(const RayObservation& observation, const ForwardModel& model, int pose, int camera, int bias, int scatter)
      : rays_(observation.rays),
        outline_margin_rad_(observation.outline_margin_rad),
        lens_(observation.scatter.value_or(LensScatter{})),
        R_base_camera_(observation.R_base_camera),
        pose_(pose),
        camera_(camera),
        bias_(bias),
        scatter_(scatter),
        rest_tree_(model.rest_tree()),
        edges_(outline_margin_rad_ > 0 ? model.surface_edges() : nullptr),
        rest_(rest_tree_->mesh()),
        hints_(static_cast<std::size_t>(rays_.range_m.size()), -1) {
    centre_m_ = rest_.vertices_m.colwise().mean();
    pivot_m_ = (rays_.origins_m.colwise().sum().transpose() + rays_.directions.transpose() * rays_.range_m) /
               static_cast<double>(rays_.range_m.size());
    typical_ = rays_.sigma_m.mean();
    one_eye_ = (rays_.origins_m.rowwise() - rays_.origins_m.row(0)).isZero(0);
  }

  TermRows rows(const StepPrediction& predicted, const VectorX& unknowns, const TermView& view) const override {
    if (view.along_rays && view.surface_slopes && !needs_surface_derivatives()) return facet_rows(predicted, unknowns, view);
    Sight sight = look(predicted.surface_m, unknowns, view);
    const RigidMap &frame = sight.frame, &camera = sight.camera;
    const double bias_m = bias_ >= 0 ? unknowns(bias_) : 0;
    const Index count = static_cast<Index>(predicted.columns.size());
    const Index pose_column = count;
    const Index camera_column = pose_column + (pose_ >= 0 ? 6 : 0);
    const Index bias_column = camera_column + (camera_ >= 0 ? 6 : 0);
    const Index scatter_column = bias_column + (bias_ >= 0 ? 1 : 0);
    const double share = scatter_ >= 0 ? unknowns(scatter_) : 0;
    TermRows rows = blank_rows(predicted, view);
    const FieldColumns field(predicted);
    field.append_unknowns(rows.unknowns);
    rows.jacobian = MatrixX::Zero(rays_.range_m.size(), static_cast<Index>(rows.unknowns.size()));
    if (view.surface_slopes) rows.surface.resize(static_cast<std::size_t>(rays_.range_m.size()));

    const MatrixX slopes = predicted.d_surface.transpose();  // a vertex's in one place
    const MatrixX material_slopes = share != 0 ? MatrixX(predicted.d_markers().transpose()) : MatrixX();
    VectorX slope(count);
    for (Index i = 0; i < rays_.range_m.size(); ++i) {
      // The measured point, with the sensor's common offset taken out, where the corrected camera pose puts it.
      const Vec3 measured = point(i) - bias_m * Vec3(rays_.directions.row(i));
      const Vec3 observed = frame.apply(camera.apply(measured));
      const Vec3 direction = sight.rotation * rays_.directions.row(i).transpose();
      rows.observed_m.row(i) = observed;

      Index triangle = -1;
      Vec3 barycentric, gradient;  // of the distance between observed and surface along the ray (or between both)
      double residual_m = 0;
      std::optional<Scattered> scattered;
      Vec3 lever = measured;  // where the frame's pose acts: the hit, for a ray
      const bool chosen = view.chosen != nullptr && (*view.chosen)[static_cast<std::size_t>(i)] == counts_in;
      if ((view.chosen != nullptr && !chosen) || !view.asks(i, static_cast<Index>(rays_.range_m.size()))) {
        rows.residual(i) = std::numeric_limits<double>::infinity();
        continue;
      }
      if (view.along_rays) {
        const Vec3 origin_m = sight.place(rays_.origins_m.row(i));
        double range_m = 0;  // at which the ray meets the surface
        if (const auto hit = cast(sight, predicted.surface_m, i, origin_m, direction)) {
          const Vec3 normal = face_normal(predicted.surface_m, hit->triangle);
          const double cosine = normal.dot(direction);
          rows.facing(i) = sight.facing(i, cosine);
          if (chosen || rows.facing(i) > 1) {
            triangle = hit->triangle;
            barycentric = hit->barycentric;
            gradient = normal / std::copysign(std::max(std::abs(cosine), steepest_cosine), cosine);
            range_m = hit->range_m;
          }
        } else if (chosen && !view.surface_slopes) {  // nearest points jump from edge to edge: no quadratic form holds them
          if (const auto beside = beside_outline(tree_of(sight, predicted.surface_m), origin_m, direction, observed, rays_.sigma_m(i),
                                                 hints_[static_cast<std::size_t>(i)])) {
            triangle = beside->triangle;
            barycentric = beside->barycentric;
            gradient = across_edge(predicted.surface_m, *beside, direction);
            range_m = direction.dot(beside->point_m - origin_m);
          }
        }
        if (triangle >= 0) {
          residual_m = rays_.range_m(i) - bias_m - range_m;
          rows.met_m.row(i) = (origin_m + range_m * direction).transpose();
          lever = measured - residual_m * Vec3(rays_.directions.row(i));
          if (scatter_ >= 0) {
            scattered = scatter(predicted, triangle, rays_.directions.row(i), range_m);
            residual_m -= share * scattered->error.m;
          }
        }
      } else {
        Index& hint = hints_[static_cast<std::size_t>(i)];
        const auto hit = tree_of(sight, predicted.surface_m).closest(observed, hint);
        triangle = hint = hit.triangle;
        rows.met_m.row(i) = hit.point_m.transpose();
        barycentric = hit.barycentric;
        const Vec3 apart = observed - hit.point_m;
        gradient = apart.norm() > 1e-9 ? Vec3(apart.normalized()) : face_normal(predicted.surface_m, hit.triangle);
        residual_m = apart.norm();
      }
      if (triangle < 0) {  // the ray passes the object by: an outlier, at no gradient
        rows.residual(i) = std::numeric_limits<double>::infinity();
        continue;
      }
      const double sigma_m = rays_.sigma_m(i);
      rows.residual(i) = residual_m / sigma_m;
      if (bias_ >= 0) rows.jacobian(i, bias_column) = -gradient.dot(direction) / sigma_m;
      slope.setZero();
      if (scattered) {
        rows.jacobian(i, scatter_column) = -scattered->error.m / sigma_m;
        gradient *= 1 + share * scattered->error.per_range;
        for (int k = 0; share != 0 && k < 3; ++k)
          slope.noalias() -= material_slopes.middleCols<3>(3 * rest_.triangles(triangle, k)) *
                             (share * scattered->error.per_cosine / sigma_m * scattered->cosine_per_corner[k]);
      }
      for (int k = 0; k < 3; ++k) {
        const Vec3 weighed = barycentric(k) / sigma_m * gradient;
        const double* const of_corner = slopes.data() + 3 * count * rest_.triangles(triangle, k);
        for (Index c = 0; c < count; ++c)
          slope(c) -= of_corner[c] * weighed(0) + of_corner[count + c] * weighed(1) + of_corner[2 * count + c] * weighed(2);
      }
      rows.jacobian.row(i).head(count) = slope.transpose();
      if (view.surface_slopes) {
        SurfaceSlope& surface = rows.surface[static_cast<std::size_t>(i)];
        surface.triangle = triangle;
        surface.per_corner = -gradient / sigma_m * barycentric.transpose();
        for (int k = 0; scattered && k < 3; ++k)
          surface.per_corner.col(k) -= share * scattered->error.per_cosine / sigma_m * scattered->cosine_per_corner[k];
      }
      field.subtract(rows.jacobian, i, rest_.triangles.row(triangle), barycentric, gradient / sigma_m);
      if (pose_ >= 0) {
        rows.jacobian.block<1, 6>(i, pose_column) = frame.slope(gradient / sigma_m, camera.apply(lever));
      }
      if (camera_ >= 0) {
        const auto slope_of_base = camera.slope(frame.rotation().transpose() * gradient / sigma_m, lever);
        rows.jacobian.block<1, 3>(i, camera_column) = slope_of_base.head<3>() * R_base_camera_;
        rows.jacobian.block<1, 3>(i, camera_column + 3) = slope_of_base.tail<3>() * R_base_camera_;
      }
    }
    return rows;
  }
  std::vector<int> own_unknowns() const override {
    std::vector<int> own;
    for (int k = 0; pose_ >= 0 && k < 6; ++k) own.push_back(pose_ + k);
    for (int k = 0; camera_ >= 0 && k < 6; ++k) own.push_back(camera_ + k);
    if (bias_ >= 0) own.push_back(bias_);
    if (scatter_ >= 0) own.push_back(scatter_);
    return own;
  }
  double typical_sigma() const override { return typical_; }
  bool needs_surface_derivatives() const override { return scatter_ >= 0; }

 private:
  /// What every frame of the camera errs by: a motion along and about the camera's axes, turning about the object's middle.
  RigidMap camera_pose(const VectorX& unknowns) const {
    RigidOffset offset;
    offset.pivot_m = centre_m_;
    if (camera_ >= 0) {
      offset.translation_m = R_base_camera_ * unknowns.segment<3>(camera_);
      offset.rotation_rad = R_base_camera_ * unknowns.segment<3>(camera_ + 3);
    }
    return RigidMap(offset);
  }
  /// Where the rays of one evaluation come from, and the surface before them.
  struct Sight {
    RigidMap frame, camera;
    Mat3 rotation;
    std::optional<std::vector<geometry::RayHit>> hits = {};  ///< a ray that counts; nothing: the tree is asked
    std::vector<char> beside_outline = {};  ///< a ray, while none was chosen: not to count; empty: none
    const geometry::TriangleTree* tree = nullptr;  ///< once somebody asked
    double facing(Index ray, double cosine) const {
      const double steep = std::abs(cosine) / grazing_cosine;
      return !beside_outline.empty() && beside_outline[static_cast<std::size_t>(ray)] != 0 ? std::min(steep, 0.5) : steep;
    }
    Vec3 place(const Vec3& seen_m) const { return frame.apply(camera.apply(seen_m)); }
  };
  Sight look(const Points& surface_m, const VectorX& unknowns, const TermView& view) const {
    Sight out{frame_pose(unknowns, pose_, pivot_m_), camera_pose(unknowns), {}};
    out.rotation = out.frame.rotation() * out.camera.rotation();
    if (!view.along_rays || !one_eye_) return out;
    std::vector<char> skipped;
    if (view.chosen != nullptr)
      for (const char choice : *view.chosen) skipped.push_back(choice != counts_in);
    if (!bundle_) bundle_.emplace(rays_.directions);
    const Vec3 eye_m = out.place(rays_.origins_m.row(0));
    out.hits = bundle_->meet(surface_m, rest_.triangles, eye_m, out.rotation, skipped);
    if (out.hits && view.chosen == nullptr && outline_margin_rad_ > 0) leave_outline(out, surface_m, eye_m);
    return out;
  }
  void leave_outline(Sight& sight, const Points& surface_m, const Vec3& eye_m) const {
    auto beside = bundle_->beside_outline(surface_m, rest_.triangles, *edges_, eye_m, sight.rotation, *sight.hits, outline_margin_rad_);
    if (!beside) return;
    const auto hit = std::count_if(sight.hits->begin(), sight.hits->end(), [](const auto& one) { return one.triangle >= 0; });
    // What is a few pixels wide has nothing else to say.
    if (2 * std::count(beside->begin(), beside->end(), 1) < hit) sight.beside_outline = std::move(*beside);
  }
  const geometry::TriangleTree& tree_of(Sight& sight, const Points& surface_m) const {
    if (sight.tree == nullptr) {
      if (!tree_) tree_.emplace(*rest_tree_);
      tree_->refit(surface_m);
      sight.tree = &*tree_;
    }
    return *sight.tree;
  }
  std::optional<geometry::RayHit> cast(Sight& sight, const Points& surface_m, Index i, const Vec3& origin_m, const Vec3& direction) const {
    if (sight.hits) {
      const geometry::RayHit& hit = (*sight.hits)[static_cast<std::size_t>(i)];
      return hit.triangle < 0 ? std::nullopt : std::optional(hit);
    }
    Index& hint = hints_[static_cast<std::size_t>(i)];
    const auto hit = tree_of(sight, surface_m).cast(origin_m, direction, endless, hint);
    if (hit) hint = hit->triangle;
    return hit;
  }
  TermRows blank_rows(const StepPrediction& predicted, const TermView& view) const {
    const Index count = static_cast<Index>(rays_.range_m.size());
    if (cell_.empty())
      for (Index i = 0; i < count; ++i) cell_.push_back(cell(i));
    TermRows rows;
    rows.unknowns = predicted.columns;
    for (int unknown : own_unknowns()) rows.unknowns.push_back(unknown);
    rows.residual.resize(count);
    rows.sigma = rays_.sigma_m;
    rows.observed_m.resize(count, 3);
    rows.met_m.setZero(count, 3);
    if (view.along_rays) rows.facing = VectorX::Zero(count);
    rows.robust = true;
    rows.unit = "m";
    rows.cell = cell_;
    return rows;
  }
  /// Rows by triangle: within one the gradient has one direction, and what moves the rays moves them as its corners.
  TermRows facet_rows(const StepPrediction& predicted, const VectorX& unknowns, const TermView& view) const {
    Sight sight = look(predicted.surface_m, unknowns, view);
    const double bias_m = bias_ >= 0 ? unknowns(bias_) : 0;
    const Index count = static_cast<Index>(rays_.range_m.size()), triangles = static_cast<Index>(rest_.triangles.rows());
    TermRows rows = blank_rows(predicted, view);
    FacetSlopes& facets = rows.facets.emplace();
    const Index most = std::min(count, triangles);
    facets.facet.assign(static_cast<std::size_t>(count), -1);
    facets.share.resize(count, FacetSlopes::shares);
    facets.normal.resize(most, 3);
    facets.own.resize(most * FacetSlopes::shares, static_cast<Index>(own_unknowns().size()));
    std::vector<Index> facet_of(static_cast<std::size_t>(triangles), -1);
    const Vec3 eye_m = sight.place(rays_.origins_m.row(0));
    for (Index i = 0; i < count; ++i) {
      const Vec3 origin_m = one_eye_ ? eye_m : sight.place(rays_.origins_m.row(i));
      const Vec3 direction = sight.rotation * rays_.directions.row(i).transpose();
      const double measured_m = rays_.range_m(i) - bias_m;
      rows.observed_m.row(i) = (origin_m + measured_m * direction).transpose();
      rows.residual(i) = std::numeric_limits<double>::infinity();
      const bool chosen = view.chosen != nullptr && (*view.chosen)[static_cast<std::size_t>(i)] == counts_in;
      if (view.chosen != nullptr && !chosen) continue;
      const auto hit = cast(sight, predicted.surface_m, i, origin_m, direction);
      if (!hit) continue;  // the ray passes the object by; nearest points jump from edge to edge: no quadratic form holds them
      Index& facet = facet_of[static_cast<std::size_t>(hit->triangle)];
      if (facet < 0) facet = add_facet(predicted.surface_m, hit->triangle, sight, facets);
      const double cosine = facets.normal.row(facet).dot(direction);
      rows.facing(i) = sight.facing(i, cosine);
      if (!chosen && !(rows.facing(i) > 1)) continue;
      const double along = 1 / (std::copysign(std::max(std::abs(cosine), steepest_cosine), cosine) * rays_.sigma_m(i));
      facets.facet[static_cast<std::size_t>(i)] = facet;
      facets.share.row(i) << along * hit->barycentric.transpose(), along * cosine;
      rows.residual(i) = (measured_m - hit->range_m) / rays_.sigma_m(i);
      rows.met_m.row(i) = (origin_m + hit->range_m * direction).transpose();
    }
    return rows;
  }
  /// @returns its number
  Index add_facet(const Points& surface_m, Index triangle, const Sight& sight, FacetSlopes& facets) const {
    const Index facet = static_cast<Index>(facets.triangle.size());
    const Vec3 normal = face_normal(surface_m, triangle);
    const Mat3 back = sight.frame.rotation().transpose();
    facets.triangle.push_back(triangle);
    facets.normal.row(facet) = normal.transpose();
    facets.own.middleRows<FacetSlopes::shares>(FacetSlopes::shares * facet).setZero();
    for (Index k = 0; k < 3; ++k) {
      auto own = facets.own.row(FacetSlopes::shares * facet + k);
      const Vec3 corner_m = surface_m.row(rest_.triangles(triangle, k));
      const Vec3 in_frame_m = back * (corner_m - sight.frame.apply(Vec3::Zero()));
      if (pose_ >= 0) own.head<6>() = sight.frame.slope(normal, in_frame_m);
      if (camera_ < 0) continue;
      const Vec3 in_camera_m = sight.camera.rotation().transpose() * (in_frame_m - sight.camera.apply(Vec3::Zero()));
      const auto of_base = sight.camera.slope(back * normal, in_camera_m);
      auto of_axes = own.segment<6>(pose_ >= 0 ? 6 : 0);
      of_axes << of_base.head<3>() * R_base_camera_, of_base.tail<3>() * R_base_camera_;
    }
    if (bias_ >= 0) facets.own(FacetSlopes::shares * facet + 3, facets.own.cols() - 1) = -1;
    return facet;
  }
  /// Where the surface comes nearest to a ray that counts and just misses it: its depth goes on as that of the outline. As an outlier
  /// it would hold the fit where the outline stood when the rays were chosen, at a sharp edge above all.
  /// @param observed_m  on the ray, near the surface
  /// @param hint  a triangle to begin with; the one that was found @returns nothing further off than noise reaches
  static std::optional<geometry::ClosestPoint> beside_outline(const geometry::TriangleTree& tree, const Vec3& origin_m,
                                                              const Vec3& direction, const Vec3& observed_m, double sigma_m, Index& hint) {
    constexpr double near_std = 5;
    constexpr int rounds = 8;
    Vec3 on_ray = observed_m;
    geometry::ClosestPoint nearest = tree.closest(on_ray, hint);
    for (int round = 0; round < rounds; ++round) {
      const Vec3 across = origin_m + direction.dot(nearest.point_m - origin_m) * direction;
      const bool there = (across - on_ray).norm() < 1e-3 * sigma_m;
      on_ray = across;
      if (there) break;
      nearest = tree.closest(on_ray, nearest.triangle);
    }
    hint = nearest.triangle;
    if ((nearest.point_m - on_ray).norm() > near_std * sigma_m) return std::nullopt;
    return nearest;
  }
  /// By how much the range of the point that is nearest to a ray changes with the surface there: on an edge that point slides along it.
  Vec3 across_edge(const Points& surface_m, const geometry::ClosestPoint& at, const Vec3& direction) const {
    constexpr double on_edge = 1e-9;
    if ((at.barycentric.array() < on_edge).count() != 1) return direction;
    Index opposite = 0;
    at.barycentric.minCoeff(&opposite);
    const auto corner = [&](Index k) { return Vec3(surface_m.row(rest_.triangles(at.triangle, k % 3))); };
    const Vec3 edge = (corner(opposite + 2) - corner(opposite + 1)).normalized();
    const Vec3 across = direction - direction.dot(edge) * edge;
    return across / std::max(across.dot(direction), steepest_cosine * steepest_cosine);
  }
  /// What scattered light adds to a range that ends on a triangle of the surface.
  struct Scattered {
    LensScatter::Error error;
    std::array<Vec3, 3> cosine_per_corner;  ///< derivative of the cosine between ray and normal to the triangle's corners
  };
  /// The normal is that of the material: what is wrong with the rest surface is too slow to turn it.
  Scattered scatter(const StepPrediction& predicted, Index triangle, const Vec3& direction, double range_m) const {
    const auto corner = [&](int k) { return Vec3(predicted.markers_m().row(rest_.triangles(triangle, k))); };
    const Vec3 e1 = corner(1) - corner(0), e2 = corner(2) - corner(0);
    const Vec3 doubled = e1.cross(e2);
    const double size = doubled.norm();
    const Vec3 normal = doubled / size;
    const double cosine = normal.dot(direction);
    Scattered out;
    out.error = lens_.error(range_m, std::max(std::abs(cosine), steepest_cosine));
    const bool grazes = std::abs(cosine) < steepest_cosine;
    const Vec3 turned = grazes ? Vec3(Vec3::Zero()) : Vec3(std::copysign(1 / size, cosine) * (direction - cosine * normal));
    out.cosine_per_corner[1] = e2.cross(turned);
    out.cosine_per_corner[2] = turned.cross(e1);
    out.cosine_per_corner[0] = -out.cosine_per_corner[1] - out.cosine_per_corner[2];
    return out;
  }
  Vec3 point(Index i) const { return rays_.origins_m.row(i) + rays_.range_m(i) * rays_.directions.row(i); }
  Vec3 face_normal(const Points& surface_m, Index triangle) const {
    const auto corner = [&](int k) { return Vec3(surface_m.row(rest_.triangles(triangle, k))); };
    return (corner(1) - corner(0)).cross(corner(2) - corner(0)).normalized();
  }
  /// Square image cells, numbered along rows of up to 4096 cells.
  int cell(Index i) const {
    return rays_.pixel.rows() == 0 ? static_cast<int>(i)
                                   : (rays_.pixel(i, 1) / cell_px) * 4096 + rays_.pixel(i, 0) / cell_px;
  }

  RayCloud rays_;
  double outline_margin_rad_ = 0;
  LensScatter lens_;
  Mat3 R_base_camera_;
  int pose_, camera_;
  int bias_, scatter_;
  Vec3 pivot_m_ = Vec3::Zero(), centre_m_;
  double typical_ = 0;
  bool one_eye_ = false;  // all rays start at one point
  std::shared_ptr<const geometry::TriangleTree> rest_tree_;
  std::shared_ptr<const std::vector<geometry::SurfaceEdge>> edges_;  // nullptr: rays beside the outline count
  const TriMesh& rest_;
  mutable std::optional<geometry::RayBundle> bundle_;   // of rays of one eye
  mutable std::optional<geometry::TriangleTree> tree_;  // rays of one eye need none
  mutable std::vector<Index> hints_;
  mutable std::vector<int> cell_;  // made when it is first of use
};

}  // namespace

std::unique_ptr<Term> make_ray_term(const RayObservation& observation, const TermContext& context) {
  const std::string where = context.model.step(context.step).source + " depth";
  if (observation.rays.range_m.size() == 0) throw Error("no pixel of the depth image shows the object", where);
  if (!(observation.rays.sigma_m.minCoeff() > 0)) throw Error("the depth's standard deviation must be positive", where);
  int bias = -1;
  if (observation.bias_std_m > 0) {
    const std::string name = "depth_bias" + of_camera(context.model.push(context.step), observation.camera, context.frame);
    if (context.shared.count(name) == 0) context.shared[name] = context.unknowns.add({name, "m", 0, observation.bias_std_m});
    bias = context.shared[name];
  }
  int scatter = -1;
  if (observation.scatter && observation.scatter->share_std > 0) {
    const std::string name = "lens_scatter";
    if (context.shared.count(name) == 0)
      context.shared[name] = context.unknowns.add({name, "1", 0, observation.scatter->share_std});
    scatter = context.shared[name];
  }
  const int pose = add_frame_pose(context, observation.pose_std_m, observation.pose_std_rad);
  const int camera = add_camera_pose(context, observation.camera, observation.pose_std_m, observation.pose_std_rad);
  return std::make_unique<RayTerm>(observation, context.model, pose, camera, bias, scatter);
}

}  // namespace palpate::estimation
