#!/usr/bin/env bash
# A complete session of the simulated machine in wall-clock time whose dynamometer and hammer take the way of one real instrument of five
# channels: by a named pipe (driver file) or by a null sink of a sound server of its own and its monitor (driver sound). Neither stamps nor
# counts samples: daq_node counts them against the arrivals, and the latency of the way is found by `smartmill align` before the session. The
# report judges it as it judges the direct way. Needs everything built (./setup --with-instruments); about six minutes.
#
# usage: session_wall_clock.sh pipe|sound OUT
set -euo pipefail
cd "$(dirname "$(readlink -f "$0")")/../.."
way=${1:?pipe or sound is required}
out=$(readlink -m "${2:?a folder for the results is required}")
mkdir -p "$out"
case $way in pipe | sound) ;; *) echo "session_wall_clock.sh: $way, expected pipe or sound" >&2; exit 2 ;; esac
read -r master focas < <(python3 - <<'END'
import socket
sockets = [socket.socket() for _ in range(2)]
for s in sockets:
    s.bind(("127.0.0.1", 0))
print(*(s.getsockname()[1] for s in sockets))
END
)
FULL_SCALE=1.0e+6   # [unit] of float32 samples, whose relative resolution does not depend on it
RATE=25600
started=()
stop() {
  for pid in "${started[@]}"; do kill -INT "$pid" 2>/dev/null || true; done
  wait || true
}
trap stop EXIT

options="{path: front_end.pipe}" driver=file
if [ "$way" = sound ]; then
  driver=sound options="{source: front_end.monitor, channels: 5, server: 'unix:$out/native'}"
fi
channel() { # INPUT NAME UNIT
  echo "      - {input: $1, name: $2, unit: $3, sensitivity: 1.0, range: $FULL_SCALE}"
}
cat >"$out/front_end.yaml" <<END
format: smartmill-instrument/1
name: front_end
driver: $driver
options: $options
sample_rate: $RATE.0
block: 0.01
silence: 5.0   # [s] on a busy computer
streams:
  - topic: daq/dynamometer
    frame: dynamometer
    channels:
$(channel 1 fx N; channel 2 fy N; channel 3 fz N)
  - topic: daq/hammer
    channels:
$(channel 4 hammer N; channel 5 gap V)
END
rm -f "$out/front_end.pipe"
mkfifo "$out/front_end.pipe"

full_scale=0.0
if [ "$way" = sound ]; then
  full_scale=$FULL_SCALE
  export HOME=$out XDG_RUNTIME_DIR=$out PULSE_RUNTIME_PATH=$out
  sink="rate=$RATE format=float32le"
  pulseaudio -n --daemonize=no --exit-idle-time=-1 --use-pid-file=no --disable-shm=yes \
    -L "module-null-sink sink_name=front_end channels=5 channel_map=aux0,aux1,aux2,aux3,aux4 $sink" \
    -L "module-native-protocol-unix socket=$out/native auth-anonymous=1" >"$out/pulseaudio.log" 2>&1 &
  started+=($!)
  for _ in $(seq 100); do [ ! -S "$out/native" ] || break; sleep 0.1; done
  pacat --playback --server="unix:$out/native" --device=front_end --rate="$RATE" --channels=5 --channel-map=aux0,aux1,aux2,aux3,aux4 \
    --format=float32le --no-remix --no-remap --raw --latency-msec=200 --process-time-msec=10 <"$out/front_end.pipe" >"$out/pacat.log" 2>&1 &
  started+=($!)
fi

export ROS_MASTER_URI=http://localhost:$master ROS_HOSTNAME=localhost ROS_HOME=$out ROS_LOG_DIR=$out/log
devel/env.sh roslaunch -p "$master" smartmill_studies/daq/launch/machine_through_pipe.launch port:="$focas" folder:="$out" \
  full_scale:="$full_scale" >"$out/machine.log" 2>&1 &
started+=($!)

record() { # SECONDS FILE
  timeout -s INT "$1" devel/env.sh rosrun smartmill_launch record -o "$2" '/smartmill/(daq|device)/.*' >"$out/record.log" 2>&1 || true
}
align() { # RECORD NAME/CHANNEL OPTION...
  devel/env.sh rosrun smartmill_daq align "$1" "daq/$2" "device/$2" --by correlation "${@:3}" 2>&1 | tee -a "$out/align.txt"
}
# The line of the arrivals settles for half a minute. The latency, then what is left of it after a restart of daq_node.
rm -f "$out/align.txt"
sleep "${SETTLE:-30}"
record 15 "$out/align_before.bag"
align "$out/align_before.bag" hammer/hammer --write "$out/front_end.yaml" || true
devel/env.sh rosnode kill /smartmill/daq_front_end >/dev/null   # roslaunch starts it again
sleep "${SETTLE:-30}"
record 12 "$out/align_after.bag"
for name in dynamometer/fx hammer/hammer; do align "$out/align_after.bag" "$name" || true; done
devel/env.sh roslaunch -p "$master" smartmill_studies/daq/launch/session_on_machine.launch port:="$focas" bag:="$out/session.bag" \
  summary:="$out/session.json" >"$out/session.log" 2>&1 || true
grep -aoE "session \[.*|\[(WARN|ERROR|FATAL)\].*" "$out/session.log" "$out/machine.log" || true
devel/env.sh rosrun smartmill_launch report "$out/session.bag" --session "$out/session.json" -o "$out" --check
