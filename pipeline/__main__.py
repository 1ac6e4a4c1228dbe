"""``python -m pipeline`` is the command ``epsmesh``."""

import sys


def main() -> None:
    """Run the command ``epsmesh``; Ctrl-C ends it quietly even while it is loading."""
    try:
        from pipeline.cli import main as run  # noqa: PLC0415 (what loads here can be interrupted)

        run()
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    main()
