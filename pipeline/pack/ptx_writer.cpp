#include "pipeline/pack/ptx_writer.h"

#include <zlib.h>

#include <cstring>

namespace spillway::pipeline {
namespace {

using Bytes = std::vector<std::byte>;

void put(Bytes& out, const void* from, size_t size) {
  out.resize(out.size() + size);
  std::memcpy(out.data() + out.size() - size, from, size);
}
void put(Bytes& out, const Bytes& bytes) { out.insert(out.end(), bytes.begin(), bytes.end()); }
template <class T>
void put_number(Bytes& out, T value) {
  put(out, &value, sizeof value);
}

Bytes deflated(const Bytes& bytes) {
  uLongf size = compressBound(bytes.size());
  Bytes out(size);
  compress2(reinterpret_cast<Bytef*>(out.data()), &size, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size(), 6);
  out.resize(size);
  return out;
}

template <class T>
void differences(Bytes& bytes) {
  T last = 0;
  for (size_t i = 0; i < bytes.size(); i += sizeof(T)) {
    T value;
    std::memcpy(&value, &bytes[i], sizeof value);
    const T step = static_cast<T>(value - last);
    last = value;
    std::memcpy(&bytes[i], &step, sizeof step);
  }
}

class Writer {
 public:
  explicit Writer(const PtxDescription& d)
      : d_(d), number_(texel_type_bytes(d.info.type)), texel_(d.info.channels * number_) {}

  // The block, and its header.
  Bytes block(const PtxFace& face, uint32_t& header) const {
    const uint32_t width = 1u << face.info.ulog2, height = 1u << face.info.vlog2;
    Bytes out;
    if (face.encoding == PtxEncoding::tiled) {
      out = tiles(face);
    } else {
      out = flat(face.texels, width * height, face.encoding);
    }
    header = static_cast<uint32_t>(out.size()) | static_cast<uint32_t>(face.encoding) << 30;
    return out;
  }

  Bytes level(const std::vector<PtxFace>& faces, uint32_t& table_size) const {
    Bytes blocks;
    std::vector<uint32_t> headers(faces.size());
    for (size_t f = 0; f < faces.size(); ++f)
      if (!(faces[f].info.flags & cache::kFaceIsConstant)) put(blocks, block(faces[f], headers[f]));
    Bytes table;
    put(table, headers.data(), headers.size() * sizeof(uint32_t));
    Bytes out = deflated(table);
    table_size = static_cast<uint32_t>(out.size());
    put(out, blocks);
    return out;
  }

  Bytes edit(const PtxEdit& edit) const {
    uint32_t header = 0;
    const bool is_constant = (edit.texels.info.flags & cache::kFaceIsConstant) != 0;
    const Bytes texels = is_constant ? Bytes{} : block(edit.texels, header);
    Bytes out;
    put_number(out, uint8_t{0});
    put_number(out, static_cast<uint32_t>(28 + texel_ + texels.size()));
    put_number(out, edit.face);
    put(out, &edit.texels.info, sizeof edit.texels.info);
    put_number(out, header);
    put(out, constant(edit.texels));
    put(out, texels);
    return out;
  }

  Bytes constant(const PtxFace& face) const {
    if (face.info.flags & cache::kFaceIsConstant)
      return {face.texels.begin(), face.texels.begin() + static_cast<ptrdiff_t>(texel_)};
    return face.mean.empty() ? Bytes(texel_) : face.mean;
  }

 private:
  Bytes flat(const Bytes& texels, size_t count, PtxEncoding encoding) const {
    if (encoding == PtxEncoding::constant) return {texels.begin(), texels.begin() + static_cast<ptrdiff_t>(texel_)};
    Bytes planes(texels.size());
    for (size_t c = 0; c < d_.info.channels; ++c)
      for (size_t i = 0; i < count; ++i)
        std::memcpy(&planes[(c * count + i) * number_], &texels[i * texel_ + c * number_], number_);
    if (encoding == PtxEncoding::differences && number_ == 1) differences<uint8_t>(planes);
    if (encoding == PtxEncoding::differences && d_.info.type == cache::FaceTexelType::uint16)
      differences<uint16_t>(planes);
    return deflated(planes);
  }

