"""Fill the cache with the robot's files, for environments without robosuite: `python -m scengen.robots.download`

pip downloads robosuite's wheel (157 MB) into a temporary folder. The files of the robot alone (40 MB) are kept.
"""

import os
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

from ..errors import NoRobot, cut
from ..installation import ROBOSUITE
from . import files


def main() -> int:
    """Fill the cache, and print where the files are. Returns the exit status."""
    folder = files.cached_folder()
    try:
        if not complete(folder):
            print(f"downloading robosuite {ROBOSUITE} (157 MB)", file=sys.stderr)
            fill(folder)
        print(f"the robot's files are in {folder}")
        if not complete((used := files.place()).folder):
            print(
                f"but {used.label}, which is not complete, comes first; to use the cache, set {files.VARIABLE}={folder}"
            )
    except NoRobot as error:
        print(error, file=sys.stderr)
        return 2
    except OSError as error:
        print(f"{error.filename or folder}: {(error.strerror or str(error)).lower()}", file=sys.stderr)
        return 2
    return 0


def complete(folder: Path) -> bool:
    """Whether a folder holds all files of the robot."""
    paths = {name: folder / name for name in files.hashes()}
    return all(path.is_file() and files.is_ours(name, path.read_bytes()) for name, path in paths.items())


def fill(folder: Path) -> None:
    """Download robosuite's wheel, and write the robot's files into a folder.

    Raises:
        NoRobot: the wheel cannot be downloaded, or it holds other files.
        OSError: a file cannot be written.
    """
    with tempfile.TemporaryDirectory() as temporary:
        extract(wheel(Path(temporary)), folder)


def wheel(folder: Path) -> Path:
    """Path of robosuite's wheel, which pip downloads into a folder.

    Raises:
        NoRobot: pip fails.
    """
    options = ["--no-deps", "--only-binary", ":all:", "--quiet", "--disable-pip-version-check", "--dest", str(folder)]
    line = [sys.executable, "-m", "pip", "download", *options, f"robosuite=={ROBOSUITE}"]
    done = subprocess.run(line, capture_output=True, text=True, errors="replace")
    found = list(folder.glob("*.whl"))
    if done.returncode or not found:
        said = [text.strip() for text in done.stderr.splitlines() if text.strip()] or ["it wrote no wheel"]
        errors = [text for text in said if text.startswith("ERROR")] or said
        raise NoRobot(
            f"pip cannot download robosuite {ROBOSUITE}: {cut(errors[-1], 300)}; check pip and the package index, or "
            f"copy a folder with this release from another machine and set {files.VARIABLE} to it"
        )
    return found[0]


def extract(archive: Path, folder: Path) -> None:
    """Write the robot's files of a wheel into a folder, each whole or not at all.

    Raises:
        NoRobot: a file is missing in the wheel, or is another one.
        OSError: a file cannot be written.
    """
    with zipfile.ZipFile(archive) as opened:
        held = set(opened.namelist())
        for name in files.hashes():
            inside = f"{files.ASSETS}/{name}"
            content = opened.read(inside) if inside in held else b""
            if not files.is_ours(name, content):
                raise NoRobot(f"{name} in {archive.name} is not that of robosuite {ROBOSUITE}; check the package index")
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            part = path.with_name(f"{path.name}.{os.getpid()}.part")
            try:
                part.write_bytes(content)
                part.replace(path)
            finally:
                part.unlink(missing_ok=True)


if __name__ == "__main__":
    sys.exit(main())
