"""The words of docs/*.md: evidence is counted apart, text is limited."""

from tools.count_words import LIMIT, WRITTEN, Words, pages, words


def test_parts_that_scripts_write_are_counted_apart() -> None:
    text = "# A page\n<!-- one -->\n| a | b |\n<!-- end one -->\nread\n<!-- ik: two -->\n1 2 3\n<!-- end ik: two -->\n"
    assert words(text) == Words(text=4, evidence=len(text.split()) - 4)


def test_folded_tables_are_evidence() -> None:
    assert words("before\n<details><summary>of it</summary>\n| 1 | 2 |\n</details>\nafter\n").text == 2


def test_a_part_without_an_end_is_text() -> None:
    assert words("<!-- open -->\nsome words\n").evidence == 0


def test_every_page_has_words() -> None:
    assert min(counted.text for name, counted in pages().items() if name not in WRITTEN) > 20


def test_the_pages_have_no_more_words_than_the_limit() -> None:
    assert sum(counted.text for counted in pages().values()) <= LIMIT
