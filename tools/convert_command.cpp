#include <fmt/format.h>

#include <memory>

#include "pipeline/pack/convert_face_texture.h"
#include "tools/commands.h"

namespace spillway::tools {
namespace {

struct Arguments {
  std::string from, to, encoding = "linear", compression = "lz4";
  float gamma = 2.2f;
};

int run(const Arguments& a) {
  pipeline::ConvertOptions options;
  if (a.encoding == "sRGB") options.encoding.kind = cache::FaceTexEncoding::srgb;
  if (a.encoding == "gamma") options.encoding = {cache::FaceTexEncoding::gamma, a.gamma};
  if (a.compression == "zstd") options.codec = cache::FaceTexCodec::zstd;
  if (a.compression == "none") options.codec = cache::FaceTexCodec::none;
  const Status converted = pipeline::convert_face_texture(a.from, a.to, options);
  return converted ? kExitOk : fail(converted.error().message);
}

}  // namespace

void add_convert_command(CLI::App& app, int& exit_code) {
  auto* command =
      app.add_subcommand("convert", "turn a face texture (.ptx, .facetex, .exr) into another kind of file");
  auto arguments = std::make_shared<Arguments>();
  command->add_option("from", arguments->from, "what to read")->required();
  command->add_option("to", arguments->to, "what to write: its name says the kind")->required();
  command->add_option("--encoding", arguments->encoding, "of the integers of a .ptx file [linear]")
      ->check(CLI::IsMember({"linear", "sRGB", "gamma"}));
  command->add_option("--gamma", arguments->gamma, "with --encoding gamma [2.2]")->check(positive());
  command->add_option("--compression", arguments->compression, "of a .facetex file; zstd is smaller [lz4]")
      ->check(CLI::IsMember({"lz4", "zstd", "none"}));
  command->callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

}  // namespace spillway::tools
