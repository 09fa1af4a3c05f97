// From materials to the numbers of a BSDF. The streamed stages and the reference integrator share this code: where it is
// wrong, both are, and their images still agree.

#include "pipeline/render/resolve_material.h"

#include <gtest/gtest.h>

#include <vector>

namespace spillway::pipeline {
namespace {

Param constant(float r, float g, float b) {
  Param p;
  p.constant = {r, g, b};
  return p;
}

class Resolver {
 public:
  explicit Resolver(std::vector<Material> materials) : materials_(std::move(materials)) {
    Mesh mesh{};
    for (mesh.material = 0; mesh.material < materials_.size(); ++mesh.material) meshes_.push_back(mesh);
  }
  // The material as a hit by the given sample sees it.
  SurfaceQuery operator()(uint32_t material, uint32_t sample = 0) const {
    const TextureEvaluator no_textures({}, nullptr);
    const MaterialResolver resolver({meshes_, materials_, &no_textures}, 0);
    HitRecord hit{};
    hit.path.sample = sample;
    const ShadingPoint point{};
    SurfaceQuery query{&hit, &point, material, true, 0, {}};
    MaterialResolver::Scratch scratch;
    EXPECT_TRUE(resolver.resolve({&query, 1}, scratch));
    return query;
  }

 private:
  std::vector<Material> materials_;
  std::vector<Mesh> meshes_;
};

TEST(ResolveMaterial, a_coat_keeps_its_index_its_roughness_and_what_it_throws_back) {
  Material coated;
  coated.kind = MaterialKind::coated_diffuse;
  coated.reflectance = constant(0.25f, 0.5f, 2);
  coated.u_roughness = constant(0.25f, 0, 0), coated.v_roughness = constant(0.01f, 0, 0);
  coated.eta = 1.7f, coated.coat_internal_reflectance = shading::internal_diffuse_reflectance(1.7f);
  const shading::BsdfParams b = Resolver({coated})(0).values.bsdf;
  EXPECT_EQ(b.kind, shading::BsdfKind::coated_diffuse);
  EXPECT_EQ(b.reflectance, (Rgb{0.25f, 0.5f, 1}));  // more than all is not reflected
  EXPECT_FLOAT_EQ(b.alpha_x, 0.5f);                 // the root of the roughness
  EXPECT_FLOAT_EQ(b.alpha_y, 0.1f);
  EXPECT_EQ(b.eta, 1.7f);
  EXPECT_EQ(b.coat_internal_reflectance, coated.coat_internal_reflectance);
  EXPECT_GT(b.coat_internal_reflectance, 0.5f);
}

TEST(ResolveMaterial, a_conductor_given_by_its_reflectance_has_it_head_on) {
  Material metal;
  metal.kind = MaterialKind::conductor;
  metal.uses_reflectance = 1, metal.reflectance = constant(0.3f, 0.6f, 0.9f);
  const shading::BsdfParams b = Resolver({metal})(0).values.bsdf;
  const Rgb head_on = shading::sample_bsdf(b, {0, 0, 1}, {0.5f, 0.5f}, 0.5f).weight;  // smooth: a mirror
  EXPECT_NEAR(head_on.r, 0.3f, 1e-5);
  EXPECT_NEAR(head_on.g, 0.6f, 1e-5);
  EXPECT_NEAR(head_on.b, 0.9f, 1e-5);
}

TEST(ResolveMaterial, a_mix_takes_its_second_material_as_often_as_it_says) {
  Material mix;
  mix.kind = MaterialKind::mix;
  mix.mix_material[0] = 0, mix.mix_material[1] = 1;
  mix.mix_amount = constant(0.2f, 0, 0);
  const Resolver resolver({Material{}, Material{}, mix});
  constexpr uint32_t kSamples = 4000;
  uint32_t second = 0;
  for (uint32_t sample = 0; sample < kSamples; ++sample) second += resolver(2, sample).material;
  EXPECT_NEAR(second / static_cast<double>(kSamples), 0.2, 0.0253);  // four deviations
}

}  // namespace
}  // namespace spillway::pipeline
