#include "tools/import/ply.h"

#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <string_view>
#include <system_error>

#include "tools/import/ply_header.h"

namespace spillway::tools {
namespace {

bool is_space(int c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; }

template <class T>
T load(const unsigned char* bytes, bool big_endian) {
  std::array<unsigned char, sizeof(T)> ordered;
  for (size_t i = 0; i < sizeof(T); ++i) ordered[i] = bytes[big_endian ? sizeof(T) - 1 - i : i];
  T value;
  std::memcpy(&value, ordered.data(), sizeof(T));
  return value;
}
static_assert(std::endian::native == std::endian::little);

double load(const unsigned char* bytes, PlyType type, bool big) {
  switch (type) {
    case PlyType::int8:
      return load<int8_t>(bytes, big);
    case PlyType::uint8:
      return load<uint8_t>(bytes, big);
    case PlyType::int16:
      return load<int16_t>(bytes, big);
    case PlyType::uint16:
      return load<uint16_t>(bytes, big);
    case PlyType::int32:
      return load<int32_t>(bytes, big);
    case PlyType::uint32:
      return load<uint32_t>(bytes, big);
    case PlyType::float32:
      return load<float>(bytes, big);
    case PlyType::float64:
      return load<double>(bytes, big);
  }
  return 0;
}

// What a vertex holds; each property goes into one slot, or nowhere.
enum Slot : int { kX, kY, kZ, kNx, kNy, kNz, kU, kV, kSlotCount, kNowhere = kSlotCount };
struct SlotName {
  std::string_view name;
  Slot slot;
};
constexpr std::array kSlotNames = {
    SlotName{"x", kX},         SlotName{"y", kY},         SlotName{"z", kZ},         SlotName{"nx", kNx},
    SlotName{"ny", kNy},       SlotName{"nz", kNz},       SlotName{"u", kU},         SlotName{"v", kV},
    SlotName{"s", kU},         SlotName{"t", kV},         SlotName{"texture_u", kU}, SlotName{"texture_v", kV},
    SlotName{"texture_s", kU}, SlotName{"texture_t", kV},
};

Slot slot_of(const PlyProperty& property) {
  for (const SlotName& known : kSlotNames) {
    if (!property.is_list && known.name == property.name) return known.slot;
  }
  return kNowhere;
}

class PlyReader {
 public:
  PlyReader(PlyBytes bytes, PlyHeader header, PlyFaces faces)
      : bytes_(std::move(bytes)), header_(std::move(header)), faces_(faces) {}

  Result<PlyMesh> read() {
    bool has_vertices = false, has_faces = false;
    for (const PlyElement& element : header_.elements) {
      has_vertices = has_vertices || element.name == "vertex";
      has_faces = has_faces || element.name == "face";
      if (element.name == "vertex")
        SPILLWAY_TRY(read_vertices(element));
      else if (element.name == "face")
        SPILLWAY_TRY(read_faces(element));
      else
        SPILLWAY_TRY(skip(element));
    }
    if (!has_vertices || !has_faces) return bytes_.fail("no element \"vertex\", or no element \"face\"");
    SPILLWAY_TRY(check_end());
    SPILLWAY_TRY(check_indices());
    return std::move(mesh_);
  }

 private:
  // Where the next value begins.
  Result<uint64_t> value_offset() {
    while (header_.format == PlyFormat::ascii && is_space(bytes_.peek())) SPILLWAY_TRY(drop_byte());
    return bytes_.offset();
  }

  Result<double> ascii_value() {
    SPILLWAY_ASSIGN(const uint64_t offset, value_offset());
    char text[64];
    size_t size = 0;
    for (int c = bytes_.peek(); c >= 0 && !is_space(c); c = bytes_.peek()) {
      if (size == sizeof(text)) return bytes_.fail_at(offset, "a word that is no number");
      text[size++] = static_cast<char>(c);
      SPILLWAY_TRY(drop_byte());
    }
    // The last number counts only with what ends it: a shorter one looks as good.
    if (bytes_.peek() < 0) return bytes_.fail("the file ends too early, or lacks its last newline: write it again");
    double value = 0;
    const auto [end, code] = std::from_chars(text, text + size, value);
    const bool is_tiny = code == std::errc::result_out_of_range && std::string_view(text, size).find("e-") < size;
    if (is_tiny) return 0.0;
    if (code != std::errc() || end != text + size) return bytes_.fail_at(offset, "a word that is no number");
    return value;
  }

