"""The job scripts without a Slurm: what they start, and when a job goes back into the queue."""

import os
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCRIPTS = sorted((ROOT / "scripts" / "slurm").iterdir()) + sorted(Path(__file__).parent.glob("*.sh"))
JOBS = [script for script in SCRIPTS if script.suffix == ".sbatch"]
# Stand-ins: srun runs what it is given, if a step can start; scontrol notes what it is told.
STAND_INS = {
    "srun": """#!/bin/bash
echo "srun $*" >>"$NOTES"
while [[ $1 == --* ]]; do shift; done
((CANNOT_START)) && exit 0
SLURM_PROCID=0 exec "$@"
""",
    "scontrol": '#!/bin/bash\necho "scontrol $*" >>"$NOTES"\nexit 1\n',
    "epsmesh": '#!/bin/bash\necho "epsmesh $*" >>"$NOTES"\nexit "$STATUS"\n',
}


def start(script: str, folder: Path, *arguments: str, **environment: str) -> tuple[int, list[str]]:
    """Run a job script with stand-ins for Slurm; return its exit status, and what was called."""
    for name, text in STAND_INS.items():
        (folder / name).write_text(text)
        (folder / name).chmod(0o755)
    notes = folder / "notes"
    notes.write_text("")
    clean = {key: value for key, value in os.environ.items() if not key.startswith(("SLURM_", "SHARDS"))}
    job = {"PATH": f"{folder}:{os.environ['PATH']}", "EPSMESH": str(folder / "epsmesh"), "NOTES": str(notes),
           "SLURM_JOB_ID": "7", "STATUS": "0", "CANNOT_START": "0", "TMPDIR": str(folder)}  # fmt: skip
    done = subprocess.run(
        ["bash", str(ROOT / "scripts" / "slurm" / script), *arguments],
        env=clean | job | environment, cwd=ROOT, check=False, capture_output=True,
    )  # fmt: skip
    left = {path.name for path in folder.iterdir()} - {*STAND_INS, "notes"}
    assert not left, "a mark is left"
    return done.returncode, notes.read_text().splitlines()


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.name)
def test_scripts_are_sound(script):
    subprocess.run(["bash", "-n", str(script)], check=True)
    lines = script.read_text().splitlines()
    assert lines[0] == "#!/bin/bash"
    # Slurm reads no directive past the first command.
    first = next(number for number, line in enumerate(lines) if line and not line.startswith("#"))
    assert not any(line.startswith("#SBATCH") for line in lines[first:])


def test_what_the_jobs_start(tmp_path):
    options = ("a study.toml", "--output", "a folder")
    _, calls = start("study.sbatch", tmp_path, *options)
    assert calls[-1] == "epsmesh run a study.toml --output a folder"
    array = {"SLURM_ARRAY_TASK_ID": "3", "SLURM_ARRAY_TASK_COUNT": "4"}
    _, calls = start("shards.sbatch", tmp_path, *options, **array)
    assert calls[-1] == "epsmesh run a study.toml --shard 3/4 --output a folder"
    _, calls = start("shards.sbatch", tmp_path, "s.toml", SHARDS="8", **array)
    assert calls[-1] == "epsmesh run s.toml --shard 3/8"
    status, calls = start("merge.sbatch", tmp_path, "s.toml", STATUS="1")
    assert (status, calls[-1]) == (1, "epsmesh run s.toml")
    for script in JOBS:
        status, calls = start(script.name, tmp_path)
        assert status != 0
        assert not calls


@pytest.mark.parametrize("status", ["0", "1", "2", "130", "137", "139"])
def test_what_is_interrupted_goes_back_into_the_queue(tmp_path, status):
    found, calls = start("study.sbatch", tmp_path, "s.toml", STATUS=status)
    assert found == int(status)
    assert ("scontrol requeue 7" in calls) == (int(status) > 128)


def test_a_task_of_an_array_goes_back_into_the_queue_alone(tmp_path):
    """The last task's number is that of the whole array."""
    task = {"SLURM_ARRAY_JOB_ID": "7", "SLURM_ARRAY_TASK_ID": "3", "SLURM_ARRAY_TASK_COUNT": "4"}
    _, calls = start("shards.sbatch", tmp_path, "s.toml", STATUS="137", **task)
    assert calls[-1] == "scontrol requeue 7_3"


def test_a_step_that_did_not_start_is_no_success(tmp_path):
    found, calls = start("study.sbatch", tmp_path, "s.toml", CANNOT_START="1")
    assert found != 0
    assert "scontrol requeue 7" in calls


def test_restarts_take_new_steps_and_come_to_an_end(tmp_path):
    _, calls = start("study.sbatch", tmp_path, "s.toml", STATUS="130", SLURM_RESTART_COUNT="2")
    assert [call.startswith("srun --mpi=none") for call in calls if call.startswith("srun")] == [True, True, False]
    assert "scontrol requeue 7" in calls
    _, calls = start("study.sbatch", tmp_path, "s.toml", STATUS="130", SLURM_RESTART_COUNT="20")
    assert not any(call.startswith("scontrol") for call in calls)
