"""`make results` runs each command once, and goes on after the last one that was done."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.helpers.places import ROOT

# Stands for ehar: notes the command and writes its last file, or stops where it is told to. As ehar does, it refuses to
# train a recogniser that is there.
EHAR = r"""#!/bin/sh
told="$*" kind="$1 $2" place="$3" form=causal sensor=perfect views=moving
while [ $# -gt 0 ]; do
  case "$1" in --out|--models|--form|--sensor|--views) eval "${1#--}=\$2";; esac
  shift
done
out=${out:-$models}
[ "$(wc -l < heard)" -lt "${STOP:-1000}" ] || exit 3
echo "$told" >> heard
case "$kind" in
  "train recogniser") file=$out/$form-$sensor-$views.safetensors; [ ! -e "$file" ] || exit 2;;
  "train gain-field") file=$out/gain-field-$sensor-$views.safetensors;;
  "train fixed-best") file=$out/fixed-best-$sensor-$views.json;;
  "train agent") exit;;
  "study scaling") exit;;
  "study overview"|"study paper") file=$out;;
  "study analyse") file=$place/analysis/analysis.md;;
  *) file=$out/table.md;;
esac
mkdir -p "${file%/*}" && echo made > "$file"
for picture in deciding learning positions; do echo > "${file%/*}/$picture.png"; done
"""


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """Return a folder with the Makefile, and an ehar that takes no time."""
    for folder in (".venv/bin", "docs/results"):
        (tmp_path / folder).mkdir(parents=True)
    for name in ("Makefile", "pyproject.toml", "constraints.txt", "docs/worlds.md"):
        shutil.copy(ROOT / name, tmp_path / name)
    (tmp_path / ".venv/.installed").touch()
    (tmp_path / "heard").touch()
    (tmp_path / ".venv/bin/ehar").write_text(EHAR)
    (tmp_path / ".venv/bin/ehar").chmod(0o755)
    return tmp_path


def make(place: Path, *told: str, **variables: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        ["make", "--silent", *told], cwd=place, env=os.environ | variables, capture_output=True, text=True
    )


def test_what_is_done_is_not_run_again(place: Path) -> None:
    done = 0
    for stop in (8, 9, 60, 150, 1000):
        made = make(place, "pages", STOP=str(stop))
        heard = (place / "heard").read_text().splitlines()
        assert (made.returncode == 0) == (stop == 1000), made.stderr
        assert len(heard) > done
        done = len(heard)
    trained = [line for line in heard if line.startswith("train recogniser")]
    assert len(set(trained)) == len(trained) > 30
    runs = [line for line in heard if line.startswith("benchmark")]
    assert len(set(runs)) == len(runs) > 50
    assert make(place, "--question", "pages").returncode == 0, "nothing is left"
    others = make(place, "pages", "SEEDS=5 6")
    assert others.returncode == 0
    asked = (place / "heard").read_text().splitlines()[done:]
    assert [line for line in asked if line.startswith("train ")] == [
        line for line in asked if line.startswith("train agent") and line.endswith("--seeds 5 6")
    ]


def test_a_page_without_its_table_is_an_error_and_leaves_the_page_before(place: Path) -> None:
    assert make(place, "docs/results/headroom.md").returncode == 0
    page = (place / "docs/results/headroom.md").read_text()
    assert page.count("made\n") == 5
    (place / "runs/headroom-solo/table.md").unlink()
    ehar = (place / ".venv/bin/ehar").read_text()
    (place / ".venv/bin/ehar").write_text(ehar.replace('echo made > "$file"', "true"))
    assert make(place, "docs/results/headroom.md").returncode != 0
    assert (place / "docs/results/headroom.md").read_text() == page
