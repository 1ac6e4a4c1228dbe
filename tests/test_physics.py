"""Sources that forces and error bars depend on do not change unnoticed."""

import ast

from tests import physics


def test_a_change_of_what_forces_depend_on_is_noticed():
    before, now = physics.recorded(), physics.hashes()
    changed = sorted(name for name in before | now if before.get(name) != now.get(name))
    assert not changed, (
        f"Forces or error bars may depend on what changed: {', '.join(changed)}. If the same study now gives another "
        "force or bar, raise PHYSICS_VERSION in pipeline/epsmesh/plan/key.py, so that earlier records are not used. "
        f"Then write the hashes: {physics.COMMAND}"
    )


def test_words_are_no_change_and_numbers_are():
    def text(source: str) -> str:
        return physics.plain(ast.parse(source))

    one = 'def f(x: int) -> int:\n    """Return."""\n    if x:\n        raise ValueError("no")\n    return 2 * x\n'
    other = "def f(x):  # words\n    if x:\n        raise ValueError('never', x)\n\n    return (2 * x)\n"
    assert text(one) == text(other)
    assert text(one) != text(one.replace("2 *", "3 *"))
    assert text(one) != text(one.replace("if x", "if not x"))
