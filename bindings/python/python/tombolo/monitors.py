"""Monitors of a run as tables that grow."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping
from typing import Any, Optional

import numpy as np
from numpy.typing import NDArray

from ._identity import by_identity
from ._names import unknown

__all__ = ["MonitorTable", "Monitors"]

#: The most rows that a table keeps: the newest.
ROWS = 1 << 20


@by_identity
class MonitorTable(Mapping[str, NDArray[np.float64]]):
    """The values of a pipeline's monitors: a column for each, beside `cycle` and `time`, a row for each time they ran.

    It grows while the run goes on; a column that was taken out of it stays as it was: an array of shape (rows,),
    float64, which cannot be written to. NaN where nothing could be measured. Of more than 1 048 576 rows it keeps the
    newest. `time` is in the solver's unit of time, and values are in the units of the fields that they were measured
    of.

    Examples
    --------
    >>> import tombolo
    >>> table = tombolo.MonitorTable("health")
    >>> table._append({"cycle": 3, "time": 0.3, "values": {"quality.min": 0.2, "drag": None}})
    >>> table["quality.min"], table.last["cycle"], sorted(table)
    (array([0.2]), 3.0, ['cycle', 'drag', 'quality.min', 'time'])
    """

    def __init__(self, pipeline: str) -> None:
        self.pipeline = pipeline
        self._lock = threading.Lock()
        self._columns: dict[str, NDArray[np.float64]] = {}
        self._begin = 0
        self._end = 0

    def __getstate__(self) -> dict[str, Any]:
        # A lock cannot be copied. A copy has the rows that there are now.
        with self._lock:
            columns = {name: column[self._begin : self._end].copy() for name, column in self._columns.items()}
            return {"pipeline": self.pipeline, "_columns": columns, "_begin": 0, "_end": self._end - self._begin}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._lock = threading.Lock()

    def _announce(self, name: str) -> None:
        """Have a column for a monitor, which may have no row yet."""
        with self._lock:
            capacity = self._capacity
            for column in ("cycle", "time", name):
                if column not in self._columns:
                    self._columns[column] = np.full(capacity, np.nan)

    @property
    def _capacity(self) -> int:
        return len(next(iter(self._columns.values()))) if self._columns else 0

    def _append(self, told: Mapping[str, Any]) -> None:
        row: dict[str, Any] = {"cycle": told["cycle"], "time": told["time"], **told["values"]}
        with self._lock:
            capacity = self._capacity
            if self._end == capacity:
                self._begin = max(self._begin, self._end - ROWS)
                kept = slice(self._begin, self._end)
                self._begin, self._end = 0, kept.stop - kept.start
                # Columns that were taken out keep the old memory.
                for name, column in self._columns.items():
                    self._columns[name] = np.full(max(64, 2 * self._end), np.nan)
                    self._columns[name][: self._end] = column[kept]
                capacity = max(64, 2 * self._end)
            for name in row:
                if name not in self._columns:
                    self._columns[name] = np.full(capacity, np.nan)
            for name, value in row.items():
                if value is not None:
                    self._columns[name][self._end] = value
            self._end += 1
            self._begin = max(self._begin, self._end - ROWS)

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        with self._lock:
            try:
                column = self._columns[name][self._begin : self._end]
            except KeyError:
                where = f"there are in the pipeline '{self.pipeline}'"
                raise KeyError(unknown("monitor", name, self._columns, where)) from None
        column.flags.writeable = False
        return column

    def __iter__(self) -> Iterator[str]:
        with self._lock:
            return iter(list(self._columns))

    def __len__(self) -> int:
        """The number of columns, as of any mapping; `rows` is that of rows."""
        with self._lock:
            return len(self._columns)

    @property
    def rows(self) -> int:
        """How many rows there are."""
        with self._lock:
            return self._end - self._begin

    @property
    def last(self) -> dict[str, float]:
        """The newest row; empty before there is one."""
        with self._lock:
            if self._end == self._begin:
                return {}
            return {name: float(column[self._end - 1]) for name, column in self._columns.items()}

    def to_pandas(self) -> Any:
        """The table as a `pandas.DataFrame`.

        Returns
        -------
        pandas.DataFrame
            A copy, its rows by their cycle, with a column for `time` and one for each monitor.

        Raises
        ------
        ImportError
            There is no pandas.
        """
        import pandas

        with self._lock:
            columns = {name: column[self._begin : self._end].copy() for name, column in self._columns.items()}
        cycles = columns.pop("cycle", np.empty(0)).astype(np.int64)
        return pandas.DataFrame(columns, index=pandas.Index(cycles, name="cycle"))

    def __repr__(self) -> str:
        return f"<tombolo.MonitorTable '{self.pipeline}': {self.rows} rows of {', '.join(self) or 'nothing yet'}>"


class Monitors(Mapping[str, MonitorTable]):
    """The monitors of a run: for each pipeline that has some a table, without rows until something was measured."""

    def __init__(self) -> None:
        self._tables: dict[str, MonitorTable] = {}

    def _table(self, pipeline: str) -> MonitorTable:
        found: Optional[MonitorTable] = self._tables.get(pipeline)
        if found is None:
            found = self._tables[pipeline] = MonitorTable(pipeline)
        return found

    def __getitem__(self, pipeline: str) -> MonitorTable:
        try:
            return self._tables[pipeline]
        except KeyError:
            raise KeyError(unknown("monitors of a pipeline", pipeline, self, "there are those of")) from None

    def __iter__(self) -> Iterator[str]:
        return iter(list(self._tables))

    def __len__(self) -> int:
        return len(self._tables)

    def to_pandas(self) -> Any:
        """All monitors as one `pandas.DataFrame`.

        What was measured at one cycle and time is one row. A cycle that was counted anew, or shown more than once, has
        a row for each time.

        Returns
        -------
        pandas.DataFrame
            A copy, its rows by their cycle, with columns called ``pipeline.monitor``.

        Raises
        ------
        ImportError
            There is no pandas.
        """
        import pandas

        frames = []
        for name, table in list(self._tables.items()):
            frame = table.to_pandas().reset_index()
            step = [frame["cycle"], frame["time"]]
            step.append(frame.groupby(step).cumcount())
            frames.append(frame.drop(columns=["cycle", "time"]).add_prefix(f"{name}.").set_index(step))
        if not frames:
            return pandas.DataFrame()
        return pandas.concat(frames, axis=1).sort_index(level=[1, 0, 2]).droplevel([1, 2])

    def __repr__(self) -> str:
        return f"<tombolo.Monitors of {', '.join(self) or 'no pipeline yet'}>"
