#pragma once

// Writes .ptx files of every kind that the format allows, right ones and, by changing what comes out, wrong ones.

#include <cstdint>
#include <vector>

#include "pipeline/pack/ptx_file.h"

namespace spillway::pipeline {

enum class PtxEncoding : uint32_t { constant, deflated, differences, tiled };

struct PtxFace {
  cache::FaceInfo info;           // the size is of the texels given
  std::vector<std::byte> texels;  // channels side by side; one texel when constant
  std::vector<std::byte> mean;    // one texel; zeros when empty
  PtxEncoding encoding = PtxEncoding::deflated;
  uint32_t tile_ulog2 = 0, tile_vlog2 = 0;  // of a tiled face
  PtxEncoding tile_encoding = PtxEncoding::deflated;
};

struct PtxEdit {
  uint32_t face;
  PtxFace texels;
};

struct PtxDescription {
  PtxInfo info;
  std::vector<PtxFace> faces;
  std::vector<std::vector<PtxFace>> reductions;  // levels from 1 on, in the order of the file
  std::vector<PtxEdit> edits;
  uint32_t metadata_bytes = 0;
  bool says_where_edits_are = true;  // as files of version 1.4 do
};

std::vector<std::byte> ptx_bytes(const PtxDescription& description);

}  // namespace spillway::pipeline
