#include "tools/lab/experiment.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "tools/lab/summarize.h"
#include "tools/metrics/flip.h"
#include "tools/metrics/image_metrics.h"

namespace spillway::tools::lab {
namespace {

using pipeline::RenderOptions;
using pipeline::Store;

// Seeds of measurements begin here; the reference has one of its own.
constexpr uint32_t kFirstSeed = 1, kReferenceSeed = 0x5eed;

class Experiment {
 public:
  Experiment(const std::string& name, const OpenStore& open, bool can_pack, const ExperimentOptions& options)
      : open_(open), can_pack_(can_pack), options_(options) {
    result_.name = name;
  }

  Result<SceneResult> run() {
    SPILLWAY_ASSIGN(const Store* const store, store_at(0));
    SPILLWAY_ASSIGN(base_, base_options(*store));
    result_.facts = facts(*store);
    for (size_t i = 0; i < options_.axes.size(); ++i) {
      SPILLWAY_ASSIGN(Axis axis, make_axis(options_.axes[i], *store, base_, options_.memory_limits));
      AxisResult result;
      result.axis = std::move(axis);
      result.left_out = why_left_out(result.axis, *store, can_pack_);
      if (result.left_out.empty()) {
        const Status ran = run_axis(*store, result);
        if (!ran && !is_stopped()) return ran.error();
        if (!ran) result_.missing_axes.push_back(options_.axes[i]);
      }
      result_.axes.push_back(std::move(result));
      if (!is_stopped()) continue;
      result_.missing_axes.insert(result_.missing_axes.end(), options_.axes.begin() + static_cast<ptrdiff_t>(i) + 1,
                                  options_.axes.end());
      break;
    }
    return std::move(result_);
  }

 private:
  struct Reference {
    Picture picture;
    std::string about;
    double noise = 0;
  };

  [[nodiscard]] bool is_stopped() const { return options_.stop != nullptr && *options_.stop; }

  // Stores are diced for the scene's own resolution; edges are counted in pixels of the frame that is rendered.
  [[nodiscard]] float edge_of_store(const Store& store, float edge_length_px) const {
    const auto px_per_radian = [](const shading::Camera& c) {
      return std::max(static_cast<float>(c.resolution_x_px) / c.tan_half_fov_x,
                      static_cast<float>(c.resolution_y_px) / c.tan_half_fov_y);
    };
    return edge_length_px * (px_per_radian(store.settings().camera) / px_per_radian(base_.settings.camera));
  }

  // 0: the scene as it is.
  Result<const Store*> store_at(float edge_length_px) {
    if (edge_length_px > 0) {
      SPILLWAY_ASSIGN(const Store* const own, store_at(0));
      edge_length_px = edge_of_store(*own, edge_length_px);
      if (own->dicing() != nullptr && own->dicing()->edge_length_px == edge_length_px)
        return static_cast<const Store*>(own);
    }
    const auto found = stores_.find(edge_length_px);
    if (found != stores_.end()) return static_cast<const Store*>(found->second.get());
    SPILLWAY_ASSIGN(Store store, open_(edge_length_px));
    auto& place = stores_[edge_length_px] = std::make_unique<Store>(std::move(store));
    return static_cast<const Store*>(place.get());
  }

  Result<RenderOptions> base_options(const Store& store) const {
    RenderOptions options;
    options.settings = store.settings();
    if (options_.override_settings) SPILLWAY_TRY(options_.override_settings(options.settings));
    options.stop = options_.stop;
    return options;
  }

  [[nodiscard]] std::string facts(const Store& store) const {
    const pipeline::SceneFacts f = pipeline::scene_facts(store, base_);
    const pipeline::PixelWindow window = pipeline::pixel_window(base_.settings);
    return fmt::format(
        "{} unique triangles, {} as seen; geometry {}, attributes {}, textures {}; {} x {} pixels, {} bounces",
        store.settings().statistics.triangle_count, store.settings().statistics.instanced_triangle_count,
        pipeline::bytes_text(f.trace_bytes), pipeline::bytes_text(f.attribute_bytes),
        pipeline::bytes_text(f.texture_bytes), window.x1 - window.x0, window.y1 - window.y0, f.max_depth);
  }

