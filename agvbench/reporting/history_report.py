"""The page of a history: steps first, then the trend of every metric, then levels and what was not read."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from agvbench.campaign.atomic_files import made_folder, replace_whole
from agvbench.campaign.tables.parquet import to_parquet
from agvbench.errors import FileError
from agvbench.plot.style import condition_numbers
from agvbench.reporting.content import (
    Block,
    Bullets,
    Column,
    Content,
    FigureBlock,
    Panel,
    Paragraph,
    Table,
    Value,
    plain,
)
from agvbench.reporting.figures.history import draw_history
from agvbench.reporting.figures.style import legend
from agvbench.reporting.pages import to_html
from agvbench.reporting.progress import track
from agvbench.statistics.end_poses import in_order
from agvbench.workflows.history.result import NIGHTS_FILE, History

PAGE = "history.html"
_FACTS_SHOWN = 6
_CHANGES = (
    Column("driven", "first night after"),
    Column("interval", "95 % interval"),
    Column("metric", "metric"),
    Column("condition", "condition"),
    Column("levels", "levels"),
    Column("in_sd", "change in sd", 1),
    Column("words", "changed there"),
)
_SERIES = (
    Column("metric", "metric"),
    Column("condition", "condition"),
    Column("unit", "unit"),
    Column("nights", "nights", 0),
    Column("latest", "latest"),
    Column("level", "level"),
    Column("sd", "sd of nights"),
    Column("repeatability", "repeatability"),
    Column("steps", "steps", 0),
)
_CAPTION = (
    "Mean over trajectories of the medians of absolute values, a point per night; the band is ± two standard errors "
    "that the repeatability causes. A dashed line is a step, the shaded nights are the 95 % interval of its night, "
    "grey lines are levels. A ring is a night that lacks trajectories of other nights, whose values are estimated."
)


def changes_table(history: History) -> Table:
    """Return the steps, the latest first, each with what changed in the interval of its night."""
    digits = dict(zip(history.series["metric"], history.series["digits"], strict=True))
    titles = _titles(history)
    rows = [_change_row(row, titles, digits[row["metric"]]) for row in history.changes.to_dict("records")]
    note = (
        f"The chance of any false step is about {100.0 * history.alpha:g} % over all metrics and conditions. Changes "
        "are in standard deviations of the nights about their levels. What changed there need not be the cause."
    )
    return Table("changes", "Steps, the latest first", _CHANGES, rows, note=note)


def _change_row(row: Mapping[Any, Any], titles: dict[str, str], digits: int) -> list[Value]:
    facts = list(dict.fromkeys(plain(fact) for _, fact in row["facts"]))
    more = [f"and {len(facts) - _FACTS_SHOWN} more"] if len(facts) > _FACTS_SHOWN else []
    number = Column("", "", digits)
    levels = plain(f"{number.shown(row['before'])} → {number.shown(row['after'])} {row['unit']}")
    in_sd = row["change"] / row["sd"] if row["sd"] > 0.0 else math.copysign(math.inf, row["change"])
    words = "; ".join((facts[:_FACTS_SHOWN] + more) or ["nothing that is recorded"])
    night = f"{row['driven']:%Y-%m-%d} {row['campaign']}"
    return [night, _interval(row), titles[row["metric"]], row["condition"], levels, in_sd, words]


def _interval(row: Mapping[Any, Any]) -> str:
    """Return the interval of a step's night: dates, or campaigns where these were driven on one day."""
    if row["earliest"] == row["latest"]:
        return "this night"
    first, last = (f"{row[name]:%Y-%m-%d}" for name in ("earliest_driven", "latest_driven"))
    return f"{row['earliest']} to {row['latest']}" if first == last else f"{first} to {last}"


def series_table(history: History) -> Table:
    """Return the latest value, the level and the standard deviations of every series."""
    titles = _titles(history)
    rows: list[list[Value]] = []
    for row in history.series.to_dict("records"):
        number = Column("", "", row["digits"])
        shown = [number.shown(row[name]) for name in ("latest", "level", "sd", "repeatability")]
        rows.append([titles[row["metric"]], row["condition"], row["unit"], row["nights"], *shown, row["steps"]])
    note = (
        "Level: mean of the nights since the last step. sd of nights: about their levels, empty where there are too "
        "few nights to find a step. Repeatability: standard deviation of repeats within a night, median over nights."
    )
    return Table("series", "Every metric", _SERIES, rows, grouped=True, note=note)


def _titles(history: History) -> dict[str, str]:
    return dict(zip(history.series["metric"], history.series["title"], strict=True))


@dataclass(frozen=True)
class WrittenHistory:
    """The files that a history was written into."""

    page: Path
    nights: Path


def write_history(history: History, out: str | Path) -> WrittenHistory:
    """Write the page and the nightly values of `history` into the directory `out`, which is made if it is not there.

    Raises
    ------
    FileError
        If it cannot be written.
    """
    import pyarrow as pa

    out = Path(out)
    first, last = (f"{history.campaigns['driven'].iloc[k]:%Y-%m-%d}" for k in (0, -1))
    subtitle = f"{len(history.campaigns)} campaigns, {first} to {last}"
    text = to_html(f"History of {plain(str(history.folder))}", subtitle, list(_sections(history)))
    table = pa.Table.from_pandas(_as_texts(history), preserve_index=False).replace_schema_metadata(None)
    written = WrittenHistory(out / PAGE, out / NIGHTS_FILE)
    try:
        with made_folder(out):
            _replace(written.page, text.encode())
            _replace(written.nights, to_parquet(table))
    except OSError as error:
        why = error.strerror or str(error)
        raise FileError(f"cannot be written ({why})", where=out, remedy="choose another directory with --out") from None
    return written


def _replace(path: Path, content: bytes | memoryview) -> None:
    replace_whole(path, partial(Path.write_bytes, data=content), durable=False)


def _as_texts(history: History) -> Any:
    """Return the nightly values with plain columns of text, which every reader of parquet knows."""
    nights = history.nights
    return nights.assign(**{str(name): nights[name].astype(str) for name in nights.select_dtypes("category")})


def _sections(history: History) -> Iterator[Content]:
    steps: list[Block] = [Paragraph(history.headline, lead=True)]
    yield Content("steps", "Steps", [*steps, changes_table(history)] if len(history.changes) else steps)
    conditions = condition_numbers(in_order(history.series["condition"]))
    yield Content(
        "trends",
        "Trends",
        [FigureBlock("trends", _CAPTION, list(_panels(history, conditions)), legend(conditions), wide=True)],
    )
    yield Content("levels", "Levels", [series_table(history)])
    yield Content("unread", "Campaigns that cannot be read", list(_unread(history.unread)))


def _panels(history: History, numbers: dict[str, int]) -> Iterator[Panel]:
    kinds = history.series.drop_duplicates(["metric", "unit"])[["metric", "unit", "title"]]
    for metric, unit, title in track(kinds.itertuples(index=False), len(kinds), what="drawing"):
        yield Panel(plain(f"{title} [{unit}]" if unit else title), draw_history(history, metric, unit, numbers))


def _unread(lines: Sequence[str]) -> Iterable[Block]:
    return [Bullets([plain(line) for line in lines])] if lines else [Paragraph("All campaigns were read.")]
