import pytest

from eval.cli.main import main


def fails_with(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """Return the one line that a command ends in, on standard error, with exit code 2."""
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == 2
    out, line = capsys.readouterr()
    assert out == ""
    assert line.startswith("ehar: error: ")
    assert line.count("\n") == 1
    return line
