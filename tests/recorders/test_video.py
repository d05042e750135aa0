"""Films: every film plays, and a broken encoder affects the film alone."""

import os
import re
import signal
import stat
import subprocess
import sys
import textwrap
import threading
import time
from pathlib import Path

import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image, ImageSequence

from mpp_taichi.errors import OutputError
from mpp_taichi.recorders import video
from mpp_taichi.recorders.frames import FrameRecorder
from mpp_taichi.recorders.video import VideoRecorder, check_encoder

ENVIRONMENT = os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])}
SIZE = (160, 120)


def picture(index: int, size: tuple[int, int] = SIZE) -> np.ndarray:
    """A yellow block that moves to the right by four pixels a frame, on blue."""
    result = np.empty((size[1], size[0], 3), np.uint8)
    result[:] = (20, 40, 120)
    result[40:80, 4 * index : 4 * index + 40] = (250, 200, 20)
    return result


def decode(path: Path, frame_shape: tuple[int, int]) -> np.ndarray:
    """Every frame of a film, shape (frame_count, height, width, 3).

    The decoders come with the packages of the tests. The FFmpeg of a machine may have any version, and old versions read no
    animated WebP.
    """
    if path.suffix.lower() in (".gif", ".webp"):
        with Image.open(path) as film:
            return np.stack([np.asarray(frame.convert("RGB")) for frame in ImageSequence.Iterator(film)])
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", "-nostdin", "-i", f"file:{path}", "-f", "rawvideo"]
    command += ["-pix_fmt", "rgb24", "-fps_mode", "passthrough", "pipe:1"]
    raw = subprocess.run(command, capture_output=True, check=True).stdout
    return np.frombuffer(raw, np.uint8).reshape(-1, frame_shape[1], frame_shape[0], 3)


def describe(path: Path) -> str:
    """What FFmpeg says about a file."""
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-hide_banner", "-i", f"file:{path}"]
    return subprocess.run(command, capture_output=True, text=True).stderr


def block_center(frame: np.ndarray) -> float:
    """Mean column of the yellow block."""
    return float(np.nonzero(frame[60, :, 0] > 135)[0].mean())


def fake_encoder(folder: Path, body: str) -> str:
    """A program that answers `-version` as FFmpeg does and otherwise runs `body`."""
    script = folder / "fake_ffmpeg"
    start = f"#!{sys.executable}\nimport sys, time, os, signal\nif '-version' in sys.argv:\n    sys.exit(0)\n"
    script.write_text(start + textwrap.dedent(body), encoding="utf-8")
    script.chmod(script.stat().st_mode | stat.S_IXUSR)
    return str(script)


