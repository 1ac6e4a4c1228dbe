"""A signal ends a run within a bounded time, even if what it computes does not look up."""

import signal
import subprocess
import sys

import pytest
from mpi4py import MPI

pytestmark = pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="starts processes itself")

# `sum` over a range is one call of C code: Python hears of signals after it.
# Signals come while Python writes, too: what answers them does not write through its buffers.
SCRIPT = """
import os, signal
from pipeline.run.deadline import watched
def heard(*_):
    {answer}
    os.write(1, b"heard\\n")
with watched(signal.SIGTERM, seconds=1) as watch:
    signal.signal(signal.SIGTERM, heard)
    signal.signal(signal.SIGUSR1, lambda *_: None)
    print("ready", flush=True)
    {work}
print("end", flush=True)
"""


def begun(work, answer):
    process = subprocess.Popen(
        [sys.executable, "-c", SCRIPT.format(work=work, answer=answer)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout.readline() == "ready\n"
    return process


def test_what_does_not_look_up_is_ended():
    process = begun("sum(range(10**11))", answer="pass")
    process.send_signal(signal.SIGTERM)
    try:
        _, errors = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == -signal.SIGKILL
    assert "what is finished is kept" in errors


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGUSR1])
def test_a_signal_that_is_answered_or_meant_otherwise_ends_nothing(number):
    process = begun("import time; [time.sleep(0.1) for _ in range(15)]", answer="watch.answer()")
    process.send_signal(number)
    said, _ = process.communicate(timeout=60)
    assert process.returncode == 0
    assert said.splitlines()[-1] == "end"
    assert ("heard" in said) == (number == signal.SIGTERM)
