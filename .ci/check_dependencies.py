#!/usr/bin/env python3
"""Every package that sources include, CMake finds or links, and launch files start is declared in package.xml."""
import re
import sys

from packages import includes, packages, report, system_includes, text

# First folder of a header, or name that CMake finds: name in package.xml. None: no package has to be declared.
HEADERS = {
    "Eigen": "eigen", "ceres": "libceres-dev", "fftw3.h": "fftw3", "sndfile.h": "libsndfile1-dev", "hdf5.h": "libhdf5-dev",
    "matio.h": "libmatio-dev", "lz4frame.h": "lz4", "xxhash.h": "libxxhash-dev", "bzlib.h": "bzip2", "zstd.h": "libzstd-dev", "zlib.h": "zlib",
    "yaml-cpp": "yaml-cpp",
    "nlohmann": "nlohmann-json-dev", "CLI": "cli11", "sqlite3.h": "sqlite3", "SQLiteCpp": "libsqlitecpp-dev", "benchmark": "benchmark",
    "rapidcheck": "rapidcheck", "rapidcheck.h": "rapidcheck", "ros": "roscpp", "boost": "boost",
    "glog": "libgoogle-glog-dev", "unsupported": "eigen", "gtest": None, "gmock": None,
    "pybind11": "pybind11-dev",
    "libpq-fe.h": None,  # optional: ./setup --with-fleet
    "mqtt": None, "open62541": None,  # optional: a build without it refuses mqtt_broker, opcua_port
    "openvdb": None,  # optional: a baseline of program_stock_benchmark, apt install libopenvdb-dev
    "pulse": None, "libsigrok": None, "iio.h": None, "comedilib.h": None,  # optional: ./setup --with-instruments
    "arpa": None, "netinet": None, "sys": None, "linux": None,
}
FOUND = {
    "Eigen3": "eigen", "Ceres": "libceres-dev", "SQLite3": "sqlite3", "SQLiteCpp": "libsqlitecpp-dev", "CLI11": "cli11", "liblz4": "lz4",
    "libxxhash": "libxxhash-dev", "libzstd": "libzstd-dev", "BZip2": "bzip2", "ZLIB": "zlib", "hdf5-serial": "libhdf5-dev", "matio": "libmatio-dev",
    "pybind11": "pybind11-dev", "Python": "python3-dev", "Interpreter": None, "Development.Module": None,
    "comedilib": None, "libiio": None, "libpulse": None, "libsigrok": None,  # optional: ./setup --with-instruments
    "nlohmann_json": "nlohmann-json-dev", "PkgConfig": None, "Threads": None, "GTest": None, "catkin": None,
}
ROS_PACKAGES = {"actionlib", "tf2", "tf2_ros", "roslib", "rosbag", "rosbag_storage", "diagnostic_updater", "topic_tools",
                "rostest", "roslaunch", "roscpp", "rospy"}
# A header of rosbag's storage is found through either.
SAME = {"rosbag": {"rosbag", "rosbag_storage"}, "topic_tools": {"topic_tools", "rosbag"}}
BUILD = ("depend", "build_depend", "buildtool_depend", "build_export_depend")
TEST = BUILD + ("test_depend", "exec_depend")
RUN = ("depend", "exec_depend", "test_depend")


def package_of_header(header, ours):
    first = header.split("/")[0]
    if first in HEADERS:
        return HEADERS[first]
    if "/" in header and (first in ROS_PACKAGES or first in ours or first.endswith("_msgs")):
        return first
    return None


def packages_found(cmake):
    cmake = re.sub(r"#.*", "", cmake)
    for call in re.findall(r"find_package\(([^)]*)\)", cmake):
        words = call.split()
        yield words[0]
        if "COMPONENTS" in words:
            yield from words[words.index("COMPONENTS") + 1:]
    for call in re.findall(r"pkg_check_modules\(([^)]*)\)", cmake):
        yield call.split()[-1]


def packages_launched(launch):
    launch = re.sub(r"<!--.*?-->", "", launch, flags=re.DOTALL)
    yield from re.findall(r'\bpkg="([^"$]+)"', launch)
    yield from re.findall(r"\$\(find ([\w-]+)\)", launch)


def required(package, ours):
    """(file, required package, kinds of dependency that satisfy it)"""
    for path in package.files:
        if "consumer" in path.parts:
            continue  # a project of its own, which uses the installed libraries
        test = "test" in path.relative_to(package.folder).parts
        if path.suffix in (".cpp", ".h"):
            kinds = TEST if test else BUILD
            for header in includes(path):
                yield path, package_of_header(header, ours), kinds
            for header in system_includes(path):
                if header.split("/")[0] not in HEADERS and package_of_header(header, ours) is None:
                    yield path, f"the package of {header}", kinds
        elif path.name == "CMakeLists.txt":
            for name in packages_found(text(path)):
                yield path, FOUND.get(name, name), TEST
        elif path.suffix in (".launch", ".test"):
            for name in packages_launched(text(path)):
                yield path, name, TEST if path.suffix == ".test" else RUN


def main():
    everything = packages()
    ours = {p.name for p in everything}
    faults = set()
    for package in everything:
        for path, name, kinds in required(package, ours):
            if name is None or name == package.name:
                continue
            if not SAME.get(name, {name}) & package.declares(*kinds):
                faults.add(f"{path}: {name} is not declared in {package.folder}/package.xml as {' or '.join(kinds)}")
    return report("dependencies", sorted(faults))


sys.exit(main())
