#pragma once

// The film: sums of radiance and of first-hit values by pixel, in fixed point, in two halves.
//
// Owns: the accumulators of a window of the image. Half A takes the even samples, half B the odd ones; each half has
//       its own count of completed samples, and a pixel is (A + B) / (samples of A + samples of B).
// Memory: tag film, exactly Film::bytes(shape), all of it at construction.
// Threads: add and add_aovs from any number of threads at once; everything else while nobody adds.
// Order: integer additions commute, and rounding depends on the record alone: any order of records gives the same bits.
// Fails: a value that is not finite or does not fit is not added; it is counted and located in faults(), and a picture
//        with faults is not right: the program's exit code must say so.
// Bits: one unit of beauty is 2^(scale_exponent - 24); a value between two units is rounded up with the probability of
//       its fraction, by a hash of (sink, sample, event, channel): unbiased, so that dim scenes do not darken.

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "cache/base/memory.h"
#include "cache/base/result.h"
#include "cache/base/vec.h"
#include "pipeline/records.h"

namespace spillway::pipeline {

enum FilmLayer : uint32_t {
  kLayerDepth = 1,   // mean over the samples that hit; +infinity where none did
  kLayerNormal = 2,  // mean over all samples, a miss counts as zero: not unit length at edges
  kLayerAlbedo = 4,  // mean over all samples, a miss counts as zero
  kLayerIds = 8,     // mesh, material and instance of sample 0: an id is not averaged
};
inline constexpr uint32_t kAllLayers = 15;

// Pixels [x0, x1) x [y0, y1) of the full image.
struct FilmWindow {
  uint32_t x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  [[nodiscard]] uint32_t width() const { return x1 - x0; }
  [[nodiscard]] uint32_t height() const { return y1 - y0; }
  bool operator==(const FilmWindow&) const = default;
};

struct FilmShape {
  uint32_t full_width = 0, full_height = 0;
  FilmWindow window;
  uint32_t layers = 0;         // FilmLayer; beauty is always there
  int32_t scale_exponent = 0;  // larger: brighter values fit, dim ones carry more rounding noise
  bool operator==(const FilmShape&) const = default;
  [[nodiscard]] size_t pixel_count() const { return size_t{window.width()} * window.height(); }
};
// Fails when no film can have this shape: says what is wrong with it.
Status check_shape(const FilmShape& shape);

// What must be equal for two films to be parts of one image.
struct FilmIdentity {
  uint64_t settings_key = 0;     // hash of everything that determines the image; made by the caller
  std::string library_versions;  // libraries whose functions reach pixels
};

// Samples [first, end) of a half, counted within the half: sample number = 2 * index + half.
struct SampleRange {
  uint32_t first = 0, end = 0;
  bool operator==(const SampleRange&) const = default;
};

struct FilmFaults {
  uint64_t not_finite_count = 0;
  uint64_t out_of_range_count = 0;  // records that did not fit, and sums that left the range
  // The least (sink, sample) that was at fault; meaningful when any() is true.
  uint32_t sink = 0, sample = 0;
  [[nodiscard]] bool any() const { return not_finite_count + out_of_range_count > 0; }
};

struct PixelIds {
  uint32_t mesh, material, instance;
};

// Largest count of samples a half: keeps the 32-bit sums of normals and albedos in range (see film.cpp).
inline constexpr uint32_t kMaxHalfSamples = 65536;

class Film {
 public:
  static Result<Film> create(const FilmShape& shape, FilmIdentity identity);
  [[nodiscard]] static uint64_t bytes(const FilmShape& shape);

  void add(std::span<const SplatRecord> splats);
  void add_aovs(std::span<const AovRecord> aovs);  // records of layers that the film does not have are ignored

  // Declares what a half holds once its epoch has closed: the first `count` samples, or one more range of them.
  void set_half_samples(int half, uint32_t count);
  Status add_half_samples(int half, SampleRange range);  // fails when a sample would be counted twice
  [[nodiscard]] uint32_t half_samples(int half) const;
  [[nodiscard]] uint32_t samples() const { return half_samples(0) + half_samples(1); }
  [[nodiscard]] std::span<const SampleRange> half_ranges(int half) const { return halves_[half].ranges; }

  // Sums of other's samples are added to this film's; a half of it without completed samples is passed over. Fails,
  // changing nothing, when the two are not parts of one image or a sample is in both.
  Status merge(const Film& other);

  [[nodiscard]] const FilmShape& shape() const { return shape_; }
  [[nodiscard]] const FilmIdentity& identity() const { return identity_; }
  [[nodiscard]] double lsb() const;  // radiance of one unit
  [[nodiscard]] FilmFaults faults() const;
  // XXH3 of shape, sample counts and all sums, as 16 hex digits: equal for equal pictures, whatever made them.
  [[nodiscard]] std::string hash() const;

  // Of pixel (x, y) of the full image, inside the window. Zero when there are no samples.
  [[nodiscard]] Rgb pixel(uint32_t x, uint32_t y) const;
  [[nodiscard]] Rgb half_pixel(int half, uint32_t x, uint32_t y) const;
  [[nodiscard]] float depth(uint32_t x, uint32_t y) const;
  [[nodiscard]] Float3 normal(uint32_t x, uint32_t y) const;
  [[nodiscard]] Rgb albedo(uint32_t x, uint32_t y) const;
  [[nodiscard]] PixelIds ids(uint32_t x, uint32_t y) const;

 private:
  struct Half {
    Buffer<int64_t> beauty;                            // 3 a pixel
    Buffer<int64_t> depth;                             // 1
    Buffer<uint32_t> depth_hits;                       // 1
    Buffer<int32_t> normal;                            // 3
    Buffer<int32_t> albedo;                            // 3
    std::array<uint64_t, 3> faults{0, 0, UINT64_MAX};  // not finite, out of range, least (sink << 32 | sample)
    std::vector<SampleRange> ranges;                   // ascending, disjoint, not touching
  };

  // A half's arrays, of a film or as they lie in a file. The ids are half A's: sample 0 is in it.
  struct HalfView {
    std::span<const int64_t> beauty, depth;
    std::span<const uint32_t> depth_hits;
    std::span<const int32_t> normal, albedo;
    std::span<const uint32_t> ids;
    std::span<const uint64_t> faults;
    std::span<const SampleRange> ranges;
  };
  friend struct FilmFile;

  Film(const FilmShape& shape, FilmIdentity identity);
  [[nodiscard]] size_t pixel_index(uint32_t sink) const;
  [[nodiscard]] size_t pixel_index(uint32_t x, uint32_t y) const;
  void add_splat(const SplatRecord& splat);
  void add_aov(const AovRecord& aov);
  Status check_half(int half, const HalfView& from) const;
  Status check_parts_of_one_image(const FilmShape& shape, const FilmIdentity& identity) const;
  void merge_half(int half, const HalfView& from);
  [[nodiscard]] HalfView view(int half) const;

  FilmShape shape_;
  FilmIdentity identity_;
  double units_per_value_ = 0;
  std::array<Half, 2> halves_;
  Buffer<uint32_t> ids_;  // 3 a pixel
};

}  // namespace spillway::pipeline
