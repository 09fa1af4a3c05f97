#pragma once

// Points on a triangle, seen from a receiver: evenly over the solid angle where that is large, evenly over the area
// where it is small. One rule decides, from receiver and triangle alone, so that a chance hit knows the same density.
//
// Based on: Arvo 1995, Stratified Sampling of Spherical Triangles, in the form of Peters 2021, BRDF Importance Sampling
// for Polygonal Lights, section 3 (one arc tangent, no arc cosine); Heitz 2019, A Low-Distortion Map Between Triangle
// and Square (area).

#include <span>

#include "cache/base/vec.h"

namespace spillway::shading {

// p0, p0 + edge1, p0 + edge2, in the space of the receiver.
struct TriangleShape {
  Float3 position, edge1, edge2;
};

struct TrianglePoint {
  Float3 point{0, 0, 0};
  float pdf_solid_angle = 0;  // 0: the triangle is seen edge-on, or the receiver is that point
};

[[nodiscard]] TrianglePoint sample_triangle(const TriangleShape& triangle, Float3 receiver, Float2 u);

// Several at once, points[i] of queries[i]: the bits of sample_triangle() in a fraction of its time.
struct TriangleQuery {
  TriangleShape triangle;
  Float3 receiver;
  Float2 u;
};
void sample_triangles(std::span<const TriangleQuery> queries, std::span<TrianglePoint> points);

// The density of that point, bit for bit what sampling returned with it.
[[nodiscard]] float triangle_pdf_solid_angle(const TriangleShape& triangle, Float3 receiver, Float3 point);

// The same evenly over the area, from wherever it is seen: noisier near by, to measure the other by.
[[nodiscard]] TrianglePoint sample_triangle_by_area(const TriangleShape& triangle, Float3 receiver, Float2 u);
[[nodiscard]] float triangle_pdf_by_area(const TriangleShape& triangle, Float3 receiver, Float3 point);

// The solid angle of a triangle that is sampled by it, within 2 pi; 0 for one that is sampled by area.
[[nodiscard]] float sampled_solid_angle(const TriangleShape& triangle, Float3 receiver);

}  // namespace spillway::shading
