"""Scores the reading of text: how many texts are read wholly right, frame by frame, in their roles, with nothing lost.

    python benchmarks/score_text.py styles|second [--half fit|held|all] [--count N] [--first-seed N] [-v]
    python benchmarks/score_text.py pastes FOLDER [-v]
    python benchmarks/score_text.py law FOLDER [-v]

`styles` are texts of `textstyles`, drawn from the rows of its tables that nothing is fitted on (`held`) or from the
others; wrong ones are counted by the row that they were drawn from. `second` are those of `textstyles_second`.
`pastes` are texts of people with their truth (`truth.jsonl`, as `score_pastes.py` of the corpus reads it). `law`: one
more everyday line behind a paste that is read right changes no frame. `--reader NAME` takes another reader of lines,
`module:function`, in place of the product's.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from importlib import import_module
from pathlib import Path
from random import Random
from typing import Any

import textstyles
import textstyles_second
from textstyles import EVERYDAY, Drawn

from analyzer.paste import PastedFrame, PasteError, read
from captures import hexwords
from captures.errors import HexError

Piece = tuple[str, str]  # role, or the kind of what is no whole frame; hex


def pieces_of(text: str) -> tuple[list[Piece], str]:
    """The right frames of a text with their roles, and all its other bytes."""
    try:
        paste = read(text)
    except (HexError, PasteError):
        return [], ""
    frames, rest = [], []
    for piece in paste.pieces:
        if isinstance(piece, PastedFrame) and piece.check_ok is not False:
            frames.append((piece.role.name.lower(), piece.adu.data.hex()))
        else:
            rest.append((piece.adu.data if isinstance(piece, PastedFrame) else piece.data).hex())
    return frames, "".join(rest)


def wrong_in(text: str, wanted: Sequence[Piece], others: str | None) -> list[str]:
    """What of a text is read wrongly; `others` are the bytes that belong to no whole frame, None where they are any."""
    frames, rest = pieces_of(text)
    left, wrong = list(frames), []
    for piece in wanted:
        same = piece if piece in left else next((one for one in left if one[1] == piece[1]), None)
        if same is None:
            wrong.append(f"lost {piece[1][:24]}")
            continue
        left.remove(same)
        if same != piece:
            wrong.append(f"{piece[1][:24]} is a {piece[0]}")
    wrong += [f"nobody sent {data[:24]} ({role})" for role, data in left]
    if others is not None and rest != others:
        wrong.append(f"other bytes {rest[:32] or '-'}, not {others[:32] or '-'}")
    return wrong


def truth_of(one: Drawn) -> tuple[list[Piece], str]:
    """The frames of a drawn text, and the bytes of it that are in none."""
    frames, rest = [], ""
    for said in one.said:
        if said.kind == "damaged":
            rest += said.data.hex()
            continue
        stray = said.kind == "behind a stray"
        rest += said.data[:stray].hex()
        frames.append((said.role, said.data[stray:].hex()))
    return frames, rest


def styles(drawn: Callable[[int, str], Drawn], half: str, seeds: range, verbose: bool) -> None:
    """How many drawn texts are right, and what the wrong ones have in common."""
    right, met, failed, size = 0, Counter[str](), Counter[str](), 0
    begun = time.process_time()
    for seed in seeds:
        one = drawn(seed, half)
        size += len(one.text)
        names = [
            f"{name}: {row}"
            for name, row in zip(
                ("envelope", "stamp", "speaker", "writing", "tail", "join", "copy", "damage"), one.rows, strict=False
            )
        ]
        met.update(names)
        if wrong := wrong_in(one.text, *truth_of(one)):
            failed.update(names)
            if verbose:
                print(seed, one.rows, "; ".join(wrong)[:160])
        right += not wrong
    spent = time.process_time() - begun
    worst = sorted(failed, key=lambda name: failed[name] / met[name], reverse=True)[:12]
    print("; ".join(f"{name} {failed[name]} of {met[name]}" for name in worst))
    print(f"{half}: {right} of {len(seeds)} right ({right / len(seeds):.3f}), {spent / size * 1e6:.1f} us a byte")


def truths(folder: Path) -> Iterable[tuple[dict[str, Any], str, list[Piece], str | None]]:
    """The pastes of a folder with their truth."""
    for line in (folder / "truth.jsonl").open(encoding="utf-8"):
        truth = json.loads(line)
        pieces = truth["pieces"]
        frames = [(piece["role"], piece["hex"]) for piece in pieces if piece["kind"] == "frame"]
        others = "".join(piece["hex"] for piece in pieces if piece["kind"] != "frame")
        text = (folder / truth["file"]).read_text(encoding="utf-8", errors="replace")
        yield truth, text, frames, None if truth["envelope"] == "none" else others


def pastes(folder: Path, verbose: bool) -> None:
    """How many pastes are right."""
    right = count = 0
    for truth, text, frames, others in truths(folder):
        wrong = wrong_in(text, frames, others)
        count, right = count + 1, right + (not wrong)
        if wrong and verbose:
            print(truth["file"], "; ".join(wrong)[:200])
    print(f"{folder.name}: {right} of {count} right")


def law(folder: Path, verbose: bool) -> None:
    """One more everyday line changes no frame with a right check value."""
    broken = tried = 0
    for truth, text, _, _ in truths(folder):
        frames = pieces_of(text)[0]
        for name, line in EVERYDAY.items():
            seed = f"{name} {truth['file']}"
            more = f"{text.rstrip()}\n{line(Random(seed))}\n"
            tried += 1
            if frames and pieces_of(more)[0] != frames:
                broken += 1
                if verbose:
                    print(truth["file"], name)
    print(f"{folder.name}: {broken} of {tried} broken by one more line")


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("what", choices=("styles", "second", "pastes", "law"))
    parser.add_argument("folder", type=Path, nargs="?")
    parser.add_argument("--half", choices=("fit", "held", "all"), default="held")
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--reader", help="module:function that reads lines in place of the product's")
    parser.add_argument("-v", action="store_true")
    given = parser.parse_args(arguments)
    if given.reader:
        module, _, name = given.reader.partition(":")
        setattr(hexwords, "read_lines", getattr(import_module(module), name))  # noqa: B010 - a name that it imports
    seeds = range(given.first_seed, given.first_seed + given.count)
    if given.what in ("styles", "second"):
        drawn = textstyles.drawn if given.what == "styles" else textstyles_second.drawn
        styles(drawn, given.half, seeds, given.v)
    else:
        {"pastes": pastes, "law": law}[given.what](given.folder, given.v)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
