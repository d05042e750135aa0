"""Formats: where each kind of file has room for a passport, a JSON object, so that other programs read the file as before.

.mp4    a box `uuid` at the end (ISO/IEC 14496-12, 11.1)
.webp   a chunk `MPPP` at the end of the RIFF container
.gif    a comment extension before the trailer (GIF89a, 24)
.png    a chunk `iTXt` before `IEND` (PNG specification, 11.3.3.4)
.npz    the comment of the ZIP archive
.html   a script of type application/json before `</body>`
.svg    a comment at the end
"""

import json
import os
import re
import struct
import zipfile
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

BOX = bytes.fromhex("6d70702d7461696368692d7061737370")  # the user type of the box: "mpp-taichi-passp"
CHUNK = b"MPPP"
KEYWORD = b"mpp-taichi-passport"
LONGEST = 60_000  # bytes; the comment of a ZIP archive has at most 65,535
TAIL = 200_000  # bytes at the end of a file in which its passport lies
SCRIPT = '<script type="application/json" id="passport">'
SCRIPT_END = "</script>\n"
PAGE_END = re.compile(rb"</body>\s*</html>\s*\Z")
COMMENT, COMMENT_END = "<!-- mpp-taichi-passport ", " -->\n"
Facts = Mapping[str, Any]


@dataclass(frozen=True)
class PassportFormat:
    """How a kind of file takes a passport, and gives the JSON text of it back, or None where the file has none."""

    put: Callable[[Path, Facts], None]
    get: Callable[[Path], "bytes | None"]


def _bytes(facts: Facts) -> bytes:
    """JSON in ASCII without the letters that mean something in HTML and XML, within a script or a comment."""
    text = json.dumps(facts, sort_keys=True)
    for letters in ("&", "<", ">", "--"):
        text = text.replace(letters, "".join(f"\\u{ord(letter):04x}" for letter in letters))
    found = text.encode("ascii")
    if len(found) > LONGEST:
        raise ValueError(f"a passport of {len(found)} bytes is too long, allowed: {LONGEST}")
    return found


def _append(path: Path, data: bytes, *, over: int = 0) -> None:
    """Write at the end of a file, over its last bytes."""
    with open(path, "rb+") as stream:
        stream.seek(-over, os.SEEK_END)
        stream.write(data)


def _tail(path: Path) -> bytes:
    with open(path, "rb") as stream:
        stream.seek(max(0, os.fstat(stream.fileno()).st_size - TAIL))
        return stream.read()


def _between(data: bytes, begin: bytes, length: Callable[[bytes, int], int]) -> bytes | None:
    """The text after the last `begin`; `length` says how long it is from the data and the place where it begins."""
    at = data.rfind(begin)
    return None if at < 0 else data[at + len(begin) : at + len(begin) + length(data, at)]


def _put_mp4(path: Path, facts: Facts) -> None:
    text = _bytes(facts)
    _append(path, struct.pack(">I", 24 + len(text)) + b"uuid" + BOX + text)


def _get_mp4(path: Path) -> bytes | None:
    return _between(_tail(path), b"uuid" + BOX, lambda data, at: struct.unpack(">I", data[at - 4 : at])[0] - 24)


def _put_webp(path: Path, facts: Facts) -> None:
    text = _bytes(facts)
    text += b" " * (len(text) % 2)  # chunks have an even number of bytes
    _append(path, CHUNK + struct.pack("<I", len(text)) + text)
    with open(path, "rb+") as stream:
        stream.seek(4)
        stream.write(struct.pack("<I", os.fstat(stream.fileno()).st_size - 8))


def _get_webp(path: Path) -> bytes | None:
    data = _tail(path)
    at = data.rfind(CHUNK)
    return None if at < 0 else data[at + 8 : at + 8 + struct.unpack("<I", data[at + 4 : at + 8])[0]]


def _put_gif(path: Path, facts: Facts) -> None:
    text = KEYWORD + b" " + _bytes(facts)
    blocks = b"".join(bytes([len(part)]) + part for part in (text[k : k + 255] for k in range(0, len(text), 255)))
    _append(path, b"\x21\xfe" + blocks + b"\x00\x3b", over=1)


def _get_gif(path: Path) -> bytes | None:
    data = _tail(path)
    at = data.rfind(b"\x21\xfe")
    text, at = b"", at + 2
    while at > 1 and at < len(data) and data[at]:
        text, at = text + data[at + 1 : at + 1 + data[at]], at + 1 + data[at]
    return text.removeprefix(KEYWORD + b" ") if text.startswith(KEYWORD) else None


def _put_png(path: Path, facts: Facts) -> None:
    body = b"iTXt" + KEYWORD + b"\x00\x00\x00\x00\x00" + _bytes(facts)
    end = struct.pack(">I", 0) + b"IEND"
    whole = struct.pack(">I", len(body) - 4) + body + struct.pack(">I", zlib.crc32(body))
    _append(path, whole + end + struct.pack(">I", zlib.crc32(b"IEND")), over=12)


def _get_png(path: Path) -> bytes | None:
    begin = b"iTXt" + KEYWORD + b"\x00\x00\x00\x00\x00"
    return _between(_tail(path), begin, lambda data, at: struct.unpack(">I", data[at - 4 : at])[0] - len(begin) + 4)


def _put_npz(path: Path, facts: Facts) -> None:
    with zipfile.ZipFile(path, "a") as archive:
        archive.comment = KEYWORD + b" " + _bytes(facts)


def _get_npz(path: Path) -> bytes | None:
    with zipfile.ZipFile(path) as archive:
        comment = archive.comment
    return comment.removeprefix(KEYWORD + b" ") if comment.startswith(KEYWORD) else None


def _put_html(path: Path, facts: Facts) -> None:
    end = PAGE_END.search(_tail(path))
    if end is not None:
        body = f"{SCRIPT}{_bytes(facts).decode('ascii')}{SCRIPT_END}".encode()
        _append(path, body + end[0], over=len(end[0]))


def _get_html(path: Path) -> bytes | None:
    found = re.search(f"{re.escape(SCRIPT)}(.*?){re.escape(SCRIPT_END.strip())}".encode(), _tail(path), re.DOTALL)
    return found[1] if found else None


def _put_svg(path: Path, facts: Facts) -> None:
    _append(path, f"{COMMENT}{_bytes(facts).decode('ascii')}{COMMENT_END}".encode())


def _get_svg(path: Path) -> bytes | None:
    found = re.search(f"{re.escape(COMMENT)}(.*?){re.escape(COMMENT_END.strip())}".encode(), _tail(path), re.DOTALL)
    return found[1] if found else None


FORMATS = {
    ".mp4": PassportFormat(_put_mp4, _get_mp4),
    ".webp": PassportFormat(_put_webp, _get_webp),
    ".gif": PassportFormat(_put_gif, _get_gif),
    ".png": PassportFormat(_put_png, _get_png),
    ".npz": PassportFormat(_put_npz, _get_npz),
    ".html": PassportFormat(_put_html, _get_html),
    ".svg": PassportFormat(_put_svg, _get_svg),
}


def passport_of(path: Path) -> dict[str, Any] | None:
    """The passport in a file; None where the file has none.

    Raises:
        KeyError: its format has no room for a passport.
        OSError: the file cannot be read.
        ValueError: the file is damaged.
    """
    try:
        text = FORMATS[path.suffix.lower()].get(path)
        found = None if text is None else json.loads(text)
    except (zipfile.BadZipFile, struct.error) as error:
        raise ValueError(str(error)) from None
    if found is not None and not isinstance(found, dict):
        raise ValueError("its passport is no object")
    return found
