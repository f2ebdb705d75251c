// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "palpate/core/error.hpp"
#include "palpate/core/physical_range.hpp"
#include "palpate/core/recording_values.hpp"
#include "palpate/io/cloud_file.hpp"
#include "palpate/io/depth_file.hpp"
#include "palpate/io/file.hpp"
#include "palpate/io/mesh_file.hpp"
#include "palpate/io/part_folder.hpp"
#include "palpate/io/recording.hpp"
#include "palpate/io/recording_names.hpp"
#include "palpate/io/recording_writer.hpp"
#include "palpate/io/urdf.hpp"
#include "palpate/io/yaml_text.hpp"

namespace palpate::io {

namespace fs = std::filesystem;

/// The index in parts (cameras turn up while steps are written) and the folder of the files.
struct RecordingWriter::Pages {
  fs::path folder;
  std::string head, markers, pushes;
  std::vector<Push> pending;  ///< a push that has no step yet
  std::size_t push_count = 0, step_count = 0;
  double last_time_s = 0;  ///< of the step before, where the push has one
  Markers known_markers;
  bool has_markers = false;

  struct KnownCamera {
    Camera camera;
    DepthNoise noise;
    double depth_unit_m = 1;
  };
  std::vector<KnownCamera> cameras;
  std::size_t joints_named = 0;

  void put_file(const std::string& name, const std::string& bytes) const {
    std::error_code code;
    fs::create_directories((folder / name).parent_path(), code);
    write_file(folder / name, bytes);
  }

  void put_index() const {
    std::string text = "format: palpate-recording/1\n" + head + cameras_text() + markers;
    text += pushes.empty() ? "pushes: []\n" : "pushes:\n" + pushes;
    write_file(folder / "recording.yaml", text);
  }

  std::string cameras_text() const {
    std::string text = cameras.empty() ? "" : "cameras:\n";
    for (std::size_t i = 0; i < cameras.size(); ++i) text += camera_text(i);
    return text;
  }

  static std::string camera_name(std::size_t index) { return fmt::format("camera_{}", index + 1); }

  std::string camera_text(std::size_t index) const {
    const KnownCamera& known = cameras[index];
    const Camera& camera = known.camera;
    std::string text = fmt::format(
        "  - name: {}\n    width_px: {}\n    height_px: {}\n    fx_px: {}\n    fy_px: {}\n    cx_px: {}\n    cy_px: {}\n",
        camera_name(index), camera.width_px, camera.height_px, camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px);
    if (camera.distortion != DistortionModel::none) {
      text += fmt::format("    distortion: {{model: {}, coefficients: {}}}\n", name_of(distortion_names, camera.distortion),
                          yaml_list(camera.distortion_coefficients.data(), camera.distortion_coefficients.size()));
    }
    return text + fmt::format("    depth_unit_m: {}\n    noise: {}\n", known.depth_unit_m, depth_noise_yaml(known.noise));
  }

  std::size_t camera_of(const DepthFrame& frame, double unit_m) {
    for (std::size_t i = 0; i < cameras.size(); ++i) {
      const KnownCamera& known = cameras[i];
      if (known.camera == frame.camera && known.noise == frame.noise && known.depth_unit_m == unit_m) return i;
    }
    cameras.push_back({frame.camera, frame.noise, unit_m});
    return cameras.size() - 1;
  }

  /// Sensors speak in whole units: where one fits every pixel a PNG loses nothing, else a float array is written.
  static double exact_unit(const DepthImage& depth) {
    for (const double unit : {1e-3, 2.5e-4, 1e-4, 2e-4, 5e-4, 5e-5, 1e-5}) {
      bool fits = true;
      for (Eigen::Index i = 0; fits && i < depth.size(); ++i) {
        const float value = depth.data()[i];
        const double count = std::round(static_cast<double>(value) / unit);
        fits = count >= 0 && count <= 65535 && static_cast<float>(count * unit) == value;
      }
      if (fits) return unit;
    }
    return 0;
  }

