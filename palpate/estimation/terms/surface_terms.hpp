// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/estimation/terms/term.hpp"

namespace palpate::estimation {

std::unique_ptr<Term> make_cloud_term(const PointCloud& cloud, const TermContext& context);
std::unique_ptr<Term> make_ray_term(const RayObservation& rays, const TermContext& context);
std::unique_ptr<Term> make_marker_term(const Markers& markers, const TermContext& context);
std::unique_ptr<Term> make_travel_term(const ToolTravel& travel, const TermContext& context);
std::unique_ptr<Term> make_wrench_term(const Wrench& wrench, const TermContext& context);
/// @param load  of the step, whose force is known
std::unique_ptr<Term> make_torque_term(const Wrench& wrench, std::size_t load, const TermContext& context);

/// Index of the step's load that an observation of `tool` belongs to. @throws Error when it is not clear.
std::size_t load_of(const TermContext& context, const std::string& tool, const std::string& what);

/// "[push:step]" for the names of nuisances.
std::string step_suffix(const TermContext& context);

/// Six unknowns of a frame's pose, or -1 when it is exactly known.
int add_frame_pose(const TermContext& context, double pose_std_m, double pose_std_rad);
/// Six unknowns of what all frames of a camera err by, or -1 when their pose is exactly known.
int add_camera_pose(const TermContext& context, const std::string& camera, double pose_std_m, double pose_std_rad);

/// The frame's pose at these unknowns, ready for many points. @param pose  of add_frame_pose
RigidMap frame_pose(const VectorX& unknowns, int pose, const Vec3& pivot_m);

/// Columns of the rest surface's slow error at the end of a term's jacobian; none where the recording states no such error.
class FieldColumns {
 public:
  explicit FieldColumns(const StepPrediction& predicted) : predicted_(predicted) {}
  Index count() const { return predicted_.field != nullptr ? predicted_.field->modes() : 0; }
  void append_unknowns(std::vector<int>& unknowns) const {
    for (Index k = 0; k < count(); ++k) unknowns.push_back(predicted_.field_unknown + static_cast<int>(k));
  }
  /// Row of residual = gradient . (observed - surface point), the point being `barycentric` of `vertices`.
  template <class Vertices>
  void subtract(MatrixX& jacobian, Index row, const Vertices& vertices, const Vec3& barycentric, const Vec3& gradient) const {
    for (int k = 0; k < 3 && count() > 0; ++k) {
      const double along = gradient.dot(Vec3(predicted_.field_directions.row(vertices(k))));
      jacobian.row(row).tail(count()) -= barycentric(k) * along * predicted_.field->basis().row(vertices(k));
    }
  }

 private:
  const StepPrediction& predicted_;
};

}  // namespace palpate::estimation
