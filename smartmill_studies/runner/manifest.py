"""Shared by run, case and collect: the definition of a run, stored in its folder."""
import hashlib
import json
import os
import pathlib
import subprocess
import sys
import tomllib

ROOT = pathlib.Path(__file__).resolve().parents[2]
SAME = ("program", "arguments", "cases", "seed", "build")  # the parameters that determine the cases


def fail(what, code=1):
    print(f"{pathlib.Path(sys.argv[0]).name}: {what}", file=sys.stderr)
    sys.exit(code)


def definitions():
    with open(pathlib.Path(__file__).with_name("studies.toml"), "rb") as file:
        return tomllib.load(file)


def program_path(name):
    path = ROOT / "devel/lib" / name
    if not os.access(path, os.X_OK):
        fail(f"{path}: is not built (./setup)")
    return path


def digest(path):
    return hashlib.sha256(pathlib.Path(path).read_bytes()).hexdigest()


def libraries(path):
    """The project's own libraries that a program loads."""
    output = subprocess.run(["ldd", path], check=True, capture_output=True, text=True).stdout
    own = [word for word in output.split() if word.startswith(str(ROOT))]
    return sorted(pathlib.Path(word) for word in own)


def build_of(path):
    """Digest of a program and the project's libraries that it loads, which determine the result of a case."""
    combined = hashlib.sha256()
    for file in [path, *libraries(path)]:
        combined.update(digest(file).encode())
    return combined.hexdigest()[:16]


def commit():
    def git(*words):
        return subprocess.run(["git", "-C", ROOT, *words], check=True, capture_output=True, text=True).stdout.strip()
    try:
        changed = git("status", "--porcelain", "--untracked-files=no")
        return git("rev-parse", "HEAD") + ("+changes" if changed else "")
    except (OSError, subprocess.CalledProcessError):
        return "unknown"


def write_whole(path, text):
    """Writes a file atomically."""
    partial = pathlib.Path(f"{path}.part.{os.uname().nodename}.{os.getpid()}")
    with open(partial, "w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())
    os.replace(partial, path)


def read(out):
    path = pathlib.Path(out) / "study.json"
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        fail(f"{path}: not a study ({error})")


def case_file(out, number):
    return pathlib.Path(out) / "cases" / f"{number}.json"


def done(out, study):
    """Numbers of the completed cases."""
    found = {int(p.stem) for p in (pathlib.Path(out) / "cases").glob("*.json") if p.stem.isdigit()}
    return {k for k in found if k < study["cases"]}
