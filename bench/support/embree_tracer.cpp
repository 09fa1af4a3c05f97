#include "bench/support/embree_tracer.h"

#if SPILLWAY_EMBREE_MAJOR == 4
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include <cfloat>
#include <cstring>
#include <vector>

#include "cache/attribute_block.h"
#include "cache/file.h"

namespace spillway::bench {
namespace {

using namespace pipeline;

constexpr unsigned kOpaqueMask = 1, kAlphaMask = 2;

class EmbreeTracer final : public test::Tracer {
 public:
  EmbreeTracer() : device_(rtcNewDevice(nullptr)) {}
  ~EmbreeTracer() override {
    for (RTCScene object : objects_) rtcReleaseScene(object);
    rtcReleaseDevice(device_);
  }

  Status build(const Store& store) {
    if (!store.motions().empty())
      return error("{}: moves; the baseline traces still scenes only", store.directory().string());
    const size_t object_count = store.page_tree().objects.size();
    for (size_t i = 0; i < object_count; ++i) {
      objects_.push_back(rtcNewScene(device_));
      rtcSetSceneFlags(objects_[i], RTC_SCENE_FLAG_ROBUST);
    }
    prims_.resize(object_count);
    SPILLWAY_TRY(add_triangles(store));
    for (size_t i = 1; i < object_count; ++i) rtcCommitScene(objects_[i]);
    add_instances(store);
    rtcCommitScene(objects_[0]);
    return {};
  }

  cache::TraceHit nearest(const cache::TraceRay& ray) const override { return intersect(ray, kOpaqueMask | kAlphaMask); }

  cache::TraceHit occlusion(const cache::TraceRay& ray) const override {
    RTCRay r = embree_ray(ray, kOpaqueMask);
    occluded(r);
    if (r.tfar < 0) {
      cache::TraceHit hit = cache::no_hit(ray);
      hit.flags = cache::kHitOccluded;
      return hit;
    }
    return has_alpha_ ? intersect(ray, kAlphaMask) : cache::no_hit(ray);
  }

 private:
  static RTCRay embree_ray(const cache::TraceRay& ray, unsigned mask) {
    RTCRay r{};
    r.org_x = ray.origin_world.x, r.org_y = ray.origin_world.y, r.org_z = ray.origin_world.z;
    r.dir_x = ray.direction_world.x, r.dir_y = ray.direction_world.y, r.dir_z = ray.direction_world.z;
    // In robust mode Embree takes hits at tnear itself: of rays that leave the floor at height 0, the floor.
    r.tnear = FLT_MIN, r.tfar = ray.t_max, r.mask = mask;
    return r;
  }

  void occluded(RTCRay& ray) const {
#if SPILLWAY_EMBREE_MAJOR == 4
    rtcOccluded1(objects_[0], &ray);
#else
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcOccluded1(objects_[0], &context, &ray);
#endif
  }

  cache::TraceHit intersect(const cache::TraceRay& ray, unsigned mask) const {
    RTCRayHit r{embree_ray(ray, mask), {}};
    r.hit.geomID = r.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
#if SPILLWAY_EMBREE_MAJOR == 4
    rtcIntersect1(objects_[0], &r);
#else
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcIntersect1(objects_[0], &context, &r);
#endif
    cache::TraceHit hit = cache::no_hit(ray);
    if (r.hit.geomID == RTC_INVALID_GEOMETRY_ID) return hit;
    const bool instanced = r.hit.instID[0] != RTC_INVALID_GEOMETRY_ID;
    hit.instance = instanced ? instance_of_[r.hit.instID[0]] : 0;
    const auto& geometry = prims_[instanced ? object_of_[hit.instance] : 0][r.hit.geomID];
    hit.t = r.ray.tfar, hit.u = r.hit.u, hit.v = r.hit.v;
    hit.prim = geometry.first + r.hit.primID;
    hit.flags = geometry.alpha ? static_cast<uint32_t>(cache::kHitAlphaUnknown) : 0u;
    return hit;
  }

  Status add_triangles(const Store& store) {
    SPILLWAY_ASSIGN(const cache::ReadFile file, cache::ReadFile::open(store.attributes_path(), {}));
    for (const AttributeLocation& location : store.attributes()) {
      std::vector<std::byte> block(location.size_bytes);
      SPILLWAY_TRY(file.read(location.offset_bytes, block));
      SPILLWAY_TRY(cache::validate_attribute_block(block, "attributes"));
      cache::AttributeBlockHeader header;
      std::memcpy(&header, block.data(), sizeof header);
      const auto* segments = reinterpret_cast<const cache::AttributeSegment*>(block.data() + sizeof header);
      for (uint32_t s = 0; s < header.segment_count; ++s) add_segment(store, block, segments[s]);
    }
    return {};
  }

  void add_segment(const Store& store, std::span<const std::byte> block, const cache::AttributeSegment& segment) {
    const Mesh& mesh = store.meshes()[segment.mesh];
    const bool alpha = mesh.alpha_texture != TextureId::kNone;
    has_alpha_ = has_alpha_ || alpha;
    RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* vertices = static_cast<Float3*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                                                  sizeof(Float3), segment.vertex_count));
    for (uint32_t v = 0; v < segment.vertex_count; ++v) vertices[v] = cache::vertex_position(block.data(), segment, v);
    auto* indices = static_cast<uint32_t*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                                                   3 * sizeof(uint32_t), segment.face_count));
    for (uint32_t i = 0; i < 3 * segment.face_count; ++i) indices[i] = cache::vertex_index(block.data(), segment, i);
    rtcSetGeometryMask(geometry, alpha ? kAlphaMask : kOpaqueMask);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(objects_[mesh.object], geometry);
    rtcReleaseGeometry(geometry);
    prims_[mesh.object].push_back({segment.first_prim, alpha});
  }

  void add_instances(const Store& store) {
    object_of_.assign(store.instances().size(), 0);
    for (uint32_t i = 1; i < store.instances().size(); ++i) {
      const cache::Instance& instance = store.instances()[i];
      RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_INSTANCE);
      rtcSetGeometryInstancedScene(geometry, objects_[instance.object]);
      rtcSetGeometryTransform(geometry, 0, RTC_FORMAT_FLOAT3X4_ROW_MAJOR, &instance.world_from_object);
      rtcCommitGeometry(geometry);
      const unsigned id = rtcAttachGeometry(objects_[0], geometry);
      rtcReleaseGeometry(geometry);
      if (instance_of_.size() <= id) instance_of_.resize(id + 1);
      instance_of_[id] = i;
      object_of_[i] = instance.object;
    }
  }

  struct Geometry {
    uint32_t first;
    bool alpha;
  };
  RTCDevice device_;
  std::vector<RTCScene> objects_;
  std::vector<std::vector<Geometry>> prims_;  // by object, by geometry id
  std::vector<uint32_t> instance_of_, object_of_;
  bool has_alpha_ = false;
};

}  // namespace

Result<std::unique_ptr<test::Tracer>> embree_tracer(const Store& store) {
  auto tracer = std::make_unique<EmbreeTracer>();
  SPILLWAY_TRY(tracer->build(store));
  return std::unique_ptr<test::Tracer>(std::move(tracer));
}

}  // namespace spillway::bench
