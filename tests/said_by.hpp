// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/wait.h>

#include <array>
#include <cstdio>
#include <string>

namespace palpate::test {

struct Said {
  int exit_code = -1;  ///< -1: ended by a signal
  std::string text;
};

/// What a shell's command prints, and how it ends.
inline Said said_by(const std::string& command) {
  FILE* pipe = popen(command.c_str(), "r");
  Said said;
  std::array<char, 4096> buffer;
  while (const std::size_t count = std::fread(buffer.data(), 1, buffer.size(), pipe)) said.text.append(buffer.data(), count);
  const int status = pclose(pipe);
  said.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return said;
}

}  // namespace palpate::test
