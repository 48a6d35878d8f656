#!/usr/bin/env bash
# Train from your own logs: checked, learned from on top of the network that ships, and servoed with.
set -euo pipefail
data=$1 out=$2
dnet inspect validate "$data"
dnet train --from-mcap "$data" --out "$out/network" --weights shipped --epochs 2
dnet servo --checkpoint "$out/network" --goal "$data/episode-0-00000.mcap" --steps 2 --world quasistatic --out "$out/servo"
