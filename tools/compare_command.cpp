#include <memory>

#include "tools/commands.h"
#include "tools/compare_images.h"
#include "tools/sizes.h"

namespace spillway::tools {
namespace {

struct CompareArguments {
  std::filesystem::path a, b;
  CompareImagesOptions options;
  std::vector<std::string> excluded;
};

Status read_excluded(CompareArguments& arguments) {
  for (const std::string& text : arguments.excluded) {
    SPILLWAY_ASSIGN(const Crop c, parse_crop(text));
    arguments.options.metrics.excluded.push_back({static_cast<int>(c.x0), static_cast<int>(c.y0),
                                                  static_cast<int>(c.x1), static_cast<int>(c.y1)});
  }
  return {};
}

void add_limits(CLI::App& command, CompareLimits& limits) {
  command.add_flag("--same-bits", limits.same_bits, "equal only when every pixel has the same bits");
  command.add_flag("--statistical", limits.statistical, "equal within the noise that half buffers tell");
  command.add_option("--relmse", limits.rel_mse, "at most this relative squared error");
  command.add_option("--flip", limits.flip, "at most this mean FLIP");
  command.add_option("--correlation", limits.correlation, "at least this correlation of block means");
  command.add_option("--mean", limits.mean_deviation, "at most this deviation of the means' ratio from one");
}

}  // namespace

void add_compare_command(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("compare", "how far two pictures are apart; exit code 1 when they differ");
  auto arguments = std::make_shared<CompareArguments>();
  command->add_option("a", arguments->a, "a picture")->required()->check(CLI::ExistingFile);
  command->add_option("b", arguments->b, "the reference")->required()->check(CLI::ExistingFile);
  add_limits(*command, arguments->options.metrics.limits);
  command->add_option("--block", arguments->options.metrics.block_size, "side of the blocks in pixels [32]");
  command->add_option("--exposure", arguments->options.metrics.exposure_stops, "stops, for FLIP [0]");
  command->add_option("--exclude", arguments->excluded, "x0,y0,x1,y1: a rectangle to pass over; may be repeated");
  command->add_option("--flip-png", arguments->options.flip_png, "write FLIP as a picture");
  command->add_option("--difference-png", arguments->options.difference_png, "write the relative difference as a picture");
  command->add_flag("--json", arguments->options.json, "for machines");
  command->callback([arguments, &exit_code] {
    const Status usage = read_excluded(*arguments);
    exit_code = usage ? compare_images(arguments->a, arguments->b, arguments->options)
                      : fail(usage.error().message, kExitUsage);
  });
}

}  // namespace spillway::tools
