// SPDX-License-Identifier: Apache-2.0
#include <palpate/core/error.hpp>
#include <palpate/core/identification.hpp>
#include <palpate/core/version.hpp>
#include <string>

int main() {
  try {
    throw palpate::Error("cure", "file");
  } catch (const palpate::Error& error) {
    const palpate::Identification untouched;
    return error.where() == "file" && untouched.termination == palpate::Termination::failed &&
                   std::string(palpate::version) == "0.1.0"
               ? 0
               : 1;
  }
}
