"""The program `tombolo` in the package."""

import signal
import subprocess
import sys
import time

import tombolo
from conftest import program


def test_the_version_is_that_of_the_package():
    assert program("--version").stdout == f"tombolo {tombolo.__version__}\n"


def test_exit_codes_and_errors_are_those_of_the_program(tmp_path):
    file = tmp_path / "pipelines.json"
    file.write_text('{"version": 1, "pipelnes": []}')
    done = program("check", str(file))
    assert done.returncode == 1 and "did you mean `pipelines`" in done.stderr
    file.write_text('{"version": 1}')
    assert program("check", str(file)).returncode == 0
    assert program("bogus").returncode == 2
    assert program("status").returncode == 2
    assert program("status", "http://127.0.0.1:1/?token=a").returncode == 2


def test_it_reaches_a_run(solver):
    done = program("status", "--json", solver.link)
    assert done.returncode == 0 and '"cycle"' in done.stdout


def test_ctrl_c_ends_it(solver):
    process = subprocess.Popen([sys.executable, "-m", "tombolo", "watch", solver.link], stdout=-1, stderr=-1, text=True)
    assert process.stdout.readline()
    time.sleep(0.2)
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=20)
    assert process.returncode == -signal.SIGINT
