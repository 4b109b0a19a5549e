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


@pytest.fixture
def wheel():
    """The wheel that TOMBOLO_WHEEL names, or the newest of `pip wheel -w target/wheels ./bindings/python`."""
    named = os.environ.get("TOMBOLO_WHEEL")
    built = sorted(TARGET.glob("wheels/tombolo-*.whl"), key=lambda file: file.stat().st_mtime)
    # One that is older than what it is built from says nothing of it.
    settings = (PROJECT / "bindings/python/pyproject.toml").stat().st_mtime
    if named is None and not (built and built[-1].stat().st_mtime >= settings):
        pytest.skip("there is no new wheel: pip wheel --no-deps -w target/wheels ./bindings/python")
    return Path(named) if named is not None else built[-1]


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
