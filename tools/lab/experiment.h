#pragma once

// The experiment: a scene's axes, each configuration at several sample counts with several seeds, against a reference.
//
// Order: seeds and configurations take turns within a sample count, so that a machine that slows down slows all alike.
// Memory: a picture a configuration, two sums a pixel for each of the configurations of one axis, the reference.

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "tools/lab/axes.h"
#include "tools/lab/measure.h"
#include "tools/lab/statistics.h"

namespace spillway::tools::lab {

struct ExperimentOptions {
  std::vector<std::string> axes;
  std::vector<uint32_t> spps = {1, 4, 16, 64};
  uint32_t seed_count = 4;
  uint32_t reference_spp = 1024;
  std::filesystem::path reference_file;  // of another renderer, for axes without a reference of their own; empty: ours
  std::vector<uint64_t> memory_limits;   // of the axis `memory`; empty: planned
  // What the command line changes of the scene's settings, for all of it.
  std::function<Status(pipeline::SceneSettings&)> override_settings;
  const std::atomic<bool>* stop = nullptr;
  std::function<void(const std::string&)> tell = [](const std::string&) {};  // a line of progress
};

// Opens a scene diced at an edge length (0: as it is).
using OpenStore = std::function<Result<pipeline::Store>(float edge_length_px)>;

// A configuration at one number of samples.
struct CurvePoint {
  uint32_t spp = 0;
  double samples = 0;
  Band seconds, rel_mse, flip;
  double variance = 0;    // over the seeds: mean over pixels and channels, weighed as relMSE; 0: one seed alone
  double efficiency = 0;  // 1 / (variance x seconds)
  double read_bytes = 0, written_bytes = 0, peak_bytes = 0;  // means
  bool is_above_reference_noise = true;
};

struct Curve {
  std::string name, about;
  std::vector<CurvePoint> points;
  Slope slope;                     // of relMSE over samples, by seed, without points in the reference's noise
  PowerLaw error_of_time;          // of the means, the same points
  Picture picture;                 // of the first seed at the largest number of samples
  std::vector<float> flip;         // of that picture
  double equal_error_seconds = 0;  // to the error that AxisResult says; 0: not known
};

struct AxisResult {
  Axis axis;
  std::string left_out;  // why; then there is nothing else
  std::vector<Curve> curves;
  std::vector<std::string> remarks;
  Picture reference;
  std::string reference_about;
  double reference_noise = 0;
  double equal_error = 0;  // that curves are compared at
};

struct SceneResult {
  std::string name, facts;
  std::vector<AxisResult> axes;
  std::vector<Measurement> rows;            // of every render that was finished
  std::vector<std::string> missing_axes{};  // when it was stopped: not whole, or not begun
};

// Fails as rendering does, and for a reference that cannot be read or has another size. When it is stopped it says what
// it has and what is missing; the axis that was under way has the numbers of samples that all its configurations had.
Result<SceneResult> run_experiment(const std::string& name, const OpenStore& open, bool can_pack,
                                   const ExperimentOptions& options);

}  // namespace spillway::tools::lab
