#include "pipeline/pack/cage_spool.h"

#include <algorithm>
#include <cstring>

namespace spillway::pipeline {
namespace {

constexpr size_t kBufferBytes = 1 << 20;

uint64_t aligned_down(uint64_t n) { return n / cache::kDirectAlignment * cache::kDirectAlignment; }
uint64_t aligned_up(uint64_t n) { return aligned_down(n + cache::kDirectAlignment - 1); }

// Calls body(array) for each array, in the order of the file.
template <class Cage, class Body>
void for_each_array(Cage& cage, const Body& body) {
  body(cage.positions), body(cage.first_corner), body(cage.indices), body(cage.uvs), body(cage.uv_indices);
  body(cage.sharp_edges), body(cage.sharp_vertices), body(cage.holes);
}

}  // namespace

Status CageSpool::append(SubdivisionCage cage, cache::Scratch& scratch) {
  if (!file_) {
    SPILLWAY_ASSIGN(file_, scratch.create_file("the cages of the scene", cache::IoPurpose::pack));
    buffer_ = Buffer<std::byte>(MemoryTag::pack, kBufferBytes);
  }
  SpooledCage spooled{};
  spooled.offset_bytes = flushed_bytes_ + buffered_, spooled.size_bytes = cage.size_bytes();
  for (const Float3 p : cage.positions) spooled.bounds.grow(p);
  size_t n = 0;
  Status written;
  for_each_array(cage, [&](auto& array) {
    spooled.item_counts[n++] = static_cast<uint32_t>(array.size());
    if (written) written = append_bytes(std::as_bytes(std::span(array)));
    array = {};
  });
  SPILLWAY_TRY(written);
  spooled.row = std::move(cage);
  cages_.push_back(std::move(spooled));
  return {};
}

Status CageSpool::append_bytes(std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const size_t now = std::min(bytes.size(), buffer_.size() - buffered_);
    std::memcpy(buffer_.data() + buffered_, bytes.data(), now);
    buffered_ += now, bytes = bytes.subspan(now);
    if (buffered_ == buffer_.size()) SPILLWAY_TRY(flush());
  }
  return {};
}

Status CageSpool::flush() {
  const size_t padded = aligned_up(buffered_);
  if (padded == 0) return {};
  std::memset(buffer_.data() + buffered_, 0, padded - buffered_);
  SPILLWAY_TRY(file_->write(flushed_bytes_, std::span<const std::byte>(buffer_.data(), padded)));
  flushed_bytes_ += padded, buffered_ = 0;
  return {};
}

Status CageSpool::seal() {
  if (file_) SPILLWAY_TRY(flush());
  buffer_ = {};
  return {};
}

Result<SubdivisionCage> CageSpool::read(const SpooledCage& spooled) const {
  const uint64_t begin = aligned_down(spooled.offset_bytes), end = aligned_up(spooled.offset_bytes + spooled.size_bytes);
  Buffer<std::byte> bytes(MemoryTag::pack, end - begin);
  SPILLWAY_TRY(file_->read(begin, std::span<std::byte>(bytes.data(), bytes.size())));
  SubdivisionCage cage = spooled.row;
  const std::byte* from = bytes.data() + (spooled.offset_bytes - begin);
  size_t n = 0;
  for_each_array(cage, [&](auto& array) {
    array.resize(spooled.item_counts[n++]);
    const size_t size = array.size() * sizeof(array[0]);
    if (size > 0) std::memcpy(array.data(), from, size);
    from += size;
  });
  return cage;
}

}  // namespace spillway::pipeline
