#pragma once

// The process's memory by owner. Every allocation of size is made through Buffer, or declared with MemoryClaim when a
// library makes it; what the process holds beyond the sum of the tags and the floor is reported as untagged.

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>
#include <utility>

namespace spillway {

enum class MemoryTag : uint8_t {
  scene,       // tables of the store: meshes, materials, instances, directories
  page_tree,   // tree over pages and instances
  pages,       // trace parts, resident or in flight
  attributes,  // attribute blocks, resident or in flight
  textures,    // the tile cache, and what its library holds beside it
  volumes,     // bricks, resident or in flight, and runs of segments through them
  rays,        // trace columns, results and orders of a wave
  paths,       // cold path and shadow records
  hits,        // hit records and their sort
  film,        // accumulators
  streams,     // I/O buffers of spilled streams
  lights,      // light table
  trace_log,   // events of a timeline, when one is asked for
  pack,        // everything at pack time
  count
};
inline constexpr int kMemoryTagCount = static_cast<int>(MemoryTag::count);
[[nodiscard]] const char* name(MemoryTag tag);

struct MemoryUse {
  uint64_t current_bytes = 0;
  uint64_t peak_bytes = 0;
};

void memory_claim(MemoryTag tag, uint64_t bytes);
void memory_release(MemoryTag tag, uint64_t bytes);
[[nodiscard]] MemoryUse memory_use(MemoryTag tag);
[[nodiscard]] MemoryUse memory_total();
void memory_reset_peaks();

// Resident set of this process from /proc/self/status: now (VmRSS) and at its highest (VmHWM).
struct ResidentMemory {
  uint64_t current_bytes = 0;
  uint64_t peak_bytes = 0;
};
[[nodiscard]] ResidentMemory resident_memory();

// Page-aligned memory straight from the system: what is freed leaves the resident set at once. Zeroed.
[[nodiscard]] void* allocate_pages(size_t size_bytes);
// The same memory and more, perhaps elsewhere: nothing is copied, what is new is zero.
[[nodiscard]] void* grow_pages(void* pages, size_t size_bytes, size_t more_bytes);
void free_pages(void* pages, size_t size_bytes);

// An array of trivially copyable items, zero at birth, 4096-aligned, counted under its tag. Moves, does not copy.
template <class T>
class Buffer {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  Buffer() = default;
  Buffer(MemoryTag tag, size_t size) : tag_(tag), size_(size), capacity_(size) { allocate(); }
  Buffer(Buffer&& other) noexcept { swap(other); }
  Buffer& operator=(Buffer&& other) noexcept {
    Buffer taken(std::move(other));
    swap(taken);
    return *this;
  }
  ~Buffer() { release(); }

  [[nodiscard]] size_t size() const { return size_; }
  [[nodiscard]] size_t capacity() const { return capacity_; }
  [[nodiscard]] size_t size_bytes() const { return size_ * sizeof(T); }
  [[nodiscard]] bool empty() const { return size_ == 0; }
  T* data() { return data_; }
  const T* data() const { return data_; }
  T* begin() { return data_; }
  T* end() { return data_ + size_; }
  const T* begin() const { return data_; }
  const T* end() const { return data_ + size_; }
  T& operator[](size_t i) { return data_[i]; }
  const T& operator[](size_t i) const { return data_[i]; }
  operator std::span<T>() { return {data_, size_}; }
  operator std::span<const T>() const { return {data_, size_}; }

  // The count of items in use, within the capacity.
  void set_size(size_t size) { size_ = size; }
  // Room for `capacity` items, in use or not; those it has stay. Memory that was touched is not made zero again, which
  // costs as much as writing it.
  void grow(MemoryTag tag, size_t capacity) {
    if (capacity <= capacity_) return;
    if (data_ == nullptr) {
      *this = Buffer(tag, capacity);
      return;
    }
    data_ = static_cast<T*>(grow_pages(data_, capacity_ * sizeof(T), capacity * sizeof(T)));
    memory_claim(tag_, (capacity - capacity_) * sizeof(T));
    capacity_ = size_ = capacity;
  }
  void swap(Buffer& other) noexcept {
    std::swap(tag_, other.tag_), std::swap(size_, other.size_);
    std::swap(capacity_, other.capacity_), std::swap(data_, other.data_);
  }

 private:
  void allocate() {
    if (capacity_ == 0) return;
    data_ = static_cast<T*>(allocate_pages(capacity_ * sizeof(T)));
    memory_claim(tag_, capacity_ * sizeof(T));
  }
  void release() {
    if (data_ == nullptr) return;
    free_pages(data_, capacity_ * sizeof(T));
    memory_release(tag_, capacity_ * sizeof(T));
  }

  MemoryTag tag_ = MemoryTag::scene;
  size_t size_ = 0;
  size_t capacity_ = 0;
  T* data_ = nullptr;
};

// Declares memory that somebody else allocates, for as long as the claim lives.
class MemoryClaim {
 public:
  MemoryClaim() = default;
  MemoryClaim(MemoryTag tag, uint64_t bytes) : tag_(tag), bytes_(bytes) { memory_claim(tag_, bytes_); }
  MemoryClaim(MemoryClaim&& other) noexcept : tag_(other.tag_), bytes_(std::exchange(other.bytes_, 0)) {}
  MemoryClaim& operator=(MemoryClaim&& other) noexcept {
    std::swap(tag_, other.tag_), std::swap(bytes_, other.bytes_);
    return *this;
  }
  ~MemoryClaim() { memory_release(tag_, bytes_); }

 private:
  MemoryTag tag_ = MemoryTag::scene;
  uint64_t bytes_ = 0;
};

}  // namespace spillway
