# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The messages of a sqlite3 bag taken straight from the pages of the file, thousands at once.

https://www.sqlite.org/fileformat2.html: a table is a tree of pages; its leaves hold the rows, each
a cell of payload length, row id, and a record (types, then values). Only rows of the one expected
shape are taken: id as row id, topic_id a small integer, timestamp 8 bytes, data a blob within the
page.

"""

from __future__ import annotations

from collections.abc import Iterator
from io import BufferedReader
from typing import NamedTuple

import numpy as np

from .container import Damaged, rows

LEAF, INTERIOR = 13, 5
SOME = 1024             # pages looked at together
SPARE = 16              # bytes behind the last page, so that a number at its end can be read


class Unexpected(Exception):
    """The table has another shape than expected; SQL has to read it."""


class Rows(NamedTuple):
    """Rows of the table of messages, and the buffer that their data lie in."""

    id: np.ndarray
    topic: np.ndarray
    time: np.ndarray
    data: np.ndarray
    begin: np.ndarray
    length: np.ndarray


class Pages:
    """The pages of a database file."""

    def __init__(self, file: BufferedReader, size: int):
        self.file = file
        head = self._read(0, 100)
        declared = int.from_bytes(head[16:18], 'big')
        self.page = 65536 if declared == 1 else declared
        self.usable = self.page - head[20]
        if self.page < 512 or self.page & (self.page - 1) or self.usable < 480:
            raise Damaged('page size')
        self.size = size
        self.count = -(-size // self.page)          # the last one may be cut

    def _read(self, at: int, n: int) -> bytes:
        self.file.seek(at)
        return self.file.read(n)

    def leaves(self, root: int) -> np.ndarray:
        """
        Return the numbers of a table's leaf pages in order of its rows.

        Raise Damaged where the tree is broken.

        """
        level, found = np.array([root]), []
        for _ in range(20):
            kinds = np.array([self._kind(p) for p in level[:1]])
            if kinds[0] == LEAF:
                return level
            for p in level:
                found.append(self._children(int(p)))
            level, found = np.concatenate(found), []
            if len(level) > self.count:
                raise Damaged('pages used twice')
        raise Damaged('depth')

    def _kind(self, page: int) -> int:
        raw = self._read((page - 1) * self.page, 101 if page == 1 else 1)
        return raw[-1] if raw else 0

    def _children(self, page: int) -> np.ndarray:
        raw = np.frombuffer(self._read((page - 1) * self.page, self.page), np.uint8)
        start = 100 if page == 1 else 0
        if len(raw) < self.page or raw[start] != INTERIOR:
            raise Damaged(f'page {page}')
        n = int(raw[start + 3]) << 8 | int(raw[start + 4])
        if start + 12 + 2 * n > self.page:
            raise Damaged(f'page {page}')
        at = raw[start + 12:start + 12 + 2 * n].view('>u2').astype(np.int64)
        if n and at.max() + 4 > self.page:
            raise Damaged(f'page {page}')
        left = (
            raw[at[:, None] + np.arange(4)].copy().view('>u4')[:, 0]
            if n
            else np.empty(0, np.int64)
        )
        last = raw[start + 8:start + 12].view('>u4')
        return np.concatenate([left, last]).astype(np.int64)

    def every_leaf(self) -> np.ndarray:
        """Return all pages that look like leaves of tables, for files whose tree is broken."""
        kinds = np.array([self._kind(p) for p in range(2, self.count + 1)], np.int64)
        return np.flatnonzero(kinds == LEAF) + 2

    def rows(self, leaves: np.ndarray, strict: bool = True) -> Iterator[Rows]:
        """
        Yield the rows of leaf pages.

        Raises
        ------
        Unexpected
            If ``strict``, where a page or a row has another shape; otherwise that is passed over.

        """
        for k in range(0, len(leaves), SOME):
            some = leaves[k:k + SOME]
            data = np.zeros(len(some) * self.page + SPARE, np.uint8)
            self._fill(data, some)
            yield self._cells(data, some, strict)

    def _fill(self, data: np.ndarray, pages: np.ndarray) -> None:
        """Read pages into a buffer, those that follow each other together."""
        cuts = np.r_[0, np.flatnonzero(np.diff(pages) != 1) + 1, len(pages)]
        view = data.data
        for a, b in zip(cuts[:-1], cuts[1:]):
            self.file.seek((int(pages[a]) - 1) * self.page)
            self.file.readinto(view[int(a) * self.page:int(b) * self.page])

    def _cells(self, data: np.ndarray, numbers: np.ndarray, strict: bool) -> Rows:
        count = len(numbers)
        pages = data[:count * self.page].reshape(count, self.page)
        number = pages[:, 3].astype(np.int64) << 8 | pages[:, 4]
        good = (pages[:, 0] == LEAF) & (8 + 2 * number <= self.page)
        if strict and not good.all():
            raise Unexpected('page')
        number[~good] = 0
        most = int(number.max(initial=0))
        pointers = np.ascontiguousarray(pages[:, 8:8 + 2 * most]).view('>u2').astype(np.int64)
        used = np.arange(most) < number[:, None]
        begin = ((np.arange(count) * self.page)[:, None] + pointers)[used]
        # of the page, in the file
        there = np.minimum(self.usable, self.size - (numbers - 1) * self.page)
        end = np.repeat(np.arange(count) * self.page + there, number)
        return self._records(data, begin, end, strict)

    def _records(self, data: np.ndarray, at: np.ndarray, end: np.ndarray, strict: bool) -> Rows:
        payload, at = _varint(data, at)
        id, at = _varint(data, at)
        inside = payload <= self.usable - 35
        header, types = _varint(data, at)
        first, topic_at = _varint(data, types)
        topic_type, time_at = _varint(data, topic_at)
        time_type, data_at = _varint(data, time_at)
        blob_type, after = _varint(data, data_at)
        width = np.select(
            [topic_type == 8, topic_type == 9, topic_type == 1, topic_type == 2], [0, 0, 1, 2], -1
        )
        values = at + header
        length = (blob_type - 12) // 2
        begin = values + width + 8
        good = (
            (first == 0)
            & (width >= 0)
            & (time_type == 6)
            & (blob_type >= 12)
            & (blob_type % 2 == 0)
            & (after == values)
            & (values + width + 8 < len(data))
        )
        whole = good & inside & (header + width + 8 + length == payload) & (begin + length <= end)
        if strict and not np.all(good & (whole | ~inside)):
            raise Unexpected('row')
        values = np.where(good, values, 0)
        width = np.where(good, width, 0)
        one, two = data[values].astype(np.int64), data[values + 1].astype(np.int64)
        topic = np.select(
            [topic_type == 8, topic_type == 9, width == 1], [0, 1, one], one << 8 | two
        )
        time = (
            np.ascontiguousarray(rows(data, values + width, 8)).view('>i8')[:, 0].astype(np.int64)
        )
        # A row that goes on in other pages has length -1: another topic's, or SQL has to read it.
        length = np.where(whole, length, -1)
        keep = good if strict else whole
        return Rows(id[keep], topic[keep], time[keep], data, begin[keep], length[keep])


def _varint(data: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """
    Return the numbers that begin at these places, and where they end.

    A number has 1 to 9 bytes, seven bits in each.

    """
    last = len(data) - 1
    byte = data[np.minimum(at, last)].astype(np.int64)
    value, at = byte & 127, at + 1
    more = np.flatnonzero(byte > 127)
    for k in range(7):
        if not len(more):
            return value, at
        byte = data[np.minimum(at[more], last)].astype(np.int64)
        value[more] = value[more] << 7 | byte & 127
        at[more] += 1
        more = more[byte > 127]
    value[more] = -1            # nine bytes: nothing here is so large
    return value, at
