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
import sys
import tempfile
import threading
from collections import deque
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from mpp_taichi.atomic_file import fresh
from mpp_taichi.device.thread_count import start_thread
from mpp_taichi.errors import OutputError
from mpp_taichi.missing_package import is_absent, missing_line
from mpp_taichi.passport.carried import stamp
from mpp_taichi.recorders._lock import OutputLock
from mpp_taichi.recorders._stall import STALL_SECONDS, ends_in_time

logger = logging.getLogger(__name__)

FORMATS = (".mp4", ".gif", ".webp")
QUEUED_FRAMES = 4  # enough for a slow frame, few enough to hold in memory
MESSAGE_LINES = 6  # last lines of FFmpeg's messages, shown when it fails
FAREWELL_SECONDS = 5.0  # for FFmpeg to end by itself
POLL_SECONDS = 0.2
ADVICE = "a sequence of pictures needs no encoder: --frames FOLDER"


def check_encoder(suffix: str = ".mp4") -> str:
    """The FFmpeg that writes films with this suffix.

    It is the program named by `IMAGEIO_FFMPEG_EXE`, which is only started, not examined. Without that variable it is the first
    FFmpeg that lists the codec of the format: first the FFmpeg of the package imageio-ffmpeg, whose version is known, then the
    FFmpeg on the path, whose version and codecs differ from machine to machine.

    Raises:
        OutputError: no FFmpeg is installed, none starts, or none has the codec.
    """
    named = os.environ.get("IMAGEIO_FFMPEG_EXE")
    if named:
        _ask(named, "-version")
        return named
    installed = [each for each in (_bundled(), shutil.which("ffmpeg")) if each is not None]
    if not installed:
        raise OutputError(f"no video encoder: there is no ffmpeg, and {_why_none_is_bundled()}; {ADVICE}")
    codec, faults = CODECS[suffix.lower()], list[str]()
    for executable in dict.fromkeys(installed):
        try:
            if codec in _ask(executable, "-encoders").split():
                return executable
            faults.append(f"the video encoder {executable} cannot write {suffix}, it has no codec {codec}; {ADVICE}")
        except OutputError as error:
            faults.append(str(error))
    raise OutputError(faults[0])


def _ask(executable: str, question: str) -> str:
    """The answer of an FFmpeg to an option; OutputError where it does not start."""
    try:
        done = subprocess.run(
            [executable, question, "-hide_banner"],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            timeout=20,
            check=True,
        )
    except (OSError, subprocess.SubprocessError) as error:
        raise OutputError(f"the video encoder {executable} does not start: {error}; {ADVICE}") from error
    return done.stdout.decode("utf-8", "replace")


def _why_none_is_bundled() -> str:
    """Why imageio-ffmpeg gives no FFmpeg: the package is missing, or it has none for this system."""
    missing = is_absent("imageio_ffmpeg")
    return missing_line("imageio_ffmpeg") if missing else "imageio-ffmpeg has none that starts on this machine"


def _bundled() -> str | None:
    """The FFmpeg of the package imageio-ffmpeg; where the package has none for this system, it names another."""
    try:
        import imageio_ffmpeg  # imported only when a film is made
    except ImportError:
        return None
    try:
        return str(imageio_ffmpeg.get_ffmpeg_exe())
    except RuntimeError:
        return None


