#pragma once

// Small vectors that may lie in records and on disk: packed, trivially copyable 32-bit floats.
// (Imath's are neither trivially copyable nor of guaranteed layout.)

#include <algorithm>
#include <cmath>
#include <type_traits>

namespace spillway {

struct Float2 {
  float x, y;
};

struct Float3 {
  float x, y, z;
  float operator[](int i) const { return i == 0 ? x : i == 1 ? y : z; }
  float& operator[](int i) { return i == 0 ? x : i == 1 ? y : z; }
};

// Linear RGB, Rec. 709 primaries.
struct Rgb {
  float r, g, b;
};

inline Float2 operator+(Float2 a, Float2 b) { return {a.x + b.x, a.y + b.y}; }
inline Float2 operator-(Float2 a, Float2 b) { return {a.x - b.x, a.y - b.y}; }
inline Float2 operator*(Float2 a, float s) { return {a.x * s, a.y * s}; }

inline Float3 operator+(Float3 a, Float3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Float3 operator-(Float3 a, Float3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Float3 operator-(Float3 a) { return {-a.x, -a.y, -a.z}; }
inline Float3 operator*(Float3 a, float s) { return {a.x * s, a.y * s, a.z * s}; }
inline Float3 operator*(float s, Float3 a) { return a * s; }
inline Float3& operator+=(Float3& a, Float3 b) { return a = a + b; }
inline bool operator==(Float3 a, Float3 b) { return a.x == b.x && a.y == b.y && a.z == b.z; }
inline float dot(Float3 a, Float3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Float3 cross(Float3 a, Float3 b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline float length_squared(Float3 a) { return dot(a, a); }
inline float length(Float3 a) { return std::sqrt(dot(a, a)); }
inline Float3 normalize(Float3 a) { return a * (1.0f / length(a)); }
inline Float3 min(Float3 a, Float3 b) { return {std::min(a.x, b.x), std::min(a.y, b.y), std::min(a.z, b.z)}; }
inline Float3 max(Float3 a, Float3 b) { return {std::max(a.x, b.x), std::max(a.y, b.y), std::max(a.z, b.z)}; }
inline float max_abs(Float3 a) { return std::max({std::fabs(a.x), std::fabs(a.y), std::fabs(a.z)}); }
inline bool is_finite(Float3 a) { return std::isfinite(a.x) && std::isfinite(a.y) && std::isfinite(a.z); }

inline Rgb operator+(Rgb a, Rgb b) { return {a.r + b.r, a.g + b.g, a.b + b.b}; }
inline Rgb operator-(Rgb a, Rgb b) { return {a.r - b.r, a.g - b.g, a.b - b.b}; }
inline Rgb operator*(Rgb a, Rgb b) { return {a.r * b.r, a.g * b.g, a.b * b.b}; }
inline Rgb operator/(Rgb a, Rgb b) { return {a.r / b.r, a.g / b.g, a.b / b.b}; }
inline Rgb operator*(Rgb a, float s) { return {a.r * s, a.g * s, a.b * s}; }
inline Rgb operator*(float s, Rgb a) { return a * s; }
inline Rgb& operator+=(Rgb& a, Rgb b) { return a = a + b; }
inline Rgb& operator*=(Rgb& a, Rgb b) { return a = a * b; }
inline bool operator==(Rgb a, Rgb b) { return a.r == b.r && a.g == b.g && a.b == b.b; }
inline bool is_black(Rgb a) { return a.r == 0 && a.g == 0 && a.b == 0; }
inline float max_component(Rgb a) { return std::max({a.r, a.g, a.b}); }
inline bool is_finite(Rgb a) { return std::isfinite(a.r) && std::isfinite(a.g) && std::isfinite(a.b); }
// Rec. 709 luminance weights (ITU-R BT.709-6, section 3).
inline float luminance(Rgb a) { return 0.2126f * a.r + 0.7152f * a.g + 0.0722f * a.b; }

// Rows of a 3 x 4 matrix that multiplies column vectors: p' = m[i][0..2] . p + m[i][3].
struct Affine3 {
  float m[3][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}};

  [[nodiscard]] Float3 point(Float3 p) const {
    return {m[0][0] * p.x + m[0][1] * p.y + m[0][2] * p.z + m[0][3],
            m[1][0] * p.x + m[1][1] * p.y + m[1][2] * p.z + m[1][3],
            m[2][0] * p.x + m[2][1] * p.y + m[2][2] * p.z + m[2][3]};
  }
  [[nodiscard]] Float3 vector(Float3 v) const {
    return {m[0][0] * v.x + m[0][1] * v.y + m[0][2] * v.z, m[1][0] * v.x + m[1][1] * v.y + m[1][2] * v.z,
            m[2][0] * v.x + m[2][1] * v.y + m[2][2] * v.z};
  }
  // Transforms a normal when *this is the inverse of the point transform (multiplies by the transpose).
  [[nodiscard]] Float3 transposed_vector(Float3 n) const {
    return {m[0][0] * n.x + m[1][0] * n.y + m[2][0] * n.z, m[0][1] * n.x + m[1][1] * n.y + m[2][1] * n.z,
            m[0][2] * n.x + m[1][2] * n.y + m[2][2] * n.z};
  }
};

struct Bounds3 {
  Float3 lower{INFINITY, INFINITY, INFINITY};
  Float3 upper{-INFINITY, -INFINITY, -INFINITY};

  void grow(Float3 p) { lower = min(lower, p), upper = max(upper, p); }
  void grow(const Bounds3& b) { lower = min(lower, b.lower), upper = max(upper, b.upper); }
  [[nodiscard]] bool empty() const { return !(lower.x <= upper.x && lower.y <= upper.y && lower.z <= upper.z); }
  [[nodiscard]] Float3 extent() const { return upper - lower; }
  [[nodiscard]] Float3 center() const { return (lower + upper) * 0.5f; }
  [[nodiscard]] float half_area() const {
    const Float3 e = extent();
    return e.x * e.y + e.y * e.z + e.z * e.x;
  }
};

static_assert(std::is_trivially_copyable_v<Float3> && sizeof(Float3) == 12);
static_assert(std::is_trivially_copyable_v<Rgb> && sizeof(Rgb) == 12);
static_assert(std::is_trivially_copyable_v<Affine3> && sizeof(Affine3) == 48);

}  // namespace spillway
