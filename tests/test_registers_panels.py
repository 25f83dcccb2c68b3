"""Tables that panels and loggers write: which column is which, in what form times and numbers are."""

from __future__ import annotations

import pytest

from analyzer.registers.panel import PanelError, read_panel

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
    times, values = read_panel(PANELS[panel], "panel.csv")
    assert list(values) == SHOWN
    assert list(times - times[0]) == pytest.approx([0, 5, 10, 15])


def test_days_and_months_are_told_by_all_rows() -> None:
    rows = "".join(f"{day:02}/04/2026 10:00,{day}.5\n" for day in range(3, 26))
    times, _ = read_panel(f"t,v\n{rows}", "panel.csv")
    assert set(times[1:] - times[:-1]) == {86400.0}


def test_thousands_with_gaps_and_points() -> None:
    text = "t;kWh\n10:00:00;1 234,5\n10:01:00;1.235,5\n10:02:00;1236,5\n"
    assert list(read_panel(text, "panel.csv")[1]) == [1234.5, 1235.5, 1236.5]


@pytest.mark.parametrize("text", ["", "a,b\nc,d\n", "10:00,5\n10:01,6\n", "1;x\n2;y\n3;z\n4;w\n"])
def test_what_is_no_panel_is_one_line(text: str) -> None:
    with pytest.raises(PanelError, match=r"rows of a time and a value, such as .*at least 3") as raised:
        read_panel(text, "panel.csv")
    assert "\n" not in str(raised.value)
