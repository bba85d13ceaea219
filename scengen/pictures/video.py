"""MP4 files. Needs PyAV (`pip install scengen[record]`), whose wheels include FFmpeg."""

from contextlib import nullcontext, suppress
from fractions import Fraction
from pathlib import Path
from types import TracebackType

from ..errors import BadConfig, ScengenError
from .render import Picture

CODEC = "h264"
"""Codec that every browser and every version of LeRobot decodes."""
PIXELS = "yuv420p"
"""Pixel format that every browser and every version of LeRobot decodes."""


class NoVideo(ScengenError):
    """PyAV is missing on this machine."""


def check_size(width: int, height: int) -> None:
    """Raise `BadConfig` unless a video can have this size: colours are stored for squares of 2 x 2 pixels."""
    for name, value in (("width", width), ("height", height)):
        if value < 2 or value % 2:
            raise BadConfig(
                f"{name} = {value}; the width and height of a video must be even numbers, at least 2; choose another"
            )


class Movie:
    """An MP4 file that is being written. Frame k starts exactly at k / fps."""

    def __init__(self, path: Path, fps: int, width: int, height: int, key_every: int = 250):
        """Start a file.

        Args:
            key_every: number of frames per keyframe. With few frames per keyframe, single frames can be read quickly.
                250 is x264's default.

        Raises:
            NoVideo: PyAV is missing.
            BadConfig: the size is odd, or the file cannot be written.
        """
        check_size(width, height)
        try:
            import av
        except ImportError:
            raise NoVideo("no PyAV for MP4 files; run pip install 'scengen[record]'") from None
        self.path, self.fps, self.frames = path, fps, 0
        self._closed = False
        self._encode = av.VideoFrame.from_ndarray
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = av.open(str(path), "w", format="mp4")
        except OSError as error:
            raise BadConfig(f"{path} cannot be written: {error.strerror}") from None
        self._stream = self._file.add_stream("libx264", rate=fps, width=width, height=height, pix_fmt=PIXELS)
        self._stream.codec_context.gop_size = key_every
        # no frame depends on a later one, so that times start at 0; crf 20 looks like the original
        self._stream.options = {"crf": "20", "preset": "veryfast", "bf": "0"}

    def add(self, picture: Picture) -> None:
        """Append one frame."""
        frame = self._encode(picture, format="rgb24")
        frame.pts, frame.time_base = self.frames, Fraction(1, self.fps)
        self._file.mux(self._stream.encode(frame))
        self.frames += 1

    def close(self) -> None:
        """Write the remaining frames and the index, unless this has been tried before."""
        if self._closed:
            return
        self._closed = True
        try:
            self._file.mux(self._stream.encode())
        finally:
            self._file.close()

    def __enter__(self) -> "Movie":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with suppress(OSError) if error else nullcontext():  # the first error counts
            self.close()
