"""Laws of reading text, on texts that are drawn: what a line more, a wrap, or another way in must not change."""

from __future__ import annotations

from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

from hypothesis import given, settings
from hypothesis import strategies as st
from scripts import script

import analyzer

styles, second, score = script("textstyles"), script("textstyles_second"), script("score_text")
SEEDS = st.integers(0, 400)
PLAIN_WIDTHS = st.integers(40, 110)


def test_the_laws_are_told_of_texts_that_hold_frames() -> None:
    assert all(score.pieces_of(styles.drawn(seed).text)[0] for seed in range(20))


@settings(max_examples=40, derandomize=True)
@given(SEEDS, st.sampled_from(sorted(styles.EVERYDAY)))
def test_one_more_everyday_line_changes_no_frame(seed: int, name: str) -> None:
    text = styles.drawn(seed).text
    more = f"{text}{styles.EVERYDAY[name](Random(f'{name} {seed}'))}\n"
    assert score.pieces_of(more)[0] == score.pieces_of(text)[0]


@settings(max_examples=40, derandomize=True)
@given(SEEDS, st.sampled_from(sorted(second.EVERYDAY)), st.booleans())
def test_an_everyday_line_of_another_hand_changes_no_byte(seed: int, name: str, before: bool) -> None:
    text = second.drawn(seed).text
    line = f"{second.EVERYDAY[name](Random(f'{name} {seed}'))}\n"
    assert score.pieces_of(line + text if before else text + line) == score.pieces_of(text)


@settings(max_examples=40, derandomize=True)
@given(SEEDS, SEEDS)
def test_a_conversation_in_any_style_has_the_same_frames(seed: int, way: int) -> None:
    said = styles.conversation(Random(f"restyled {seed}"), "rtu")
    text = "\n".join(second.styled(said, second.style(Random(way), "all"), Random(seed)))
    assert score.pieces_of(text) == ([(one.role, one.data.hex()) for one in said], ""), text


@settings(max_examples=20, derandomize=True)
@given(SEEDS, st.sampled_from(["    {}", "{}  ", "\t{}", "{}\r"]))
def test_blanks_around_the_lines_of_a_text_change_no_frame(seed: int, around: str) -> None:
    text = styles.drawn(seed).text
    framed = "\n".join(around.format(line) for line in text.splitlines())
    assert score.pieces_of(framed)[0] == score.pieces_of(text)[0]


@settings(max_examples=30, derandomize=True)
@given(SEEDS)
def test_a_paste_and_a_file_tell_the_same_frames(seed: int) -> None:
    text = styles.drawn(seed).text
    with TemporaryDirectory() as folder:
        path = Path(folder) / "bus.log"
        path.write_text(text, encoding="utf-8")
        frames = [frame for frame in analyzer.open(path).frames() if frame.adu.check_ok is not False]
    assert [(frame.role.name.lower(), frame.adu.data.hex()) for frame in frames] == score.pieces_of(text)[0]


@settings(max_examples=40, derandomize=True)
@given(SEEDS, PLAIN_WIDTHS, st.booleans(), st.sampled_from(["pairs", "0x", "dashes", "0x commas", "brackets"]))
def test_a_wrap_anywhere_loses_nothing(seed: int, width: int, soft: bool, writing: str) -> None:
    said = styles.conversation(Random(f"wrapped {seed}"), "rtu")
    lines = [
        line
        for one in said
        for line in styles.wrapped(
            f"{styles.STAMPS['clock'](one.ms)}{'TX' if one.sent else 'RX'}: {styles.WRITINGS[writing](one.data)}",
            width,
            soft,
        )
    ]
    text = "\n".join(lines) + "\n"
    assert score.pieces_of(text)[0] == [(one.role, one.data.hex()) for one in said], text