  Bytes tiles(const PtxFace& face) const {
    const uint32_t width = 1u << face.tile_ulog2, height = 1u << face.tile_vlog2;
    const uint32_t across = 1u << (face.info.ulog2 - face.tile_ulog2), down = 1u << (face.info.vlog2 - face.tile_vlog2);
    Bytes table, blocks;
    for (uint32_t t = 0; t < across * down; ++t) {
      Bytes texels;
      for (uint32_t y = 0; y < height; ++y)
        put(texels, &face.texels[((size_t{t / across * height + y} << face.info.ulog2) + t % across * width) * texel_],
            width * texel_);
      const Bytes one = flat(texels, size_t{width} * height, face.tile_encoding);
      put_number(table, static_cast<uint32_t>(one.size()) | static_cast<uint32_t>(face.tile_encoding) << 30);
      put(blocks, one);
    }
    const Bytes zipped = deflated(table);
    Bytes out;
    put_number(out, static_cast<uint8_t>(face.tile_ulog2)), put_number(out, static_cast<uint8_t>(face.tile_vlog2));
    put_number(out, static_cast<uint32_t>(zipped.size()));
    put(out, zipped), put(out, blocks);
    return out;
  }

  const PtxDescription& d_;
  size_t number_, texel_;
};

}  // namespace

std::vector<std::byte> ptx_bytes(const PtxDescription& d) {
  const Writer writer(d);
  Bytes infos, constants, entries, levels, edits;
  for (const PtxFace& face : d.faces) put(infos, &face.info, sizeof face.info), put(constants, writer.constant(face));
  for (size_t l = 0; l <= d.reductions.size(); ++l) {
    const auto& faces = l == 0 ? d.faces : d.reductions[l - 1];
    uint32_t table_size = 0;
    const Bytes level = writer.level(faces, table_size);
    put_number(entries, static_cast<uint64_t>(level.size())), put_number(entries, table_size);
    put_number(entries, static_cast<uint32_t>(faces.size()));
    put(levels, level);
  }
  for (const PtxEdit& edit : d.edits) put(edits, writer.edit(edit));
  const Bytes zipped_infos = deflated(infos), zipped_constants = deflated(constants);
  const Bytes metadata = d.metadata_bytes > 0 ? deflated(Bytes(d.metadata_bytes)) : Bytes{};

  Bytes out;
  for (const uint32_t word : {0x78657450u, 1u, static_cast<uint32_t>(d.info.shape), static_cast<uint32_t>(d.info.type),
                              static_cast<uint32_t>(d.info.alpha_channel)})
    put_number(out, word);
  put_number(out, static_cast<uint16_t>(d.info.channels)),
      put_number(out, static_cast<uint16_t>(d.reductions.size() + 1));
  for (const size_t word :
       {d.faces.size(), size_t{40}, zipped_infos.size(), zipped_constants.size(), entries.size(), size_t{4}})
    put_number(out, static_cast<uint32_t>(word));
  put_number(out, static_cast<uint64_t>(levels.size()));
  put_number(out, static_cast<uint32_t>(metadata.size())), put_number(out, d.metadata_bytes);
  const size_t edits_offset =
      64 + 40 + zipped_infos.size() + zipped_constants.size() + entries.size() + levels.size() + metadata.size() + 8;
  put_number(out, static_cast<uint16_t>(d.info.u_border)), put_number(out, uint16_t{0});
  put_number(out, static_cast<uint16_t>(d.info.v_border)), put_number(out, uint16_t{0});
  put_number(out, uint32_t{0}), put_number(out, uint32_t{0}), put_number(out, uint64_t{0});
  put_number(out, uint64_t{d.says_where_edits_are ? edits.size() : 0});
  put_number(out, uint64_t{d.says_where_edits_are ? edits_offset : 0});
  for (const Bytes& part : {zipped_infos, zipped_constants, entries, levels, metadata, Bytes(8), edits}) put(out, part);
  return out;
}

}  // namespace spillway::pipeline
