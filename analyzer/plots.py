"""Pictures of a capture for notebooks, by matplotlib: `bus.plot.timeline()`, `.response_times()`, `.register()`.

They draw the tables that `rtuscope export --table` writes. Each takes an `Axes` to draw on, or makes one, and gives it
back, for titles and limits of one's own. What is foreign is drawn as harmless text, never as matplotlib's mathematics.
"""

from __future__ import annotations

import io
from collections import defaultdict
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from dissectors.values import harmless

from .exports.records import AREA_NAMES
from .extras import needs
from .words import HOUR_NS, is_clock, moment

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from .analysis import Analysis

_STATUSES: Final = {  # what became of a request: colour, mark
    "answered": ("tab:blue", "|"),
    "exception": ("tab:orange", "s"),
    "unanswered": ("tab:red", "x"),
    "damaged": ("tab:purple", "d"),
    "unheard": ("tab:gray", "."),
    "broadcast": ("tab:green", "|"),
}
_BINS: Final = 4000  # along the time: marks that would fall on one another are drawn once
_MS: Final = 1e6
_WIDE: Final = (9.0, 3.5)  # inches


class Plots:
    """The pictures of one analysis; ImportError says how to get matplotlib where it is not here."""

    def __init__(self, bus: Analysis) -> None:
        self._bus = bus

    def timeline(self, ax: Axes | None = None) -> Axes:
        """What became of each unit's requests, over time. ValueError for a capture without times."""
        self._timed()
        points: dict[str, list[tuple[NDArray[Any], NDArray[Any]]]] = defaultdict(list)
        for columns in self._bus.columns("transactions"):
            statuses, units = np.array(columns["status"], object), np.array(columns["unit"], np.int64)
            times = np.array(columns["t_start_ns"], np.int64)
            for status in set(columns["status"]):
                chosen = statuses == status
                points[status].append((times[chosen], units[chosen]))
        drawn = {status: (_side_by_side(parts, 0), _side_by_side(parts, 1)) for status, parts in points.items()}
        ax = _axes(ax)
        all_units = sorted({unit for _, units in drawn.values() for unit in units.tolist()})
        lanes = {unit: lane for lane, unit in enumerate(all_units)}
        axis = _TimeAxis(ax, [times for times, _ in drawn.values()])
        for status in (name for name in _STATUSES if name in drawn):
            times, units = drawn[status]
            lane = np.array([lanes[unit] for unit in units.tolist()], np.int64)
            kept = _apart(times, lane)
            colour, mark = _STATUSES[status]
            words = f"{status} ({len(times):,})"
            ax.plot(axis.places(times[kept]), lane[kept], mark, color=colour, label=words, markersize=6)
        ax.set_yticks(range(len(all_units)), [f"unit {unit}" for unit in all_units])
        ax.set_ylim(-0.6, max(len(all_units), 1) - 0.4)
        ax.set_title("requests, and what became of them")
        return _with_legend(ax)

    def response_times(self, ax: Axes | None = None) -> Axes:
        """How many of a unit's answers came within a time. A band where the tap tells only between which times."""
        low: dict[int, list[int]] = defaultdict(list)
        high: dict[int, list[int]] = defaultdict(list)
        unknown = 0
        for columns in self._bus.columns("transactions"):
            names = ("unit", "response", "response_time_ns", "response_time_low_ns", "response_time_high_ns")
            for unit, response, exact, least, most in zip(*(columns[name] for name in names), strict=True):
                soonest, latest = (least, most) if exact is None else (exact, exact)
                if soonest is not None and latest is not None:
                    low[unit].append(soonest)
                    high[unit].append(latest)
                else:
                    unknown += response is not None
        ax = _axes(ax)
        for unit in sorted(low):
            share = np.arange(1, len(low[unit]) + 1) / len(low[unit])
            begin, end = (np.sort(np.array(times[unit])) / _MS for times in (low, high))
            (line,) = ax.step(end, share, where="post", label=f"unit {unit} ({len(share):,})")
            ax.fill_betweenx(share, begin, end, color=line.get_color(), alpha=0.3, step="pre")
        ax.set_xscale("symlog", linthresh=0.1)
        ax.set_xlabel("response time, ms")
        ax.set_ylabel("share of answers")
        ax.set_title("response times" + (f"; of {unknown:,} answers this tap cannot tell them" if unknown else ""))
        return _with_legend(ax)

    def register(self, unit: int, address: int, *, area: str = "holding", ax: Axes | None = None) -> Axes:
        """What a register, coil or input was, over time; by a map (`with_maps`) its value, name and measure.

        `address` counts from 0, as on the wire. ValueError where nothing of it was read or written.
        """
        self._timed()
        if area not in AREA_NAMES.values():
            raise ValueError(f"no area {area!r}: {', '.join(AREA_NAMES.values())}")
        times, values, name, measure = [], [], None, None
        for record in self._readings(unit, address, area):
            number = record.get("value")
            times.append(record["t_ns"])
            values.append(number if number is not None else record["raw"])
            name, measure = record.get("name") or name, record.get("unit_of_measure") or measure
        if not times:
            raise ValueError(f"nothing is known of {area} {address} of unit {unit}")
        ax = _axes(ax)
        moments = np.array(times, np.int64)
        order = np.argsort(moments, kind="stable")
        axis = _TimeAxis(ax, [moments])
        numbers = np.array([np.nan if value is None else float(value) for value in values])
        ax.step(axis.places(moments[order]), numbers[order], ".-", where="post")
        ax.set_title(_label_text(f"unit {unit}: {name or f'{area} {address}'}"))
        ax.set_ylabel(_label_text(measure or ("value" if name else "raw value")))
        return ax

    def _timed(self) -> None:
        if not self._bus.capture.timed:
            raise ValueError("this capture has no times, along which anything could be drawn")

    def _readings(self, unit: int, address: int, area: str) -> Iterator[Mapping[str, Any]]:
        for columns in self._bus.columns("values"):
            names = list(columns)
            wanted = (np.array(columns["unit"]) == unit) & (np.array(columns["address"]) == address)
            wanted &= np.array(columns["area"], object) == area
            for at in np.flatnonzero(wanted).tolist():
                yield {name: columns[name][at] for name in names}


