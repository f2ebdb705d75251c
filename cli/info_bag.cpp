// SPDX-License-Identifier: Apache-2.0
#include "cli/info_bag.hpp"

#include <fmt/format.h>

#include <sstream>

#include "palpate/core/error.hpp"
#include "palpate/io/bag_mapping.hpp"
#include "palpate/io/bag_survey.hpp"
#include "palpate/io/message_source.hpp"

namespace palpate::cli {

nlohmann::json look_into_bag(Session& session, const std::filesystem::path& path, const std::filesystem::path& mapping) {
  const io::MessageSource bag = io::read_bag(path);
  if (bag.messages.empty())
    throw Error(fmt::format("holds no message on its {} topics{}; record it again", bag.topics.size(),
                            bag.warnings.empty() ? "" : ": " + bag.warnings.front()),
                path.string());
  const io::BagSurvey survey = io::survey(bag);
  std::filesystem::path name = path.lexically_normal();
  if (name.filename().empty()) name = name.parent_path();
  session.say(fmt::format("bag        {} ({}): {} messages on {} topics in {:.3g} s", name.filename().string(), bag.format,
                          bag.messages.size(), bag.topics.size(), survey.duration_s));
  nlohmann::json listed = nlohmann::json::array();
  for (const io::SurveyedTopic& topic : survey.topics) {
    session.say(fmt::format("  {:<32} {:<32} {:>7} messages, {:.3g} Hz, {:.1f} to {:.1f} s   {}{}", topic.name, topic.type,
                            topic.messages, topic.rate_hz, topic.from_s, topic.to_s,
                            topic.use.empty() ? "(of no use here)" : topic.use,
                            topic.frame.empty() ? "" : " in frame " + topic.frame));
    listed.push_back({{"topic", topic.name},
                      {"type", topic.type},
                      {"messages", topic.messages},
                      {"rate_hz", topic.rate_hz},
                      {"from_s", topic.from_s},
                      {"to_s", topic.to_s},
                      {"frame", topic.frame},
                      {"use", topic.use},
                      {"understood", !topic.use.empty()}});
  }
  if (!survey.frames.empty()) session.say(fmt::format("frames     {}", fmt::join(survey.frames, ", ")));
  for (const std::string& lack : survey.missing) session.warn(lack);
  nlohmann::json left_out = nlohmann::json::array();
  if (!mapping.empty()) {
    for (const io::UnusedTopic& one : io::unused_topics(survey, io::read_mapping(mapping))) {
      session.warn(fmt::format("left out   {} ({}): the mapping does not name it; {} would", one.topic, one.use, one.key));
      left_out.push_back({{"topic", one.topic}, {"use", one.use}, {"key", one.key}});
    }
  }
  if (mapping.empty()) {  // with a mapping, the recording says what was lost
    for (const std::string& warning : bag.warnings) session.warn(warning);
    session.say("mapping    none is given (--mapping FILE, or mapping.yaml beside the bag); one to start from:");
    std::istringstream lines(survey.mapping);
    for (std::string line; std::getline(lines, line);) session.say("    " + line);
  }
  return {{"format", "palpate-info/1"},      {"bag", path.string()},      {"container", bag.format},
          {"duration_s", survey.duration_s}, {"topics", listed},          {"frames", survey.frames},
          {"missing", survey.missing},       {"mapping", survey.mapping}, {"warnings", bag.warnings},
          {"left_out", left_out}};
}

}  // namespace palpate::cli
