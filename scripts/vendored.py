"""Fetch the JavaScript that is kept in the repository, as scripts/vendored.toml records it: `make vendored`.

`npm pack` fetches each package from the registry that npm is set to; a package whose checksum is another is refused.
"""

import hashlib
import subprocess
import sys
import tempfile
import tomllib
from base64 import b64encode
from pathlib import Path
from typing import Any

RECORD = Path(__file__).with_suffix(".toml")
ROOT = RECORD.parents[1]


def fetched(entry: dict[str, Any], folder: Path) -> Path:
    """Return the unpacked files of a package, which `npm pack` downloads into ``folder``."""
    folder.mkdir()
    package = entry["package"]
    subprocess.run(["npm", "pack", "--silent", package], cwd=folder, check=True, stdout=subprocess.DEVNULL)
    (archive,) = folder.glob("*.tgz")
    found = "sha512-" + b64encode(hashlib.sha512(archive.read_bytes()).digest()).decode()
    if found != entry["integrity"]:
        sys.exit(f"vendored: {package} has the checksum {found}, not {entry['integrity']} of {RECORD.name}")
    subprocess.run(["tar", "-xzf", archive.name], cwd=folder, check=True)
    return folder / "package"


def written(entry: dict[str, Any], package: Path, esbuild: Path) -> list[Path]:
    """Write the files of an entry, from its unpacked ``package``; return them."""
    folder, made = ROOT / entry["folder"], []
    for source, name in entry["files"].items():
        made.append(folder / name)
        made[-1].write_bytes((package / source).read_bytes())
    for source, name in entry.get("bundle", {}).items():
        modules = package.parent / "node_modules"
        modules.mkdir()
        package.rename(modules / entry["package"].rpartition("@")[0])
        start = modules.parent / source  # where the bundler looks for node_modules
        start.write_bytes((folder / source).read_bytes())
        how = ["--bundle", "--minify", "--format=iife", f"--global-name={entry['global']}", "--legal-comments=eof"]
        command = [str(esbuild), source, *how, "--log-level=error", f"--outfile={folder / name}"]
        subprocess.run(command, cwd=start.parent, check=True)
        made.append(folder / name)
    return made


def main() -> None:
    """Write all files, and their checksums into the record."""
    text = RECORD.read_text(encoding="utf-8")
    record = tomllib.loads(text)
    made: list[Path] = []
    with tempfile.TemporaryDirectory() as name:
        esbuild = fetched(record["bundler"], Path(name, "bundler")) / "bin" / "esbuild"
        for number, entry in enumerate(record["vendored"]):
            made += written(entry, fetched(entry, Path(name, str(number))), esbuild)
    head = text[: text.index("[sha256]\n") + len("[sha256]\n")]
    sums = {path.relative_to(ROOT).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest() for path in made}
    lines = [f'"{path}" = "{value}"\n' for path, value in sorted(sums.items())]
    RECORD.write_text(head + "".join(lines), encoding="utf-8")
    print(f"vendored: {len(made)} files of {len(record['vendored'])} packages")


if __name__ == "__main__":
    main()
