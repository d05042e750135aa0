"""Video: frames piped as raw pixels into FFmpeg, which writes MP4 (H.264), GIF or WebP.

The frames go through a short queue and a thread of their own, so that encoding overlaps stepping. MP4 is first written in
fragments, `name.part.mp4`, which play even when the program is killed; on success it is copied, without encoding again, into
a file whose index comes first, and moved to its final name.
"""

import logging
import os
import queue
import shutil
import subprocess
import threading
from collections import deque
from pathlib import Path
from types import TracebackType

import numpy as np

from mpp_taichi.errors import OutputError
from mpp_taichi.recorders._lock import OutputLock

logger = logging.getLogger(__name__)

FORMATS = (".mp4", ".gif", ".webp")
QUEUED_FRAMES = 4  # enough to ride out a slow frame, little enough to hold in memory
MESSAGE_LINES = 6  # of FFmpeg's last words, shown when it fails
STALL_SECONDS = 60.0  # FFmpeg took no frame for so long: it hangs
POLL_SECONDS = 0.2
ADVICE = "a sequence of pictures needs no encoder: --frames FOLDER"


def check_encoder() -> str:
    """The FFmpeg to use: `IMAGEIO_FFMPEG_EXE`, else the one on the path, else the one imageio-ffmpeg brings.

    Raises:
        OutputError: there is none, or it does not start.
    """
    executable = os.environ.get("IMAGEIO_FFMPEG_EXE") or shutil.which("ffmpeg") or _bundled()
    if executable is None:
        raise OutputError(f"no video encoder: neither ffmpeg nor the package imageio-ffmpeg is installed; {ADVICE}")
    try:
        subprocess.run(
            [executable, "-version"], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, timeout=20, check=True
        )
    except (OSError, subprocess.SubprocessError) as error:
        raise OutputError(f"the video encoder {executable} does not start: {error}; {ADVICE}") from error
    return executable


def _bundled() -> str | None:
    try:
        import imageio_ffmpeg  # an optional dependency, only looked for when a film is made
    except ImportError:
        return None
    try:
        return str(imageio_ffmpeg.get_ffmpeg_exe())
    except RuntimeError:
        return None


