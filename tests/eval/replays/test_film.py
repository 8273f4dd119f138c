from pathlib import Path
from typing import Any

import imageio_ffmpeg
import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image, ImageSequence

from ehar.errors import UsageError
from eval.replays.film import HOLD, check_film, write_film

FRAMES, FPS, SHAPE = 5, 12.5, (96, 160, 3)


def draw(frame: int) -> NDArray[np.uint8]:
    """Return a picture with a bar that grows."""
    pixels = np.full(SHAPE, 255, dtype=np.uint8)
    pixels[20:60, : 32 * frame] = (0, 114, 178)
    return pixels


def off(one: NDArray[np.uint8], other: NDArray[np.uint8]) -> float:
    return float(np.abs(one.astype(float) - other).mean())


def test_an_mp4_shows_every_frame_and_holds_the_last(tmp_path: Path) -> None:
    path = tmp_path / "a.mp4"
    write_film(draw, FRAMES, FPS, path)
    frames: Any = imageio_ffmpeg.read_frames(path)
    told = next(frames)
    read = [np.frombuffer(pixels, dtype=np.uint8).reshape(SHAPE) for pixels in frames]
    assert told["size"] == (SHAPE[1], SHAPE[0])
    assert told["fps"] == FPS
    assert told["codec"] == "h264" and told["pix_fmt"].startswith("yuv420p")
    assert len(read) == FRAMES + round(HOLD * FPS)
    for frame, pixels in enumerate(read):
        assert off(pixels, draw(min(frame, FRAMES - 1))) < 4
    assert [file.name for file in tmp_path.iterdir()] == ["a.mp4"]


@pytest.mark.parametrize(("fps", "lasts"), [(FPS, 80), (200.0, 20)])
def test_a_gif_shows_every_frame_and_holds_the_last(tmp_path: Path, fps: float, lasts: int) -> None:
    path = tmp_path / "a.gif"
    write_film(draw, FRAMES, fps, path)
    with Image.open(path) as film:
        assert film.info["loop"] == 0
        durations = []
        for frame, image in enumerate(ImageSequence.Iterator(film)):
            assert off(np.asarray(image.convert("RGB")), draw(frame)) < 4
            durations.append(image.info["duration"])
    assert durations == [lasts] * (FRAMES - 1) + [lasts + 1000 * HOLD]


@pytest.mark.parametrize("name", ["a.avi", "a", "a.MP4"])
def test_other_endings_are_refused(name: str) -> None:
    with pytest.raises(UsageError, match=rf"^{name}: expected a film that ends in .mp4 or .gif$"):
        check_film(Path(name))


def test_without_ffmpeg_there_are_gifs(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing() -> str:
        raise RuntimeError("No ffmpeg exe could be found.")

    monkeypatch.setattr(imageio_ffmpeg, "get_ffmpeg_exe", missing)
    check_film(Path("a.gif"))
    with pytest.raises(UsageError, match=r"^a.mp4: expected ffmpeg for an MP4, found none; a .gif needs none$"):
        check_film(Path("a.mp4"))


@pytest.mark.parametrize("ending", ["mp4", "gif"])
def test_a_place_that_cannot_be_written_to_is_named(tmp_path: Path, ending: str) -> None:
    (tmp_path / "file").touch()
    path = tmp_path / "file" / f"a.{ending}"
    with pytest.raises(UsageError, match=rf"file/.*a.*\.{ending}: (cannot be written|ffmpeg cannot write it): ") as got:
        write_film(draw, FRAMES, FPS, path)
    assert "\n" not in str(got.value)
