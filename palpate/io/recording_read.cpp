// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "palpate/core/error.hpp"
#include "palpate/io/file.hpp"
#include "palpate/io/recording.hpp"
#include "palpate/io/recording_reader.hpp"
#include "palpate/io/urdf.hpp"

namespace palpate::io {
namespace {

namespace fs = std::filesystem;
constexpr const char* index_name = "recording.yaml";
constexpr const char* recording_format = "palpate-recording/1";

void read_density(YamlKeys& keys, Recording& recording) {
  const auto field = keys.optional("density_kg_m3");
  if (!field) return;
  if (field->is_map()) {
    YamlKeys inner(*field);
    recording.density_kg_m3 = inner.required("value").positive();
    if (const auto std = inner.optional("std")) {
      recording.density_std_kg_m3 = std->non_negative();
      if (recording.density_std_kg_m3 > recording.density_kg_m3)
        std->fail("is larger than the density itself; it is a standard deviation in kg/m3");
    }
    inner.finish();
  } else {
    recording.density_kg_m3 = field->positive();
  }
  if (recording.density_kg_m3 < 5 || recording.density_kg_m3 > 30000) {
    field->fail("is outside 5 to 30000 kg/m3; is it in g/cm3? Multiply by 1000");
  }
}

void read_environment(YamlKeys& keys, Recording& recording) {
  const auto field = keys.optional("environment");
  if (!field) return;
  YamlKeys inner(*field);
  if (const auto gravity = inner.optional("gravity_m_s2")) {
    recording.environment.gravity_m_s2 = gravity->vector3();
    if (recording.environment.gravity_m_s2.norm() > 100)
      gravity->fail("is more than 100 m/s2; it is in m/s2, [0, 0, -9.81] on earth");
    if (recording.environment.gravity_m_s2.norm() > 0 && recording.density_kg_m3 == 0) {
      gravity->fail("gravity acts but 'density_kg_m3' is missing; add the object's density, or leave gravity out");
    }
  }
  if (const auto planes = inner.optional("planes")) {
    for (const YamlField& item : planes->items()) {
      YamlKeys plane(item);
      recording.environment.planes.push_back(read_plane(plane));
      plane.finish();
    }
  }
  inner.finish();
}

void read_robot(const YamlField& field, RecordingContext& context) {
  YamlKeys keys(field);
  const YamlField urdf = keys.required("urdf");
  context.recording.robot = parse_named(urdf.where(), [&] {
    return parse_urdf(context.folder.read(urdf.text(), urdf.where()), context.folder.path_of(urdf.text()),
                      context.folder.root(), &context.recording.warnings);
  });
  if (const auto joints = keys.optional("joints")) {
    for (const YamlField& joint : joints->items()) {
      const std::string name = joint.text();
      const auto& known = context.recording.robot->joints;
      if (std::none_of(known.begin(), known.end(), [&](const RobotJoint& one) { return one.name == name; })) {
        joint.fail("the robot has no joint '" + name + "'");
      }
      context.recording.joint_names.push_back(name);
    }
  }
  keys.finish();
}

}  // namespace

void read_object(YamlKeys& keys, RecordingContext& context) {
  Recording& recording = context.recording;
  recording.name = keys.text_or("name", fs::absolute(context.folder.root()).lexically_normal().filename().string());
  recording.description = keys.text_or("description", "");
  recording.accept_size = keys.boolean_or("accept_size", false);
  recording.force_scale_std = keys.within_or("force_scale_std", 0, ranges::share_std);
  recording.force_cross_talk_std = keys.within_or("force_cross_talk_std", 0, ranges::share_std);
  recording.time_offset_std_s = keys.within_or("time_offset_std_s", 0, ranges::clock_std);
  read_density(keys, recording);
  read_environment(keys, recording);
  // Keys are asked for in an order that lets each part refer to what it needs, and all before any is missed, so that a
  // mistyped key is recognised as such.
  const auto model = keys.optional("model"), robot = keys.optional("robot"), tools = keys.optional("tools"),
             cameras = keys.optional("cameras"), regions = keys.optional("regions");
  const YamlField rest = keys.required("rest", "say what the object looks like untouched");
  const YamlField supports =
      keys.required("supports", "say how the object is held, or 'supports: free' if nothing holds it");
  keys.finish();
  if (model) read_model(*model, recording.model);
  if (robot) read_robot(*robot, context);
  if (cameras) read_cameras(*cameras, context);
  read_rest(rest, context);
  read_supports(supports, context);
  if (regions) read_regions(*regions, context);
  if (tools) read_tools(*tools, context);
}

std::string RecordingFolder::read(const std::string& file, const std::string& where) {
  const fs::path relative(file);
  if (file.empty()) throw Error("a file name is expected", where);
  if (relative.is_absolute() || std::find(relative.begin(), relative.end(), "..") != relative.end()) {
    throw Error("'" + file + "' lies outside the recording's folder; copy the file into it", where);
  }
  std::error_code code;
  if (!fs::is_regular_file(root_ / relative, code)) {
    throw Error("there is no file '" + file + "' in " + root_.string() + "; check the name or copy the file there", where);
  }
  std::string bytes = read_file(root_ / relative);
  hashes_[file] = sha256_hex(bytes);
  return bytes;
}

Recording read_recording_unchecked(const fs::path& given) {
  std::error_code code;
  const bool is_index = fs::is_regular_file(given, code);
  const fs::path root = is_index ? given.parent_path() : given;
  const fs::path index = is_index ? given : given / index_name;
  if (!is_index && !fs::is_directory(given, code)) throw Error("there is no such folder; a recording is a folder with recording.yaml in it (docs/recording-format.md)", given.string());
  if (is_index && index.extension() != ".yaml" && index.extension() != ".yml") {
    throw Error("is no recording: that is a folder with recording.yaml in it, that file, or a bag (.mcap, .db3, .bag); "
                "the shape of an object alone is for `palpate model` (docs/recording-format.md)",
                given.string());
  }
  if (!fs::exists(index, code)) {
    const fs::path below = given / "recording";  // as `palpate demo` and `explore` leave it
    const std::string meant = fs::exists(below / index_name, code) ? "; did you mean " + below.string() + "?" : "";
    throw Error("holds no recording.yaml; a recording is a folder with that file in it (docs/recording-format.md)" + meant, given.string());
  }
  RecordingContext context{RecordingFolder(root), {}, {}, {}, {}, 0, {}};
  Recording& recording = context.recording;
  const std::string bytes = context.folder.read(index.filename().string(), index.string());
  const YamlField top = YamlField::parse(bytes, index.string());
  YamlKeys keys(top);
  const YamlField format = keys.required("format", std::string("write 'format: ") + recording_format + "'");
  if (format.text() != recording_format) {
    if (format.text().starts_with("palpate-mapping/"))
      format.fail("this is the mapping of a bag; name the bag in its place, and this as its mapping (`--mapping`) unless it is mapping.yaml beside the bag");
    format.fail("'" + format.text().substr(0, 60) + "' is not a format that this version reads; it reads " + recording_format);
  }
  recording.source = given.string();
  const auto markers = keys.optional("markers");
  const YamlField pushes = keys.required("pushes", "list what was done to the object");
  read_object(keys, context);
  if (markers) read_markers(*markers, context);
  read_pushes(pushes, context);
  recording.input_hashes = context.folder.hashes();
  return std::move(context.recording);
}

Recording read_recording(const fs::path& folder) {
  Recording recording = read_recording_unchecked(folder);
  const std::vector<Problem> problems = check_recording(recording);
  if (!problems.empty()) {
    std::string what = problems.front().what;
    if (problems.size() > 1) what += " (" + std::to_string(problems.size() - 1) + " more: `palpate info` lists them)";
    throw Error(what, problems.front().where);
  }
  for (std::string& odd : odd_numbers(recording)) recording.warnings.push_back(std::move(odd));
  return recording;
}

}  // namespace palpate::io
