#!/bin/bash
# From nothing to a picture: installs what is missing, builds the program, renders the courtyard of this repository under
# a small memory limit. usage: tools/demo.sh [OUTPUT_DIRECTORY]
set -eu
cd "$(dirname "$0")/.."
out="${1:-build/demo}"

tools/setup.sh
echo "building ..."
cmake --preset release >/dev/null
cmake --build --preset release --target spillway -- --quiet

mkdir -p "$out"
build/spillway render tests/data/courtyard/courtyard.pbrt --store "$out/courtyard.store" -o "$out/courtyard.exr" \
  --memory 256MiB --report "$out/report.json"
oiiotool "$out/courtyard.exr" --ch R,G,B --tocolorspace sRGB -d uint8 -o "$out/courtyard.png"

echo
echo "the picture:  $out/courtyard.exr, to look at: $out/courtyard.png"
echo "the report:   $out/report.json"
echo "the store:    $out/courtyard.store"
