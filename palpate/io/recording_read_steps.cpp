// SPDX-License-Identifier: Apache-2.0
// Pushes, steps, loads and observations, from lists and from tables.
#include <algorithm>
#include <limits>

#include "palpate/io/cloud_file.hpp"
#include "palpate/io/depth_file.hpp"
#include "palpate/io/recording_reader.hpp"

namespace palpate::io {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// A column's full name: with the tool's or the observation's name in front, or without where only one can be meant.
std::string column_of(const TableRow& row, const std::string& prefix, bool alone, const std::string& column) {
  const std::string full = prefix + "." + column;
  return !prefix.empty() && (row.table().has(full) || !alone) ? full : column;
}

const Tool* find_tool(const Recording& recording, const std::string& name) {
  for (const Tool& tool : recording.tools) {
    if (tool.name == name) return &tool;
  }
  return nullptr;
}

std::vector<std::string> stated_tools(const Recording& recording) {
  std::vector<std::string> names;
  for (const Tool& tool : recording.tools) names.push_back(tool.name);
  return names;
}

std::string tool_of(YamlKeys& keys, const Step& step, const RecordingContext& context) {
  if (const auto field = keys.optional("tool")) {
    const std::string name = field->text();
    if (find_tool(context.recording, name) == nullptr) field->fail_name("tool", "tools", stated_tools(context.recording));
    return name;
  }
  return step.loads.size() == 1 ? step.loads.front().tool : "";
}

/// An observation file belongs to one step.
void claim_file(const std::string& file, const std::string& step, RecordingContext& context, const std::string& where) {
  const auto [place, is_new] = context.used_files.emplace(file, step);
  if (!is_new)
    throw Error("'" + file + "' is used by " + place->second + " already; a step is there twice, remove one", where);
}

DepthImage depth_of(const std::string& file, const std::string& where, const CameraEntry& entry, RecordingContext& context) {
  return parse_named(where, [&] {
    const std::string path = context.folder.path_of(file);
    DepthImage depth = parse_depth(context.folder.read(file, where), path, entry.depth_unit_m);
    const Camera& camera = entry.frame.camera;
    if (depth.cols() != camera.width_px || depth.rows() != camera.height_px) {
      throw Error("is " + std::to_string(depth.cols()) + " x " + std::to_string(depth.rows()) + " pixels, its camera " +
                      std::to_string(camera.width_px) + " x " + std::to_string(camera.height_px),
                  path);
    }
    return depth;
  });
}

MaskImage mask_of(const std::string& file, const std::string& where, const Camera& camera, RecordingContext& context) {
  return parse_named(where, [&] {
    const std::string path = context.folder.path_of(file);
    MaskImage mask = parse_mask(context.folder.read(file, where), path);
    if (mask.cols() != camera.width_px || mask.rows() != camera.height_px)
      throw Error("has another size than its camera's image", path);
    if ((mask.array() != 0).all()) throw Error("masks every pixel; non-zero means invalid", path);
    return mask;
  });
}

void read_cloud_observation(YamlKeys& keys, const TableRow* row, const std::string& prefix, bool alone,
                            RecordingContext& context, Step& step) {
  const double sigma = keys.has("sigma_m") ? keys.required("sigma_m").within(ranges::length_sigma) : nan;
  const double pose_std_m = keys.within_or("pose_std_m", 0, ranges::length_std),
               pose_std_rad = keys.within_or("pose_std_rad", 0, ranges::angle_std);
  const std::string camera = keys.text_or("camera", "");
  const auto field = keys.optional("file");
  std::optional<std::string> file = field ? std::optional(field->text()) : std::nullopt;
  std::string where = field ? field->where() : keys.map().where();
  if (row != nullptr) {
    const std::string column = column_of(*row, prefix, alone, "cloud");
    if (const auto cell = row->text(column)) file = cell, where = row->where() + ": " + column;
  }
  if (!file) keys.required("file", "name the cloud's file, or a column 'cloud' of the table");
  if (file->empty()) return;
  claim_file(*file, step.source, context, where);
  PointCloud cloud = parse_named(where, [&] {
    cloud_format_of(*file);
    return parse_cloud(context.folder.read(*file, where), context.folder.path_of(*file));
  });
  if (!std::isnan(sigma)) cloud.sigma_m = VectorX::Constant(1, sigma);
  if (cloud.sigma_m.size() == 0) {
    keys.map().fail("key 'sigma_m' is missing: the standard deviation of a point (or a column sigma_m in the cloud)");
  }
  cloud.pose_std_m = pose_std_m;
  cloud.pose_std_rad = pose_std_rad;
  cloud.camera = camera;
  step.observations.emplace_back(std::move(cloud));
}

void read_marker_observation(YamlKeys& keys, const TableRow* row, RecordingContext& context, Step& step) {
  if (context.marker_names.empty())
    keys.map().fail("markers were observed but the top level has no 'markers' (their positions at rest)");
  Markers markers;
  const YamlField sigma = keys.required("sigma_m", "the standard deviation of a marker's position, per axis");
  markers.sigma_m = sigma.within(ranges::length_sigma);
  markers.names = context.marker_names;
  markers.rest_m = context.marker_rest_m;
  markers.rest_std_m = context.marker_rest_std_m;
  markers.observed_m = Points::Constant(context.marker_rest_m.rows(), 3, nan);
  const auto row_of = [&](const std::string& name, const std::string& where) {
    const auto found = std::find(markers.names.begin(), markers.names.end(), name);
    if (found == markers.names.end()) {
      const auto near = nearest_word(name, markers.names);
      throw Error(
          "there is no marker '" + name.substr(0, 60) + "'" + (near ? "; did you mean '" + *near + "'?" : " in 'markers'"),
          where);
    }
    return found - markers.names.begin();
  };
  const auto file = keys.optional("file"), list = keys.optional("observed_m");
  if (file) {
    claim_file(file->text(), step.source, context, file->where());
    const std::string path = context.folder.path_of(file->text());
    const MarkerPoints seen = parse_named(
        file->where(), [&] { return parse_marker_table(context.folder.read(file->text(), file->where()), path, true); });
    for (std::size_t i = 0; i < seen.names.size(); ++i) {
      markers.observed_m.row(row_of(seen.names[i], path)) = seen.points_m.row(static_cast<Eigen::Index>(i));
    }
  } else if (list) {
    for (const auto& [name, place] : list->entries()) markers.observed_m.row(row_of(name, place.where())) = place.vector3();
  } else if (row != nullptr) {
    for (std::size_t i = 0; i < markers.names.size(); ++i) {
      const std::string& name = markers.names[i];
      if (!row->table().has(name + ".x_m")) continue;
      if (row->is_empty(name + ".x_m") && row->is_empty(name + ".y_m") && row->is_empty(name + ".z_m")) continue;
      for (const auto& [axis, letter] : {std::pair{0, 'x'}, {1, 'y'}, {2, 'z'}}) {
        const auto value = row->number(name + "." + letter + "_m");
        if (!value) throw Error("column '" + name + "." + letter + "_m' is missing", row->where());
        markers.observed_m(static_cast<Eigen::Index>(i), axis) = *value;
      }
    }
  } else {
    keys.map().fail("give either 'file' or 'observed_m'");
  }
  bool any = false;
  for (Eigen::Index i = 0; i < markers.observed_m.rows(); ++i) any |= markers.observed_m.row(i).allFinite();
  if (any) {
    step.observations.emplace_back(std::move(markers));
  } else if (row == nullptr) {
    keys.map().fail("no marker was seen; remove the observation");
  }
}

void read_travel_observation(YamlKeys& keys, const TableRow* row, const std::string& prefix, bool alone,
                             const RecordingContext& context, Step& step) {
  ToolTravel travel;
  travel.tool = tool_of(keys, step, context);
  travel.sigma_m = keys.required("sigma_m", "the standard deviation of the travel").within(ranges::length_sigma);
  const auto field = keys.optional("travel_m");
  if (row != nullptr && !field) {
    const std::string column = column_of(*row, prefix, alone, "observed_travel_m");
    if (row->is_empty(column)) return;
    if (const auto value = row->number(column)) {
      travel.travel_m = *value;
      step.observations.emplace_back(travel);
      return;
    }
  }
  travel.travel_m =
      keys.required("travel_m", row != nullptr ? "or give the table a column 'observed_travel_m'" : "").number();
  if (field) step.observations.emplace_back(travel);
}

void read_wrench_file(const YamlField& file, const Wrench& like, RecordingContext& context, Step& step) {
  claim_file(file.text(), step.source, context, file.where());
  const std::string path = context.folder.path_of(file.text());
  parse_named(file.where(), [&] {
    const CsvTable table = CsvTable::parse(context.folder.read(file.text(), file.where()), path);
    const char* columns[] = {"time_s", "force_x_n", "force_y_n", "force_z_n", "torque_x_nm", "torque_y_nm", "torque_z_nm"};
    std::size_t place[7] = {};
    const bool torque = table.has(columns[4]);
    for (std::size_t k = 0; k < (torque ? 7u : 4u); ++k) {
      const auto found = table.find(columns[k]);
      if (!found) throw Error(std::string("column '") + columns[k] + "' is missing", path + ":1");
      place[k] = *found;
    }
    if (table.columns().size() != (torque ? 7u : 4u))
      throw Error("has columns beside time_s, force_*_n and torque_*_nm", path + ":1");
    for (std::size_t i = 0; i < table.rows(); ++i) {
      Wrench wrench = like;
      wrench.time_s = table.number(i, place[0]);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        wrench.force_n[static_cast<Eigen::Index>(axis)] = table.number(i, place[1 + axis]);
        if (torque) wrench.torque_nm[static_cast<Eigen::Index>(axis)] = table.number(i, place[4 + axis]);
      }
      wrench.has_torque = torque;
      step.observations.emplace_back(wrench);
    }
    return true;
  });
}

