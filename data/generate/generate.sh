#!/bin/sh
# Makes the meshes of data/meshes again from their descriptions here.
#
#   generate.sh [--poses] [GROUP...]    groups: bar cylinder cuboid plane bird car teddy cross
#                                       column dog shoe fish; all of them where none is named
#
# --poses leaves the stored meshes alone and makes the poses that share their connectivity.
# Needs gmsh and a C compiler. The stored meshes came from gmsh 4.8.4; its HXT mesher places inner
# vertices anew in every run, so a new set has the same shapes and quality but other vertices:
# replace a whole group together.
set -eu
export OMP_NUM_THREADS=1
here=$(cd "$(dirname "$0")" && pwd)
meshes=$here/../meshes
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

${CC:-cc} -std=c17 -O2 -Wall -Wextra -o "$work/pose" "$here/pose.c" -lm

# tetrahedralise NAME OUTPUT [gmsh options]: a Gmsh 2.2 file, which pose reads
tetrahedralise() {
  name=$1 output=$2
  shift 2
  gmsh -3 -v 1 -nt 1 -format msh22 "$@" "$here/$name.geo" -o "$output" || {
    echo "generate.sh: gmsh could not mesh $name.geo" >&2
    exit 1
  }
}
# pose IN OUT.veg [DEFORMATION NUMBERS...], in the folder of the meshes
pose() { (cd "$meshes" && "$work/pose" "$@"); }
# object NAME [gmsh options]: a mesh to animate, and the look at its quality
object() {
  object=$1
  shift
  tetrahedralise "$object" "$meshes/$object.msh" "$@"
  pose "$object.msh" "$work/check.veg"
}
# another NAME SIZE OUT.veg [DEFORMATION...]: an example on a mesh of its own
another() {
  name=$1 size=$2
  shift 2
  tetrahedralise "$name" "$work/another.msh" -setnumber size "$size" ${options:-}
  pose "$work/another.msh" "$@"
}

# shellcheck disable=SC2086 # the deformations are lists of words
s65="s -0.5,0,0 1,0,0 0,1,0 1 65"
twist150="twist 0,0,0 1,0,0 1 150"
car_arc="arc 0,0,0 1,0,0 0,1,0 0.6 32 arc 0,0,0 -1,0,0 0,1,0 0.6 32"
car_s="s -0.6,0,0 1,0,0 0,1,0 1.2 45"
car_twist="twist 0,0,0 1,0,0 1.2 80"
teddy_left_arm="within 0.49,0.12,0 0.32 joint 0.285,0.16,0.02 1,-0.05,0 0,1,0 0.18 60"
teddy_right_arm="within -0.49,0.12,0 0.32 joint -0.285,0.16,0.02 -1,-0.05,0 0,1,0 0.18 60"
teddy_left_leg="within 0.33,-0.50,0.05 0.38 joint 0.14,-0.22,0 0.32,-0.95,0 0.95,0.32,0 0.22 40"
teddy_right_leg="within -0.33,-0.50,0.05 0.38 joint -0.14,-0.22,0 -0.32,-0.95,0 -0.95,0.32,0 0.22 40"
teddy_jump="$teddy_left_arm $teddy_right_arm $teddy_left_leg $teddy_right_leg"

mesh_bar() {
  tetrahedralise bar "$work/bar.msh"
  gmsh -v 1 -format msh41 "$work/bar.msh" -save -o "$meshes/bar.msh" # the one 4.1 file
}
poses_bar() {
  gmsh -v 1 -format msh22 "$meshes/bar.msh" -save -o "$work/bar.msh"
  pose "$work/bar.msh" bar-s.veg $s65
  pose "$work/bar.msh" bar-twist.veg $twist150
  pose "$work/bar.msh" bar-left.veg turn -0.06,0,0 -1,0,0 0.44 -70
  pose "$work/bar.msh" bar-right.veg joint 0.06,0,0 1,0,0 0,1,0 0.22 45
}

mesh_cylinder() {
  another cylinder 0.058 cylinder.veg
  another cylinder 0.066 cylinder-s.veg $s65
}
poses_cylinder() {
  pose cylinder.veg cylinder-twist.veg $twist150
  pose cylinder.veg cylinder-arc.veg arc 0,0,0 1,0,0 0,1,0 0.5 50 arc 0,0,0 -1,0,0 0,1,0 0.5 50
  pose cylinder.veg cylinder-s-own.veg $s65
  pose cylinder.veg cylinder-hook.veg joint 0.02,0,0 1,0,0 0,1,0 0.4 65
}

