#!/bin/sh
# From a fresh clone to one page with the figures of both papers: installs the packages, builds in
# build/, bakes and runs every scene of data/scenes/zhao2018 and data/scenes/zhang2015 and leaves
# out/reproduce/index.html (or the folder given as first argument). A scene that fails is named, the
# others go on, and the script then ends with 1.
set -eu
cd "$(dirname "$0")/.."

scripts/install-packages.sh
cmake -S . -B build -G Ninja
cmake --build build --target eigenpose_command

out=${1:-out/reproduce}
mkdir -p "$out"
# Two runs at a time would disturb each other's times: one after the other, each on its own.
set -- data/scenes/zhao2018/*.yaml data/scenes/zhang2015/*.yaml
count=0
failed=
for scene in "$@"; do
  name=$(basename "$(dirname "$scene")")/$(basename "$scene" .yaml)
  folder=$out/$name
  count=$((count + 1))
  rm -rf "$folder"
  mkdir -p "$folder"
  printf '[%d/%d] %s ... ' "$count" "$#" "$name"
  started=$(date +%s)
  if build/eigenpose plan "$scene" --json >"$folder/plan.json" 2>"$folder/run.log" &&
    build/eigenpose run "$scene" --out "$folder" --quiet >"$folder/summary.log" 2>"$folder/run.log"; then
    case $name in
    zhao2018/fig3-*) # this figure shows the full space too
      build/eigenpose compare "$scene" --out "$folder/full" --quiet --set 'compare.modes=[30]' \
        --set 'compare.elements=[60]' --set 'compare.methods=[cubature, full]' \
        >"$folder/compare.log" 2>"$folder/run.log" || failed="$failed $name(full)"
      ;;
    esac
    echo "$(($(date +%s) - started)) s"
  else
    failed="$failed $name"
    echo "FAILED: $(tail -n 1 "$folder/run.log")"
  fi
done

build/eigenpose report data/figures.json --out "$out"
if [ "$failed" ]; then
  echo "reproduce.sh: failed:$failed" >&2
  exit 1
fi
