#include "tools/import/transform_directives.h"

#include <optional>
#include <vector>

#include "tools/import/params.h"

namespace spillway::tools {
namespace {

Result<Vec3> read_vector(Tokenizer& tokens, const Token& directive) {
  SPILLWAY_ASSIGN(const std::vector<double> v, read_numbers(tokens, 3, false, directive.text));
  return Vec3{v[0], v[1], v[2]};
}

Result<Transform> read_rotation(Tokenizer& tokens, const Token& directive) {
  SPILLWAY_ASSIGN(const std::vector<double> v, read_numbers(tokens, 4, false, directive.text));
  if (const std::optional<Transform> turn = rotation(v[0], {v[1], v[2], v[3]})) return *turn;
  return error_at(directive.place, "Rotate about an axis of length zero");
}

Result<Transform> read_view(Tokenizer& tokens, const Token& directive) {
  SPILLWAY_ASSIGN(const std::vector<double> v, read_numbers(tokens, 9, false, directive.text));
  const std::optional<Transform> view = look_at({v[0], v[1], v[2]}, {v[3], v[4], v[5]}, {v[6], v[7], v[8]});
  if (view) return *view;
  return error_at(directive.place, "LookAt: the eye is the target, or the view is along the up vector");
}

Result<Transform> read_matrix(Tokenizer& tokens, const Token& directive) {
  SPILLWAY_ASSIGN(const std::vector<double> columns, read_numbers(tokens, 16, true, directive.text));
  if (const std::optional<Transform> matrix = from_columns(columns)) return *matrix;
  return error_at(directive.place, "{} is not affine: every fourth number must be 0, the last one not", directive.text);
}

// What the directive multiplies onto the current transform from the right.
Result<Transform> read_factor(Tokenizer& tokens, const Token& directive) {
  if (directive.text == "Rotate") return read_rotation(tokens, directive);
  if (directive.text == "LookAt") return read_view(tokens, directive);
  if (directive.text == "Transform" || directive.text == "ConcatTransform") return read_matrix(tokens, directive);
  SPILLWAY_ASSIGN(const Vec3 v, read_vector(tokens, directive));
  return directive.text == "Scale" ? scaling(v) : translation(v);
}

}  // namespace

Result<TransformStep> read_transform_step(Tokenizer& tokens, const Token& directive) {
  if (directive.text == "Identity") return TransformStep{{}, true};
  SPILLWAY_ASSIGN(const Transform factor, read_factor(tokens, directive));
  return TransformStep{factor, directive.text == "Transform"};
}

Result<Transform> after_step(const TransformStep& step, const Token& directive, const Transform& current) {
  const Transform product = step.replaces ? step.factor : current * step.factor;
  if (product.is_invertible()) return product;
  return error_at(directive.place, "{} makes the transform singular or infinite: it has no inverse", directive.text);
}

}  // namespace spillway::tools
