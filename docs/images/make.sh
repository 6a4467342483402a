#!/usr/bin/env bash
# Makes the pictures of docs/maps.md and docs/report.md again: docs/images/make.sh WORK
# WORK is a folder for what they are made of. Needs the extra rerun, Chromium and Xvfb.
set -euo pipefail
images=$(cd "$(dirname "$0")" && pwd)
mkdir -p "$1" && cd "$1"
[ -d room ] || semslam run synthetic:room --out room
semslam map room --mesh --semantic
semslam report room
semslam view room --save room.rrd
semslam plot room --format png --out plots
xvfb-run -a -s "-screen 0 1600x1000x24" rerun --window-size 1600x1000 --screenshot-to viewer.png room.rrd
chromium --headless --no-sandbox --hide-scrollbars --virtual-time-budget=10000 --window-size=1400,1520 \
  --screenshot=report.png room/report.html
python "$images/finish.py" . "$images"
