"""Archives with other payloads, whose checksums are right: as a hostile hand or a faulty version would write them."""

from mpp_taichi.archive.record_file import HEADER, RecordFile
from mpp_taichi.archive.values import pack, unpack


def remade(path, into, change, leave=()):
    """Write the records of an archive to another path, with `change(kind, payload)` as their payloads; leave kinds out."""
    source, target = RecordFile.open(path, to_append=False), RecordFile.create(into)
    for record in source.records:
        if record.kind not in leave:
            target.append(record.kind, change(record.kind, source.read(record)))
    source.close()
    target.close()
    return into


def with_header(path, into, **changes):
    """An archive with other values in its header."""
    return remade(path, into, lambda kind, data: pack(unpack(data) | changes) if kind == HEADER else data)
