// SPDX-License-Identifier: Apache-2.0
// The recording folder of docs/recording-format.md, read and written.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "palpate/core/force_drift.hpp"
#include "palpate/core/recording.hpp"

namespace palpate::io {

/// Something that makes a recording unusable although its files could be read.
struct Problem {
  std::string where;  ///< file, line and field
  std::string what;   ///< what is wrong and the cure
};

/// Reads a folder (or the index file in it) and checks everything that docs/recording-format.md says is refused. Throws
/// Error naming file, line, field and cure.
Recording read_recording(const std::filesystem::path& folder);

/// The same without the checks that need the whole recording (`check_recording`); for `palpate info`, and for an object
/// without pushes.
Recording read_recording_unchecked(const std::filesystem::path& folder);

/// What is wrong with a recording, wherever it came from: sizes and units, orientation, fit of the clouds, depths and
/// travels to the object, loads. Empty = usable.
std::vector<Problem> check_recording(const Recording& recording);

/// What can be, and is seldom meant: warnings in words that name the place, for whoever reads the recording.
std::vector<std::string> odd_numbers(const Recording& recording);

/// Writes a recording while it is being made. After every step the folder is a whole recording: files are put in place
/// first, then the index by renaming, so that a crash loses at most the step in flight. To go on after one, start from what
/// `read_recording_unchecked` gives.
class RecordingWriter {
 public:
  /// Writes `start` with the steps that it has into `folder`, which is made if absent.
  RecordingWriter(std::filesystem::path folder, const Recording& start);
  ~RecordingWriter();
  RecordingWriter(RecordingWriter&&) noexcept;
  RecordingWriter& operator=(RecordingWriter&&) noexcept;
  /// Following steps belong to this push; of `push` the steps are not looked at. It is written with its first step.
  void begin_push(const Push& push);
  void add_step(const Step& step);
  /// Says how the zero of the forces of the push just written went away; `read_recording` takes it off them.
  void end_push(const ForceDrift& drift);

  struct Pages;  ///< of the writer alone

 private:
  std::unique_ptr<Pages> pages_;
};

/// Writes the folder beside `folder` and renames it; what `read_recording` gives back is equal to `recording` up to names of
/// files and `source`. Throws Error when `folder` exists and is not an empty folder.
void write_recording(const Recording& recording, const std::filesystem::path& folder);

}  // namespace palpate::io