@pytest.mark.parametrize("suffix", [".mp4", ".gif", ".webp"])
def test_every_frame_is_in_the_film_and_moves(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"film{suffix}"
    with VideoRecorder(path, SIZE, 30) as recorder:
        for index in range(25):
            recorder.write(picture(index))
    frames = decode(path, SIZE)
    assert len(frames) == 25
    for index in (0, 12, 24):
        assert block_center(frames[index]) == pytest.approx(4 * index + 19.5, abs=1.5)
    assert os.listdir(tmp_path) == [path.name], "neither lock nor part is left"


def test_colors_survive(tmp_path: Path) -> None:
    path = tmp_path / "film.mp4"
    with VideoRecorder(path, SIZE, 30) as recorder:
        recorder.write(picture(10))
    (frame,) = decode(path, SIZE)
    np.testing.assert_allclose(frame[60, 60], (250, 200, 20), atol=4)
    np.testing.assert_allclose(frame[10, 10], (20, 40, 120), atol=4)


def shaded_discs(index: int, size: tuple[int, int]) -> np.ndarray:
    """Thirty discs in motion on black, each lighter on the left, among points of light that stay."""
    random, (width, height) = np.random.default_rng(3), size
    result = np.where(random.random((height, width, 1)) < 3e-3, random.random((height, width, 3)), 0.02)
    rows, columns = np.mgrid[:height, :width]
    for x, y, radius, vx, vy, *color in random.random((30, 8)):
        radius = 3 + 20 * radius
        right, down = columns - width * x - 6 * index * (vx - 0.5), rows - height * y - 6 * index * (vy - 0.5)
        inside = right**2 + down**2 < radius**2
        result[inside] = (0.6 - 0.4 * right[inside] / radius)[:, None] * np.array(color)
    return np.uint8(255 * np.clip(result, 0, 1))


def likeness(film: Path, pictures: list[np.ndarray]) -> float:
    """FFmpeg's SSIM of the brightness of a film and its pictures."""
    height, width, _ = pictures[0].shape
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-hide_banner", "-i", f"file:{film}", "-f", "rawvideo", "-pix_fmt", "rgb24"]
    command += ["-video_size", f"{width}x{height}", "-framerate", "30", "-i", "pipe:0", "-f", "null", "-"]
    taken = "[1:v]scale=out_color_matrix=bt709:out_range=tv,format=yuv420p[given];[0:v][given]ssim"
    command[-3:-3] = ["-lavfi", taken]
    told = subprocess.run(command, input=b"".join(map(bytes, pictures)), capture_output=True, check=True).stderr.decode()
    found = re.search(r"SSIM Y:([\d.]+)", told)
    assert found is not None, told
    return float(found[1])


def test_a_film_is_as_near_to_its_frames_as_one_by_a_slow_preset(tmp_path: Path) -> None:
    pictures = [shaded_discs(index, (640, 360)) for index in range(20)]
    with VideoRecorder(tmp_path / "film.mp4", (640, 360), 30) as recorder:
        for each in pictures:
            recorder.write(each)
    command = video.encoder_command(check_encoder(), tmp_path / "slow.mp4", (640, 360), 30)
    for option, value in (("-preset", "medium"), ("-crf", "18")):
        command[command.index(option) + 1] = value
    subprocess.run(command, input=b"".join(map(bytes, pictures)), check=True)
    films = [tmp_path / "film.mp4", tmp_path / "slow.mp4"]
    ours, slow = (likeness(film, pictures) for film in films)
    assert ours > slow - 1e-3 and ours > 0.98
    assert films[0].stat().st_size < 1.4 * films[1].stat().st_size


def test_mp4_plays_everywhere(tmp_path: Path) -> None:
    path = tmp_path / "film.mp4"
    with VideoRecorder(path, SIZE, 24) as recorder:
        for index in range(10):
            recorder.write(picture(index))
    facts = describe(path)
    assert "h264" in facts and "yuv420p" in facts and "24 fps" in facts
    data = path.read_bytes()
    assert 0 < data.index(b"moov") < data.index(b"mdat"), "the index comes first, so that a browser starts at once"
    assert b"moof" not in data, "no fragments are left"


@pytest.mark.parametrize("size", [(161, 121), (161, 120), (160, 121)])
def test_odd_sizes_are_padded_to_even_ones(tmp_path: Path, size: tuple[int, int]) -> None:
    path = tmp_path / "film.mp4"
    with VideoRecorder(path, size, 30) as recorder:
        for index in range(5):
            recorder.write(picture(index, size))
    frames = decode(path, (size[0] + size[0] % 2, size[1] + size[1] % 2))
    assert len(frames) == 5
    assert block_center(frames[4]) == pytest.approx(4 * 4 + 19.5, abs=1.0), "pixels stay where they are"


@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", ["-y.mp4", "a b $(touch x).mp4", "Šídlo ö.mp4", "a:b.mp4", "%03d.mp4", "'.gif", "A.MP4"])
def test_awkward_names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.chdir(tmp_path)
    with VideoRecorder(name, SIZE, 30) as recorder:
        recorder.write(picture(0))
        recorder.write(picture(1))
    assert os.listdir(tmp_path) == [name]
    assert len(decode(tmp_path / name, SIZE)) == 2


def test_unknown_format_is_refused(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"'\.avi' is none of"):
        VideoRecorder(tmp_path / "film.avi", SIZE, 30)


def test_frame_of_another_size_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="a frame of this film"), VideoRecorder(tmp_path / "film.mp4", SIZE, 30) as recorder:
        recorder.write(np.zeros((SIZE[0], SIZE[1], 3), np.uint8))


