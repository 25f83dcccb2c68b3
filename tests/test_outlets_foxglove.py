"""What viewers of Foxglove get while it is heard; one that goes costs nothing and says nothing."""

import asyncio
import json
import os
import socket
import struct
import time

import pytest
from livebus import Running, pty
from running import ran

import captures
from captures import samples

TROUBLED = samples.path("troubled.jsonl")
_UPGRADE = (
    "GET / HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
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
        viewer.sendall(_UPGRADE.encode())
        assert b"101 Switching" in viewer.recv(4096)
        viewer.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))  # its end is a reset
    time.sleep(0.5)
    said = sniff.ended()[2].splitlines()
    assert said
    assert [line for line in said if not line.startswith("rtuscope: ")] == []
