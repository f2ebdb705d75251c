// SPDX-License-Identifier: Apache-2.0
// Which pixels show the robot: its URDF's shapes, posed by the joint angles and seen from the camera.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "palpate/core/recording.hpp"
#include "palpate/sensing/depth_render.hpp"
#include "palpate/sensing/kinematics.hpp"

namespace palpate::sensing {

/// Triangles of a shape in its own frame: box and sphere about the origin, cylinder along z about it, as URDF defines them.
/// Round shapes are drawn around (never inside) the true surface.
/// @throws Error when a size is not positive or a mesh is empty.
TriMesh shape_mesh(const RobotShape& shape);

/// Whether any link has a shape: a robot that was recorded without shapes cannot be masked.
bool has_shapes(const RobotModel& robot);

enum class RobotGeometry { visual, collision };

struct RobotMaskOptions {
  RobotGeometry geometry = RobotGeometry::visual;
  double joint_std_rad = 0.02 * 3.14159265358979323846 / 180;  ///< encoders: 0.02 degrees (PowerCube modules)
  double base_std_m = 0;        ///< further error between robot and camera, e.g. of the hand-eye calibration
  double pose_sigmas = 2;       ///< outline and depth are widened by this many of their standard deviations
  RenderMaskOptions margins{};  ///< on top of that
};

class RobotMask {
 public:
  /// Shapes of every link as one mesh. A link without geometry of the kind asked for uses the other kind.
  /// @throws Error as Kinematics and shape_mesh do, or when no link has any geometry.
  explicit RobotMask(RobotModel robot, RobotMaskOptions options = {});

  const Kinematics& kinematics() const { return kinematics_; }
  Index triangle_count() const;

  /// What the camera would see of the robot alone. `T_base_root`: where the robot's root link stands in the base frame.
  DepthImage render(const std::vector<Pose>& link_poses, const Camera& camera, const Pose& T_base_camera,
                    const Pose& T_base_root = Pose::Identity()) const;

  /// 1 where the frame shows the robot or what it hides.
  MaskImage mask(const DepthFrame& frame, const std::vector<std::string>& joint_names, const std::vector<double>& joints,
                 const Pose& T_base_root = Pose::Identity()) const;

  /// The same of those links alone whose pose these joints tell; the others stay in the image.
  MaskImage mask_known(const DepthFrame& frame, const std::vector<std::string>& joint_names, const std::vector<double>& joints,
                       const Pose& T_base_root = Pose::Identity()) const;
  /// Links with a shape, in the order of the description.
  const std::vector<Index>& shaped_links() const { return links_; }
  /// All shapes of the k-th of them, in the link's frame.
  const TriMesh& link_mesh(std::size_t k) const { return meshes_[k]; }

  struct PosedLink {
    std::size_t shaped = 0;  ///< of shaped_links()
    Pose T_root_link = Pose::Identity();
    double position_std_m = 0;  ///< of its farthest vertex, by the joints' errors
  };
  /// Those links with a shape whose pose these joints tell.
  std::vector<PosedLink> known_links(const std::vector<std::string>& joint_names, const std::vector<double>& joints) const;

 private:
  MaskImage mask_posed(const DepthFrame& frame, const std::vector<PosedLink>& links, const Pose& T_base_root) const;
  PosedLink posed(std::size_t k, const std::vector<Pose>& link_poses) const;

  Kinematics kinematics_;
  RobotMaskOptions options_;
  std::vector<Index> links_;      // those with geometry
  std::vector<TriMesh> meshes_;   // of them
  std::vector<Vec3> farthest_m_;  // of them: the vertex farthest from the link's origin
};

}  // namespace palpate::sensing
