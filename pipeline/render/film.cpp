#include "pipeline/render/film.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <limits>

#include "cache/base/check.h"
#include "cache/base/hash.h"
#include "cache/base/ids.h"
#include "cache/base/parallel.h"

namespace spillway::pipeline {
namespace {

// 2^-24 is a quarter of the step of a half float just above 2^-12: far below what a picture shows.
constexpr int kFractionBits = 24;
// A splat below 2^60 units cannot carry a sum from below 2^62 past 2^63: every sum that leaves the range is seen.
constexpr double kLargestSplat = 0x1p60;
constexpr int64_t kLargestSum = int64_t{1} << 62;
// Sums of normals and albedos: 1.5 * 2^14 units * kMaxHalfSamples stays below 2^31.
constexpr double kUnitsPerUnitVector = 0x1p14;
constexpr double kLargestUnitComponent = 1.5;
static_assert(kLargestUnitComponent * kUnitsPerUnitVector * kMaxHalfSamples < 0x1p31);

// Rounding keys of first-hit values lie apart from those of all events.
constexpr uint64_t kDepthKey = uint64_t{1} << 40;
constexpr uint64_t kNormalKey = kDepthKey + 4;
constexpr uint64_t kAlbedoKey = kDepthKey + 8;

constexpr size_t kBlockRecords = 4096;
constexpr int32_t kLargestScaleExponent = 64;

constexpr size_t kNotFinite = 0, kOutOfRange = 1, kFirstFault = 2;

uint64_t path_key(uint32_t sink, uint32_t sample) { return mix64(uint64_t{sink} << 32 | sample); }

// One of the two neighbouring integers; the mean over keys is `units`.
int64_t round_by_key(double units, uint64_t path, uint64_t channel) {
  const double below = std::floor(units);
  const double u = static_cast<double>(hash_combine(path, channel) >> 11) * 0x1p-53;
  return static_cast<int64_t>(below) + (u < units - below ? 1 : 0);
}

template <class T>
T add_relaxed(T& sum, T value) {
  return std::atomic_ref<T>(sum).fetch_add(value, std::memory_order_relaxed);
}

// Wraps, as atomic additions do: sums that left the range were counted as faults, and must not be undefined besides.
template <class T>
T wrapped_sum(T a, T b) {
  using Unsigned = std::make_unsigned_t<T>;
  return static_cast<T>(static_cast<Unsigned>(a) + static_cast<Unsigned>(b));
}

// False when the sum leaves the range.
bool add_checked(int64_t& sum, int64_t value) {
  const int64_t after = wrapped_sum(add_relaxed(sum, value), value);
  return after <= kLargestSum && after >= -kLargestSum;
}

void count_fault(std::array<uint64_t, 3>& faults, size_t kind, uint32_t sink, uint32_t sample) {
  add_relaxed(faults[kind], uint64_t{1});
  const uint64_t place = uint64_t{sink} << 32 | sample;
  std::atomic_ref<uint64_t> first(faults[kFirstFault]);
  uint64_t seen = first.load(std::memory_order_relaxed);
  while (place < seen && !first.compare_exchange_weak(seen, place, std::memory_order_relaxed)) {
  }
}

bool unit_sized(float x) { return std::fabs(x) <= kLargestUnitComponent; }
bool unit_sized(Float3 v) { return unit_sized(v.x) && unit_sized(v.y) && unit_sized(v.z); }
Float3 as_float3(Rgb c) { return {c.r, c.g, c.b}; }

void add_unit_vector(int32_t* sums, Float3 v, uint64_t path, uint64_t key) {
  for (int c = 0; c < 3; ++c)
    add_relaxed(sums[c], static_cast<int32_t>(round_by_key(double{v[c]} * kUnitsPerUnitVector, path, key + c)));
}

uint32_t sample_count(std::span<const SampleRange> ranges) {
  uint32_t count = 0;
  for (const SampleRange& r : ranges) count += r.end - r.first;
  return count;
}

// Adds a range, keeps the list ascending and joins what touches.
Status insert_range(std::vector<SampleRange>& ranges, SampleRange range, int half) {
  if (range.first >= range.end || range.end > kMaxHalfSamples)
    return error("samples [{}, {}) of half {} are no valid range; a half holds at most {} samples", range.first,
                 range.end, "AB"[half], kMaxHalfSamples);
  const auto after = std::find_if(ranges.begin(), ranges.end(), [&](SampleRange r) { return r.end > range.first; });
  if (after != ranges.end() && after->first < range.end)
    return error("samples [{}, {}) of half {} would be counted twice; merge films of different samples",
                 std::max(after->first, range.first), std::min(after->end, range.end), "AB"[half]);
  ranges.insert(after, range);
  std::vector<SampleRange> joined;
  for (const SampleRange& r : ranges)
    if (!joined.empty() && joined.back().end == r.first)
      joined.back().end = r.end;
    else
      joined.push_back(r);
  ranges = std::move(joined);
  return {};
}

template <class T>
void add_all(Buffer<T>& into, std::span<const T> from) {
  parallel_blocks(into.size(), 1 << 16, [&](size_t, size_t first, size_t last) {
    for (size_t i = first; i < last; ++i) into[i] = wrapped_sum(into[i], from[i]);
  });
}

float mean(int64_t sum, double unit, uint32_t count) {
  return count == 0 ? 0.0f : static_cast<float>(static_cast<double>(sum) * unit / count);
}

}  // namespace

// ---- the accumulators ----

Status check_shape(const FilmShape& shape) {
  const FilmWindow& w = shape.window;
  if (shape.full_width == 0 || shape.full_height == 0 ||
      uint64_t{shape.full_width} * shape.full_height > std::numeric_limits<uint32_t>::max())
    return error("the film's size {} x {} is not possible; it must have 1 to 2^32 - 1 pixels", shape.full_width,
                 shape.full_height);
  if (w.x0 >= w.x1 || w.y0 >= w.y1 || w.x1 > shape.full_width || w.y1 > shape.full_height)
    return error("the crop window [{}, {}) x [{}, {}) is empty or leaves the image of {} x {} pixels", w.x0, w.x1, w.y0,
                 w.y1, shape.full_width, shape.full_height);
  if (shape.layers & ~kAllLayers) return error("the film's layers {:#x} are unknown to this program", shape.layers);
  if (std::abs(int64_t{shape.scale_exponent}) > kLargestScaleExponent)
    return error("the film's scale 2^{} is not possible; the exponent must be in [-{}, {}]", shape.scale_exponent,
                 kLargestScaleExponent, kLargestScaleExponent);
  return {};
}

Result<Film> Film::create(const FilmShape& shape, FilmIdentity identity) {
  SPILLWAY_TRY(check_shape(shape));
  return Film(shape, std::move(identity));
}

Film::Film(const FilmShape& shape, FilmIdentity identity)
    : shape_(shape),
      identity_(std::move(identity)),
      units_per_value_(std::ldexp(1.0, kFractionBits - shape.scale_exponent)) {
  const size_t pixels = shape.pixel_count();
  const auto size = [&](uint32_t layer, size_t channels) { return shape.layers & layer ? pixels * channels : 0; };
  for (Half& half : halves_) {
    half.beauty = Buffer<int64_t>(MemoryTag::film, 3 * pixels);
    half.depth = Buffer<int64_t>(MemoryTag::film, size(kLayerDepth, 1));
    half.depth_hits = Buffer<uint32_t>(MemoryTag::film, size(kLayerDepth, 1));
    half.normal = Buffer<int32_t>(MemoryTag::film, size(kLayerNormal, 3));
    half.albedo = Buffer<int32_t>(MemoryTag::film, size(kLayerAlbedo, 3));
  }
  ids_ = Buffer<uint32_t>(MemoryTag::film, size(kLayerIds, 3));
  std::fill(ids_.begin(), ids_.end(), MeshId::kNone);
}

uint64_t Film::bytes(const FilmShape& shape) {
  const auto cost = [&](uint32_t layer, uint64_t bytes) { return shape.layers & layer ? bytes : 0; };
  const uint64_t half = 3 * sizeof(int64_t) + cost(kLayerDepth, sizeof(int64_t) + sizeof(uint32_t)) +
                        cost(kLayerNormal, 3 * sizeof(int32_t)) + cost(kLayerAlbedo, 3 * sizeof(int32_t));
  return shape.pixel_count() * (2 * half + cost(kLayerIds, 3 * sizeof(uint32_t)));
}

size_t Film::pixel_index(uint32_t x, uint32_t y) const {
  const FilmWindow& w = shape_.window;
  SPILLWAY_CHECK(x >= w.x0 && x < w.x1 && y >= w.y0 && y < w.y1, ==, true);
  return size_t{y - w.y0} * w.width() + (x - w.x0);
}

size_t Film::pixel_index(uint32_t sink) const {
  return pixel_index(sink % shape_.full_width, sink / shape_.full_width);
}

void Film::add(std::span<const SplatRecord> splats) {
  if (splats.empty()) return;
  parallel_blocks(splats.size(), kBlockRecords, [&](size_t, size_t first, size_t last) {
    for (size_t i = first; i < last; ++i) add_splat(splats[i]);
  });
}

void Film::add_splat(const SplatRecord& splat) {
  Half& half = halves_[splat.sample & 1];
  const size_t pixel = pixel_index(splat.sink);
  if (!is_finite(splat.value)) return count_fault(half.faults, kNotFinite, splat.sink, splat.sample);
  const double units[3] = {splat.value.r * units_per_value_, splat.value.g * units_per_value_,
                           splat.value.b * units_per_value_};
  for (const double u : units)
    if (!(std::fabs(u) < kLargestSplat)) return count_fault(half.faults, kOutOfRange, splat.sink, splat.sample);
  const uint64_t path = path_key(splat.sink, splat.sample);
  bool in_range = true;
  for (uint64_t c = 0; c < 3; ++c)
    in_range &= add_checked(half.beauty[3 * pixel + c], round_by_key(units[c], path, 4 * uint64_t{splat.event} + c));
  if (!in_range) count_fault(half.faults, kOutOfRange, splat.sink, splat.sample);
}

void Film::add_aovs(std::span<const AovRecord> aovs) {
  if (aovs.empty() || shape_.layers == 0) return;
  parallel_blocks(aovs.size(), kBlockRecords, [&](size_t, size_t first, size_t last) {
    for (size_t i = first; i < last; ++i) add_aov(aovs[i]);
  });
}

void Film::add_aov(const AovRecord& aov) {
  Half& half = halves_[aov.sample & 1];
  const size_t pixel = pixel_index(aov.sink);
  const auto fault = [&](size_t kind) { count_fault(half.faults, kind, aov.sink, aov.sample); };
  const bool hit = aov.depth < std::numeric_limits<float>::infinity();
  if (std::isnan(aov.depth) || !is_finite(aov.normal_world) || !is_finite(aov.albedo)) return fault(kNotFinite);
  const double depth_units = hit ? std::ldexp(double{aov.depth}, kFractionBits) : 0.0;
  if (!unit_sized(aov.normal_world) || !unit_sized(as_float3(aov.albedo)) || !(std::fabs(depth_units) < kLargestSplat))
    return fault(kOutOfRange);
  const uint64_t path = path_key(aov.sink, aov.sample);
  if ((shape_.layers & kLayerDepth) && hit) {
    add_relaxed(half.depth_hits[pixel], 1u);
    if (!add_checked(half.depth[pixel], round_by_key(depth_units, path, kDepthKey))) fault(kOutOfRange);
  }
  if (shape_.layers & kLayerNormal) add_unit_vector(&half.normal[3 * pixel], aov.normal_world, path, kNormalKey);
  if (shape_.layers & kLayerAlbedo) add_unit_vector(&half.albedo[3 * pixel], as_float3(aov.albedo), path, kAlbedoKey);
  if ((shape_.layers & kLayerIds) && aov.sample == 0) {
    const uint32_t ids[3] = {aov.mesh, aov.material, aov.instance};
    std::memcpy(&ids_[3 * pixel], ids, sizeof ids);
  }
}

// ---- samples, merging, identity ----

void Film::set_half_samples(int half, uint32_t count) {
  halves_[half].ranges.clear();
  if (count == 0) return;
  const Status added = add_half_samples(half, {0, count});
  SPILLWAY_CHECK(static_cast<bool>(added), ==, true);
}

Status Film::add_half_samples(int half, SampleRange range) { return insert_range(halves_[half].ranges, range, half); }

uint32_t Film::half_samples(int half) const { return sample_count(halves_[half].ranges); }

Film::HalfView Film::view(int half) const {
  const Half& h = halves_[half];
  HalfView v{h.beauty, h.depth, h.depth_hits, h.normal, h.albedo, {}, h.faults, h.ranges};
  if (half == 0) v.ids = ids_;
  return v;
}

Status Film::check_parts_of_one_image(const FilmShape& shape, const FilmIdentity& identity) const {
  const auto differs = [](const char* what, const auto& a, const auto& b) {
    return error("the films differ in {} ({} and {}): they are not parts of one image", what, a, b);
  };
  const FilmWindow &a = shape_.window, &b = shape.window;
  if (shape_.full_width != shape.full_width) return differs("image width", shape_.full_width, shape.full_width);
  if (shape_.full_height != shape.full_height) return differs("image height", shape_.full_height, shape.full_height);
  if (a != b)
    return differs("crop window", fmt::format("{},{},{},{}", a.x0, a.y0, a.x1, a.y1),
                   fmt::format("{},{},{},{}", b.x0, b.y0, b.x1, b.y1));
  if (shape_.layers != shape.layers) return differs("layers", shape_.layers, shape.layers);
  if (shape_.scale_exponent != shape.scale_exponent)
    return differs("scale exponent", shape_.scale_exponent, shape.scale_exponent);
  if (identity_.settings_key != identity.settings_key)
    return differs("scene or settings (key)", fmt::format("{:016x}", identity_.settings_key),
                   fmt::format("{:016x}", identity.settings_key));
  if (identity_.library_versions != identity.library_versions)
    return differs("library versions", identity_.library_versions, identity.library_versions);
  return {};
}

Status Film::check_half(int half, const HalfView& from) const {
  std::vector<SampleRange> ranges = halves_[half].ranges;
  for (const SampleRange& r : from.ranges) SPILLWAY_TRY(insert_range(ranges, r, half));
  if (sample_count(ranges) > kMaxHalfSamples)
    return error("half {} would hold {} samples; {} is the limit", "AB"[half], sample_count(ranges), kMaxHalfSamples);
  return {};
}

// Sums of films that were each in range may leave it together: counted like a splat that did.
void Film::merge_half(int half, const HalfView& from) {
  if (from.ranges.empty()) return;  // what it may hold belongs to an epoch that never closed
  Half& into = halves_[half];
  for (const SampleRange& r : from.ranges) {
    const Status added = insert_range(into.ranges, r, half);
    SPILLWAY_CHECK(static_cast<bool>(added), ==, true);
  }
  into.faults[kNotFinite] += from.faults[kNotFinite], into.faults[kOutOfRange] += from.faults[kOutOfRange];
  into.faults[kFirstFault] = std::min(into.faults[kFirstFault], from.faults[kFirstFault]);
  for (size_t i = 0; i < into.beauty.size(); ++i)
    if (!add_checked(into.beauty[i], from.beauty[i])) {
      const auto pixel = static_cast<uint32_t>(i / 3), width = shape_.window.width();
      const uint32_t x = shape_.window.x0 + pixel % width, y = shape_.window.y0 + pixel / width;
      count_fault(into.faults, kOutOfRange, y * shape_.full_width + x, 0);
    }
  add_all(into.depth, from.depth);
  add_all(into.depth_hits, from.depth_hits);
  add_all(into.normal, from.normal);
  add_all(into.albedo, from.albedo);
  if (half == 0)  // only one of them has sample 0; the other's ids are kNone, the largest value
    for (size_t i = 0; i < ids_.size(); ++i) ids_[i] = std::min(ids_[i], from.ids[i]);
}

Status Film::merge(const Film& other) {
  SPILLWAY_TRY(check_parts_of_one_image(other.shape_, other.identity_));
  for (int half = 0; half < 2; ++half) SPILLWAY_TRY(check_half(half, other.view(half)));
  for (int half = 0; half < 2; ++half) merge_half(half, other.view(half));
  return {};
}

double Film::lsb() const { return std::ldexp(1.0, shape_.scale_exponent - kFractionBits); }

FilmFaults Film::faults() const {
  const uint64_t first = std::min(halves_[0].faults[kFirstFault], halves_[1].faults[kFirstFault]);
  return {halves_[0].faults[kNotFinite] + halves_[1].faults[kNotFinite],
          halves_[0].faults[kOutOfRange] + halves_[1].faults[kOutOfRange], static_cast<uint32_t>(first >> 32),
          static_cast<uint32_t>(first)};
}

std::string Film::hash() const {
  static_assert(sizeof(FilmShape) == 32, "no padding: its bytes are hashed");
  uint64_t h = checksum(&shape_, sizeof shape_);
  for (int half = 0; half < 2; ++half) {
    const HalfView v = view(half);
    const uint64_t samples = half_samples(half);
    h = checksum(&samples, sizeof samples, h);
    h = checksum(v.beauty.data(), v.beauty.size_bytes(), h);
    h = checksum(v.depth.data(), v.depth.size_bytes(), h);
    h = checksum(v.depth_hits.data(), v.depth_hits.size_bytes(), h);
    h = checksum(v.normal.data(), v.normal.size_bytes(), h);
    h = checksum(v.albedo.data(), v.albedo.size_bytes(), h);
    h = checksum(v.ids.data(), v.ids.size_bytes(), h);
  }
  return fmt::format("{:016x}", h);
}

// ---- pixels ----

Rgb Film::pixel(uint32_t x, uint32_t y) const {
  const int64_t *a = &halves_[0].beauty[3 * pixel_index(x, y)], *b = &halves_[1].beauty[3 * pixel_index(x, y)];
  const auto channel = [&](int c) { return mean(wrapped_sum(a[c], b[c]), lsb(), samples()); };
  return {channel(0), channel(1), channel(2)};
}

Rgb Film::half_pixel(int half, uint32_t x, uint32_t y) const {
  const int64_t* sums = &halves_[half].beauty[3 * pixel_index(x, y)];
  const uint32_t n = half_samples(half);
  return {mean(sums[0], lsb(), n), mean(sums[1], lsb(), n), mean(sums[2], lsb(), n)};
}

float Film::depth(uint32_t x, uint32_t y) const {
  const size_t i = pixel_index(x, y);
  const uint32_t hits = halves_[0].depth_hits[i] + halves_[1].depth_hits[i];
  if (hits == 0) return std::numeric_limits<float>::infinity();
  return mean(wrapped_sum(halves_[0].depth[i], halves_[1].depth[i]), std::ldexp(1.0, -kFractionBits), hits);
}

Float3 Film::normal(uint32_t x, uint32_t y) const {
  Float3 n{};
  const size_t i = 3 * pixel_index(x, y);
  for (int c = 0; c < 3; ++c)
    n[c] = mean(int64_t{halves_[0].normal[i + c]} + halves_[1].normal[i + c], 1 / kUnitsPerUnitVector, samples());
  return n;
}

Rgb Film::albedo(uint32_t x, uint32_t y) const {
  Float3 a{};
  const size_t i = 3 * pixel_index(x, y);
  for (int c = 0; c < 3; ++c)
    a[c] = mean(int64_t{halves_[0].albedo[i + c]} + halves_[1].albedo[i + c], 1 / kUnitsPerUnitVector, samples());
  return {a.x, a.y, a.z};
}

PixelIds Film::ids(uint32_t x, uint32_t y) const {
  const size_t i = 3 * pixel_index(x, y);
  return {ids_[i], ids_[i + 1], ids_[i + 2]};
}

}  // namespace spillway::pipeline
