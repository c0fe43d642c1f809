#!/usr/bin/env bash
# Tallow against Mitsuba 3's plain `path` integrator (llvm_ad_rgb): the same Cornell box, 512x512, depth 3, on the same
# cores, in turn. Tallow renders all its layers. Prints Msamples/s of each round and the ratio of the medians.
#   TALLOW_DATA=../shared tools/bench/cornell.sh PEERS [ROUNDS] [SPP]
# PEERS is the folder that $TALLOW_DATA/peers/setup.sh installed into. Start-up is kept out of both: Mitsuba times its
# second render, and Tallow's time is the difference between a render of 2 SPP and one of SPP.
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd -P)
peers=${1:?usage: TALLOW_DATA=FOLDER tools/bench/cornell.sh PEERS [ROUNDS] [SPP]}
rounds=${2:-3}
spp=${3:-64}
: "${TALLOW_DATA:?names the folder of the outside data}"
[[ -x $peers/venv/bin/python ]] || {
    echo "$peers holds no Mitsuba: bash $TALLOW_DATA/peers/setup.sh $peers" >&2
    exit 1
}
# shellcheck disable=SC1091 # made by the peers' set-up
source "$peers/env.sh"

out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
scene=$root/scenes/cornell-box/scene.toml
# Builds where needed, and fills the pipeline cache.
"$root/tools/tallow" render "$scene" -o "$out/tallow.exr" --spp 1 --max-depth 3 >&2

seconds() { # SPP
    local start=$EPOCHREALTIME
    "$root/tools/tallow" render "$scene" -o "$out/tallow.exr" --spp "$1" --max-depth 3 >/dev/null 2>&1
    awk -v a="$start" -v b="$EPOCHREALTIME" 'BEGIN { print b - a }'
}

tallow() {
    local one two
    one=$(seconds "$spp")
    two=$(seconds $((2 * spp)))
    awk -v t1="$one" -v t2="$two" -v n="$spp" 'BEGIN { printf "%.3f\n", 512 * 512 * n / (t2 - t1) / 1e6 }'
}

mitsuba() {
    "$peers/venv/bin/python" "$TALLOW_DATA/peers/mitsuba_cornell.py" "$TALLOW_DATA/references" "$out" \
        --res 512 --depth 3 --spp "$spp" --variants llvm_ad_rgb | awk '/ path / { print $(NF - 1) }'
}

median() { sort -n | awk '{ v[NR] = $1 } END { print (v[int((NR + 1) / 2)] + v[int(NR / 2) + 1]) / 2 }'; }

for ((i = 1; i <= rounds; i++)); do
    tallow >>"$out/tallow.txt"
    mitsuba >>"$out/mitsuba.txt"
    echo "round $i: Tallow $(tail -n 1 "$out/tallow.txt"), Mitsuba $(tail -n 1 "$out/mitsuba.txt") Msamples/s"
done
ours=$(median <"$out/tallow.txt")
theirs=$(median <"$out/mitsuba.txt")
awk -v a="$ours" -v b="$theirs" 'BEGIN { printf "median: Tallow %.2f, Mitsuba %.2f Msamples/s, ratio %.2f\n", a, b, a / b }'
