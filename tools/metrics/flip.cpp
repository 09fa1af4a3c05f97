#include "tools/metrics/flip.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "cache/base/parallel.h"

namespace spillway::tools {
namespace {

using Plane = std::vector<float>;  // one channel, row by row

struct Double3 {
  double x, y, z;
};

// ---- colour ----

// Rows of a matrix.
struct Double3x3 {
  Double3 row[3];
};
Double3 operator*(const Double3x3& m, Double3 v) {
  const auto dot = [&](Double3 r) { return r.x * v.x + r.y * v.y + r.z * v.z; };
  return {dot(m.row[0]), dot(m.row[1]), dot(m.row[2])};
}

Double3 cross(Double3 a, Double3 b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }

Double3x3 inverse(const Double3x3& m) {
  const Double3 &a = m.row[0], &b = m.row[1], &c = m.row[2];
  const Double3 bc = cross(b, c), ca = cross(c, a), ab = cross(a, b);  // columns of the inverse times the determinant
  const double d = a.x * bc.x + a.y * bc.y + a.z * bc.z;
  return {{{bc.x / d, ca.x / d, ab.x / d}, {bc.y / d, ca.y / d, ab.y / d}, {bc.z / d, ca.z / d, ab.z / d}}};
}

// Linear sRGB to CIE XYZ from the chromaticities of Rec. 709's primaries and of D65 (ITU-R BT.709-6, section 1).
Double3x3 make_xyz_from_rgb() {
  const Double3x3 primaries{{{0.64, 0.30, 0.15}, {0.33, 0.60, 0.06}, {0.03, 0.10, 0.79}}};  // x, y, z a column
  const Double3 white{0.3127 / 0.3290, 1, (1 - 0.3127 - 0.3290) / 0.3290};
  const Double3 weight = inverse(primaries) * white;
  Double3x3 m = primaries;
  for (Double3& row : m.row) row = {row.x * weight.x, row.y * weight.y, row.z * weight.z};
  return m;
}

const Double3x3 kXyzFromRgb = make_xyz_from_rgb();
const Double3x3 kRgbFromXyz = inverse(kXyzFromRgb);
Double3 xyz_from_rgb(Double3 c) { return kXyzFromRgb * c; }
Double3 rgb_from_xyz(Double3 c) { return kRgbFromXyz * c; }

const Double3 kWhite = xyz_from_rgb({1, 1, 1});

// The linear opponent space YyCxCz (the paper, section 4.1).
Double3 opponent_from_rgb(Double3 c) {
  const Double3 xyz = xyz_from_rgb(c);
  const double x = xyz.x / kWhite.x, y = xyz.y / kWhite.y, z = xyz.z / kWhite.z;
  return {116 * y - 16, 500 * (x - y), 200 * (y - z)};
}

Double3 rgb_from_opponent(Double3 c) {
  const double y = (c.x + 16) / 116, x = c.y / 500 + y, z = y - c.z / 200;
  return rgb_from_xyz({x * kWhite.x, y * kWhite.y, z * kWhite.z});
}

// CIELAB, with a* and b* weakened in the dark (Hunt's effect; section 4.1).
Double3 hunt_lab_from_rgb(Double3 c) {
  const auto f = [](double t) {
    constexpr double kDelta = 6.0 / 29.0;
    return t > kDelta * kDelta * kDelta ? std::cbrt(t) : t / (3 * kDelta * kDelta) + 4.0 / 29.0;
  };
  const Double3 xyz = xyz_from_rgb(c);
  const double x = f(xyz.x / kWhite.x), y = f(xyz.y / kWhite.y), z = f(xyz.z / kWhite.z);
  const double lightness = 116 * y - 16;
  return {lightness, 0.01 * lightness * 500 * (x - y), 0.01 * lightness * 200 * (y - z)};
}

double hyab(Double3 a, Double3 b) { return std::fabs(a.x - b.x) + std::hypot(a.y - b.y, a.z - b.z); }

// ---- filters: sums of separable ones ----

struct Kernel1d {
  int radius = 0;
  std::vector<double> weights;  // 2 * radius + 1
};

template <class Weight>
Kernel1d make_kernel(int radius, const Weight& weight) {
  Kernel1d kernel{radius, {}};
  for (int i = -radius; i <= radius; ++i) kernel.weights.push_back(weight(static_cast<double>(i)));
  return kernel;
}

double total(const Kernel1d& kernel) {
  double sum = 0;
  for (const double w : kernel.weights) sum += w;
  return sum;
}

struct Size {
  int width, height;
};

// One pass along x (step 1) or y; beyond the border the border's value goes on.
Plane convolve_axis(const Plane& in, Size size, const Kernel1d& kernel, bool along_x) {
  Plane out(in.size());
  const int last = (along_x ? size.width : size.height) - 1;
  parallel_blocks(static_cast<size_t>(size.height), 16, [&](size_t, size_t first, size_t end) {
    for (int y = static_cast<int>(first); y < static_cast<int>(end); ++y)
      for (int x = 0; x < size.width; ++x) {
        double sum = 0;
        for (int k = -kernel.radius; k <= kernel.radius; ++k) {
          const int at = std::clamp((along_x ? x : y) + k, 0, last);
          const size_t from = along_x ? size_t(y) * size.width + at : size_t(at) * size.width + x;
          sum += kernel.weights[static_cast<size_t>(k + kernel.radius)] * in[from];
        }
        out[size_t(y) * size.width + x] = static_cast<float>(sum);
      }
  });
  return out;
}

Plane convolve(const Plane& in, Size size, const Kernel1d& kernel_x, const Kernel1d& kernel_y) {
  return convolve_axis(convolve_axis(in, size, kernel_x, true), size, kernel_y, false);
}

// ---- colour difference (section 4.1) ----

// Gaussians a sqrt(pi / b) exp(-pi^2 d^2 / b), d in degrees: contrast sensitivity of one opponent channel (Table 1).
struct Sensitivity {
  double a1, b1, a2, b2;
};
constexpr Sensitivity kSensitivity[3] = {{1, 0.0047, 0, 1e-5}, {1, 0.0053, 0, 1e-5}, {34.1, 0.04, 13.5, 0.025}};
constexpr double kWidestB = 0.04;

// The channel filtered by its sensitivity, whose weights sum to one.
Plane filter_channel(const Plane& in, Size size, const Sensitivity& s, double pixels_per_degree) {
  constexpr double kPi = std::numbers::pi;
  const int radius = static_cast<int>(std::ceil(3 * std::sqrt(kWidestB / (2 * kPi * kPi)) * pixels_per_degree));
  const auto gaussian = [&](double b) {
    const double scale = kPi * kPi / (b * pixels_per_degree * pixels_per_degree);
    return make_kernel(radius, [&](double i) { return std::exp(-scale * i * i); });
  };
  const auto mass = [&](double a, double b) {
    const double sum = total(gaussian(b));
    return a * std::sqrt(kPi / b) * sum * sum;
  };
  const auto part = [&](double b) {
    Kernel1d kernel = gaussian(b);
    const double sum = total(kernel);
    for (double& w : kernel.weights) w /= sum;
    return convolve(in, size, kernel, kernel);
  };
  Plane out = part(s.b1);
  if (s.a2 == 0) return out;
  const Plane second = part(s.b2);
  const double share = mass(s.a2, s.b2) / (mass(s.a1, s.b1) + mass(s.a2, s.b2));
  for (size_t i = 0; i < out.size(); ++i) out[i] = static_cast<float>((1 - share) * out[i] + share * second[i]);
  return out;
}

struct Planes {
  Plane channel[3];
  [[nodiscard]] Double3 at(size_t i) const { return {channel[0][i], channel[1][i], channel[2][i]}; }
};

Double3 display_rgb(const Rgb& c, float gain) {
  const auto one = [&](float v) { return v * gain > 0 ? std::min(double{v} * gain, 1.0) : 0.0; };
  return {one(c.r), one(c.g), one(c.b)};
}

Planes opponent_planes(const Picture& picture, float gain) {
  Planes planes;
  for (Plane& plane : planes.channel) plane.resize(picture.pixels.size());
  for (size_t i = 0; i < picture.pixels.size(); ++i) {
    const Double3 c = opponent_from_rgb(display_rgb(picture.pixels[i], gain));
    planes.channel[0][i] = static_cast<float>(c.x), planes.channel[1][i] = static_cast<float>(c.y);
    planes.channel[2][i] = static_cast<float>(c.z);
  }
  return planes;
}

Planes perceived(const Planes& opponent, Size size, double pixels_per_degree) {
  Planes out;
  for (int c = 0; c < 3; ++c)
    out.channel[c] = filter_channel(opponent.channel[c], size, kSensitivity[c], pixels_per_degree);
  return out;
}

Double3 clamped(Double3 c) { return {std::clamp(c.x, 0.0, 1.0), std::clamp(c.y, 0.0, 1.0), std::clamp(c.z, 0.0, 1.0)}; }

// HyAB distances to [0, 1]: the lower 40 % of the range takes 95 % of the result (constants of section 4.1).
double colour_difference(Double3 a, Double3 b) {
  constexpr double kExponent = 0.7, kKnee = 0.4, kKneeValue = 0.95;
  static const double kLargest = std::pow(hyab(hunt_lab_from_rgb({0, 1, 0}), hunt_lab_from_rgb({0, 0, 1})), kExponent);
  const double d =
      std::pow(hyab(hunt_lab_from_rgb(clamped(rgb_from_opponent(a))), hunt_lab_from_rgb(clamped(rgb_from_opponent(b)))),
               kExponent);
  const double knee = kKnee * kLargest;
  if (d < knee) return d * kKneeValue / knee;
  return kKneeValue + (d - knee) / (kLargest - knee) * (1 - kKneeValue);
}

// ---- feature difference (section 4.2) ----

// First or second derivative of a Gaussian, positive and negative weights each summing to one.
Kernel1d detector(int radius, double sigma, bool edge) {
  Kernel1d kernel = make_kernel(radius, [&](double x) {
    const double g = std::exp(-x * x / (2 * sigma * sigma));
    return edge ? -x * g : (x * x / (sigma * sigma) - 1) * g;
  });
  double positive = 0, negative = 0;
  for (const double w : kernel.weights) (w > 0 ? positive : negative) += std::fabs(w);
  for (double& w : kernel.weights) w /= w > 0 ? positive : negative;
  return kernel;
}

// Magnitude of the detector's response along x and y to the luminance in [0, 1].
Plane feature(const Plane& luminance, Size size, bool edge, double pixels_per_degree) {
  constexpr double kFeatureWidthDegrees = 0.082;
  const double sigma = 0.5 * kFeatureWidthDegrees * pixels_per_degree;
  const int radius = static_cast<int>(std::ceil(3 * sigma));
  Kernel1d smooth = make_kernel(radius, [&](double x) { return std::exp(-x * x / (2 * sigma * sigma)); });
  const double sum = total(smooth);
  for (double& w : smooth.weights) w /= sum;
  const Kernel1d detect = detector(radius, sigma, edge);
  Plane along_x = convolve(luminance, size, detect, smooth);
  const Plane along_y = convolve(luminance, size, smooth, detect);
  for (size_t i = 0; i < along_x.size(); ++i) along_x[i] = std::hypot(along_x[i], along_y[i]);
  return along_x;
}

Plane normalized_luminance(const Planes& opponent) {
  Plane out = opponent.channel[0];
  for (float& v : out) v = (v + 16) / 116;
  return out;
}

}  // namespace

std::vector<float> flip(const Picture& a, const Picture& b, const FlipOptions& options) {
  const Size size{a.width, a.height};
  const float gain = std::exp2(options.exposure_stops);
  const double ppd = options.pixels_per_degree;
  const Planes raw_a = opponent_planes(a, gain), raw_b = opponent_planes(b, gain);
  const Planes seen_a = perceived(raw_a, size, ppd), seen_b = perceived(raw_b, size, ppd);
  const Plane luminance_a = normalized_luminance(raw_a), luminance_b = normalized_luminance(raw_b);
  const Plane edge_a = feature(luminance_a, size, true, ppd), edge_b = feature(luminance_b, size, true, ppd);
  const Plane point_a = feature(luminance_a, size, false, ppd), point_b = feature(luminance_b, size, false, ppd);
  std::vector<float> out(a.pixels.size());
  parallel_blocks(out.size(), 4096, [&](size_t, size_t first, size_t end) {
    for (size_t i = first; i < end; ++i) {
      const double colour = colour_difference(seen_a.at(i), seen_b.at(i));
      const double differs = std::max(std::fabs(edge_a[i] - edge_b[i]), std::fabs(point_a[i] - point_b[i]));
      const double features = std::sqrt(std::min(differs / std::numbers::sqrt2, 1.0));
      out[i] = static_cast<float>(std::pow(colour, 1 - features));
    }
  });
  return out;
}

}  // namespace spillway::tools