  std::string frame_text(const DepthFrame& frame, const std::string& stem, YamlLine line) {
    demand_depth_sigma(frame.noise, stem);
    const double unit = exact_unit(frame.depth_m);
    const std::string file = stem + (unit > 0 ? ".png" : ".npy");
    put_file(file, unit > 0 ? depth_png(frame.depth_m, unit) : depth_npy(frame.depth_m));
    line.put("camera", camera_name(camera_of(frame, unit > 0 ? unit : 1.0))).put("file", file);
    if (frame.mask.size() > 0) {
      put_file(stem + "_mask.png", mask_png(frame.mask));
      line.put("mask", stem + "_mask.png");
    }
    if (frame.robot_is_masked) line.put("robot_is_masked", "true");  // or it would be masked again, as if it stood at the base
    line.put("T_base_camera", yaml_pose(frame.T_base_camera));
    line.number_unless(0, "pose_std_m", frame.pose_std_m).number_unless(0, "pose_std_rad", frame.pose_std_rad);
    return line.str();
  }

  std::string index_text(const std::vector<Index>& indices, const std::string& file) const {
    std::string text;
    for (const Index index : indices) text += fmt::format("{}\n", index);
    put_file(file, text);
    return file;
  }

  void set_head(const Recording& recording);
  std::string rest_text(const Rest& rest);
  std::string support_text(const Support& support, std::size_t number) const;
  std::string region_text(const Region& region, std::size_t number) const;
  std::string tool_text(const Tool& tool, std::size_t number) const;
  void add_step(const Step& step);
  void demand_later(const Step& step) const;
  /// Empty where nothing was observed.
  std::string observation_text(const Observation& observation, const std::string& stem, const Step& step);
  void note_markers(const Markers& seen);
};

namespace {

void put_contact(YamlLine& line, ContactLaw contact, double friction) {
  line.put("contact", name_of(contact_names, contact));
  if (contact == ContactLaw::friction) line.number("friction_coefficient", friction);
}

std::string load_text(const Load& load) {
  YamlLine line;
  line.word("tool", load.tool);
  if (load.force_n) line.vector("force_n", *load.force_n);
  if (load.travel_m) line.number("travel_m", *load.travel_m);
  line.vector("contact_m", load.contact_m).vector("direction", unit_direction(load.direction));
  line.number_unless(0, "force_std_n", load.force_std_n).number_unless(0, "force_relative_std", load.force_relative_std);
  line.number_unless(0, "contact_std_m", load.contact_std_m);
  if (!load.force_rate_n_s.isZero(0)) line.vector("force_rate_n_s", load.force_rate_n_s);
  return line.str();
}

/// Files tell markers apart by their names.
Markers with_names(Markers markers) {
  if (!markers.names.empty()) return markers;
  for (Eigen::Index i = 0; i < markers.rest_m.rows(); ++i) markers.names.push_back(fmt::format("marker_{}", i + 1));
  return markers;
}

std::string marker_map(const std::vector<std::string>& names, const Points& places) {
  YamlLine line;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const Vec3 place = places.row(static_cast<Eigen::Index>(i));
    if (place.allFinite()) line.vector(yaml_word(names[i]), place);
  }
  return line.str();
}

}  // namespace

std::string RecordingWriter::Pages::rest_text(const Rest& rest) {
  std::string text = "rest:\n";
  if (rest.volume) {
    MeshData mesh;
    mesh.points_m = rest.volume->nodes_m;
    mesh.tetrahedra = rest.volume->tetrahedra;
    put_file("rest.vtu", mesh_format_named("vtu").write(mesh));
    text += "  volume_mesh: rest.vtu\n";
  } else if (rest.surface) {
    MeshData mesh;
    mesh.points_m = rest.surface->vertices_m;
    mesh.triangles = rest.surface->triangles;
    put_file("rest.ply", mesh_format_named("ply").write(mesh));
    text += "  surface_mesh: rest.ply\n";
  } else {
    text += "  views:\n";
    for (std::size_t i = 0; i < rest.views.size(); ++i) {
      text += "    - " + frame_text(rest.views[i], fmt::format("views/view_{:03}", i), {}) + "\n";
    }
  }
  text += fmt::format("  state: {}\n", name_of(rest_state_names, rest.state));
  if (rest.observed_triangles) {
    std::string rows;
    for (Eigen::Index i = 0; i < rest.observed_triangles->rows(); ++i) {
      const auto row = rest.observed_triangles->row(i);
      rows += fmt::format("{},{},{}\n", row[0], row[1], row[2]);
    }
    put_file("observed_triangles.csv", rows);
    text += "  observed_triangles: observed_triangles.csv\n";
  }
  return text +
         fmt::format("  surface_std_m: {}\n  surface_correlation_m: {}\n", rest.surface_std_m, rest.surface_correlation_m);
}