class VideoRecorder:
    """Writes frames to a film; a context manager. The file appears under its name only when it is whole.

    On an exception in its block the recorder keeps what was written, as `name.part.mp4` (MP4 only).
    """

    def __init__(self, path: str | Path, size: tuple[int, int], fps: float) -> None:
        """Start the encoder for frames of (width, height) pixels, `fps` of them a second of film.

        Raises:
            OutputError: no encoder, a suffix that is none of `FORMATS`, a folder that cannot be written, or the same file
                is being written by another run.
        """
        self.path, self.size, self.fps = Path(path), size, fps
        suffix = self.path.suffix.lower()
        if suffix not in FORMATS:
            raise OutputError(f"{self.path}: the video format {suffix!r} is none of {', '.join(FORMATS)}")
        self._part = self.path.with_name(f"{self.path.stem}.part{suffix}")
        self._executable = check_encoder()
        self.frame_count = 0
        self._lines: deque[str] = deque(maxlen=MESSAGE_LINES)
        self._queue: queue.Queue[np.ndarray | None] = queue.Queue(QUEUED_FRAMES)
        self._failed = threading.Event()
        self._closed = False
        self._lock = OutputLock(self.path)
        try:
            self._process = subprocess.Popen(
                encoder_command(self._executable, self._part, size, fps),
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
            )
        except OSError as error:
            self._lock.release()
            raise OutputError(f"{self.path}: cannot start the video encoder {self._executable}: {error}; {ADVICE}") from error
        self._listener = threading.Thread(target=self._listen, name="ffmpeg messages", daemon=True)
        self._writer = threading.Thread(target=self._feed, name="ffmpeg frames", daemon=True)
        self._listener.start()
        self._writer.start()

    def __enter__(self) -> "VideoRecorder":
        """The recorder itself."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        """Finish the film; after an exception leave what there is, and let that exception be the one that is seen."""
        if kind is None:
            self.close()
        else:
            self.abandon()

    def write(self, picture: np.ndarray) -> None:
        """Add one frame: uint8, shape (height, width, 3). Waits when the encoder lags behind.

        Raises:
            OutputError: the encoder ended, or took no frame for a minute.
        """
        width, height = self.size
        if picture.shape != (height, width, 3) or picture.dtype != np.uint8:
            raise ValueError(f"a frame of this film is uint8 {(height, width, 3)}, not {picture.dtype} {picture.shape}")
        self._put(np.array(picture, order="C"))  # a copy: the caller may draw the next frame into the same array
        self.frame_count += 1

    def close(self) -> None:
        """Finish the film and give it its name."""
        if self._closed:
            return
        try:
            if self.frame_count == 0:
                raise OutputError(f"{self.path}: not one frame was written")
            self._put(None)
            self._wait()
            self._finish()
        finally:
            self.abandon()

    def abandon(self) -> None:
        """End the encoder at once, keeping the fragments it wrote; harmless after `close`."""
        if self._closed:
            return
        self._closed = True
        self._failed.set()
        if self._process.poll() is None and self.frame_count > 0:
            self._end_input()
        try:
            self._process.wait(timeout=POLL_SECONDS if self.frame_count == 0 else 5.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._listener.join()
        self._lock.release()
        if self._part.exists() and self._part.suffix.lower() != ".mp4":
            self._part.unlink()

    def _end_input(self) -> None:
        """Let the writer thread close the pipe, so that the encoder ends its last fragment."""
        try:
            while True:
                self._queue.get_nowait()
        except queue.Empty:
            self._queue.put(None)

    def _put(self, picture: np.ndarray | None) -> None:
        waited = 0.0
        while True:
            if self._failed.is_set():
                raise self._failure()
            try:
                self._queue.put(picture, timeout=POLL_SECONDS)
                return
            except queue.Full:
                waited += POLL_SECONDS
            if waited >= STALL_SECONDS:
                self._process.kill()
                raise OutputError(f"{self.path}: the video encoder took no frame for {waited:.0f} s and was ended; {ADVICE}")

    def _wait(self) -> None:
        """Wait until every queued frame is written and the encoder has ended well."""
        self._writer.join(timeout=STALL_SECONDS)
        try:
            code = self._process.wait(timeout=STALL_SECONDS)
        except subprocess.TimeoutExpired as error:
            self._process.kill()
            raise OutputError(f"{self.path}: the video encoder did not finish within {STALL_SECONDS:.0f} s; {ADVICE}") from error
        if code != 0 or self._failed.is_set():
            raise self._failure()

    def _finish(self) -> None:
        try:
            if self._part.suffix.lower() == ".mp4":
                final = self.path.with_name(f"{self.path.stem}.final{self.path.suffix}")
                self._run([self._executable, *QUIET, "-i", f"file:{self._part}", *COPY, f"file:{final}"])
                os.replace(final, self.path)
                self._part.unlink()
            else:
                os.replace(self._part, self.path)
        except OSError as error:
            raise OutputError(f"{self.path}: cannot write the video: {error.strerror or error}; it is kept as {self._part}") from error

    def _run(self, command: list[str]) -> None:
        done = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, check=False)
        if done.returncode != 0:
            message = done.stderr.decode("utf-8", "replace").strip().splitlines()[-MESSAGE_LINES:]
            raise OutputError(f"{self.path}: cannot finish the video; it is kept as {self._part}: " + " | ".join(message))

    def _failure(self) -> OutputError:
        self._process.kill()  # it failed, or its pipe did; either way nothing more can come of it
        code = self._process.wait()
        self._listener.join()
        message = " | ".join(self._lines) or f"it ended with code {code} and said nothing"
        return OutputError(f"{self.path}: the video encoder failed after {self.frame_count} frames: {message}; {ADVICE}")

    def _feed(self) -> None:
        """The writer thread: frames from the queue into the pipe."""
        assert self._process.stdin is not None
        try:
            with self._process.stdin as pipe:
                while (picture := self._queue.get()) is not None:
                    pipe.write(picture.data)
        except (OSError, ValueError) as error:
            logger.debug("the pipe to the video encoder broke: %s", error)
            self._failed.set()

    def _listen(self) -> None:
        """The listener thread: what the encoder says, or it would stop when the pipe is full."""
        assert self._process.stderr is not None
        with self._process.stderr as pipe:
            for line in pipe:
                self._lines.append(line.decode("utf-8", "replace").strip())


QUIET = ["-hide_banner", "-loglevel", "error", "-nostdin", "-y"]
COPY = ["-c", "copy", "-movflags", "+faststart"]
# H.264 in 4:2:0, which every browser and player shows, has even sizes only; padding keeps every pixel where a rescale blurs.
EVEN = "pad=ceil(iw/2)*2:ceil(ih/2)*2"
PALETTE = "split[a][b];[a]palettegen=stats_mode=diff[p];[b][p]paletteuse=dither=bayer:bayer_scale=4:diff_mode=rectangle"


def encoder_command(executable: str, output: Path, size: tuple[int, int], fps: float) -> list[str]:
    """The command that reads raw frames on its standard input; the suffix of `output` chooses the format."""
    width, height = size
    source = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-video_size", f"{width}x{height}", "-framerate", f"{fps:g}", "-i", "pipe:0"]
    encoding = {
        ".mp4": ["-vf", EVEN, "-c:v", "libx264", "-pix_fmt", "yuv420p", "-crf", "18", "-preset", "fast"]
        + ["-movflags", "+frag_keyframe+empty_moov+default_base_moof"],
        ".gif": ["-filter_complex", PALETTE, "-loop", "0"],
        ".webp": ["-c:v", "libwebp_anim", "-quality", "80", "-loop", "0"],
    }[output.suffix.lower()]
    return [executable, *QUIET, *source, "-an", *encoding, f"file:{output}"]
