#!/bin/sh
# From a fresh clone to the animation of an own scene: installs the packages, builds in build/ and
# runs a scene (the first argument, or the toy plane with the wings of a bird).
set -eu
cd "$(dirname "$0")/.."

scripts/install-packages.sh
cmake -S . -B build -G Ninja
cmake --build build --target eigenpose_command

scene=${1:-data/scenes/plane.yaml}
out=out/$(basename "$scene" .yaml)
build/eigenpose run "$scene" --out "$out"
cat <<END

The results are in $out:
  strip.png        the motion as a row of pictures (start here)
  animation.glb    open in Blender or any glTF viewer
  animation.pvd    open in ParaView
  trajectory.csv   reduced coordinates and example weights over time
  summary.txt      sizes, times, quality
END
