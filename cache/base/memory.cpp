#include "cache/base/memory.h"

#include <sys/mman.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>

#include "cache/base/check.h"

namespace spillway {
namespace {

struct Counter {
  std::atomic<uint64_t> current{0};
  std::atomic<uint64_t> peak{0};

  void add(uint64_t bytes) {
    const uint64_t now = current.fetch_add(bytes) + bytes;
    uint64_t seen = peak.load();
    while (seen < now && !peak.compare_exchange_weak(seen, now)) {
    }
  }
};

std::array<Counter, kMemoryTagCount> counters;
Counter total;

constexpr size_t kLargePage = 2 << 20;
size_t whole_system_pages(size_t size_bytes) { return (size_bytes + 4095) / 4096 * 4096; }

Counter& counter(MemoryTag tag) { return counters[static_cast<size_t>(tag)]; }
MemoryUse use(const Counter& c) { return {c.current.load(), c.peak.load()}; }

}  // namespace

const char* name(MemoryTag tag) {
  static constexpr const char* kNames[kMemoryTagCount] = {"scene", "page_tree", "pages", "attributes",
                                                          "textures", "volumes", "rays", "paths", "hits",
                                                          "film", "streams", "lights", "trace_log", "pack"};
  return kNames[static_cast<size_t>(tag)];
}

void memory_claim(MemoryTag tag, uint64_t bytes) {
  counter(tag).add(bytes);
  total.add(bytes);
}

void memory_release(MemoryTag tag, uint64_t bytes) {
  const uint64_t held = counter(tag).current.fetch_sub(bytes);
  SPILLWAY_CHECK(held, >=, bytes);
  total.current.fetch_sub(bytes);
}

MemoryUse memory_use(MemoryTag tag) { return use(counter(tag)); }
MemoryUse memory_total() { return use(total); }

void memory_reset_peaks() {
  for (Counter& c : counters) c.peak = c.current.load();
  total.peak = total.current.load();
}

ResidentMemory resident_memory() {
  ResidentMemory result;
  std::ifstream status("/proc/self/status");
  std::string line;
  while (std::getline(status, line)) {
    unsigned long long kib = 0;
    if (std::sscanf(line.c_str(), "VmRSS: %llu kB", &kib) == 1) result.current_bytes = kib << 10;
    if (std::sscanf(line.c_str(), "VmHWM: %llu kB", &kib) == 1) result.peak_bytes = kib << 10;
  }
  return result;
}

[[noreturn]] static void give_up(size_t size_bytes) {
  fmt::print(stderr, "spillway: the system refused {} bytes of memory\n", size_bytes);
  std::abort();
}

void* allocate_pages(size_t size_bytes) {
  // What can hold a large page of the processor begins at one: geometry, textures and film are met at random, and each
  // small page of theirs has to be searched for (1 to 2 % of a render of `bathroom`).
  const size_t slack = size_bytes >= kLargePage ? kLargePage : 0;
  void* mapped = mmap(nullptr, size_bytes + slack, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (mapped == MAP_FAILED) give_up(size_bytes);
  if (slack == 0) return mapped;
  const size_t size = whole_system_pages(size_bytes);
  const auto begin = reinterpret_cast<uintptr_t>(mapped);
  const uintptr_t aligned = (begin + slack - 1) / slack * slack;
  if (aligned > begin) munmap(mapped, aligned - begin);
  const uintptr_t end = begin + whole_system_pages(size_bytes + slack);
  if (end > aligned + size) munmap(reinterpret_cast<void*>(aligned + size), end - (aligned + size));
  void* pages = reinterpret_cast<void*>(aligned);
  madvise(pages, size, MADV_HUGEPAGE);
  return pages;
}

void* grow_pages(void* pages, size_t size_bytes, size_t more_bytes) {
  // To a place that begins at a large page where it can hold one: large pages then move as they are.
  void* const place = allocate_pages(more_bytes);
  const int flags = MREMAP_MAYMOVE | MREMAP_FIXED;
  void* const moved = mremap(pages, whole_system_pages(size_bytes), whole_system_pages(more_bytes), flags, place);
  if (moved == MAP_FAILED) give_up(more_bytes);
  if (more_bytes >= kLargePage) madvise(moved, whole_system_pages(more_bytes), MADV_HUGEPAGE);
  return moved;
}

void free_pages(void* pages, size_t size_bytes) { munmap(pages, size_bytes); }

}  // namespace spillway
