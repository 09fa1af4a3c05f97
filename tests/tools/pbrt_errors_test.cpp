// Every error says where, what, and names the thing that is wrong.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "tests/tools/import_text.h"

namespace spillway::tools {
namespace {

struct Case {
  std::string text;
  std::string want;  // how the message begins
};

void expect_errors(const std::vector<Case>& cases) {
  for (const Case& c : cases) {
    const Imported imported = import_text(c.text);
    EXPECT_TRUE(starts_with(imported.error, c.want))
        << c.text << "\n  said:   " << imported.error << "\n  wanted: " << c.want;
  }
}

TEST(pbrt_errors, tokens_have_line_and_column) {
  expect_errors({
      {"  Scale 1 2 x\n", "scene.pbrt:1:13: x instead of a finite number"},
      {"# a comment\n\tTranslate 1 \"2\" 3", "scene.pbrt:2:14: Translate takes 3 numbers, not \"2\""},
      {"Camera \"perspective\n", "scene.pbrt:1:8: string without closing quote"},
      {"Camera \"per\\spective\"", "scene.pbrt:1:12: unknown escape"},
      {"Film", "scene.pbrt:1:5: Film is followed by a string in quotes, not by the end of the file"},
      {"Scale 1 1\n 1e999", "scene.pbrt:2:2: 1e999 instead of a finite number"},
      {"Scale nan 1 1", "scene.pbrt:1:7: nan instead of"},
      {"Scale inf 1 1", "scene.pbrt:1:7: inf instead of"},
      {"Scale 1 1 1x", "scene.pbrt:1:11: 1x instead of"},
      {"] ", "scene.pbrt:1:1: ] where a directive is expected"},
      {"\"Film\"", "scene.pbrt:1:1: \"Film\" where a directive is expected"},
      {std::string("Ident\0ity", 9), "scene.pbrt:1:6: byte 0x00: not a text file?"},
      {"Film \"" + std::string(70000, 'a') + "\"", "scene.pbrt:1:6: string of more than 65536 bytes"},
      {std::string(70000, 'a'), "scene.pbrt:1:1: word of more than 65536 bytes"},
  });
}

TEST(pbrt_errors, parameters_are_typed_and_used) {
  expect_errors({
      {"Camera \"perspective\" \"float\" 3", "scene.pbrt:1:22: \"float\" is no parameter"},
      {"Camera \"perspective\" \"flaot fov\" 3", "scene.pbrt:1:22: unknown parameter type \"flaot\" of \"fov\""},
      {"Camera \"perspective\"\n \"integer fov\" 30\nWorldBegin",
       "scene.pbrt:2:2: \"fov\" of Camera \"perspective\" has type float, not integer"},
      {"Camera \"perspective\" \"float fox\" 30\nWorldBegin",
       "scene.pbrt:1:22: Camera \"perspective\" has no parameter \"float fox\""},
      {"Camera \"perspective\" \"float fov\" [ 30 40 ]\nWorldBegin",
       "scene.pbrt:1:22: \"float fov\" takes 1 value, not 2"},
      {"Camera \"perspective\" \"float fov\" [ 30 \"x\" ]", "scene.pbrt:1:39: \"x\" instead of a finite number"},
      {"Camera \"perspective\" \"float fov\" 1e300", "scene.pbrt:1:34: 1e300 is no value for \"float fov\""},
      {"Camera \"perspective\" \"float fov\" [ 30", "scene.pbrt:1:34: [ of \"fov\" is never closed"},
      {"Camera \"perspective\" \"float fov\" [ [", "scene.pbrt:1:36: [ inside the values"},
      {"Camera \"perspective\" \"float fov\" 30 \"float fov\" 40",
       "scene.pbrt:1:37: parameter \"fov\" is given twice (first at scene.pbrt:1:22)"},
      {"Film \"rgb\" \"integer xresolution\" 1.5", "scene.pbrt:1:34: 1.5 is no value for \"integer xresolution\""},
      {"Film \"rgb\" \"integer xresolution\" 3000000000", "scene.pbrt:1:34: 3000000000 is no value"},
      {"Film \"rgb\" \"bool savefp16\" maybe", "scene.pbrt:1:28: maybe is no value for \"bool savefp16\""},
      {"Film \"rgb\" \"string filename\" 3", "scene.pbrt:1:30: 3 is no value for \"string filename\""},
  });
}

TEST(pbrt_errors, directives_belong_somewhere) {
  expect_errors({
      {"Sphere 3", "scene.pbrt:1:1: unknown directive Sphere"},
      {"Shape \"trianglemesh\"", "scene.pbrt:1:1: Shape belongs after WorldBegin"},
      {"WorldBegin\n Film \"rgb\"", "scene.pbrt:2:2: Film belongs before WorldBegin"},
      {"WorldBegin WorldBegin", "scene.pbrt:1:12: WorldBegin belongs before WorldBegin"},
      {"WorldBegin AttributeEnd", "scene.pbrt:1:12: AttributeEnd without AttributeBegin"},
      {"WorldBegin\nAttributeBegin", "scene.pbrt:2:1: AttributeBegin is never ended"},
      {"WorldBegin ObjectBegin \"a\" AttributeEnd",
       "scene.pbrt:1:28: AttributeEnd cannot end the ObjectBegin at scene.pbrt:1:12"},
      {"WorldBegin AttributeBegin ObjectEnd", "scene.pbrt:1:27: ObjectEnd cannot end the AttributeBegin"},
      {"WorldBegin ObjectBegin \"a\" ObjectBegin \"b\"", "scene.pbrt:1:28: ObjectBegin inside the object"},
      {"WorldBegin ObjectBegin \"a\" ObjectInstance \"a\"", "scene.pbrt:1:28: ObjectInstance inside an object"},
      {"WorldBegin ObjectInstance \"a\"", "scene.pbrt:1:27: there is no object \"a\""},
      {"WorldBegin ObjectBegin \"a\" ObjectEnd ObjectBegin \"a\"", "scene.pbrt:1:50: object \"a\" is defined twice"},
      {"Identity", "scene.pbrt: no WorldBegin"},
      {"", "scene.pbrt: no WorldBegin"},
      {"ColorSpace \"adobe\"", "scene.pbrt:1:12: color space \"adobe\" is not known"},
      {"ActiveTransform Middle", "scene.pbrt:1:17: ActiveTransform Middle: use StartTime, EndTime or All"},
      {"TransformTimes 1 1", "scene.pbrt:1:1: TransformTimes 1 1: the first must be before the second"},
      {"TransformTimes 0 1e99", "scene.pbrt:1:1: TransformTimes 0 1e+99: the first"},
      {"WorldBegin TransformTimes 0 1", "scene.pbrt:1:12: TransformTimes belongs before WorldBegin"},
      {"WorldBegin MediumInterface \"fog\" \"\" Shape \"sphere\"", "scene.pbrt:1:28: there is no medium \"fog\""},
  });
}

TEST(pbrt_errors, a_million_nested_attributes_are_too_many) {
  std::string text = "WorldBegin\n";
  for (int i = 0; i < 1000000; ++i) text += "AttributeBegin\n";
  expect_errors({{text, "scene.pbrt:1026:1: scopes nest more than 1024 deep"}});
}

TEST(pbrt_errors, transforms_must_have_an_inverse) {
  expect_errors({
      {"Scale 1 0 1", "scene.pbrt:1:1: Scale makes the transform singular"},
      {"Scale 1e99 1e99 1e99    Scale 1e99 1 1", "scene.pbrt:1:25: Scale makes the transform singular or infinite"},
      {"Rotate 30 0 0 0", "scene.pbrt:1:1: Rotate about an axis of length zero"},
      {"LookAt 1 2 3 1 2 3 0 1 0", "scene.pbrt:1:1: LookAt: the eye is the target"},
      {"LookAt 0 0 0 0 5 0 0 1 0", "scene.pbrt:1:1: LookAt"},
      {"Transform [ 1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 ]", "scene.pbrt:1:43: Transform takes 16 numbers, not ]"},
      {"Transform 1 0 0 0", "scene.pbrt:1:11: Transform takes [ 16 numbers ], not 1"},
      {"Transform [ 1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1 7 ]", "scene.pbrt:1:45: Transform takes 16 numbers: ] expected"},
      {"Transform [ 1 0 0 1 0 1 0 0 0 0 1 0 0 0 0 1 ]", "scene.pbrt:1:1: Transform is not affine"},
      {"Transform [ 1 0 0 0 0 1 0 0 0 0 0 0 0 0 0 1 ]", "scene.pbrt:1:1: Transform makes the transform singular"},
      {"Transform [ 1 0 0 0 0 nan 0 0 0 0 1 0 0 0 0 1 ]", "scene.pbrt:1:23: nan instead of a finite number"},
      {"ConcatTransform [ 1 0 0 0 0 1 0 0 0 0 1 0 0 0 inf 1 ]", "scene.pbrt:1:47: inf instead of a finite number"},
      {"ConcatTransform [ 1 0 0 0 0 1 0 0 1 1 0 0 0 0 0 1 ]",
       "scene.pbrt:1:1: ConcatTransform makes the transform singular"},
      {"CoordSysTransform \"nowhere\"", "scene.pbrt:1:19: there is no coordinate system \"nowhere\""},
  });
}

TEST(pbrt_errors, settings_are_checked) {
  expect_errors({
      {"Camera \"spherical\" WorldBegin", "scene.pbrt:1:8: camera \"spherical\" is not supported"},
      {"Camera \"realistic\" WorldBegin", "scene.pbrt:1:8: camera \"realistic\" is not supported"},
      {"Camera \"pinhole\" WorldBegin", "scene.pbrt:1:8: unknown camera \"pinhole\""},
      {"Camera \"perspective\" \"float fov\" 180 WorldBegin", "scene.pbrt:1:22: \"fov\" must be between 0 and 180"},
      {"Camera \"perspective\" \"float screenwindow\" [1 -1 0 1] WorldBegin",
       "scene.pbrt:1:22: \"screenwindow\" takes"},
      {"Camera \"perspective\" \"float shutterclose\" 0 WorldBegin", "scene.pbrt:1:8: the shutter must close"},
      {"Camera \"perspective\" \"float shutterclose\" 3e38 \"float shutteropen\" -3e38\n WorldBegin",
       "scene.pbrt:2:2: the film gathers no light"},
      {"Scale 1e-105 1e-105 1e-105\nCamera \"perspective\" WorldBegin",
       "scene.pbrt:2:8: the camera's transform or window is too large"},
      {"Camera \"orthographic\" \"float screenwindow\" [-3e38 3e38 -1 1] WorldBegin",
       "scene.pbrt:1:8: the camera's transform or window is too large"},
      {"Film \"rgb\" \"integer xresolution\" 0 WorldBegin", "scene.pbrt:1:6: a resolution of 0 x 720"},
      {"Film \"rgb\" \"float iso\" 0 WorldBegin", "scene.pbrt:1:6: the film gathers no light"},
      {"Film \"rgb\" \"float cropwindow\" [0.5 0.5 0 1] WorldBegin", "scene.pbrt:1:12: the crop holds no pixel"},
      {"PixelFilter \"tent\" WorldBegin", "scene.pbrt:1:13: unknown filter \"tent\""},
      {"PixelFilter \"box\" \"float xradius\" 0 WorldBegin", "scene.pbrt:1:13: filter radii must be above 0"},
      {"PixelFilter \"box\" \"float sigma\" 1 WorldBegin", "scene.pbrt:1:19: PixelFilter \"box\" has no parameter"},
      {"Sampler \"random\" WorldBegin", "scene.pbrt:1:9: unknown sampler \"random\""},
      {"Sampler \"sobol\" \"integer pixelsamples\" 0 WorldBegin", "scene.pbrt:1:9: 0 samples a pixel"},
      {"Integrator \"magic\" WorldBegin", "scene.pbrt:1:12: integrator \"magic\" is not supported"},
      {"Integrator \"path\" \"integer maxdepth\" -1 WorldBegin", "scene.pbrt:1:12: \"maxdepth\" must be at least 0"},
      {"Option \"forcediffuse\" \"yes\"", "scene.pbrt:1:23: option \"forcediffuse\" takes true or false"},
      {"Option \"seed\" many", "scene.pbrt:1:15: "},
      {"Option \"seed\" 1e10", "scene.pbrt:1:15: a seed of"},
      {"Option \"seed\" [ 1 2 ]", "scene.pbrt:1:19: 2 where ] is expected"},
      {"Option \"seed\"", "scene.pbrt:1:14: the end of the file where the value of an Option is expected"},
      {"Option \"msereferenceimage\" 3", "scene.pbrt:1:28: option \"msereferenceimage\" takes a string"},
      {"Option \"integer sead\" 3", "scene.pbrt:1:8: option \"integer sead\" is not known"},
  });
}

TEST(pbrt_errors, names_must_be_known_and_defined_once) {
  const std::string triangle(kTriangle);
  expect_errors({
      {"WorldBegin\nNamedMaterial \"m\"\n" + triangle, "scene.pbrt:2:15: there is no material \"m\""},
      {"WorldBegin\nObjectBegin \"o\" NamedMaterial \"m\"\n" + triangle, "scene.pbrt:2:31: there is no material \"m\""},
      {"WorldBegin\nMaterial \"diffuse\" \"texture reflectance\" \"t\"\n" + triangle,
       "scene.pbrt:2:20: there is no spectrum texture \"t\""},
      {"WorldBegin Texture \"t\" \"float\" \"constant\"\nMaterial \"diffuse\" \"texture reflectance\" \"t\"\n" +
           triangle,
       "scene.pbrt:2:20: there is no spectrum texture \"t\""},
      {"WorldBegin Texture \"t\" \"float\" \"constant\"\nTexture \"t\" \"float\" \"constant\"",
       "scene.pbrt:2:9: texture \"t\" is defined twice (first at scene.pbrt:1:32)"},
      {"WorldBegin MakeNamedMaterial \"m\" \"string type\" \"diffuse\"\nMakeNamedMaterial \"m\" \"string type\" "
       "\"diffuse\"",
       "scene.pbrt:2:19: material \"m\" is defined twice (first at scene.pbrt:1:30)"},
      {"WorldBegin MakeNamedMaterial \"m\"", "scene.pbrt:1:30: MakeNamedMaterial \"m\" has no \"string type\""},
      {"WorldBegin Texture \"a\" \"float\" \"scale\" \"texture tex\" \"b\" Texture \"b\" \"float\" \"scale\" \"texture "
       "tex\" \"a\"\n"
       "Material \"diffuse\" \"texture displacement\" \"a\"\n" +
           triangle,
       "scene.pbrt:1:86: texture \"a\" uses itself"},
      {"WorldBegin MakeNamedMaterial \"m\" \"string type\" \"mix\" \"string materials\" [\"m\" \"m\"]\nNamedMaterial "
       "\"m\"\n" +
           triangle,
       "scene.pbrt:1:30: material \"m\" uses itself"},
      {"WorldBegin Texture \"t\" \"color\" \"constant\"", "scene.pbrt:1:24: a texture holds \"float\" or \"spectrum\""},
  });
}

TEST(pbrt_errors, long_chains_of_textures_end_before_the_stack_does) {
  std::string text = "WorldBegin\nTexture \"t0\" \"float\" \"constant\"\n";
  for (int i = 1; i < 100; ++i) {
    text += fmt::format("Texture \"t{}\" \"float\" \"scale\" \"texture tex\" \"t{}\"\n", i, i - 1);
  }
  text += "Material \"diffuse\" \"texture displacement\" \"t99\"\n" + std::string(kTriangle);
  EXPECT_NE(import_text(text).error.find("textures use one another more than 64 deep"), std::string::npos);
}

TEST(pbrt_errors, materials_are_checked) {
  const auto with = [](const std::string& material) {
    return "WorldBegin\nMaterial " + material + "\n" + std::string(kTriangle);
  };
  expect_errors({
      {with("\"hair\""), "scene.pbrt:2:10: material type \"hair\" is not supported"},
      {with("\"subsurface\""), "scene.pbrt:2:10: material type \"subsurface\" is not supported"},
      {with("\"measured\""), "scene.pbrt:2:10: material type \"measured\" is not supported"},
      {with("\"diffuse\" \"rgb reflectance\" [1 2 0]"), "scene.pbrt:2:20: \"reflectance\" must not be above 1"},
      {with("\"diffuse\" \"rgb reflectance\" [-1 0 0]"), "scene.pbrt:2:20: \"reflectance\" must not be negative"},
      {with("\"diffuse\" \"rgb reflectance\" [1 0]"), "scene.pbrt:2:20: \"rgb reflectance\" takes 3 values, not 2"},
      {with("\"diffuse\" \"float roughness\" 1"),
       "scene.pbrt:2:20: Material \"diffuse\" has no parameter \"float roughness\""},
      {with("\"diffuse\" \"spectrum reflectance\" \"grass\""), "scene.pbrt:2:20: spectrum \"grass\" is neither known"},
      {with("\"diffuse\" \"spectrum reflectance\" [500 1 500 1]"), "scene.pbrt:2:20: \"reflectance\" takes pairs"},
      {with("\"diffuse\" \"string normalmap\" \"n.png\" \"float displacement\" 1"),
       "scene.pbrt:2:20: a material takes \"normalmap\" or \"displacement\""},
      {with("\"diffusetransmission\" \"float scale\" -1"), "scene.pbrt:2:10: \"scale\" must not be negative"},
      {with("\"conductor\" \"spectrum eta\" \"metal-Fe-eta\""),
       "scene.pbrt:2:22: spectrum \"metal-Fe-eta\" is neither"},
      {with("\"conductor\" \"rgb reflectance\" [1 1 1] \"rgb k\" [1 1 1]"),
       "scene.pbrt:2:48: Material \"conductor\" has no parameter \"rgb k\", or has no use"},
      {with("\"conductor\" \"spectrum k\" [500 1 400 1]"), "scene.pbrt:2:22: \"k\" takes pairs of wavelength"},
      {with("\"dielectric\" \"float eta\" 0"), "scene.pbrt:2:23: \"eta\" must be above 0"},
      {with("\"dielectric\" \"spectrum eta\" \"glass-X\""), "scene.pbrt:2:23: spectrum \"glass-X\" is neither"},
      {with("\"mix\""), "scene.pbrt:2:10: material \"mix\" without \"string materials\""},
      {with("\"mix\" \"string materials\" [\"a\" \"b\"]"), "scene.pbrt:2:16: there is no material \"a\""},
  });
}

TEST(pbrt_errors, textures_are_checked) {
  const auto with = [](const std::string& texture) {
    return "WorldBegin\nTexture \"t\" \"spectrum\" " + texture +
           "\nMaterial \"diffuse\" \"texture reflectance\" \"t\"\n" + std::string(kTriangle);
  };
  expect_errors({
      {with("\"voronoi\""), "scene.pbrt:2:24: texture type \"voronoi\" of \"t\" is not supported"},
      {with("\"fbm\""), "scene.pbrt:2:24: texture type \"fbm\" of \"t\" is not supported for spectrum textures"},
      {with("\"marble\" \"integer octaves\" 33"), "scene.pbrt:2:24: 33 octaves of noise"},
      {with("\"marble\" \"integer octaves\" -1"), "scene.pbrt:2:24: -1 octaves of noise"},
      {with("\"directionmix\" \"vector3 dir\" [0 0 0]"), "scene.pbrt:2:24: \"dir\" of a directionmix"},
      {with("\"checkerboard\" \"integer dimension\" 4"), "scene.pbrt:2:24: a checkerboard of 4 dimensions"},
      {"WorldBegin Scale 1e-40 1 1\nTexture \"t\" \"spectrum\" \"marble\"\nMaterial \"diffuse\" \"texture "
       "reflectance\" "
       "\"t\" " +
           std::string(kTriangle),
       "scene.pbrt:2:24: the transform of this texture is too small"},
      {with("\"imagemap\""), "scene.pbrt:2:24: imagemap without \"string filename\""},
      {with("\"imagemap\" \"string filename\" \"a.png\" \"string mapping\" \"cubic\""),
       "scene.pbrt:2:61: mapping \"cubic\" is not known"},
      {with("\"imagemap\" \"string filename\" \"a.png\" \"string wrap\" \"octahedralsphere\""),
       "scene.pbrt:2:61: wrap"},
      {with("\"imagemap\" \"string filename\" \"a.png\" \"string filter\" \"box\""), "scene.pbrt:2:61: unknown filter"},
      {with("\"imagemap\" \"string filename\" \"a.png\" \"string encoding\" \"gamma 2\""), "scene.pbrt:2:61: encoding"},
      {with("\"imagemap\" \"string filename\" \"a.png\" \"float gain\" 2"),
       "scene.pbrt:2:61: Texture \"imagemap\" has no parameter \"float gain\""},
  });
}

TEST(pbrt_errors, lights_are_checked) {
  expect_errors({
      {"WorldBegin LightSource \"projection\"", "scene.pbrt:1:24: light \"projection\" without \"string filename\""},
      {"WorldBegin LightSource \"projection\" \"string filename\" \"a.exr\" \"float fov\" 180",
       "scene.pbrt:1:24: \"fov\" must be between 0 and 180 degrees"},
      {"WorldBegin LightSource \"projection\" \"string filename\" [\"a.exr\" \"b.exr\"]",
       "scene.pbrt:1:37: \"string filename\" takes 1 value, not 2"},
      {"WorldBegin LightSource \"projection\" \"string filename\" \"a.exr\" \"rgb I\" [1 1 1]",
       "scene.pbrt:1:63: LightSource \"projection\" has no parameter \"rgb I\""},
      {"WorldBegin Scale 1 2 1 LightSource \"projection\" \"string filename\" \"a.exr\"",
       "scene.pbrt:1:36: the transform of a projection must keep angles"},
      {"WorldBegin Scale 1 2 1 LightSource \"goniometric\" \"string filename\" \"a.exr\"",
       "scene.pbrt:1:36: the transform of a goniometric light must keep angles"},
      {"WorldBegin LightSource \"goniometric\" \"string filename\" \"a.exr\" \"point3 from\" [0 0 1]",
       "scene.pbrt:1:64: LightSource \"goniometric\" has no parameter \"point3 from\""},
      {"WorldBegin LightSource \"goniometric\" \"string filename\" \"a.exr\" \"float scale\" -1",
       "scene.pbrt:1:64: \"scale\" of a light must not be negative"},
      {"WorldBegin LightSource \"infinite\" \"point3 portal\" [0 0 0 1 0 0 1 1 0]",
       "scene.pbrt:1:35: \"point3 portal\" takes 12 values, not 9"},
      {"WorldBegin LightSource \"infinite\" \"point3 portal\" [0 0 0 1 0 0 1 1 0 0.5 1 0]",
       "scene.pbrt:1:35: \"portal\" takes the four corners of a rectangle"},
      {"WorldBegin LightSource \"point\" \"point3 portal\" [0 0 0 1 0 0 1 1 0 0 1 0]",
       "scene.pbrt:1:32: LightSource \"point\" has no parameter \"point3 portal\""},
      {"WorldBegin LightSource \"laser\"", "scene.pbrt:1:24: light \"laser\" is not known"},
      {"WorldBegin LightSource \"infinite\" \"string filename\" \"a.exr\" \"float illuminance\" 1",
       "scene.pbrt:1:61: \"illuminance\" of an image"},
      {"WorldBegin LightSource \"point\" \"rgb L\" [1 1 1]",
       "scene.pbrt:1:32: LightSource \"point\" has no parameter \"rgb L\""},
      {"WorldBegin LightSource \"point\" \"rgb I\" [1 1 -1]", "scene.pbrt:1:32: \"I\" must not be negative"},
      {"WorldBegin LightSource \"point\" \"blackbody I\" 3", "scene.pbrt:1:32: \"blackbody I\" takes 500"},
      {"WorldBegin LightSource \"point\" \"spectrum I\" \"stdillum-F13\"",
       "scene.pbrt:1:32: spectrum \"stdillum-F13\" is neither known"},
      {"WorldBegin LightSource \"distant\" \"point3 from\" [0 0 1]", "scene.pbrt:1:24: \"from\" and \"to\""},
      {"WorldBegin LightSource \"spot\" \"float coneangle\" 0", "scene.pbrt:1:24: a spot takes a coneangle"},
      {"WorldBegin LightSource \"point\" \"float scale\" -1", "scene.pbrt:1:32: \"scale\" of a light"},
      {"WorldBegin AreaLightSource \"projective\"", "scene.pbrt:1:28: area light \"projective\""},
      {"WorldBegin AreaLightSource \"diffuse\" \"string filename\" \"a\" \"rgb L\" [1 1 1]",
       "scene.pbrt:1:38: an area light has an \"L\" or an image, not both"},
  });
}

TEST(pbrt_errors, shapes_are_checked) {
  expect_errors({
      {"WorldBegin Shape \"curve\"", "scene.pbrt:1:18: shape \"curve\" is not supported"},
      {"WorldBegin Shape \"trianglemesh\"", "scene.pbrt:1:12: trianglemesh without \"point3 P\""},
      {"WorldBegin Shape \"trianglemesh\" \"point3 P\" [0 0]",
       "scene.pbrt:1:33: \"P\" takes three numbers a vertex, not 2"},
      {"WorldBegin Shape \"trianglemesh\" \"point3 P\" [0 0 0]",
       "scene.pbrt:1:12: trianglemesh without \"integer indices\""},
      {"WorldBegin Shape \"trianglemesh\" \"point3 P\" [0 0 0] \"integer indices\" [0 0 1]",
       "scene.pbrt:1:52: \"indices\" names vertex 1 of 1"},
      {"WorldBegin Shape \"trianglemesh\" \"point3 P\" [0 0 0] \"integer indices\" [0 0 -1]",
       "scene.pbrt:1:52: \"indices\" names vertex -1"},
      {"WorldBegin Shape \"trianglemesh\" \"point3 P\" [0 0 0] \"integer indices\" [0 0]",
       "scene.pbrt:1:52: \"indices\" takes 3 numbers a face, not 2"},
      {"WorldBegin Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"normal N\" [0 0 1]",
       "scene.pbrt:1:64: \"normal N\" takes 9 values, not 3"},
      {"WorldBegin Shape \"plymesh\"", "scene.pbrt:1:12: plymesh without \"string filename\""},
      {"WorldBegin Shape \"plymesh\" \"string filename\" \"none.ply\"", "scene.pbrt:1:28: none.ply: No such file"},
      {"WorldBegin Shape \"plymesh\" \"string filename\" \"scene.pbrt\"",
       "scene.pbrt:1:28: scene.pbrt: byte 0: not a PLY file"},
  });
}

TEST(pbrt_errors, includes_that_loop_or_explode_are_refused) {
  write_file("loop.pbrt", "# one\n Include \"loop.pbrt\"\n");
  expect_errors({{"Include \"loop.pbrt\"", "loop.pbrt:2:10: loop.pbrt includes itself"},
                 {"Include \"none.pbrt\"", "scene.pbrt:1:9: none.pbrt: No such file"},
                 {"\nInclude \"scene.pbrt\"", "scene.pbrt:2:9: scene.pbrt includes itself"}});
  for (int i = 0; i < 40; ++i) {
    write_file(fmt::format("deep{}.pbrt", i), fmt::format("Include \"deep{}.pbrt\"", i + 1));
  }
  EXPECT_TRUE(
      starts_with(import_text("Include \"deep0.pbrt\"").error, "deep30.pbrt:1:9: files include one another more than"));
}

TEST(pbrt_errors, parameters_and_attributes_are_not_without_number) {
  std::string one = "Camera \"perspective\"", many;
  for (int i = 0; i < 300; ++i) one += fmt::format("\n\"float p{}\" 1", i);
  for (int i = 0; i < 300; ++i) many += fmt::format("Attribute \"shape\" \"float p{}\" 1\n", i);
  expect_errors(
      {{one, "scene.pbrt:258:1: more than 256 parameters"}, {many, "scene.pbrt:257:11: more than 256 attributes"}});
}

TEST(pbrt_errors, folders_and_compressed_files_are_named) {
  RecordingSink sink;
  ImportReport report;
  EXPECT_NE(import_pbrt(test_folder(), sink, {}, report).error().message.find("is a directory"), std::string::npos);
  const auto gz = write_file("a.pbrt", "\x1f\x8b\x08");
  EXPECT_NE(import_pbrt(gz, sink, {}, report).error().message.find("gzip"), std::string::npos);
}

TEST(pbrt_errors, lenient_leaves_out_what_can_be_left_out) {
  const std::string text =
      "Sprocket \"a\" \"float b\" [ 1 2 ] 3 true\nCamera \"perspective\" \"float fox\" 30\nWorldBegin\n"
      "MakeNamedMedium \"fog\" \"string type\" \"homogeneous\" \"string preset\" \"Milk\"\n"
      "LightSource \"laser\"\nShape \"curve\" \"float radius\" 3\nMaterial \"hair\"\n" +
      std::string(kTriangle) + "Material \"interface\"\n" + std::string(kTriangle);
  EXPECT_EQ(import_text(text).error.substr(0, 15), "scene.pbrt:1:1:");
  const Imported imported = import_text(text, true);
  EXPECT_EQ(imported.error, "");
  EXPECT_EQ(imported.report.warning_count, 6u);
  for (const char* stand_in : {"light \"laser\" is not known", "nothing is used", "a grey diffuse one is used"}) {
    const auto& warnings = imported.report.warnings;
    EXPECT_TRUE(std::any_of(warnings.begin(), warnings.end(), [&](const std::string& w) {
      return w.find(stand_in) != w.npos;
    })) << stand_in;
  }
  EXPECT_EQ(imported.sink.meshes.size(), 1u);  // the curve is left out, the interface is not seen
  ASSERT_EQ(imported.sink.materials.size(), 1u);
  EXPECT_EQ(imported.sink.materials[0].kind, pipeline::MaterialKind::diffuse);
}

TEST(pbrt_errors, lenient_replaces_cameras) {
  const Imported imported = import_text("Camera \"realistic\" \"string lensfile\" \"a.dat\" WorldBegin\n", true);
  ASSERT_EQ(imported.error, "");
  EXPECT_EQ(imported.report.warning_count, 1u);
  EXPECT_EQ(imported.sink.settings.camera.is_orthographic, 0u);
}

TEST(pbrt_errors, what_the_sink_refuses_is_said_at_the_shape) {
  struct Refusing : RecordingSink {
    Status add_mesh(const pipeline::MeshInput&) override { return error("disk full"); }
  } sink;
  ImportReport report;
  const auto path = write_file("scene.pbrt", "WorldBegin\n  " + std::string(kTriangle));
  const Status status = import_pbrt(path, sink, {}, report);
  ASSERT_FALSE(status);
  EXPECT_TRUE(status.error().message.ends_with("scene.pbrt:2:3: disk full")) << status.error().message;
}

TEST(pbrt_errors, warnings_are_capped_but_counted) {
  std::string text = "WorldBegin\n";
  for (int i = 0; i < 1500; ++i) text += "TransformBegin TransformEnd\n";
  const Imported imported = import_text(text);
  EXPECT_EQ(imported.error, "");
  EXPECT_EQ(imported.report.warning_count, 1500u);
  EXPECT_EQ(imported.report.warnings.size(), kMaxWarnings);
}

}  // namespace
}  // namespace spillway::tools