  Result<MeasuredPicture> render(const Store& store, const RenderOptions& options) const {
    SPILLWAY_ASSIGN(MeasuredPicture measured, render_measured(store, options));
    if (is_stopped()) return error("interrupted");
    return measured;
  }

  Result<Reference> read_reference() const {
    SPILLWAY_ASSIGN(Picture picture, read_picture(options_.reference_file));
    const pipeline::PixelWindow window = pipeline::pixel_window(base_.settings);
    const int width = static_cast<int>(window.x1 - window.x0), height = static_cast<int>(window.y1 - window.y0);
    if (picture.width != width || picture.height != height)
      return error("{}: has {} x {} pixels; the frame has {} x {}: see --resolution", options_.reference_file.string(),
                   picture.width, picture.height, width, height);
    Reference reference{std::move(picture), options_.reference_file.filename().string(), 0};
    reference.noise = noise_of_halves(reference.picture);
    return reference;
  }

  Result<Reference> render_reference(const Axis& axis) {
    SPILLWAY_ASSIGN(const Store* const store, store_at(axis.reference_edge_length_px));
    RenderOptions options = base_;
    if (axis.apply_to_all) axis.apply_to_all(options);
    if (axis.apply_to_reference) axis.apply_to_reference(options);
    options.settings.render.samples_per_pixel = options_.reference_spp, options.settings.render.seed = kReferenceSeed;
    options_.tell(
        fmt::format("{}, {}: reference, {} samples a pixel", result_.name, axis.name, options_.reference_spp));
    SPILLWAY_ASSIGN(MeasuredPicture measured, render(*store, options));
    Reference reference{std::move(measured.picture), fmt::format("our own, {} samples a pixel", measured.row.spp), 0};
    reference.noise = noise_of_halves(reference.picture);
    return reference;
  }

  // Shared by the axes that render what the scene says.
  Result<const Reference*> reference_of(const Axis& axis) {
    auto& place = references_[axis.has_own_reference() ? axis.name : ""];
    if (place == nullptr) {
      const bool is_file = !options_.reference_file.empty() && !axis.has_own_reference();
      SPILLWAY_ASSIGN(Reference reference, is_file ? read_reference() : render_reference(axis));
      place = std::make_unique<Reference>(std::move(reference));
    }
    return static_cast<const Reference*>(place.get());
  }

  Result<MeasuredPicture> measure(const Axis& axis, const Configuration& configuration, uint32_t spp, uint32_t seed,
                                  const Picture& reference) {
    SPILLWAY_ASSIGN(const Store* const store, store_at(configuration.edge_length_px));
    RenderOptions options = base_;
    if (axis.apply_to_all) axis.apply_to_all(options);
    configuration.apply(options);
    options.settings.render.samples_per_pixel = spp, options.settings.render.seed = seed;
    SPILLWAY_ASSIGN(MeasuredPicture measured, render(*store, options));
    Measurement& row = measured.row;
    row.scene = result_.name, row.axis = axis.name, row.configuration = configuration.name;
    const auto mask = metric_mask(measured.picture, reference, {});
    row.rel_mse = tools::rel_mse(measured.picture, reference, mask);
    const std::vector<float> map = flip(measured.picture, reference);
    double sum = 0;
    for (const float v : map) sum += v;
    row.flip = sum / static_cast<double>(map.size());
    return measured;
  }

  // All configurations at one number of samples, taking turns.
  Status run_samples(AxisResult& result, uint32_t spp, bool is_last) {
    std::vector<std::vector<Measurement>> rows(result.curves.size());
    const Status ran = measure_in_turns(result, spp, is_last, rows);
    for (const auto& own : rows) result_.rows.insert(result_.rows.end(), own.begin(), own.end());
    return ran;
  }

