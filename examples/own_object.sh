#!/usr/bin/env bash
# A softer, rounder object: recorded, learned from, and judged on what was held out.
set -euo pipefail
out=$1
dnet record "$out/data" --object hemi_ellipsoid --young 5000 --vary --world quasistatic --pairs 4 --shapes 6
dnet inspect stats "$out/data"
dnet train --from-mcap "$out/data" --out "$out/run" --weights shipped --epochs 4
dnet evaluate network --checkpoint "$out/run" --from-mcap "$out/data" --validation 0.15