std::string RecordingWriter::Pages::support_text(const Support& support, std::size_t number) const {
  YamlLine line;
  line.put("kind", name_of(support_names, support.kind)).word("name", support.name);
  const bool half_space = support.kind == SupportKind::table || support.kind == SupportKind::wall;
  const NodeSelection by = selection_of(support);
  if (by == NodeSelection::vertices) {
    line.put("file", index_text(support.vertices, fmt::format("support_{}.csv", number)));
  } else if (by == NodeSelection::box) {
    line.vector("min_m", support.box_min_m).vector("max_m", support.box_max_m);
  } else {
    line.vector("point_m", support.plane.point_m)
        .vector("normal", support.plane.normal)
        .number("tolerance_m", support.tolerance_m);
  }
  if (half_space || support.contact != ContactLaw::bonded) put_contact(line, support.contact, support.friction_coefficient);
  line.number_unless(0, "spread_std_m", support.spread_std_m)
      .number_unless(0, "compliance_m_per_n", support.compliance_m_per_n)
      .number_unless(0, "compliance_std_m_per_n", support.compliance_std_m_per_n);
  if (support.kind == SupportKind::clamp) {
    line.number("pose_std_m", support.pose_std_m).number("pose_std_rad", support.pose_std_rad);
    line.put("pose_varies", name_of(pose_varies_names, support.pose_varies));
  }
  return line.str();
}

std::string RecordingWriter::Pages::region_text(const Region& region, std::size_t number) const {
  YamlLine line;
  line.word("name", region.name).put("kind", name_of(region_names, region.select));
  switch (region.select) {
    case RegionSelection::box: line.vector("min_m", region.box_min_m).vector("max_m", region.box_max_m); break;
    case RegionSelection::points: {
      std::string points;
      for (Eigen::Index i = 0; i < region.points_m.rows(); ++i)
        points += (i > 0 ? ", " : "") + yaml_vector(region.points_m.row(i));
      line.put("points_m", "[" + points + "]");
      break;
    }
    case RegionSelection::elements:
      line.put("file", index_text(region.elements, fmt::format("region_{}.csv", number)));
      break;
    case RegionSelection::rest: break;
  }
  return line.str();
}

std::string RecordingWriter::Pages::tool_text(const Tool& tool, std::size_t number) const {
  YamlLine line;
  line.word("name", tool.name).put("shape", name_of(tool_names, tool.shape));
  switch (tool.shape) {
    case ToolShape::vertices:
      line.put("file", index_text(tool.vertices, fmt::format("tool_{}.csv", number)));
      break;
    case ToolShape::sphere:
    case ToolShape::disc:
      line.number("radius_m", tool.radius_m).number_unless(0, "radius_std_m", tool.radius_std_m);
      if (tool.shape == ToolShape::disc && tool.pressure != Pressure::uniform) line.put("pressure", name_of(pressure_names, tool.pressure));
      break;
    case ToolShape::capsule:
    case ToolShape::edge:
      line.number("radius_m", tool.radius_m).number("length_m", tool.length_m).vector("axis", tool.axis);
      break;
    case ToolShape::platen:
      line.vector("point_m", tool.plane.point_m).vector("normal", tool.plane.normal);
      break;
    case ToolShape::mesh: {
      MeshData mesh;
      if (tool.mesh) mesh.points_m = tool.mesh->vertices_m, mesh.triangles = tool.mesh->triangles;
      const std::string file = fmt::format("tool_{}.ply", number);
      put_file(file, mesh_format_named("ply").write(mesh));
      line.put("file", file);
      break;
    }
  }
  put_contact(line, tool.contact, tool.friction_coefficient);
  line.number_unless(0, "compliance_m_per_n", tool.compliance_m_per_n)
      .number_unless(0, "compliance_std_m_per_n", tool.compliance_std_m_per_n);
  return line.str();
}

