#include "tests/support/small_scene.h"

#include <OpenImageIO/imageio.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <vector>

#include "tests/support/face_mesh.h"

namespace spillway::test {
namespace {

using namespace pipeline;

struct MeshData {
  std::vector<Float3> positions, normals;
  std::vector<Float2> uvs;
  std::vector<uint32_t> indices;
  std::vector<TriangleFace> faces;
};

// A grid of n x n quads over the parallelogram at `corner`.
MeshData grid(Float3 corner, Float3 edge_u, Float3 edge_v, uint32_t n) {
  MeshData mesh;
  for (uint32_t j = 0; j <= n; ++j)
    for (uint32_t i = 0; i <= n; ++i) {
      const Float2 uv{static_cast<float>(i) / static_cast<float>(n), static_cast<float>(j) / static_cast<float>(n)};
      mesh.positions.push_back(corner + edge_u * uv.x + edge_v * uv.y);
      mesh.uvs.push_back(uv);
    }
  for (uint32_t j = 0; j < n; ++j)
    for (uint32_t i = 0; i < n; ++i) {
      const uint32_t a = j * (n + 1) + i, b = a + 1, c = a + n + 1, d = c + 1;
      mesh.indices.insert(mesh.indices.end(), {a, b, d, a, d, c});
    }
  return mesh;
}

MeshData sphere(Float3 center, float radius, uint32_t n) {
  MeshData mesh = grid({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, n);
  for (size_t i = 0; i < mesh.positions.size(); ++i) {
    const double phi = 2 * M_PI * mesh.uvs[i].x, theta = M_PI * (0.02 + 0.96 * mesh.uvs[i].y);
    const Float3 d{static_cast<float>(std::sin(theta) * std::cos(phi)), static_cast<float>(std::cos(theta)),
                   static_cast<float>(std::sin(theta) * std::sin(phi))};
    mesh.positions[i] = center + d * radius;
    mesh.normals.push_back(d);
  }
  return mesh;
}

Status write_image(const std::filesystem::path& path, int size, int channels, uint32_t (*texel)(int, int, int)) {
  std::vector<uint8_t> bytes;
  for (int y = 0; y < size; ++y)
    for (int x = 0; x < size; ++x)
      for (int c = 0; c < channels; ++c) bytes.push_back(static_cast<uint8_t>(texel(x, y, c)));
  const auto output = OIIO::ImageOutput::create(path.string());
  if (!output || !output->open(path.string(), OIIO::ImageSpec(size, size, channels, OIIO::TypeUInt8)) ||
      !output->write_image(OIIO::TypeUInt8, bytes.data()) || !output->close())
    return error("{}: the test image cannot be written", path.string());
  return {};
}

uint32_t checks(int x, int y, int c) {
  return ((x / 16 + y / 16) % 2 ? 200u : 60u) + static_cast<uint32_t>(c * 10 + x % 7);
}
uint32_t holes(int x, int y, int) {
  const int dx = x % 32 - 16, dy = y % 32 - 16;
  const int r2 = dx * dx + dy * dy;
  return r2 < 64 ? 0u : r2 < 110 ? 120u : 255u;
}
uint32_t waves(int x, int y, int) { return static_cast<uint32_t>(128 + 100 * std::sin(0.3 * x) * std::cos(0.2 * y)); }

Param constant(float r, float g, float b) {
  Param p;
  p.constant = {r, g, b};
  return p;
}

class Builder {
 public:
  Builder(ScenePacker& packer, std::filesystem::path images) : packer_(packer), images_(std::move(images)) {}

  Result<uint32_t> image(const char* name, int size, int channels, uint32_t (*texel)(int, int, int), float scale) {
    const auto path = images_ / name;
    SPILLWAY_TRY(write_image(path, size, channels, texel));
    SPILLWAY_ASSIGN(const ImageId id, packer_.add_image(path, cache::TexelEncoding::linear));
    TextureNode node;
    node.kind = TextureKind::image;
    node.image = id.value;
    node.filter = cache::TexelFilter::trilinear;
    node.uv_scale[0] = node.uv_scale[1] = 2;
    for (float& v : node.value) v = scale;
    SPILLWAY_ASSIGN(const TextureId texture, packer_.add_texture(node));
    return texture.value;
  }

  // Solid noise, a quarter of a unit wide.
  Result<Param> noise(TextureKind kind) {
    TextureNode node;
    node.kind = kind, node.mapping = TextureMapping::solid;
    node.texture_from_world = {{{4, 0, 0, 0}, {0, 4, 0, 0}, {0, 0, 4, 0}}};
    node.value[0] = 0.5f, node.value[1] = 6, node.value[2] = 1, node.value[3] = 2;
    SPILLWAY_ASSIGN(const TextureId texture, packer_.add_texture(node));
    Param param;
    param.texture = texture.value;
    return param;
  }

  Result<MaterialId> material(MaterialKind kind, Param reflectance, float roughness, Param base = {}) {
    Material m;
    m.kind = kind;
    m.reflectance = reflectance;
    m.remap_roughness = 0;
    m.u_roughness = m.v_roughness = constant(roughness, roughness, roughness);
    m.base_u_roughness = m.base_v_roughness = base;
    m.conductor_eta = constant(0.2f, 0.9f, 1.1f), m.conductor_k = constant(3.9f, 2.4f, 2.2f);
    return packer_.add_material(m, "material");
  }

  Status mesh(const MeshData& data, MaterialId id, uint32_t object = 0, TextureId alpha = {}, Rgb emission = {0, 0, 0},
              TextureId emission_texture = {}) {
    MeshInput input;
    input.name = fmt::format("mesh {}", count_++);
    input.positions = data.positions, input.normals = data.normals, input.uvs = data.uvs, input.indices = data.indices;
    input.faces = data.faces;
    input.material = id, input.alpha = alpha, input.object = object;
    input.emits = !is_black(emission), input.emission = emission, input.emission_texture = emission_texture;
    return packer_.add_mesh(input);
  }

 private:
  ScenePacker& packer_;
  std::filesystem::path images_;
  int count_ = 0;
};

SceneSettings settings(const SmallSceneOptions& options) {
  SceneSettings s;
  s.camera.world_from_camera.m[1][3] = 1.0f;
  s.camera.world_from_camera.m[2][3] = -3.5f;
  s.camera.resolution_x_px = options.resolution_x_px, s.camera.resolution_y_px = options.resolution_y_px;
  s.camera.tan_half_fov_y = 0.5f;
  s.camera.tan_half_fov_x =
      0.5f * static_cast<float>(options.resolution_x_px) / static_cast<float>(options.resolution_y_px);
  s.camera.lens_radius = 0.02f, s.camera.focal_distance = 3.5f;
  s.filter = {shading::FilterKind::mitchell, {2, 2}, 1.0f / 3, 1.0f / 3};
  s.render.samples_per_pixel = options.samples_per_pixel;
  s.render.max_depth = 6;
  // Moves from before the shutter opens to before it closes: the rest of the time all stands still.
  if (options.moves) s.motion = {-0.25f, 0.75f};
  return s;
}

// A wall of 6 x 4 quads with a face texture: faces of a texel to four tiles, some turned, some constant.
Status add_painted_wall(Builder& b, ScenePacker& packer) {
  const FaceGrid faces(6, 4, [](uint32_t f) { return f % 4; });
  cache::FaceTexFormat format;
  format.type = cache::FaceTexelType::float32;  // so that its tiles outweigh the smallest cache
  auto infos = faces.faces([](uint32_t f) { return std::pair<uint8_t, uint8_t>{f % 8, (f + 3) % 8}; });
  infos[9].flags = cache::kFaceIsConstant;
  SPILLWAY_ASSIGN(const FaceTextureId id,
                  packer.begin_face_texture(format, {"wall", cache::FaceShape::quad, {}, {}, infos}));
  for (uint32_t f = 0; f < infos.size(); ++f)
    SPILLWAY_TRY(
        packer.add_face(painted_face(format, infos[f], cache::FaceShape::quad, [&](double u, double v, uint32_t c) {
          return 0.4 + 0.3 * std::sin(20 * u + f) * std::cos(17 * v + c);
        })));
  TextureNode node;
  node.kind = TextureKind::face, node.image = id.value;
  for (float& v : node.value) v = 1;
  SPILLWAY_ASSIGN(const TextureId texture, packer.add_texture(node));
  Param painted;
  painted.texture = texture.value;
  SPILLWAY_ASSIGN(const MaterialId paint, b.material(MaterialKind::diffuse, painted, 0));
  MeshData mesh;
  for (uint32_t j = 0; j <= 4; ++j)
    for (uint32_t i = 0; i <= 6; ++i) {
      mesh.positions.push_back({-1.9f, 0.1f + 0.4f * static_cast<float>(j), -1.5f + 0.5f * static_cast<float>(i)});
      mesh.uvs.push_back({static_cast<float>(i) / 6, static_cast<float>(j) / 4});
    }
  for (uint32_t f = 0; f < infos.size(); ++f) {
    const uint32_t a = f / 6 * 7 + f % 6, square[4] = {a, a + 1, a + 8, a + 7}, turn = f % 4;
    uint32_t corner[4];
    for (uint32_t k = 0; k < 4; ++k) corner[k] = square[(k + turn) % 4];
    mesh.indices.insert(mesh.indices.end(), {corner[0], corner[1], corner[2], corner[0], corner[2], corner[3]});
    mesh.faces.push_back({f, {0, 1, 2}, false, corner[3]});
    mesh.faces.push_back({f, {0, 2, 3}, false, corner[1]});
  }
  return b.mesh(mesh, paint);
}

Status add_room(Builder& b, ScenePacker& packer, const Param& checks_param, TextureId emission) {
  SPILLWAY_ASSIGN(const Param marble, b.noise(TextureKind::marble));
  SPILLWAY_ASSIGN(const MaterialId walls, b.material(MaterialKind::diffuse, marble, 0));
  SPILLWAY_ASSIGN(const MaterialId floor, b.material(MaterialKind::coated_diffuse, checks_param, 0.1f));
  SPILLWAY_TRY(b.mesh(grid({-2, 0, -2}, {4, 0, 0}, {0, 0, 4}, 24), floor));
  SPILLWAY_TRY(b.mesh(grid({-2, 0, 2}, {4, 0, 0}, {0, 3, 0}, 16), walls));
  SPILLWAY_TRY(add_painted_wall(b, packer));
  SPILLWAY_ASSIGN(const MaterialId black, b.material(MaterialKind::diffuse, constant(0, 0, 0), 0));
  return b.mesh(grid({-0.5f, 2.9f, -0.5f}, {1, 0, 0}, {0, 0, 1}, 2), black, 0, {}, {12, 11, 9}, emission);
}

// A turn about y and a step, from where the instance is.
Affine3 moved_on(const Affine3& from, double angle_rad, Float3 step) {
  const auto s = static_cast<float>(std::sin(angle_rad)), c = static_cast<float>(std::cos(angle_rad));
  Affine3 to = from;
  for (int j = 0; j < 3; ++j) {
    to.m[0][j] = c * from.m[0][j] + s * from.m[2][j];
    to.m[2][j] = c * from.m[2][j] - s * from.m[0][j];
  }
  for (int i = 0; i < 3; ++i) to.m[i][3] += step[i];
  return to;
}

Status add_objects(Builder& b, ScenePacker& packer, bool moves) {
  SPILLWAY_ASSIGN(const Param wrinkles, b.noise(TextureKind::wrinkled));
  SPILLWAY_ASSIGN(const MaterialId glass, b.material(MaterialKind::dielectric, {}, 0));
  SPILLWAY_ASSIGN(const MaterialId frosted, b.material(MaterialKind::dielectric, {}, 0.2f));
  SPILLWAY_ASSIGN(const MaterialId metal, b.material(MaterialKind::conductor, {}, 0.15f));
  SPILLWAY_ASSIGN(const MaterialId coated_metal, b.material(MaterialKind::coated_conductor, {}, 0.05f, wrinkles));
  SPILLWAY_TRY(b.mesh(sphere({-0.8f, 0.5f, 0.2f}, 0.5f, 24), glass));
  SPILLWAY_TRY(b.mesh(sphere({0.9f, 0.4f, 0.0f}, 0.4f, 24), metal));
  SPILLWAY_TRY(b.mesh(sphere({0.1f, 0.3f, -0.6f}, 0.3f, 16), frosted));
  const uint32_t object = packer.begin_object("ball");
  SPILLWAY_TRY(b.mesh(sphere({0, 0, 0}, 0.2f, 16), coated_metal, object));
  for (int i = 0; i < 5; ++i) {
    Affine3 place;
    const float size = 0.6f + 0.2f * static_cast<float>(i);
    place.m[0][0] = i == 2 ? -size : size, place.m[1][1] = size, place.m[2][2] = size;
    place.m[0][3] = -1.5f + 0.7f * static_cast<float>(i), place.m[1][3] = 0.9f + 0.2f * static_cast<float>(i % 2);
    place.m[2][3] = 1.2f;
    // One stands still among those that move.
    SPILLWAY_TRY(moves && i != 1
                     ? packer.add_moving_instance(object, place, moved_on(place, 1 + i, {0.3f, 0.2f, -0.4f}))
                     : packer.add_instance(object, place));
  }
  return {};
}

// Smoke that thins out upwards, n samples an axis.
std::vector<float> smoke_samples(int32_t n) {
  std::vector<float> samples;
  for (int32_t z = 0; z < n; ++z)
    for (int32_t y = 0; y < n; ++y)
      for (int32_t x = 0; x < n; ++x) {
        const double wave = std::sin(0.5 * x) * std::cos(0.4 * z) + 1 - 1.2 * y / n;
        samples.push_back(wave > 0 ? static_cast<float>(wave) : 0);
      }
  return samples;
}

Result<uint32_t> add_cube(ScenePacker& packer, const char* name, int32_t n, std::span<const float> samples,
                          uint32_t channels, Float3 corner, float size) {
  SPILLWAY_ASSIGN(const auto stream, to_sample_stream(packer, samples));
  VolumeInput volume{name, {}, {}, {n, n, n}, channels, stream};
  const float step = size / static_cast<float>(n);
  for (int a = 0; a < 3; ++a) volume.medium_from_lattice.m[a][a] = step, volume.medium_from_lattice.m[a][3] = corner[a];
  return packer.add_volume(volume);
}

Result<uint32_t> add_smoke(ScenePacker& packer, const char* name, int32_t n, Float3 corner, float size) {
  return add_cube(packer, name, n, smoke_samples(n), 1, corner, size);
}

// The same in three channels: as it is, turned over, and evenly, all of them times `less`.
Result<uint32_t> add_colored_smoke(ScenePacker& packer, const char* name, Float3 corner, float size, float less) {
  constexpr int32_t kSide = 24;
  const std::vector<float> grey = smoke_samples(kSide);
  std::vector<float> colors;
  for (size_t i = 0; i < grey.size(); ++i)
    for (const float value : {less * grey[i], less * grey[grey.size() - 1 - i], less * 0.5f}) colors.push_back(value);
  return add_cube(packer, name, kSide, colors, 3, corner, size);
}

// The media by number: haze, fire, milk, paint.
Status add_media(ScenePacker& packer) {
  Medium haze;
  haze.sigma_a = {0.01f, 0.01f, 0.01f}, haze.sigma_s = {0.06f, 0.06f, 0.06f}, haze.g = 0.3f;
  SPILLWAY_ASSIGN([[maybe_unused]] const uint32_t first, packer.add_medium({"haze", haze, {}}));
  Medium fire;
  fire.kind = MediumKind::grid;
  fire.sigma_a = {2, 3, 4}, fire.sigma_s = {3, 2, 1}, fire.g = -0.2f;
  fire.glow_kind = GlowKind::scaled, fire.glow = {1, 0.4f, 0.1f};
  SPILLWAY_ASSIGN(fire.density_volume, add_smoke(packer, "density", 40, {-1.7f, 0.05f, -1.5f}, 0.9f));
  SPILLWAY_ASSIGN(fire.glow_volume, add_smoke(packer, "glow", 20, {-1.6f, 0.1f, -1.4f}, 0.8f));
  SPILLWAY_ASSIGN([[maybe_unused]] const uint32_t second, packer.add_medium({"fire", fire, {}}));
  Medium milk;
  milk.sigma_a = {0.1f, 0.4f, 1.0f}, milk.sigma_s = {4, 4.5f, 5};
  SPILLWAY_ASSIGN([[maybe_unused]] const uint32_t third, packer.add_medium({"milk", milk, {}}));
  Medium paint;
  paint.kind = MediumKind::color_grid;
  paint.sigma_a = {0, 0, 0}, paint.sigma_s = {6, 6, 6}, paint.g = 0.1f;
  paint.glow_kind = GlowKind::colors, paint.glow = {0.2f, 0.3f, 0.1f};
  const Float3 corner{-0.4f, 0.05f, -1.95f};
  SPILLWAY_ASSIGN(paint.density_volume, add_colored_smoke(packer, "paint", corner, 0.8f, 1));
  SPILLWAY_ASSIGN(paint.scatter_volume, add_colored_smoke(packer, "scattering", corner, 0.8f, 0.7f));
  SPILLWAY_ASSIGN(paint.glow_volume, add_colored_smoke(packer, "shine", corner, 0.8f, 0.4f));
  SPILLWAY_ASSIGN([[maybe_unused]] const uint32_t fourth, packer.add_medium({"paint", paint, {}}));
  return {};
}

// A closed surface that divides media; without a material it does nothing else.
Status add_divider(ScenePacker& packer, const MeshData& data, MaterialId material, uint32_t inside, uint32_t outside) {
  MeshInput input;
  input.name = "divider";
  input.positions = data.positions, input.normals = data.normals, input.uvs = data.uvs, input.indices = data.indices;
  input.material = material;
  input.divides_media = true, input.medium_inside = inside, input.medium_outside = outside;
  return packer.add_mesh(input);
}

MeshData box(Float3 corner, float size) {
  MeshData mesh;
  const auto side = [&](Float3 from, Float3 u, Float3 v) {
    const MeshData face = grid(from, u, v, 1);
    const auto base = static_cast<uint32_t>(mesh.positions.size());
    mesh.positions.insert(mesh.positions.end(), face.positions.begin(), face.positions.end());
    mesh.uvs.insert(mesh.uvs.end(), face.uvs.begin(), face.uvs.end());
    for (const uint32_t i : face.indices) mesh.indices.push_back(base + i);
  };
  const Float3 x{size, 0, 0}, y{0, size, 0}, z{0, 0, size}, far = corner + x + y + z;
  side(corner, y, x), side(corner, z, y), side(corner, x, z);
  side(far, -x, -y), side(far, -y, -z), side(far, -z, -x);
  return mesh;
}

Status add_dividers(Builder& b, ScenePacker& packer) {
  SPILLWAY_TRY(add_divider(packer, box({-1.75f, 0.02f, -1.55f}, 1), {}, 1, 0));
  SPILLWAY_TRY(add_divider(packer, box({-0.42f, 0.03f, -1.97f}, 0.84f), {}, 3, 0));
  SPILLWAY_ASSIGN(const MaterialId glass, b.material(MaterialKind::dielectric, {}, 0.05f));
  return add_divider(packer, sphere({1.2f, 0.35f, -1.2f}, 0.3f, 24), glass, 2, 0);
}

// A lamp head that shines down and a shade that does not, at five places.
Status add_lamps(Builder& b, ScenePacker& packer) {
  SPILLWAY_ASSIGN(const MaterialId grey, b.material(MaterialKind::diffuse, constant(0.4f, 0.4f, 0.4f), 0));
  const uint32_t object = packer.begin_object("lamp");
  SPILLWAY_TRY(b.mesh(grid({-0.05f, 0, -0.05f}, {0.1f, 0, 0}, {0, 0, 0.1f}, 2), grey, object, {}, {9, 14, 20}));
  SPILLWAY_TRY(b.mesh(grid({-0.08f, 0.03f, -0.08f}, {0.16f, 0, 0}, {0, 0, 0.16f}, 1), grey, object));
  for (int i = 0; i < 5; ++i) {
    Affine3 place;
    place.m[0][0] = i == 3 ? -1.0f : 1.0f, place.m[2][2] = i == 1 ? 2.5f : 1.0f, place.m[0][1] = i == 4 ? 0.6f : 0.0f;
    place.m[0][3] = -1.6f + 0.8f * static_cast<float>(i), place.m[1][3] = 1.9f,
    place.m[2][3] = -0.4f * static_cast<float>(i);
    SPILLWAY_TRY(packer.add_instance(object, place));
  }
  return {};
}

Status add_everything(ScenePacker& packer, const std::filesystem::path& images, const SmallSceneOptions& options) {
  const bool moves = options.moves;
  Builder b(packer, images);
  if (options.has_media) SPILLWAY_TRY(add_media(packer));
  SPILLWAY_ASSIGN(const uint32_t check_texture, b.image("checks.png", 128, 3, checks, 1));
  SPILLWAY_ASSIGN(const uint32_t hole_texture, b.image("holes.png", 128, 1, holes, 1));
  SPILLWAY_ASSIGN(const uint32_t wave_texture, b.image("waves.png", 64, 1, waves, 0.05f));
  Param checked;
  checked.texture = check_texture;
  SPILLWAY_TRY(add_room(b, packer, checked, options.emits_image ? TextureId{check_texture} : TextureId{}));
  SPILLWAY_TRY(add_objects(b, packer, moves));
  if (options.has_media) SPILLWAY_TRY(add_dividers(b, packer));
  if (options.has_lamps) SPILLWAY_TRY(add_lamps(b, packer));
  Material fence;
  fence.reflectance = constant(0.2f, 0.5f, 0.2f);
  fence.displacement = wave_texture;
  SPILLWAY_ASSIGN(const MaterialId fence_id, packer.add_material(fence, "fence"));
  Material mix;
  mix.kind = MaterialKind::mix;
  mix.mix_material[0] = fence_id.value;
  SPILLWAY_ASSIGN(const MaterialId red, b.material(MaterialKind::diffuse, constant(0.7f, 0.1f, 0.1f), 0));
  mix.mix_material[1] = red.value;
  mix.mix_amount.texture = hole_texture;
  SPILLWAY_ASSIGN(const MaterialId mixed, packer.add_material(mix, "mix"));
  if (moves) {
    const uint32_t gate = packer.begin_object("gate");
    SPILLWAY_TRY(b.mesh(grid({-0.6f, 0, 0}, {1.2f, 0, 0}, {0, 1, 0}, 4), mixed, gate, TextureId{hole_texture}));
    Affine3 closed;
    closed.m[0][3] = 0.5f, closed.m[2][3] = -1.6f;
    SPILLWAY_TRY(packer.add_moving_instance(gate, closed, moved_on(closed, 2, {-0.3f, 0, 0})));
  }
  // Two walls with holes, one behind the other, and twice the same wall in the same place: ties.
  for (const float z : {-1.0f, 0.6f, 0.6f})
    SPILLWAY_TRY(b.mesh(grid({-1.2f, 0, z}, {2.4f, 0, 0}, {0, 1.6f, 0}, 6), mixed, 0, TextureId{hole_texture}));
  shading::Light spot{};
  spot.kind = shading::LightKind::spot;
  spot.radiance = {8, 6, 4};
  spot.position = {1.5f, 2.5f, -1.5f};
  spot.edge1 = normalize(Float3{-1, -1.5f, 1});
  spot.cos_total = 0.8f, spot.cos_falloff = 0.9f;
  SPILLWAY_TRY(packer.add_light(spot));
  shading::Light sky{};
  sky.kind = shading::LightKind::infinite;
  sky.radiance = {0.2f, 0.25f, 0.4f};
  return packer.add_light(sky);
}

}  // namespace

TemporaryDirectory::TemporaryDirectory() {
  std::string name = (std::filesystem::temp_directory_path() / "spillway-test-XXXXXX").string();
  if (mkdtemp(name.data()) == nullptr) std::abort();
  path_ = name;
}

TemporaryDirectory::~TemporaryDirectory() {
  std::error_code code;
  std::filesystem::remove_all(path_, code);
}

Result<Store> pack_small_scene(const std::filesystem::path& directory, const std::string& name,
                               const SmallSceneOptions& options) {
  PackOptions pack;
  pack.max_triangles_per_page = options.max_triangles_per_page;
  pack.max_faces_per_attribute_block = options.max_faces_per_attribute_block;
  pack.tree = options.tree;
  pack.volume_brick_voxels = options.volume_brick_voxels;
  pack.face_tile_log2 = options.face_tile_log2;
  const auto store = directory / (name + ".store");
  SPILLWAY_ASSIGN(const auto packer, ScenePacker::create(store, pack));
  SceneSettings said = settings(options);
  if (options.has_media) said.render.camera_medium = 0, said.render.max_depth += 3;
  packer->set_settings(said);
  if (options.moves)
    SPILLWAY_TRY(
        packer->set_camera_end(moved_on(settings(options).camera.world_from_camera, 0.1, {0.1f, 0.05f, 0.1f})));
  std::vector<shading::Camera> path(options.frame_count, settings(options).camera);
  for (size_t f = 0; f < path.size(); ++f) path[f].world_from_camera.m[0][3] += 0.05f * static_cast<float>(f);
  packer->set_camera_path(1, path);
  SPILLWAY_TRY(add_everything(*packer, directory, options));
  SPILLWAY_TRY(packer->finish());
  return Store::open(store);
}

}  // namespace spillway::test
