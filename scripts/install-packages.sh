#!/bin/sh
# Install the Debian packages the build, the tests and the data need. Safe to run again: apt is
# called only for what is missing, and without rights to install it says what to ask for.
set -eu

packages="
  build-essential cmake ninja-build pkg-config
  petsc-dev slepc-dev libopenmpi-dev libnlopt-dev libopenblas-dev liblapacke-dev
  libjansson-dev libcyaml-dev libxxhash-dev libpng-dev zlib1g-dev
  libcmocka-dev clang clang-format gmsh
"

installed() {
  dpkg-query -W -f '${db:Status-Status}' "$1" 2>/dev/null | grep -qx installed
}

missing=
for package in $packages; do
  installed "$package" || missing="$missing $package"
done
if [ -z "$missing" ]; then
  echo "install-packages.sh: everything needed is installed"
  exit 0
fi

if [ "$(id -u)" -eq 0 ]; then
  as_root=
elif command -v sudo >/dev/null 2>&1; then
  as_root=sudo
else
  echo "install-packages.sh: not root and no sudo; as root run:" >&2
  echo "  apt-get install --no-install-recommends$missing" >&2
  exit 1
fi

echo "install-packages.sh: installing$missing"
$as_root apt-get update
# shellcheck disable=SC2086 # lists of words
$as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends $missing