def test_a_frame_may_be_drawn_over_after_it_was_written(tmp_path: Path) -> None:
    path = tmp_path / "film.mp4"
    canvas = np.empty((SIZE[1], SIZE[0], 3), np.uint8)
    with VideoRecorder(path, SIZE, 30) as recorder:
        for index in range(20):
            canvas[:] = picture(index)
            recorder.write(canvas)
            canvas[:] = 0
    assert decode(path, SIZE).max(axis=(1, 2, 3)).min() > 100


def test_film_without_frames_is_an_error_and_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="not one frame"), VideoRecorder(tmp_path / "film.mp4", SIZE, 30):
        pass
    assert os.listdir(tmp_path) == []


def test_missing_encoder_names_the_way_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("IMAGEIO_FFMPEG_EXE", raising=False)
    monkeypatch.setenv("PATH", "/nonexistent")
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(OutputError, match="--frames"):
        check_encoder()


def test_encoder_that_does_not_start(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", "/nonexistent/ffmpeg")
    with pytest.raises(OutputError, match="does not start"):
        check_encoder()


def foreign_ffmpeg(folder: Path, answer: str) -> Path:
    """A program with the name of FFmpeg that answers every question with the same text and encodes nothing."""
    program = folder / "ffmpeg"
    program.write_text(f"#!/bin/sh\n{answer}\n", encoding="utf-8")
    program.chmod(0o755)
    return program


@pytest.mark.sampled(2)
@pytest.mark.skipif(os.name == "nt", reason="the false encoder is a shell script")
@pytest.mark.parametrize("suffix", [".mp4", ".gif", ".webp"])
@pytest.mark.parametrize("answer", ["echo libx263; exit 0", "exit 1", "echo libx264 libx264rgb libwebp_anim"])
def test_a_film_is_right_whatever_ffmpeg_comes_first_on_the_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str, answer: str
) -> None:
    monkeypatch.delenv("IMAGEIO_FFMPEG_EXE", raising=False)
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    foreign_ffmpeg(tmp_path, answer)
    path = tmp_path / f"film{suffix}"
    with VideoRecorder(path, SIZE, 30) as recorder:
        for index in range(3):
            recorder.write(picture(index))
    frames = decode(path, SIZE)
    assert [round(block_center(frame)) for frame in frames] == pytest.approx([20, 24, 28], abs=1)


@pytest.mark.skipif(os.name == "nt", reason="the false encoder is a shell script")
def test_an_encoder_on_the_path_is_used_for_the_formats_whose_codec_it_has(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("IMAGEIO_FFMPEG_EXE", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    program = foreign_ffmpeg(tmp_path, "echo ' V....D libx264  H.264'")
    assert check_encoder(".MP4") == str(program)
    with pytest.raises(OutputError, match=r"cannot write \.webp, it has no codec libwebp_anim"):
        check_encoder(".webp")


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("body", "message"),
    [
        (
            "sys.stdin.buffer.read(3 * 57600)\nsys.stderr.write('first words\\nthe disk is on fire\\n')\nsys.exit(1)",
            "disk is on fire",
        ),
        ("sys.stdin.buffer.read(3 * 57600)\nos.kill(os.getpid(), signal.SIGKILL)", "code -9"),
        ("sys.exit(3)", "code 3"),
        ("sys.stdin.buffer.read()\nsys.stderr.write('too late\\n' * 100000)\nsys.exit(1)", "too late"),
    ],
    ids=["dies after three frames", "killed", "never reads and ends", "talks much and fails at the end"],
)
def test_encoder_that_dies(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, body: str, message: str) -> None:
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", fake_encoder(tmp_path, body))
    with pytest.raises(OutputError, match=message), VideoRecorder(tmp_path / "film.mp4", SIZE, 30) as recorder:
        for index in range(30):
            recorder.write(picture(index % 20))
    assert not list(tmp_path.glob("*.lock")) and not (tmp_path / "film.mp4").exists()


@pytest.mark.parametrize("frames", [2, 40], ids=["while closing", "while writing"])
def test_encoder_that_hangs_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, frames: int) -> None:
    monkeypatch.setattr(video, "STALL_SECONDS", 0.5)
    monkeypatch.setattr(video, "FAREWELL_SECONDS", 0.2)
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", fake_encoder(tmp_path, "time.sleep(1000)"))
    with pytest.raises(OutputError, match="was ended"), VideoRecorder(tmp_path / "film.mp4", SIZE, 30) as recorder:
        for index in range(frames):
            recorder.write(picture(index % 20))
    assert recorder._process.poll() is not None
    assert not recorder._writer.is_alive() and not recorder._listener.is_alive()


