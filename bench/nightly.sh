#!/bin/bash
# The nightly measurement: a city and scenes of the repository in the laboratory, beside Mitsuba 3 where it is installed.
# usage: bench/nightly.sh OUT [SCENE...]     leaves OUT/lab/index.html
# LAB_OPTIONS and PEERS_OPTIONS replace the sizes below.
set -eu
root=$(cd "$(dirname "$0")/.." && pwd)
out=$(realpath -m "$1")
shift
spillway=${SPILLWAY:-$root/build/spillway}
mkdir -p "$out"
if [ ! -e "$out/city/city.pbrt" ]; then
  "$spillway" city -o "$out/city" --buildings "${BUILDINGS:-1000}" --time night --tessellate
fi
# shellcheck disable=SC2086
python3 "$root/bench/peers.py" -o "$out/peers.csv" --city "$out/city" --spillway "$spillway" ${PEERS_OPTIONS:-}
# shellcheck disable=SC2086
"$spillway" lab "$out/city/city.pbrt" "$root/tests/data/courtyard/courtyard.pbrt" "$root/tests/twins/lamps.pbrt" "$@" -o "$out/lab" \
  --peers "$out/peers.csv" ${LAB_OPTIONS:---spp 1,4,16,64 --seeds 8 --reference-spp 4096 --resolution 480x270}
echo "$out/lab/index.html"
