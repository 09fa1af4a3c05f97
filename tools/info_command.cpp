#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <memory>

#include "pipeline/json_text.h"
#include "pipeline/render/film.h"
#include "pipeline/render/film_file.h"
#include "pipeline/render/plan.h"
#include "pipeline/store.h"
#include "tools/commands.h"

namespace spillway::tools {
namespace {

using nlohmann::json;
using namespace pipeline;

// Of a scene that stands still nothing.
void add_motion_facts(const Store& store, json& facts) {
  const auto moves = [](const cache::Instance& i) { return i.motion != 0; };
  const auto moving = std::count_if(store.instances().begin(), store.instances().end(), moves);
  const shading::Camera& camera = store.settings().camera;
  if (moving != 0) facts["instances_moving"] = moving;
  if (camera.motion != 0) facts["camera"] = "moves";
  if (!store.motions().empty()) facts["shutter"] = {camera.shutter_open, camera.shutter_close};
}

Result<json> store_facts(const std::filesystem::path& path) {
  SPILLWAY_ASSIGN(const Store store, Store::open(path));
  const SceneSettings& settings = store.settings();
  uint64_t page_bytes = 0, attribute_bytes = 0;
  for (const cache::PageLocation& page : store.pages()) page_bytes += page.size_bytes;
  for (const AttributeLocation& block : store.attributes()) attribute_bytes += block.size_bytes;
  json facts = {{"kind", "store"},
                {"triangles", settings.statistics.triangle_count},
                {"triangles_instanced", settings.statistics.instanced_triangle_count},
                {"triangles_of_zero_area_dropped", settings.statistics.degenerate_dropped_count},
                {"meshes", store.meshes().size()},
                {"instances", store.instances().size() - 1},
                {"materials", store.materials().size()},
                {"images", store.images().size()},
                {"face_textures", store.face_textures().size()},
                {"lights", store.lights().size()},
                {"emitting_triangles", store.emitters().size()},
                {"lights_that_shine_nothing", settings.statistics.dark_light_count},
                {"light_tree_nodes", store.light_table().tree.nodes.size()},
                {"pages", store.pages().size()},
                {"page_bytes", page_bytes},
                {"attribute_blocks", store.attributes().size()},
                {"attribute_bytes", attribute_bytes},
                {"texture_bytes", cache::TextureCache::bytes_for_all(store.images(), store.face_containers())},
                {"resolution", {settings.camera.resolution_x_px, settings.camera.resolution_y_px}},
                {"samples_per_pixel", settings.render.samples_per_pixel},
                {"max_depth", settings.render.max_depth}};
  add_motion_facts(store, facts);
  return facts;
}

Result<json> film_facts(const std::filesystem::path& path) {
  SPILLWAY_ASSIGN(const Film film, read_film(path));
  return json{{"kind", "film"},
              {"resolution", {film.shape().full_width, film.shape().full_height}},
              {"samples", {film.half_samples(0), film.half_samples(1)}},
              {"image_hash", film.hash()}};
}

Result<json> image_facts(const std::filesystem::path& path) {
  const auto input = OIIO::ImageInput::open(path.string());
  if (!input) return error("{}: is neither a store, nor a film, nor an image: {}", path.string(), OIIO::geterror());
  const OIIO::ImageSpec& spec = input->spec();
  json facts = {{"kind", "image"}, {"resolution", {spec.full_width, spec.full_height}}, {"channels", spec.channelnames}};
  for (const OIIO::ParamValue& value : spec.extra_attribs) facts[value.name().string()] = value.get_string();
  return facts;
}

Result<json> facts_of(const std::filesystem::path& path) {
  if (std::filesystem::is_directory(path)) return store_facts(path);
  if (path.extension() == ".film") return film_facts(path);
  return image_facts(path);
}

}  // namespace

void add_info_command(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("info", "facts about a store, a film file or a picture");
  struct Arguments {
    std::filesystem::path path;
    bool json = false;
  };
  auto arguments = std::make_shared<Arguments>();
  command->add_option("path", arguments->path, "a .store, .film or image")->required()->check(CLI::ExistingPath);
  command->add_flag("--json", arguments->json, "for machines");
  command->callback([arguments, &exit_code] {
    const Result<json> facts = facts_of(arguments->path);
    if (!facts) {
      exit_code = fail(facts.error().message);
      return;
    }
    if (arguments->json) {
      fmt::print("{}\n", json_text(*facts));
      return;
    }
    for (const auto& [key, value] : facts->items())
      fmt::print("{:<32} {}\n", key, value.is_string() ? value.get<std::string>() : json_text(value, -1));
  });
}

}  // namespace spillway::tools
