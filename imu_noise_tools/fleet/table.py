# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The one long table of a fleet: fleet.parquet and fleet.csv, a row a coefficient.

``kind`` is ``coefficient`` (what was fitted), ``missing`` (a parameter of an effect that the
diagnosis found missing) or ``failed`` (a bag that gave nothing, with its one-line ``error``).
``warnings`` are those of the recording, as of ``analyse``, between `` | ``; a row with a word in
``left_out`` counts in no value of a unit or a model (the unit of its samples is suspected).
Values are SI; where ``null`` is true the value cannot be told from zero and ``upper95`` limits it.
What a record says of an amplitude that it does not show well is more than a value or a limit: its
likelihood, in the numbers ``square``, ``square_std``, ``square_dof`` (:mod:`.amplitude`).

"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from datetime import datetime, timezone
import io
from pathlib import Path
from typing import Any

from . import extra
from .amplitude import SQUARE
from .inputs import Bag, DATE
from ..core import files
from ..core.errors import InputError

NUMBERS = ('value', 'std', 'lo', 'hi', 'upper95', *SQUARE, 'held_out', 'gain', 'penalty',
           'probability', 'rate_hz', 'duration_s')
FACTORS = ('firmware', 'mount', DATE)
ORDER = ('unit', 'model', *FACTORS, 'bag', 'topic', 'axis', 'kind', 'effect', 'parameter', 'value',
         'std', 'lo', 'hi', 'null', 'upper95', *SQUARE, 'si', 'verdict', 'held_out', 'gain',
         'penalty', 'probability', 'rate_hz', 'duration_s', 'left_out', 'warnings', 'key', 'error')
BETWEEN = ' | '     # warnings of one recording
BATCH = 50_000      # rows that are plain objects at one time
STEM = 'fleet'


def table(found: Iterable[tuple[Bag, str, Mapping[str, Any]]], factors: Iterable[str] = ()) -> Any:
    """
    Return the long table, of pyarrow, from each bag with its key and facts.

    ``factors`` are its further columns. Rows are taken in batches, so that memory does not go with
    the plain rows of all bags.

    """
    pa = extra('pyarrow')
    more = [f for f in dict.fromkeys(factors) if f not in FACTORS]
    word = pa.dictionary(pa.int32(), pa.string())
    schema = pa.schema([
        (name, pa.bool_() if name == 'null' else pa.float64() if name in NUMBERS else word)
        for name in (*ORDER, *more)])
    done, rows = [], []
    for bag, key, facts in found:
        rows += _rows(bag, key, facts)
        if len(rows) >= BATCH:
            done.append(pa.Table.from_pylist(rows, schema))
            rows = []
    done.append(pa.Table.from_pylist(rows, schema))
    return pa.concat_tables(done).unify_dictionaries()


def _rows(bag: Bag, key: str, facts: Mapping[str, Any]) -> list[dict[str, Any]]:
    one = {'unit': bag.unit, 'model': bag.model, 'bag': bag.path, 'topic': bag.topic, 'key': key,
           **{k if k not in ORDER or k in FACTORS else f'{k}_': v
              for k, v in bag.factors.items()}}
    if facts['error']:
        return [{**one, 'kind': 'failed', 'error': facts['error']}]
    one['warnings'] = BETWEEN.join(facts.get('warnings', ()))
    out = []
    for row in facts['rows']:
        start = row.get('start') or 0
        dated = {} if DATE in one or start < 1e8 else {
            DATE: datetime.fromtimestamp(start, timezone.utc).date().isoformat()}
        out.append({**one, **dated, **{k: v for k, v in row.items() if k != 'start'}})
    return out


def write(folder: Path, whole: Any) -> None:
    """Write both files of a table."""
    text = io.BytesIO()
    extra('pyarrow.csv').write_csv(whole, text)
    buffer = io.BytesIO()
    extra('pyarrow.parquet').write_table(whole, buffer, compression='zstd')
    files.atomic_write(folder / f'{STEM}.parquet', buffer.getvalue())
    files.atomic_write(folder / f'{STEM}.csv', text.getvalue())


def read(folder: str | Path) -> Any:
    """Return the table of a fleet's folder; raise InputError where there is none."""
    path = Path(folder) / f'{STEM}.parquet'
    pa, parquet = extra('pyarrow'), extra('pyarrow.parquet')
    try:
        whole = parquet.read_table(path)
        missing = set(ORDER) - set(whole.column_names)
    except FileNotFoundError:
        raise InputError(f'{folder}: no {path.name} in it', 'name a folder that fleet wrote'
                         ) from None
    except (OSError, pa.ArrowException) as error:
        raise InputError(f'{path}: damaged ({str(error).splitlines()[0]})',
                         'run the fleet again: what is done is kept') from None
    if missing:
        raise InputError(f'{path}: no column {sorted(missing)[0]}',
                         'not the table of a fleet, or of an older one: run it again')
    return whole


def factors_of(whole: Any) -> list[str]:
    """Return the columns that are factors: firmware, mount, date and a manifest's own."""
    return [n for n in whole.column_names if n in FACTORS or n not in ORDER]
