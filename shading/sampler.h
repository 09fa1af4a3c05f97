#pragma once

// Random numbers as pure functions of keys: Owen-scrambled Sobol' pairs, padded over dimensions, and plain hashes where
// the count is unbounded. No state.
// Based on: Burley 2020, Practical Hash-based Owen Scrambling (nested uniform scramble, shuffled padding).

#include <cstdint>

#include "cache/base/vec.h"

namespace spillway::shading {

// Streams keep unrelated uses apart (camera paths now; light paths, baking later).
enum class SampleStream : uint32_t { camera_paths = 0, decisions = 1, media = 2 };

enum class SamplerKind : uint32_t { sobol, independent };  // independent: to measure the other by

// Samples of a sink are split over two halves with independent scrambles: half = sample & 1, index in it = sample >> 1,
// so that the halves estimate the error (and every even sample count fills both equally).
struct SampleKey {
  uint32_t sink;
  uint32_t sample;
  uint32_t seed;
  SamplerKind kind = SamplerKind::sobol;
};

// Dimension slots: each slot is one 2D point of its own.
enum SampleSlot : uint32_t {
  kSlotFilm = 0,
  kSlotLens = 1,
  kSlotTime = 2,
  kSlotFirstBounce = 4,
};
enum BounceSlot : uint32_t { kBounceLight = 0, kBounceLightSelect = 1, kBounceBsdf = 2, kBounceLobeAndRoulette = 3, kSlotsPerBounce = 4 };
constexpr uint32_t bounce_slot(uint32_t bounce, BounceSlot slot) {
  return kSlotFirstBounce + bounce * kSlotsPerBounce + slot;
}

// A point in [0,1)^2 of the given slot.
[[nodiscard]] Float2 sample_2d(SampleKey key, uint32_t slot);

// The points of a vertex, all of its slots at once: the bits of sample_2d() in a third of its time.
struct BouncePoints {
  Float2 at[kSlotsPerBounce];
  Float2 operator[](BounceSlot slot) const { return at[slot]; }
};
[[nodiscard]] BouncePoints sample_bounce(SampleKey key, uint32_t bounce);

// Hashed, uniform in [0, 1): for decisions whose number or order is not fixed (alpha, mix, rounding).
[[nodiscard]] float hashed_1d(SampleKey key, SampleStream stream, uint32_t a, uint32_t b, uint32_t c);

}  // namespace spillway::shading
