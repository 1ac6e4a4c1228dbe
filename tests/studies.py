"""Studies for the tests, as data and as text: a base, of which a test says what it changes."""

import copy
import json
from typing import Any

# A disc on a box, solved in no time.
_SMALL: dict[str, Any] = {
    "body": {"shape": "box", "size": ["20 mm", "20 mm", "10 mm"]},
    "material": {"young": "10 kPa", "poisson": 0.3},
    "probe": {"shape": "disc", "radius": "2 mm", "depth": "0.1 mm"},
    "mesh": {"epsilon": ["4 mm", "6 mm", "full"], "fine": "2 mm", "coarse": "4 mm", "rim": "0.5 mm"},
}


def changed(base: dict[str, Any], **changes: Any) -> dict[str, Any]:
    """Return a study with sections updated, or replaced where ``shape`` changes; None removes a key."""
    study = copy.deepcopy(base)
    for section, values in changes.items():
        replaced = not isinstance(values, dict) or "shape" in values or section not in study
        study[section] = values if replaced else {**study[section], **values}
        if isinstance(study[section], dict):
            study[section] = {key: value for key, value in study[section].items() if value is not None}
    return study


def small_text(title: str = "small", **changes: Any) -> str:
    """Return the text of the small study with changes; a list is a section of which there are several."""
    lines = [f"title = {json.dumps(title)}"]
    for name, section in changed(_SMALL, **changes).items():
        several = isinstance(section, list)
        for part in section if several else [section]:
            lines.append(f"[[{name}]]" if several else f"[{name}]")
            lines += [f"{key} = {json.dumps(value)}" for key, value in part.items()]
    return "\n".join(lines) + "\n"
