#include "pipeline/pack/mesh_spool.h"

#include <algorithm>
#include <cstring>

#include "cache/base/alignment.h"
#include "cache/base/check.h"

namespace spillway::pipeline {
namespace {

constexpr uint64_t kChunkAlignment = 16;


template <class T>
const std::byte* take(const std::byte* from, std::vector<T>& items, size_t count) {
  items.resize(count);
  std::memcpy(items.data(), from, count * sizeof(T));
  return from + count * sizeof(T);
}

template <class T>
std::byte* put(std::byte* to, const std::vector<T>& items) {
  if (!items.empty()) std::memcpy(to, items.data(), items.size() * sizeof(T));
  return to + items.size() * sizeof(T);
}

}  // namespace

uint64_t chunk_bytes(const MeshChunk& chunk, bool everything) {
  const uint64_t vertices = chunk.vertex_count;
  uint64_t bytes = uint64_t{chunk.face_count} * 3 * sizeof(uint16_t) + vertices * sizeof(Float3);
  if (everything && (chunk.columns & kChunkNormals)) bytes += vertices * sizeof(Float3);
  if (everything && (chunk.columns & kChunkUvs)) bytes += vertices * sizeof(Float2);
  if (everything && (chunk.columns & kChunkFaces)) bytes += uint64_t{chunk.face_count} * sizeof(cache::FaceOfTriangle);
  return bytes;
}

Result<MeshSpool> MeshSpool::create(cache::Scratch& scratch) {
  MeshSpool spool;
  SPILLWAY_ASSIGN(spool.file_, scratch.create_file("the meshes of the scene", cache::IoPurpose::pack));
  return spool;
}

void MeshSpool::open_region(Lane& lane, uint64_t bytes) {
  const uint64_t size = aligned(std::max(bytes, kRegionBytes), kRegionBytes);
  lane.buffer.grow(MemoryTag::pack, size);
  lane.offset_bytes = end_bytes_;
  lane.used_bytes = 0;
  end_bytes_ += size;
}

Result<MeshChunk> MeshSpool::append(const cache::AttributeSegmentData& data, uint32_t lane_index) {
  SPILLWAY_CHECK(data.indices.size() / 3, <=, size_t{UINT16_MAX});
  SPILLWAY_CHECK(data.positions.size(), <=, size_t{UINT16_MAX});
  const size_t lane_number = lane_index % kMaxLanes;
  if (lanes_.size() <= lane_number) lanes_.resize(lane_number + 1);
  Lane& lane = lanes_[lane_number];
  MeshChunk chunk;
  chunk.face_count = static_cast<uint16_t>(data.indices.size() / 3);
  chunk.vertex_count = static_cast<uint16_t>(data.positions.size());
  chunk.columns = (data.normals.empty() ? 0u : kChunkNormals) | (data.uvs.empty() ? 0u : kChunkUvs) |
                  (data.faces.empty() ? 0u : kChunkFaces);
  const uint64_t bytes = chunk_bytes(chunk, true);
  const uint64_t room = lane.used_bytes == 0 ? 0 : kRegionBytes - std::min(kRegionBytes, lane.used_bytes);
  if (bytes > room) {
    SPILLWAY_TRY(flush(lane));
    open_region(lane, bytes);
  }
  chunk.offset_bytes = lane.offset_bytes + lane.used_bytes;
  std::byte* to = lane.buffer.data() + lane.used_bytes;
  put(put(put(put(put(to, data.positions), data.indices), data.normals), data.uvs), data.faces);
  lane.used_bytes = aligned(lane.used_bytes + bytes, kChunkAlignment);
  return chunk;
}

Status MeshSpool::flush(Lane& lane) {
  if (lane.used_bytes == 0) return {};
  const uint64_t padded = aligned(lane.used_bytes, cache::kDirectAlignment);
  std::memset(lane.buffer.data() + lane.used_bytes, 0, padded - lane.used_bytes);
  SPILLWAY_TRY(file_->write(lane.offset_bytes, std::span<const std::byte>(lane.buffer.data(), padded)));
  written_bytes_ = std::max(written_bytes_, lane.offset_bytes + padded);
  lane.used_bytes = 0;
  return {};
}

Status MeshSpool::seal() {
  for (Lane& lane : lanes_) SPILLWAY_TRY(flush(lane));
  lanes_.clear();
  return {};
}

Result<const std::byte*> SpoolReader::bytes(uint64_t offset, uint64_t size) {
  if (offset < window_begin_ || offset + size > window_end_) {
    const uint64_t begin = offset / cache::kDirectAlignment * cache::kDirectAlignment;
    const uint64_t region_end = aligned(offset + size, MeshSpool::kRegionBytes);
    const uint64_t end = std::min(region_end, spool_.written_bytes_);
    window_begin_ = window_end_ = 0;
    if (window_.size() < end - begin)
      window_ = Buffer<std::byte>(MemoryTag::pack, aligned(end - begin, MeshSpool::kRegionBytes));
    SPILLWAY_TRY(spool_.file_->read(begin, std::span<std::byte>(window_.data(), end - begin)));
    window_begin_ = begin, window_end_ = end;
  }
  return window_.data() + (offset - window_begin_);
}

Result<cache::AttributeSegmentData> SpoolReader::read(const MeshChunk& chunk, bool everything) {
  SPILLWAY_ASSIGN(const std::byte* from, bytes(chunk.offset_bytes, chunk_bytes(chunk, everything)));
  cache::AttributeSegmentData data;
  from = take(from, data.positions, chunk.vertex_count);
  from = take(from, data.indices, size_t{3} * chunk.face_count);
  if (everything && (chunk.columns & kChunkNormals)) from = take(from, data.normals, chunk.vertex_count);
  if (everything && (chunk.columns & kChunkUvs)) from = take(from, data.uvs, chunk.vertex_count);
  if (everything && (chunk.columns & kChunkFaces)) take(from, data.faces, chunk.face_count);
  return data;
}

Result<SpoolReader::View> SpoolReader::view(const MeshChunk& chunk) {
  SPILLWAY_ASSIGN(const std::byte* from, bytes(chunk.offset_bytes, chunk_bytes(chunk, false)));
  const auto* indices = reinterpret_cast<const uint16_t*>(from + chunk.vertex_count * sizeof(Float3));
  return View{{indices, size_t{3} * chunk.face_count}, {reinterpret_cast<const Float3*>(from), chunk.vertex_count}};
}

}  // namespace spillway::pipeline
