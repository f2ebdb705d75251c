// SPDX-License-Identifier: Apache-2.0
// The table of verbs. A new verb is one line here and one file cli/<verb>.cpp; help, completion and the check for mistyped
// words read this table.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <span>
#include <string>

#include "cli/session.hpp"

namespace palpate::cli {

/// What a verb does once its options are parsed. Returns an ExitCode; throws Error for bad input.
using Run = std::function<int(Session&)>;

/// Adds the verb's options to `app` and returns what to run. Option values live in a shared struct that Run captures.
using SetUp = Run(CLI::App& app);

// clang-format off
//     verb         group      what it does (one line of the help)                                     an example
#define PALPATE_VERBS(VERB) \
  VERB(demo,       "start",   "the whole way on a made-up foam cube: push, fit, report",               "palpate demo -o out") \
  VERB(model,      "object",  "make tetrahedra that can be simulated from a surface, however broken",  "palpate model teddy.obj -o out --tetrahedra 10000 --unit mm") \
  VERB(record,     "measure", "push an object and record it: the software lab, or the demonstration",  "palpate record -o foam_cube --force-limit 8") \
  VERB(info,       "measure", "what is in a recording, in units, and what is wrong with it",           "palpate info recording") \
  VERB(estimate,   "measure", "Young's modulus and Poisson ratio of a recording, with intervals",      "palpate estimate recording -o result") \
  VERB(check,      "measure", "pushes on a known spring or rigid block: what is wrong with the rig",   "palpate check on_a_spring --stiffness 800") \
  VERB(suggest,    "measure", "the next best push: where, which way and how hard, with what to expect", "palpate suggest result --for poisson-ratio") \
  VERB(explore,    "measure", "push, estimate and take the next best push, until E and nu are known",  "palpate explore --object ball -o out --young-modulus-within 0.05") \
  VERB(predict,    "use",     "deformation, force and stress of a new push, with bands",               "palpate predict result --contact 0.58 0 0.15 --force 5 -o pressed") \
  VERB(export_,    "use",     "the learned object for other simulators",                               "palpate export result --to calculix -o calculix --verify") \
  VERB(report,     "show",    "the figures of a result as SVG and PNG files, without a display",       "palpate report out --png figures") \
  VERB(paper,      "show",    "the experiments of the founding paper, by its method and by ours",      "palpate paper -o paper --quick") \
  VERB(doctor,     "set up",  "check the installation and say what to do about what is missing",      "palpate doctor") \
  VERB(completion, "set up",  "print the completion script of a shell: bash, zsh or fish",            "palpate completion bash > ~/.local/share/bash-completion/completions/palpate")

// clang-format on

namespace verbs {
#define PALPATE_DECLARE_VERB(name, group, summary, example) SetUp name;
PALPATE_VERBS(PALPATE_DECLARE_VERB)
#undef PALPATE_DECLARE_VERB
}  // namespace verbs

struct Verb {
  const char* name;
  const char* group;
  const char* summary;
  const char* example;
  SetUp* set_up;
};

std::span<const Verb> verb_table();

/// The whole command line: global options and one subcommand a verb. Building it runs nothing. `chosen` becomes the Run of
/// the verb that was parsed; it stays empty when there was none.
void build_command_line(CLI::App& app, Session& session, Run& chosen);

}  // namespace palpate::cli
