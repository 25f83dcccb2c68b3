"""Tables that panels and loggers write: which column is which, in what form times and numbers are."""

from __future__ import annotations

import json
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from buses import write_meter
from running import ran

from analyzer.registers.inference import infer
from analyzer.registers.like import Match, matches_of_series
from analyzer.registers.panel import PanelError, read_panel
from analyzer.registers.readings import RegisterReadings

SHOWN = [23.4, 23.5, 23.9, 24.25]
PANELS = {
    "a Russian panel": "Дата и время;Температура, °C\n22.11.2026 21:05:10;23,4\n22.11.2026 21:05:15;23,5\n"
    "22.11.2026 21:05:20;23,9\n22.11.2026 21:05:25;24,25\n",
    "a number before the time, units behind values": "№;Время;Значение\n1;21:05:10;23,4 °C\n2;21:05:15;23,5 °C\n"
    "3;21:05:20;23,9 °C\n4;21:05:25;24,25 °C\n",
    "date and time apart, milliseconds": "Date\tZeit\tT\n22.11.26\t21:05:10,000\t23,4\n22.11.26\t21:05:15,000\t23,5\n"
    "22.11.26\t21:05:20,000\t23,9\n22.11.26\t21:05:25,000\t24,25\n",
    "months first, twelve hours": "Time,Value\n11/22/2026 9:05:10 PM,23.4\n11/22/2026 9:05:15 PM,23.5\n"
    "11/22/2026 9:05:20 PM,23.9\n11/22/2026 9:05:25 PM,24.25\n",
    "gaps and a state before the value": "time,state,T\n2026-11-22T21:05:10Z,ok,23.4\n2026-11-22T21:05:15Z,ok,23.5\n"
    "2026-11-22T21:05:18Z,bad,---\n2026-11-22T21:05:20Z,ok,23.9\n2026-11-22T21:05:25Z,ok,24.25\n",
    "quoted decimal commas, titles above": 'Report of unit 7\n\n"Time","Value"\n"21:05:10","23,4"\n"21:05:15","23,5"\n'
    '"21:05:20","23,9"\n"21:05:25","24,25"\n',
    "seconds and nothing else": "0\t23.4\n5\t23.5\n10\t23.9\n15\t24.25\n",
    "milliseconds since 1970": "t,v\n1795381510000,23.4\n1795381515000,23.5\n1795381520000,23.9\n1795381525000,24.25\n",
}


@pytest.mark.parametrize("panel", PANELS)
def test_a_panel_is_read(panel: str) -> None:
    table = read_panel(PANELS[panel], "panel.csv")
    assert list(table.values) == SHOWN
    assert list(table.times_s - table.times_s[0]) == pytest.approx([0, 5, 10, 15])


def test_days_and_months_are_told_by_all_rows() -> None:
    rows = "".join(f"{day:02}/04/2026 10:00,{day}.5\n" for day in range(3, 26))
    times = read_panel(f"t,v\n{rows}", "panel.csv").times_s
    assert set(times[1:] - times[:-1]) == {86400.0}


def test_thousands_with_gaps_and_points() -> None:
    text = "t;kWh\n10:00:00;1 234,5\n10:01:00;1.235,5\n10:02:00;1236,5\n"
    assert list(read_panel(text, "panel.csv").values) == [1234.5, 1235.5, 1236.5]


@pytest.mark.parametrize("text", ["", "a,b\nc,d\n", "10:00,5\n10:01,6\n", "1;x\n2;y\n3;z\n4;w\n"])
def test_what_is_no_panel_is_one_line(text: str) -> None:
    with pytest.raises(PanelError, match=r"rows with a time and a value, such as .*at least 3") as raised:
        read_panel(text, "panel.csv")
    assert "\n" not in str(raised.value)


def test_hours_run_over_midnight() -> None:
    table = read_panel("t;T\n23:59:50;1\n23:59:55;2\n00:00:00;3\n00:00:05;4\n", "panel.csv")
    assert (table.beginning, list(table.values)) == ("midnight", [1, 2, 3, 4])
    assert list(table.times_s - table.times_s[0]) == [0, 5, 10, 15]


BEGIN = datetime(2026, 7, 1, 9, 30, tzinfo=UTC)
POLLS, EVERY_S = 2700, 4  # three hours


