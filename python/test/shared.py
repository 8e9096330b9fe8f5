"""What the tests share: the data next to the repository, the program `smartmill`, small campaigns."""
import os
import pathlib
import re
import subprocess
import tempfile
import unittest

REPOSITORY = pathlib.Path(__file__).resolve().parents[2]
SHARED = pathlib.Path(os.environ.get("SMARTMILL_SHARED", REPOSITORY.parent / "shared"))
EXAMPLES = REPOSITORY / "python" / "examples"
MODEL = REPOSITORY / "smartmill_stability/test/smartmill_stability_testing/model.yaml"


def shared(name):
    """Path of shared data; skips the test where they are absent."""
    path = SHARED / name
    if not path.exists():
        raise unittest.SkipTest(f"{path} is absent")
    return path


def program(*arguments, folder="."):
    """The completed run of `smartmill ARGUMENTS` in a folder."""
    return subprocess.run([os.environ["SMARTMILL"], *map(str, arguments)], cwd=folder, capture_output=True, text=True)


def subset(campaign, folder, *names):
    """A campaign of the named tests of another one, in a folder."""
    text = (campaign / "campaign.yaml").read_text()
    head, *tests = re.split(r"^(?=- name: )", text, flags=re.MULTILINE)
    chosen = [test for test in tests if re.match(r"- name: (\S+)", test)[1] in names]
    folder = pathlib.Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "campaign.yaml").write_text(head + "".join(chosen))
    for file in ["model.yaml", *(re.search(r"file: (\S+)", test)[1] for test in chosen)]:
        (folder / file).symlink_to(campaign / file)
    return folder


class FolderTest(unittest.TestCase):
    """A test with a folder of its own."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
