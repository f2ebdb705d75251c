// SPDX-License-Identifier: Apache-2.0
// What rosbag2 demands of metadata.yaml, by the version that it claims (convert<BagMetadata> in rosbag2_storage/yaml.hpp).
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "palpate/io/file.hpp"
#include "palpate/io/yaml_field.hpp"

namespace palpate::io::test {

struct Rosbag2File {
  std::string path;
  std::int64_t start_ns = 0, duration_ns = 0;
  std::size_t messages = 0;
};
struct Rosbag2Metadata {
  int version = 0;
  std::string storage;
  std::size_t messages = 0;
  std::map<std::string, std::size_t> topics;
  std::map<std::string, std::string> offers;  // qualities of service, by topic
  std::vector<std::string> paths;
  std::vector<Rosbag2File> files;
};

/// @throws Error naming the key that rosbag2 would miss.
inline Rosbag2Metadata rosbag2_metadata(const std::filesystem::path& folder) {
  const std::filesystem::path path = folder / "metadata.yaml";
  const auto count = [](const YamlField& field) { return static_cast<std::size_t>(std::stoull(field.text())); };
  const auto nanoseconds = [&](YamlKeys& keys, const char* key, const char* unit) {
    return static_cast<std::int64_t>(count(YamlKeys(keys.required(key)).required(unit)));
  };
  YamlKeys keys(YamlKeys(YamlField::parse(read_file(path), path.string())).required("rosbag2_bagfile_information"));
  Rosbag2Metadata out;
  out.version = keys.required("version").whole(1, 8);
  out.storage = keys.required("storage_identifier").text();
  nanoseconds(keys, "duration", "nanoseconds");
  nanoseconds(keys, "starting_time", "nanoseconds_since_epoch");
  out.messages = count(keys.required("message_count"));
  for (const YamlField& one : keys.required("topics_with_message_count").items()) {
    YamlKeys topic(one);
    YamlKeys about(topic.required("topic_metadata"));
    about.required("type").text();
    about.required("serialization_format").text();
    const std::string name = about.required("name").text();
    if (out.version >= 4) out.offers[name] = about.required("offered_qos_profiles").text();
    if (out.version >= 7) about.required("type_description_hash").text();
    out.topics[name] = count(topic.required("message_count"));
  }
  for (const YamlField& one : keys.required("relative_file_paths").items()) out.paths.push_back(one.text());
  if (out.version >= 3) keys.required("compression_format").text(), keys.required("compression_mode").text();
  if (out.version >= 5) {
    for (const YamlField& one : keys.required("files").items()) {
      YamlKeys file(one);
      out.files.push_back({file.required("path").text(), nanoseconds(file, "starting_time", "nanoseconds_since_epoch"),
                           nanoseconds(file, "duration", "nanoseconds"), count(file.required("message_count"))});
    }
  }
  if (out.version >= 6) keys.required("custom_data");
  if (out.version >= 8) keys.required("ros_distro").text();
  return out;
}

}  // namespace palpate::io::test
