#include "shading/sampler.h"

#include <immintrin.h>

#include "cache/base/hash.h"

namespace spillway::shading {
namespace {

uint64_t reverse_bits(uint64_t x) {
  x = __builtin_bswap64(x);  // then swap within bytes
  x = ((x & 0x0f0f0f0f0f0f0f0fu) << 4) | ((x >> 4) & 0x0f0f0f0f0f0f0f0fu);
  x = ((x & 0x3333333333333333u) << 2) | ((x >> 2) & 0x3333333333333333u);
  return ((x & 0x5555555555555555u) << 1) | ((x >> 1) & 0x5555555555555555u);
}
uint32_t reverse_bits(uint32_t x) { return static_cast<uint32_t>(reverse_bits(uint64_t{x}) >> 32); }

// Each bit is flipped by a hash of the bits below it: applied to reversed bits, an Owen scramble (Burley 2020, section 3;
// constants found by Vegdahl).
uint32_t laine_karras(uint32_t x, uint32_t seed) {
  x ^= x * 0x3d20adea;
  x += seed;
  x *= (seed >> 16) | 1;
  x ^= x * 0x05526c56;
  x ^= x * 0x53a22864;
  return x;
}

uint32_t nested_uniform_scramble(uint32_t x, uint32_t seed) {
  return reverse_bits(laine_karras(reverse_bits(x), seed));
}

// The second Sobol' dimension, bits reversed: multiplication by Pascal's triangle modulo two, in five steps.
uint32_t sobol_second_reversed(uint32_t index) {
  index ^= (index & 0xaaaaaaaau) >> 1;
  index ^= (index & 0xccccccccu) >> 2;
  index ^= (index & 0xf0f0f0f0u) >> 4;
  index ^= (index & 0xff00ff00u) >> 8;
  index ^= (index & 0xffff0000u) >> 16;
  return index;
}

// What all slots of a sink have in common, and what is a slot's own.
uint64_t sink_hash(SampleKey key) { return hash_combine(uint64_t{key.seed} << 1 | (key.sample & 1), key.sink); }
uint64_t slot_hash(uint64_t sink, uint32_t slot) { return hash_combine(sink, (uint64_t{1} << 32) | slot); }

// ---- the same, four slots side by side ----

// Eight lanes; bytes are turned by a table of nibbles, two in each.
__m256i reverse_bits(__m256i x) {
  const __m256i bytes = _mm256_set_epi8(12, 13, 14, 15, 8, 9, 10, 11, 4, 5, 6, 7, 0, 1, 2, 3, 12, 13, 14, 15, 8, 9, 10,
                                        11, 4, 5, 6, 7, 0, 1, 2, 3);
  const __m256i nibbles = _mm256_set_epi8(15, 7, 11, 3, 13, 5, 9, 1, 14, 6, 10, 2, 12, 4, 8, 0, 15, 7, 11, 3, 13, 5, 9,
                                          1, 14, 6, 10, 2, 12, 4, 8, 0);
  const __m256i low = _mm256_set1_epi8(0x0f);
  x = _mm256_shuffle_epi8(x, bytes);
  const __m256i high_turned = _mm256_shuffle_epi8(nibbles, _mm256_and_si256(_mm256_srli_epi16(x, 4), low));
  const __m256i low_turned = _mm256_shuffle_epi8(nibbles, _mm256_and_si256(x, low));
  return _mm256_or_si256(_mm256_slli_epi16(low_turned, 4), high_turned);
}

__m256i times(__m256i x, uint32_t factor) { return _mm256_mullo_epi32(x, _mm256_set1_epi32(static_cast<int>(factor))); }

__m256i laine_karras(__m256i x, __m256i seed) {
  x = _mm256_xor_si256(x, times(x, 0x3d20adea));
  x = _mm256_add_epi32(x, seed);
  x = _mm256_mullo_epi32(x, _mm256_or_si256(_mm256_srli_epi32(seed, 16), _mm256_set1_epi32(1)));
  x = _mm256_xor_si256(x, times(x, 0x05526c56));
  return _mm256_xor_si256(x, times(x, 0x53a22864));
}

__m128i sobol_second_reversed(__m128i index) {
  const auto step = [&](uint32_t mask, int shift) {
    index = _mm_xor_si128(index, _mm_srli_epi32(_mm_and_si128(index, _mm_set1_epi32(static_cast<int>(mask))), shift));
  };
  step(0xaaaaaaaa, 1), step(0xcccccccc, 2), step(0xf0f0f0f0, 4), step(0xff00ff00, 8), step(0xffff0000, 16);
  return index;
}

Float2 independent_2d(SampleKey key, uint32_t slot) {
  const uint64_t h = hash_combine(hash_combine(uint64_t{key.seed} << 32 | slot, uint64_t{key.sink} << 32 | key.sample),
                                  uint64_t{1} << 33);
  return {unit_float(static_cast<uint32_t>(h >> 32)), unit_float(static_cast<uint32_t>(h))};
}

BouncePoints one_by_one(SampleKey key, uint32_t bounce) {
  BouncePoints points;
  for (uint32_t s = 0; s < kSlotsPerBounce; ++s)
    points.at[s] = sample_2d(key, bounce_slot(bounce, static_cast<BounceSlot>(s)));
  return points;
}

}  // namespace

BouncePoints sample_bounce(SampleKey key, uint32_t bounce) {
  if (key.kind == SamplerKind::independent) return one_by_one(key, bounce);
  alignas(16) uint32_t shuffle[4];
  alignas(32) uint32_t xy_seed[8];
  const uint64_t sink = sink_hash(key);
  for (uint32_t s = 0; s < 4; ++s) {
    const uint64_t scramble = slot_hash(sink, bounce_slot(bounce, static_cast<BounceSlot>(s)));
    shuffle[s] = static_cast<uint32_t>(scramble);
    xy_seed[s] = static_cast<uint32_t>(scramble >> 32);
    xy_seed[4 + s] = static_cast<uint32_t>(mix64(scramble));
  }
  const __m256i seed = _mm256_castsi128_si256(_mm_load_si128(reinterpret_cast<const __m128i*>(shuffle)));
  const __m256i sample = _mm256_set1_epi32(static_cast<int>(reverse_bits(key.sample >> 1)));
  const __m128i index = _mm256_castsi256_si128(reverse_bits(laine_karras(sample, seed)));
  const __m256i both = _mm256_set_m128i(sobol_second_reversed(index), index);
  const __m256i bits =
      reverse_bits(laine_karras(both, _mm256_load_si256(reinterpret_cast<const __m256i*>(xy_seed))));
  const __m256 unit = _mm256_mul_ps(_mm256_cvtepi32_ps(_mm256_srli_epi32(bits, 8)), _mm256_set1_ps(0x1p-24f));
  const __m128 x = _mm256_castps256_ps128(unit), y = _mm256_extractf128_ps(unit, 1);
  BouncePoints points;
  static_assert(sizeof points == 32);
  _mm_storeu_ps(&points.at[0].x, _mm_unpacklo_ps(x, y));
  _mm_storeu_ps(&points.at[2].x, _mm_unpackhi_ps(x, y));
  return points;
}

Float2 sample_2d(SampleKey key, uint32_t slot) {
  if (key.kind == SamplerKind::independent) return independent_2d(key, slot);
  const uint64_t scramble = slot_hash(sink_hash(key), slot);
  const auto shuffle_seed = static_cast<uint32_t>(scramble);
  const auto x_seed = static_cast<uint32_t>(scramble >> 32);
  const auto y_seed = static_cast<uint32_t>(mix64(scramble));
  const uint32_t index = nested_uniform_scramble(key.sample >> 1, shuffle_seed);
  // Dimension one of index i is i with its bits reversed, so the scramble's first reversal cancels.
  const uint64_t reversed_x = laine_karras(index, x_seed), reversed_y = laine_karras(sobol_second_reversed(index), y_seed);
  const uint64_t both = reverse_bits(reversed_x | reversed_y << 32);
  return {unit_float(static_cast<uint32_t>(both >> 32)), unit_float(static_cast<uint32_t>(both))};
}

float hashed_1d(SampleKey key, SampleStream stream, uint32_t a, uint32_t b, uint32_t c) {
  uint64_t h = hash_combine(uint64_t{key.seed} << 32 | static_cast<uint32_t>(stream), uint64_t{key.sink} << 32 | key.sample);
  h = hash_combine(h, uint64_t{a} << 32 | b);
  return unit_float(static_cast<uint32_t>(hash_combine(h, c) >> 32));
}

}  // namespace spillway::shading
