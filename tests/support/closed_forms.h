#pragma once

// Answers in double precision, from the textbook and not from shading/: what surfaces and gas should return.

#include <cmath>
#include <complex>
#include <functional>

#include "tests/support/failure_scene.h"

namespace spillway::test {

inline double dot(Vec a, Vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec operator+(Vec a, Vec b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec operator-(Vec a, Vec b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec operator*(Vec a, double s) { return {a.x * s, a.y * s, a.z * s}; }
inline Vec unit(Vec a) { return a * (1 / std::sqrt(dot(a, a))); }

// Gauss's rule of five points in each of `cells` cells.
double integral(double from, double to, int cells, const std::function<double(double)>& f);
// Mean over the square |x| <= half, |y| <= half.
double mean_over_square(double half, int cells, const std::function<double(double, double)>& f);

// Unpolarised reflectance of a plane boundary, light from a vacuum (Fresnel's equations with a complex index).
double reflectance(double cosine, std::complex<double> index);

// A metal with facets distributed as GGX, height-correlated Smith masking: f(i, o), z the normal, without the cosine.
// Walter et al. 2007, equations 20, 33 and 34; Heitz 2014, equation 99.
double metal(Vec i, Vec o, double alpha, std::complex<double> index);
inline const std::complex<double> kMetalIndex{0.2, 3.9};
std::string metal_words(double alpha);  // the same as a Material

}  // namespace spillway::test
