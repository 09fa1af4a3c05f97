// Face textures and other programs: conversion both ways, and OpenImageIO's plugin.

#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <map>
#include <string>

#include "pipeline/pack/convert_face_texture.h"
#include "pipeline/pack/ptx_file.h"
#include "tests/support/small_scene.h"

namespace spillway::tools {
namespace {

namespace fs = std::filesystem;
using pipeline::convert_face_texture;
using pipeline::PtxFile;

class FaceTexTools : public testing::Test {
 protected:
  static fs::path reference(const std::string& name) {
    return fs::path(SPILLWAY_SOURCE_DIR) / "tests/data/ptex" / (name + ".ptx");
  }
  fs::path file(const std::string& name) const { return directory_.path() / name; }
  void convert(const fs::path& from, const fs::path& to) {
    const Status done = convert_face_texture(from, to, {});
    ASSERT_TRUE(done) << done.error().message;
  }
  static std::string bytes(const fs::path& path) {
    std::ifstream stream(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
  }
  int run(const std::string& command) const {
    return std::system((command + " > " + file("out.txt").string() + " 2>&1").c_str());
  }

  test::TemporaryDirectory directory_;
};

TEST_F(FaceTexTools, ptx_becomes_facetex_becomes_exr_and_comes_back_texel_for_texel) {
  for (const char* name : {"cube", "cube_half", "cube_rgba", "quads60", "subface_prism6", "tri"}) {
    convert(reference(name), file("a.facetex"));
    convert(file("a.facetex"), file("b.exr"));
    convert(file("b.exr"), file("c.facetex"));
    EXPECT_TRUE(bytes(file("a.facetex")) == bytes(file("c.facetex"))) << name;
    convert(file("b.exr"), file("d.ptx"));
    const auto before = PtxFile::open(reference(name), {.premultiply = true}), after = PtxFile::open(file("d.ptx"));
    ASSERT_TRUE(before && after) << name;
    EXPECT_EQ(after->info().alpha_channel, before->info().alpha_channel);
    for (uint32_t f = 0; f < before->faces().size(); ++f) {
      EXPECT_TRUE(*before->texels(f) == *after->texels(f)) << name << ' ' << f;
      EXPECT_TRUE(std::equal(std::begin(before->faces()[f].adjacent_faces), std::end(before->faces()[f].adjacent_faces),
                             after->faces()[f].adjacent_faces));
    }
    for (const auto& entry : fs::directory_iterator(directory_.path()))
      EXPECT_EQ(entry.path().string().find(".tmp"), std::string::npos);
  }
}

// Whichever kind a file comes from, each other kind of it has the same bytes (an EXR, which tells the time at which it
// was written, when it is brought back).
TEST_F(FaceTexTools, every_kind_becomes_every_other) {
  for (const char* name : {"cube", "quads60", "tri"}) {
    std::map<std::string, std::string> first;
    fs::copy_file(reference(name), file("from.ptx"),
                  fs::copy_options::overwrite_existing);  // the file names the texture
    for (const char* kind : {"facetex", "exr"}) convert(file("from.ptx"), file(std::string("from.") + kind));
    for (const char* from : {"ptx", "facetex", "exr"})
      for (const std::string to : {"ptx", "facetex", "exr"}) {
        convert(file(std::string("from.") + from), file("to." + to));
        if (to == "exr") convert(file("to.exr"), file("back.facetex"));
        const std::string got = bytes(file(to == "exr" ? "back.facetex" : "to." + to));
        EXPECT_TRUE(first.emplace(to, got).first->second == got) << name << ": " << from << " to " << to;
      }
  }
}

TEST_F(FaceTexTools, an_ordinary_exr_becomes_one_quad_with_its_lowest_row_first) {
  const float pixels[] = {1, 2, 3, 4, 5, 6, 7, 8};  // two rows of four
  const auto output = OIIO::ImageOutput::create(file("plain.exr").string());
  ASSERT_TRUE(output && output->open(file("plain.exr").string(), OIIO::ImageSpec(4, 2, 1, OIIO::TypeFloat)));
  ASSERT_TRUE(output->write_image(OIIO::TypeFloat, pixels) && output->close());
  convert(file("plain.exr"), file("one.ptx"));
  const auto ptx = PtxFile::open(file("one.ptx"));
  ASSERT_TRUE(ptx) << ptx.error().message;
  ASSERT_EQ(ptx->faces().size(), 1u);
  const auto texels = ptx->texels(0);
  float first = 0;
  std::memcpy(&first, texels->data(), sizeof first);
  EXPECT_EQ(first, 5);
}

TEST_F(FaceTexTools, what_cannot_be_converted_is_refused_and_leaves_nothing) {
  EXPECT_FALSE(convert_face_texture(reference("cube"), file("a.png"), {}));
  EXPECT_FALSE(convert_face_texture(file("missing.ptx"), file("a.facetex"), {}));
  std::ofstream(file("bad.ptx")) << "Ptex and no more";
  EXPECT_FALSE(convert_face_texture(file("bad.ptx"), file("a.exr"), {}));
  fs::remove(file("bad.ptx"));
  EXPECT_TRUE(fs::is_empty(directory_.path()));
}

TEST_F(FaceTexTools, the_program_converts) {
  const std::string program = SPILLWAY_PROGRAM;
  EXPECT_EQ(run(program + " convert " + reference("cube").string() + " " + file("a.facetex").string() +
                " --compression zstd"),
            0);
  EXPECT_TRUE(fs::exists(file("a.facetex")));
  EXPECT_NE(run(program + " convert " + file("none.ptx").string() + " " + file("b.facetex").string()), 0);
}

#ifndef __SANITIZE_ADDRESS__  // oiiotool as installed has no runtime of the sanitizer, which the plugin then needs
TEST_F(FaceTexTools, oiiotool_opens_facetex_files_with_the_plugin) {
  convert(reference("cube"), file("cube.facetex"));
  const fs::path plugins = fs::path(SPILLWAY_PROGRAM).parent_path() / "plugins";
  ASSERT_TRUE(fs::exists(plugins / "facetex.imageio.so"));
  const std::string oiiotool = "OIIO_LIBRARY_PATH=" + plugins.string() + " oiiotool ";
  ASSERT_EQ(run(oiiotool + "--info -v -a " + file("cube.facetex").string()), 0) << bytes(file("out.txt"));
  const std::string info = bytes(file("out.txt"));
  EXPECT_NE(info.find("facetex"), std::string::npos) << info;
  EXPECT_NE(info.find("64 x   96, 3 channel"), std::string::npos) << info;  // six faces of 32 x 32, two side by side
  ASSERT_EQ(run(oiiotool + file("cube.facetex").string() + " --subimage 1 -o " + file("level.exr").string()), 0)
      << bytes(file("out.txt"));
  const auto input = OIIO::ImageInput::open(file("level.exr").string());
  ASSERT_TRUE(input);
  EXPECT_EQ(input->spec().width, 64);
  EXPECT_EQ(input->spec().height, 32);  // six of 16 x 16, four side by side
  // Texel for texel what a .facetex reader sees.
  std::vector<float> pixels(64 * 32 * 3);
  ASSERT_TRUE(input->read_image(0, 0, 0, 3, OIIO::TypeFloat, pixels.data()));
  const auto facetex = cache::FaceTexFile::open(file("cube.facetex"), {});
  ASSERT_TRUE(facetex);
  const auto texels = facetex->texels(facetex->textures()[0], 1, 1);
  for (uint32_t y = 0; y < 16; ++y)
    for (uint32_t x = 0; x < 48; ++x)
      EXPECT_NEAR(pixels[(y * 64 + 16) * 3 + x], static_cast<float>((*texels)[y * 48 + x]) / 255, 1e-3f);
}
#endif

}  // namespace
}  // namespace spillway::tools
