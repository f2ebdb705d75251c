// SPDX-License-Identifier: Apache-2.0
// What a bag holds and what a recording would still need, for people who see it for the first time.
#pragma once

#include <string>
#include <vector>

#include "palpate/io/bag_mapping.hpp"
#include "palpate/io/message_source.hpp"

namespace palpate::io {

struct SurveyedTopic {
  std::string name, type;
  std::size_t messages = 0;
  double from_s = 0, to_s = 0;  ///< from the bag's first message
  double rate_hz = 0;           ///< mean; 0 for fewer than two messages
  std::string use;              ///< "force", "depth images", ...; empty = of no use here
  std::string frame;            ///< of its first message's header, where it has one
};

struct BagSurvey {
  std::vector<SurveyedTopic> topics;
  double duration_s = 0;
  std::vector<std::string> frames;   ///< "child of parent", of all transforms
  std::vector<std::string> missing;  ///< what a recording needs and the bag does not have, in plain words with the cure
  std::string mapping;               ///< a mapping to start from; what nobody can guess says FILL_IN
};

BagSurvey survey(const MessageSource& bag);

/// A topic that a recording could be made with and that the mapping leaves alone.
struct UnusedTopic {
  std::string topic, use, key;  ///< key: of the mapping, that would take it
};
/// Pictures that the mapping takes in another form (raw and packed, depth and clouds of it) are not missed.
std::vector<UnusedTopic> unused_topics(const BagSurvey& found, const BagMapping& mapping);

}  // namespace palpate::io
