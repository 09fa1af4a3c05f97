// The program as people and scripts use it: what it leaves behind, what it says, and its exit codes.

#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/support/run_command.h"
#include "tests/support/small_scene.h"

namespace spillway::tools {
namespace {

namespace fs = std::filesystem;

using test::Ended;
using test::run_command;

constexpr std::string_view kScene = R"(LookAt 0 0 5  0 0 0  0 1 0
Camera "perspective" "float fov" 40
Film "rgb" "integer xresolution" 24 "integer yresolution" 16
WorldBegin
LightSource "infinite" "rgb L" [0.2 0.3 0.4]
AreaLightSource "diffuse" "rgb L" [5 5 5]
Shape "trianglemesh" "point3 P" [-1 3 -1  1 3 -1  1 3 1  -1 3 1] "integer indices" [0 1 2 0 2 3]
)";

class ProgramTest : public testing::Test {
 protected:
  Ended spillway(const std::string& arguments) { return run_command("cd " + folder_.string() + " && " SPILLWAY_PROGRAM " " + arguments); }
  // Renders what follows WorldBegin in kScene.
  Ended render(const std::string& body, const std::string& more = "") {
    write("scene.pbrt", std::string(kScene) + body);
    return spillway("render scene.pbrt -o out.exr --spp 2 -q " + more);
  }
  void write(const std::string& name, const std::string& bytes) {
    std::ofstream(folder_ / name, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  }
  [[nodiscard]] bool exists(const std::string& name) const { return fs::exists(folder_ / name); }
  void expect_refused(const Ended& ended, std::initializer_list<const char*> parts) {
    EXPECT_EQ(ended.code, 3) << ended.said;
    for (const char* part : parts) EXPECT_NE(ended.said.find(part), std::string::npos) << part << " in: " << ended.said;
    EXPECT_FALSE(exists("out.exr"));
    for (const auto& entry : fs::directory_iterator(folder_))
      EXPECT_EQ(entry.path().string().find(".tmp"), std::string::npos) << entry.path();
  }

  static std::string a_texture() {
    for (const auto& entry : fs::directory_iterator(SPILLWAY_SOURCE_DIR "/tests/data/courtyard/textures"))
      if (entry.path().extension() == ".png") return entry.path();
    return {};
  }

  test::TemporaryDirectory directory_;
  const fs::path folder_ = directory_.path();
  const std::string courtyard_ = SPILLWAY_SOURCE_DIR "/tests/data/courtyard/courtyard.pbrt";
};

constexpr const char* kPlyHeader =
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n";

TEST_F(ProgramTest, a_scene_becomes_a_picture_a_report_and_a_timeline) {
  const Ended first = spillway("render " + courtyard_ + " --store c.store -o a.exr --resolution 64x36 --spp 4 --aov "
                               "--half-buffers --memory 512MiB --report r.json --trace t.json");
  ASSERT_EQ(first.code, 0) << first.said;
  for (const char* part : {"rays/s", "trace_rays", "untagged", "again"})
    EXPECT_NE(first.said.find(part), std::string::npos) << part;
  std::ifstream report_file(folder_ / "r.json"), trace_file(folder_ / "t.json");
  const auto report = nlohmann::json::parse(report_file), trace = nlohmann::json::parse(trace_file);
  EXPECT_EQ(report["samples_per_pixel"], 4);
  EXPECT_GT(trace["traceEvents"].size(), 50u);
  // Other threads and waves: the same picture; another seed: another one.
  EXPECT_EQ(spillway("render c.store -o b.exr --resolution 64x36 --spp 4 --aov --half-buffers --threads 1 --wave-paths 999 -q").code, 0);
  const Ended same = spillway("compare a.exr b.exr");
  EXPECT_EQ(same.code, 0) << same.said;
  EXPECT_EQ(spillway("render c.store -o d.exr --resolution 64x36 --spp 4 --seed 5 -q").code, 0);
  EXPECT_EQ(spillway("compare a.exr d.exr").code, 1);
  EXPECT_EQ(spillway("info c.store").code, 0);
  EXPECT_NE(spillway("info a.exr").said.find("64"), std::string::npos);
  const Ended plan = spillway("plan c.store --memory 512MiB --spp 64");
  EXPECT_EQ(plan.code, 0);
  EXPECT_NE(plan.said.find("wave"), std::string::npos) << plan.said;
}

TEST_F(ProgramTest, a_current_store_is_not_packed_again_and_an_old_one_is) {
  ASSERT_EQ(render("Shape \"trianglemesh\" \"point3 P\" [-1 -1 0 1 -1 0 0 1 0]").code, 0);
  const auto first = fs::last_write_time(folder_ / "scene.store/manifest.spw");
  ASSERT_EQ(spillway("render scene.pbrt -o out.exr --spp 1 -q").code, 0);
  EXPECT_EQ(fs::last_write_time(folder_ / "scene.store/manifest.spw"), first);
  ASSERT_EQ(render("Shape \"trianglemesh\" \"point3 P\" [-2 -1 0 1 -1 0 0 1 0]").code, 0);
  EXPECT_NE(fs::last_write_time(folder_ / "scene.store/manifest.spw"), first);
}

TEST_F(ProgramTest, surfaces_are_diced_again_for_another_length_and_found_for_the_same) {
  const std::string cube =
      "Shape \"subdivmesh\" \"point3 P\" [-1 -1 -1 1 -1 -1 1 1 -1 -1 1 -1 -1 -1 1 1 -1 1 1 1 1 -1 1 1] "
      "\"integer indices\" [0 3 2 1 0 1 5 4 1 2 6 5 2 3 7 6 3 0 4 7 4 5 6 7]";
  const auto triangles = [&] {
    const std::string said = spillway("info scene.store").said;
    return std::stoi(said.substr(said.find("\ntriangles ") + 11));
  };
  ASSERT_EQ(render(cube, "--edge-length-px 4").code, 0);
  const int coarse = triangles();
  const auto first = fs::last_write_time(folder_ / "scene.store/manifest.spw");
  ASSERT_EQ(spillway("render scene.pbrt -o out.exr --spp 1 -q").code, 0);  // any length will do
  EXPECT_EQ(fs::last_write_time(folder_ / "scene.store/manifest.spw"), first);
  const std::string fine = "render scene.pbrt -o out.exr --spp 1 --edge-length-px 0.2 --dice-cache diced";
  ASSERT_EQ(spillway(fine + " -q").code, 0);
  EXPECT_GT(triangles(), 100 * coarse);
  const Ended again = spillway("pack scene.pbrt --edge-length-px 0.2 --dice-cache diced");
  EXPECT_NE(again.said.find("of these 1 into"), std::string::npos) << again.said;
}

// A white sky as an image, around a convex body of albedo one half: half as bright as the sky everywhere.
TEST_F(ProgramTest, an_environment_lights_the_scene) {
  const auto write_sky = [&](int width, int height, float value) {
    std::string bytes = fmt::format("PF\n{} {}\n-1.0\n", width, height);
    for (int i = 0; i < 3 * width * height; ++i) bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
    write("sky.pfm", bytes);
  };
  write("scene.pbrt", "LookAt 0 0 5 0 0 0 0 1 0 Camera \"perspective\" \"float fov\" 10\n"
                      "Film \"rgb\" \"integer xresolution\" 16 \"integer yresolution\" 16 PixelFilter \"box\" WorldBegin\n"
                      "LightSource \"infinite\" \"string filename\" \"sky.pfm\" \"float scale\" 2\n"
                      "Shape \"sphere\" \"float radius\" 1\n");
  const std::string render = "render scene.pbrt -o out.exr --spp 256 -q";
  write_sky(8, 8, 0.75f);
  const Ended ended = spillway(render);
  ASSERT_EQ(ended.code, 0) << ended.said;
  const auto input = OIIO::ImageInput::open((folder_ / "out.exr").string());
  ASSERT_TRUE(input);
  std::vector<float> pixels(16 * 16 * 3);
  ASSERT_TRUE(input->read_image(0, 0, 0, 3, OIIO::TypeFloat, pixels.data()));
  double sum = 0;
  for (const float p : pixels) sum += p;
  EXPECT_NEAR(sum / static_cast<double>(pixels.size()), 0.75, 0.75 * 0.004);  // the sky itself is 1.5
  fs::remove(folder_ / "out.exr");
  write_sky(8, 4, 0.75f);
  expect_refused(spillway(render), {"sky.pfm", "8 x 4 texels", "square"});
  write_sky(4, 4, -1);
  expect_refused(spillway(render), {"sky.pfm", "texel (0, 0) is (-1"});
  write_sky(4, 4, INFINITY);
  expect_refused(spillway(render), {"sky.pfm", "finite"});
}

// Images of lights without a surface stay in memory: they are counted, and refused with what would do.
TEST_F(ProgramTest, images_of_lights_count_towards_the_budget) {
  const auto smallest_mib = [&](int edge, const std::string& light) {
    std::string bytes = fmt::format("PF\n{} {}\n-1.0\n", edge, edge);
    const float half = 0.5f;
    for (int i = 0; i < 3 * edge * edge; ++i) bytes.append(reinterpret_cast<const char*>(&half), sizeof half);
    write("light.pfm", bytes);
    write("scene.pbrt", "Film \"rgb\" \"integer xresolution\" 16 \"integer yresolution\" 16 WorldBegin\nLightSource " +
                            light + " \"string filename\" \"light.pfm\"\nShape \"disk\"\n");
    EXPECT_EQ(spillway("pack scene.pbrt -o scene.store -q").code, 0);
    fs::remove(folder_ / "out.exr");
    const Ended refused = spillway("render scene.store -o out.exr --spp 1 -q --memory 130MiB");
    expect_refused(refused, {"--memory 130.0 MiB: this frame needs at least "});
    const double mib = std::stod(refused.said.substr(refused.said.find("at least ") + 9));
    const Ended done = spillway(fmt::format("render scene.store -o out.exr --spp 1 -q --memory {}MiB --report r.json",
                                            static_cast<int>(mib) + 1));
    EXPECT_EQ(done.code, 0) << done.said;
    std::ifstream file(folder_ / "r.json");
    const auto memory = nlohmann::json::parse(file)["memory"];
    EXPECT_GE(memory["peak_by_tag"]["lights"].get<double>(), 12.0 * edge * edge);
    EXPECT_LT(memory["untagged_bytes"].get<double>(), 32 << 20);
    // What the process holds before it begins differs from run to run; the number named has a 32nd of it to spare.
    const std::string tail = refused.said.substr(refused.said.find("at least ") + 9);
    return mib - std::stod(tail.substr(tail.find('(') + 1)) * 33 / 32;
  };
  const auto added_mib = [&](const std::string& light) { return smallest_mib(1024, light) - smallest_mib(4, light); };
  EXPECT_NEAR(added_mib("\"infinite\""), 16, 0.3);  // texels and what samples them
  EXPECT_NEAR(added_mib("\"goniometric\""), 12, 0.3);
  EXPECT_NEAR(added_mib("\"projection\""), 12, 0.3);
}

TEST_F(ProgramTest, a_command_line_that_makes_no_sense_ends_with_two) {
  EXPECT_EQ(spillway("").code, 2);
  EXPECT_EQ(spillway("render").code, 2);
  EXPECT_EQ(spillway("render x.pbrt -o a.exr --no-such-option").code, 2);
  EXPECT_EQ(spillway("render x.pbrt -o a.exr --spp 0").code, 2);
  EXPECT_EQ(spillway("--help").code, 0);
}

TEST_F(ProgramTest, help_is_text_without_bytes_of_another_kind) {
  for (const char* command : {"", "render", "plan", "whatif", "pack", "city", "info", "compare", "convert"}) {
    const Ended help = spillway(std::string(command) + " --help");
    EXPECT_EQ(help.code, 0) << command;
    EXPECT_NE(help.said.find("Options:"), std::string::npos) << help.said;
    for (const char c : help.said) EXPECT_TRUE(c == '\n' || (c >= 0x20 && c < 0x7f)) << command << ": " << int{c};
  }
}

TEST_F(ProgramTest, options_are_refused_before_anything_is_packed) {
  write("scene.pbrt", std::string(kScene));
  const auto refused = [&](const std::string& options, const char* said) {
    const Ended ended = spillway("render scene.pbrt -o out.exr -q " + options);
    EXPECT_EQ(ended.code, 2) << options << ended.said;
    EXPECT_NE(ended.said.find(said), std::string::npos) << options << ended.said;
    EXPECT_FALSE(exists("scene.store")) << options;
  };
  refused("--resolution 12y7", "resolution");
  refused("--crop 4,4,2,2", "crop");
  refused("--memory rubbish", "size");
  refused("--page-share 1KB", "size");
  refused("--scratch-limit -1", "size");
  refused("--frames 3-1", "--frames 3-1");
  refused("--frames 1-3", "run of #");
  refused("--frames 1 --access-log a", "--access-log");
  for (const char* limit : {"-5", "nan", "0", "inf"}) refused(std::string("--time-limit ") + limit, "--time-limit");
  EXPECT_EQ(spillway("pack scene.pbrt --edge-length-px nan").code, 2);
  EXPECT_EQ(spillway("plan scene.pbrt --memory rubbish").code, 2);
  EXPECT_EQ(spillway("whatif a.log --memory 1GiB,much").code, 2);
  EXPECT_EQ(spillway("compare scene.pbrt scene.pbrt --exclude 1,2").code, 2);
  EXPECT_EQ(spillway("compare scene.pbrt scene.pbrt").code, 3);  // no pictures
  EXPECT_FALSE(exists("scene.store"));
}

// The names of files are bytes, and JSON is UTF-8.
TEST_F(ProgramTest, names_that_are_not_utf8_do_not_break_json) {
  const std::string odd = "\xff\xfe\xc3";
  fs::copy(a_texture(), folder_ / (odd + ".png"));
  write(odd + ".pbrt",
        std::string(kScene) + "Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"" + odd + ".png\"\n"
        "Material \"diffuse\" \"texture reflectance\" \"t\"\nShape \"trianglemesh\" \"point3 P\" [-1 -1 0 1 -1 0 0 1 0]");
  const Ended rendered =
      spillway("render " + odd + ".pbrt -o out.exr --spp 1 -q --report r.json --access-log a.log");
  ASSERT_EQ(rendered.code, 0) << rendered.said;
  std::ifstream report(folder_ / "r.json");
  EXPECT_NE(nlohmann::json::parse(report).dump().find("\uFFFD"), std::string::npos);
  for (const char* command : {"info out.exr --json", "whatif a.log --memory 1GiB --json"}) {
    const Ended ended = spillway(command);
    EXPECT_EQ(ended.code, 0) << ended.said;
    EXPECT_TRUE(nlohmann::json::accept(ended.said)) << ended.said;
  }
  EXPECT_EQ(spillway("info out.exr").code, 0);
}

TEST_F(ProgramTest, a_budget_binds_packing_before_it_binds_rendering) {
  for (const char* command : {"render ", "plan "}) {
    const Ended refused = spillway(command + courtyard_ + " --store c.store --memory 100MiB" +
                                   (command[0] == 'r' ? " -o out.exr" : ""));
    expect_refused(refused, {"--memory 100", "packing needs"});
    EXPECT_FALSE(exists("c.store/manifest.spw"));
  }
}

TEST_F(ProgramTest, scenes_that_are_wrong_are_refused_at_their_place) {
  expect_refused(spillway("render missing.pbrt -o out.exr"), {"missing.pbrt"});
  expect_refused(render("Shape \"trianglemesh\" \"point3 P\" [0 0 0"), {"scene.pbrt:8:"});
  expect_refused(render("Shape \"no-such-shape\""), {"scene.pbrt:8:7", "no-such-shape"});
  expect_refused(render("\n  Material \"velvet\"\nShape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0]"), {"scene.pbrt:9:", "velvet"});
  expect_refused(render("Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"integer indices\" [0 1 7]"), {"scene.pbrt:8", "7"});
  expect_refused(render("Shape \"trianglemesh\" \"point3 P\" [0 0 0 nan 0 0 0 1 0]"), {"scene.pbrt:8"});
  expect_refused(spillway("render scene.pbrt -o no/such/folder/out.exr"), {"no/such/folder"});
}

TEST_F(ProgramTest, meshes_that_are_missing_or_damaged_are_refused_by_name) {
  const std::string shape = "Shape \"plymesh\" \"string filename\" \"mesh.ply\"";
  expect_refused(render(shape), {"mesh.ply"});
  write("mesh.ply", std::string(kPlyHeader) + "0 0 0\n1 0 0\n");
  expect_refused(render(shape), {"mesh.ply"});
  write("mesh.ply", std::string(kPlyHeader) + "0 0 0\n1 0 0\n0 1 0\n3 0 1 9\n");
  expect_refused(render(shape), {"mesh.ply", "9"});
  write("mesh.ply", std::string(kPlyHeader) + "0 0 0\n1 nan 0\n0 1 0\n3 0 1 2\n");
  expect_refused(render(shape), {"mesh.ply"});
  std::string absurd = kPlyHeader;
  absurd.replace(absurd.find("vertex 3"), 8, "vertex 4000000000");
  write("mesh.ply", absurd + "0 0 0\n");
  expect_refused(render(shape), {"mesh.ply"});
  write("mesh.ply", std::string(kPlyHeader) + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
  EXPECT_EQ(render(shape).code, 0);
}

TEST_F(ProgramTest, textures_that_are_missing_or_damaged_are_refused_by_name) {
  const std::string body =
      "Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"image.png\"\n"
      "Material \"diffuse\" \"texture reflectance\" \"t\"\nShape \"trianglemesh\" \"point3 P\" [-1 -1 0 1 -1 0 0 1 0]";
  expect_refused(render(body), {"image.png"});
  write("image.png", "this is no picture");
  expect_refused(render(body), {"image.png"});
  std::ifstream whole(a_texture(), std::ios::binary);
  std::string bytes(std::istreambuf_iterator<char>(whole), {});
  write("image.png", bytes.substr(0, bytes.size() / 2));
  expect_refused(render(body), {"image.png"});
  write("image.png", bytes);
  EXPECT_EQ(render(body).code, 0);
}

#ifdef __SANITIZE_ADDRESS__  // reserves terabytes of addresses
constexpr const char* kLimit = "";
#else
constexpr const char* kLimit = "ulimit -v 3000000; ";
#endif

// Out of a pipe, so that nobody holds it, and within three gigabytes of addresses.
TEST_F(ProgramTest, a_word_and_a_string_of_four_gigabytes_are_refused_at_their_place) {
  for (const auto& [opening, message] : {std::pair{"WorldBegin\\n  Shape \"", "scene.pbrt:2:9: string of more than 65536 bytes"},
                                         std::pair{"WorldBegin\\n  ", "scene.pbrt:2:3: word of more than 65536 bytes"}}) {
    const Ended ended = run_command(fmt::format(
        "{{ cd {}; rm -f scene.pbrt; mkfifo scene.pbrt\n"
        "(printf '{}'; yes aaaaaaaa | tr -d '\\n' | head -c 4294967296) 2>/dev/null >scene.pbrt &\n"
        "({}" SPILLWAY_PROGRAM " render scene.pbrt -o out.exr --memory 512MiB); status=$?; kill $! 2>/dev/null; exit $status; }}",
        folder_.string(), opening, kLimit));
    expect_refused(ended, {message});
  }
}

TEST_F(ProgramTest, a_budget_that_is_too_small_is_refused_with_one_that_would_do) {
  ASSERT_EQ(spillway("pack " + courtyard_ + " -o c.store -q").code, 0);
  const Ended refused = spillway("render c.store -o out.exr --memory 64MiB");
  expect_refused(refused, {"MiB"});
  // The number it names does.
  const std::string before = "at least ";
  const size_t at = refused.said.find(before);
  ASSERT_NE(at, std::string::npos) << refused.said;
  const double mib = std::stod(refused.said.substr(at + before.size()));
  const Ended enough = spillway("render c.store -o out.exr --spp 1 -q --memory " + std::to_string(static_cast<int>(mib) + 1) + "MiB");
  EXPECT_EQ(enough.code, 0) << refused.said << enough.said;
}

TEST_F(ProgramTest, a_full_scratch_disk_stops_the_render_and_says_how_much_was_needed) {
  ASSERT_EQ(spillway("pack " + courtyard_ + " -o c.store -q").code, 0);
  const Ended full = spillway("render c.store -o out.exr --resolution 200x200 --spp 4 --spill always --scratch . --scratch-limit 1MiB");
  expect_refused(full, {"scratch disk is full", "more"});
}

// A limit on the size of files stands for a full disk: the same error comes back from a write.
TEST_F(ProgramTest, a_disk_that_fills_while_packing_leaves_nothing_that_looks_whole) {
  const int blocks = 1024;  // of 1 KiB, less than the pages of the courtyard
  const Ended full = run_command("cd " + folder_.string() + " && bash -c 'ulimit -f " + std::to_string(blocks) + "; " SPILLWAY_PROGRAM
                         " pack " + courtyard_ + " -o c.store'");
  EXPECT_EQ(full.code, 3) << full.said;
  EXPECT_NE(full.said.find("disk is full"), std::string::npos) << full.said;
  EXPECT_FALSE(exists("c.store/manifest.spw"));
  size_t files = 0;
  for (const auto& entry : fs::recursive_directory_iterator(folder_)) files += entry.is_regular_file();
  EXPECT_EQ(files, 0u);
  const Ended opened = spillway("render c.store -o out.exr");
  EXPECT_EQ(opened.code, 3);
  EXPECT_NE(opened.said.find("is no store"), std::string::npos) << opened.said;
}

TEST_F(ProgramTest, packing_reports_its_steps_and_keeps_its_limit) {
  const Ended packed = spillway("pack " + courtyard_ + " -o c.store --memory 512MiB --report pack.json");
  ASSERT_EQ(packed.code, 0) << packed.said;
  EXPECT_NE(packed.said.find("cluster_pages"), std::string::npos) << packed.said;
  std::ifstream file(folder_ / "pack.json");
  const auto report = nlohmann::json::parse(file);
  double sum = 0;
  for (const auto& step : report["steps"]) sum += step["seconds"].get<double>();
  EXPECT_NEAR(sum, report["seconds"].get<double>(), 0.05 * report["seconds"].get<double>() + 0.05);
  EXPECT_LE(report["resident_peak_bytes"], 512u << 20);
  const Ended refused = spillway("pack " + courtyard_ + " -o d.store --memory 100MiB");
  EXPECT_EQ(refused.code, 3);
  EXPECT_NE(refused.said.find("--memory"), std::string::npos) << refused.said;
}

TEST_F(ProgramTest, damage_is_named_by_file_and_page) {
  ASSERT_EQ(spillway("pack " + courtyard_ + " -o c.store -q").code, 0);
  const std::string frame = "render c.store -o out.exr --resolution 32x18 --spp 1";
  std::fstream pages(folder_ / "c.store/pages.trace", std::ios::in | std::ios::out | std::ios::binary);
  pages.seekp(5000);
  pages.write("damage", 6);
  pages.close();
  expect_refused(spillway(frame), {"pages.trace: part 0 at byte 0", "checksum"});
  fs::resize_file(folder_ / "c.store/pages.trace", 5000);
  expect_refused(spillway(frame), {"pages.trace"});
  fs::remove(folder_ / "c.store/pages.trace");
  expect_refused(spillway(frame), {"pages.trace"});
  std::fstream manifest(folder_ / "c.store/manifest.spw", std::ios::in | std::ios::out | std::ios::binary);
  manifest.seekp(8);
  manifest.put(77);
  manifest.close();
  expect_refused(spillway(frame), {"manifest.spw: byte 8", "version 77"});
}

TEST_F(ProgramTest, an_interrupt_leaves_a_picture_of_whole_samples) {
  ASSERT_EQ(spillway("pack " + courtyard_ + " -o c.store -q").code, 0);
  const Ended stopped = run_command("cd " + folder_.string() + " && timeout --preserve-status -s INT 2 " SPILLWAY_PROGRAM
                            " render c.store -o out.exr --resolution 160x90 --spp 100000 --threads 1 --report r.json");
  ASSERT_EQ(stopped.code, 130) << stopped.said;
  std::ifstream report_file(folder_ / "r.json");
  const uint32_t samples = nlohmann::json::parse(report_file)["samples_per_pixel"];
  ASSERT_GT(samples, 0u);
  EXPECT_NE(stopped.said.find("--spp " + std::to_string(samples)), std::string::npos) << stopped.said;
  ASSERT_EQ(spillway("render c.store -o again.exr --resolution 160x90 -q --spp " + std::to_string(samples)).code, 0);
  const Ended same = spillway("compare out.exr again.exr");
  EXPECT_EQ(same.code, 0) << same.said;
}

}  // namespace
}  // namespace spillway::tools