  // rows: by configuration.
  Status measure_in_turns(AxisResult& result, uint32_t spp, bool is_last,
                          std::vector<std::vector<Measurement>>& rows) {
    std::vector<PixelVariance> variances(result.curves.size());
    for (uint32_t seed = kFirstSeed; seed < kFirstSeed + options_.seed_count; ++seed)
      for (size_t c = 0; c < result.curves.size(); ++c) {
        SPILLWAY_ASSIGN(MeasuredPicture measured,
                        measure(result.axis, result.axis.configurations[c], spp, seed, result.reference));
        variances[c].add(measured.picture);
        rows[c].push_back(measured.row);
        if (is_last && seed == kFirstSeed) {
          result.curves[c].flip = flip(measured.picture, result.reference);
          result.curves[c].picture = std::move(measured.picture);
        }
      }
    for (size_t c = 0; c < result.curves.size(); ++c)
      result.curves[c].points.push_back(
          curve_point(rows[c], variances[c].relative_to(result.reference), result.reference_noise));
    return {};
  }

  Status run_axis(const Store& store, AxisResult& result) {
    SPILLWAY_ASSIGN(const Reference* const reference, reference_of(result.axis));
    result.reference = reference->picture, result.reference_about = reference->about;
    result.reference_noise = reference->noise;
    for (const Configuration& c : result.axis.configurations) {
      Curve curve;
      curve.name = c.name, curve.about = c.about;
      result.curves.push_back(std::move(curve));
    }
    const size_t first_row = result_.rows.size();
    Status ran;
    for (size_t i = 0; i < options_.spps.size() && ran; ++i) {
      const uint32_t spp = options_.spps[i];
      options_.tell(fmt::format("{}, {}: {} samples a pixel, {} configurations, {} seeds", result_.name,
                                result.axis.name, spp, result.curves.size(), options_.seed_count));
      ran = run_samples(result, spp, spp == options_.spps.back());
    }
    // Other axes plan with what is in memory: of the scene alone.
    std::erase_if(stores_, [](const auto& entry) { return entry.first != 0; });
    if (!result.curves.front().points.empty())
      finish_axis(store, std::span(result_.rows).subspan(first_row), result);
    return ran;
  }

  void finish_axis(const Store& store, std::span<const Measurement> rows, AxisResult& result) const {
    for (Curve& curve : result.curves) {
      std::vector<Measurement> own;
      for (const Measurement& row : rows)
        if (row.configuration == curve.name) own.push_back(row);
      fit_curve(own, curve);
    }
    compare_at_equal_error(result);
    if (result.axis.keeps_bits) result.remarks.push_back(equality_of_bits(rows));
    if (result.axis.name == "light-selection" && store.light_table().tree.empty())
      result.remarks.push_back("The scene has too few lights for a tree: `tree` chooses by power.");
    if (const Band& last = result.curves.front().points.back().rel_mse; last.high > 4 * last.low)
      result.remarks.push_back(
          "Heavy tails: a few pixels carry most of the squared error, so that its bands are wide and its order may be "
          "chance. FLIP, which bounds what a pixel counts, says more.");
    for (const Curve& curve : result.curves)
      for (const CurvePoint& p : curve.points)
        if (!p.is_above_reference_noise) {
          result.remarks.push_back(
              "Hollow points are within four times the noise of the reference: they are left out of "
              "slopes and times. More --reference-spp would measure them.");
          return;
        }
  }

  const OpenStore& open_;
  bool can_pack_;
  const ExperimentOptions& options_;
  SceneResult result_;
  RenderOptions base_;
  std::map<float, std::unique_ptr<Store>> stores_;
  std::map<std::string, std::unique_ptr<Reference>> references_;
};

}  // namespace

Result<SceneResult> run_experiment(const std::string& name, const OpenStore& open, bool can_pack,
                                   const ExperimentOptions& options) {
  return Experiment(name, open, can_pack, options).run();
}

}  // namespace spillway::tools::lab
