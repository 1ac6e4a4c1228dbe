"""Seconds until the commands that need no solver answer: medians, each in a process of its own.

python -m benchmarks.start_up        writes results/start_up.json
"""

import json
import statistics
import subprocess
import sys
import time
from pathlib import Path

COMMANDS = {
    "--help": ["--help"],
    "validate": ["validate", "studies/figure3.toml"],
    "plan": ["plan", "studies/figure3.toml"],
    "status": ["status", "studies/figure3.toml"],
    "explain": ["explain", "studies/figure3.toml"],
}
_REPEATS = 7


def main(output: Path = Path("results")) -> dict[str, float]:
    """Measure, print and write."""
    found = {}
    for name, arguments in COMMANDS.items():
        times = []
        for _ in range(_REPEATS):
            start = time.perf_counter()
            subprocess.run([sys.executable, "-m", "pipeline", *arguments], check=True, capture_output=True)
            times.append(time.perf_counter() - start)
        found[name] = statistics.median(times)
        print(f"{name:10} {found[name]:.2f} s")
    output.mkdir(exist_ok=True)
    (output / "start_up.json").write_text(json.dumps(found, indent=2))
    return found


if __name__ == "__main__":
    main()