def series_over_time(
    series: Mapping[str, tuple[NDArray[np.int64], NDArray[np.float64]]],
    title: str,
    ax: Axes | None = None,
    measure: str = "raw value",
) -> Axes:
    """Values over time, a stepped line for each name: of its values the times (ns, in order), and themselves.

    Along dates where the times have any and are more than an hour; else along seconds.
    """
    ax = _axes(ax)
    moments = [times for times, _ in series.values()]
    known = np.concatenate([np.zeros(0, np.int64), *moments])
    dated = len(known) > 0 and is_clock(int(known.min())) and int(np.ptp(known)) > HOUR_NS
    axis = None if dated else _TimeAxis(ax, moments)
    for name, (times, values) in series.items():
        places = times.astype("datetime64[ns]") if axis is None else axis.places(times)
        many = len(times) > _BINS  # in a picture of lines each would be a stroke of its own
        ax.step(
            places, values, ".-", where="post", markersize=2, linewidth=0.8, label=_label_text(name), rasterized=many
        )
    if dated:
        from matplotlib.dates import AutoDateLocator, ConciseDateFormatter

        locator = AutoDateLocator()
        ax.xaxis.set_major_locator(locator)
        ax.xaxis.set_major_formatter(ConciseDateFormatter(locator))
        ax.set_xlabel("UTC")
    ax.set_ylabel(_label_text(measure))
    ax.set_title(_label_text(title))
    return _with_legend(ax)


def drawn_series(
    kind: str,
    series: Mapping[str, tuple[NDArray[np.int64], NDArray[np.float64]]],
    title: str,
    measure: str = "raw value",
) -> bytes:
    """The same as a file of a kind, `png`, `svg` or `pdf`. ImportError says how to get matplotlib."""
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise ImportError(needs("a picture", "matplotlib", "plot"), name="matplotlib") from error
    figure = Figure(figsize=_WIDE, layout="constrained")
    series_over_time(series, title, figure.subplots(), measure)
    file = io.BytesIO()
    figure.savefig(file, format=kind, dpi=150)
    return file.getvalue()


class _TimeAxis:
    """Seconds along the bottom, since the first of these times."""

    def __init__(self, ax: Axes, times: list[NDArray[np.int64]]) -> None:
        known = np.concatenate([np.zeros(0, np.int64), *times])
        self._first = int(known.min()) if len(known) else 0
        ax.set_xlabel(f"s since {moment(self._first)}" if len(known) and is_clock(self._first) else "s")

    def places(self, times: NDArray[np.int64]) -> NDArray[np.float64]:
        return (times - self._first) / 1e9


def _axes(ax: Axes | None) -> Axes:
    if ax is not None:
        return ax
    try:
        from matplotlib import pyplot
    except ImportError as error:
        raise ImportError(needs("bus.plot", "matplotlib", "plot"), name="matplotlib") from error
    axes: Axes = pyplot.subplots(figsize=_WIDE, layout="constrained")[1]
    return axes


def _with_legend(ax: Axes) -> Axes:
    """With a legend, where there is anything to tell."""
    if ax.get_legend_handles_labels()[0]:
        ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize="small")
    return ax


def _label_text(text: str) -> str:
    return harmless(text).replace("$", r"\$")  # matplotlib would read mathematics between two of them


def _side_by_side(parts: list[tuple[NDArray[Any], NDArray[Any]]], side: int) -> NDArray[np.int64]:
    return np.concatenate([part[side] for part in parts])


def _apart(times: NDArray[np.int64], lanes: NDArray[np.int64]) -> NDArray[np.intp]:
    """Places of marks that can be told apart in a picture."""
    first = int(times.min())
    step = max(1, (int(times.max()) - first) // _BINS)
    kept: NDArray[np.intp] = np.unique(lanes * (_BINS + 2) + (times - first) // step, return_index=True)[1]
    return kept
