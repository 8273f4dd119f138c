"""What a failed check of motion data advises: the command that read the files, with other options."""

from dataclasses import dataclass

from ehar.data.preparing.axes import Up


@dataclass(frozen=True)
class ReadWith:
    """How original files were read, for advice.

    Args:
        unit: unit of length: m, cm, mm, or a number of metres.
        up: axis that points up.
        mirror: whether x changed its sign.
        command: the command whose options mend the data.
    """

    unit: str | float = "m"
    up: Up = "z"
    mirror: bool = False
    command: str = "prepare it again with"

    def mend(self, options: str) -> str:
        """Return the command with more options."""
        return f"{self.command} {options}"
