// SPDX-License-Identifier: Apache-2.0
#include <map>

#include "palpate/io/bag_formats.hpp"
#include "palpate/io/mcap.hpp"

namespace palpate::io {

MessageSource parse_mcap_bag(std::string bytes, const std::string& name) {
  const auto file = std::make_shared<McapFile>(McapFile::parse(std::move(bytes), name));
  MessageCollector collector;
  std::map<std::uint16_t, std::size_t> place;
  for (const auto& [id, channel] : file->channels) {
    const MessageEncoding encoding = channel.message_encoding == "cdr"    ? MessageEncoding::cdr
                                     : channel.message_encoding == "ros1" ? MessageEncoding::ros1
                                                                          : MessageEncoding::other;
    place[id] = collector.topic(channel.topic, channel.schema_name, encoding);
  }
  for (const McapMessage& message : file->messages)
    collector.add(place.at(message.channel), static_cast<std::int64_t>(message.log_time_ns), message.data);
  collector.warnings = file->warnings;
  return collector.finish(file, name);
}

}  // namespace palpate::io
