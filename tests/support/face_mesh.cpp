#include "tests/support/face_mesh.h"

#include "cache/facetex_texel.h"

namespace spillway::test {

FaceGrid::FaceGrid(uint32_t columns, uint32_t rows, Turn turn)
    : columns_(columns), rows_(rows), turn_(std::move(turn)) {}

std::vector<cache::FaceInfo> FaceGrid::faces(const std::function<std::pair<uint8_t, uint8_t>(uint32_t)>& logs) const {
  std::vector<cache::FaceInfo> faces(face_count());
  for (uint32_t f = 0; f < face_count(); ++f) {
    std::tie(faces[f].ulog2, faces[f].vlog2) = logs(f);
    const int x = static_cast<int>(f % columns_), y = static_cast<int>(f / columns_);
    for (uint32_t side = 0; side < 4; ++side) {  // of the square: below, right, above, left
      const int nx = x + (side == 1) - (side == 3), ny = y + (side == 2) - (side == 0);
      if (nx < 0 || ny < 0 || nx >= static_cast<int>(columns_) || ny >= static_cast<int>(rows_)) continue;
      const auto other = static_cast<uint32_t>(ny) * columns_ + static_cast<uint32_t>(nx);
      const uint32_t edge = (side + 4 - turn_(f) % 4) % 4, other_edge = ((side + 2) % 4 + 4 - turn_(other) % 4) % 4;
      faces[f].adjacent_faces[edge] = other;
      faces[f].adjacent_edges = static_cast<uint8_t>(faces[f].adjacent_edges | other_edge << (2 * edge));
    }
  }
  return faces;
}

FaceGrid::Place FaceGrid::place(uint32_t face, double u, double v) const {
  double x = u - 0.5, y = v - 0.5;
  for (uint32_t q = 0; q < turn_(face) % 4; ++q) std::tie(x, y) = std::pair(-y, x);
  return {x + 0.5 + face % columns_, y + 0.5 + face / columns_};
}

std::vector<std::byte> painted_face(const cache::FaceTexFormat& format, const cache::FaceInfo& face,
                                    cache::FaceShape shape,
                                    const std::function<double(double, double, uint32_t)>& value) {
  const cache::FaceTexDecoder decoder(format);
  const bool is_constant = (face.flags & cache::kFaceIsConstant) != 0;
  const uint32_t width = is_constant ? 1 : 1u << face.ulog2, height = is_constant ? 1 : 1u << face.vlog2;
  std::vector<std::byte> texels(size_t{width} * height * format.texel_bytes());
  for (uint32_t j = 0; j < height; ++j)
    for (uint32_t i = 0; i < width; ++i) {
      double u = (i + 0.5) / width, v = (j + 0.5) / height;
      if (shape == cache::FaceShape::triangle) {
        const bool upper = i + j >= width;
        u = upper ? (width - j - 1.0 / 3) / width : (i + 1.0 / 3) / width;
        v = upper ? (width - i - 1.0 / 3) / width : (j + 1.0 / 3) / width;
      }
      for (uint32_t c = 0; c < format.channels; ++c)
        decoder.put(static_cast<float>(value(u, v, c)), texels.data() + (size_t{j} * width + i) * format.texel_bytes(),
                    c);
    }
  return texels;
}

}  // namespace spillway::test
