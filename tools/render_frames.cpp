#include "tools/render_frames.h"

#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <charconv>
#include <chrono>

#include "pipeline/json_text.h"
#include "pipeline/render/render_report.h"
#include "tools/commands.h"
#include "tools/sizes.h"
#include "tools/write_text.h"

namespace spillway::tools {
namespace {

using namespace pipeline;
using Clock = std::chrono::steady_clock;

constexpr size_t kMostFrames = 1 << 20;

enum class FrameEnd { rendered, skipped, failed, interrupted };

struct FrameOutcome {
  uint32_t frame = 0;
  FrameEnd end = FrameEnd::failed;
  bool has_faults = false;
  std::string what{};  // the error of a failed frame
  std::string image_hash{};
  uint32_t samples = 0;
  double seconds = 0;
  uint64_t bytes_read = 0;  // pages, attributes and texture tiles
};

const char* name(FrameEnd end) {
  static constexpr const char* kNames[] = {"rendered", "skipped", "failed", "interrupted"};
  return kNames[static_cast<size_t>(end)];
}

bool read_count(const char*& at, const char* end, uint32_t& value) {
  const auto [after, code] = std::from_chars(at, end, value);
  if (code != std::errc() || after == at) return false;
  at = after;
  return true;
}

// One item of the list: first[-last[xstep]].
bool read_range(const std::string& item, uint32_t& first, uint32_t& last, uint32_t& step) {
  const char *at = item.data(), *end = at + item.size();
  if (!read_count(at, end, first)) return false;
  last = first, step = 1;
  if (at == end) return true;
  if (*at++ != '-' || !read_count(at, end, last)) return false;
  if (at != end && (*at++ != 'x' || !read_count(at, end, step))) return false;
  return at == end && last >= first && step >= 1;
}

// What a finished picture says of itself; nothing when there is none, or it is not the one asked for.
std::optional<FrameOutcome> finished(const std::filesystem::path& output, const std::string& key, uint32_t frame,
                                     uint32_t samples) {
  if (output.extension() != ".exr") return std::nullopt;
  const auto input = OIIO::ImageInput::open(output.string());
  if (!input) {
    OIIO::geterror();
    return std::nullopt;
  }
  const OIIO::ImageSpec& spec = input->spec();
  const auto got = static_cast<uint32_t>(spec.get_int_attribute("spillway:spp"));
  const bool is_whole = got == samples || spec.get_string_attribute("spillway:ended_by") == "error";
  if (spec.get_string_attribute("spillway:frame_key") != key || !is_whole) return std::nullopt;
  return FrameOutcome{.frame = frame,
                      .end = FrameEnd::skipped,
                      .has_faults = spec.get_string_attribute("spillway:faults") != "none",
                      .image_hash = std::string(spec.get_string_attribute("spillway:image_hash")),
                      .samples = got};
}

class Batch {
 public:
  Batch(const Store& store, RenderOptions options, const FrameBatch& batch)
      : store_(store), options_(std::move(options)), batch_(batch) {}

  Status check();
  void run();
  [[nodiscard]] int exit_code() const;
  [[nodiscard]] std::string table() const;
  [[nodiscard]] nlohmann::json summary() const;

 private:
  [[nodiscard]] const FrameCamera* camera_of(uint32_t frame) const;
  [[nodiscard]] bool stopped() const { return options_.stop && options_.stop->load(); }
  Result<FrameOutcome> render_or_skip(uint32_t frame);
  Result<FrameOutcome> render_frame(uint32_t frame, const RenderOptions& options, const std::filesystem::path& output);
  void tell(const FrameOutcome& outcome) const;
  [[nodiscard]] size_t count(FrameEnd end) const;

