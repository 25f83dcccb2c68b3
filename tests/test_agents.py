"""`rtuscope mcp`: what an agent is told can be looked up, is short, says whose words it repeats, and stays inside."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Any

import pytest
from agentquestions import HOSTILE, hostile_capture, made_captures, questions
from hypothesis import given
from hypothesis import strategies as st
from running import ran, refused

import captures
from analyzer.agents import AgentError
from analyzer.agents.answers import MARK, MOST_TOKENS, citation, token_bound
from analyzer.agents.citations import CitationResolver, citations
from analyzer.agents.root import AgentRoot
from analyzer.agents.tools import AgentTools
from analyzer.simulation import Scenario, simulate

TOOLS = ["captures", "info", "report", "frames", "registers", "values", "parse", "ask"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A root with four captures, and something beside it that is nobody's business."""
    outside = tmp_path_factory.mktemp("agents")
    captures.write(outside / "secret.jsonl", hostile_capture())
    (root := outside / "root").mkdir()
    made_captures(root)
    return root


@pytest.fixture(scope="module")
def tools(folder: Path) -> AgentTools:
    return AgentTools(AgentRoot(folder))


def told(tools: AgentTools, tool: str, **arguments: Any) -> dict[str, Any]:
    """An answer, which is never longer than it may be."""
    text = tools.by_name()[tool](**arguments)
    assert token_bound(text) <= 2000
    answer: dict[str, Any] = json.loads(text)
    return answer


NAMES = ["site/bus0.jsonl", "site/bus1.jsonl", "site/bus2.jsonl", "hostile.jsonl"]


def test_sixty_questions_over_the_wire_and_every_citation_holds(folder):
    mcp = pytest.importorskip("mcp", reason="the package mcp is not installed")
    anyio = pytest.importorskip("anyio")
    from mcp.client.stdio import stdio_client

    asked = questions(NAMES)
    assert len(asked) == 60
    answers = []

    async def ask() -> None:
        command = [sys.executable, ["-m", "analyzer.cli", "mcp", "--root", str(folder)]]
        server = mcp.StdioServerParameters(command=command[0], args=command[1], cwd=str(Path(__file__).parents[1]))
        async with mcp.Client(stdio_client(server)) as client:
            offered = (await client.list_tools()).tools
            assert [tool.name for tool in offered] == TOOLS
            assert all(tool.annotations.read_only_hint and tool.description for tool in offered)
            for question in asked:
                result = await client.call_tool(question.tool, question.arguments)
                assert not result.is_error, (question, result)
                answers.append(result.content[0].text)
            outside = await client.call_tool("info", {"capture": "../secret.jsonl"})
            assert outside.is_error
            assert "absolute" in outside.content[0].text

    anyio.run(ask)
    resolver, statements = CitationResolver(AgentRoot(folder)), 0
    for text in answers:
        assert token_bound(text) <= 2000
        answer = json.loads(text)
        statements += len(answer["statements"])
        assert list(resolver.contradictions(answer)) == []
    assert statements > 250


def test_the_checker_finds_what_is_not_so(folder, tools):
    resolver = CitationResolver(AgentRoot(folder))
    wrong = {
        "frames": lambda each: each.update(unit=each["unit"] + 1),
        "info": lambda each: each.update(cite=each["cite"].replace(":", ":77777")),
        "report": lambda each: each.get("counts", [{}])[0].update(count=1),
        "registers": lambda each: each.update(address=each["address"] + 40_000),
    }
    for tool, change in wrong.items():
        arguments = {"capture": NAMES[0]} | ({"section": "units"} if tool == "report" else {})
        answer = told(tools, tool, **arguments)
        change(answer["statements"][-1])
        assert list(resolver.contradictions(answer)), tool


def test_values_are_those_of_the_answers_cited(folder, tools):
    answer = told(tools, "values", capture="hostile.jsonl", unit=9, area="holding", address=0)
    assert answer["of"] == 1  # they never changed
    statement = answer["statements"][0]
    assert statement["value"] == int.from_bytes(HOSTILE[:2].encode(), "big")
    assert list(CitationResolver(AgentRoot(folder)).contradictions(answer)) == []
    every = told(tools, "values", capture="hostile.jsonl", unit=9, area="holding", address=0, changes=False)
    assert every["of"] == 12


def test_long_answers_come_in_parts_that_make_the_whole(tools):
    offset, frames = 0, []
    while True:
        answer = told(tools, "frames", capture=NAMES[1], offset=offset)
        frames += [each["frame"] for each in answer["statements"]]
        offset = answer.get("next_offset", 0)
        if not offset:
            break
    assert frames == list(range(answer["of"]))


