#!/bin/bash
# The nightly measurement: cities and scenes of the repository in the laboratory, beside Mitsuba 3 where it is there.
# usage: bench/nightly.sh OUT [SCENE...]     leaves OUT/lab/index.html
# LAB_OPTIONS and PEERS_OPTIONS replace the sizes below.
set -eu
root=$(cd "$(dirname "$0")/.." && pwd)
out=$(realpath -m "$1")
shift
spillway=${SPILLWAY:-$root/build/spillway}
mkdir -p "$out"
# By day for the peers (Mitsuba 3 has no lamps in instances), at night, with lamps by the thousand, for the laboratory.
for time in day night; do
  if [ ! -e "$out/$time/city.pbrt" ]; then
    "$spillway" city -o "$out/$time" --buildings "${BUILDINGS:-1000}" --time $time --tessellate
  fi
done
# shellcheck disable=SC2086
python3 "$root/bench/peers.py" -o "$out/peers.csv" --city "$out/day" --spillway "$spillway" ${PEERS_OPTIONS:-}
# shellcheck disable=SC2086
"$spillway" lab "$out/night/city.pbrt" "$root/tests/data/courtyard/courtyard.pbrt" "$root/tests/twins/lamps.pbrt" "$@" \
  -o "$out/lab" --peers "$out/peers.csv" ${LAB_OPTIONS:---spp 1,4,16,64 --seeds 8 --reference-spp 4096 --resolution 480x270}
echo "$out/lab/index.html"
