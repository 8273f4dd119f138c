"""One table, in the terminal, in Markdown and in HTML."""

import io

import pytest
from rich.console import Console

from eval.render.tables import Cell, Rendered, Table, html, markdown

TABLE = Table(
    title="Some <table> of oracle*",
    header=("name", "value", "what"),
    rows=(
        ("a*", Cell("1.5", "[1, 2]", 1.5), "some words"),
        (Cell("b & c", value="b"), Cell("-"), "words " * 20),
    ),
    footnotes=("* starred.",),
    bold=frozenset({(0, 1)}),
    slanted=frozenset({1}),
    words=frozenset({2}),
    lower_is_better=frozenset({1}),
)


def printed(width: int) -> str:
    console = Console(width=width, record=True, file=io.StringIO())
    console.print(Rendered(TABLE))
    return console.export_text()


def test_markdown_marks_what_is_bold_and_escapes_stars() -> None:
    lines = markdown(TABLE).splitlines()
    assert lines[0] == r"**Some <table> of oracle\***"
    assert lines[2:5] == ["| name | value | what |", "| --- | --: | --- |", r"| a\* | **1.5 [1, 2]** | some words |"]
    assert lines[-1] == r"\* starred."
    assert markdown(TABLE, TABLE) == markdown(TABLE) + "\n" + markdown(TABLE)


def test_html_holds_what_its_script_sorts_by() -> None:
    page = html(TABLE, sortable=True)
    assert '<table class="sortable"><caption hidden>Some &lt;table&gt; of oracle*</caption>' in page
    assert '<th scope="col" data-better="low"><button type="button">value</button></th>' in page
    assert '<tr><td data-value="a*">a*</td><td data-value="1.5"><strong>1.5</strong>' in page
    assert '<span class="interval">[1, 2]</span>' in page
    assert '<tr class="slanted"><td data-value="b">b &amp; c</td><td data-value="">-</td>' in page
    assert page.endswith('<ul class="notes"><li>* starred.</li></ul>')


def test_html_without_a_script_has_no_buttons_and_shows_its_title() -> None:
    page = html(TABLE)
    assert "<button" not in page
    assert "<caption>Some &lt;table&gt; of oracle*</caption>" in page


@pytest.mark.parametrize("width", [30, 60, 200])
def test_words_go_on_on_the_next_line_in_the_terminal(width: int) -> None:
    text = printed(width)
    assert "…" not in text
    assert "1.5 [1, 2]" in text
    assert text.count("words") == 21