  Status drop_byte() {
    SPILLWAY_ASSIGN([[maybe_unused]] const unsigned char* byte, bytes_.take(1));
    return {};
  }

  Result<double> value(PlyType type) {
    if (header_.format == PlyFormat::ascii) return ascii_value();
    SPILLWAY_ASSIGN(const unsigned char* bytes, bytes_.take(size_bytes(type)));
    return load(bytes, type, header_.format == PlyFormat::big);
  }

  Result<uint32_t> whole(PlyType type, std::string_view what) {
    SPILLWAY_ASSIGN(const uint64_t offset, value_offset());
    SPILLWAY_ASSIGN(const double number, value(type));
    if (number >= 0 && number <= std::numeric_limits<uint32_t>::max() && std::floor(number) == number) {
      return static_cast<uint32_t>(number);
    }
    return bytes_.fail_at(offset, fmt::format("{} is {}, which is no whole number of 32 bits", what, number));
  }

  Status skip_value(const PlyProperty& property) {
    uint32_t count = 1;
    if (property.is_list) {
      SPILLWAY_ASSIGN(count, whole(property.count_type, "the count of a list"));
    }
    for (uint32_t i = 0; i < count; ++i) {
      if (auto skipped = value(property.type); !skipped) return skipped.error();
    }
    return {};
  }

  Status skip(const PlyElement& element) {
    if (element.properties.empty()) return {};  // takes no bytes, whatever its count
    for (uint64_t i = 0; i < element.count; ++i) {
      for (const PlyProperty& property : element.properties) SPILLWAY_TRY(skip_value(property));
    }
    return {};
  }

  // Which slots the element fills; a slot named twice is an error.
  Result<std::vector<Slot>> slots_of(const PlyElement& element, std::array<bool, kSlotCount + 1>& has) {
    std::vector<Slot> slots;
    for (const PlyProperty& property : element.properties) {
      const Slot slot = slot_of(property);
      if (slot != kNowhere && has[slot]) {
        return bytes_.fail(fmt::format("vertex property \"{}\" says again what another one says", property.name));
      }
      has[slot] = true;
      slots.push_back(slot);
    }
    if (!has[kX] || !has[kY] || !has[kZ]) return bytes_.fail("vertices without x, y and z");
    if (element.count > std::numeric_limits<uint32_t>::max())
      return bytes_.fail("more than 2^32 vertices: split the mesh");
    return slots;
  }

  Status read_vertices(const PlyElement& element) {
    std::array<bool, kSlotCount + 1> has{};
    SPILLWAY_ASSIGN(const std::vector<Slot> slots, slots_of(element, has));
    const bool has_normals = has[kNx] && has[kNy] && has[kNz], has_uvs = has[kU] && has[kV];
    mesh_.positions.reserve(element.count);
    if (has_normals) mesh_.normals.reserve(element.count);
    if (has_uvs) mesh_.uvs.reserve(element.count);
    for (uint64_t i = 0; i < element.count; ++i) {
      float v[kSlotCount + 1] = {};
      for (size_t p = 0; p < slots.size(); ++p) {
        if (slots[p] == kNowhere) {
          SPILLWAY_TRY(skip_value(element.properties[p]));
        } else {
          SPILLWAY_ASSIGN(const double number, value(element.properties[p].type));
          v[slots[p]] = static_cast<float>(number);
        }
      }
      mesh_.positions.push_back({v[kX], v[kY], v[kZ]});
      if (has_normals) mesh_.normals.push_back({v[kNx], v[kNy], v[kNz]});
      if (has_uvs) mesh_.uvs.push_back({v[kU], v[kV]});
    }
    return {};
  }

