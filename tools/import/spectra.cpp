#include "tools/import/spectra.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace spillway::tools {
namespace {

struct Xyz {
  double x = 0, y = 0, z = 0;
};

// One lobe of the fit: a gaussian with different widths on its two sides.
double lobe(double wavelength_nm, double center_nm, double width_below_nm, double width_above_nm) {
  const double t = (wavelength_nm - center_nm) / (wavelength_nm < center_nm ? width_below_nm : width_above_nm);
  return std::exp(-0.5 * t * t);
}

// CIE 1931 colour matching: multi-lobe fit of Wyman, Sloan and Shirley 2013, Simple Analytic Approximations to the CIE
// XYZ Color Matching Functions, JCGT 2(2), equation 4. Within 1 % of the tables in colour.
Xyz matching(double wavelength_nm) {
  const double w = wavelength_nm;
  return {1.056 * lobe(w, 599.8, 37.9, 31.0) + 0.362 * lobe(w, 442.0, 16.0, 26.7) - 0.065 * lobe(w, 501.1, 20.4, 26.2),
          0.821 * lobe(w, 568.8, 46.9, 40.5) + 0.286 * lobe(w, 530.9, 16.3, 31.1),
          1.217 * lobe(w, 437.0, 11.8, 36.0) + 0.681 * lobe(w, 459.0, 26.0, 13.8)};
}

// The range of pbrt's colour matching tables.
constexpr int kFirstWavelength_nm = 360, kLastWavelength_nm = 830;

template <class Spectrum>
Xyz integrate(const Spectrum& spectrum) {
  Xyz sum;
  for (int w = kFirstWavelength_nm; w <= kLastWavelength_nm; ++w) {
    const Xyz weight = matching(w);
    const double value = spectrum(w);
    sum.x += value * weight.x, sum.y += value * weight.y, sum.z += value * weight.z;
  }
  return sum;
}

// IEC 61966-2-1, scaled to luminance 1, into the gamut.
Rgb unit_luminance_rgb(const Xyz& c) {
  const double r = 3.2406 * c.x - 1.5372 * c.y - 0.4986 * c.z;
  const double g = -0.9689 * c.x + 1.8758 * c.y + 0.0415 * c.z;
  const double b = 0.0557 * c.x - 0.2040 * c.y + 1.0570 * c.z;
  const Rgb rgb{static_cast<float>(std::max(r / c.y, 0.0)), static_cast<float>(std::max(g / c.y, 0.0)),
                static_cast<float>(std::max(b / c.y, 0.0))};
  return rgb * (1 / luminance(rgb));
}

struct Illuminant {
  std::string_view name;
  double x, y;
};
// Chromaticities for the 2 degree observer: CIE 15:2004, tables T.3 and T.8; SMPTE ST 2065-1.
constexpr std::array kIlluminants = {
    Illuminant{"stdillum-A", 0.44758, 0.40745},    Illuminant{"stdillum-D50", 0.34567, 0.35851},
    Illuminant{"stdillum-F1", 0.3131, 0.3371},     Illuminant{"stdillum-F2", 0.3721, 0.3751},
    Illuminant{"stdillum-F3", 0.4091, 0.3941},     Illuminant{"stdillum-F4", 0.4402, 0.4031},
    Illuminant{"stdillum-F5", 0.3138, 0.3452},     Illuminant{"stdillum-F6", 0.3779, 0.3882},
    Illuminant{"stdillum-F7", 0.3129, 0.3292},     Illuminant{"stdillum-F8", 0.3458, 0.3586},
    Illuminant{"stdillum-F9", 0.3741, 0.3727},     Illuminant{"stdillum-F10", 0.3458, 0.3588},
    Illuminant{"stdillum-F11", 0.3805, 0.3769},    Illuminant{"stdillum-F12", 0.4370, 0.4042},
    Illuminant{"illum-acesD60", 0.32168, 0.33767},
};

struct Metal {
  std::string_view name;
  Rgb eta, k;
};
// RGB, that is: three samples, at kRgbWavelengths_nm, linear between the entries of the tables. Ag, Al, Au, Cu: E. D.
// Palik (ed.) 1985, Handbook of Optical Constants of Solids. CuZn (70/30 brass): M. R. Querry 1985, CRDC-CR-85034.
// MgO: R. E. Stephens and I. H. Malitson 1952, J. Res. NBS 49. TiO2 (rutile, extraordinary ray): J. R. DeVore 1951,
// JOSA 41. The last two do not absorb here.
constexpr std::array kMetals = {
    Metal{"Ag", {0.1342f, 0.1297f, 0.1395f}, {3.9628f, 3.1942f, 2.6135f}},
    Metal{"Al", {1.3571f, 0.8843f, 0.6605f}, {7.5878f, 6.4700f, 5.6536f}},
    Metal{"Au", {0.1837f, 0.4573f, 1.3724f}, {3.0663f, 2.4084f, 1.8250f}},
    Metal{"Cu", {0.2459f, 1.0723f, 1.1569f}, {3.3784f, 2.5907f, 2.4572f}},
    Metal{"CuZn", {0.4450f, 0.5682f, 0.9470f}, {3.5220f, 2.5880f, 1.9200f}},
    Metal{"MgO", {1.7348f, 1.7422f, 1.7502f}, {0, 0, 0}},
    Metal{"TiO2", {2.8750f, 2.9685f, 3.1176f}, {0, 0, 0}},
};

struct Glass {
  std::string_view name;
  float eta;
};
// n_d of the Schott catalogue; pbrt's F5, F10 and F11 are SF5, SF10 and SF11.
constexpr std::array kGlasses = {
    Glass{"glass-BK7", 1.51680f},   Glass{"glass-BAF10", 1.67003f}, Glass{"glass-FK51A", 1.48656f},
    Glass{"glass-LASF9", 1.85025f}, Glass{"glass-F5", 1.67271f},    Glass{"glass-F10", 1.72828f},
    Glass{"glass-F11", 1.78472f},
};

constexpr double kSecondRadiation_nm_kelvin = 1.438776877e7;  // h c / k, CODATA 2018
constexpr double kWien_nm_kelvin = 2.897771955e6;             // displacement, CODATA 2018

}  // namespace

