// SPDX-License-Identifier: Apache-2.0
#include "cli/info_bag.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "palpate/io/message_source.hpp"
#include "palpate/io/ros_messages.hpp"

namespace palpate::cli {
namespace {

struct Topic {
  std::string type;
  std::size_t count = 0;
  std::int64_t first_ns = 0, last_ns = 0;
  double rate_hz() const {
    return count > 1 && last_ns > first_ns ? static_cast<double>(count - 1) * 1e9 / static_cast<double>(last_ns - first_ns)
                                           : 0.0;
  }
};

bool is_understood(const std::string& type) {
  const auto types = io::ros_types();
  return std::any_of(types.begin(), types.end(), [&](const io::RosType& one) { return type == one.name; });
}

}  // namespace

int look_into_bag(Session& session, const std::filesystem::path& path) {
  const io::MessageSource file = io::read_bag(path);
  std::map<std::string, Topic> topics;
  for (const io::MessageTopic& one : file.topics) topics[one.name].type = one.type;
  for (const io::Message& message : file.messages) {
    Topic& topic = topics[file.topics[message.topic].name];
    if (topic.count++ == 0) topic.first_ns = message.log_time_ns;
    topic.last_ns = message.log_time_ns;
  }
  const double seconds =
      file.messages.empty()
          ? 0
          : static_cast<double>(file.messages.back().log_time_ns - file.messages.front().log_time_ns) * 1e-9;
  session.say(fmt::format("bag        {}: {} messages on {} topics in {:.3g} s", path.filename().string(),
                          file.messages.size(), topics.size(), seconds));
  nlohmann::json listed = nlohmann::json::array();
  for (const auto& [name, topic] : topics) {
    const bool understood = is_understood(topic.type);
    session.say(fmt::format("  {:<32} {:<32} {:>7} messages, {:.3g} Hz{}", name, topic.type, topic.count, topic.rate_hz(),
                            understood ? "" : "   (of no use here)"));
    listed.push_back({{"topic", name},
                      {"type", topic.type},
                      {"messages", topic.count},
                      {"rate_hz", topic.rate_hz()},
                      {"understood", understood}});
  }
  for (const std::string& warning : file.warnings) session.warn("warning    " + warning);
  session.result({{"format", "palpate-info/1"},
                  {"bag", path.string()},
                  {"duration_s", seconds},
                  {"topics", listed},
                  {"warnings", file.warnings}});
  return exit_done;
}

}  // namespace palpate::cli