  const Store& store_;
  RenderOptions options_;
  const FrameBatch& batch_;
  std::optional<RenderSession> session_;
  std::vector<FrameOutcome> outcomes_;
  double seconds_ = 0;
};

const FrameCamera* Batch::camera_of(uint32_t frame) const {
  const auto path = store_.camera_path();
  const auto at = std::ranges::lower_bound(path, frame, {}, &FrameCamera::frame);
  return at != path.end() && at->frame == frame ? &*at : nullptr;
}

Status Batch::check() {
  const auto path = store_.camera_path();
  if (path.empty())
    return error(
        "{}: has no camera path, so that there are no frames; render it without --frames, or make its store with "
        "one camera a frame",
        store_.directory().string());
  for (const uint32_t frame : batch_.frames)
    if (camera_of(frame) == nullptr)
      return error("{}: has no frame {}; its camera path has {} to {}", store_.directory().string(), frame,
                   path.front().frame, path.back().frame);
  if (batch_.frames.size() > 1) SPILLWAY_TRY(frame_path(batch_.output, 0));
  // The budget is refused now, not frame by frame.
  PlanOptions plan = options_.plan;
  plan.floor_bytes = memory_floor_bytes();
  SPILLWAY_ASSIGN(options_.settings, batch_.settings_of(*camera_of(batch_.frames.front())));
  SPILLWAY_TRY(plan_render(scene_facts(store_, options_), plan));
  return {};
}

void Batch::run() {
  const Clock::time_point start = Clock::now();
  for (const uint32_t frame : batch_.frames) {
    if (stopped()) break;
    const Clock::time_point frame_start = Clock::now();
    Result<FrameOutcome> outcome = render_or_skip(frame);
    if (!outcome) outcome = FrameOutcome{.frame = frame, .end = FrameEnd::failed, .what = outcome.error().message};
    outcome->seconds = std::chrono::duration<double>(Clock::now() - frame_start).count();
    tell(*outcome);
    outcomes_.push_back(std::move(*outcome));
  }
  seconds_ = std::chrono::duration<double>(Clock::now() - start).count();
}

Result<FrameOutcome> Batch::render_or_skip(uint32_t frame) {
  const bool one = batch_.frames.size() == 1 && batch_.output.find('#') == std::string::npos;
  std::filesystem::path output = batch_.output;
  if (!one) {
    SPILLWAY_ASSIGN(output, frame_path(batch_.output, frame));
  }
  RenderOptions options = options_;
  SPILLWAY_ASSIGN(options.settings, batch_.settings_of(*camera_of(frame)));
  if (auto done = finished(output, batch_.key_of(options), frame, options.settings.render.samples_per_pixel))
    return *done;
  return render_frame(frame, options, output);
}

Result<FrameOutcome> Batch::render_frame(uint32_t frame, const RenderOptions& options,
                                         const std::filesystem::path& output) {
  if (!session_) {
    SPILLWAY_ASSIGN(session_, RenderSession::open(store_, options));
  }
  SPILLWAY_ASSIGN(const RenderedImage image, session_->render(options.settings.camera, options.settings.render.camera_medium));
  SPILLWAY_TRY(batch_.write(image, options, output));
  const RenderReport& report = image.report;
  if (batch_.report.find('#') != std::string::npos) {
    SPILLWAY_ASSIGN(const std::filesystem::path path, frame_path(batch_.report, frame));
    SPILLWAY_TRY(write_text(path, report_json(report, store_.directory().string())));
  }
  const bool interrupted = report.stopped_early() && stopped();
  return FrameOutcome{
      .frame = frame,
      .end = interrupted ? FrameEnd::interrupted : FrameEnd::rendered,
      .has_faults = report.faults.any(),
      .image_hash = report.image_hash,
      .samples = report.samples_per_pixel,
      .bytes_read = report.pages.bytes_read + report.attributes.bytes_read + report.textures.bytes_read};
}

std::string line_of(const FrameOutcome& o) {
  if (o.end == FrameEnd::failed) return fmt::format("{:>7}  {:<11} {}\n", o.frame, name(o.end), o.what);
  return fmt::format("{:>7}  {:<11} {:>7} {:>10} {:>12}  {}{}\n", o.frame, name(o.end), o.samples,
                     duration_text(o.seconds), bytes_text(o.bytes_read), o.image_hash,
                     o.has_faults ? "  contributions were not finite or out of range" : "");
}

void Batch::tell(const FrameOutcome& outcome) const {
  if (!batch_.quiet) fmt::print(stderr, "{}", line_of(outcome));
}

size_t Batch::count(FrameEnd end) const {
  return static_cast<size_t>(std::ranges::count(outcomes_, end, &FrameOutcome::end));
}

int Batch::exit_code() const {
  if (stopped()) return kExitInterrupted;
  if (count(FrameEnd::failed) > 0) return kExitFailed;
  return std::ranges::any_of(outcomes_, &FrameOutcome::has_faults) ? kExitBadValues : kExitOk;
}

std::string Batch::table() const {
  std::string text =
      fmt::format("{:>7}  {:<11} {:>7} {:>10} {:>12}  {}\n", "frame", "", "samples", "time", "read", "image hash");
  for (const FrameOutcome& outcome : outcomes_) text += line_of(outcome);
  return text + fmt::format("{} frames in {}: {} rendered, {} skipped, {} failed\n", batch_.frames.size(),
                            duration_text(seconds_), count(FrameEnd::rendered), count(FrameEnd::skipped),
                            count(FrameEnd::failed));
}

nlohmann::json Batch::summary() const {
  nlohmann::json frames = nlohmann::json::array();
  for (const FrameOutcome& o : outcomes_)
    frames.push_back({{"frame", o.frame},
                      {"end", name(o.end)},
                      {"error", o.what},
                      {"image_hash", o.image_hash},
                      {"samples_per_pixel", o.samples},
                      {"seconds", o.seconds},
                      {"bytes_read", o.bytes_read},
                      {"has_faults", o.has_faults}});
  return {{"frames", frames},
          {"asked", batch_.frames.size()},
          {"rendered", count(FrameEnd::rendered)},
          {"skipped", count(FrameEnd::skipped)},
          {"failed", count(FrameEnd::failed)},
          {"seconds", seconds_}};
}

}  // namespace

Result<std::vector<uint32_t>> parse_frames(const std::string& text) {
  std::vector<uint32_t> frames;
  for (size_t from = 0; from <= text.size();) {
    const size_t comma = std::min(text.find(',', from), text.size());
    uint32_t first = 0, last = 0, step = 1;
    if (!read_range(text.substr(from, comma - from), first, last, step))
      return error("--frames {}: write numbers and ranges, such as 1-48, 1-48x2 or 3,7", text);
    if ((last - first) / step >= kMostFrames - frames.size())
      return error("--frames {}: names more than {} frames", text, kMostFrames);
    for (uint64_t frame = first; frame <= last; frame += step) frames.push_back(static_cast<uint32_t>(frame));
    from = comma + 1;
  }
  std::ranges::sort(frames);
  frames.erase(std::unique(frames.begin(), frames.end()), frames.end());
  return frames;
}

Result<std::filesystem::path> frame_path(const std::string& pattern, uint32_t frame) {
  const size_t name_at = pattern.rfind('/') == std::string::npos ? 0 : pattern.rfind('/') + 1;
  const size_t first = pattern.find('#', name_at);
  const size_t last = pattern.find_first_not_of('#', first == std::string::npos ? 0 : first);
  if (first == std::string::npos || pattern.find('#') < name_at ||
      (last != std::string::npos && pattern.find('#', last) != std::string::npos))
    return error("{}: several frames need one run of # in the file's name for their number, such as frame.####.exr",
                 pattern);
  const size_t end = std::min(last, pattern.size());
  return std::filesystem::path(pattern.substr(0, first) + fmt::format("{:0{}}", frame, end - first) +
                               pattern.substr(end));
}

Result<int> render_frames(const Store& store, RenderOptions options, const FrameBatch& batch) {
  Batch frames(store, std::move(options), batch);
  SPILLWAY_TRY(frames.check());
  frames.run();
  const std::string json = json_text(frames.summary());
  if (!batch.report.empty() && batch.report.find('#') == std::string::npos)
    SPILLWAY_TRY(write_text(batch.report, json));
  if (batch.json) fmt::print("{}\n", json);
  if (!batch.json && !batch.quiet) fmt::print(stderr, "\n{}", frames.table());
  if (frames.exit_code() == kExitInterrupted)
    fail("interrupted: the same command goes on where this one stopped; finished frames are skipped");
  if (frames.exit_code() == kExitFailed) fail("frames failed, see above; the same command renders them again");
  return frames.exit_code();
}

}  // namespace spillway::tools
