#!/bin/bash
# From nothing to a picture: installs what is missing, builds the program, generates a small city and renders it by dusk
# under a small memory limit. usage: tools/demo.sh [OUTPUT_DIRECTORY]
set -eu
cd "$(dirname "$0")/.."
out="${1:-build/demo}"

tools/setup.sh
echo "building ..."
cmake --preset release >/dev/null
cmake --build --preset release --target spillway -- --quiet

mkdir -p "$out"
build/spillway city -o "$out/city" --buildings 2000 --time dusk --format store --memory 512MiB
build/spillway render "$out/city/city.store" -o "$out/city.exr" --resolution 960x540 --spp 32 --memory 512MiB \
  --report "$out/report.json"
oiiotool "$out/city.exr" --ch R,G,B --tocolorspace sRGB -d uint8 -o "$out/city.png"

echo
echo "the picture:  $out/city.exr, to look at: $out/city.png"
echo "the report:   $out/report.json"
echo "the city:     $out/city, its manifest.json and city.store"
