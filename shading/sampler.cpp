#include "shading/sampler.h"

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

Float2 independent_2d(SampleKey key, uint32_t slot) {
  const uint64_t h = hash_combine(hash_combine(uint64_t{key.seed} << 32 | slot, uint64_t{key.sink} << 32 | key.sample),
                                  uint64_t{1} << 33);
  return {unit_float(static_cast<uint32_t>(h >> 32)), unit_float(static_cast<uint32_t>(h))};
}

}  // namespace

Float2 sample_2d(SampleKey key, uint32_t slot) {
  if (key.kind == SamplerKind::independent) return independent_2d(key, slot);
  const uint64_t half = key.sample & 1;
  const uint64_t scramble =
      hash_combine(hash_combine(uint64_t{key.seed} << 1 | half, key.sink), (uint64_t{1} << 32) | slot);
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
