// SPDX-License-Identifier: Apache-2.0
// Inside of ClosestSearch: four floats at once, in the vectors that GCC and Clang know, and what these lack.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#ifdef __SSE2__
#include <emmintrin.h>
#endif

namespace palpate::geometry::lanes {

typedef float Floats __attribute__((vector_size(16)));

inline Floats all(float value) { return Floats{value, value, value, value}; }

inline Floats smaller(Floats a, Floats b) {
#ifdef __SSE2__
  return _mm_min_ps(a, b);
#else
  return a < b ? a : b;
#endif
}

inline Floats larger(Floats a, Floats b) {
#ifdef __SSE2__
  return _mm_max_ps(a, b);
#else
  return a > b ? a : b;
#endif
}

inline float smallest(Floats a) {
  const Floats two = smaller(a, Floats{a[2], a[3], a[0], a[1]});
  return two[0] < two[1] ? two[0] : two[1];
}

inline void unpack(const std::uint8_t* eight, Floats& first, Floats& last) {
#ifdef __SSE2__
  const __m128i zero = _mm_setzero_si128();
  const __m128i words = _mm_unpacklo_epi8(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(eight)), zero);
  first = _mm_cvtepi32_ps(_mm_unpacklo_epi16(words, zero));
  last = _mm_cvtepi32_ps(_mm_unpackhi_epi16(words, zero));
#else
  for (int i = 0; i < 4; ++i) first[i] = eight[i], last[i] = eight[i + 4];
#endif
}

inline Floats unpack(const std::uint16_t* four) {
#ifdef __SSE2__
  const __m128i words = _mm_loadl_epi64(reinterpret_cast<const __m128i*>(four));
  return _mm_cvtepi32_ps(_mm_unpacklo_epi16(words, _mm_setzero_si128()));
#else
  return Floats{float(four[0]), float(four[1]), float(four[2]), float(four[3])};
#endif
}

/// Bit i: a[i] > limit. False where a number is none.
inline unsigned above(Floats a, float limit) {
#ifdef __SSE2__
  return static_cast<unsigned>(_mm_movemask_ps(_mm_cmpgt_ps(a, all(limit))));
#else
  unsigned bits = 0;
  for (int i = 0; i < 4; ++i) bits |= static_cast<unsigned>(a[i] > limit) << i;
  return bits;
#endif
}

/// Which of eight numbers that are not negative is the smallest, to a millionth.
inline int where_smallest(Floats first, Floats last) {
#ifdef __SSE2__
  // Floats that are not negative are ordered as their bits are; the last three bits make room for the number's place.
  const __m128 but_three = _mm_castsi128_ps(_mm_set1_epi32(~7));
  const __m128 a = _mm_or_ps(_mm_and_ps(first, but_three), _mm_castsi128_ps(_mm_setr_epi32(0, 1, 2, 3)));
  const __m128 b = _mm_or_ps(_mm_and_ps(last, but_three), _mm_castsi128_ps(_mm_setr_epi32(4, 5, 6, 7)));
  const __m128 four = _mm_min_ps(a, b), two = _mm_min_ps(four, _mm_shuffle_ps(four, four, 0x4e));
  return _mm_cvtsi128_si32(_mm_castps_si128(_mm_min_ps(two, _mm_shuffle_ps(two, two, 0xb1)))) & 7;
#else
  int at = 0;
  for (int i = 1; i < 8; ++i)
    if ((i < 4 ? first[i] : last[i - 4]) < (at < 4 ? first[at] : last[at - 4])) at = i;
  return at;
#endif
}

/// Asks the cache for 72 to 128 bytes that are soon read.
inline void fetch(const void* what) {
  __builtin_prefetch(what);
  __builtin_prefetch(static_cast<const char*>(what) + 64);
}

}  // namespace palpate::geometry::lanes