class VideoRecorder:
    """Writes frames to a film; a context manager. The file appears under its name only when it is whole.

    On an exception in its block the recorder keeps the frames written so far, as `name.part.mp4` (MP4 only).
    """

    def __init__(self, path: str | Path, size: tuple[int, int], fps: float) -> None:
        """Start the encoder for frames of (width, height) pixels, `fps` of them a second of film.

        Raises:
            OutputError: no encoder, a suffix that is none of `FORMATS`, a folder that cannot be written, or the same file
                is being written by another run.
            CapacityError: the system starts no threads for it.
        """
        self.path, self.size, self.fps = Path(path), size, fps
        suffix = self.path.suffix.lower()
        if suffix not in FORMATS:
            raise OutputError(f"{self.path}: the video format {suffix!r} is none of {', '.join(FORMATS)}")
        self._part = self.path.with_name(f"{self.path.stem}.part{PART_SUFFIX[suffix]}")
        self._executable = check_encoder(suffix)
        self.frame_count = 0
        self._lines: deque[str] = deque(maxlen=MESSAGE_LINES)
        self._queue: queue.Queue[np.ndarray | None] = queue.Queue(QUEUED_FRAMES)
        self._failed = threading.Event()
        self._closed = False
        self._lock = OutputLock(self.path)
        try:
            self._process = subprocess.Popen(
                encoder_command(self._executable, fresh(self._part), size, fps),
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                **OWN_GROUP,
            )
        except OSError as error:
            self._lock.release()
            raise OutputError(f"{self.path}: cannot start the video encoder {self._executable}: {error}; {ADVICE}") from error
        self._listener = threading.Thread(target=self._listen, name="ffmpeg messages", daemon=True)
        self._writer = threading.Thread(target=self._feed, name="ffmpeg frames", daemon=True)
        try:
            start_thread(self._listener)
            start_thread(self._writer)
        except BaseException:
            self._give_up()
            raise

    def __enter__(self) -> "VideoRecorder":
        """The recorder itself."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        """Finish the film; after an exception keep the frames written so far, and let the exception pass."""
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
        """Finish the film and give it its name.

        Raises:
            OutputError: the encoder failed, the disk is full, or not one frame was written.
        """
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
        """End the encoder, keeping the fragments it wrote under the name with `.part`; harmless after `close`."""
        if self._closed:
            return
        self._closed = True
        try:
            while True:
                self._queue.get_nowait()
        except queue.Empty:
            self._queue.put(None)  # the writer closes the pipe, and the encoder ends its last fragment
        self._end(FAREWELL_SECONDS)
        self._writer.join()
        self._listener.join()
        if self.frame_count == 0 or (self._part.exists() and self._part.stat().st_size == 0):
            self._part.unlink(missing_ok=True)
        self._lock.release()

    def _give_up(self) -> None:
        """End an encoder that was given no frame, and leave nothing of it."""
        self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stderr):
            if pipe is not None:
                pipe.close()
        self._part.unlink(missing_ok=True)
        self._closed = True
        self._lock.release()

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
        if not ends_in_time(self._process, self._part, STALL_SECONDS):
            raise OutputError(f"{self.path}: the video encoder wrote nothing for {STALL_SECONDS:.0f} s and was ended; {ADVICE}")
        self._writer.join()
        if self._process.returncode != 0 or self._failed.is_set():
            raise self._failure()

    def _finish(self) -> None:
        """Make the final file from the fragments, and move it to its name."""
        whole = self.path.with_name(f"{self.path.stem}.whole{self.path.suffix}")
        palette = self.path.with_name(f"{self.path.stem}.palette.png")
        try:
            commands = finishing_commands(self._executable, self._part, whole, palette)
            for temporary in (whole, palette)[: len(commands)]:
                fresh(temporary)
            for command in commands:
                self._run(command)
            stamp(whole if commands else self._part)
            os.replace(whole if commands else self._part, self.path)
            self._part.unlink(missing_ok=True)
        except OSError as error:
            raise OutputError(
                f"{self.path}: cannot write the video: {error.strerror or error}; it is kept as {self._part}"
            ) from error
        finally:
            whole.unlink(missing_ok=True)
            palette.unlink(missing_ok=True)

    def _run(self, command: list[str]) -> None:
        with tempfile.TemporaryFile() as told:
            quiet = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": told}
            with subprocess.Popen(command, **quiet) as process:  # type: ignore[call-overload]
                try:
                    in_time = ends_in_time(process, Path(command[-1].removeprefix("file:")), STALL_SECONDS)
                except BaseException:
                    process.kill()
                    raise
            told.seek(0)
            lines = told.read().decode("utf-8", "replace").strip().splitlines()[-MESSAGE_LINES:]
        if not in_time:
            lines = [f"the video encoder wrote nothing for {STALL_SECONDS:.0f} s and was ended"]
        if not in_time or process.returncode != 0:
            said = " | ".join(lines) or _silent_end(process.returncode)
            raise OutputError(f"{self.path}: cannot finish the video; it is kept as {self._part}: {said}")

    def _failure(self) -> OutputError:
        self._end(FAREWELL_SECONDS)  # the pipe broke; the last messages may not have arrived yet
        self._listener.join()
        message = " | ".join(self._lines) or _silent_end(self._process.returncode)
        return OutputError(f"{self.path}: the video encoder failed after {self.frame_count} frames: {message}; {ADVICE}")

    def _end(self, seconds: float) -> None:
        try:
            self._process.wait(timeout=seconds)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

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
        """The listener thread: reads the messages of the encoder, which would stop if the pipe were full."""
        assert self._process.stderr is not None
        with self._process.stderr as pipe:
            for line in pipe:
                self._lines.append(line.decode("utf-8", "replace").strip())


def _silent_end(code: int) -> str:
    """What is known of an encoder that ended and said nothing; code −9 is a signal of POSIX that no program can answer."""
    more = "because another program or the system killed it" if code == -9 else "without a message"
    return f"it ended with code {code}, {more}"


# Outside the terminal's process group: a Ctrl-C then stops the simulation, which closes the film.
OWN_GROUP: dict[str, Any] = {"start_new_session": True}
if sys.platform == "win32":
    OWN_GROUP = {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP}

QUIET = ["-hide_banner", "-loglevel", "error", "-nostdin", "-y"]
PART_SUFFIX = {".mp4": ".mp4", ".gif": ".mkv", ".webp": ".webp"}  # a GIF needs its palette first, hence a lossless copy
CODECS = {".mp4": "libx264", ".gif": "libx264rgb", ".webp": "libwebp_anim"}
# H.264 in 4:2:0, which every browser and player shows, has even sizes only; padding keeps every pixel, scaling would blur.
EVEN = "pad=ceil(iw/2)*2:ceil(ih/2)*2"
# Converted to BT.709 and tagged with it: players guess the matrix of an untagged film from its size, and colours shift.
COLOR_TAGS = ["-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "bt709", "-color_range", "tv"]
# The preset is the cheapest whose films are as near to the frames as those of slower presets, at a size that differs little.
ENCODING = {
    ".mp4": [
        "-vf",
        f"{EVEN},scale=out_color_matrix=bt709:out_range=tv",
        *COLOR_TAGS,
        "-c:v",
        CODECS[".mp4"],
        "-pix_fmt",
        "yuv420p",
        "-crf",
        "16",
        "-preset",
        "veryfast",
    ]
    + ["-movflags", "+empty_moov+default_base_moof", "-frag_duration", "500000"],
    ".mkv": ["-c:v", CODECS[".gif"], "-qp", "0", "-preset", "ultrafast"],
    ".webp": ["-c:v", CODECS[".webp"], "-quality", "80", "-loop", "0"],
}


def encoder_command(executable: str, part: Path, size: tuple[int, int], fps: float) -> list[str]:
    """The command that reads raw frames on its standard input; the suffix of `part` chooses the encoding."""
    source = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-video_size", f"{size[0]}x{size[1]}", "-framerate", repr(float(fps))]
    return [executable, *QUIET, *source, "-i", "pipe:0", "-an", *ENCODING[part.suffix], f"file:{part}"]


def finishing_commands(executable: str, part: Path, whole: Path, palette: Path) -> list[list[str]]:
    """The commands that make the final file: an index in front for MP4, the best 256 colours for GIF; none for WebP."""
    given, start = ["-i", f"file:{part}"], [executable, *QUIET]
    if part.suffix == ".webp":
        return []
    if part.suffix == ".mp4":
        return [[*start, *given, "-c", "copy", "-movflags", "+faststart", f"file:{whole}"]]
    use = "paletteuse=dither=bayer:bayer_scale=4:diff_mode=rectangle"
    return [
        [*start, *given, "-vf", "palettegen=stats_mode=diff", f"file:{palette}"],
        [*start, *given, "-i", f"file:{palette}", "-lavfi", use, "-loop", "0", f"file:{whole}"],
    ]
