// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace palpate::report {

/// palpate/report/template.html as it was when the library was built (cmake/PalpateTemplate.cmake embeds it).
std::string page_template();

}  // namespace palpate::report
