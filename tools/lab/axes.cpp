#include "tools/lab/axes.h"

#include <fmt/format.h>

#include <algorithm>

#include "tools/method_names.h"

namespace spillway::tools::lab {
namespace {

using pipeline::RenderOptions;
using pipeline::Store;

Configuration estimator(const char* name, const char* about) {
  const pipeline::Estimator value = kEstimators.at(name);
  return {name, about, [value](RenderOptions& o) { o.settings.render.estimator = value; }};
}

Axis estimators() {
  return {.name = "estimators",
          .title = "What is sampled at a vertex",
          .about = "All have the same mean: slope -1 in the number of samples. They differ in the constant.",
          .configurations = {estimator("mis-power", "lights and BSDF, power heuristic"),
                             estimator("mis-balance", "lights and BSDF, balance heuristic"),
                             estimator("light", "lights alone"), estimator("bsdf", "the BSDF alone"),
                             estimator("hemisphere", "directions spread evenly")}};
}

// One bounce, so that nothing but direct light is in the picture.
Axis direct_light() {
  return {.name = "direct-light",
          .title = "Direct light: by the hemisphere, by the area of the lamps",
          .about =
              "The same integral over other variables: directions of the hemisphere, points on the lamps, or what the "
              "lamps cover of the sphere. One bounce only.",
          .configurations = {estimator("mis-power", "lights and BSDF, power heuristic"),
                             estimator("hemisphere", "directions spread evenly"),
                             estimator("light-by-area", "points spread evenly over the lamps"),
                             estimator("light", "directions spread evenly over the solid angle of the lamps")},
          .apply_to_all = [](RenderOptions& o) { o.settings.render.max_depth = 1; }};
}

Axis samplers() {
  const auto of = [](shading::SamplerKind kind) {
    return [kind](RenderOptions& o) { o.settings.render.sampler = kind; };
  };
  return {
      .name = "samplers",
      .title = "Samplers",
      .about = "Independent numbers give slope -1; scrambled Sobol' points are steeper where the integrand is smooth.",
      .configurations = {{"sobol", "Owen-scrambled Sobol' pairs", of(shading::SamplerKind::sobol)},
                         {"independent", "hashes", of(shading::SamplerKind::independent)}}};
}

Axis light_selection() {
  const auto of = [](const char* name, const char* about) -> Configuration {
    const pipeline::LightSelection value = kLightSelections.at(name);
    return {name, about, [value](RenderOptions& o) { o.settings.render.light_selection = value; }};
  };
  return {.name = "light-selection",
          .title = "How a light is chosen",
          .about = "A tree asks how much of each group's light can arrive here; power and uniform do not ask.",
          .configurations = {of("tree", "by what may arrive (by power in scenes with few lights)"),
                             of("power", "by what is emitted"), of("uniform", "all alike")}};
}

Axis roulette() {
  const auto of = [](uint32_t value) { return [value](RenderOptions& o) { o.settings.render.roulette = value; }; };
  return {.name = "roulette",
          .title = "Russian roulette",
          .about = "Ending dim paths early costs variance and saves time: the efficiency says which is more.",
          .configurations = {{"roulette", "dim paths end early", of(1)},
                             {"no-roulette", "all go to the last bounce", of(0)}}};
}

// The mean over a pixel of the image itself is what point lookups converge to: filters are held against that.
Axis texture_filter() {
  const auto of = [](const char* name, const char* about) -> Configuration {
    const pipeline::TextureFilter value = kTextureFilters.at(name);
    return {name, about, [value](RenderOptions& o) { o.settings.render.texture_filter = value; }};
  };
  return {.name = "texture-filter",
          .title = "Texture filters",
          .about =
              "Filtering trades noise for a difference that no number of samples removes: curves that level off are "
              "biased against the reference, which is made of point lookups.",
          .configurations = {of("of-texture", "as each texture says"), of("point", "the nearest texel"),
                             of("bilinear", "four texels of one level"), of("trilinear", "two levels")},
          .apply_to_reference = [value = kTextureFilters.at("point")](RenderOptions& o) {
            o.settings.render.texture_filter = value;
          }};
}

Axis dicing() {
  Axis axis{.name = "dicing",
            .title = "How finely surfaces are diced",
            .about = "The longest edge in pixels. Coarse surfaces are another shape: their curves level off."};
  for (const float edge : {4.0f, 1.0f, 2.0f, 8.0f, 16.0f})
    axis.configurations.push_back(
        {fmt::format("{} px", edge), "longest edge of a diced triangle", [](RenderOptions&) {}, edge});
  axis.reference_edge_length_px = 0.5f;
  return axis;
}

Axis majorants() {
  const auto of = [](const char* name, const char* about) -> Configuration {
    const pipeline::MajorantExtent value = kMajorants.at(name);
    return {name, about, [value](RenderOptions& o) { o.settings.render.majorants = value; }};
  };
  return {.name = "majorants",
          .title = "Bounds of a medium's density",
          .about = "Loose bounds cost steps and do not change the mean.",
          .configurations = {of("cell", "of a cell of 8 voxels a side"), of("brick", "of a brick"),
                             of("grid", "of the whole grid")}};
}

// What everything takes, and the smallest budget that the plan accepts.
Result<std::pair<uint64_t, uint64_t>> memory_range(const Store& store, const RenderOptions& options) {
  pipeline::PlanOptions plan = options.plan;
  plan.floor_bytes = pipeline::memory_floor_bytes();
  plan.memory_bytes = 0;
  const pipeline::SceneFacts facts = pipeline::scene_facts(store, options);
  SPILLWAY_ASSIGN(const pipeline::Plan all, pipeline::plan_render(facts, plan));
  uint64_t low = 0, high = all.memory_bytes;
  while (high - low > 1 << 20) {
    plan.memory_bytes = low + (high - low) / 2;
    (pipeline::plan_render(facts, plan) ? high : low) = plan.memory_bytes;
  }
  return std::pair(high, all.memory_bytes);
}

Configuration memory_limit(uint64_t bytes) {
  return {pipeline::bytes_text(bytes), "of the whole process",
          [bytes](RenderOptions& o) { o.plan.memory_bytes = bytes; }};
}

Result<Axis> memory(const Store& store, const RenderOptions& options, std::vector<uint64_t> limits) {
  Axis axis{.name = "memory",
            .title = "The memory limit",
            .about = "Another budget reads and writes other bytes in other time; the picture keeps its bits.",
            .keeps_bits = true};
  axis.configurations.push_back(
      {"no limit", "everything stays in memory", [](RenderOptions& o) { o.plan.memory_bytes = 0; }});
  if (limits.empty()) {
    SPILLWAY_ASSIGN(const auto range, memory_range(store, options));
    const uint64_t span = range.second - range.first;
    limits = {range.first + span / 2, range.first + span / 8, range.first};
  }
  for (const uint64_t bytes : limits) axis.configurations.push_back(memory_limit(bytes));
  return axis;
}

Axis wave_size() {
  Axis axis{.name = "wave",
            .title = "The size of a wave",
            .about = "Larger waves share more reads and leave the processor's caches; the picture keeps its bits.",
            .keeps_bits = true};
  axis.configurations.push_back({"planned", "as the plan says", [](RenderOptions& o) { o.plan.wave_paths = 0; }});
  for (const uint64_t paths : {uint64_t{1} << 12, uint64_t{1} << 14, uint64_t{1} << 18, uint64_t{1} << 20})
    axis.configurations.push_back({fmt::format("{} Ki paths", paths >> 10), "paths a wave",
                                   [paths](RenderOptions& o) { o.plan.wave_paths = paths; }});
  return axis;
}

const std::vector<std::pair<std::string, Axis (*)()>> kAxes = {
    {"estimators", estimators}, {"direct-light", direct_light},
    {"samplers", samplers},     {"light-selection", light_selection},
    {"roulette", roulette},     {"texture-filter", texture_filter},
    {"dicing", dicing},         {"majorants", majorants},
    {"memory", nullptr},        {"wave", wave_size}};

}  // namespace

std::vector<std::string> axis_names() {
  std::vector<std::string> names;
  for (const auto& [name, make] : kAxes) names.push_back(name);
  return names;
}

Result<std::vector<std::string>> chosen_axes(const std::vector<std::string>& names) {
  const std::vector<std::string> all = axis_names();
  std::vector<std::string> chosen;
  for (const std::string& name : names) {
    if (name == "all") return all;
    if (std::find(all.begin(), all.end(), name) == all.end())
      return error("--axis {}: there is no such axis; there are {} and all", name, fmt::join(all, ", "));
    if (std::find(chosen.begin(), chosen.end(), name) == chosen.end()) chosen.push_back(name);
  }
  return chosen;
}

Result<Axis> make_axis(const std::string& name, const Store& store, const RenderOptions& options,
                       const std::vector<uint64_t>& memory_limits) {
  if (name == "memory") return memory(store, options, memory_limits);
  for (const auto& [known, make] : kAxes)
    if (known == name) return make();
  return error("{}: there is no such axis", name);
}

std::string why_left_out(const Axis& axis, const Store& store, bool can_pack) {
  if (axis.name == "texture-filter" && store.images().empty() && store.face_textures().empty())
    return "the scene has no images";
  if (axis.name == "majorants" && store.medium_tables().volumes.bricks.empty())
    return "the scene has no grids of density";
  if (axis.name == "dicing" && store.dicing() == nullptr) return "nothing in the scene is diced";
  if (axis.name == "dicing" && !can_pack) return "a store cannot be diced again: name the .pbrt scene";
  return {};
}

}  // namespace spillway::tools::lab