void RecordingWriter::Pages::set_head(const Recording& recording) {
  head = "name: " + yaml_word(recording.name) + "\n";
  if (!recording.description.empty()) head += "description: " + yaml_word(recording.description) + "\n";
  if (recording.accept_size) head += "accept_size: true\n";
  head += rest_text(recording.rest);
  if (recording.free) {
    head += "supports: free\n";
  } else {
    head += recording.supports.empty() ? "supports: []\n" : "supports:\n";
    for (std::size_t i = 0; i < recording.supports.size(); ++i)
      head += "  - " + support_text(recording.supports[i], i + 1) + "\n";
  }
  const bool in_regions = recording.regions.size() > 1;  // one is the whole object, and no file names it
  if (in_regions) head += "regions:\n";
  for (std::size_t i = 0; in_regions && i < recording.regions.size(); ++i)
    head += "  - " + region_text(recording.regions[i], i + 1) + "\n";
  head += "environment:\n  gravity_m_s2: " + yaml_vector(recording.environment.gravity_m_s2) + "\n";
  if (!recording.environment.planes.empty()) {
    head += "  planes:\n";
    for (const Plane& plane : recording.environment.planes) {
      head += "    - " + YamlLine().vector("point_m", plane.point_m).vector("normal", plane.normal).str() + "\n";
    }
  }
  if (recording.density_kg_m3 > 0)
    head += fmt::format("density_kg_m3: {{value: {}, std: {}}}\n", recording.density_kg_m3, recording.density_std_kg_m3);
  if (!recording.tools.empty()) head += "tools:\n";
  for (std::size_t i = 0; i < recording.tools.size(); ++i) head += "  - " + tool_text(recording.tools[i], i + 1) + "\n";
  head += fmt::format("force_scale_std: {}\n", recording.force_scale_std);
  if (recording.force_cross_talk_std > 0) head += fmt::format("force_cross_talk_std: {}\n", recording.force_cross_talk_std);
  if (recording.time_offset_std_s != 0) head += fmt::format("time_offset_std_s: {}\n", recording.time_offset_std_s);
  if (recording.robot) {
    std::string joints;
    joints_named = recording.joint_names.size();
    for (const std::string& joint : recording.joint_names) joints += (joints.empty() ? "" : ", ") + yaml_word(joint);
    for (const auto& [file, bytes] : urdf_files(*recording.robot, "robot")) put_file(file, bytes);
    head += "robot: {urdf: robot.urdf, joints: [" + joints + "]}\n";
  }
  const ModelDefaults& model = recording.model;
  YamlLine line;
  line.put("mesh", model.mesh).put("element", model.element).put("refine", model.refine).word("material", model.material);
  line.put("poisson_range", fmt::format("[{}, {}]", model.poisson_lower, model.poisson_upper));
  if (model.poisson_fixed) line.number("poisson_fixed", *model.poisson_fixed);
  if (model.poisson_by_region) line.put("poisson_by_region", "true");
  head += "model: " + line.str() + "\n";
}

void RecordingWriter::Pages::note_markers(const Markers& seen) {
  const auto same = [](const Points& a, const Points& b) {
    return a.rows() == b.rows() && ((a.array() == b.array()) || (a.array().isNaN() && b.array().isNaN())).all();
  };
  if (has_markers) {
    if (seen.names != known_markers.names || !same(seen.rest_m, known_markers.rest_m) ||
        seen.rest_std_m != known_markers.rest_std_m) {
      throw Error("steps differ in their markers' names or rest positions; a recording has one set of markers",
                  "write_recording: markers");
    }
    return;
  }
  if (!seen.rest_m.allFinite()) throw Error("a marker has no position at rest", "write_recording: markers");
  known_markers = seen;
  has_markers = true;
  markers =
      "markers:\n  rest_m: " + marker_map(seen.names, seen.rest_m) + fmt::format("\n  rest_std_m: {}\n", seen.rest_std_m);
}

