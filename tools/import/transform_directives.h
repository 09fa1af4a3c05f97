#pragma once

// Identity, Translate, Scale, Rotate, LookAt, Transform, ConcatTransform.

#include "tools/import/tokens.h"
#include "tools/import/transform.h"

namespace spillway::tools {

// Reads the directive's numbers; returns the current transform as it leaves it. Errors: not affine, no inverse.
Result<Transform> read_transform(Tokenizer& tokens, const Token& directive, const Transform& current);

}  // namespace spillway::tools
