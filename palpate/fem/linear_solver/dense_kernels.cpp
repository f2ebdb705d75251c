// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/linear_solver/dense_kernels.hpp"

#if defined(__x86_64__) && defined(__GNUC__)
#define PALPATE_X86 1
#endif

namespace palpate::fem {
namespace {

namespace baseline {
#define PALPATE_TARGET
constexpr const char* kName = "128 bit";
constexpr int kVectorBytes = 16, kStripVectors = 2, kPanelRows = 4;
#include "palpate/fem/linear_solver/dense_kernels_body.hpp"
#undef PALPATE_TARGET
}  // namespace baseline

#ifdef PALPATE_X86
namespace avx2 {
#define PALPATE_TARGET __attribute__((target("avx2,fma")))
constexpr const char* kName = "AVX2";
constexpr int kVectorBytes = 32, kStripVectors = 3, kPanelRows = 4;
#include "palpate/fem/linear_solver/dense_kernels_body.hpp"
#undef PALPATE_TARGET
}  // namespace avx2

namespace avx512 {
#define PALPATE_TARGET __attribute__((target("avx512f,avx512vl,avx512dq,avx2,fma,prefer-vector-width=512")))
constexpr const char* kName = "AVX-512";
constexpr int kVectorBytes = 64, kStripVectors = 2, kPanelRows = 8;
#include "palpate/fem/linear_solver/dense_kernels_body.hpp"
#undef PALPATE_TARGET
}  // namespace avx512
#endif

}  // namespace

template <class T>
std::vector<const DenseKernels<T>*> runnable_dense_kernels() {
  std::vector<const DenseKernels<T>*> variants;
#ifdef PALPATE_X86
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512dq")) {
    variants.push_back(&avx512::kernels<T>());
  }
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) variants.push_back(&avx2::kernels<T>());
#endif
  variants.push_back(&baseline::kernels<T>());
  return variants;
}

template <class T>
const DenseKernels<T>& dense_kernels() {
  static const DenseKernels<T>& chosen = *runnable_dense_kernels<T>().front();
  return chosen;
}

template std::vector<const DenseKernels<double>*> runnable_dense_kernels<double>();
template std::vector<const DenseKernels<float>*> runnable_dense_kernels<float>();
template const DenseKernels<double>& dense_kernels<double>();
template const DenseKernels<float>& dense_kernels<float>();

}  // namespace palpate::fem
