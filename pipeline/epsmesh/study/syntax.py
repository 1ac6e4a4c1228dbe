"""Errors of TOML as sentences: the place, what was found, and what was probably meant."""

import re
import tomllib

_PLACE = re.compile(r"\(at (?:line (\d+), column (\d+)|end of document)\)")
_STATEMENT = re.compile(r"\s*(?P<key>[\w.\"'-]+)\s*=\s*(?P<value>.*?)\s*(?:#[^\"']*)?")
_HEADING = re.compile(r"\s*(\[\[?)\s*([^\[\]#]+?)\s*\]")
_QUOTES = "“”„‟‘’«»"
_LONGEST = 80
# Values that are no TOML, and what is said of them; {key} and the groups are what was found.
_VALUES = (
    (rf"[^#]*[{_QUOTES}].*", 'quotation marks are straight: write {key} = "…"'),
    (r"(?P<a>[+-]?\d+),(?P<b>\d+)", "a number has a decimal point: write {key} = {a}.{b}"),
    (r"(?P<a>[+-]?\d+),(?P<b>\d+)\s*(?P<c>[^\d\s,].*)", 'text, and a decimal point: write {key} = "{a}.{b} {c}"'),
    (
        r"(?P<a>[+-]?[\d.]+(?:[eE][+-]?\d+)?)\s*(?P<c>[A-Za-zµμ%°][^\",]*)",
        'a quantity is text: write {key} = "{a} {c}"',
    ),
    (r"(?P<a>[+-]?)(?P<b>\.\d+)", "a number begins with a digit: write {key} = {a}0{b}"),
    (r"(?P<a>[+-]?\d+)\.", "a number ends with a digit: write {key} = {a}.0"),
    (r"(?P<a>[+-]?)0+(?P<b>\d.*)", "a number does not begin with 0: write {key} = {a}{b}"),
    (r"(?P<a>True|False|TRUE|FALSE)", "write true and false in small letters"),
    (r"", "there is no value after ="),
    (r"[A-Za-z]:[\\/].*", 'a path is text, with / between folders: write {key} = "…"'),
    (r"(?P<a>[A-Za-z_./][\w ./-]*)", 'text is in quotation marks: write {key} = "{a}"'),
    (r"\[.*\]", "values with a unit, and words, are in quotation marks within a list, too"),
    (r"\{[^}]*", "a table in braces is on one line"),
)


def meant(text: str, error: ValueError) -> str:
    """Return what is wrong with the ``text`` of a study that is no TOML, by the ``error`` of its reader."""
    why = str(error)
    place = _PLACE.search(why)
    lines = text.split("\n")
    if place is None:
        return why
    filled = max((number for number, line in enumerate(lines, start=1) if line.strip()), default=1)
    number = int(place[1]) if place[1] else filled
    where = f"line {number}" + (f", column {place[2]}" if place[2] else "")
    if "overwrite" in why or "twice" in why:
        return _twice(lines) or why
    line = lines[number - 1] if number <= len(lines) else ""
    sentence = _of_line(line, why.partition(" (at ")[0])
    return f"{where}, `{line.strip()[:_LONGEST]}`: {sentence}"


def _of_line(line: str, why: str) -> str:
    """Return what is wrong with a line."""
    if _is_sound(line) or ("Unclosed array" in why and "]" not in line):
        return "a list that begins above is not closed"
    if "Unterminated" in why:
        return "a text in three quotation marks is not closed"
    if why.startswith("Expected ']'") or (line.lstrip().startswith("[") and "]" not in line):
        return "the bracket of a heading is not closed"
    if found := _STATEMENT.fullmatch(line):
        for pattern, said in _VALUES:
            if value := re.fullmatch(pattern, found["value"]):
                return said.format(key=found["key"], **value.groupdict())
    if line.count('"') % 2 or line.count("'") % 2:
        return "a quotation mark is not closed"
    if '"' in line and "\\" in line:
        return "a backslash begins a sign of its own: write / or \\\\ in its place"
    if re.match(r"\s*[\w.-]+\s*:", line):
        return "a key and its value have = between them, not a colon"
    if "=" not in line and not line.lstrip().startswith("["):
        return "neither a heading nor a key with = and a value"
    return why[:1].lower() + why[1:]


def _is_sound(line: str) -> bool:
    """Tell a line that is TOML by itself."""
    try:
        return bool(tomllib.loads(line))
    except (ValueError, RecursionError):
        return False


def _twice(lines: list[str]) -> str:
    """Return which key or heading is there twice, with both lines; "" if it is not found."""
    known: dict[str, int] = {}
    section = ""
    for number, line in enumerate(lines, start=1):
        if heading := _HEADING.match(line):
            brackets, name = heading.groups()
            section = f"{name}." if brackets == "[" else f"{name}#{number}."
            place, what, cure = (
                f"[{name}]",
                f"[{name}]",
                f"put all keys under one, or write [[{name}]] for each of several",
            )
            if brackets == "[[" and place not in known:
                known.setdefault(f"[[{name}]]", number)
                continue
            if first := known.get(f"[[{name}]]", 0):
                return f"line {number}: {what} is also an array of tables, [[{name}]] in line {first}: write [[{name}]]"
        elif statement := _STATEMENT.fullmatch(line):
            place, what = section + statement["key"], f"`{statement['key']}`"
            cure = "leave one of them out; a list of values, such as [1, 2], is a sweep"
        else:
            continue
        if place in known:
            return f"line {number}: {what} is there twice, first in line {known[place]}: {cure}"
        known[place] = number
    return ""
