#pragma once

// Identity, Translate, Scale, Rotate, LookAt, Transform, ConcatTransform.

#include "tools/import/tokens.h"
#include "tools/import/transform.h"

namespace spillway::tools {

// What a directive does to a current transform: multiplies from the right, or replaces it.
struct TransformStep {
  Transform factor;
  bool replaces = false;
};

// Reads the directive's numbers. Errors: not affine.
Result<TransformStep> read_transform_step(Tokenizer& tokens, const Token& directive);
// The current transform as the directive leaves it. Errors: no inverse.
Result<Transform> after_step(const TransformStep& step, const Token& directive, const Transform& current);

}  // namespace spillway::tools
