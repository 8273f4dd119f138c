from pathlib import Path

ROOT = Path(__file__).parents[2]  # of the project
SHARED = ROOT.parent / "shared" / "data"  # motion data that is not part of it
