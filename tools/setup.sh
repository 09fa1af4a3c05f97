#!/bin/sh
# Installs what Spillway builds with, where it is missing: Debian 12 or 13, as root or through sudo.
# usage: tools/setup.sh [MORE PACKAGES]
# Nothing is downloaded when everything is there.
set -eu

packages="cmake ninja-build g++ ccache python3
  libembree-dev libopenimageio-dev openimageio-tools libopenexr-dev libosd-dev libopenvdb-dev libnanovdb-dev
  libtbb-dev libboost-dev libcli11-dev nlohmann-json3-dev libfmt-dev libxxhash-dev zlib1g-dev liblz4-dev libzstd-dev
  libgtest-dev libgmock-dev libbenchmark-dev $*"

missing=""
for package in $packages; do
  dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null | grep -qx installed || missing="$missing $package"
done
[ -z "$missing" ] && exit 0

echo "installing:$missing"
as_root=""
if [ "$(id -u)" -ne 0 ]; then
  command -v sudo >/dev/null || { echo "setup.sh: these packages are missing, and installing them needs root:$missing" >&2; exit 1; }
  as_root="sudo"
fi
export DEBIAN_FRONTEND=noninteractive
$as_root apt-get update -qq
# shellcheck disable=SC2086  # a list
$as_root apt-get install -y -qq --no-install-recommends $missing >/dev/null
