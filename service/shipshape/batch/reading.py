"""One input -> its clouds in chunks, the same in every run; memory holds one chunk and one message."""

import logging
from collections.abc import Container, Iterator

import numpy as np

from shipshape.batch.method import Method
from shipshape.batch.units import Chunk, Cloud, Ending, Source, part_name
from shipshape.errors import FileError
from shipshape.pointfiles import read_named_clusters
from shipshape.pointfiles.recordings import Message, is_recording, read_recording

# A chunk is full at one of these: about half a second of work, and memory that few cores or many can spare.
CHUNK_CLOUDS = 256
CHUNK_POINTS = 2**19

_NO_POINTS = np.empty((0, 3), np.float32)

log = logging.getLogger(__name__)


def read(source: Source, method: Method, done: Container[str]) -> Iterator[Chunk | Ending]:
    """The chunks of an input but for those whose parts are done, and how it ended."""
    number = messages = 0
    clouds: list[Cloud] = []
    points, share, error = 0, 0.0, ""
    try:
        for message in _messages(source, method):
            messages, before = message.index + 1, share
            for index, cloud in enumerate(_clouds(message), 1):
                share = before + (message.share - before) * index / max(len(message.clusters), 1)
                clouds.append(cloud)
                points += len(cloud.points_level)
                if len(clouds) == CHUNK_CLOUDS or points >= CHUNK_POINTS:
                    if part_name(source.sha256, number) not in done:
                        yield Chunk(source.sha256, number, clouds, share)
                    number, clouds, points = number + 1, [], 0
    except FileError as failed:
        error = str(failed)
    except Exception as fault:  # nothing that one file holds may end a run
        log.exception("%s could not be read", source.path)
        error = f"expected {source.path.name} to be readable, got a fault of Shipshape: {type(fault).__name__}"
    if clouds:
        if part_name(source.sha256, number) not in done:
            yield Chunk(source.sha256, number, clouds, share)
        number += 1
    yield Ending(source.sha256, number, messages, error)


def _messages(source: Source, method: Method) -> Iterator[Message]:
    if is_recording(source.path):
        yield from read_recording(source.path, method.topics, method.id_names)
        return
    clusters = read_named_clusters(source.path, id_names=method.id_names)
    if not clusters:
        raise FileError(f"expected at least one cluster in {source.path.name}, got none")
    yield Message(0, clusters)


def _clouds(message: Message) -> Iterator[Cloud]:
    about = (message.topic, message.frame_id, message.stamp_ns)
    if message.error:
        yield Cloud(message.index, None, _NO_POINTS, "", *about, message.error)
    for index, cluster in enumerate(message.clusters):
        number = index if cluster.apart else None
        yield Cloud(message.index, number, cluster.points_level, cluster.contact_id, *about)
