// SPDX-License-Identifier: Apache-2.0
#include <palpate/core/error.hpp>
#include <palpate/core/identification.hpp>
#include <palpate/core/version.hpp>
#include <palpate/identify.hpp>
#include <palpate/load_recording.hpp>
#include <string>

int main() {
  try {
    palpate::LoadedRecording loaded = palpate::load_recording("nowhere");
    palpate::check_loaded(loaded.recording);
    return palpate::identify(loaded.recording).answer.parameters.empty() ? 1 : 2;
  } catch (const palpate::Error& error) {
    const palpate::Identification untouched;
    return error.where() == "nowhere" && untouched.termination == palpate::Termination::failed &&
                   std::string(palpate::version) == "0.1.0"
               ? 0
               : 1;
  }
}