std::string RecordingWriter::Pages::observation_text(const Observation& observation, const std::string& stem,
                                                     const Step& step) {
  YamlLine line;
  if (const auto* frame = std::get_if<DepthFrame>(&observation)) {
    line.put("kind", "depth").number_unless(step.time_s, "time_s", frame->time_s);
    return frame_text(*frame, "depth/" + stem, line);
  }
  if (const auto* cloud = std::get_if<PointCloud>(&observation)) {
    const std::string file = "clouds/" + stem + ".ply";
    put_file(file, cloud_format_of(file).write(*cloud));
    line.put("kind", "cloud").put("file", file);
    if (cloud->sigma_m.size() == 1) line.number("sigma_m", cloud->sigma_m[0]);
    line.number_unless(0, "pose_std_m", cloud->pose_std_m).number_unless(0, "pose_std_rad", cloud->pose_std_rad);
    if (!cloud->camera.empty()) line.word("camera", cloud->camera);
  } else if (const auto* markers_given = std::get_if<Markers>(&observation)) {
    if (!markers_given->observed_m.array().isFinite().rowwise().all().any()) return "";  // all are hidden
    const Markers seen = with_names(*markers_given);
    note_markers(seen);
    line.put("kind", "markers").number("sigma_m", seen.sigma_m).put("observed_m", marker_map(seen.names, seen.observed_m));
  } else if (const auto* travel = std::get_if<ToolTravel>(&observation)) {
    line.put("kind", "travel");
    if (!travel->tool.empty()) line.word("tool", travel->tool);
    line.number("travel_m", travel->travel_m).number("sigma_m", travel->sigma_m);
  } else if (const auto* wrench = std::get_if<Wrench>(&observation)) {
    line.put("kind", "wrench").number_unless(step.time_s, "time_s", wrench->time_s);
    if (!wrench->tool.empty()) line.word("tool", wrench->tool);
    if (wrench->along.norm() > 0) {
      const Vec3 along = unit_direction(wrench->along);
      line.number("force_n", wrench->force_n.dot(along)).vector("along", along);
    } else {
      line.vector("force_n", wrench->force_n);
    }
    line.number("force_sigma_n", wrench->force_sigma_n);
    if (wrench->has_torque) line.vector("torque_nm", wrench->torque_nm).number("torque_sigma_nm", wrench->torque_sigma_nm);
  }
  return line.str();
}

/// In a push time goes on: a reader takes a step that stands still in it for one that is there twice.
void RecordingWriter::Pages::demand_later(const Step& step) const {
  const bool is_first = !pending.empty();
  const std::string place = fmt::format("pushes[{}].steps[{}].time_s", is_first ? push_count : push_count - 1, is_first ? 0 : step_count);
  if (!(step.time_s >= ranges::time.least && step.time_s <= ranges::time.most))
    throw Error(fmt::format("is {:g} s, which cannot be; {}", step.time_s, ranges::time.slip), place);
  if (is_first || step.time_s > last_time_s) return;
  throw Error(step.time_s == last_time_s ? fmt::format("is that of the step before, {:.10g} s; give each step of a push its own, or remove one that is there twice",
                                                       step.time_s)
                                         : "goes back, from that of the step before; order the steps by time",
              place);
}

