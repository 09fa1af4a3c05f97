#pragma once

// How far a picture is from the one that infinitely many samples would give, told from its two halves alone.
//
// With w the share of half A's samples, the pixel w A + (1 - w) B has the squared error w (1 - w) (A - B)^2 in
// expectation: exactly for equal halves, whose scrambles are independent, whatever the sampler's rate of convergence;
// for unequal ones where it falls as 1 / samples. It is divided by the picture's square + 0.01, as relMSE of `spillway
// compare` is by the reference's, and averaged over pixels and channels. The square is that of the pixel or of its
// neighbours' mean, whichever is less: a pixel that one stray sample lights would else hide its own error.
// Right where the integrand has a fourth moment; where rare samples carry the picture, what was not met is not told.

#include <optional>

#include "pipeline/render/film.h"

namespace spillway::pipeline {

// What keeps the error of black pixels finite: a tenth of a unit of radiance, squared (Rousselle et al. 2011).
inline constexpr double kRelativeErrorEpsilon = 0.01;

struct ErrorEstimate {
  double rel_mse = 0;         // of this picture, in expectation
  double standard_error = 0;  // of the above, from its spread over the pixels

  [[nodiscard]] double relative_error() const;  // root of rel_mse
  // What the picture's own error stays below with 95 %: the picture varies about the expectation as its estimate does.
  [[nodiscard]] double relative_error_bound() const;
};

// Nothing while a half has no samples. Sums are made in a fixed order: the same bits for any number of threads.
[[nodiscard]] std::optional<ErrorEstimate> estimate_error(const Film& film);

}  // namespace spillway::pipeline
