// SPDX-License-Identifier: Apache-2.0
// The object and what holds, touches and sees it: rest, supports, tools, cameras, markers, model.
#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "palpate/io/depth_file.hpp"
#include "palpate/io/mesh_file.hpp"
#include "palpate/io/recording_names.hpp"
#include "palpate/io/recording_reader.hpp"

namespace palpate::io {
namespace {

Pose checked_pose(const Mat3& rotation, const Vec3& position, const std::string& where) {
  if ((rotation.transpose() * rotation - Mat3::Identity()).norm() > 1e-2 || rotation.determinant() < 0) {
    throw Error("the upper left 3 x 3 part is not a rotation (orthonormal, determinant +1)", where);
  }
  // Files carry few digits: the nearest rotation is taken.
  const Eigen::JacobiSVD<Mat3> svd(rotation, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Pose pose = Pose::Identity();
  const Mat3 exact = svd.matrixU() * svd.matrixV().transpose();
  pose.linear() = (exact - rotation).norm() < 1e-12 ? rotation : exact;
  pose.translation() = position;
  return pose;
}

Eigen::Index rest_nodes(const Recording& recording) {
  if (recording.rest.volume) return recording.rest.volume->nodes_m.rows();
  return recording.rest.surface ? recording.rest.surface->vertices_m.rows() : 0;
}

void check_indices(const std::vector<Index>& indices, const RecordingContext& context, const std::string& where) {
  const Eigen::Index nodes = rest_nodes(context.recording);
  if (nodes == 0) throw Error("vertices need a rest mesh; with 'views' choose nodes by a plane or a box", where);
  for (const Index index : indices) {
    if (index < 0 || index >= nodes) {
      throw Error("vertex " + std::to_string(index) + " is not in the rest mesh, which has " + std::to_string(nodes) +
                      " (indices are 0-based)",
                  where);
    }
  }
}

/// Focal lengths and image centre: in pixels they go with the size of the image.
void read_pinhole(YamlKeys& keys, Camera& camera) {
  const auto one = [&](const char* key, int size_px, double middle_px, const PhysicalRange& share) {
    const YamlField field = keys.required(key);
    return field.within({middle_px + share.least * size_px, middle_px + share.most * size_px, "px", share.slip});
  };
  camera.fx_px = one("fx_px", camera.width_px, 0, ranges::focal_over_width);
  camera.fy_px = one("fy_px", camera.height_px, 0, ranges::focal_over_width);
  camera.cx_px = one("cx_px", camera.width_px, 0.5 * camera.width_px, ranges::centre_over_width);
  camera.cy_px = one("cy_px", camera.height_px, 0.5 * camera.height_px, ranges::centre_over_width);
}

}  // namespace

Pose pose_from(const Vec3& position_m, const Eigen::Vector4d& q, const std::string& where) {
  if (std::abs(q.norm() - 1) > 1e-2)
    throw Error("the quaternion's length is " + std::to_string(q.norm()) + ", it must be 1", where);
  const Eigen::Quaterniond rotation(q[3], q[0], q[1], q[2]);
  return checked_pose(rotation.normalized().toRotationMatrix(), position_m, where);
}

Pose read_pose(const YamlField& field) {
  if (field.is_map()) {
    YamlKeys keys(field);
    const Vec3 position = keys.required("position_m").vector3();
    const YamlField rotation = keys.required("quaternion_xyzw");
    keys.finish();
    const std::vector<double> q = rotation.numbers();
    if (q.size() != 4) rotation.fail("four numbers are expected: [x, y, z, w]");
    return pose_from(position, {q[0], q[1], q[2], q[3]}, rotation.where());
  }
  const auto rows = field.items();
  if (rows.size() != 4) field.fail("4 rows of 4 numbers are expected, or {position_m, quaternion_xyzw}");
  Eigen::Matrix4d matrix;
  for (std::size_t i = 0; i < 4; ++i) {
    const std::vector<double> row = rows[i].numbers();
    if (row.size() != 4) rows[i].fail("a row of four numbers is expected");
    matrix.row(static_cast<Eigen::Index>(i)) = Eigen::RowVector4d(row[0], row[1], row[2], row[3]);
  }
  if (matrix.row(3) != Eigen::RowVector4d(0, 0, 0, 1)) rows[3].fail("the last row must be [0, 0, 0, 1]");
  return checked_pose(matrix.topLeftCorner<3, 3>(), matrix.topRightCorner<3, 1>(), field.where());
}

Plane read_plane(YamlKeys& keys) {
  Plane plane;
  plane.point_m = keys.required("point_m").vector3();
  plane.normal = keys.required("normal").unit_vector();
  return plane;
}

std::vector<Index> read_index_list(YamlKeys& keys, RecordingContext& context) {
  const auto file = keys.optional("file"), list = keys.optional("vertices");
  if (static_cast<bool>(file) == static_cast<bool>(list)) keys.map().fail("give either 'file' or 'vertices'");
  if (file) {
    auto result = parse_named(file->where(), [&] {
      auto indices = parse_indices(context.folder.read(file->text(), file->where()), context.folder.path_of(file->text()));
      check_indices(indices, context, context.folder.path_of(file->text()));
      return indices;
    });
    return result;
  }
  std::vector<Index> result;
  for (const YamlField& item : list->items()) result.push_back(item.whole(0, std::numeric_limits<Index>::max()));
  if (result.empty()) list->fail("holds no index");
  check_indices(result, context, list->where());
  return result;
}

ContactLaw read_contact(YamlKeys& keys, bool is_required, double& friction_coefficient) {
  const auto field = is_required
                         ? std::optional<YamlField>(keys.required("contact", "choose bonded, frictionless or friction"))
                         : keys.optional("contact");
  const ContactLaw law = field ? field->choice<ContactLaw>(contact_names) : ContactLaw::bonded;
  if (law == ContactLaw::friction) friction_coefficient = keys.required("friction_coefficient").within(ranges::friction);
  return law;
}

void read_rest(const YamlField& field, RecordingContext& context) {
  YamlKeys keys(field);
  Rest& rest = context.recording.rest;
  const auto volume = keys.optional("volume_mesh"), surface = keys.optional("surface_mesh"), views = keys.optional("views"),
             observed = keys.optional("observed_triangles"), views_at = context.of_bag != nullptr ? keys.optional("views_at_s") : std::nullopt;
  const auto scale_field = keys.optional("scale_to_m");
  const double scale = scale_field ? scale_field->positive() : 1.0;
  rest.surface_std_m = keys.within_or("surface_std_m", rest.surface_std_m, ranges::length_std);
  if (const auto length = keys.optional("surface_correlation_m")) rest.surface_correlation_m = length->within(ranges::length_scale);
  rest.state =
      keys.required("state", "choose stress_free, under_gravity or under_pressure").choice<RestState>(rest_state_names);
  keys.finish();
  if (int{volume.has_value()} + int{surface.has_value()} + int{views.has_value()} + int{views_at.has_value()} != 1) {
    field.fail(context.of_bag != nullptr ? "exactly one of 'volume_mesh', 'surface_mesh', 'views' and 'views_at_s' (times of the bag's own images) must be given"
                                         : "exactly one of 'volume_mesh', 'surface_mesh' and 'views' must be given");
  }
  const auto mesh_of = [&](const YamlField& file) {
    return parse_named(file.where(), [&] {
      mesh_format_of(file.text());
      const std::string path = context.folder.path_of(file.text());
      rest.source = path + " (" + file.where() + ")";
      MeshData mesh = parse_mesh(context.folder.read(file.text(), file.where()), path);
      mesh.points_m *= scale;
      return mesh;
    });
  };
  if (volume) {
    MeshData mesh = mesh_of(*volume);
    rest.volume =
        parse_named(volume->where(), [&] { return tet_mesh_of(std::move(mesh), context.folder.path_of(volume->text())); });
  } else if (surface) {
    MeshData mesh = mesh_of(*surface);
    rest.surface =
        parse_named(surface->where(), [&] { return tri_mesh_of(std::move(mesh), context.folder.path_of(surface->text())); });
  } else if (views_at) {
    context.of_bag->views_at_s = views_at->numbers();
    if (context.of_bag->views_at_s.empty()) views_at->fail("names no time; give seconds from the bag's start at which the object stood untouched in view");
    context.of_bag->views_where = rest.source = views_at->where();
  } else {
    for (const YamlField& view : views->items()) {
      YamlKeys view_keys(view);
      rest.views.push_back(read_depth_frame(view_keys, nullptr, "", context));
      view_keys.finish();
    }
    if (rest.views.empty()) views->fail("holds no view");
    rest.source = views->where();
  }
  if (rest.state == RestState::under_gravity && context.recording.environment.gravity_m_s2.norm() == 0) {
    field.fail("'state: under_gravity' needs 'environment: {gravity_m_s2: [0, 0, -9.81]}' and 'density_kg_m3'");
  }
  if (observed) {
    const auto indices = parse_named(observed->where(), [&] {
      const std::string path = context.folder.path_of(observed->text());
      auto list = parse_indices(context.folder.read(observed->text(), observed->where()), path);
      if (list.size() % 3 != 0)
        throw Error("holds " + std::to_string(list.size()) + " indices, three make a triangle", path);
      check_indices(list, context, path);
      return list;
    });
    rest.observed_triangles = Eigen::Map<const Triangles>(indices.data(), static_cast<Eigen::Index>(indices.size() / 3), 3);
  }
}

void read_supports(const YamlField& field, RecordingContext& context) {
  Recording& recording = context.recording;
  if (field.is_scalar()) {
    if (field.text() != "free") field.fail("a list of supports is expected, or 'free' if nothing holds the object");
    recording.free = true;
    return;
  }
  for (const YamlField& item : field.items()) {
    YamlKeys keys(item);
    Support support;
    support.source = item.where();
    support.kind = keys.required("kind").choice<SupportKind>(support_names);
    support.name = keys.text_or("name", "support " + std::to_string(recording.supports.size() + 1));
    const bool clamp = support.kind == SupportKind::clamp;
    const bool by_vertices = support.kind == SupportKind::vertices || (clamp && (keys.has("file") || keys.has("vertices")));
    const bool by_box = support.kind == SupportKind::box || (clamp && !by_vertices && keys.has("min_m"));
    if (clamp && !by_vertices && !by_box && !keys.has("point_m")) {
      item.fail("a clamp needs its nodes: 'file' or 'vertices', a plane ('point_m', 'normal') or a box ('min_m', 'max_m')");
    }
    if (by_vertices) {
      support.select = NodeSelection::vertices;
      support.vertices = read_index_list(keys, context);
    } else if (by_box) {
      support.select = NodeSelection::box;
      support.box_min_m = keys.required("min_m").vector3();
      const YamlField max = keys.required("max_m");
      support.box_max_m = max.vector3();
      if ((support.box_max_m - support.box_min_m).minCoeff() <= 0) max.fail("must be larger than min_m in every axis");
    } else {
      support.select = NodeSelection::plane;
      support.plane = read_plane(keys);
      if (const auto tolerance = keys.optional("tolerance_m")) support.tolerance_m = tolerance->within(ranges::length_sigma);
    }
    const bool half_space = support.kind == SupportKind::table || support.kind == SupportKind::wall;
    support.contact = read_contact(keys, half_space, support.friction_coefficient);
    if (const auto spread = keys.optional("spread_std_m")) {
      support.spread_std_m = spread->within(ranges::length_std);
      if (support.contact != ContactLaw::bonded && support.spread_std_m > 0)
        spread->fail("is for a support that is bonded; one that is not slides by itself");
    }
    support.compliance_m_per_n = keys.within_or("compliance_m_per_n", 0, ranges::compliance);
    support.compliance_std_m_per_n = keys.within_or("compliance_std_m_per_n", 0, ranges::compliance);
    if (clamp) {
      support.pose_std_m = keys.within_or("pose_std_m", 0, ranges::length_std);
      support.pose_std_rad = keys.within_or("pose_std_rad", 0, ranges::angle_std);
      if (const auto varies = keys.optional("pose_varies"))
        support.pose_varies = varies->choice<PoseVaries>(pose_varies_names);
    }
    keys.finish();
    recording.supports.push_back(std::move(support));
  }
  if (recording.supports.empty()) field.fail("holds no support; write 'supports: free' if nothing holds the object");
}

void read_tools(const YamlField& field, RecordingContext& context) {
  // An object of any size may be pushed with a tool of any size.
  const auto size = [&](const YamlField& one, const PhysicalRange& range) {
    return context.recording.accept_size ? one.positive() : one.within(range);
  };
  for (const YamlField& item : field.items()) {
    YamlKeys keys(item);
    Tool tool;
    const YamlField name = keys.required("name");
    tool.name = name.text();
    for (const Tool& other : context.recording.tools) {
      if (other.name == tool.name) name.fail("there is a tool '" + tool.name + "' already");
    }
    tool.shape = keys.required("shape").choice<ToolShape>(tool_names);
    const bool round = tool.shape == ToolShape::sphere || tool.shape == ToolShape::disc || tool.shape == ToolShape::capsule;
    const bool long_one = tool.shape == ToolShape::capsule || tool.shape == ToolShape::edge;
    if (tool.shape == ToolShape::vertices) tool.vertices = read_index_list(keys, context);
    if (round) tool.radius_m = size(keys.required("radius_m"), ranges::tool_radius);
    if (tool.shape == ToolShape::sphere || tool.shape == ToolShape::disc) {
      tool.radius_std_m = keys.within_or("radius_std_m", 0, ranges::length_std);
      if (tool.radius_std_m > tool.radius_m)
        keys.required("radius_std_m").fail("is larger than the radius itself; it is a standard deviation in metres");
    }
    if (tool.shape == ToolShape::disc)
      if (const auto pressure = keys.optional("pressure")) tool.pressure = pressure->choice<Pressure>(pressure_names);
    if (tool.shape == ToolShape::edge) tool.radius_m = keys.within_or("radius_m", 0, ranges::strip_half_width);
    if (long_one) {
      tool.length_m = size(keys.required("length_m"), ranges::tool_length);
      tool.axis = keys.required("axis").unit_vector();
    }
    if (tool.shape == ToolShape::platen) tool.plane = read_plane(keys);
    if (tool.shape == ToolShape::mesh) {
      const YamlField file = keys.required("file");
      tool.mesh = parse_named(file.where(), [&] {
        const std::string path = context.folder.path_of(file.text());
        return tri_mesh_of(parse_mesh(context.folder.read(file.text(), file.where()), path), path);
      });
    }
    tool.contact = read_contact(keys, tool.shape != ToolShape::vertices, tool.friction_coefficient);
    tool.compliance_m_per_n = keys.within_or("compliance_m_per_n", 0, ranges::compliance);
    tool.compliance_std_m_per_n = keys.within_or("compliance_std_m_per_n", 0, ranges::compliance);
    keys.finish();
    context.recording.tools.push_back(std::move(tool));
  }
}

DepthNoise read_depth_noise(const YamlField& field) {
  YamlKeys keys(field);
  DepthNoise noise;
  noise.model = keys.required("model").text();
  if (noise.model == "constant") noise.sigma_m = keys.required("sigma_m").within(ranges::length_sigma);
  noise.bias_std_m = keys.within_or("bias_std_m", 0, ranges::length_std);
  noise.shared_std_m = keys.within_or("shared_std_m", 0, ranges::length_std);
  if (const auto scatter = keys.optional("lens_scatter_std")) noise.lens_scatter_std = scatter->within(ranges::share_std);
  keys.finish();
  return noise;
}

void read_cameras(const YamlField& field, RecordingContext& context) {
  for (const YamlField& item : field.items()) {
    YamlKeys keys(item);
    CameraEntry entry;
    Camera& camera = entry.frame.camera;
    const YamlField name = keys.required("name");
    camera.width_px = keys.required("width_px").whole(1, 20000);
    camera.height_px = keys.required("height_px").whole(1, 20000);
    read_pinhole(keys, camera);
    if (const auto distortion = keys.optional("distortion")) {
      YamlKeys inner(*distortion);
      camera.distortion = inner.required("model").choice<DistortionModel>(distortion_names);
      if (const auto coefficients = inner.optional("coefficients")) camera.distortion_coefficients = coefficients->numbers();
      inner.finish();
      const std::size_t given = camera.distortion_coefficients.size();
      const bool fits = camera.distortion == DistortionModel::none        ? given == 0
                        : camera.distortion == DistortionModel::plumb_bob ? given == 4 || given == 5
                        : camera.distortion == DistortionModel::rational  ? given == 8
                                                                          : given == 4;
      if (!fits)
        distortion->fail("has " + std::to_string(given) +
                         " coefficients; plumb_bob has 4 or 5, rational 8, fisheye 4, none 0");
    }
    entry.depth_unit_m = keys.required("depth_unit_m", "0.001 for most 16-bit images").within(ranges::image_unit);
    if (const auto pose = keys.optional("T_base_camera")) {
      entry.frame.T_base_camera = read_pose(*pose);
      entry.has_pose = true;
    }
    entry.frame.pose_std_m = keys.within_or("pose_std_m", 0, ranges::length_std);
    entry.frame.pose_std_rad = keys.within_or("pose_std_rad", 0, ranges::angle_std);
    entry.frame.noise = read_depth_noise(keys.required("noise", "e.g. {model: constant, sigma_m: 0.002}"));
    keys.finish();
    if (!context.cameras.emplace(name.text(), std::move(entry)).second)
      name.fail("there is a camera '" + name.text() + "' already");
  }
}

MarkerPoints parse_marker_table(const std::string& bytes, const std::string& name, bool may_be_hidden) {
  const CsvTable table = CsvTable::parse(bytes, name);
  const char* wanted[] = {"name", "x_m", "y_m", "z_m"};
  std::array<std::size_t, 4> column{};
  for (std::size_t k = 0; k < 4; ++k) {
    const auto found = table.find(wanted[k]);
    if (!found)
      throw Error(std::string("column '") + wanted[k] + "' is missing; the columns are name,x_m,y_m,z_m", name + ":1");
    column[k] = *found;
  }
  MarkerPoints markers;
  markers.points_m.resize(static_cast<Eigen::Index>(table.rows()), 3);
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const std::string& marker = table.cell(row, column[0]);
    if (std::find(markers.names.begin(), markers.names.end(), marker) != markers.names.end())
      throw Error("marker '" + marker.substr(0, 60) + "' is there twice; remove one", table.where(row));
    markers.names.push_back(marker);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const bool hidden = may_be_hidden && table.cell(row, column[axis + 1]).empty();
      markers.points_m(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(axis)) =
          hidden ? std::numeric_limits<double>::quiet_NaN() : table.number(row, column[axis + 1]);
    }
  }
  return markers;
}