void RecordingWriter::Pages::add_step(const Step& step) {
  if (!step.joints_rad.empty() && joints_named > 0 && step.joints_rad.size() != joints_named)
    throw Error(fmt::format("has {} values, 'robot: joints' names {}; name the joints that the robot tells of, in their order", step.joints_rad.size(),
                            joints_named),
                "joints_rad");
  if (pending.empty() && push_count == 0) throw Error("a step was added before any push was begun", "RecordingWriter::add_step");
  demand_later(step);
  std::string text;
  if (!pending.empty()) {
    const Push& push = pending.back();
    text += fmt::format("  - name: {}\n", yaml_word(push.name.empty() ? fmt::format("push {}", push_count + 1) : push.name));
    if (!push.site.empty()) text += fmt::format("    site: {}\n", yaml_word(push.site));
    if (push.force_tare_std_n != 0) text += fmt::format("    force_tare_std_n: {}\n", push.force_tare_std_n);
    if (push.travel_offset_std_m != 0) text += fmt::format("    travel_offset_std_m: {}\n", push.travel_offset_std_m);
    if (push.torque_tare_std_nm != 0) text += fmt::format("    torque_tare_std_nm: {}\n", push.torque_tare_std_nm);
    if (push.tip_std_m != 0) text += fmt::format("    tip_std_m: {}\n", push.tip_std_m);
    text += "    steps:\n";
    push_count += 1;
    step_count = 0;
  }
  text += fmt::format("      - time_s: {}\n", step.time_s);
  if (step.unloading) text += "        unloading: true\n";
  if (step.slipped) text += "        slipped: true\n";
  if (!step.joints_rad.empty() && joints_named > 0)  // without names nobody could read them
    text += "        joints_rad: " + yaml_list(step.joints_rad.data(), step.joints_rad.size()) + "\n";
  if (step.T_base_tip) text += "        T_base_tip: " + yaml_pose(*step.T_base_tip) + "\n";
  if (!step.loads.empty()) text += "        loads:\n";
  for (const Load& load : step.loads) text += "          - " + load_text(load) + "\n";
  std::string observed;
  for (std::size_t i = 0; i < step.observations.size(); ++i) {
    const std::string stem = fmt::format("push{:03}_step{:04}_{}", push_count, step_count + 1, i + 1);
    const std::string one = observation_text(step.observations[i], stem, step);
    if (!one.empty()) observed += "          - " + one + "\n";
  }
  if (!observed.empty()) text += "        observations:\n" + observed;
  pending.clear();
  step_count += 1;
  last_time_s = step.time_s;
  pushes += text;
}

std::string object_text(const Recording& recording, const fs::path& folder) {
  RecordingWriter::Pages pages;
  pages.folder = folder;
  pages.set_head(recording);
  return pages.head + pages.cameras_text();
}

RecordingWriter::RecordingWriter(fs::path folder, const Recording& start) : pages_(std::make_unique<Pages>()) {
  pages_->folder = std::move(folder);
  std::error_code code;
  fs::create_directories(pages_->folder, code);
  if (!fs::is_directory(pages_->folder))
    throw Error("cannot be made; check the name and the permissions", pages_->folder.string());
  pages_->set_head(start);
  for (const Push& push : start.pushes) {
    begin_push(push);
    for (const Step& step : push.steps) pages_->add_step(step);
  }
  pages_->put_index();
}
RecordingWriter::~RecordingWriter() = default;
RecordingWriter::RecordingWriter(RecordingWriter&&) noexcept = default;
RecordingWriter& RecordingWriter::operator=(RecordingWriter&&) noexcept = default;

void RecordingWriter::begin_push(const Push& push) {
  Push without_steps = push;
  without_steps.steps.clear();
  pages_->pending = {without_steps};
}

void RecordingWriter::add_step(const Step& step) {
  pages_->add_step(step);
  pages_->put_index();
}

void RecordingWriter::end_push(const ForceDrift& drift) {
  if (pages_->push_count == 0 || !pages_->pending.empty())
    throw Error("a push was ended before its first step", "RecordingWriter::end_push");
  pages_->pushes += fmt::format("    force_drift: {{rate_n_s: {}, zero_at_s: {}}}\n", yaml_vector(drift.rate_n_s), drift.zero_at_s);
  pages_->put_index();
}

void write_recording(const Recording& recording, const fs::path& folder) {
  std::error_code code;
  // What a link leads to is filled; the link stays.
  fs::path target = fs::weakly_canonical(folder, code);
  if (code) target = folder.lexically_normal();
  if (target.filename().empty()) target = target.parent_path();
  if (fs::is_symlink(target, code))
    throw Error("is a link to '" + fs::read_symlink(target, code).string() + "', which is not there; make that folder, or remove the link",
                folder.string());
  if (fs::exists(target, code) && !(fs::is_directory(target, code) && fs::is_empty(target, code))) {
    throw Error("is there already; choose another folder or remove it", folder.string());
  }
  PartFolder part(target);
  { RecordingWriter writer(part.path(), recording); }
  part.become(target);
}

}  // namespace palpate::io
