"""What cannot be written is found before anything is computed; who no longer reads ends nothing."""

import errno
import os
import subprocess

import pytest

from tests.commands import command
from tests.studies import small_text

# What stands where, and what is said of it.
IN_THE_WAY = {
    "a file for the folder": ("out", "", ("--output", "out"), "out/cases.sqlite: cannot be written: out is a file"),
    "a folder for the dataset": ("out/small.nc", None, ("--output", "out"), "out/small.nc: is a folder"),
    "a folder for the figure": ("out/small.png", None, ("--output", "out"), "out/small.png: is a folder"),
    "a file for the meshes": ("kept", "", ("--meshes", "kept"), "kept is a file, not a folder"),
    "a device for the store": ("x", "", ("--store", "/dev/full"), "/dev/full: is no plain file"),
    "a folder that is a device": ("x", "", ("--output", "/dev/full"), "/dev/full is a file, not a folder"),
    "a folder of the system's": ("x", "", ("--output", "/proc/none"), "cannot be written"),
}


@pytest.mark.parametrize("name", IN_THE_WAY)
def test_what_cannot_be_written_is_found_first(name, epsmesh, tmp_path, monkeypatch):
    place, content, options, message = IN_THE_WAY[name]
    monkeypatch.chdir(tmp_path)
    (tmp_path / "small.toml").write_text(small_text(), encoding="utf-8")
    if content is None:
        (tmp_path / place).mkdir(parents=True)
    else:
        (tmp_path / place).write_text(content)
    done = epsmesh("run", "small.toml", *options)
    assert done.exit_code == 2
    assert message in done.stderr
    assert not done.stdout
    assert not list(tmp_path.rglob("*.npz"))


def test_a_full_standard_output_is_told(tmp_path):
    (tmp_path / "small.toml").write_text(small_text(), encoding="utf-8")
    with open("/dev/full", "w") as full:  # noqa: PTH123
        done = subprocess.run(
            command("validate", tmp_path / "small.toml"), stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert (done.returncode, done.stderr) == (2, "standard output: No space left on device\n")


def test_a_reader_that_goes_away_ends_nothing(tmp_path):
    (tmp_path / "small.toml").write_text(small_text(mesh={"epsilon": "full"}, solve={"exact": False}), encoding="utf-8")
    reading, writing = os.pipe()
    os.close(reading)
    arguments = ("run", "small.toml", "--verbose", "--output", "out")
    done = subprocess.run(command(*arguments), stdout=writing, stderr=writing, cwd=tmp_path, check=False)
    os.close(writing)
    assert done.returncode == 0
    assert (tmp_path / "out" / "small.nc").is_file()


def test_a_disk_that_fills_while_results_are_written_loses_no_record(epsmesh, tmp_path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    file = tmp_path / "small.toml"
    file.write_text(small_text(mesh={"epsilon": "full"}, solve={"exact": False}), encoding="utf-8")
    options = ("--output", tmp_path / "out", "--meshes", tmp_path / "meshes")
    with monkeypatch.context() as patched:
        patched.setattr("pipeline.workflow.publish", full)
        done = epsmesh("run", file, *options)
    assert done.exit_code == 2
    (line,) = [line for line in done.stderr.splitlines() if "cannot be written" in line]
    assert "No space left on device" in line
    assert "(1 read back)" in epsmesh("run", file, *options).stdout
