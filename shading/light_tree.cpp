#include "shading/light_tree.h"

#include <immintrin.h>

#include <algorithm>
#include <cmath>

#include "shading/weigh_lights.h"

namespace spillway::shading {
namespace {

// A child whose doubt is a smaller part of the whole is not looked into.
constexpr float kWorthALook = 1e-3f;

void weigh_or_by_energy(const LightTree& tree, uint32_t node, const LocalLightReceiver& receiver, LightWeights& w) {
  w.sum = 0;
  if (!tree.by_energy) weigh_lights(tree.nodes[node], receiver, w);
  if (!(w.sum > 0)) weigh_lights_by_energy(tree.nodes[node], w);
}

// The sums of the first one, two, ... eight weights.
struct Prefixes {
  alignas(32) double before[kLightNodeWidth + 1];
  explicit Prefixes(const float (&weight)[kLightNodeWidth]) {
    const auto scan = [](__m256d x) {
      const __m256d zero = _mm256_setzero_pd();
      x = _mm256_add_pd(x, _mm256_blend_pd(_mm256_permute4x64_pd(x, 0x90), zero, 1));
      return _mm256_add_pd(x, _mm256_blend_pd(_mm256_permute4x64_pd(x, 0x44), zero, 3));
    };
    const __m256d low = scan(_mm256_cvtps_pd(_mm_load_ps(weight)));
    const __m256d high =
        _mm256_add_pd(scan(_mm256_cvtps_pd(_mm_load_ps(weight + 4))), _mm256_permute4x64_pd(low, 0xff));
    before[0] = 0;
    _mm256_storeu_pd(before + 1, low);
    _mm256_storeu_pd(before + 5, high);
    low_ = low, high_ = high;
  }
  // How many of the sums are at most x.
  [[nodiscard]] uint32_t count_until(double x) const {
    const __m256d at = _mm256_set1_pd(x);
    const int low = _mm256_movemask_pd(_mm256_cmp_pd(low_, at, _CMP_LE_OQ));
    const int high = _mm256_movemask_pd(_mm256_cmp_pd(high_, at, _CMP_LE_OQ));
    return static_cast<uint32_t>(__builtin_popcount(static_cast<unsigned>(low | high << 4)));
  }