  Status read_face(const PlyProperty& property) {
    SPILLWAY_ASSIGN(const uint64_t offset, value_offset());
    SPILLWAY_ASSIGN(const uint32_t count, whole(property.count_type, "the count of corners"));
    if (faces_ == PlyFaces::polygons) return read_polygon(property, offset, count);
    if (count != 3 && count != 4) {
      return bytes_.fail_at(offset, fmt::format("a face of {} corners: triangulate the mesh first", count));
    }
    uint32_t corner[4];
    for (uint32_t i = 0; i < count; ++i) {
      SPILLWAY_ASSIGN(corner[i], whole(property.type, "a vertex index"));
    }
    mesh_.indices.insert(mesh_.indices.end(), {corner[0], corner[1], corner[2]});
    if (count == 4) mesh_.indices.insert(mesh_.indices.end(), {corner[0], corner[2], corner[3]});
    if (faces_ != PlyFaces::numbered_triangles) return {};
    mesh_.faces.push_back({0, {0, 1, 2}, count == 3, count == 4 ? corner[3] : 0});
    if (count == 4) mesh_.faces.push_back({0, {0, 2, 3}, false, corner[1]});
    return {};
  }

  Status read_polygon(const PlyProperty& property, uint64_t offset, uint32_t count) {
    if (count < 3 || count > kMostPolygonCorners)
      return bytes_.fail_at(offset, fmt::format("a face of {} corners; 3 to {} are possible", count, kMostPolygonCorners));
    for (uint32_t i = 0; i < count; ++i) {
      SPILLWAY_ASSIGN(const uint32_t corner, whole(property.type, "a vertex index"));
      mesh_.indices.push_back(corner);
    }
    mesh_.corner_counts.push_back(count);
    return {};
  }

  Status read_faces(const PlyElement& element) {
    const PlyProperty *corners = nullptr, *numbers = nullptr;
    for (const PlyProperty& property : element.properties) {
      if (property.name == "face_indices" && !property.is_list && is_integer(property.type)) numbers = &property;
      if (property.name != "vertex_indices" && property.name != "vertex_index") continue;
      if (corners != nullptr) return bytes_.fail("faces with both vertex_indices and vertex_index");
      if (!property.is_list || !is_integer(property.type)) {
        return bytes_.fail(fmt::format("face property \"{}\" must be a list of whole numbers", property.name));
      }
      corners = &property;
    }
    if (corners == nullptr) return bytes_.fail("faces without the list vertex_indices");
    for (uint64_t i = 0; i < element.count; ++i) {
      const size_t first = mesh_.faces.size();
      uint32_t number = static_cast<uint32_t>(i);
      for (const PlyProperty& property : element.properties) {
        if (faces_ == PlyFaces::numbered_triangles && &property == numbers) {
          SPILLWAY_ASSIGN(number, whole(property.type, "a face index"));
        } else {
          SPILLWAY_TRY(&property == corners ? read_face(property) : skip_value(property));
        }
      }
      for (size_t f = first; f < mesh_.faces.size(); ++f) mesh_.faces[f].face = number;
    }
    return {};
  }

  // A few exporters end with a newline too many; anything else means that the header counts wrongly.
  Status check_end() {
    while (is_space(bytes_.peek())) SPILLWAY_TRY(drop_byte());
    if (bytes_.remaining() == 0) return {};
    return bytes_.fail(
        fmt::format("{} bytes left after the last element: the header's counts are wrong", bytes_.remaining()));
  }

  Status check_indices() {
    for (size_t i = 0; i < mesh_.indices.size(); ++i) {
      if (mesh_.indices[i] < mesh_.positions.size()) continue;
      const bool polygons = faces_ == PlyFaces::polygons;
      return bytes_.fail(fmt::format("{} {} names vertex {} of {}", polygons ? "corner" : "triangle",
                                     polygons ? i : i / 3, mesh_.indices[i], mesh_.positions.size()));
    }
    return {};
  }

  PlyBytes bytes_;
  PlyHeader header_;
  PlyFaces faces_;
  PlyMesh mesh_;
};

}  // namespace

Result<PlyMesh> read_ply(const std::filesystem::path& file, PlyFaces faces) {
  SPILLWAY_ASSIGN(PlyBytes bytes, PlyBytes::open(file));
  SPILLWAY_ASSIGN(PlyHeader header, read_ply_header(bytes));
  return PlyReader(std::move(bytes), std::move(header), faces).read();
}

}  // namespace spillway::tools