void read_wrench_observation(YamlKeys& keys, const TableRow* row, const std::string& prefix, bool alone,
                             RecordingContext& context, Step& step) {
  Wrench wrench;
  wrench.tool = tool_of(keys, step, context);
  const YamlField force_sigma = keys.required("force_sigma_n", "the standard deviation of the force, per axis");
  wrench.force_sigma_n = force_sigma.within(ranges::force_sigma);
  if (const auto sigma = keys.optional("torque_sigma_nm")) wrench.torque_sigma_nm = sigma->within(ranges::torque_sigma);
  wrench.time_s = keys.number_or("time_s", step.time_s);
  const auto file = keys.optional("file"), force = keys.optional("force_n"), torque = keys.optional("torque_nm"),
             axis = keys.optional("along");
  if (file) {
    if (force || torque || axis)
      (force ? force : torque ? torque : axis)->fail("stands beside 'file', which holds the numbers: give one of the two");
    return read_wrench_file(*file, wrench, context, step);
  }
  const auto along = [&](double value, const std::string& where) {
    if (axis) {
      wrench.along = axis->unit_vector();
      wrench.force_n = value * wrench.along;
      return;
    }
    const auto load =
        std::find_if(step.loads.begin(), step.loads.end(), [&](const Load& one) { return one.tool == wrench.tool; });
    if (load == step.loads.end())
      throw Error("a force given as one number needs a load whose direction it is along, or 'along'", where);
    wrench.along = load->direction;
    wrench.force_n = value * load->direction;
  };
  if (force) {
    force->is_list() ? void(wrench.force_n = force->vector3()) : along(force->number(), force->where());
  } else if (row != nullptr) {
    const auto name = [&](const char* column) { return column_of(*row, prefix, alone, column); };
    if (row->is_empty(name("observed_force_n")) || row->is_empty(name("observed_force_x_n"))) return;
    if (const auto vector = row->vector(name("observed_force"), "_n")) {
      wrench.force_n = *vector;
    } else if (const auto value = row->number(name("observed_force_n"))) {
      along(*value, row->where());
    } else {
      keys.required("force_n", "or give the table columns 'observed_force_x_n', '_y_n', '_z_n' or 'observed_force_n'");
    }
    if (const auto vector = row->vector(name("observed_torque"), "_nm"))
      wrench.torque_nm = *vector, wrench.has_torque = true;
  } else {
    keys.required("force_n");
  }
  if (torque) wrench.torque_nm = torque->vector3(), wrench.has_torque = true;
  if (wrench.has_torque && std::isnan(wrench.torque_sigma_nm)) {
    keys.required("torque_sigma_nm", "the standard deviation of the torque, per axis");
  }
  step.observations.emplace_back(wrench);
}

