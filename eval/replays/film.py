"""A replay as a film: MP4 (H.264) by the ffmpeg that imageio-ffmpeg brings along, or an animated GIF by Pillow."""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ehar.errors import UsageError
from ehar.files import replacing

FORMATS = (".mp4", ".gif")
HOLD = 1.5  # [s], how long the last frame stays
QUALITY = ("-crf", "20", "-preset", "veryfast", "-tune", "animation", "-movflags", "+faststart")  # of x264
COLOURS = 128  # of a GIF
SHORTEST = 0.02  # [s], the shortest frame of a GIF: browsers show shorter ones for a tenth of a second

Draw = Callable[[int], NDArray[np.uint8]]


def check_film(path: Path) -> None:
    """Raise a UsageError unless a film of this name can be written here."""
    if path.suffix not in FORMATS:
        raise UsageError(f"{path}: expected a film that ends in {' or '.join(FORMATS)}")
    if path.suffix == ".mp4":
        import imageio_ffmpeg  # imported here: a GIF needs none

        try:
            imageio_ffmpeg.get_ffmpeg_exe()
        except RuntimeError as error:
            raise UsageError(f"{path}: expected ffmpeg for an MP4, found none; a .gif needs none") from error


def write_film(draw: Draw, frames: int, fps: float, path: Path) -> None:
    """Write a film.

    Args:
        draw: returns a frame, counted from 0, as pixels (height, width, 3).
        frames: number of frames.
        fps: frames per second. A GIF shows at most 50.
        path: path of the film; its suffix decides the format.

    Raises:
        UsageError: the film cannot be written.
    """
    write = _write_mp4 if path.suffix == ".mp4" else _write_gif
    with replacing(path) as temporary:
        write(draw, frames, fps, temporary)


def _write_mp4(draw: Draw, frames: int, fps: float, path: Path) -> None:
    import imageio_ffmpeg  # imported here: a GIF needs none

    pixels = draw(0)
    height, width, _ = pixels.shape
    film = imageio_ffmpeg.write_frames(
        path, (width, height), fps=fps, codec="libx264", quality=None, output_params=list(QUALITY)
    )
    try:
        film.send(None)
        for frame in range(frames):
            pixels = draw(frame)
            film.send(pixels)
        for _ in range(round(HOLD * fps)):
            film.send(pixels)
    except OSError as error:
        # What ffmpeg printed follows, in many lines.
        raise UsageError(f"{path}: ffmpeg cannot write it: {str(error).splitlines()[0]}") from error
    finally:
        film.close()


def _write_gif(draw: Draw, frames: int, fps: float, path: Path) -> None:
    sample = np.concatenate([draw(frame) for frame in (0, frames // 2, frames - 1)])
    palette = Image.fromarray(sample).quantize(COLOURS)

    def images() -> Iterator[Image.Image]:
        for frame in range(frames):
            yield Image.fromarray(draw(frame)).quantize(palette=palette, dither=Image.Dither.NONE)

    lasts = max(1 / fps, SHORTEST)
    durations = [round(1000 * lasts)] * (frames - 1) + [round(1000 * (lasts + HOLD))]
    film = images()
    next(film).save(path, save_all=True, append_images=film, duration=durations, loop=0)