def heard() -> tuple[RegisterReadings, np.ndarray]:
    """A temperature in register 41 beside one that goes its own way, and what the first one was."""
    chance = np.random.default_rng(5)
    warmth = np.round(60 + np.cumsum(chance.normal(0, 0.15, POLLS)) + np.sin(np.arange(POLLS) / 40), 1)
    other = np.round(500 + np.cumsum(chance.normal(0, 1, POLLS)))
    readings = RegisterReadings(1 << 14)
    words = np.stack([other, np.round(warmth * 10)], axis=1).astype(np.uint16)
    times = int(BEGIN.timestamp()) * 10**9 + np.arange(POLLS, dtype=np.int64) * EVERY_S * 10**9
    readings.put(1, "input", 40, words, times)
    return readings, warmth


def found_by(form: str, ahead: timedelta, late_s: float = 0.0) -> Match:
    """The best match of half an hour from a panel whose clock is so far ahead and its display so late."""
    readings, warmth = heard()
    rows = []
    for poll in range(900, 1350, 5):
        shown = BEGIN + timedelta(seconds=poll * EVERY_S + late_s) + ahead
        rows.append(f"{shown.strftime(form)};{warmth[poll]:.1f}".replace(".", ","))
    table = read_panel("Zeit;T\n" + "\n".join(rows) + "\n", "panel.csv")
    best = matches_of_series(readings, table, infer(readings))[0]
    assert (best.address, best.words, best.scale, best.offset) == (41, 1, 0.1, 0)
    return best


@pytest.mark.parametrize("form", ["%Y-%m-%d %H:%M:%S", "%H:%M:%S"])
@pytest.mark.parametrize("hours", [0, 1, -1, 3, -5])
def test_a_panel_in_another_zone_is_no_process_that_lags(form: str, hours: int) -> None:
    best = found_by(form, timedelta(hours=hours), late_s=8)
    assert best.clock_s == (hours * 3600 or None)
    assert best.lag_s is not None
    assert -8 <= best.lag_s <= -8 + EVERY_S


@pytest.mark.parametrize("seconds", [437, -1250])
def test_a_clock_that_is_wrong_by_minutes_is_told_and_the_lag_is_not(seconds: int) -> None:
    best = found_by("%Y-%m-%d %H:%M:%S", timedelta(seconds=seconds))
    assert best.clock_s == pytest.approx(seconds, abs=EVERY_S)
    assert best.lag_s is None


def test_seconds_of_no_clock_are_laid_where_they_fit() -> None:
    readings, warmth = heard()
    rows = "".join(f"{7 + n * 20}\t{warmth[300 + 5 * n]}\n" for n in range(80))
    best = matches_of_series(readings, read_panel(f"t\tT\n{rows}", "panel.csv"), infer(readings))[0]
    assert (best.address, best.scale, best.clock_s, best.lag_s) == (41, 0.1, None, None)


def test_registers_that_make_a_huge_double_do_not_overflow() -> None:
    volts = 2300 + np.arange(30) % 7
    words = np.stack([volts, *(np.full(30, 9 * at) for at in range(3)), 0x6974 + volts % 5], axis=1)
    readings = RegisterReadings()
    rows = np.concatenate((words, np.ones((30, 3))), axis=1).astype(np.uint16)
    readings.put(1, "input", 0, rows, np.arange(30) * 10**9)
    table = read_panel("\n".join(f"{at}\t{number}" for at, number in enumerate(volts / 10)), "panel.csv")
    with np.errstate(over="raise"):
        found = matches_of_series(readings, table, infer(readings))
    assert (found[0].address, found[0].words, found[0].scale) == (0, 1, 0.1)


def test_the_command_says_how_the_clocks_differ(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    chance = np.random.default_rng(3)
    volts = [float(value) for value in 230 + np.cumsum(chance.normal(0, 0.4, 600))]
    bus, panel = tmp_path / "bus.jsonl", tmp_path / "panel.csv"
    write_meter(bus, volts)
    begin = datetime.fromtimestamp(1_780_000_000 + 3600 + 2, UTC)
    rows = (f"{begin + timedelta(seconds=n):%d.%m.%Y %H:%M:%S};{volts[n]:.2f}\n" for n in range(100, 400, 3))
    panel.write_text("Zeit;Spannung\n" + "".join(rows))
    first, second = ran(capsys, "registers", bus, "--like", panel).out.splitlines()[:2]
    assert first == (
        "the clocks differ by 1 h 0 min: the table's is ahead of the capture's (a time zone, or summer time)"
    )
    assert second.startswith("unit 1 holding 0: f32 ABCD showed ")
    best = json.loads(ran(capsys, "registers", bus, "--like", panel, "--json").out.splitlines()[0])
    assert best["clock_s"] == 3600
    assert best["lag_s"] == pytest.approx(-2, abs=1)