std::optional<Pose> row_pose(const TableRow& row, const std::string& place, const std::string& stem) {
  const auto position = row.vector(place, "_m");
  if (!position) return std::nullopt;
  Eigen::Vector4d q;
  for (const auto& [k, letter] : {std::pair{0, 'x'}, {1, 'y'}, {2, 'z'}, {3, 'w'}}) {
    const auto value = row.number(stem + "_q" + letter);
    if (!value) throw Error("column '" + stem + "_q" + letter + "' is missing", row.where());
    q[k] = *value;
  }
  return pose_from(*position, q, row.where());
}

}  // namespace

std::optional<double> TableRow::number(const std::string& column) const {
  const auto place = table_.find(column);
  if (!place) return std::nullopt;
  used_.insert(*place);
  return table_.number(row_, *place);
}

std::optional<Vec3> TableRow::vector(const std::string& stem, const std::string& unit) const {
  const auto x = number(stem + "_x" + unit), y = number(stem + "_y" + unit), z = number(stem + "_z" + unit);
  if (!x && !y && !z) return std::nullopt;
  if (!x || !y || !z)
    throw Error("columns " + stem + "_x" + unit + ", _y" + unit + " and _z" + unit + " belong together; one is missing",
                where());
  return Vec3(*x, *y, *z);
}

