#include "pipeline/evaluate_texture.h"

#include <algorithm>
#include <cmath>

#include "pipeline/render/shade_path.h"
#include "shading/noise.h"
#include "shading/trigonometry.h"

namespace spillway::pipeline {
namespace {

// A point in texture space, and the footprint there: along each axis, and along the longest.
struct Place {
  Float3 point, width;
  float longest;
};

float row_length(const Affine3& a, int row) { return length({a.m[row][0], a.m[row][1], a.m[row][2]}); }

float longest_column(const Affine3& a) {
  float squared = 0;
  for (int c = 0; c < 3; ++c) squared = std::max(squared, length_squared({a.m[0][c], a.m[1][c], a.m[2][c]}));
  return std::sqrt(squared);
}

Place place_of(const TextureNode& node, const TextureQuery& query) {
  const ShadingPoint& at = *query.point;
  const Float2 step = query.uv - at.uv;
  Float3 world = at.position;
  if (step.x != 0 || step.y != 0) world += at.dpdu * step.x + at.dpdv * step.y;
  const Affine3& a = node.texture_from_world;
  const float width = query.width_uv > 0 ? at.width_world : 0;
  const Float3 point = a.point(world);
  return {is_finite(point) ? point : Float3{0, 0, 0},
          Float3{row_length(a, 0), row_length(a, 1), row_length(a, 2)} * width, longest_column(a) * width};
}

struct Mapped {
  Float2 st, width;  // footprint along s and along t
};

// A length as a share of a circle of this size; never more than all of it.
float share(float width, float circle) { return width < circle ? width / circle : (width > 0 ? 1.0f : 0.0f); }

Mapped mapped_place(const TextureNode& node, const TextureQuery& query) {
  const Place place = place_of(node, query);
  const Float3 p = place.point;
  if (node.mapping == TextureMapping::planar) return {{p.x, p.y}, {place.width.x, place.width.y}};
  const float off_axis = std::sqrt(p.x * p.x + p.y * p.y), turn = shading::turn_of(p.y, p.x);
  const float around = share(place.longest, 2 * shading::kPi * off_axis);
  if (node.mapping == TextureMapping::cylindrical)
    return {{turn < 0.5f ? turn + 0.5f : turn - 0.5f, p.z}, {around, place.width.z}};
  return {{2 * shading::turn_of(off_axis, p.z), turn}, {share(place.longest, shading::kPi * length(p)), around}};
}

Mapped mapped(const TextureNode& node, const TextureQuery& query) {
  if (node.mapping != TextureMapping::uv) return mapped_place(node, query);
  const Float2 st{query.uv.x * node.uv_scale[0] + node.uv_offset[0], query.uv.y * node.uv_scale[1] + node.uv_offset[1]};
  return {{std::isfinite(st.x) ? st.x : 0, std::isfinite(st.y) ? st.y : 0},
          {query.width_uv * std::fabs(node.uv_scale[0]), query.width_uv * std::fabs(node.uv_scale[1])}};
}

cache::Texel product(const cache::Texel& a, const cache::Texel& b) {
  cache::Texel result;
  for (int c = 0; c < 4; ++c) result.value[c] = a.value[c] * b.value[c];
  return result;
}

cache::Texel mixed(const cache::Texel& a, const cache::Texel& b, float amount) {
  cache::Texel result;
  for (int c = 0; c < 4; ++c) result.value[c] = a.value[c] * (1 - amount) + b.value[c] * amount;
  return result;
}

// The sign of a cell, +1 where it is even, under a triangle filter of radius r: the second difference of the sign's second
// integral (pbrt-v4, section 10.2.3).
float filtered_sign(float x, float r) {
  const float low = std::floor(x - r), high = std::floor(x + r);
  if (low == high) return 1 - 2 * (low - 2 * std::floor(low / 2));
  const auto integral = [](float at) {
    const float y = at / 2 - std::floor(at / 2) - 0.5f;
    return at / 2 + y * (1 - 2 * std::fabs(y));
  };
  return (integral(x + r) - 2 * integral(x) + integral(x - r)) / (r * r);
}

// How much of the footprint lies in cells of unlike parity.
float checkerboard(const TextureNode& node, const TextureQuery& query) {
  constexpr float kRadius = 1.5f;  // of the filter, in footprints
  if (node.mapping == TextureMapping::solid) {
    const Place p = place_of(node, query);
    float sign = 1;
    for (int axis = 0; axis < 3; ++axis) sign *= filtered_sign(p.point[axis], kRadius * p.width[axis]);
    return 0.5f - sign / 2;
  }
  const Mapped at = mapped(node, query);
  return 0.5f - filtered_sign(at.st.x, kRadius * at.width.x) * filtered_sign(at.st.y, kRadius * at.width.y) / 2;
}

cache::Texel grey(float value) { return {{value, value, value, 1}}; }

// Textures of solid noise: no lookups, no children.
cache::Texel noise_value(const TextureNode& node, const TextureQuery& query) {
  const Place at = place_of(node, query);
  const float roughness = node.value[0];
  const auto octaves = static_cast<uint32_t>(node.value[1]);
  switch (node.kind) {
    case TextureKind::fbm:
      return grey(shading::fractal_noise(at.point, at.longest, roughness, octaves));
    case TextureKind::wrinkled:
      return grey(shading::turbulence(at.point, at.longest, roughness, octaves));
    case TextureKind::windy:
      return grey(shading::windy_waves(at.point, at.longest));
    default:
      break;
  }
  const Rgb c = shading::marble_color(at.point, at.longest, {roughness, node.value[2], node.value[3], octaves});
  return {{c.r, c.g, c.b, 1}};
}

bool is_noise(TextureKind kind) { return kind >= TextureKind::fbm; }

// Where a query is on its face. Without a footprint (opacity is asked for so) the finest level answers.
cache::FaceTextureRequest face_request(const TextureNode& node, const TextureQuery& query) {
  // A mesh that has none is damaged: the cache refuses the face.
  static constexpr FacePoint kNone{cache::kNoFace, 0, 0, 0, 0, 0};
  const FacePoint& at = query.point != nullptr && query.point->face != nullptr ? *query.point->face : kNone;
  const float width_u = query.width_uv > 0 ? at.width_u : 0, width_v = query.width_uv > 0 ? at.width_v : 0;
  const auto choice = node.filter == cache::TexelFilter::trilinear ? cache::FaceLevelChoice::trilinear
                                                                   : cache::FaceLevelChoice::stochastic;
  return {node.image, at.face, at.u, at.v, width_u, width_v, at.random, choice};
}

float along_direction(const TextureNode& node, const TextureQuery& query) {
  return std::fabs(dot(query.point->normal_geometric, {node.value[0], node.value[1], node.value[2]}));
}

}  // namespace

std::vector<uint32_t> face_textures_in(std::span<const TextureNode> nodes, uint32_t texture) {
  std::vector<uint32_t> found;
  std::vector<uint32_t> pending{texture};
  std::vector<bool> seen(texture + 1);
  while (!pending.empty()) {
    const uint32_t node = pending.back();
    pending.pop_back();
    if (seen[node]) continue;
    seen[node] = true;
    if (nodes[node].kind == TextureKind::face) found.push_back(nodes[node].image);
    for (uint32_t c = 0; c < child_count(nodes[node].kind); ++c) pending.push_back(nodes[node].child[c]);
  }
  return found;
}

std::vector<uint32_t> face_texture_params(const Material& m, std::span<const TextureNode> nodes) {
  std::vector<uint32_t> found;
  const uint32_t textures[] = {m.reflectance.texture,
                               m.transmittance.texture,
                               m.u_roughness.texture,
                               m.v_roughness.texture,
                               m.base_u_roughness.texture,
                               m.base_v_roughness.texture,
                               m.conductor_eta.texture,
                               m.conductor_k.texture,
                               m.mix_amount.texture,
                               m.displacement,
                               m.normal_map};
  for (const uint32_t texture : textures)
    if (texture != TextureId::kNone && !face_textures_in(nodes, texture).empty()) found.push_back(texture);
  return found;
}

// Scale first, then inversion, which never goes below zero (pbrt-v4, ImageTexture).
cache::Texel image_value(const TextureNode& node, cache::Texel texel) {
  if (node.is_float) {
    const float mean = (texel.value[0] + texel.value[1] + texel.value[2]) * (1.0f / 3);
    // Grey keeps its bits.
    if (texel.value[0] != texel.value[1] || texel.value[1] != texel.value[2])
      texel.value[0] = texel.value[1] = texel.value[2] = mean;
  }
  for (int c = 0; c < 4; ++c) texel.value[c] *= node.value[c];
  if (node.invert)
    for (int c = 0; c < 3; ++c) texel.value[c] = std::max(0.0f, 1 - texel.value[c]);
  return texel;
}

Status TextureEvaluator::evaluate(std::span<const TextureQuery> queries, std::span<cache::Texel> values,
                                  Scratch& scratch) const {
  scratch.requests.clear(), scratch.face_requests.clear();
  scratch.users.clear(), scratch.face_users.clear();
  for (const TextureQuery& query : queries) collect_and_count(query, scratch);
  scratch.texels.resize(scratch.requests.size());
  if (!scratch.requests.empty()) SPILLWAY_TRY(images_->look_up(scratch.requests, scratch.texels, scratch.users));
  if (!scratch.face_requests.empty()) {
    scratch.face_texels.resize(scratch.face_requests.size());
    SPILLWAY_TRY(images_->look_up_faces(scratch.face_requests, scratch.face_texels, scratch.face_users));
  }
  Texels next{scratch.texels.data(), scratch.face_texels.data()};
  for (size_t i = 0; i < queries.size(); ++i) values[i] = combine(queries[i].texture, queries[i], next);
  return {};
}

void TextureEvaluator::collect_and_count(const TextureQuery& query, Scratch& scratch) const {
  const size_t before = scratch.lookup_count();
  collect(query.texture, query, scratch);
  if (scratch.tally.counts.empty()) return;
  const auto point = static_cast<size_t>(query.point - scratch.tally.points);
  scratch.tally.counts[point] += static_cast<uint32_t>(scratch.lookup_count() - before);
  if (scratch.tally.users.empty()) return;
  scratch.users.resize(scratch.requests.size(), scratch.tally.users[point]);
  scratch.face_users.resize(scratch.face_requests.size(), scratch.tally.users[point]);
}

// Image lookups of a node, in the order in which combine() takes their texels.
void TextureEvaluator::collect(uint32_t node, const TextureQuery& query, Scratch& scratch) const {
  const TextureNode& n = nodes_[node];
  if (n.kind == TextureKind::image) {
    const Mapped at = mapped(n, query);
    scratch.requests.push_back({n.image, n.wrap, n.filter, at.st.x, at.st.y, std::max(at.width.x, at.width.y)});
  }
  if (n.kind == TextureKind::face) scratch.face_requests.push_back(face_request(n, query));
  for (uint32_t c = 0; c < child_count(n.kind); ++c) collect(n.child[c], query, scratch);
}

void TextureEvaluator::append_face_requests(const TextureQuery& query,
                                            std::vector<cache::FaceTextureRequest>& requests) const {
  const auto visit = [&](const auto& self, uint32_t node) -> void {
    const TextureNode& n = nodes_[node];
    if (n.kind == TextureKind::face) requests.push_back(face_request(n, query));
    for (uint32_t c = 0; c < child_count(n.kind); ++c) self(self, n.child[c]);
  };
  visit(visit, query.texture);
}

cache::Texel TextureEvaluator::combine(uint32_t node, const TextureQuery& query, Texels& next) const {
  const TextureNode& n = nodes_[node];
  if (n.kind == TextureKind::constant) return {{n.value[0], n.value[1], n.value[2], n.value[3]}};
  if (n.kind == TextureKind::image) return image_value(n, *next.image++);
  if (n.kind == TextureKind::face) return image_value(n, *next.face++);
  if (is_noise(n.kind)) return noise_value(n, query);
  cache::Texel child[4];
  for (uint32_t c = 0; c < child_count(n.kind); ++c) child[c] = combine(n.child[c], query, next);
  switch (n.kind) {
    case TextureKind::scale: return product(child[0], child[1]);
    case TextureKind::mix: return mixed(child[0], child[1], child[2].value[0]);
    case TextureKind::checkerboard: return mixed(child[0], child[1], checkerboard(n, query));
    case TextureKind::direction_mix:
      return mixed(child[1], child[0], along_direction(n, query));
    case TextureKind::dots:
      return shading::is_inside_dot(mapped(n, query).st) ? child[0] : child[1];
    default: break;
  }
  const Float2 st = mapped(n, query).st;
  return mixed(mixed(child[0], child[1], st.y), mixed(child[2], child[3], st.y), st.x);
}

}  // namespace spillway::pipeline
