#!/bin/sh
# smartmill_studies/discrepancy/live_friction.sh OUT [BREAKAWAY_NM] [SPEED_RPM]
# The simulated mill hides spindle friction that increases at low speed (Stribeck). A session runs on it, the monitor stores
# the records that disagree with its model, including the controller's loads, and explain looks for the cause.
# Exit code 0 if it names the friction with both values within three standard deviations.
set -eu
out=$(realpath -m "${1:?OUT: folder for all results}")
breakaway=${2:-0.4}
speed=${3:-2500}
models=$(rospack find smartmill_launch)/models
mkdir -p "$out"
rm -rf "$out/kept"
sed "\$a effects: [{name: stribeck_friction, breakaway_nm: $breakaway, speed_rpm: $speed}]" \
  "$models/mill_twin.yaml" > "$out/hidden.yaml"
# Air cuts at 600, 1200, 2400, 4000, 6000, 9000 rpm; unneeded steps are off.
sed -e 's/^air_speeds:.*/air_speeds: [62.83, 125.66, 251.33, 418.88, 628.32, 942.48]/' \
    -e 's/^verify:.*/verify: false/' -e 's/^resonance_speed:.*/resonance_speed: 0.0/' \
    -e 's/^hits:.*/hits: 3/' -e 's/^sensor_hits:.*/sensor_hits: 3/' \
  "$(rospack find smartmill_launch)/config/session.yaml" > "$out/session.yaml"
roslaunch --port "${ROS_PORT:-11311}" smartmill_launch pipeline.launch database:=none port:="${FOCAS_PORT:-8193}" session:=true \
  session_params:="$out/session.yaml" model:="$out/hidden.yaml" monitor:=true record_folder:="$out/kept" \
  summary:="$out/summary.json" > "$out/session.log" 2>&1
rosrun smartmill_discrepancy explain "$out/kept" -o "$out/report"
python3 - "$out/report/report.json" "$breakaway" "$speed" <<'PYTHON'
import json, sys
report = json.load(open(sys.argv[1]))
truth = {"breakaway_nm": float(sys.argv[2]), "speed_rpm": float(sys.argv[3])}
named = [e for e in report["effects"] if e["name"] == "stribeck_friction"]
right = bool(named) and len(report["effects"]) == 1
for key, value in truth.items() if named else []:
    found = named[0]["parameters"][key]
    off = abs(found["value"] - value) / found["std"]
    right = right and off < 3.0
    print("%s %.5g +- %.2g, hidden %.5g: %.1f deviations" % (key, found["value"], found["std"], value, off))
print("friction named as hidden" if right else "MISSED: " + (", ".join(e["name"] for e in report["effects"]) or report["verdict"]))
sys.exit(0 if right else 1)
PYTHON