std::optional<std::string> TableRow::text(const std::string& column) const {
  const auto place = table_.find(column);
  if (!place) return std::nullopt;
  used_.insert(*place);
  return table_.cell(row_, *place);
}

bool TableRow::is_empty(const std::string& column) const {
  const auto cell = text(column);
  return cell && cell->empty();
}

DepthFrame read_depth_frame(YamlKeys& keys, const TableRow* row, const std::string& prefix, RecordingContext& context) {
  const YamlField name = keys.required("camera");
  const auto camera = context.cameras.find(name.text());
  if (camera == context.cameras.end()) {
    std::vector<std::string> known;
    for (const auto& [each, entry] : context.cameras) known.push_back(each);
    name.fail_name("camera", "cameras", known);
  }
  const CameraEntry& entry = camera->second;
  DepthFrame frame = entry.frame;
  frame.pose_std_m = keys.within_or("pose_std_m", frame.pose_std_m, ranges::length_std);
  frame.pose_std_rad = keys.within_or("pose_std_rad", frame.pose_std_rad, ranges::angle_std);
  frame.robot_is_masked = keys.boolean_or("robot_is_masked", false);
  bool has_pose = entry.has_pose;
  if (const auto pose = keys.optional("T_base_camera")) frame.T_base_camera = read_pose(*pose), has_pose = true;
  const auto file = keys.optional("file"), mask = keys.optional("mask");
  if (row != nullptr) {
    const std::string stem = prefix.empty() ? "camera" : prefix + ".camera";
    if (const auto pose = row_pose(*row, stem, stem)) frame.T_base_camera = *pose, has_pose = true;
  }
  if (!has_pose) keys.required("T_base_camera", "here or with the camera");
  const std::string dot = prefix.empty() ? "" : prefix + ".";
  const auto cell = row != nullptr ? row->text(dot + "depth") : std::nullopt;
  const auto mask_cell = row != nullptr ? row->text(dot + "mask") : std::nullopt;
  if (cell && cell->empty()) return frame;  // left out of this row
  if (!cell && !file) keys.required("file", row != nullptr ? "or give the table a column 'depth'" : "");
  frame.depth_m =
      depth_of(cell ? *cell : file->text(), cell ? row->where() + ": " + dot + "depth" : file->where(), entry, context);
  if (mask_cell && !mask_cell->empty()) {
    frame.mask = mask_of(*mask_cell, row->where() + ": " + dot + "mask", frame.camera, context);
  } else if (mask) {
    frame.mask = mask_of(mask->text(), mask->where(), frame.camera, context);
  }
  return frame;
}

