// SPDX-License-Identifier: Apache-2.0
// The program as a process whose messages are read while it runs, and which may be killed in the middle of something.
#pragma once

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "io/recording_folder.hpp"

namespace palpate::io {

class RunningProgram : public testing::Test {
 protected:
  void SetUp() override {
    if (std::string(PALPATE_CLI).empty()) GTEST_SKIP() << "the command line program is not built";
  }
  std::string path(const std::string& name) const { return (folder.path() / name).string(); }

  /// Starts the program; its messages come out of `messages_`.
  pid_t start(std::vector<std::string> words) {
    int ends[2];
    if (pipe(ends) != 0) return -1;
    words.insert(words.begin(), PALPATE_CLI);
    const pid_t child = fork();
    if (child == 0) {
      signal(SIGHUP, SIG_DFL);  // tests may run under nohup
      setenv("PATIENT_ROBOT_LOG", path("calls").c_str(), 1);
      setenv("PATIENT_ROBOT_TIP", path("tip").c_str(), 1);
      dup2(ends[1], STDERR_FILENO);
      dup2(ends[1], STDOUT_FILENO);
      close(ends[0]);
      close(ends[1]);
      std::vector<char*> arguments;
      for (std::string& word : words) arguments.push_back(word.data());
      arguments.push_back(nullptr);
      execv(PALPATE_CLI, arguments.data());
      _exit(127);
    }
    close(ends[1]);
    messages_ = fdopen(ends[0], "r");
    return child;
  }
  /// Reads messages until one holds `words`.
  bool says(const std::string& words) {
    char line[4096];
    while (std::fgets(line, sizeof line, messages_) != nullptr) {
      said += line;
      if (std::string(line).find(words) != std::string::npos) return true;
    }
    return false;
  }
  int wait_for(pid_t child) {
    while (says("\n")) {
    }
    std::fclose(messages_);
    int status = 0;
    waitpid(child, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : 1000 + WTERMSIG(status);
  }
  int palpate(const std::vector<std::string>& words) {
    said.clear();
    return wait_for(start(words));
  }

  const test::TemporaryFolder folder{"program"};
  std::string said;
  FILE* messages_ = nullptr;
};

}  // namespace palpate::io
