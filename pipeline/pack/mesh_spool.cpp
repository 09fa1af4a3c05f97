#include "pipeline/pack/mesh_spool.h"

#include <algorithm>
#include <cstring>

namespace spillway::pipeline {
namespace {

constexpr size_t kBufferBytes = 4 << 20;  // large sequential writes; a chunk has about 0.2 to 0.6 MB
constexpr uint64_t kWindowBytes = 1 << 20;   // a direct read of 4 KiB costs about as much as one of 64
constexpr uint64_t kChunkAlignment = 16;

uint64_t direct_aligned(uint64_t n) {
  return (n + cache::kDirectAlignment - 1) / cache::kDirectAlignment * cache::kDirectAlignment;
}

uint64_t chunk_bytes(const MeshChunk& chunk, bool everything) {
  const uint64_t vertices = chunk.vertex_count;
  uint64_t bytes = uint64_t{chunk.face_count} * 3 * sizeof(uint16_t) + vertices * sizeof(Float3);
  if (everything && (chunk.columns & kChunkNormals)) bytes += vertices * sizeof(Float3);
  if (everything && (chunk.columns & kChunkUvs)) bytes += vertices * sizeof(Float2);
  return bytes;
}

template <class T>
const std::byte* take(const std::byte* from, std::vector<T>& items, size_t count) {
  items.resize(count);
  std::memcpy(items.data(), from, count * sizeof(T));
  return from + count * sizeof(T);
}

}  // namespace

Result<MeshSpool> MeshSpool::create(cache::Scratch& scratch) {
  MeshSpool spool;
  SPILLWAY_ASSIGN(spool.file_, scratch.create_file("the meshes of the scene", cache::IoPurpose::pack));
  spool.buffer_ = Buffer<std::byte>(MemoryTag::pack, kBufferBytes);
  return spool;
}

Result<MeshChunk> MeshSpool::append(const cache::AttributeSegmentData& data) {
  MeshChunk chunk;
  chunk.offset_bytes = flushed_bytes_ + buffered_;
  chunk.face_count = static_cast<uint32_t>(data.indices.size() / 3);
  chunk.vertex_count = static_cast<uint32_t>(data.positions.size());
  chunk.columns = (data.normals.empty() ? 0u : kChunkNormals) | (data.uvs.empty() ? 0u : kChunkUvs);
  SPILLWAY_TRY(append_bytes(std::as_bytes(std::span(data.indices))));
  SPILLWAY_TRY(append_bytes(std::as_bytes(std::span(data.positions))));
  SPILLWAY_TRY(append_bytes(std::as_bytes(std::span(data.normals))));
  SPILLWAY_TRY(append_bytes(std::as_bytes(std::span(data.uvs))));
  static constexpr std::byte kZeros[kChunkAlignment] = {};
  const uint64_t rest = (flushed_bytes_ + buffered_) % kChunkAlignment;
  if (rest != 0) SPILLWAY_TRY(append_bytes(std::span(kZeros).first(kChunkAlignment - rest)));
  return chunk;
}

Status MeshSpool::append_bytes(std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const size_t now = std::min(bytes.size(), buffer_.size() - buffered_);
    std::memcpy(buffer_.data() + buffered_, bytes.data(), now);
    buffered_ += now;
    bytes = bytes.subspan(now);
    if (buffered_ == buffer_.size()) SPILLWAY_TRY(flush());
  }
  return {};
}

Status MeshSpool::flush() {
  if (buffered_ == 0) return {};
  const size_t padded = direct_aligned(buffered_);
  std::memset(buffer_.data() + buffered_, 0, padded - buffered_);
  SPILLWAY_TRY(file_->write(flushed_bytes_, std::span<const std::byte>(buffer_.data(), padded)));
  flushed_bytes_ += padded;
  buffered_ = 0;
  return {};
}

Status MeshSpool::seal() {
  SPILLWAY_TRY(flush());
  buffer_ = {};
  return {};
}

Result<const std::byte*> SpoolReader::bytes(uint64_t offset, uint64_t size) {
  if (offset < window_begin_ || offset + size > window_end_) {
    const uint64_t begin = offset / cache::kDirectAlignment * cache::kDirectAlignment;
    const uint64_t end = std::min(begin + std::max(kWindowBytes, direct_aligned(offset + size - begin)),
                                  spool_.flushed_bytes_);
    window_begin_ = window_end_ = 0;
    if (window_.size() < end - begin) window_ = Buffer<std::byte>(MemoryTag::pack, end - begin);
    SPILLWAY_TRY(spool_.file_->read(begin, std::span<std::byte>(window_.data(), end - begin)));
    window_begin_ = begin, window_end_ = end;
  }
  return window_.data() + (offset - window_begin_);
}

Result<cache::AttributeSegmentData> SpoolReader::read(const MeshChunk& chunk, bool everything) {
  SPILLWAY_ASSIGN(const std::byte* from, bytes(chunk.offset_bytes, chunk_bytes(chunk, everything)));
  cache::AttributeSegmentData data;
  from = take(from, data.indices, size_t{3} * chunk.face_count);
  from = take(from, data.positions, chunk.vertex_count);
  if (everything && (chunk.columns & kChunkNormals)) from = take(from, data.normals, chunk.vertex_count);
  if (everything && (chunk.columns & kChunkUvs)) take(from, data.uvs, chunk.vertex_count);
  return data;
}

}  // namespace spillway::pipeline
