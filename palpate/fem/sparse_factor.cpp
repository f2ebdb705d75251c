// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/sparse_factor.hpp"

namespace palpate::fem {}