def test_a_bus_of_all_units_is_told_as_shortly(tmp_path):
    made = simulate(Scenario("clean", "precise", transactions=60, seed=5, baud=115_200))
    captures.write(tmp_path / "bus.jsonl", captures.Capture.of(made.line, made.chunks))
    tools = AgentTools(AgentRoot(tmp_path))
    for section in ("all", "units", "polls"):
        told(tools, "report", capture="bus.jsonl", section=section)
    long = " ".join(["11 03 00 6B 00 03 76 87"] * 400)
    assert told(tools, "parse", text=long)["next_offset"] < 400


@given(text=st.text(st.characters(codec="utf-8"), max_size=300))
def test_a_token_is_no_longer_than_a_piece(text):
    """What vocabularies do cannot be had here; a bound that grows with the text can."""
    assert token_bound(text) <= len(text.encode())
    assert token_bound(text + " word") >= token_bound(text)
    assert MOST_TOKENS < 2000


def test_what_a_device_says_is_marked_wherever_it_stands(folder, tools):
    (folder / f"{HOSTILE}.jsonl").write_bytes((folder / "hostile.jsonl").read_bytes())
    try:
        answers = [
            told(tools, "captures"),
            told(tools, "info", capture=f"{HOSTILE}.jsonl"),
            told(tools, "report", capture="hostile.jsonl"),
            told(tools, "frames", capture="hostile.jsonl"),
            told(tools, "frames", capture="hostile.jsonl", filter="response", fields=True),
            told(tools, "registers", capture="hostile.jsonl"),
            told(tools, "parse", text=f"{HOSTILE}\n11 03 00 6B 00 03 76 87"),
        ]
    finally:
        (folder / f"{HOSTILE}.jsonl").unlink()
    marked = [text for answer in answers for text, whose in texts(answer) if whose]
    bare = [text for answer in answers for text, whose in texts(answer) if not whose]
    assert sum(HOSTILE in text for text in marked) >= 6
    assert not [text for text in bare if "Ignore" in text or "delete_all" in text]


def texts(value: Any, whose: bool = False) -> list[tuple[str, bool]]:
    """All texts in a JSON value, and whether each is marked."""
    if isinstance(value, dict):
        return [each for name, inner in value.items() for each in texts(inner, whose or name == MARK)]
    if isinstance(value, list):
        return [each for inner in value for each in texts(inner, whose)]
    return [(value, whose)] if isinstance(value, str) else []


OUTSIDE = [
    "../secret.jsonl", "site/../../secret.jsonl", "/etc/passwd", "C:\\boot.ini", "\\\\host\\share\\x", "..", "", "-",
    "site\\..\\..\\secret.jsonl", "s3://bucket/x", "a\0b", "link.jsonl", "way/secret.jsonl", "pipe", "site",
]  # fmt: skip


@pytest.mark.skipif(os.name != "posix", reason="links and pipes as POSIX has them")
@pytest.mark.parametrize("name", OUTSIDE)
def test_nothing_outside_of_the_root_is_read(name, folder, tools):
    for path, make in {
        "link.jsonl": lambda path: path.symlink_to(folder.parent / "secret.jsonl"),
        "way": lambda path: path.symlink_to(folder.parent, target_is_directory=True),
        "pipe": os.mkfifo,
    }.items():
        if not (folder / path).is_symlink() and not (folder / path).exists():
            make(folder / path)
    with pytest.raises(AgentError):
        tools.info(name)
    with pytest.raises(AgentError):
        tools.ask(name, "SELECT 1")
    with pytest.raises(AgentError):
        tools.registers("hostile.jsonl", map=name or "..")
    assert "secret" not in json.dumps(told(tools, "captures"))


@given(name=st.text(st.sampled_from("./\\ab:"), max_size=12))
def test_a_name_leads_nowhere_else(name, folder):
    try:
        assert AgentRoot(folder).file(name).is_relative_to(folder.resolve())
    except AgentError as error:
        assert "\n" not in str(error)


def test_a_link_that_stays_inside_is_followed(folder, tools):
    if os.name != "posix":
        pytest.skip("links as POSIX has them")
    (folder / "inner.jsonl").symlink_to(folder / "hostile.jsonl")
    try:
        assert told(tools, "info", capture="inner.jsonl") == told(tools, "info", capture="hostile.jsonl")
    finally:
        (folder / "inner.jsonl").unlink()


