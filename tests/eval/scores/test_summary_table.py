"""The benchmark's table, in the terminal and in Markdown."""

import io
from dataclasses import replace

import pytest
from rich.console import Console

from eval.records.solves import Solves
from eval.render.tables import Rendered, markdown
from eval.scores.summary_table import paper_table
from tests.helpers.made_records import config_of_run, flown, summary_of, three_planners


def test_the_table_marks_who_is_privileged_and_prints_percent() -> None:
    table = summary_of(three_planners()).tables()[0]
    assert "tiny (synthetic)" in table.title
    assert "9 episodes of 4 frames from 5 sequences" in table.title
    assert [row[0] for row in table.rows] == ["no-act", "mine", "oracle*"]
    assert table.rows[2][8] == "100.0 [100.0, 100.0]"
    assert "| oracle\\* |" in markdown(*summary_of(three_planners()).tables())


def test_the_papers_rows_stand_beside_its_data_only() -> None:
    summary = summary_of(three_planners())
    assert paper_table(summary.config.data) is None
    assert len(summary.tables()) == 2
    *_, table = replace(summary, config=replace(summary.config, data="expi")).tables()
    assert table == paper_table("expi")
    assert table is not None
    gaps = {row[0]: row[-1] for row in table.rows}
    # The paper's agent closes 46.4 % on ExPI, its best heuristic 7.0 %.
    assert (gaps["il-ppo"], gaps["v-rotate"], gaps["oracle*"]) == ("46.4", "7.0", "100.0")


def test_fallbacks_are_stated_below_the_table() -> None:
    counted = Solves({"infeasible": 2, "ipopt-fallback": 1, "optimal": 7}, 3)
    summary = summary_of(three_planners(), solves={"no-act": None, "mine": counted, "oracle": None})
    note = "mine: 3 of 10 plans fell back (infeasible 2, ipopt-fallback 1, optimal 7)."
    assert summary.tables()[0].footnotes[-1] == note
    written = summary.to_json()["planners"]
    assert (written[1]["solves"], written[1]["fallback_share"]) == (counted.counts, 0.3)
    assert (written[0]["solves"], written[0]["fallback_share"]) == (None, None)
    clean = Solves({"optimal": 10}, 0)
    without = summary_of(three_planners(), solves={"no-act": None, "mine": clean, "oracle": None})
    assert not [line for line in without.tables()[0].footnotes if "fell back" in line]


def test_the_title_says_whose_probabilities_were_scored_unless_the_recogniser_s() -> None:
    summary = summary_of(three_planners())
    assert "readout" not in summary.tables()[0].title
    believed = summary_of(three_planners(), config_of_run(readout="belief"))
    assert "readout belief, 9 episodes" in believed.tables()[0].title


@pytest.mark.parametrize("width", range(90, 240, 7))
def test_no_cell_is_cut_off_in_a_terminal_of_any_width(width: int) -> None:
    records = {name: flown(episodes) for name, episodes in three_planners().items()}
    console = Console(width=width, record=True, file=io.StringIO())
    console.print(Rendered(*summary_of(records, on_ideal=three_planners()).tables()))
    assert "…" not in console.export_text()
