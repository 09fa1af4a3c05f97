#!/bin/bash
# The nightly measurement: cities and scenes of the repository in the laboratory, beside Mitsuba 3 where it is there.
# usage: bench/nightly.sh OUT [SCENE...]     leaves OUT/lab/index.html
# LAB_OPTIONS and PEERS_OPTIONS replace the sizes below.
set -eu
if [ $# -lt 1 ]; then
  echo "usage: bench/nightly.sh OUT [SCENE...]" >&2
  exit 2
fi
root=$(cd "$(dirname "$0")/.." && pwd)
out=$(realpath -m "$1")
shift
spillway=${SPILLWAY:-$root/build/spillway}
buildings=${BUILDINGS:-1000}
# By day for the peers, tessellated and with hardly an instance (Mitsuba 3 has no subdivision surfaces, no lamps in instances,
# and compiles each of them); at night, with lamps by the thousand and what is round as cages, for the laboratory.
make_city() {
  local folder=$out/$1_$buildings
  shift
  if [ ! -e "$folder/whole" ]; then
    rm -rf "$folder"
    "$spillway" city -o "$folder" --buildings "$buildings" "$@"
    touch "$folder/whole"
  fi
}
mkdir -p "$out"
make_city day --time day --tessellate --terrain flat --trees 0 --cars 0 --street-lights 0 --texels-per-metre 0
make_city night --time night
# shellcheck disable=SC2086
python3 "$root/bench/peers.py" -o "$out/peers.csv" --city "$out/day_$buildings" --spillway "$spillway" ${PEERS_OPTIONS:-}
code=0
# shellcheck disable=SC2086
"$spillway" lab "$out/night_$buildings/city.pbrt" "$root/tests/data/courtyard/courtyard.pbrt" \
  "$root/tests/twins/lamps.pbrt" "$@" -o "$out/lab" --peers "$out/peers.csv" \
  ${LAB_OPTIONS:---spp 1,4,16,64 --seeds 8 --reference-spp 4096 --resolution 480x270} || code=$?
# 1: pictures differ that must not; the page says which.
if [ $code -le 1 ]; then echo "$out/lab/index.html"; fi
exit $code