mesh_cuboid() {
  another cuboid 0.07 cuboid.veg
  another cuboid 0.08 cuboid-s.veg $s65
}
poses_cuboid() { :; }

mesh_plane() { object plane; }
poses_plane() {
  pose plane.msh plane-left.veg within 0.1,0,0.65 0.58 joint 0,0,0.12 0,0,1 0,1,0 0.5 45
  pose plane.msh plane-right.veg within 0.1,0,-0.65 0.58 joint 0,0,-0.12 0,0,-1 0,1,0 0.5 45
  pose plane.msh plane-tail.veg joint -0.25,0,0 -1,0,0 0,1,0 0.3 40
  pose plane.msh plane-nose.veg joint 0.32,0,0 1,0,0 0,1,0 0.4 40
}

mesh_bird() {
  another bird 0.066 bird.veg
  another bird 0.074 bird-raised-own.veg \
    joint 0,0,0.12 0,0,1 0,1,0 0.5 45 joint 0,0,-0.12 0,0,-1 0,1,0 0.5 45
}
poses_bird() {
  pose bird.veg bird-raised.veg \
    joint 0,0,0.12 0,0,1 0,1,0 0.5 45 joint 0,0,-0.12 0,0,-1 0,1,0 0.5 45
}

mesh_car() {
  object car
  options="-setnumber estate 1"
  another car 0.07 estate.veg
  another car 0.08 estate-s.veg $car_s
  options=
}
poses_car() {
  pose estate.veg estate-arc.veg $car_arc
  pose estate.veg estate-twist.veg $car_twist
  pose car.msh car-arc.veg arc 0,0,0 1,0,0 0,-1,0 0.6 32 arc 0,0,0 -1,0,0 0,-1,0 0.6 32
  pose car.msh car-s.veg $car_s
  pose car.msh car-twist.veg $car_twist
}

mesh_teddy() {
  object teddy
  options="-setnumber slim 1"
  another teddy 0.072 slim.veg
  another teddy 0.08 slim-jump.veg $teddy_jump
  options=
}
poses_teddy() {
  pose slim.veg slim-wave.veg $teddy_left_arm $teddy_left_leg
  pose teddy.msh teddy-jump.veg $teddy_jump
}

mesh_cross() {
  object cross
  options="-setnumber round 1"
  another cross 0.06 round.veg
  another cross 0.068 round-side.veg s 0.13,0.02,0 1,0,0 0,0,1 0.48 60
  options=
}
poses_cross() {
  pose round.veg round-twist.veg turn -0.13,0.02,0 -1,0,0 0.44 80
  pose round.veg round-upright.veg \
    s 0,0.14,0 0,1,0 1,0,0 0.48 60 s 0,-0.10,0 0,-1,0 -1,0,0 0.52 60
}

mesh_column() { object column; }
poses_column() {
  pose column.msh column-screw.veg stretch 0,0.5,0 0,-1,0 1.25 twist 0,0,0 0,1,0 1.25 120
}

mesh_dog() { object dog; }
poses_dog() {
  pose dog.msh dog-howl.veg \
    within 0.58,0.32,0 0.44 joint 0.33,0.05,0 0.66,0.75,0 -0.75,0.66,0 0.28 45
  pose dog.msh dog-wag.veg \
    within -0.60,0.25,0 0.36 joint -0.38,0.07,0 -0.77,0.64,0 0.64,0.77,0 0.3 65
}

mesh_shoe() { object shoe; }
poses_shoe() {
  pose shoe.msh shoe-toe.veg joint 0.08,-0.1,0 1,0,0 0,1,0 0.35 50
  pose shoe.msh shoe-shaft.veg \
joint -0.26,0.125,0 0,1,0 -1,0,0 0.22 35
}

mesh_fish() {
  another fish 0.062 fish.veg
  another fish 0.066 fish-swim-own.veg s 0.3,0,0 -1,0,0 0,0,1 1.2 40
}
poses_fish() { pose fish.veg fish-swim.veg s 0.3,0,0 -1,0,0 0,0,1 1.2 40; }

only_poses=
if [ "${1:-}" = --poses ]; then
  only_poses=1
  shift
fi
[ $# -gt 0 ] || set -- bar cylinder cuboid plane bird car teddy cross column dog shoe fish
for group in "$@"; do
  case $group in
  bar | cylinder | cuboid | plane | bird | car | teddy | cross | column | dog | shoe | fish) ;;
  *) echo "generate.sh: there is no group $group" >&2 && exit 1 ;;
  esac
  [ "$only_poses" ] || "mesh_$group"
  "poses_$group"
done
