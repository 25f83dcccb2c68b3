"""What viewers of Foxglove get while it is heard; one that goes costs nothing and says nothing."""

import asyncio
import json
import os
import socket
import struct
import sys
import time

import pytest
from livebus import Running, pty
from running import ran, refused

import captures
from captures import samples

TROUBLED = samples.path("troubled.jsonl")
_UPGRADE = (
    "GET / HTTP/1.1\r\nHost: {host}\r\n{more}Upgrade: websocket\r\nConnection: Upgrade\r\n"
    "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n"
    "Sec-WebSocket-Protocol: foxglove.sdk.v1\r\n\r\n"
)


def test_foxglove_gets_the_topics_of_the_file_live(capsys, tmp_path):
    outlet = pytest.importorskip("analyzer.live.outlets.foxglove")
    pytest.importorskip("foxglove")
    aiohttp = pytest.importorskip("aiohttp")
    from mcap.reader import make_reader

    bus = tmp_path / "bus.mcap"
    assert ran(capsys, "export", TROUBLED, "-o", bus, "--noise").status == 0
    with bus.open("rb") as file:
        written: dict[str, list[tuple[int, bytes]]] = {}
        for _, channel, message in make_reader(file).iter_messages():
            written.setdefault(channel.topic, []).append((message.log_time, message.data))
    written.pop("/chunks", None)

    async def watch(port, play):
        topics, seen = dict[int, str](), dict[str, list[tuple[int, bytes]]]()
        async with (
            aiohttp.ClientSession() as client,
            client.ws_connect(f"ws://127.0.0.1:{port}", protocols=("foxglove.sdk.v1", "foxglove.websocket.v1")) as ws,
        ):
            playing = None
            ends = asyncio.get_running_loop().time() + 15
            while asyncio.get_running_loop().time() < ends:
                try:
                    message = await ws.receive(timeout=2)
                except TimeoutError:
                    break
                if message.type == aiohttp.WSMsgType.TEXT:
                    said = json.loads(message.data)
                    channels = said.get("channels", []) if said["op"] == "advertise" else []
                    for channel in channels:
                        topics[channel["id"]] = channel["topic"]
                    if channels:
                        subscriptions = [{"id": channel["id"], "channelId": channel["id"]} for channel in channels]
                        await ws.send_json({"op": "subscribe", "subscriptions": subscriptions})
                    if playing is None:
                        await asyncio.sleep(0.3)
                        playing = asyncio.create_task(asyncio.to_thread(play))
                elif message.type == aiohttp.WSMsgType.BINARY and message.data[0] == 1:
                    number, t_ns = (int.from_bytes(message.data[i:j], "little") for i, j in ((1, 5), (5, 13)))
                    seen.setdefault(topics[number], []).append((t_ns, message.data[13:]))
            assert playing is not None
            await playing
        return topics, seen

    from analyzer.live import Replay, Session

    served = outlet.Foxglove("127.0.0.1", 0)
    capture = captures.open(TROUBLED)
    session = Session(Replay(capture, None), outlets=[served])

    def play():
        with session:
            for _ in session.steps():
                time.sleep(0.01)
            time.sleep(2)  # until all is sent

    topics, seen = asyncio.run(watch(served.port, play))
    assert {"/frames", "/transactions", "/findings", "/noise"} <= set(topics.values())
    assert [t_ns for t_ns, _ in seen["/frames"]] == [t_ns for t_ns, _ in written["/frames"]]
    assert [data for _, data in seen["/noise"]] == [data for _, data in written["/noise"]]
    of = [sorted(data[:9] for _, data in part["/transactions"]) for part in (seen, written)]  # their requests
    assert of[0] == of[1]


@pytest.mark.skipif(os.name != "posix", reason="pseudo-terminals are POSIX")
def test_a_viewer_that_just_goes_is_nobodys_trouble():
    pytest.importorskip("foxglove")
    sniff = Running("sniff", pty()[1], "--baud", "9600", "--foxglove", "0")
    at = int(b"".join(sniff.said).partition(b"ws://127.0.0.1:")[2].split()[0])
    with socket.create_connection(("127.0.0.1", at), 10) as viewer:
        viewer.sendall(_UPGRADE.format(host="localhost", more="").encode())
        assert b"101 Switching" in viewer.recv(4096)
        viewer.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))  # its end is a reset
    time.sleep(0.5)
    said = sniff.ended()[2].splitlines()
    assert said
    assert [line for line in said if not line.startswith("rtuscope: ")] == []


@pytest.fixture(scope="module")
def served():
    outlet = pytest.importorskip("analyzer.live.outlets.foxglove")
    pytest.importorskip("foxglove")
    served = outlet.Foxglove("127.0.0.1", 0, origins=["http://localhost:8080"])
    yield served
    served.close()


def answer(port, head, host="127.0.0.1"):
    """The status that a request gets."""
    with socket.create_connection((host, port), 10) as viewer:
        viewer.sendall(head.encode())
        return viewer.recv(4096).partition(b"\r\n")[0].decode()


@pytest.mark.parametrize(
    ("host", "more", "status"),
    [
        ("localhost:{port}", "", 101),
        ("127.0.0.1", "Origin: https://app.foxglove.dev\r\n", 101),
        ("localhost", "Origin: file://\r\n", 101),
        ("[::1]:8765", "origin: http://[::1]:8765\r\n", 101),
        ("localhost", "Origin: http://localhost:8080\r\n", 101),
        ("localhost", "Origin: http://evil.example\r\n", 403),
        ("localhost", "Origin: null\r\n", 403),
        ("localhost", "Origin: https://app.foxglove.dev.evil.example\r\n", 403),
        ("localhost", "Origin: file://\r\nOrigin: http://evil.example\r\n", 403),
        ("localhost", "Origin: http://localhost:8081\r\n", 403),
        ("evil.example", "", 403),
        ("evil.example", "Origin: http://evil.example\r\n", 403),
        ("localhost", "Host: evil.example\r\n", 403),
    ],
)
def test_pages_and_names_of_others_are_refused(served, host, more, status):
    head = _UPGRADE.format(host=host.format(port=served.port), more=more)
    assert f" {status} " in answer(served.port, head), head


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have one loopback address")
def test_the_server_behind_the_door_is_at_no_address_that_a_page_can_try(served):
    inner = served._server.port
    for host in ("127.0.0.1", "localhost"):
        with pytest.raises(OSError):
            socket.create_connection((host, inner), 2).close()


def test_a_door_that_is_knocked_at_without_a_word_opens_for_others(served):
    silent = [socket.create_connection(("127.0.0.1", served.port), 10) for _ in range(20)]
    silent[0].sendall(b"GET / HTTP/1.1\r\n" + b"x" * 100_000)
    assert " 101 " in answer(served.port, _UPGRADE.format(host="localhost", more=""))
    for each in silent:
        each.close()


def test_a_port_that_is_taken_is_one_line(capsys):
    pytest.importorskip("foxglove")
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        assert f"--foxglove 127.0.0.1:{port}: " in refused(capsys, "replay", TROUBLED, "--foxglove", str(port))