Load read_load(const YamlField& field, const TableRow* row, bool alone, const RecordingContext& context) {
  YamlKeys keys(field);
  Load load;
  const YamlField name = keys.required("tool");
  load.tool = name.text();
  const Tool* tool = find_tool(context.recording, load.tool);
  if (tool == nullptr) name.fail_name("tool", "tools", stated_tools(context.recording));
  const auto number = [&](const char* column) {
    return row != nullptr ? row->number(column_of(*row, load.tool, alone, column)) : std::nullopt;
  };
  const auto vector = [&](const std::string& stem, const std::string& unit) -> std::optional<Vec3> {
    if (row == nullptr) return std::nullopt;
    const std::string first = column_of(*row, load.tool, alone, stem + "_x" + unit);
    return row->vector(first.substr(0, first.size() - 2 - unit.size()), unit);
  };

  const auto direction = keys.optional("direction");
  std::optional<Vec3> way = vector("direction", "");
  if (way && std::abs(way->norm() - 1) > 0.01) throw Error("the direction's length is not 1", row->where());
  if (way) way->normalize();
  if (!way && direction) way = direction->unit_vector();
  if (!way && tool->shape == ToolShape::platen) way = tool->plane.normal;

  std::optional<double> along = number("force_n");
  load.force_n = vector("force", "_n");
  if (const auto force = keys.optional("force_n"); force && !load.force_n && !along) {
    force->is_list() ? void(load.force_n = force->vector3()) : void(along = force->number());
  }
  load.travel_m = number("travel_m");
  if (const auto travel = keys.optional("travel_m"); travel && !load.travel_m) load.travel_m = travel->number();
  const bool has_force = load.force_n || along;
  if (has_force == load.travel_m.has_value()) {
    field.fail(has_force ? "give either 'force_n' or 'travel_m': one is imposed, the other may be observed"
                         : "neither 'force_n' nor 'travel_m' is given (here or in a column of the table)");
  }
  if (!way && load.force_n && load.force_n->norm() > 0) way = load.force_n->normalized();
  if (!way && (along || load.travel_m)) keys.required("direction", "a single number needs to know along what");
  if (way) load.direction = *way;
  if (along) load.force_n = Vec3(*along * load.direction);

  const auto contact = vector("contact", "_m");
  const auto contact_field = keys.optional("contact_m");
  if (contact) {
    load.contact_m = *contact;
  } else if (contact_field) {
    load.contact_m = contact_field->vector3();
  } else if (tool->shape != ToolShape::vertices && tool->shape != ToolShape::platen) {
    keys.required("contact_m", "where the tool touches the rest surface");
  }
  load.force_std_n = keys.within_or("force_std_n", 0, ranges::force_std);
  load.force_relative_std = keys.within_or("force_relative_std", 0, ranges::share_std);
  load.contact_std_m = keys.within_or("contact_std_m", 0, ranges::length_std);
  const auto rate = vector("force_rate", "_n_s");
  const auto rate_field = keys.optional("force_rate_n_s");
  if ((rate || rate_field) && !load.force_n) keys.required("force_n", "a rate belongs to a force that is given");
  if (rate) load.force_rate_n_s = *rate;
  else if (rate_field) load.force_rate_n_s = rate_field->vector3();
  keys.finish();
  return load;
}

void read_observation(const YamlField& field, const TableRow* row, bool alone, RecordingContext& context, Step& step) {
  YamlKeys keys(field);
  const YamlField kind_field = keys.required("kind");
  const std::string kind = kind_field.text();
  const std::string name = keys.text_or("name", "");
  if (kind == "depth") {
    const std::string prefix = row != nullptr && !name.empty() && (!alone || row->table().has(name + ".depth")) ? name : "";
    DepthFrame frame = read_depth_frame(keys, row, prefix, context);
    if (frame.depth_m.size() > 0) {
      const auto cell = row != nullptr ? row->text(prefix.empty() ? "depth" : prefix + ".depth") : std::nullopt;
      const std::string file = cell ? *cell : keys.required("file").text();
      claim_file(file, step.source, context, step.source);
      frame.time_s = keys.number_or("time_s", step.time_s);
      step.observations.emplace_back(std::move(frame));
    }
  } else if (kind == "cloud") {
    read_cloud_observation(keys, row, name, alone, context, step);
  } else if (kind == "markers") {
    read_marker_observation(keys, row, context, step);
  } else if (kind == "travel") {
    read_travel_observation(keys, row, name, alone, context, step);
  } else if (kind == "wrench") {
    read_wrench_observation(keys, row, name, alone, context, step);
  } else {
    const auto near = nearest_word(kind, {"depth", "cloud", "markers", "travel", "wrench"});
    kind_field.fail("'" + kind.substr(0, 60) + "' is unknown" + (near ? "; did you mean '" + *near + "'?" : "") +
                    " It is one of depth, cloud, markers, travel, wrench");
  }
  keys.finish();
}

}  // namespace palpate::io
