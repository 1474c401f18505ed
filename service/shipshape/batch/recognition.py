"""A chunk -> its part: the clusters in each cloud, what each is taken for, and the rows of that."""

import logging
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import cv2
import pyarrow as pa
import pyarrow.parquet as pq

from shipshape.batch import rows
from shipshape.batch.method import Method
from shipshape.batch.segmentation import segment
from shipshape.batch.units import Chunk, Cloud, Part
from shipshape.client import Answer
from shipshape.errors import BundleError, InvalidInput
from shipshape.pipeline import Pipeline
from shipshape.sample import sample_contact
from shipshape.types import Contact, Options, Recognition

Answered = Recognition | Answer | str  # by this machine, by a service; a string says why there is no answer
AnswerAll = Callable[[Sequence[Contact]], Iterator[Answered]]

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Recogniser:
    """Turns chunks into parts; the same for each engine, which differs in `answers` alone."""

    answers: AnswerAll
    method: Method
    bundle: str  # digest
    code: str

    def __call__(self, chunk: Chunk) -> Part:
        """The part of a chunk; what is refused has a row with the reason."""
        contacts = list(_contacts(chunk, self.method))
        good = [contact for cloud, contact in contacts if not cloud.error]
        answers = self.answers(good)
        table, clouds = [], []
        for cloud, contact in contacts:
            answer = cloud.error or next(answers)
            table.append(rows.row_of(chunk, cloud, contact.sensor_height, answer))
            if self.method.restored and not isinstance(answer, str) and answer.restored is not None:
                clouds.append(rows.cloud_of(table[-1]["unit"], answer.restored))
        of_all = {"bundle": self.bundle, "code": self.code}
        return Part(
            sha256=chunk.sha256,
            name=chunk.name,
            share=chunk.share,
            rows=len(table),
            refused=sum("error" in row for row in table),
            table=_to_parquet([row | of_all for row in table], rows.PART),
            clouds=_to_parquet(clouds, rows.CLOUDS) if self.method.restored else None,
        )


def answers_of(pipeline: Pipeline, options: Options) -> AnswerAll:
    """The answers of a pipeline in this process."""

    def answer(contact: Contact) -> Answered:
        """One contact; a fault of the product is told in its row, and with all that is known in the log."""
        try:
            return pipeline.run(contact, options)
        except InvalidInput as error:
            return str(error)
        except BundleError:
            raise
        except Exception as error:
            log.exception("a contact of %d points got no answer", len(contact.points_level))
            return f"expected an answer, got a fault of Shipshape: {type(error).__name__}"

    return lambda contacts: map(answer, contacts)


def warm_up(pipeline: Pipeline, options: Options) -> None:
    """Compile and fill caches, once for all workers that fork afterwards."""
    cv2.setNumThreads(1)  # a contact is one core's work
    pipeline.run(sample_contact(), options)


def _contacts(chunk: Chunk, method: Method) -> Iterator[tuple[Cloud, Contact]]:
    """The clusters of a chunk; a cloud that may be a whole scan is split when that is asked for."""
    for cloud in chunk.clouds:
        if cloud.cluster is None and not cloud.error and method.segmentation is not None:
            clusters, height = segment(cloud.points_level, method.segmentation, method.sensor_height)
            for number, points in enumerate(clusters):
                yield _contact(replace(cloud, cluster=number, points_level=points), method, height)
        else:
            whole = cloud.cluster is None and not cloud.error
            yield _contact(replace(cloud, cluster=0) if whole else cloud, method, method.sensor_height)


def _contact(cloud: Cloud, method: Method, height: float | None) -> tuple[Cloud, Contact]:
    return cloud, Contact(cloud.points_level, cloud.contact_id, height, method.own_true_heading_deg)


def _to_parquet(records: list[dict[str, object]], schema: pa.Schema) -> bytes:
    sink = pa.BufferOutputStream()
    pq.write_table(pa.Table.from_pylist(records, schema), sink, compression="zstd")
    return bytes(sink.getvalue())
