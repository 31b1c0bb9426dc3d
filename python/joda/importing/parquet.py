"""Columns of numbers of a Parquet file, each row of them a number or a list of some."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from joda.errors import JodaError
from joda.importing.log import Array


def read_columns(
    file: Path, lists: Mapping[str, int], others: Sequence[str]
) -> tuple[dict[str, Array], int]:
    """Reads columns.

    Args:
        file: to read.
        lists: how many numbers each row of a column has, by the column's name.
        others: names of columns with one number a row; they need not be there.

    Returns:
        the columns, of shape (n, count) or (n,), and n.

    Raises:
        JodaError: the file is damaged, a column is not there, or it holds something else; or
            pyarrow is not installed.
    """
    pyarrow, parquet = _pyarrow()
    try:
        with parquet.ParquetFile(file) as opened:
            there = set(opened.schema_arrow.names)
            table = opened.read(columns=[name for name in (*lists, *others) if name in there])
    except (OSError, pyarrow.ArrowException) as error:
        told = str(error).partition("\n")[0].rstrip(".")
        raise JodaError(
            f"{file}: cannot be read as Parquet ({told}); fetch or write it anew."
        ) from None
    for name in lists:
        if name not in there:
            raise JodaError(f"{file}: no column '{name}', which info.json has.")
    columns = {
        name: _numbers(file, name, table[name].combine_chunks(), lists.get(name, 0))
        for name in table.column_names
    }
    return columns, table.num_rows


def _numbers(file: Path, name: str, column: Any, count: int) -> Array:
    """A column as numbers: of shape (n, count), or (n,) where `count` is 0."""
    pyarrow, _ = _pyarrow()
    types, rows = pyarrow.types, len(column)
    if isinstance(column, pyarrow.ChunkedArray):
        column = pyarrow.concat_arrays(column.chunks) if column.num_chunks else column
    kind = column.type
    if types.is_list(kind) or types.is_large_list(kind) or types.is_fixed_size_list(kind):
        flat = column.flatten()
        each = len(flat) // rows if rows else count
        lengths = {len(flat) - each * rows, column.null_count}
        if rows and (lengths != {0} or not _even(column, each)):
            raise JodaError(f"{file}: column '{name}' has lists of several lengths.")
        column, kind, shape = flat, flat.type, (rows, each)
    else:
        shape = (rows, 1)
    if not (types.is_floating(kind) or types.is_integer(kind)):
        raise JodaError(f"{file}: column '{name}' has {kind}, not numbers.")
    if shape[1] != (count or 1):
        raise JodaError(
            f"{file}: column '{name}' has {shape[1]} numbers a row, and by info.json {count or 1}."
        )
    values = np.asarray(column.to_numpy(zero_copy_only=False), np.float64).reshape(shape)
    return values if count else values[:, 0]


def _even(column: Any, each: int) -> bool:
    """Whether all lists of a column have this length."""
    import pyarrow.compute as compute

    return bool(compute.all(compute.equal(compute.list_value_length(column), each)).as_py())


def _pyarrow() -> tuple[Any, Any]:
    try:
        import pyarrow
        import pyarrow.parquet as parquet
    except ImportError:
        raise JodaError('LeRobot datasets need pyarrow; run: pip install ".[import]"') from None
    return pyarrow, parquet
