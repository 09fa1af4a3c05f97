#pragma once

#include <cmath>

namespace spillway::test {

// Of radiance one at its brightest wavelength: Planck's law (second constant 1.438777e7 nm K, displacement 2.897772e6
// nm K) times the luminosity function, both as pbrt has them for glowing gas. The function is Wyman, Sloan and
// Shirley's fit (2013), within half a per cent here.
inline double luminance_of_a_body(double kelvin) {
  const auto planck = [&](double nm) { return 1 / (std::pow(nm, 5) * std::expm1(1.438777e7 / (nm * kelvin))); };
  const auto lobe = [](double nm, double peak, double below, double above) {
    const double t = (nm - peak) * (nm < peak ? below : above);
    return std::exp(-0.5 * t * t);
  };
  double sum = 0, all = 0;
  for (double nm = 380; nm <= 780; nm += 1) {
    const double y = 0.821 * lobe(nm, 568.8, 0.0213, 0.0247) + 0.286 * lobe(nm, 530.9, 0.0613, 0.0322);
    sum += y * planck(nm) / planck(2.897772e6 / kelvin), all += y;
  }
  return sum / all;
}

}  // namespace spillway::test