def test_a_lake_answers_with_its_hash_and_one_with_a_link_outside_is_refused(tmp_path):
    pytest.importorskip("duckdb", reason="duckdb is not installed")
    lakes = pytest.importorskip("lakes")
    captures.write(tmp_path / "bus.mcap", lakes.bus())
    lakes.batch(tmp_path / "root" / "lake", tmp_path / "bus.mcap", site="plant")
    tools = AgentTools(AgentRoot(tmp_path / "root"))
    assert told(tools, "captures")["statements"] == [{"lake": {MARK: "lake"}}]
    answer = told(tools, "ask", lake="lake", question="SELECT count(*) AS n, min(site) AS site FROM frames")
    [statement] = answer["statements"]
    assert statement["n"] > 100
    assert statement["site"] == {MARK: "plant"}
    assert statement["cite"] == f"{answer['sha256'][:12]}:r0"
    assert told(tools, "ask", lake="lake", question="worst-units")["statements"]
    assert "disabled" in refusal(tools, f"SELECT * FROM read_csv('{tmp_path / 'bus.mcap'}')")
    assert "only SELECT" in refusal(tools, "DROP VIEW frames")
    if os.name == "posix":
        (tmp_path / "root" / "lake" / "frames" / "out.parquet").symlink_to(tmp_path / "bus.mcap")
        with pytest.raises(AgentError, match="link"):
            tools.ask("lake", "SELECT 1")


def refusal(tools: AgentTools, question: str) -> str:
    from analyzer.fleet import FleetError

    with pytest.raises(FleetError) as refused:
        tools.ask("lake", question)
    return str(refused.value)


def test_a_capture_that_changed_is_read_anew(tmp_path):
    path, tools = tmp_path / "bus.jsonl", AgentTools(AgentRoot(tmp_path))
    captures.write(path, hostile_capture())
    before = told(tools, "info", capture="bus.jsonl")
    made = simulate(Scenario("clean", "precise", transactions=20, seed=5, baud=9600))
    captures.write(path, captures.Capture.of(made.line, made.chunks))
    assert told(tools, "info", capture="bus.jsonl")["sha256"] != before["sha256"]


def test_a_text_of_an_agent_s_is_looked_up(folder, tmp_path, capsys):
    sha256 = told(AgentTools(AgentRoot(folder)), "info", capture="hostile.jsonl")["sha256"]
    good, bad = citation(sha256, (1, 2)), citation("0" * 64, (7,))
    text = tmp_path / "answer.txt"
    text.write_text(f"Unit 9 said who it is [{good}].")
    done = ran(capsys, "mcp", "--root", folder, "--verify", text)
    assert done.status == 0
    assert done.out.splitlines()[1].startswith(f"{sha256[:12]}:2: hostile.jsonl, request, unit 9: ")
    text.write_text(f"So it is ({bad}), and ({citation(sha256, (99_999,))}); but {good}.")
    done = ran(capsys, "mcp", "--root", folder, "--verify", text)
    assert done.status == 1
    assert "no capture under the root has this hash" in done.out
    assert "hostile.jsonl has no frame 99999" in done.out
    assert "2 citations refer to nothing under the root" in done.err
    text.write_text("nothing cited")
    assert ran(capsys, "mcp", "--root", folder, "--verify", text).status == 1
    text.write_text(f"{sha256[:12]}:0-99999999")
    assert "in one citation" in refused(capsys, "mcp", "--root", folder, "--verify", text)
    text.write_text("nothing cited")
    told_in_russian = ran(capsys, "mcp", "--root", folder, "--verify", text, "--lang", "ru")
    assert "нет ссылок" in told_in_russian.err


@given(frames=st.sets(st.integers(0, 60), min_size=1, max_size=12), octets=st.sets(st.integers(0, 9999), max_size=4))
def test_a_citation_says_what_it_was_made_of(frames, octets):
    [found] = citations(f"see {citation('ab' * 32, frames, octets)}.")
    assert (set(found.frames), set(found.octets)) == (frames, octets)


def test_what_is_missing_is_said_in_a_line(folder, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "mcp.server.mcpserver", None)
    assert "a server for agents needs mcp: " in refused(capsys, "mcp", "--root", folder)
    assert "no such folder" in refused(capsys, "mcp", "--root", folder / "none")
    assert "is not a folder" in refused(capsys, "mcp", "--root", folder / "hostile.jsonl")