 private:
  __m256d low_, high_;
};

// The slot whose part of the weights holds the target; u becomes the place inside of that part.
uint32_t choose(const float (&weight)[kLightNodeWidth], double target, double& u) {
  const Prefixes sums(weight);
  uint32_t slot = std::min(sums.count_until(target), uint32_t{kLightNodeWidth - 1});
  while (slot > 0 && !(weight[slot] > 0)) --slot;  // only where rounding led beyond the last one
  const double inside = (target - sums.before[slot]) / static_cast<double>(weight[slot]);
  u = std::min(std::max(inside, 0.0), 0x1.fffffffffffffp-1);
  return slot;
}

// The places from a leaf up to its root, appended.
struct Trail {
  uint32_t places[2 * kMaxLightTreeDepth];
  uint32_t count = 0;
  void climb(const LightTree& tree, uint32_t leaf) {
    for (uint32_t place = leaf; place != kNoLightNode && count < 2 * kMaxLightTreeDepth;
         place = tree.nodes[place / kLightNodeWidth].parent)
      places[count++] = place;
  }
};

// What brings weights of an object's tree to the world's: the energy that the instance has there, over the mean square
// of what lengths are multiplied by.
float scale_of_instance(const LightInstance& instance, float energy) {
  float squares = 0;
  for (const auto& row : instance.world_from_object.m) squares += row[0] * row[0] + row[1] * row[1] + row[2] * row[2];
  return 3 * energy / squares;
}

}  // namespace

// Octahedral, 1 to 255 along each side: zero stays free for "none".
uint16_t pack_receiver_normal(Float3 n) {
  const float size = std::fabs(n.x) + std::fabs(n.y) + std::fabs(n.z);
  if (!(size > 0)) return 0;
  float x = n.x / size, y = n.y / size;
  if (n.z < 0) {
    const float folded_x = std::copysign(1 - std::fabs(y), x), folded_y = std::copysign(1 - std::fabs(x), y);
    x = folded_x, y = folded_y;
  }
  const auto byte = [](float v) { return static_cast<uint16_t>(std::clamp(128 + 127 * v + 0.5f, 1.0f, 255.0f)); };
  return static_cast<uint16_t>(byte(x) << 8 | byte(y));
}

Float3 unpack_receiver_normal(uint16_t packed) {
  const float x = (static_cast<float>(packed >> 8) - 128) * (1.0f / 127);
  const float y = (static_cast<float>(packed & 0xff) - 128) * (1.0f / 127);
  Float3 n{x, y, 1 - std::fabs(x) - std::fabs(y)};
  if (n.z < 0) {
    n.x = std::copysign(1 - std::fabs(y), x);
    n.y = std::copysign(1 - std::fabs(x), y);
  }
  return normalize(n);
}

// A slot of a node, and how to see it.
struct LightChances::Place {
  uint32_t node, slot, instance;
  LocalLightReceiver receiver;
  float pmf;
};

LightChances::LightChances(const LightTree& tree, const LightReceiver& receiver)
    : tree_(tree), world_(receiver_in_world(receiver)) {
  if (!tree.by_energy && tree.roots[0] != kNoLightNode) make_front();
}

void LightChances::add_part(uint32_t node, uint32_t instance, const LocalLightReceiver& receiver) {
  Part& part = parts_[count_];
  LightWeights weights;
  weigh_lights(tree_.nodes[node], receiver, weights, part.urgency);
  std::copy(weights.of, weights.of + kLightNodeWidth, part.weight);
  std::fill(std::begin(part.replaced_by), std::end(part.replaced_by), uint8_t{0});
  part.receiver = receiver, part.sum = weights.sum;
  part.node = node, part.instance = instance;
  most_urgent_[count_++] = *std::max_element(std::begin(part.urgency), std::end(part.urgency));
}

void LightChances::make_front() {
  add_part(tree_.roots[0], 0, world_);
  float sum = parts_[0].sum;  // running
  while (count_ < kLightFrontNodes) {
    const auto part = static_cast<uint32_t>(std::max_element(most_urgent_, most_urgent_ + count_) - most_urgent_);
    if (!(most_urgent_[part] > kWorthALook * sum)) break;
    const float(&urgency)[kLightNodeWidth] = parts_[part].urgency;
    const auto slot = static_cast<uint32_t>(std::max_element(urgency, urgency + kLightNodeWidth) - urgency);
    const float before = parts_[part].weight[slot];
    if (!replace(part, slot)) break;
    sum += parts_[count_ - 1].sum - before;
  }
  sum_ = 0;
  for (uint32_t i = 0; i < count_; ++i) sum_ += parts_[i].sum;
}

// By the node below it.
bool LightChances::replace(uint32_t index, uint32_t slot) {
  Part& part = parts_[index];
  const uint32_t child = tree_.nodes[part.node].child[slot], below = light_child_index(child);
  const bool is_instance = light_child_kind(child) == LightChild::instance;
  const uint32_t node = is_instance ? tree_.roots[tree_.instances[below].object] : below;
  if (node == kNoLightNode) return false;
  part.weight[slot] = 0, part.urgency[slot] = 0;
  part.replaced_by[slot] = static_cast<uint8_t>(count_);
  part.sum = 0;
  for (const float w : part.weight) part.sum += w;
  most_urgent_[index] = *std::max_element(std::begin(part.urgency), std::end(part.urgency));
  if (is_instance) {
    LocalLightReceiver local = receiver_in_object(world_, tree_.instances[below]);
    local.scale = scale_of_instance(tree_.instances[below], tree_.nodes[part.node].energy[slot]);
    add_part(node, below, local);
  } else {
    add_part(node, part.instance, part.receiver);
  }
  return true;
}

LightChances::Place LightChances::choose_in_front(double& u) const {
  if (!(sum_ > 0)) {
    LightWeights w;
    weigh_lights_by_energy(tree_.nodes[tree_.roots[0]], w);
    const uint32_t slot = choose(w.of, u * static_cast<double>(w.sum), u);
    return {tree_.roots[0], slot, 0, world_, w.of[slot] / w.sum};
  }
  double target = u * static_cast<double>(sum_);
  uint32_t chosen = 0;
  for (uint32_t i = 0; i < count_; ++i) {
    if (!(parts_[i].sum > 0)) continue;
    chosen = i;
    if (target < static_cast<double>(parts_[i].sum)) break;
    target -= static_cast<double>(parts_[i].sum);
  }
  const Part& part = parts_[chosen];
  const uint32_t slot = choose(part.weight, target, u);
  return {part.node, slot, part.instance, part.receiver, part.weight[slot] / sum_};
}

LightPick LightChances::pick(double u) const {
  if (tree_.roots[0] == kNoLightNode) return {};
  Place at = choose_in_front(u);
  while (true) {
    const uint32_t child = tree_.nodes[at.node].child[at.slot], index = light_child_index(child);
    const LightChild kind = light_child_kind(child);
    if (kind == LightChild::emitter || kind == LightChild::light) return {kind, index, at.instance, at.pmf};
    at.node = index;
    if (kind == LightChild::instance) {
      at.receiver = receiver_in_object(world_, tree_.instances[index]);
      at.instance = index, at.node = tree_.roots[tree_.instances[index].object];
      if (at.node == kNoLightNode) return {};
    }
    LightWeights w;
    weigh_or_by_energy(tree_, at.node, at.receiver, w);
    if (!(w.sum > 0)) return {};
    at.slot = choose(w.of, u * static_cast<double>(w.sum), u);
    at.pmf *= w.of[at.slot] / w.sum;
  }
}

float LightChances::of_emitter(uint32_t instance, uint32_t emitter) const {
  if (tree_.emitter_leaves[emitter] == kNoLightNode) return 0;
  Trail trail;
  trail.climb(tree_, tree_.emitter_leaves[emitter]);
  const uint32_t in_object_count = trail.count;
  if (instance != 0) {
    if (instance >= tree_.instance_leaves.size() || tree_.instance_leaves[instance] == kNoLightNode) return 0;
    trail.climb(tree_, tree_.instance_leaves[instance]);
  }
  uint32_t i = trail.count;
  LocalLightReceiver local = world_;
  float pmf = 1;
  for (uint32_t part = 0; sum_ > 0;) {  // down to the place that stands in the front
    const uint32_t slot = trail.places[--i] % kLightNodeWidth;
    local = parts_[part].receiver;
    if (parts_[part].replaced_by[slot] == 0) {
      pmf = parts_[part].weight[slot] / sum_;
      break;
    }
    part = parts_[part].replaced_by[slot];
  }
  while (i-- > 0) {
    if (instance != 0 && i + 1 == in_object_count) local = receiver_in_object(world_, tree_.instances[instance]);
    LightWeights w;
    // A front without weight is left by energy, as sampling leaves it.
    if (!(sum_ > 0) && i + 1 == trail.count)
      weigh_lights_by_energy(tree_.nodes[tree_.roots[0]], w);
    else
      weigh_or_by_energy(tree_, trail.places[i] / kLightNodeWidth, local, w);
    if (!(w.sum > 0)) return 0;
    pmf *= w.of[trail.places[i] % kLightNodeWidth] / w.sum;
  }
  return pmf;
}

}  // namespace spillway::shading
