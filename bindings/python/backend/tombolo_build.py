"""Builds the wheel by maturin, with the viewer in it."""

import os
import pathlib
import subprocess

from maturin import build_editable as _build_editable
from maturin import (  # noqa: F401
    build_sdist,
    get_requires_for_build_editable,
    get_requires_for_build_sdist,
    get_requires_for_build_wheel,
    prepare_metadata_for_build_editable,
    prepare_metadata_for_build_wheel,
)
from maturin import build_wheel as _build_wheel

ROOT = pathlib.Path(__file__).resolve().parents[3]


def _viewer() -> None:
    """Builds the viewer where it is not there yet; TOMBOLO_WITHOUT_VIEWER leaves it out."""
    if "TOMBOLO_WITHOUT_VIEWER" in os.environ or (ROOT / "viewer/dist/index.html").is_file():
        return
    # What Python gives a build of its own is not for the program that it runs.
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "PIP_"))}
    subprocess.run([ROOT / "scripts/setup", "--viewer"], check=True, env=environment)


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    _viewer()
    return _build_wheel(wheel_directory, config_settings, metadata_directory)


def build_editable(wheel_directory, config_settings=None, metadata_directory=None):
    _viewer()
    return _build_editable(wheel_directory, config_settings, metadata_directory)
