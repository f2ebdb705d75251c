// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "palpate/core/recording.hpp"

namespace palpate::io {

/// Links with their visual and collision shapes and joints of a URDF (ROS wiki, urdf/XML). Meshes are read at once:
/// `package://NAME/PATH` and relative names are looked for under `mesh_root` (with and without NAME); STL, OBJ and PLY.
/// Throws Error naming file and line: unknown joint types (floating, planar), links that are not there, two roots, loops.
/// @param left_out  given: a shape whose mesh is not there or of another format is left out, and why is put here
RobotModel parse_urdf(std::string_view bytes, const std::string& name, const std::filesystem::path& mesh_root,
                      std::vector<std::string>* left_out = nullptr);
RobotModel read_urdf(const std::filesystem::path& path);

/// The model as a URDF (`STEM.urdf`) and a PLY for each mesh: file name -> bytes.
std::map<std::string, std::string> urdf_files(const RobotModel& robot, const std::string& stem);

/// The model as viewers want it in a topic (`robot_description`), which lies in no folder: its meshes are written into
/// FOLDER/robot_view, as OBJ, and named by `file://` and their whole path. RViz and Foxglove know neither relative names nor,
/// the latter, PLY. parse_urdf finds them by the end of the path, too, when the folder has been moved.
std::string urdf_for_viewers(const RobotModel& robot, const std::filesystem::path& folder);

}  // namespace palpate::io