void read_markers(const YamlField& field, RecordingContext& context) {
  YamlKeys keys(field);
  const auto file = keys.optional("file"), list = keys.optional("rest_m");
  if (static_cast<bool>(file) == static_cast<bool>(list)) field.fail("give either 'file' or 'rest_m'");
  context.marker_rest_std_m = keys.within_or("rest_std_m", 0, ranges::length_std);
  keys.finish();
  MarkerPoints markers;
  if (file) {
    markers = parse_named(file->where(), [&] {
      return parse_marker_table(context.folder.read(file->text(), file->where()), context.folder.path_of(file->text()),
                                false);
    });
  } else {
    const auto entries = list->entries();
    markers.points_m.resize(static_cast<Eigen::Index>(entries.size()), 3);
    for (const auto& [name, place] : entries) {
      markers.points_m.row(static_cast<Eigen::Index>(markers.names.size())) = place.vector3();
      markers.names.push_back(name);
    }
  }
  for (std::size_t i = 0; i < markers.names.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      if (markers.names[i] == markers.names[j]) field.fail("marker '" + markers.names[i] + "' is there twice");
    }
  }
  context.marker_names = std::move(markers.names);
  context.marker_rest_m = std::move(markers.points_m);
}

void read_model(const YamlField& field, ModelDefaults& model) {
  YamlKeys keys(field);
  const auto word = [&](const char* key, std::string& value, std::initializer_list<const char*> known) {
    const auto given = keys.optional(key);
    if (!given) return;
    std::vector<std::pair<const char*, std::string>> table;
    for (const char* one : known) table.emplace_back(one, one);
    value = given->choice<std::string>(table);
  };
  word("mesh", model.mesh, {"as_given", "remeshed", "auto"});
  word("element", model.element, {"tet4", "tet10", "auto"});
  word("refine", model.refine, {"none", "auto"});
  model.material = keys.text_or("material", model.material);
  if (const auto range = keys.optional("poisson_range")) {
    const std::vector<double> limits = range->numbers();
    if (limits.size() != 2 || !(limits[0] >= 0 && limits[0] < limits[1] && limits[1] <= 0.4995)) {
      range->fail("[lower, upper] within [0, 0.4995] is expected");
    }
    model.poisson_lower = limits[0];
    model.poisson_upper = limits[1];
  }
  if (const auto fixed = keys.optional("poisson_fixed")) {
    model.poisson_fixed = fixed->non_negative();
    if (*model.poisson_fixed > 0.4995) fixed->fail("must be at most 0.4995, which is as good as incompressible");
  }
  model.poisson_by_region = keys.boolean_or("poisson_by_region", model.poisson_by_region);
  keys.finish();
}

}  // namespace palpate::io
