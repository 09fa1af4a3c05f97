#include "pipeline/pack/convert_face_texture.h"

#include <OpenImageIO/imageio.h>
#include <unistd.h>

#include <bit>
#include <cstring>

#include "pipeline/json_text.h"
#include "pipeline/pack/pack_face_textures.h"
#include "pipeline/pack/ptx_writer.h"

namespace spillway::pipeline {
namespace {

namespace fs = std::filesystem;
using cache::FaceInfo;
using cache::FaceTexFile;
using cache::FaceTexFormat;
using cache::FaceTexImage;
using nlohmann::json;

constexpr const char* kAttribute = "facetex";
constexpr cache::FaceTexFile::Options kForConversion{MemoryTag::pack, cache::IoPurpose::pack};

Result<FaceTexFile> open_one(const fs::path& path) {
  SPILLWAY_ASSIGN(FaceTexFile file, FaceTexFile::open(path, kForConversion));
  if (file.textures().size() != 1)
    return error("{}: holds {} textures, but one is wanted", path.string(), file.textures().size());
  return file;
}

Status pack_one(const fs::path& from, const fs::path& to, const ConvertOptions& options) {
  fs::path folder = to;
  folder += fmt::format(".{}.tmp", getpid());
  Status done;
  std::error_code code;
  {
    FaceTexturePacker packer(folder, UINT64_MAX, options.codec, cache::kFaceTileLog2);
    const auto added = packer.add_file(from, options.encoding);
    if (!added) done = added.error();
    if (added)
      if (const auto packed = packer.finish(); !packed) done = packed.error();
  }
  if (done) fs::rename(folder / "faces-00000.facetex", to, code);
  if (code) done = error("{}: cannot be written: {}", to.string(), code.message());
  fs::remove_all(folder, code);
  return done;
}

Status write_bytes(const fs::path& to, std::span<const std::byte> bytes) {
  SPILLWAY_ASSIGN(cache::WriteFile file, cache::WriteFile::create(to, cache::IoPurpose::pack));
  SPILLWAY_TRY(file.append(bytes));
  return file.commit();
}

Status write_ptx(const fs::path& from, const fs::path& to) {
  SPILLWAY_ASSIGN(const FaceTexFile file, open_one(from));
  const cache::FaceTexTexture& texture = file.textures()[0];
  PtxDescription ptx;
  ptx.info = {texture.shape,    file.format().type, file.format().channels, file.format().alpha_channel,
              texture.u_border, texture.v_border};
  for (uint32_t f = 0; f < texture.face_count; ++f) {
    PtxFace& face = ptx.faces.emplace_back();
    face.info = file.faces(texture)[f];
    face.encoding =
        file.format().type <= cache::FaceTexelType::uint16 ? PtxEncoding::differences : PtxEncoding::deflated;
    SPILLWAY_ASSIGN(face.texels, file.texels(texture, f, 0));
    SPILLWAY_ASSIGN(face.mean, file.texels(texture, f, std::max(face.info.ulog2, face.info.vlog2)));
  }
  return write_bytes(to, ptx_bytes(ptx));
}

// ---- EXR ----

std::string hex(std::span<const std::byte> bytes) {
  std::string text;
  for (const std::byte b : bytes) text += fmt::format("{:02x}", static_cast<unsigned>(b));
  return text;
}

bool from_hex(const std::string& text, std::span<std::byte> bytes) {
  if (text.size() != 2 * bytes.size()) return false;
  const auto digit = [](char c) { return c >= '0' && c <= '9' ? c - '0' : c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1; };
  for (size_t i = 0; i < bytes.size(); ++i) {
    const int high = digit(text[2 * i]), low = digit(text[2 * i + 1]);
    if (high < 0 || low < 0) return false;
    bytes[i] = static_cast<std::byte>(16 * high + low);
  }
  return true;
}

bool is_narrow(const FaceTexFormat& f) {
  return f.type == cache::FaceTexelType::uint8 || f.type == cache::FaceTexelType::half;
}

OIIO::ImageSpec part_spec(const FaceTexFile& file, const FaceTexImage& image) {
  const FaceTexFormat& format = file.format();
  OIIO::ImageSpec spec(static_cast<int>(image.width), static_cast<int>(image.height), static_cast<int>(format.channels),
                       is_narrow(format) ? OIIO::TypeHalf : OIIO::TypeFloat);
  spec.alpha_channel = format.alpha_channel;
  spec.attribute("compression", "zip");
  spec.attribute("oiio:subimagename", fmt::format("{}x{}", 1u << image.ulog2, 1u << image.vlog2));
  return spec;
}

std::string description(const FaceTexFile& file) {
  const cache::FaceTexTexture& t = file.textures()[0];
  const FaceTexFormat& f = file.format();
  const json text = {{"type", static_cast<int>(f.type)},           {"alpha", f.alpha_channel},
                     {"encoding", static_cast<int>(f.encoding)},   {"gamma", f.gamma},
                     {"tile_log2", f.tile_log2},
                     {"shape", static_cast<int>(t.shape)},         {"u_border", static_cast<int>(t.u_border)},
                     {"v_border", static_cast<int>(t.v_border)},   {"name", std::string(t.name)},
                     {"faces", hex(std::as_bytes(file.faces(t)))}, {"numbers", hex(std::as_bytes(file.numbers(t)))}};
  return json_text(text, -1);
}

Result<std::vector<float>> decoded_image(const FaceTexFile& file, const cache::FaceTexDecoder& decoder,
                                         const FaceTexImage& image) {
  const FaceTexFormat& format = file.format();
  const uint32_t edge = format.tile_edge();
  std::vector<float> values(size_t{image.width} * image.height * format.channels);
  std::vector<std::byte> tile(format.tile_bytes());
  for (uint64_t t = 0; t < image.tile_count; ++t) {
    SPILLWAY_TRY(file.read_tile(image.first_tile + t, tile));
    const auto x0 = static_cast<uint32_t>(t % image.tiles_across()) * edge;
    const auto y0 = static_cast<uint32_t>(t / image.tiles_across()) * edge;
    for (uint32_t y = 0; y < edge && y0 + y < image.height; ++y)
      for (uint32_t x = 0; x < edge; ++x)
        for (uint32_t c = 0; c < format.channels; ++c)
          values[(size_t{y0 + y} * image.width + x0 + x) * format.channels + c] =
              decoder.value(tile.data() + (size_t{y} * edge + x) * format.texel_bytes(), c);
  }
  return values;
}

Status write_exr(const fs::path& from, const fs::path& to) {
  SPILLWAY_ASSIGN(const FaceTexFile file, open_one(from));
  const cache::FaceTexDecoder decoder(file.format());
  std::vector<const FaceTexImage*> parts;
  std::vector<OIIO::ImageSpec> specs;
  for (const FaceTexImage& image : file.images())
    if (image.level == 0) parts.push_back(&image), specs.push_back(part_spec(file, image));
  // Parts of an EXR have one display window.
  int full_width = 0, full_height = 0;
  for (const OIIO::ImageSpec& spec : specs)
    full_width = std::max(full_width, spec.width), full_height = std::max(full_height, spec.height);
  for (OIIO::ImageSpec& spec : specs) spec.full_width = full_width, spec.full_height = full_height;
  specs[0].attribute(kAttribute, description(file));
  fs::path temporary = to;
  temporary.replace_extension(fmt::format("{}.tmp.exr", getpid()));
  const auto fail = [&](const std::string& what) {
    std::error_code code;
    fs::remove(temporary, code);
    return error("{}: cannot be written: {}", to.string(), what);
  };
  const auto output = OIIO::ImageOutput::create(temporary.string());
  if (!output || !output->open(temporary.string(), static_cast<int>(specs.size()), specs.data()))
    return fail(output ? output->geterror() : OIIO::geterror());
  for (size_t p = 0; p < parts.size(); ++p) {
    if (p > 0 && !output->open(temporary.string(), specs[p], OIIO::ImageOutput::AppendSubimage))
      return fail(output->geterror());
    const auto values = decoded_image(file, decoder, *parts[p]);
    if (!values) return fail(values.error().message);
    if (!output->write_image(OIIO::TypeFloat, values->data())) return fail(output->geterror());
  }
  if (!output->close()) return fail(output->geterror());
  std::error_code code;
  fs::rename(temporary, to, code);
  return code ? Status(fail(code.message())) : Status{};
}

// What an EXR says of its faces.
struct Described {
  FaceTexFormat format;
  cache::FaceTextureShape texture;
  std::vector<uint32_t> numbers;
};

Status read_description(const std::string& text, const fs::path& path, Described& d) {
  const json j = json::parse(text, nullptr, false);
  const auto whole = [&](const char* name, int most) {
    return j.is_object() && j.contains(name) && j[name].is_number_integer() && j[name] >= -1 && j[name] <= most
               ? j[name].get<int>()
               : -2;
  };
  const int type = whole("type", 3), alpha = whole("alpha", 3), encoding = whole("encoding", 2),
            shape = whole("shape", 1);
  const int u_border = whole("u_border", 2), v_border = whole("v_border", 2);
  const int tile_log2 = whole("tile_log2", cache::kMostFaceTileLog2);
  const auto bad = [&] { return error("{}: its attribute '{}' is damaged", path.string(), kAttribute); };
  if (std::min({type, encoding, shape, u_border, v_border}) < 0 ||
      tile_log2 < static_cast<int>(cache::kLeastFaceTileLog2) || alpha < -1 || !j.contains("gamma") ||
      !j["gamma"].is_number())
    return bad();
  for (const char* name : {"name", "faces", "numbers"})
    if (!j.contains(name) || !j[name].is_string()) return bad();
  d.format.type = static_cast<cache::FaceTexelType>(type), d.format.alpha_channel = alpha;
  d.format.encoding = static_cast<cache::FaceTexEncoding>(encoding), d.format.gamma = j["gamma"];
  d.format.tile_log2 = static_cast<uint32_t>(tile_log2);
  d.texture = {j["name"],
               static_cast<cache::FaceShape>(shape),
               static_cast<cache::FaceBorder>(u_border),
               static_cast<cache::FaceBorder>(v_border),
               {}};
  const std::string faces = j["faces"], numbers = j["numbers"];
  d.texture.faces.resize(faces.size() / 2 / sizeof(FaceInfo)), d.numbers.resize(d.texture.faces.size());
  if (!from_hex(faces, std::as_writable_bytes(std::span(d.texture.faces))) ||
      !from_hex(numbers, std::as_writable_bytes(std::span(d.numbers))))
    return bad();
  return {};
}

// An ordinary image is one quad, its lowest row at v = 0.
Status describe_one_quad(const OIIO::ImageSpec& spec, const fs::path& path, Described& d) {
  const auto width = static_cast<uint32_t>(spec.width), height = static_cast<uint32_t>(spec.height);
  if (!std::has_single_bit(width) || !std::has_single_bit(height) || width >> cache::kMaxFaceLog2 > 1 ||
      height >> cache::kMaxFaceLog2 > 1)
    return error("{}: has {} x {} pixels; a face has powers of two, up to 2^{}", path.string(), width, height,
                 cache::kMaxFaceLog2);
  d.format.type = spec.format == OIIO::TypeHalf ? cache::FaceTexelType::half : cache::FaceTexelType::float32;
  d.format.alpha_channel = spec.alpha_channel;
  d.texture.name = path.filename().string();
  d.texture.faces.resize(1), d.numbers = {0};
  d.texture.faces[0].ulog2 = static_cast<uint8_t>(std::countr_zero(width)),
  d.texture.faces[0].vlog2 = static_cast<uint8_t>(std::countr_zero(height));
  return {};
}

Status read_exr(const fs::path& from, const fs::path& to, const ConvertOptions& options) {
  const auto input = OIIO::ImageInput::open(from.string());
  if (!input) return error("{}: cannot be read: {}", from.string(), OIIO::geterror());
  const OIIO::ImageSpec first = input->spec();
  if (first.nchannels < 1 || first.nchannels > 4)
    return error("{}: has {} channels; 1 to 4 are possible", from.string(), first.nchannels);
  Described d;
  const std::string text = first.get_string_attribute(kAttribute);
  SPILLWAY_TRY(text.empty() ? describe_one_quad(first, from, d) : read_description(text, from, d));
  d.format.channels = static_cast<uint32_t>(first.nchannels), d.format.codec = options.codec;
  // Parts by size of face.
  std::map<std::pair<uint32_t, uint32_t>, std::pair<int, uint32_t>> parts;
  for (const FaceInfo& face : d.texture.faces) {
    const bool is_constant = (face.flags & cache::kFaceIsConstant) != 0;
    ++parts[{is_constant ? 0u : face.ulog2, is_constant ? 0u : face.vlog2}].second;
  }
  int next = 0;
  for (auto& [size, part] : parts) part.first = next++;
  SPILLWAY_ASSIGN(const auto writer, cache::FaceTexWriter::create(to, d.format));
  const std::vector<FaceInfo> faces = d.texture.faces;
  SPILLWAY_TRY(writer->begin_texture(std::move(d.texture)));
  const cache::FaceTexDecoder decoder(d.format);
  std::map<int, std::vector<float>> pixels;
  std::map<int, FaceTexImage> layouts;
  for (const auto& [size, part] : parts) {
    std::vector<FaceTexImage> images;
    if (size.first > cache::kMaxFaceLog2 || size.second > cache::kMaxFaceLog2 ||
        !append_images(0, {size.first, size.second, part.second}, d.format.tile_log2, images))
      return error("{}: its faces are too large", from.string());
    const OIIO::ImageSpec spec = input->spec(part.first, 0);
    if (text.empty())
      images[0].width = static_cast<uint32_t>(first.width), images[0].height = static_cast<uint32_t>(first.height);
    if (spec.width != static_cast<int>(images[0].width) || spec.height != static_cast<int>(images[0].height) ||
        spec.nchannels != first.nchannels)
      return error("{}: part {} is not the one that '{}' describes", from.string(), part.first, kAttribute);
    std::vector<float>& of_part = pixels[part.first];
    of_part.resize(size_t{images[0].width} * images[0].height * d.format.channels);
    if (!input->read_image(part.first, 0, 0, spec.nchannels, OIIO::TypeFloat, of_part.data()))
      return error("{}: cannot be read: {}", from.string(), input->geterror());
    layouts[part.first] = images[0];
  }
  for (size_t f = 0; f < faces.size(); ++f) {
    const bool is_constant = (faces[f].flags & cache::kFaceIsConstant) != 0;
    const int part = parts[{is_constant ? 0u : faces[f].ulog2, is_constant ? 0u : faces[f].vlog2}].first;
    const FaceTexImage& image = layouts[part];
    if (d.numbers[f] >= image.face_count) return error("{}: its attribute '{}' is damaged", from.string(), kAttribute);
    const uint32_t width = 1u << image.ulog2, height = 1u << image.vlog2;
    std::vector<std::byte> texels(size_t{width} * height * d.format.texel_bytes());
    for (uint32_t y = 0; y < height; ++y)
      for (uint32_t x = 0; x < width; ++x) {
        // Rows of an ordinary image go down.
        const uint32_t row = text.empty() ? height - 1 - y : image.y_of(d.numbers[f]) + y;
        const uint32_t column = (text.empty() ? 0 : image.x_of(d.numbers[f])) + x;
        const float* pixel = pixels[part].data() + (size_t{row} * image.width + column) * d.format.channels;
        for (uint32_t c = 0; c < d.format.channels; ++c)
          decoder.put(pixel[c], texels.data() + (size_t{y} * width + x) * d.format.texel_bytes(), c);
      }
    SPILLWAY_TRY(writer->add_face(texels));
  }
  return writer->finish();
}

}  // namespace

Status convert_face_texture(const fs::path& from, const fs::path& to, const ConvertOptions& options) {
  const std::string source = from.extension(), target = to.extension();
  for (const std::string& kind : {source, target})
    if (kind != ".ptx" && kind != ".facetex" && kind != ".exr")
      return error("{} to {}: files end in .ptx, .facetex or .exr", from.string(), to.string());
  if (source != ".facetex" && target != ".facetex") {
    fs::path middle = to;
    middle += fmt::format(".{}.facetex", getpid());
    Status done = convert_face_texture(from, middle, options);
    if (done) done = convert_face_texture(middle, to, options);
    std::error_code code;
    fs::remove(middle, code);
    return done;
  }
  if (target == ".ptx") return write_ptx(from, to);
  if (target == ".exr") return write_exr(from, to);
  return source == ".exr" ? read_exr(from, to, options) : pack_one(from, to, options);
}

}  // namespace spillway::pipeline
