// SPDX-License-Identifier: Apache-2.0
// The parts of read_recording, one file each. Inner header of the room `io`.
#pragma once

#include <filesystem>
#include <map>
#include <set>
#include <string>

#include "palpate/core/error.hpp"
#include "palpate/core/force_drift.hpp"
#include "palpate/core/recording.hpp"
#include "palpate/core/streams.hpp"
#include "palpate/io/csv.hpp"
#include "palpate/io/yaml_field.hpp"

namespace palpate::io {

struct Problem;

/// The part of check_recording that compares single numbers with what can be: forces, times, poses, places of planes.
void check_numbers(const Recording& recording, std::vector<Problem>& problems);

/// The files beside the index. Remembers the hash of each.
class RecordingFolder {
 public:
  explicit RecordingFolder(std::filesystem::path root) : root_(std::move(root)) {}
  const std::filesystem::path& root() const { return root_; }
  std::string path_of(const std::string& file) const { return (root_ / file).string(); }
  /// Bytes of a file that `where` names. Throws Error when it is missing or lies outside the folder.
  std::string read(const std::string& file, const std::string& where);
  const std::map<std::string, std::string>& hashes() const { return hashes_; }

 private:
  std::filesystem::path root_;
  std::map<std::string, std::string> hashes_;
};

/// Runs a parser and adds to its Error where in the index the file is named.
template <typename Parse>
auto parse_named(const std::string& where, Parse parse) {
  try {
    return parse();
  } catch (const Error& error) {
    throw Error(error.message(), error.where() == where ? where : error.where() + " (named in " + where + ")");
  }
}

struct CameraEntry {
  DepthFrame frame;  ///< all but the image
  bool has_pose = false;
  double depth_unit_m = 0;
};

/// What the steps refer to.
struct RecordingContext {
  RecordingFolder folder;
  Recording recording;
  std::map<std::string, CameraEntry> cameras;
  std::vector<std::string> marker_names;
  Points marker_rest_m;
  double marker_rest_std_m = 0;
  std::map<std::string, std::string> used_files;  ///< observation file -> step that uses it
  StreamPlan* of_bag = nullptr;                   ///< where a mapping is read, whose object may be seen in the bag's own images
};

Pose read_pose(const YamlField& field);
Pose pose_from(const Vec3& position_m, const Eigen::Vector4d& quaternion_xyzw, const std::string& where);
Plane read_plane(YamlKeys& keys);
DepthNoise read_depth_noise(const YamlField& field);
std::vector<Index> read_index_list(YamlKeys& keys, RecordingContext& context);
ContactLaw read_contact(YamlKeys& keys, bool is_required, double& friction_coefficient);

/// Everything of a recording but markers and pushes: name, rest, supports, regions, environment, density, tools, cameras, robot,
/// model, ...: a bag's mapping has the same keys. Ask for the other keys of the map before: what is left is unknown.
void read_object(YamlKeys& keys, RecordingContext& context);
void read_rest(const YamlField& field, RecordingContext& context);
void read_supports(const YamlField& field, RecordingContext& context);
void read_regions(const YamlField& field, RecordingContext& context);
void read_tools(const YamlField& field, RecordingContext& context);
void read_cameras(const YamlField& field, RecordingContext& context);
void read_markers(const YamlField& field, RecordingContext& context);
void read_model(const YamlField& field, ModelDefaults& model);
void read_pushes(const YamlField& field, RecordingContext& context);

/// `row` fills in or replaces what a table says of one step.
class TableRow;
DepthFrame read_depth_frame(YamlKeys& keys, const TableRow* row, const std::string& prefix, RecordingContext& context);
Load read_load(const YamlField& field, const TableRow* row, bool alone, const RecordingContext& context);
/// Appends what the entry holds: nothing for an empty cell, several for a file of wrenches.
void read_observation(const YamlField& field, const TableRow* row, bool alone, RecordingContext& context, Step& step);
struct MarkerPoints {
  std::vector<std::string> names;
  Points points_m;  ///< NaN where hidden
};
/// A CSV with columns name, x_m, y_m, z_m.
MarkerPoints parse_marker_table(const std::string& bytes, const std::string& name, bool may_be_hidden);

/// One row of a push's table. Columns that nobody asked for are found by `finish`.
class TableRow {
 public:
  TableRow(const CsvTable& table, std::size_t row, std::set<std::size_t>& used) : table_(table), row_(row), used_(used) {}
  std::optional<double> number(const std::string& column) const;                       ///< nothing without such a column
  std::optional<Vec3> vector(const std::string& stem, const std::string& unit) const;  ///< stem_x_unit, ...
  std::optional<std::string> text(const std::string& column) const;
  bool is_empty(const std::string& column) const;
  std::string where() const { return table_.where(row_); }
  const CsvTable& table() const { return table_; }

 private:
  const CsvTable& table_;
  std::size_t row_;
  std::set<std::size_t>& used_;
};

}  // namespace palpate::io
