"""A wheel that was built before: installed by itself, and what is in it."""

import os
import re
import subprocess
import sys
import time
import zipfile
from pathlib import Path
from urllib.request import urlopen

import numpy as np
import pytest
from conftest import PROJECT, TARGET

PAGE = PROJECT / "docs/python.md"


def sources(project):
    """The files of the package in a checkout that a wheel is built from: in Python, in Rust, and how it is built."""
    package = project / "bindings/python"
    of_python = [package / "pyproject.toml", *package.glob("backend/*.py"), *package.glob("python/tombolo/*.py*")]
    crates = [package, *(project / name for name in ("adaptor", "deform", "pipelines"))]
    of_rust = [found for crate in crates for found in (crate / "Cargo.toml", *crate.glob("src/**/*.rs"))]
    return [file for file in (*of_python, *of_rust, project / "Cargo.lock") if file.is_file()]


def newest_wheel(project, folder):
    """The newest wheel in a folder; None where a file that it would be built from is newer."""
    built = max(folder.glob("tombolo-*.whl"), key=lambda file: file.stat().st_mtime, default=None)
    changed = max(file.stat().st_mtime for file in sources(project))
    return built if built is not None and built.stat().st_mtime >= changed else None


@pytest.fixture
def wheel():
    """The wheel that TOMBOLO_WHEEL names, or the newest of `pip wheel -w target/wheels ./bindings/python`."""
    named = os.environ.get("TOMBOLO_WHEEL")
    # One that is older than what it is built from says nothing of it.
    found = newest_wheel(PROJECT, TARGET / "wheels") if named is None else Path(named)
    if found is None:
        pytest.skip("there is no new wheel: pip wheel --no-deps -w target/wheels ./bindings/python")
    return found


@pytest.mark.parametrize("file", ["bindings/python/python/tombolo/shaper.py", "deform/src/mesh/cells.rs"])
def test_a_wheel_is_as_new_as_each_file_that_it_is_built_from(file, tmp_path):
    assert PROJECT / file in sources(PROJECT)
    source, old, new = (tmp_path / name for name in (file, "tombolo-1.whl", "tombolo-2.whl"))
    source.parent.mkdir(parents=True)
    for seconds, made in enumerate((old, source)):
        made.touch()
        os.utime(made, (seconds, seconds))
    assert newest_wheel(tmp_path, tmp_path) is None
    new.touch()
    assert newest_wheel(tmp_path, tmp_path) == new


def test_a_wheel_needs_python_alone(wheel, tmp_path):
    assert wheel.stat().st_size <= 15e6
    begun = time.monotonic()
    subprocess.run([sys.executable, "-m", "venv", tmp_path / "venv"], check=True)
    python = tmp_path / "venv/bin/python"
    subprocess.run([python, "-m", "pip", "install", "-q", "--no-index", "--no-deps", wheel], check=True)
    # NumPy, and nothing else of this environment.
    (packages,) = (tmp_path / "venv/lib").glob("python3*/site-packages")
    for folder in Path(np.__file__).parents[1].glob("numpy*"):
        (packages / folder.name).symlink_to(folder)
    lines = re.search(r"^```python\n(.*?)^```", PAGE.read_text(), re.S | re.M)[1]
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    command = [python, "-c", lines]
    with subprocess.Popen(command, cwd=tmp_path, env=environment, stdin=-1, stdout=-1, stderr=-1, text=True) as process:
        try:
            # The link leads somewhere until Enter is pressed.
            if line := process.stdout.readline():
                assert urlopen(line.split()[-1], timeout=30).status == 200
            _, said = process.communicate("\n", timeout=60)
        finally:
            process.kill()
    assert process.returncode == 0 and line, said
    # From nothing to a link and a picture.
    assert time.monotonic() - begun < 60
    (picture,) = tmp_path.glob("height-*.png")
    assert picture.read_bytes().startswith(b"\x89PNG")
    told = subprocess.run([tmp_path / "venv/bin/tombolo", "--version"], check=True, capture_output=True, text=True)
    assert told.stdout.startswith("tombolo")


def test_a_wheel_has_its_licences_and_links_that_lead_somewhere(wheel):
    with zipfile.ZipFile(wheel) as files:
        names = files.namelist()
        (metadata,) = (files.read(name).decode() for name in names if name.endswith(".dist-info/METADATA"))
    for licence in ("LICENSE-APACHE", "LICENSE-MIT"):
        assert any(name.endswith(f"/{licence}") for name in names), names
        assert f"License-File: {licence}" in metadata
    links = re.findall(r"\]\(([^)]+)\)", metadata)
    assert all(link.startswith("https://") for link in links)
