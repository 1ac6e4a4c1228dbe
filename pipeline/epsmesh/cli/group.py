"""The group of all commands: with --json, every error that ends a command is printed as JSON, too."""

import errno
import os
import sys
from collections.abc import Callable, Iterator, Mapping, MutableMapping, Sequence
from typing import Any

import typer
from typer.core import TyperGroup

from epsmesh.cli.console import JSON, has_printed_json, print_json
from epsmesh.cli.faults import (
    INTERRUPTED,
    SOME_FAILED,
    Fault,
    as_data,
    fail,
    leave_it_to_first_rank,
    of_file,
    of_unwritten,
)
from epsmesh.extensions import commands
from epsmesh.files import NOT_UTF8, is_utf8
from epsmesh.launcher import LauncherError, end_ranks, is_first_rank, is_interrupt, is_launched
from epsmesh.libraries import sentence_on
from epsmesh.printable import printable

# Errors of a disk that cannot be written to; some appear only at the end.
_UNWRITABLE = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS)


class Added(MutableMapping[str, Any]):
    """Commands by name: a package's ``own``, and those of other packages, which are loaded when they are asked for."""

    def __init__(self, own: Mapping[str, Any]) -> None:
        self._known, self._own = dict(own), tuple(own)

    def __getitem__(self, name: str) -> Any:
        """Return a command."""
        if name not in self._known:
            self._known[name] = _command(name, commands()[name][0].load())
        return self._known[name]

    def __iter__(self) -> Iterator[str]:
        """Yield the names in the order of the help: an added command comes after the one that it names as its place."""
        order = list(self._own)
        rest = {name: place for name, (_, place) in commands().items() if name not in order}
        while rest:
            for name in [name for name, place in rest.items() if place in order] or list(rest):
                place = rest.pop(name)
                order.insert(order.index(place) + 1 if place in order else len(order), name)
        yield from order

    def __len__(self) -> int:
        """Return how many there are."""
        return len(list(iter(self)))

    def __setitem__(self, name: str, command: Any) -> None:
        """Set an own command."""
        self._known[name] = command

    def __delitem__(self, name: str) -> None:
        """Take a command away."""
        del self._known[name]


def _command(name: str, function: Callable[..., Any]) -> Any:
    """Return a command as typer makes it of a function."""
    alone = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)
    alone.command(name)(function)
    return typer.main.get_command(alone)


class Commands(TyperGroup):
    """A group of commands that finds --json before any command starts, and commands of other packages."""

    words: Sequence[str] = ()

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.commands = Added(self.commands)

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of the commands, without loading those of other packages."""
        return list(self.commands)

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the words of the command line."""
        words = args[: args.index("--")] if "--" in args else args
        JSON.set({"wanted": "--json" in words, "printed": False})
        self.words = list(args)
        if foreign := [word for word in args if not is_utf8(word)]:
            fail(*(Fault(f"{printable(word)}: {NOT_UTF8}", value=printable(word)) for word in foreign))
        try:
            return super().parse_args(ctx, args)
        except Exception as wrong:
            _print_error(wrong, self.words)
            raise

    def invoke(self, ctx: Any) -> Any:
        """Run the command; print as JSON any error that ends it, and raise it again."""
        try:
            return super().invoke(ctx)
        except ModuleNotFoundError as wrong:
            if sentence := sentence_on(wrong):
                fail(sentence)
            raise
        except OSError as wrong:
            if wrong.errno in _UNWRITABLE:
                fail(of_unwritten(wrong))
            if sentence := sentence_on(wrong):
                fail(sentence)
            if wrong.strerror and wrong.filename is not None:
                fail(of_file(wrong.filename, f"cannot be used: {wrong.strerror}"))
            _print_error(wrong, self.words)
            raise
        except (Exception, KeyboardInterrupt) as wrong:
            plain = isinstance(wrong, typer.Exit) or not is_interrupt(wrong)
            if isinstance(wrong, LauncherError):
                fail(str(wrong), on_all_ranks=True)
            if plain and isinstance(wrong, ImportError) and (sentence := sentence_on(wrong)):
                fail(sentence)
            ended = wrong if plain else KeyboardInterrupt()
            _print_error(ended, self.words)
            if isinstance(ended, KeyboardInterrupt):
                _end_ranks()
            if ended is wrong:
                raise
            raise ended from wrong


def _end_ranks() -> None:
    """End every rank: if only one was interrupted, it would wait for the others for ever."""
    if not is_launched():
        return
    mpi = sys.modules.get("mpi4py.MPI")
    if mpi is not None and mpi.Is_initialized() and not mpi.Is_finalized():
        mpi.COMM_WORLD.Abort(INTERRUPTED)
    # After an interrupted import there is no module, but MPI would still wait for all ranks when Python exits.
    sys.stdout.flush()
    end_ranks(INTERRUPTED)
    os._exit(INTERRUPTED)


def _print_error(wrong: BaseException, words: Sequence[str]) -> None:
    """Print the error that ended a command line of these ``words`` as JSON, with --json and if none was printed yet."""
    usage = getattr(wrong, "format_message", None)  # usage errors have it, in every version of the library
    if usage is not None:
        leave_it_to_first_rank()
    # Before an exit its reason was printed; help is no error.
    if isinstance(wrong, typer.Exit) or has_printed_json() or not is_first_rank():
        return
    if isinstance(wrong, KeyboardInterrupt):
        found, status = Fault("interrupted"), INTERRUPTED
    elif usage is not None:
        found, status = _of_usage(wrong, usage(), words), int(getattr(wrong, "exit_code", 2))
    else:
        found, status = Fault(f"{type(wrong).__name__}: {wrong}"), SOME_FAILED
    print_json(as_data([found], status))


def _of_usage(wrong: Any, message: str, words: Sequence[str]) -> Fault:
    """Return the error of a command line that cannot be parsed."""
    parameter = getattr(wrong, "param", None)
    options = [word for word in getattr(parameter, "opts", ()) if word.startswith("--")]
    argument = getattr(parameter, "metavar", None) or str(getattr(parameter, "name", None) or "").upper()
    names = (*options, getattr(wrong, "option_name", None), argument)
    value = _after(options, words)
    allowed = None if value is None else getattr(wrong, "message", None)
    return Fault(message, key=next((name for name in names if name), None), value=value, allowed=allowed)


def _after(options: Sequence[str], words: Sequence[str]) -> str | None:
    """Return the last value of an option on the command line, None without one."""
    found = None
    for word, following in zip(words, [*words[1:], None], strict=True):
        name, equals, value = word.partition("=")
        if name in options:
            found = value if equals else following
    return found
