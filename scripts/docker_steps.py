"""Print a Dockerfile as a script for a root of its Debian: `make docker-steps` runs it in a chroot, without Docker.

`docker_steps.py Dockerfile TARGET CONTEXT`: the lines of the stage TARGET and of those that it is made from. Files are
copied from the folder CONTEXT. Of Docker's language it knows what the project's Dockerfile uses, and refuses the rest.
"""

import re
import sys
from pathlib import Path
from shlex import quote, split

Instruction = tuple[str, str]


def stages(text: str) -> dict[str, tuple[str, list[Instruction]]]:
    """Return the instructions of each stage by its name, with what it is made from."""
    found: dict[str, tuple[str, list[Instruction]]] = {}
    for line in re.sub(r"\\\n", " ", text).splitlines():
        if not line.strip() or line.startswith("#"):
            continue
        word, rest = line.split(maxsplit=1)
        if word == "FROM":
            base, name = re.fullmatch(r"(\S+) AS (\S+)", rest).groups()
            found[name] = (base, [])
        else:
            found[name][1].append((word, rest))
    return found


def chain(text: str, target: str) -> tuple[str, list[Instruction]]:
    """Return the image that a stage begins with, and all instructions since."""
    known, lines = stages(text), []
    while target in known:
        target, own = known[target]
        lines = own + lines
    return target, lines


def script(text: str, target: str, context: str, ignored: list[str]) -> str:
    """Return the script. Files in ``ignored`` are not in the context."""
    image, lines = chain(text, target)
    out = ["set -eu", "user=root", f"grep -q '^VERSION_ID=\"{image.removeprefix('debian:')}\"' /etc/os-release"]
    out += [f"rm -rf {quote(f'{context}/{name}')}" for name in ignored]
    for word, rest in lines:
        out.append(f"echo {quote(f'{word} {rest}')} >&2")
        out += _commands(word, rest, context)
    return "\n".join(out) + "\n"


def _commands(word: str, rest: str, context: str) -> list[str]:
    """Return the lines of an instruction."""
    if word in ("ENV", "ARG"):
        name, value = rest.split("=", 1)
        return [f'export {name}="{value}"' if word == "ENV" else f'export {name}="${{{name}-{value}}}"']
    if word == "USER":
        return [f"user={rest}", f"export HOME=$(getent passwd {rest} | cut -d: -f6)"]
    if word == "WORKDIR":
        return [f"mkdir -p {rest}", f"cd {rest}"]
    if word == "COPY":
        owner, *sources, goal = split(rest)
        give = f"chown -R {owner.removeprefix('--chown=')} {goal}"
        if goal.endswith("/") or len(sources) > 1:
            return [f"mkdir -p {goal}", *(f"cp {context}/{source} {goal}" for source in sources), give]
        # Of a folder, Docker copies what it contains.
        source = f"{context}/{sources[0]}"
        into = f"if [ -d {source} ]; then mkdir -p {goal}; cp -r {source}/. {goal}; else cp {source} {goal}; fi"
        return [f"mkdir -p $(dirname {goal})", into, give]
    if word == "RUN":
        return [f'runuser -u "$user" -- sh -c {quote(rest)}']
    if word in ("CMD", "EXPOSE"):
        return []
    sys.exit(f"docker_steps: {word} is not known")


if __name__ == "__main__":
    file, goal, folder = sys.argv[1:]
    names = Path(file).with_name(".dockerignore").read_text(encoding="utf-8").split()
    print(script(Path(file).read_text(encoding="utf-8"), goal, folder, names), end="")
