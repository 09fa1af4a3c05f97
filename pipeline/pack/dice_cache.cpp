#include "pipeline/pack/dice_cache.h"

#include <cstring>

#include "cache/base/hash.h"

namespace spillway::pipeline {
namespace {

// To be raised when the same cage and rates become other triangles.
constexpr uint64_t kDicerVersion = 1;
constexpr char kMagic[8] = {'S', 'P', 'W', 'D', 'I', 'C', 'E', '1'};

struct Header {
  char magic[8];
  DiceKey key;
  uint64_t piece_count;
};
static_assert(sizeof(Header) == 32);

struct PieceHeader {
  uint32_t point_count, index_count, has_uvs, reserved;
  uint64_t checksum;  // of the arrays
};
static_assert(sizeof(PieceHeader) == 24);

uint64_t array_bytes(const PieceHeader& h) {
  return uint64_t{h.point_count} * (2 * sizeof(Float3) + (h.has_uvs ? sizeof(Float2) : 0)) + uint64_t{h.index_count} * sizeof(uint32_t);
}

// Sizes count too: what ends one array must not begin the next.
template <class T>
void mix(DiceKey& key, std::span<const T> items) {
  for (uint64_t& word : key.words) word = checksum(items.data(), items.size_bytes(), hash_combine(word, items.size()));
}

template <class T>
void mix_value(DiceKey& key, const T& value) {
  mix(key, std::span<const T>(&value, 1));
}

template <class T>
const std::byte* take(const std::byte* from, std::vector<T>& items, size_t count) {
  items.resize(count);
  if (count > 0) std::memcpy(items.data(), from, count * sizeof(T));
  return from + count * sizeof(T);
}

template <class T>
void put(std::vector<std::byte>& bytes, const std::vector<T>& items) {
  const auto raw = std::as_bytes(std::span(items));
  bytes.insert(bytes.end(), raw.begin(), raw.end());
}

Result<cache::ReadFile> open_file(const std::filesystem::path& path) {
  return cache::ReadFile::open(path, {.purpose = cache::IoPurpose::pack, .direct = false});
}

}  // namespace

DiceKey dice_key(const SubdivisionCage& cage, std::span<const uint32_t> rates, uint64_t heights) {
  DiceKey key{{kDicerVersion, ~kDicerVersion}};
  const auto add = [&key](const auto& items) { mix(key, std::span(items.data(), items.size())); };
  add(cage.positions), add(cage.first_corner), add(cage.indices), add(cage.uvs), add(cage.uv_indices);
  add(cage.sharp_edges), add(cage.sharp_vertices), add(cage.holes);
  mix_value(key, cage.boundary), mix_value(key, cage.uv_rule);
  mix_value(key, static_cast<uint32_t>(cage.surface.flip_normals));
  mix(key, rates);
  mix_value(key, heights);
  return key;
}

Result<DiceCache> DiceCache::open(const std::filesystem::path& directory) {
  std::error_code code;
  std::filesystem::create_directories(directory, code);
  if (!std::filesystem::is_directory(directory, code))
    return error("{}: cannot be made a directory; name another one for diced surfaces", directory.string());
  return DiceCache(directory);
}

std::filesystem::path DiceCache::file_of(const DiceKey& key) const {
  return directory_ / fmt::format("{:016x}{:016x}.dice", key.words[0], key.words[1]);
}

Result<std::unique_ptr<CachedPieces>> DiceCache::find(const DiceKey& key, size_t piece_count) const {
  const std::filesystem::path path = file_of(key);
  std::error_code code;
  if (!std::filesystem::exists(path, code)) return std::unique_ptr<CachedPieces>();
  std::unique_ptr<CachedPieces> pieces(new CachedPieces(path));
  SPILLWAY_TRY(pieces->scan(key, piece_count));
  return pieces;
}

Status CachedPieces::scan(const DiceKey& key, size_t piece_count) {
  const std::string name = path_.string();
  SPILLWAY_ASSIGN(const cache::ReadFile file, open_file(path_));
  Header header{};
  if (file.size_bytes() < sizeof(header)) return error("{}: is too short; delete it", name);
  SPILLWAY_TRY(file.read(0, std::as_writable_bytes(std::span(&header, 1))));
  if (std::memcmp(header.magic, kMagic, sizeof(kMagic)) != 0 || std::memcmp(&header.key, &key, sizeof(key)) != 0 ||
      header.piece_count != piece_count)
    return error("{}: holds something else than its name says; delete it", name);
  uint64_t offset = sizeof(header);
  for (size_t i = 0; i < piece_count; ++i) {
    PieceHeader piece{};
    if (file.size_bytes() - offset < sizeof(piece)) return error("{}: ends before piece {}; delete it", name, i);
    SPILLWAY_TRY(file.read(offset, std::as_writable_bytes(std::span(&piece, 1))));
    offsets_.push_back(offset);
    offset += sizeof(piece);
    if (file.size_bytes() - offset < array_bytes(piece)) return error("{}: ends inside piece {}; delete it", name, i);
    offset += array_bytes(piece);
  }
  if (offset != file.size_bytes()) return error("{}: goes on after its last piece; delete it", name);
  return {};
}

Result<DicedPiece> CachedPieces::piece(size_t index) const {
  PieceHeader header{};
  const uint64_t offset = offsets_[index];
  SPILLWAY_ASSIGN(const cache::ReadFile file, open_file(path_));
  SPILLWAY_TRY(file.read(offset, std::as_writable_bytes(std::span(&header, 1))));
  // Within the file: scan() has seen the same header.
  if (file.size_bytes() - offset - sizeof(header) < array_bytes(header))
    return error("{}: changed while it was read", path_.string());
  std::vector<std::byte> bytes(array_bytes(header));
  SPILLWAY_TRY(file.read(offset + sizeof(header), bytes));
  if (checksum(bytes.data(), bytes.size()) != header.checksum)
    return error("{}: piece {} at byte {} is damaged; delete the file", path_.string(), index, offset);
  DicedPiece piece;
  const std::byte* from = take(bytes.data(), piece.positions, header.point_count);
  from = take(from, piece.normals, header.point_count);
  if (header.has_uvs) from = take(from, piece.uvs, header.point_count);
  take(from, piece.indices, header.index_count);
  return piece;
}

Result<PieceWriter> DiceCache::create(const DiceKey& key, size_t piece_count) const {
  SPILLWAY_ASSIGN(auto file, cache::WriteFile::create(file_of(key), cache::IoPurpose::pack));
  Header header{{}, key, piece_count};
  std::memcpy(header.magic, kMagic, sizeof(kMagic));
  SPILLWAY_TRY(file.append(std::as_bytes(std::span(&header, 1))));
  return PieceWriter(std::move(file));
}

Status PieceWriter::append(const DicedPiece& piece) {
  std::vector<std::byte> bytes;
  put(bytes, piece.positions), put(bytes, piece.normals), put(bytes, piece.uvs), put(bytes, piece.indices);
  PieceHeader header{};
  header.point_count = static_cast<uint32_t>(piece.positions.size());
  header.index_count = static_cast<uint32_t>(piece.indices.size());
  header.has_uvs = piece.uvs.empty() ? 0 : 1;
  header.checksum = checksum(bytes.data(), bytes.size());
  SPILLWAY_TRY(file_.append(std::as_bytes(std::span(&header, 1))));
  return file_.append(bytes);
}

}  // namespace spillway::pipeline