@pytest.mark.sampled(3)
def test_encoder_that_hangs_while_it_finishes_the_film_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real = video.check_encoder()
    body = f"if '-framerate' in sys.argv:\n    os.execv({real!r}, [{real!r}, *sys.argv[1:]])\ntime.sleep(1000)"
    monkeypatch.setattr(video, "STALL_SECONDS", 2.0)
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", fake_encoder(tmp_path, body))
    with pytest.raises(OutputError, match=r"kept as .*film\.part\.mp4: .*was ended"):
        with VideoRecorder(tmp_path / "film.mp4", SIZE, 30) as recorder:
            recorder.write(picture(0))
    monkeypatch.delenv("IMAGEIO_FFMPEG_EXE")
    assert len(decode(tmp_path / "film.part.mp4", SIZE)) == 1 and not list(tmp_path.glob("*.lock"))


@pytest.mark.sampled(3)
def test_encoder_that_is_stopped_for_a_while_goes_on(tmp_path: Path) -> None:
    with VideoRecorder(tmp_path / "film.mp4", SIZE, 30) as recorder:
        for index in range(40):
            if index == 5:
                os.kill(recorder._process.pid, signal.SIGSTOP)
                threading.Timer(2.0, os.kill, (recorder._process.pid, signal.SIGCONT)).start()
            recorder.write(picture(index % 20))
    assert len(decode(tmp_path / "film.mp4", SIZE)) == 40


