#include "shading/portal.h"

namespace spillway::shading {
namespace {

// How far along w the rectangle is met; 0: not at all. `cosine_times`: the cosine there, times the area.
float distance_through(const Portal& portal, Float3 from, Float3 w, float& cosine_times) {
  const Float3 n = cross(portal.edge1, portal.edge2);
  cosine_times = dot(n, w);
  if (!(cosine_times > 0)) return 0;
  const float distance = dot(n, portal.corner - from) / cosine_times;
  if (!(distance > 0)) return 0;
  const Float3 inside = from + w * distance - portal.corner;
  const float a = dot(inside, portal.edge1), b = dot(inside, portal.edge2);
  const bool meets = a >= 0 && a <= length_squared(portal.edge1) && b >= 0 && b <= length_squared(portal.edge2);
  return meets ? distance : 0;
}

}  // namespace

bool looks_through(const Portal& portal, Float3 from_world, Float3 w_world) {
  float cosine_times;
  return distance_through(portal, from_world, w_world, cosine_times) > 0;
}

Float3 sample_portal(const Portal& portal, Float3 from_world, Float2 u) {
  const Float3 to = portal.corner + portal.edge1 * u.x + portal.edge2 * u.y - from_world;
  const float size = length(to);
  return size > 0 ? to * (1 / size) : Float3{0, 0, 1};
}

float portal_pdf_solid_angle(const Portal& portal, Float3 from_world, Float3 w_world) {
  float cosine_times;
  const float distance = distance_through(portal, from_world, w_world, cosine_times);
  return distance > 0 ? distance * distance / cosine_times : 0;
}

}  // namespace spillway::shading
