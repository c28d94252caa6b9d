#!/bin/sh
# Makes every mesh of data/meshes again from its description here. Needs gmsh and a C compiler.
# The stored meshes came from gmsh 4.8.4; its HXT mesher places inner vertices anew in every run, so
# a new set has the same shapes and quality but other vertices: replace all of them together.
set -eu
export OMP_NUM_THREADS=1
here=$(cd "$(dirname "$0")" && pwd)
meshes=$here/../meshes
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

${CC:-cc} -std=c17 -O2 -Wall -Wextra -o "$work/pose" "$here/pose.c" -lm

# tetrahedralise NAME FORMAT OUTPUT [gmsh options]
tetrahedralise() {
  name=$1 format=$2 output=$3
  shift 3
  gmsh -3 -v 1 -nt 1 -format "$format" "$@" "$here/$name.geo" -o "$output" || {
    echo "generate.sh: gmsh could not mesh $name.geo" >&2
    exit 1
  }
}
pose() { (cd "$meshes" && "$work/pose" "$@"); }

tetrahedralise bar msh41 "$meshes/bar.msh"
gmsh -v 1 -format msh22 "$meshes/bar.msh" -save -o "$work/bar.msh" # the same mesh, read by pose
tetrahedralise cylinder msh22 "$work/cylinder.msh"
tetrahedralise cylinder msh22 "$work/coarse.msh" -setnumber size 0.066
tetrahedralise plane msh22 "$work/plane.msh"
tetrahedralise bird msh22 "$work/bird.msh"
tetrahedralise bird msh22 "$work/bird-coarse.msh" -setnumber size 0.074

# the plane stays a Gmsh 2.2 file, the bar a 4.1
cp "$work/plane.msh" "$meshes/plane.msh"
pose none 0 "$work/plane.msh" "$work/check.veg"

pose s-bend 65 "$work/bar.msh" bar-s.veg
pose twist-left 70 "$work/bar.msh" bar-left.veg
pose bend-right 45 "$work/bar.msh" bar-right.veg
pose none 0 "$work/cylinder.msh" cylinder.veg
pose twist 150 "$work/cylinder.msh" cylinder-twist.veg
pose s-bend 65 "$work/coarse.msh" cylinder-s.veg
pose none 0 "$work/bird.msh" bird.veg
pose raise 45 "$work/bird.msh" bird-raised.veg
pose raise 45 "$work/bird-coarse.msh" bird-raised-own.veg
