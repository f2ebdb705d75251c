// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "palpate/io/recording_reader.hpp"

namespace palpate::io {
namespace {

/// Two loads, or two observations of a kind: columns then carry a name in front.
bool is_alone(const std::vector<YamlField>& items, const YamlField& item) {
  const auto kind_of = [](const YamlField& one) {
    for (const auto& [key, value] : one.entries()) {
      if (key == "kind") return value.text();
    }
    return std::string();
  };
  std::size_t same = 0;
  for (const YamlField& other : items) same += kind_of(other) == kind_of(item) ? 1 : 0;
  return same == 1;
}

void read_loads_and_observations(YamlKeys& keys, const TableRow* row, RecordingContext& context, Step& step) {
  const auto loads = keys.optional("loads"), observations = keys.optional("observations");
  if (loads) {
    const auto items = loads->items();
    for (const YamlField& item : items) {
      step.loads.push_back(read_load(item, row, items.size() == 1, context));
      for (std::size_t i = 0; i + 1 < step.loads.size(); ++i) {
        if (step.loads[i].tool == step.loads.back().tool)
          item.fail("tool '" + step.loads[i].tool + "' has two loads in one step");
      }
    }
  }
  step.unloading = keys.boolean_or("unloading", false);
  step.slipped = keys.boolean_or("slipped", false);
  if (observations) {
    const auto items = observations->items();
    for (const YamlField& item : items) read_observation(item, row, is_alone(items, item), context, step);
  }
}

/// In a push time goes on: a step that stands still in it is there twice.
void add_step(Step step, Push& push) {
  if (!(step.time_s >= ranges::time.least && step.time_s <= ranges::time.most))
    throw Error(fmt::format("is {:g} s, which cannot be; {}", step.time_s, ranges::time.slip), step.source + ": time_s");
  if (!push.steps.empty() && !(step.time_s > push.steps.back().time_s)) {
    const Step& last = push.steps.back();
    const bool same = step.time_s == last.time_s;
    throw Error(same ? "has the time_s of the step in " + last.source + "; a step is there twice, remove one"
                     : "time_s goes back, from that of " + last.source + "; order the steps by time",
                step.source + ": time_s");
  }
  push.steps.push_back(std::move(step));
}

void read_step_list(const YamlField& list, Push& push, RecordingContext& context) {
  for (const YamlField& item : list.items()) {
    YamlKeys keys(item);
    Step step;
    step.source = item.file_and_line();
    step.time_s = keys.required("time_s").number();
    if (const auto tip = keys.optional("T_base_tip")) step.T_base_tip = read_pose(*tip);
    if (const auto joints = keys.optional("joints_rad")) {
      step.joints_rad = joints->numbers();
      if (step.joints_rad.size() != context.recording.joint_names.size()) {
        joints->fail("has " + std::to_string(step.joints_rad.size()) + " values, 'robot: joints' names " +
                     std::to_string(context.recording.joint_names.size()));
      }
    }
    read_loads_and_observations(keys, nullptr, context, step);
    keys.finish();
    add_step(std::move(step), push);
  }
  if (push.steps.empty()) list.fail("holds no step");
}

void read_step_table(const YamlField& file, const YamlField& every_step, Push& push, RecordingContext& context) {
  const CsvTable table = parse_named(file.where(), [&] {
    return CsvTable::parse(context.folder.read(file.text(), file.where()), context.folder.path_of(file.text()));
  });
  if (!table.has("time_s")) throw Error("column 'time_s' is missing", table.name() + ":1 (named in " + file.where() + ")");
  std::set<std::size_t> used;
  for (std::size_t i = 0; i < table.rows(); ++i) {
    const TableRow row(table, i, used);
    YamlKeys keys(every_step);
    Step step;
    step.source = row.where();
    step.time_s = *row.number("time_s");
    read_loads_and_observations(keys, &row, context, step);
    keys.finish();
    if (const auto unloading = row.number("unloading")) {
      if (*unloading != 0 && *unloading != 1) throw Error("is neither 0 nor 1", row.where() + ": unloading");
      step.unloading = *unloading == 1;
    }
    if (const auto slipped = row.number("slipped")) {
      if (*slipped != 0 && *slipped != 1) throw Error("is neither 0 nor 1", row.where() + ": slipped");
      step.slipped = *slipped == 1;
    }
    if (const auto position = row.vector("tip", "_m")) {
      Eigen::Vector4d q;
      for (const auto& [k, letter] : {std::pair{0, 'x'}, {1, 'y'}, {2, 'z'}, {3, 'w'}}) {
        const auto value = row.number(std::string("tip_q") + letter);
        if (!value) throw Error(std::string("column 'tip_q") + letter + "' is missing", row.where());
        q[k] = *value;
      }
      step.T_base_tip = pose_from(*position, q, row.where());
    }
    for (const std::string& joint : context.recording.joint_names) {
      const auto value = row.number(joint + "_rad");
      if (!value) {
        if (!step.joints_rad.empty()) throw Error("column '" + joint + "_rad' is missing", row.where());
        break;
      }
      step.joints_rad.push_back(*value);
    }
    add_step(std::move(step), push);
  }
  for (std::size_t column = 0; column < table.columns().size(); ++column) {
    if (used.count(column) > 0) continue;
    const std::string& name = table.columns()[column];
    std::vector<std::string> known = {"time_s",
                                      "force_x_n",
                                      "force_y_n",
                                      "force_z_n",
                                      "force_n",
                                      "travel_m",
                                      "cloud",
                                      "depth",
                                      "mask",
                                      "observed_travel_m",
                                      "observed_force_n",
                                      "unloading",
                                      "slipped",
                                      "tip_x_m",
                                      "contact_x_m",
                                      "observed_force_x_n",
                                      "observed_force_y_n",
                                      "observed_force_z_n"};
    const auto near = nearest_word(name, known);
    throw Error("column '" + name.substr(0, 60) + "' is unknown, or nothing in 'every_step' takes it" +
                    (near && *near != name ? "; did you mean '" + *near + "'?" : "") +
                    "; with two loads or two observations of a kind the name goes in front (left.force_x_n)",
                table.name() + ":1 (named in " + file.where() + ")");
  }
}

}  // namespace

void read_pushes(const YamlField& field, RecordingContext& context) {
  std::vector<Push>& pushes = context.recording.pushes;
  for (const YamlField& item : field.items()) {
    YamlKeys keys(item);
    Push push;
    push.name = keys.text_or("name", "push " + std::to_string(pushes.size() + 1));
    for (const Push& other : pushes) {
      if (other.name == push.name) item.fail("there is a push '" + push.name + "' already; names must differ");
    }
    push.site = keys.text_or("site", "");
    push.force_tare_std_n = keys.within_or("force_tare_std_n", 0, ranges::force_std);
    push.travel_offset_std_m = keys.within_or("travel_offset_std_m", 0, ranges::length_std);
    push.torque_tare_std_nm = keys.within_or("torque_tare_std_nm", 0, ranges::torque_std);
    push.tip_std_m = keys.within_or("tip_std_m", 0, ranges::length_std);
    std::optional<ForceDrift> drift;
    if (const auto moving = keys.optional("force_drift")) {
      YamlKeys inner(*moving);
      drift = ForceDrift{inner.required("rate_n_s").vector3(), inner.required("zero_at_s").within(ranges::time)};
      inner.finish();
      if (drift->rate_n_s.norm() > 1) moving->fail("no sensor's zero moves by more than 1 N a second; is it in millinewtons?");
    }
    const auto steps = keys.optional("steps"), table = keys.optional("table");
    if (static_cast<bool>(steps) == static_cast<bool>(table)) item.fail("give either 'steps' or 'table'");
    if (table) {
      const YamlField every_step = keys.required("every_step", "what all rows share: loads, observations");
      keys.finish();
      read_step_table(*table, every_step, push, context);
    } else {
      keys.finish();
      read_step_list(*steps, push, context);
    }
    if (drift) take_off(*drift, push);
    pushes.push_back(std::move(push));
  }
}

}  // namespace palpate::io
