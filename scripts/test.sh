#!/bin/sh
# Install the packages, build everything with warnings as errors, run all tests.
# BUILD_DIR (default build-test) and further arguments for cmake may be given.
set -eu
cd "$(dirname "$0")/.."

build=${BUILD_DIR:-build-test}
scripts/install-packages.sh
cmake -S . -B "$build" -G Ninja -DEP_WERROR=ON "$@"
cmake --build "$build"
ctest --test-dir "$build" --output-on-failure -j "$(nproc)"