Rgb normalised_blackbody_rgb(float temperature_kelvin) {
  if (!(temperature_kelvin > 100)) return {0, 0, 0};
  const double kelvin = temperature_kelvin, peak_nm = kWien_nm_kelvin / kelvin;
  const auto planck = [&](double w) {
    const double x = w / peak_nm;
    return 1 / (x * x * x * x * x * std::expm1(kSecondRadiation_nm_kelvin / (w * kelvin)));
  };
  const double brightest = planck(peak_nm);
  const Xyz c = integrate([&](int wavelength_nm) { return planck(wavelength_nm) / brightest; });
  if (!(c.y > 0)) return {0, 0, 0};
  return unit_luminance_rgb(c) * static_cast<float>(c.y / integrate([](int) { return 1.0; }).y);
}

Rgb blackbody_rgb(float temperature_kelvin) {
  return unit_luminance_rgb(integrate([&](int wavelength_nm) {
    const double w = wavelength_nm / 560.0;  // the unit falls out of the ratio; near 1 nothing underflows
    const double exponent = kSecondRadiation_nm_kelvin / (wavelength_nm * static_cast<double>(temperature_kelvin));
    const double red_end = kSecondRadiation_nm_kelvin / (kLastWavelength_nm * static_cast<double>(temperature_kelvin));
    // Planck's law over its value's exponential at the red end, so that cold bodies stay above zero.
    return std::exp(red_end - exponent) / (-std::expm1(-exponent)) / (w * w * w * w * w);
  }));
}

float spectrum_at(std::span<const float> pairs, float wavelength_nm) {
  for (size_t i = 0; i + 3 < pairs.size(); i += 2) {
    const double a = pairs[i], b = pairs[i + 2], at_a = pairs[i + 1], at_b = pairs[i + 3];  // floats' differences overflow
    if (wavelength_nm < a || wavelength_nm > b) continue;
    return static_cast<float>(at_a + (at_b - at_a) * ((wavelength_nm - a) / (b - a)));
  }
  return 0;
}

std::optional<Rgb> light_rgb(std::span<const float> pairs) {
  const Xyz xyz = integrate([&](int wavelength_nm) { return spectrum_at(pairs, static_cast<float>(wavelength_nm)); });
  if (!(xyz.y > 0)) return std::nullopt;
  return unit_luminance_rgb(xyz);
}

Rgb reflectance_rgb(std::span<const float> pairs) {
  const Xyz all = integrate([](int) { return 1.0; });
  const Xyz c = integrate([&](int wavelength_nm) { return spectrum_at(pairs, static_cast<float>(wavelength_nm)); });
  // The white point of IEC 61966-2-1, which the matrix takes to (1, 1, 1).
  const double x = c.x / all.x * 0.9505, y = c.y / all.y, z = c.z / all.z * 1.0890;
  const auto clamped = [](double v) { return static_cast<float>(std::clamp(v, 0.0, 1.0)); };
  return {clamped(3.2406 * x - 1.5372 * y - 0.4986 * z), clamped(-0.9689 * x + 1.8758 * y + 0.0415 * z),
          clamped(0.0557 * x - 0.2040 * y + 1.0570 * z)};
}

std::optional<Rgb> illuminant_rgb(std::string_view name) {
  if (name == "stdillum-D65") return Rgb{1, 1, 1};  // the white of the colour space
  for (const Illuminant& known : kIlluminants)
    if (known.name == name) return unit_luminance_rgb({known.x / known.y, 1, (1 - known.x - known.y) / known.y});
  return std::nullopt;
}

std::optional<Rgb> metal_rgb(std::string_view name) {
  constexpr std::string_view kPrefix = "metal-";
  if (!name.starts_with(kPrefix)) return std::nullopt;
  name.remove_prefix(kPrefix.size());
  const size_t dash = name.find('-');
  if (dash == std::string_view::npos) return std::nullopt;
  const std::string_view metal = name.substr(0, dash), quantity = name.substr(dash + 1);
  for (const Metal& known : kMetals) {
    if (known.name != metal) continue;
    if (quantity == "eta") return known.eta;
    if (quantity == "k") return known.k;
  }
  return std::nullopt;
}

std::optional<float> glass_eta(std::string_view name) {
  for (const Glass& known : kGlasses) {
    if (known.name == name) return known.eta;
  }
  return std::nullopt;
}

}  // namespace spillway::tools
