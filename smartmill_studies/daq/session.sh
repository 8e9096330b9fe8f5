#!/usr/bin/env bash
# A complete session of the simulated machine whose dynamometer and hammer take the way of a real instrument: TCP frames, daq_node.
# The report judges it as it judges the direct way. Needs everything built (./setup); about five minutes.
#
# usage: session.sh OUT
set -euo pipefail
cd "$(dirname "$(readlink -f "$0")")/../.."
out=$(readlink -m "${1:?a folder for the results is required}")
mkdir -p "$out"
read -r master focas dynamometer hammer < <(python3 - <<'END'
import socket
sockets = [socket.socket() for _ in range(4)]
for s in sockets:
    s.bind(("127.0.0.1", 0))
print(*(s.getsockname()[1] for s in sockets))
END
)
instrument() { # NAME PORT TOPIC FRAME CHANNELS
  cat >"$out/$1.yaml" <<END
format: smartmill-instrument/1
name: $1
driver: tcp
options: {host: 127.0.0.1, port: $2}
sample_rate: 25600.0
block: 0.01
clock: device
silence: 5.0   # [s] of the simulated clock, on a busy computer
streams:
  - topic: $3
$4    channels:
$5
END
}
channel() { # INPUT NAME UNIT
  echo "      - {input: $1, name: $2, unit: $3, sensitivity: 1.0, range: 1.0e+6}"
}
instrument dynamometer "$dynamometer" daq/dynamometer $'    frame: dynamometer\n' "$(channel 1 fx N; channel 2 fy N; channel 3 fz N)"
instrument hammer "$hammer" daq/hammer "" "$(channel 1 hammer N; channel 2 gap V)"
export ROS_MASTER_URI=http://localhost:$master ROS_HOSTNAME=localhost
devel/env.sh roslaunch -p "$master" smartmill_studies/daq/launch/session_through_daq.launch port:="$focas" bag:="$out/session.bag" \
  summary:="$out/session.json" folder:="$out" dynamometer_port:="$dynamometer" hammer_port:="$hammer" >"$out/session.log" 2>&1 || true
grep -aoE "session \[.*|\[(WARN|ERROR|FATAL)\].*" "$out/session.log" || true
devel/env.sh rosrun smartmill_launch report "$out/session.bag" --session "$out/session.json" -o "$out" --check
