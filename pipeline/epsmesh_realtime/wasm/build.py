"""Build the evaluator for web pages with clang and lld (Debian: `apt-get install clang lld`): `make wasm`.

The file ends in a section with the hash of the C sources, by which tests see that it is theirs.
"""

import hashlib
import shutil
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
SOURCES = HERE.parent / "c"
MADE = HERE.parent / "page" / "templates" / "evaluator.wasm"
_FLAGS = ("--target=wasm32", "-O2", "-std=c99", "-nostdlib", "-Wall", "-Wextra", "-fvisibility=hidden")
# Functions of math.h are imported from the page; a page that lacks one does not start.
_LINK = ("--no-entry", "--export-dynamic", "--allow-undefined", "--gc-sections", "--strip-all", "-zstack-size=1048576")
_SECTION = b"sources"


def hash_of_sources() -> bytes:
    """Return the SHA-256 of the sources and of the flags."""
    files = [*SOURCES.glob("epsmesh*.[ch]"), *SOURCES.glob("src/*.c"), *HERE.glob("*.c"), *HERE.glob("include/*.h")]
    text = b"\0".join(file.read_bytes() for file in sorted(files))
    return hashlib.sha256(text + repr((_FLAGS, _LINK)).encode()).digest()


def hash_in(made: bytes) -> bytes:
    """Return the hash in a file that was built here, b"" if there is none."""
    return made[-32:] if made[-32 - len(_SECTION) : -32] == _SECTION else b""


def build(compiler: str) -> bytes:
    """Return the evaluator as WebAssembly.

    Raises:
        RuntimeError: if it does not compile.
    """
    made = MADE.with_suffix(".tmp")
    sources = [str(SOURCES / "epsmesh.c"), str(HERE / "wasm.c")]
    command = [compiler, *_FLAGS, f"-I{HERE / 'include'}", f"-I{SOURCES}", *sources, f"-Wl,{','.join(_LINK)}"]
    done = subprocess.run([*command, "-o", str(made)], capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"the evaluator does not compile: {done.stderr.strip()}")
    code = made.read_bytes()
    made.unlink()
    content = bytes([len(_SECTION)]) + _SECTION + hash_of_sources()
    return code + bytes([0, len(content)]) + content


def main() -> None:
    """Write the file."""
    compiler = next(filter(None, map(shutil.which, ("clang", "clang-19", "clang-14"))), None)
    if compiler is None:
        sys.exit("there is no clang: apt-get install clang lld")
    MADE.write_bytes(build(compiler))
    print(f"wrote {MADE.name}: {MADE.stat().st_size} bytes")


if __name__ == "__main__":
    main()
