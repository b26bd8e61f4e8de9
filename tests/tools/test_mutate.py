"""Mutants: each is one change of what is computed, drawn alike from the same seed; their tests are there."""

from itertools import islice

from tests.messages import assert_names, raises_naming
from tools import mutate

SOURCE = '''"""Doc 1 + 2."""
LIMIT: float = 1e-7
x = np.zeros(3)
def f(a: int = 2) -> bool:
    """1 < 2"""
    a += max(-a * LIMIT, a**2) if a <= 0 and True else x[1]
    raise ValueError(f"{a + 1}")
'''


def test_what_is_computed_is_changed_and_nothing_else() -> None:
    found = [(m.line, m.before, m.after) for m in mutate.mutants("a.py", SOURCE)]
    assert sorted(found) == sorted(
        [
            (2, "1e-7", repr(1.1 * 1e-7)),
            (4, "2", "1"), (6, "+=", "-="), (6, "max", "min"), (6, "-", ""), (6, "*", "/"),
            (6, "2", "1"), (6, "<=", ">"), (6, "0", "1"), (6, "and", "or"), (6, "True", "False"), (6, "1", "0"),
        ]
    )  # fmt: skip
    for mutant in mutate.mutants("a.py", SOURCE):
        changed = mutant.apply(SOURCE)
        compile(changed, "a.py", "exec")
        lines = zip(SOURCE.splitlines(), changed.splitlines(), strict=True)
        assert [k for k, (a, b) in enumerate(lines, start=1) if a != b] == [mutant.line]


def test_a_mutant_of_another_source_is_refused() -> None:
    with raises_naming(ValueError, "a.py:2", "'1e-7'", "column 15"):
        mutate.Mutant("a.py", 2, 15, "1e-7", "1").apply("a = 1\nb = 2\n")


def test_a_seed_draws_the_same_and_none_twice() -> None:
    sources = {"a.py": SOURCE, "b.py": "y = 1 + 2\n"}
    drawn = list(mutate.draw(sources, 3))
    assert drawn == list(mutate.draw(sources, 3))
    assert drawn != list(mutate.draw(sources, 4))
    assert len(set(drawn)) == len(drawn) == 12 + 3
    assert list(islice(mutate.draw(sources, 3), 5)) == drawn[:5]


def test_each_file_and_its_tests_exist() -> None:
    for file in mutate.TESTS:
        assert mutate.mutants(file, (mutate.ROOT / file).read_text(encoding="utf-8")), file
        for test in mutate.test_files(file):
            assert (mutate.ROOT / test).is_file(), test


def test_results_are_read_again_and_survivors_are_named(tmp_path, capsys) -> None:  # type: ignore[no-untyped-def]
    one, two = mutate.Mutant("a.py", 1, 2, "+", "-"), mutate.Mutant("a.py", 3, 4, "0", "1")
    file = tmp_path / "results"
    file.write_text(mutate.row(one, None) + mutate.row(two, None) + mutate.row(one, "tests/a.py::b"))
    known = mutate.read_results(file)
    assert known == {one: "tests/a.py::b", two: None}
    assert mutate.tell([one, two], known) == 1
    killed, survivor = capsys.readouterr().out.splitlines()
    assert_names(killed, "killed 1 of 2", "survivors")
    assert_names(survivor, "a.py:3:5", "0 -> 1")
    assert mutate.tell([one], known) == 0
