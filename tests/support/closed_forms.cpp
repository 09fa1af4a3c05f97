#include "tests/support/closed_forms.h"

#include <fmt/format.h>

namespace spillway::test {

double integral(double from, double to, int cells, const std::function<double(double)>& f) {
  static constexpr double kPlace[5] = {-0.906179845938664, -0.538469310105683, 0, 0.538469310105683, 0.906179845938664};
  static constexpr double kWeight[5] = {0.236926885056189, 0.478628670499366, 0.568888888888889, 0.478628670499366,
                                        0.236926885056189};
  const double half = (to - from) / (2 * cells);
  double sum = 0;
  for (int c = 0; c < cells; ++c)
    for (int i = 0; i < 5; ++i) sum += kWeight[i] * f(from + half * (2 * c + 1 + kPlace[i]));
  return sum * half;
}

double mean_over_square(double half, int cells, const std::function<double(double, double)>& f) {
  const auto row = [&](double y) { return integral(-half, half, cells, [&](double x) { return f(x, y); }); };
  return integral(-half, half, cells, row) / (4 * half * half);
}

double reflectance(double cosine, std::complex<double> index) {
  const std::complex<double> n2 = index * index, inside = std::sqrt(n2 - (1 - cosine * cosine));
  const std::complex<double> s = (cosine - inside) / (cosine + inside),
                             p = (n2 * cosine - inside) / (n2 * cosine + inside);
  return (std::norm(s) + std::norm(p)) / 2;
}

double metal(Vec i, Vec o, double alpha, std::complex<double> index) {
  const Vec m = unit(i + o);
  const double tan2 = (1 - m.z * m.z) / (m.z * m.z), a2 = alpha * alpha;
  const double d = a2 / (M_PI * std::pow(m.z, 4) * std::pow(a2 + tan2, 2));
  const auto lambda = [&](Vec w) { return (std::sqrt(1 + a2 * (1 - w.z * w.z) / (w.z * w.z)) - 1) / 2; };
  return reflectance(dot(i, m), index) * d / ((1 + lambda(i) + lambda(o)) * 4 * i.z * o.z);
}

std::string metal_words(double alpha) {
  return fmt::format(
      "Material \"conductor\" \"rgb eta\" [{0} {0} {0}] \"rgb k\" [{1} {1} {1}] \"float roughness\" {2} "
      "\"bool remaproughness\" false\n",
      kMetalIndex.real(), kMetalIndex.imag(), alpha);
}

}  // namespace spillway::test
