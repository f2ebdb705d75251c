// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/message_source.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <optional>

#include "palpate/core/error.hpp"
#include "palpate/io/bag_formats.hpp"
#include "palpate/io/file.hpp"
#include "palpate/io/sqlite_log.hpp"
#include "palpate/io/unpack.hpp"
#include "palpate/io/yaml_field.hpp"

namespace palpate::io {
namespace {

namespace fs = std::filesystem;
using std::string_view_literals::operator""sv;
constexpr const char* metadata_name = "metadata.yaml";
constexpr std::string_view packed_extension = ".zstd";

bool starts_as_a_bag(const fs::path& path) {
  std::string first(16, '\0');
  std::ifstream file(path, std::ios::binary);
  file.read(first.data(), static_cast<std::streamsize>(first.size()));
  first.resize(static_cast<std::size_t>(file.gcount()));
  const auto formats = bag_formats();
  return std::any_of(formats.begin(), formats.end(), [&](const BagFormat& one) { return first.starts_with(one.magic); });
}

bool has_bag_extension(const fs::path& path) {
  for (const BagFormat& format : bag_formats()) {
    for (const std::string& extension : format.extensions) {
      if (path.string().ends_with(extension) || path.string().ends_with(extension + std::string(packed_extension))) return true;
    }
  }
  return false;
}

/// The files that metadata.yaml names; it is written by many versions of rosbag2, so that only what is needed is looked at.
std::vector<std::string> files_of(const fs::path& path) {
  std::vector<std::string> files;
  const YamlField top = YamlField::parse(read_file(path), path.string());
  // Since version 6 (Iron) it says `custom_data: ~`.
  YamlKeys keys(YamlKeys(top).required("rosbag2_bagfile_information"), KeysWithoutValue::left_out);
  for (const YamlField& file : keys.required("relative_file_paths").items()) files.push_back(file.text());
  const std::string mode = keys.text_or("compression_mode", ""), format = keys.text_or("compression_format", "");
  if (!mode.empty() && mode != "NONE" && mode != "none" && !format.empty() && format != "zstd")
    throw Error("is compressed as '" + format + "'; only zstd is read. Convert it: ros2 bag convert", path.string());
  return files;
}

std::vector<std::string> bag_files_in(const fs::path& folder) {
  std::vector<std::string> files;
  std::error_code code;
  for (auto entry = fs::directory_iterator(folder, code); !code && entry != fs::directory_iterator(); entry.increment(code)) {
    std::error_code of_entry;
    if (entry->is_regular_file(of_entry) && has_bag_extension(entry->path())) files.push_back(entry->path().filename().string());
  }
  std::sort(files.begin(), files.end());
  // Whoever unpacks a file or was about to pack it leaves both beside each other.
  std::erase_if(files, [&](const std::string& file) {
    return file.ends_with(packed_extension) &&
           fs::exists(folder / file.substr(0, file.size() - packed_extension.size()), code);
  });
  return files;
}

/// Where a file of a bag lies that metadata.yaml names; nothing where it is not there.
std::optional<fs::path> found_in(const fs::path& folder, const std::string& file) {
  const bool is_packed = file.ends_with(packed_extension);
  // A recorder that was cut off, or somebody with `zstd`, packed or unpacked it after it was named.
  const std::string other = is_packed ? file.substr(0, file.size() - packed_extension.size()) : file + std::string(packed_extension);
  for (const std::string& name : {file, other}) {
    // Old versions of rosbag2 put the folder's name in front.
    for (const fs::path& path : {folder / name, folder / fs::path(name).filename()}) {
      std::error_code code;
      if (fs::is_regular_file(path, code)) return path;
    }
  }
  return std::nullopt;
}

/// Several files of one bag (rosbag2 splits them by size or time) as one.
MessageSource joined(std::vector<MessageSource> sources, const std::string& name) {
  MessageCollector collector;
  auto memory = std::make_shared<std::vector<MessageSource>>(std::move(sources));
  for (const MessageSource& source : *memory) {
    std::vector<std::size_t> place;
    for (const MessageTopic& topic : source.topics) place.push_back(collector.topic(topic.name, topic.type, topic.encoding));
    for (const Message& message : source.messages) collector.add(place[message.topic], message.log_time_ns, message.data);
    for (const std::string& warning : source.warnings)
      collector.warnings.push_back(fs::path(source.name).filename().string() + ": " + warning);
  }
  MessageSource result = collector.finish(memory, name);
  result.format = memory->front().format;
  return result;
}

/// rosbag2 packs messages on their own (compression_mode MESSAGE) and says so in metadata.yaml alone, which may be missing or
/// elsewhere. The first byte of CDR is always 0.
MessageSource with_unpacked_messages(MessageSource source) {
  const auto is_packed = [&](const Message& message) {
    return source.topics[message.topic].encoding == MessageEncoding::cdr && message.data.starts_with("\x28\xb5\x2f\xfd"sv);
  };
  if (std::none_of(source.messages.begin(), source.messages.end(), is_packed)) return source;
  auto texts = std::make_shared<std::pair<std::shared_ptr<const void>, std::vector<std::string>>>();
  texts->first = source.memory;
  texts->second.reserve(source.messages.size());  // views must stay where they are
  std::size_t lost = 0;
  for (Message& message : source.messages) {
    if (!is_packed(message)) continue;
    auto text = unpack_zstd(message.data);
    if (!text) ++lost;
    texts->second.push_back(text ? std::move(*text) : std::string());
    message.data = texts->second.back();
  }
  if (lost > 0) source.warnings.push_back(std::to_string(lost) + " messages could not be unpacked");
  source.memory = texts;
  return source;
}

MessageSource read_bag_file(const fs::path& path) {
  std::string bytes = read_file(path);
  if (path.extension() == packed_extension) {
    auto unpacked = unpack_zstd(bytes);
    if (!unpacked) throw Error("is damaged: it cannot be unpacked", path.string());
    bytes = std::move(*unpacked);
  }
  // A database that was not closed: its last messages, or all of them, lie beside it.
  const fs::path log = path.string() + "-wal";
  const std::string log_name = "'" + log.filename().string() + "'";
  std::vector<std::string> warnings;
  std::error_code code;
  if (fs::exists(log, code) && fs::file_size(log, code) > 0) {
    const auto left = fold_in_log(bytes, read_file(log));
    warnings.push_back(left ? "the database was not closed by its recorder: what is in " + log_name + " is read as well" +
                                  (*left > 0 ? ", but for its last " + std::to_string(*left) + " bytes, which are no whole transaction" : "")
                            : "what is in " + log_name + " is not read: it is no write-ahead log, or its beginning is damaged");
  }
  MessageSource source = with_unpacked_messages(parse_bag(std::move(bytes), path.string()));
  source.warnings.insert(source.warnings.end(), warnings.begin(), warnings.end());
  return source;
}

MessageSource read_bag_folder(const fs::path& folder) {
  std::error_code code;
  const bool has_metadata = fs::exists(folder / metadata_name, code);
  std::vector<std::string> warnings;
  if (!has_metadata)
    warnings.push_back("there is no metadata.yaml (was the recorder cut off?): all bag files of the folder are read");
  std::vector<MessageSource> sources;
  std::optional<Error> unread;
  std::optional<std::string> missing;
  for (const std::string& file : has_metadata ? files_of(folder / metadata_name) : bag_files_in(folder)) {
    const auto path = found_in(folder, file);
    if (!path) {
      warnings.push_back("the file '" + file + "' is not there");
      if (!missing) missing = file;
      continue;
    }
    try {
      sources.push_back(read_bag_file(*path));
    } catch (const Error& error) {  // a recorder that was cut off leaves its last file empty; the others are whole
      warnings.push_back("the file '" + path->filename().string() + "' is left out: it " + error.message());
      unread = error;
    }
  }
  if (sources.empty() && unread) throw Error(*unread);
  if (sources.empty() && missing)
    throw Error("names '" + *missing + "', which is not in this folder; copy the bag's files beside it",
                (folder / metadata_name).string());
  if (sources.empty()) throw Error("holds no bag file (.mcap, .db3, .bag)", folder.string());
  MessageSource result = joined(std::move(sources), folder.string());
  result.warnings.insert(result.warnings.begin(), warnings.begin(), warnings.end());
  return result;
}

}  // namespace

std::span<const BagFormat> bag_formats() {
  static const std::array<BagFormat, 3> formats = {{
      {"mcap", {".mcap"}, "MCAP, the default of rosbag2", "\x89MCAP0\r\n"sv, parse_mcap_bag},
      {"sqlite3", {".db3"}, "SQLite, the older default of rosbag2", "SQLite format 3\0"sv, parse_sqlite_bag},
      {"ros1", {".bag", ".bag.active"}, "ROS 1 bag, version 2.0", "#ROSBAG V"sv, parse_ros1_bag},
  }};
  return formats;
}

bool is_bag(const fs::path& path) {
  std::error_code code;
  if (fs::is_regular_file(path, code)) return starts_as_a_bag(path) || has_bag_extension(path);
  if (!fs::is_directory(path, code) || fs::exists(path / "recording.yaml", code)) return false;
  return fs::exists(path / metadata_name, code) || !bag_files_in(path).empty();
}

MessageSource read_bag(const fs::path& path) {
  std::error_code code;
  return fs::is_directory(path, code) ? read_bag_folder(path) : read_bag_file(path);
}

MessageSource parse_bag(std::string bytes, const std::string& name) {
  for (const BagFormat& format : bag_formats()) {
    if (!bytes.starts_with(format.magic)) continue;
    MessageSource source = format.parse(std::move(bytes), name);
    source.format = format.name;
    return source;
  }
  std::string known;
  for (const BagFormat& format : bag_formats()) known += (known.empty() ? "" : "; ") + format.about;
  throw Error(bytes.empty() ? "is an empty file" : "does not start as a bag does. These are read: " + known, name);
}

std::string cut_off_warning(std::size_t file_bytes, std::size_t within, std::optional<std::int64_t> first_ns,
                            std::optional<std::int64_t> last_ns) {
  const std::string where = fmt::format("the file is cut off at byte {}, within what begins at byte {}", file_bytes, within);
  if (!first_ns || !last_ns) return where + ", before its first whole message: there is nothing to be read";
  return fmt::format("{}; the last whole message is of {:.6f} s, {:.3f} s after the first: what was recorded up to there is read",
                     where, 1e-9 * static_cast<double>(*last_ns), 1e-9 * static_cast<double>(*last_ns - *first_ns));
}

std::string ros2_type_name(const std::string& type) {
  const std::size_t slash = type.find('/');
  if (slash == std::string::npos || type.find('/', slash + 1) != std::string::npos) return type;
  return type.substr(0, slash) + "/msg" + type.substr(slash);
}

std::size_t MessageCollector::topic(const std::string& name, const std::string& type, MessageEncoding encoding) {
  const std::string ros2 = ros2_type_name(type);
  for (std::size_t i = 0; i < topics_.size(); ++i) {
    if (topics_[i].name == name && topics_[i].type == ros2 && topics_[i].encoding == encoding) return i;
  }
  topics_.push_back({name, ros2, encoding, 0});
  return topics_.size() - 1;
}

namespace {

/// One message logged at 0 (a simulation's clock before it ran) would be the bag's start, and put every step decades after it.
/// @param messages  in the order of their times  @returns how many went
std::size_t drop_astray(std::vector<Message>& messages) {
  if (messages.empty()) return 0;
  constexpr double far_ns = 10 * 86400 * 1e9;
  const double middle_ns = static_cast<double>(messages[messages.size() / 2].log_time_ns);
  return std::erase_if(messages, [&](const Message& one) { return std::abs(static_cast<double>(one.log_time_ns) - middle_ns) > far_ns; });
}

}  // namespace

MessageSource MessageCollector::finish(std::shared_ptr<const void> memory, const std::string& name) {
  MessageSource source;
  source.name = name;
  source.memory = std::move(memory);
  std::vector<std::size_t> order(topics_.size()), place(topics_.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return topics_[a].name < topics_[b].name; });
  for (std::size_t i = 0; i < order.size(); ++i) {
    place[order[i]] = i;
    source.topics.push_back(topics_[order[i]]);
  }
  source.messages = std::move(messages_);
  std::stable_sort(source.messages.begin(), source.messages.end(),
                   [](const Message& a, const Message& b) { return a.log_time_ns < b.log_time_ns; });
  if (const std::size_t astray = drop_astray(source.messages); astray > 0)
    warnings.push_back(std::to_string(astray) + " messages are left out: their recorder's times lie days from all others (0, or damaged)");
  for (Message& message : source.messages) {
    message.topic = place[message.topic];
    ++source.topics[message.topic].messages;
  }
  source.warnings = std::move(warnings);
  return source;
}

}  // namespace palpate::io
