# Sourced by ./setup, ./run, ./test and ./package: Debian's tools and Debian's ROS alone, whatever the caller's shell has sourced
# (another catkin workspace, a virtual environment of Python). ROS on Debian is built for the system's Python.
export PATH=/usr/sbin:/usr/bin:/sbin:/bin:${PATH:-}
unset "${!ROS@}" "${!CATKIN_@}" CMAKE_PREFIX_PATH PKG_CONFIG_PATH PYTHONPATH PYTHONHOME LD_LIBRARY_PATH

fail() { # an error of the script that sources this file, in one line
  echo "$(basename "$0"): $1" >&2
  exit 1
}