def test_an_empty_film_is_not_left_by_an_encoder_that_never_wrote(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", fake_encoder(tmp_path, "sys.exit(3)"))
    with pytest.raises(OutputError), VideoRecorder(tmp_path / "film.mp4", SIZE, 30) as recorder:
        for index in range(30):
            recorder.write(picture(index % 20))
    assert not list(tmp_path.glob("film*"))


def test_a_link_at_the_temporary_name_is_not_followed(tmp_path: Path) -> None:
    other = tmp_path / "other"
    other.write_bytes(b"of someone else")
    (tmp_path / "film.part.mp4").symlink_to(other)
    with VideoRecorder(tmp_path / "film.mp4", SIZE, 30) as recorder:
        recorder.write(picture(0))
    assert other.read_bytes() == b"of someone else"
    assert len(decode(tmp_path / "film.mp4", SIZE)) == 1


def test_two_writers_of_one_film(tmp_path: Path) -> None:
    with VideoRecorder(tmp_path / "film.mp4", SIZE, 30) as recorder:
        recorder.write(picture(0))
        with pytest.raises(OutputError, match="is writing it"):
            VideoRecorder(tmp_path / "film.mp4", SIZE, 30)
        command = "import sys, pathlib, mpp_taichi.recorders._lock as lock; lock.OutputLock(pathlib.Path(sys.argv[1]))"
        other = subprocess.run(
            [sys.executable, "-c", command, tmp_path / "film.mp4"], capture_output=True, text=True, env=ENVIRONMENT
        )
        assert other.returncode != 0 and f"process {os.getpid()} is writing it" in other.stderr
    assert len(decode(tmp_path / "film.mp4", SIZE)) == 1


@pytest.mark.parametrize("owner", ["dead", "same number", "garbage"])
def test_lock_left_by_a_crash_is_taken_over(tmp_path: Path, owner: str) -> None:
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    text = {"dead": str(gone.pid), "same number": str(os.getpid()), "garbage": "?"}[owner]
    (tmp_path / ".film.mp4.lock").write_text(text, encoding="ascii")
    with VideoRecorder(tmp_path / "film.mp4", SIZE, 30) as recorder:
        recorder.write(picture(0))
    assert os.listdir(tmp_path) == ["film.mp4"]


def test_exception_in_the_block_keeps_a_film_that_plays(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), VideoRecorder(tmp_path / "film.mp4", SIZE, 30) as recorder:
        for index in range(30):
            recorder.write(picture(index))
        raise ZeroDivisionError
    assert os.listdir(tmp_path) == ["film.part.mp4"]
    assert len(decode(tmp_path / "film.part.mp4", SIZE)) >= 30 - video.QUEUED_FRAMES


ENDLESS = """
import sys, time
import numpy as np
from mpp_taichi.recorders.video import VideoRecorder
noise = np.random.default_rng(1).integers(0, 255, (240, 320, 3), np.uint8)
recorder = VideoRecorder(sys.argv[1], (320, 240), 30)
for index in range(10000):
    recorder.write(np.roll(noise, index, axis=1))
    if index == 120:
        print("ready", flush=True)
    if index > 120:
        time.sleep(0.01)
"""


@pytest.mark.skipif(os.name == "nt", reason="POSIX signals")
@pytest.mark.parametrize("whole_group", [False, True], ids=["the program", "the program and the encoder"])
@pytest.mark.sampled(3)
def test_film_plays_after_the_program_was_killed(tmp_path: Path, whole_group: bool) -> None:
    process = subprocess.Popen([sys.executable, "-c", ENDLESS, tmp_path / "film.mp4"], stdout=subprocess.PIPE, env=ENVIRONMENT)
    assert process.stdout is not None and process.stdout.readline() == b"ready\n"
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
    encoders = [int(child) for child in children.read_text().split()] if children.exists() else []
    os.kill(process.pid, signal.SIGKILL)
    if whole_group:
        for encoder in encoders:
            os.kill(encoder, signal.SIGKILL)
    process.wait()
    process.stdout.close()
    part = tmp_path / "film.part.mp4"
    deadline = time.monotonic() + 10
    while not whole_group and any(Path(f"/proc/{encoder}").exists() for encoder in encoders) and time.monotonic() < deadline:
        time.sleep(0.05)
    frames = decode(part, (320, 240))
    assert len(frames) >= (30 if whole_group else 120 - video.QUEUED_FRAMES)


def test_frames_folder_holds_one_film(tmp_path: Path) -> None:
    folder = tmp_path / "frames"
    for count in (5, 3):
        with FrameRecorder(folder) as recorder:
            for index in range(count):
                recorder.write(picture(index))
    assert sorted(os.listdir(folder)) == ["frame_000000.png", "frame_000001.png", "frame_000002.png"]
    np.testing.assert_array_equal(np.asarray(Image.open(folder / "frame_000002.png")), picture(2))


def test_frames_folder_that_cannot_be_made(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x", encoding="ascii")
    with pytest.raises(OutputError, match="cannot be written"):
        FrameRecorder(tmp_path / "file" / "frames")


def test_frames_folder_with_two_writers(tmp_path: Path) -> None:
    with FrameRecorder(tmp_path), pytest.raises(OutputError, match="is writing it"):
        FrameRecorder(tmp_path)
