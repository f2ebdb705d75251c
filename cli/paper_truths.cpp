// SPDX-License-Identifier: Apache-2.0
#include "cli/paper_truths.hpp"

#include <algorithm>

#include "palpate/core/error.hpp"
#include "palpate/io/file.hpp"
#include "palpate/io/npy.hpp"

namespace palpate::cli {

namespace fs = std::filesystem;

lab::PressedMemory::Store truths_in(const fs::path& folder) {
  const auto file_of = [folder](std::string name) {
    std::replace(name.begin(), name.end(), ' ', '_');
    return folder / (name + ".npy");
  };
  return {[=](const std::string& name) -> std::optional<MatrixX> {
            const fs::path file = file_of(name);
            if (!fs::exists(file)) return {};
            try {
              return io::parse_npy(io::read_file(file), file.string());
            } catch (const Error&) {
              return {};
            }
          },
          [=](const std::string& name, const MatrixX& states) {
            fs::create_directories(folder);
            io::write_file(file_of(name), io::npy_bytes(states, io::NpyType::float64));
          }};
}

}  // namespace palpate::cli
