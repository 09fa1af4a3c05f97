#pragma once

// The axes of the laboratory: what is compared, one thing at a time.

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "cache/base/result.h"
#include "pipeline/render/render_image.h"

namespace spillway::tools::lab {

struct Configuration {
  std::string name;
  std::string about;  // half a sentence for the page
  std::function<void(pipeline::RenderOptions&)> apply;
  float edge_length_px = 0;  // of a store of its own; 0: the scene's
};

// The first configuration is the one that the renderer takes by itself; the others are held against it.
struct Axis {
  std::string name;
  std::string title;
  std::string about;        // what differs, and what theory says of it
  bool keeps_bits = false;  // a performance option: the pictures must be equal
  std::vector<Configuration> configurations = {};
  // Of all configurations and of their reference; none: the settings of the scene.
  std::function<void(pipeline::RenderOptions&)> apply_to_all = {};
  // Of the reference alone, where the renderer's choice is not the exact one.
  std::function<void(pipeline::RenderOptions&)> apply_to_reference = {};
  float reference_edge_length_px = 0;
  [[nodiscard]] bool has_own_reference() const {
    return apply_to_all || apply_to_reference || reference_edge_length_px > 0;
  }
};

// In the order of the page.
[[nodiscard]] std::vector<std::string> axis_names();

// A list of names, or `all`. Fails for a name that is none, saying which there are.
Result<std::vector<std::string>> chosen_axes(const std::vector<std::string>& names);

// The axis for a store. memory_limits: of the axis `memory`; empty: planned from the scene.
Result<Axis> make_axis(const std::string& name, const pipeline::Store& store, const pipeline::RenderOptions& options,
                       const std::vector<uint64_t>& memory_limits);

// Why an axis says nothing about a scene; empty when it does.
[[nodiscard]] std::string why_left_out(const Axis& axis, const pipeline::Store& store, bool can_pack);

}  // namespace spillway::tools::lab
