"""Parts -> one table of all contacts in the order of the inputs, a few parts in memory at a time."""

from collections.abc import Iterator
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from shipshape.batch import rows
from shipshape.batch.inputs import Inputs
from shipshape.batch.results import TEMPORARY, Results
from shipshape.batch.summary import Tally
from shipshape.batch.units import part_names
from shipshape.errors import FileError

GROUP_ROWS = 16_384  # of a row group: what a reader needs at once


def merge(inputs: Inputs, results: Results) -> Tally:
    """Write contacts.parquet and timings.parquet; the same parts give the same bytes of the first of them.

    Raises:
        FileError: A part is damaged.
    """
    tally = Tally()
    contacts, timings = (results.folder / f"{name}.parquet" for name in ("contacts", "timings"))
    with _Table(contacts, rows.CONTACTS) as all_contacts, _Table(timings, rows.TIMINGS) as all_timings:
        for name, table in _parts(inputs, results):
            named = pa.array([name] * len(table), rows.INPUT.type)
            tally.add(table)
            all_contacts.add(table.add_column(0, rows.INPUT, named).select(rows.CONTACTS.names))
            all_timings.add(table.select(rows.TIMINGS.names))
    return tally


def _parts(inputs: Inputs, results: Results) -> Iterator[tuple[str, pa.Table]]:
    for record in inputs.records:
        record.contacts = record.refused = 0
        if record.same_as:
            continue
        for part in part_names(record.sha256, record.chunks):
            try:
                table = pq.read_table(results.part(part), schema=rows.PART)
            except (pa.ArrowException, OSError) as error:
                raise FileError(
                    f"expected parts/{part}.parquet to be whole, got a damaged file: delete it and run again"
                ) from error
            record.contacts += len(table)
            record.refused += len(table) - table["error"].null_count
            yield record.name, table


class _Table:
    """A Parquet file that takes its name when it is whole, in row groups that do not depend on the parts."""

    def __init__(self, path: Path, schema: pa.Schema) -> None:
        self._path, self._beside = path, path.with_name(f"{path.name}{TEMPORARY}")
        self._schema = schema
        self._writer = pq.ParquetWriter(self._beside, schema, compression="zstd")
        self._waiting: list[pa.Table] = []

    def __enter__(self) -> "_Table":
        return self

    def __exit__(self, failed: type[BaseException] | None, *_: object) -> None:
        if failed is None:
            self._write(sum(map(len, self._waiting)))
        self._writer.close()
        if failed is None:
            self._beside.replace(self._path)

    def add(self, table: pa.Table) -> None:
        """Some more rows."""
        self._waiting.append(table.cast(self._schema))
        self._write(sum(map(len, self._waiting)) // GROUP_ROWS * GROUP_ROWS)

    def _write(self, count: int) -> None:
        """The first rows that wait."""
        if count:
            table = pa.concat_tables(self._waiting)
            self._writer.write_table(table.slice(0, count), row_group_size=GROUP_ROWS)
            self._waiting = [table.slice(count)]
