"""Pages of the site that are made: of notebooks, of files elsewhere in the repository, of docstrings, of tables."""

import json
import re
from dataclasses import dataclass
from importlib import import_module

from tests.messages import names, raises_naming
from tools.reference import citations, copies, notebooks, scene_fields
from tools.reference.docstrings import docstring
from tools.reference.python_api import PARTS, page, signature
from tripod_sim.simulation import Simulation
from tripod_sim.tables.fields import number


def test_a_notebook_shows_texts_programs_what_they_say_and_draw() -> None:
    cells = [
        {"cell_type": "markdown", "source": ["# Title\n", "text"]},
        {
            "cell_type": "code",
            "source": "print(1)",
            "outputs": [{"output_type": "stream", "text": ["1\n", "2\n"]}],
        },
        {
            "cell_type": "code",
            "source": "draw()",
            "outputs": [{"data": {"image/png": "QUJD\n", "text/plain": "<F>"}}],
        },
    ]
    text = notebooks.markdown(json.dumps({"cells": cells}))
    assert text.startswith(
        "# Title\ntext\n\n```python\nprint(1)\n```\n\n```\n1\n2\n```\n\n```python\ndraw()\n```\n"
    )
    assert "](data:image/png;base64,QUJD)" in text
    assert "<F>" not in text


def test_links_of_the_readme_lead_to_pages_of_the_site() -> None:
    text = copies.copied("index.md")
    assert "](docs/" not in text
    assert "](commands.md)" in text
    assert "](project/changelog.md)" in text


def test_docstrings_are_taken_apart() -> None:
    def function() -> None:
        """Do it.

        Args:
            a, b: Both of
                these.
            c: [m].
            d,
                e: Both.

        Returns:
            What is
            left.
        """

    parts = docstring(function)
    assert parts.prose == "Do it."
    assert parts.named["Args"] == {
        "a": "Both of these.",
        "b": "Both of these.",
        "c": "[m].",
        "d": "Both.",
        "e": "Both.",
    }
    assert parts.free == {"Returns": "What is left."}


def test_fields_of_scenes_have_unit_range_and_text() -> None:
    page = scene_fields.page()
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in page.splitlines()]
    texts = [row[4] for row in rows if row[:4] == ["`poisson`", "`0.45`", "", "0 to 0.499"]]
    assert any(names(text, "Nu") for text in texts)
    assert "## servo_dynamics" in page
    assert "\\|" not in page.split("## The scene itself")[0]


def test_a_field_without_a_text_is_named() -> None:
    @dataclass(frozen=True)
    class Table:
        """A table."""

        width: float = number(1.0, unit="m")

    with raises_naming(ValueError, "Table.width", "text"):
        list(scene_fields._table(Table, list(Table.__dataclass_fields__.values())))


def test_signatures_have_their_types() -> None:
    def function(a: int, *, b: str = "x") -> float:
        return float(len(b) + a)

    parameters, _, returned = signature(function).rpartition(" -> ")
    assert parameters.removeprefix("(").removesuffix(")").split(", ") == ["a: int", "*", "b: str = 'x'"]
    assert returned == "float"
    assert signature(Simulation.save) == "() -> tuple[State, FloatArray]"


def test_citations_lead_to_the_list_of_references() -> None:
    known = citations.keys("- **[Hughes1987]** T. J. R. Hughes\n- **[Bey1995]** J. Bey")
    assert known == {"Hughes1987", "Bey1995"}
    text = "Mass [Hughes1987, section 7], [Other2000].\n\n```\n[Bey1995]\n```\n"
    made = citations.linked(text, "reference/python.md", known)
    assert "[[Hughes1987, section 7]](../references.md#Hughes1987), [Other2000]." in made
    assert "\n[Bey1995]\n" in made
    assert citations.anchored("- **[Bey1995]** J. Bey") == '- <a id="Bey1995"></a>**[Bey1995]** J. Bey'


def test_the_page_of_the_library_imports_names_from_where_they_are() -> None:
    """A strict type checker refuses a name that a module has only imported itself."""
    named = [(m, name) for _, _, modules in PARTS for m, names in modules.items() for name in names]
    homes = [(m, getattr(import_module(m), name).__module__, name) for m, name in named]
    assert not [
        (m, home, name)
        for m, home, name in homes
        if home != m and name not in getattr(import_module(m), "__all__", ())
    ]


def test_the_page_of_the_library_has_what_is_computed_once_what_is_inherited_and_choices() -> None:
    text = page()
    for told in ("- **`jacobian`**: ", "- **`topics`**: ", "#### State.copy\n", "One of `Outcome.REACHED`, "):
        assert told in text


def test_the_page_of_the_library_tells_where_each_error_comes_from() -> None:
    text = page()
    raised = re.findall(r"\b(?:Scene|Step|Film|Record|Ik|Play|Calibration)Error\b", text)
    assert len(set(raised)) == 7
    assert not [name for name in set(raised) if f"\n### {name}\n" not in text]
