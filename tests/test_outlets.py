"""What leaves a session for other programs is what its own views say; who takes it slowly or never costs nothing."""

import contextlib
import json
import os
import shutil
import socket
import subprocess
import time
import urllib.error
import urllib.request

import pytest
from buses import adu
from livebus import Running, eventually, pty
from running import PATIENCE_S, ran, refused, spawned

import analyzer
import captures
from analyzer.live.outlets import Letter, Mailbox
from captures import samples

needs_pty = pytest.mark.skipif(os.name != "posix", reason="pseudo-terminals are POSIX")
needs_mosquitto = pytest.mark.skipif(
    shutil.which("mosquitto", path=f"{os.environ['PATH']}:/usr/sbin") is None, reason="mosquitto is not installed"
)
TROUBLED = samples.path("troubled.jsonl")
ASKED, ANSWER = adu("1103006b0001"), "110302"
MAP = "area,address,name,type,unit\nholding,107,Active power,u16,W\n"


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def scraped(port, *, openmetrics=False):
    """What a scraper gets, parsed by the library's own parser."""
    accept = "application/openmetrics-text; version=1.0.0" if openmetrics else "text/plain"
    request = urllib.request.Request(f"http://127.0.0.1:{port}/metrics", headers={"Accept": accept})
    with urllib.request.urlopen(request, timeout=10) as answer:
        text = answer.read().decode()
    parser = pytest.importorskip(f"prometheus_client.{'openmetrics.' if openmetrics else ''}parser")
    samples = [sample for family in parser.text_string_to_metric_families(text) for sample in family.samples]
    return text, {(sample.name, *sorted(sample.labels.items())): sample.value for sample in samples}


@contextlib.contextmanager
def replayed(*arguments):
    """A session over the bundled capture, played at once and then held by what follows it: (session, outlets)."""
    from analyzer.live import Replay, Session

    outlet = arguments[0]()
    session = Session(Replay(captures.open(TROUBLED), None), outlets=[outlet])
    with session:
        for _ in session.steps():
            pass
        yield outlet


def test_metrics_say_what_the_report_says(capsys):
    metrics = pytest.importorskip("analyzer.live.outlets.metrics")
    pytest.importorskip("prometheus_client")
    report = json.loads(ran(capsys, "report", TROUBLED, "--json").out)
    with replayed(lambda: metrics.Metrics("127.0.0.1", 0)) as served:
        for openmetrics in (False, True):
            _, values = scraped(served.port, openmetrics=openmetrics)
        plain = scraped(served.port)[0]
    for unit in report["units"]:
        of_unit = ("unit", str(unit["unit"]))
        counts = unit["counts"]
        for name, key in (("requests", "requests"), ("answers", "answered"), ("unanswered", "unanswered"),
                          ("retries", "retries"), ("damaged_answers", "damaged")):  # fmt: skip
            assert values[f"modbus_{name}_total", of_unit] == counts[key], (unit, name)
        assert values.get(("modbus_response_time_seconds_count", of_unit), 0) == unit["times"]["count"]
    assert values["modbus_heard_bytes_total",] == report["bytes"]
    found: dict[str, float] = {}
    for (name, *labels), value in values.items():
        if name == "modbus_findings_total":
            code = dict(labels)["code"]
            found[code] = found.get(code, 0) + value
    codes: dict[str, int] = {}
    for group in report["findings"]:
        codes[group["code"]] = codes.get(group["code"], 0) + group["count"]
    assert found == codes
    if (promtool := shutil.which("promtool")) is not None:
        done = subprocess.run([promtool, "check", "metrics"], input=plain, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize(
    ("listening", "headers", "status"),
    [
        ("127.0.0.1", {"Host": "localhost:9617"}, 200),
        ("127.0.0.1", {"Host": "evil.example"}, 403),
        ("127.0.0.1", {"Host": "rtuscope:9617"}, 403),
        ("127.0.0.1", {"Origin": "http://evil.example"}, 403),
        ("127.0.0.1", {"Origin": "null"}, 403),
        ("0.0.0.0", {"Host": "rtuscope:9617"}, 200),  # a service in a network of containers
        ("0.0.0.0", {"Host": "192.0.2.7:9617"}, 200),
        ("0.0.0.0", {"Host": "evil.example:9617"}, 403),
        ("localhost", {"Host": "LOCALHOST"}, 200),
    ],
)
def test_metrics_are_for_no_page_of_the_web(listening, headers, status):
    """Nor under a name that a stranger makes point here."""
    metrics = pytest.importorskip("analyzer.live.outlets.metrics")
    pytest.importorskip("prometheus_client")
    served = metrics.Metrics(listening, 0)
    try:
        request = urllib.request.Request(f"http://127.0.0.1:{served.port}/metrics", headers=headers)
        try:
            with urllib.request.urlopen(request, timeout=10) as answer:
                assert answer.status == status
                assert b"modbus_heard_bytes_total" in answer.read()
        except urllib.error.HTTPError as error:
            assert error.code == status
            assert b"modbus_" not in error.read()
    finally:
        served.close()


@needs_pty
@pytest.mark.skipif(shutil.which("prometheus") is None, reason="prometheus is not installed")
def test_prometheus_scrapes_a_recorder(tmp_path):
    pytest.importorskip("prometheus_client")
    at, its = free_port(), free_port()
    master, port = pty()
    settings = tmp_path / "prometheus.yml"
    settings.write_text(
        f"scrape_configs: [{{job_name: bus, scrape_interval: 1s, static_configs: [{{targets: ['127.0.0.1:{at}']}}]}}]"
    )
    record = Running("record", port, "-o", tmp_path / "bus.mcap", "--metrics", str(at))
    scraper = subprocess.Popen(
        ["prometheus", f"--config.file={settings}", f"--storage.tsdb.path={tmp_path / 'db'}",
         f"--web.listen-address=127.0.0.1:{its}"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)  # fmt: skip

    def counted():
        with contextlib.suppress(OSError):
            url = f"http://127.0.0.1:{its}/api/v1/query?query=modbus_requests_total"
            with urllib.request.urlopen(url, timeout=5) as answer:
                result = json.load(answer)["data"]["result"]
            return [(found["metric"]["unit"], found["value"][1]) for found in result]
        return []

    try:
        for value in range(10):
            os.write(master, ASKED)
            time.sleep(0.02)
            os.write(master, adu(f"{ANSWER}{value:04x}"))
            time.sleep(0.02)
        os.write(master, ASKED)
        assert eventually(lambda: counted() == [("17", "10")]), counted()
    finally:
        scraper.kill()
        scraper.wait()
        status, _, said = record.ended()
    assert status == 0, said
    assert len(list(analyzer.open(tmp_path / "bus.mcap").frames())) == 21


class Broker:
    """mosquitto, without persistence unless told otherwise, and a subscriber's log."""

    def __init__(self, folder, anonymous="true"):
        self.port = free_port()
        self._settings = folder / "mosquitto.conf"
        self._settings.write_text(
            f"listener {self.port} 127.0.0.1\nallow_anonymous {anonymous}\npersistence true\n"
            f"persistence_location {folder}/\nuser root\nautosave_interval 1\nautosave_on_changes true\n"
        )
        self.start()

    def start(self):
        program = shutil.which("mosquitto", path=f"{os.environ['PATH']}:/usr/sbin")
        assert program is not None
        self._process = subprocess.Popen(
            [program, "-c", self._settings], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        assert eventually(self._answers)

    def _answers(self):
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", self.port), 1):
            return True
        return False

    def stop(self):
        self._process.terminate()
        self._process.wait(PATIENCE_S)


class Subscriber:
    """All messages of a broker: (topic, payload, retained)."""

    def __init__(self, port):
        mqtt = pytest.importorskip("paho.mqtt.client")
        enums = pytest.importorskip("paho.mqtt.enums")
        self.messages: list[tuple[str, str, bool]] = []
        self.client = mqtt.Client(enums.CallbackAPIVersion.VERSION2, client_id="the-test", clean_session=False)
        self.client.on_connect = lambda client, *_: client.subscribe([("rtuscope/#", 1), ("homeassistant/#", 1)])
        self.client.on_message = lambda _c, _d, m: self.messages.append((m.topic, m.payload.decode(), m.retain))
        self.client.reconnect_delay_set(1, 1)
        self.client.connect("127.0.0.1", port)
        self.client.loop_start()

    def of(self, topic):
        return [payload for name, payload, _ in self.messages if name == topic]

    def live(self, topic):
        """Those that are not what the broker held when it was asked."""
        return [payload for name, payload, retained in self.messages if name == topic and not retained]

    def close(self):
        self.client.disconnect()
        self.client.loop_stop()


def answered(master, value):
    os.write(master, ASKED)
    time.sleep(0.02)
    os.write(master, adu(f"{ANSWER}{value:04x}"))
    time.sleep(0.05)


@needs_pty
@needs_mosquitto
def test_values_and_health_reach_a_broker_that_is_away_for_a_while(tmp_path):
    pytest.importorskip("paho.mqtt.client")
    (tmp_path / "meter.csv").write_text(MAP)
    broker = Broker(tmp_path)
    heard = Subscriber(broker.port)
    master, port = pty()
    url = f"mqtt://127.0.0.1:{broker.port}"
    record = Running(
        "record", port, "-o", tmp_path / "bus.mcap", "--map", f"{tmp_path / 'meter.csv'}@17", "--mqtt", url
    )
    power = "rtuscope/unit/17/values/Active_power"
    try:
        assert eventually(lambda: "online" in heard.of("rtuscope/status"))
        for value in (100, 100, 101, 102):
            answered(master, value)
        assert eventually(lambda: heard.live(power) == ["100", "101", "102"]), heard.messages
        broker.stop()
        for value in (103, 104, 105):
            answered(master, value)
        time.sleep(1)
        broker.start()
        assert eventually(lambda: "105" in heard.of(power)), heard.messages
        answered(master, 106)
        assert eventually(lambda: "106" in heard.of(power)), heard.messages
    finally:
        status, _, said = record.ended()
        gone = eventually(lambda: heard.of("rtuscope/status")[-1:] == ["offline"] and heard.of(power)[-1:] == [""])
        heard.close()
        broker.stop()
    assert status == 0, said
    assert gone
    assert "connection lost; the latest states" in said, said
    assert "connected again" in said, said
    *live, last = heard.live(power)
    assert last == "", "nobody hears it any more: the broker keeps none"
    assert len(live) == len(set(live)), live  # nothing twice
    assert live[:3] == ["100", "101", "102"]
    assert live[-2:] == ["105", "106"]
    health = json.loads(heard.of("rtuscope/unit/17/health")[-1])
    assert health["requests"] == 8
    assert health["answered"] == 8
    assert health["answers"] is True
    told = heard.live("homeassistant/sensor/rtuscope/unit_17_values_Active_power/config")
    assert len(told) <= 2, "at first, and once the period of its poll is known"
    config = json.loads(told[-1])
    assert config["state_topic"] == power
    assert config["unit_of_measurement"] == "W"
    assert config["device_class"] == "power"
    assert [each["topic"] for each in config["availability"]] == ["rtuscope/status", "rtuscope/unit/17/available"]
    assert heard.of("rtuscope/unit/17/available")[-1] == "offline"
    assert len(list(analyzer.open(tmp_path / "bus.mcap").frames())) == 16  # the recording has all


@needs_pty
@needs_mosquitto
def test_a_broker_says_that_a_killed_session_is_gone(tmp_path):
    pytest.importorskip("paho.mqtt.client")
    broker = Broker(tmp_path)
    heard = Subscriber(broker.port)
    sniff = Running("sniff", pty()[1], "--mqtt", f"mqtt://127.0.0.1:{broker.port}")
    try:
        assert eventually(lambda: heard.of("rtuscope/status") == ["online"]), heard.messages
        sniff.process.kill()
        sniff.process.communicate()
        assert eventually(lambda: heard.of("rtuscope/status") == ["online", "offline"]), heard.messages
    finally:
        heard.close()
        broker.stop()


@needs_mosquitto
def test_a_broker_that_refuses_is_told_of_once(tmp_path):
    mqtt = pytest.importorskip("analyzer.live.outlets.mqtt")
    pytest.importorskip("paho.mqtt.client")
    broker = Broker(tmp_path, anonymous="false")
    told: list[str] = []
    outlet = mqtt.Mqtt(f"mqtt://127.0.0.1:{broker.port}", {}, told.append)
    try:
        assert eventually(lambda: bool(told))
        time.sleep(1.5)  # it tries again after one
    finally:
        outlet.close()
        broker.stop()
    assert [line.partition(";")[0] for line in told[:-1]] == [f"mqtt: 127.0.0.1:{broker.port}: not authorized"], told
    assert "not connected at the end" in told[-1]


def test_a_server_that_hangs_up_is_told_of_once():
    mqtt = pytest.importorskip("analyzer.live.outlets.mqtt")
    pytest.importorskip("paho.mqtt.client")
    told: list[str] = []
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(10)
        outlet = mqtt.Mqtt(f"mqtt://127.0.0.1:{server.getsockname()[1]}", {}, told.append)
        for _ in range(2):  # it tries again
            server.accept()[0].close()
        assert eventually(lambda: bool(told))
    outlet.close()
    assert len([line for line in told if "closed before it answered; with TLS it is mqtts://" in line]) == 1, told


@needs_pty
def test_no_broker_at_all_changes_nothing_of_the_recording(tmp_path):
    pytest.importorskip("paho.mqtt.client")
    master, port = pty()
    record = Running("record", port, "-o", tmp_path / "bus.mcap", "--mqtt", f"mqtt://127.0.0.1:{free_port()}/my/bus")
    for value in range(5):
        answered(master, value)
    status, _, said = record.ended()
    assert status == 0
    assert "cannot be reached (connection refused)" in said
    assert "not connected at the end" in said
    assert len(list(analyzer.open(tmp_path / "bus.mcap").frames())) == 10


def test_a_mailbox_keeps_the_newest_state_and_counts_what_it_drops():
    mail = Mailbox(most=3)
    for number in range(5):
        mail.put(Letter("state", str(number)))
    assert mail.dropped() == 4
    for number in range(4):
        mail.put(Letter("event", str(number), state=False))
    assert mail.dropped() == 2  # the state and the first event
    first = mail.get(0)
    assert first == Letter("event", "1", state=False)
    mail.put_back(first)
    assert [letter.payload for _ in range(3) if (letter := mail.get(0))] == ["1", "2", "3"]
    assert mail.get(0) is None


def test_a_newer_state_is_not_undone_by_one_that_did_not_go_out():
    mail = Mailbox()
    mail.put(Letter("state", "new"))
    mail.put_back(Letter("state", "old"))
    assert mail.get(0) == Letter("state", "new")
    assert mail.get(0) is None


def test_metrics_have_the_values_of_mapped_registers_until_they_are_stale(tmp_path):
    pytest.importorskip("prometheus_client")
    from buses import LINE, spaced

    from analyzer.analysis import Analysis
    from analyzer.live.outlets.gauges import ValueGauges
    from dissectors.maps.files import read_map

    (tmp_path / "meter.csv").write_text(MAP)
    now = [0.0]
    gauges = ValueGauges({17: read_map(tmp_path / "meter.csv")}, clock=lambda: now[0])

    def heard(word):
        capture = captures.Capture.of(LINE, spaced([ASKED, adu(f"{ANSWER}{word}")]))
        for batch in Analysis(capture).batches():
            gauges.feed(batch)

    def served():
        return [(sample.labels, sample.value) for family in gauges.collect() for sample in family.samples]

    assert served() == []
    for word in ("0064", "00C8"):
        heard(word)
        now[0] += 10.0
    labels = {"unit": "17", "area": "holding", "address": "107", "name": "Active power", "unit_of_measure": "W"}
    assert served() == [(labels, 200.0)]
    now[0] += 3600.0
    assert served() == []


def test_influx_lines_hold_the_frames_of_the_capture(capsys):
    lines = [json.loads(line) for line in ran(capsys, "export", TROUBLED).out.splitlines()]
    out = spawned("replay", TROUBLED, "--speed", "max", "--influx").out.splitlines()
    frames = [line for line in out if line.startswith(("modbus_request,", "modbus_response,"))]
    assert len(frames) == len(lines)
    for text, line in zip(frames, lines, strict=True):
        head, fields, t_ns = text.split(" ")
        assert int(t_ns) == line["t_end_ns"]
        assert head.startswith(f"modbus_{line['direction']},unit={line['unit']},function={line['function']}")
        assert f"length={line['length']}i,crc_ok={str(line['crc_ok']).lower()}" in fields
        took = line["response_time_ns"]
        assert ("response_time_ns=" in fields) == (took is not None)


def test_influx_escapes_names_and_texts(tmp_path):
    (tmp_path / "meter.csv").write_text('area,address,name,type,unit\nholding,107,"Power, L1=a",u16,W\n')
    bus = tmp_path / "bus.jsonl"
    from buses import LINE, spaced

    captures.write(bus, spaced([ASKED, adu(f"{ANSWER}0064")]), line=LINE)
    done = spawned("replay", bus, "--speed", "max", "--influx", "--map", f"{tmp_path / 'meter.csv'}@17")
    values = [line for line in done.out.splitlines() if line.startswith("modbus_value")]
    assert values[0].startswith(r"modbus_value,unit=17,area=holding,name=Power\,\ L1\=a value=100.0 ")


def test_influx_has_values_of_writes_only_where_they_were_confirmed(tmp_path):
    (tmp_path / "drive.csv").write_text("area,address,name,type\nholding,2,Ramp,u16\n")
    bus = tmp_path / "bus.jsonl"
    from buses import LINE, spaced

    turns = [("110600020005", "118602"), ("11100002000102 0006", "111000020001"), ("110600020007", "110600020007")]
    captures.write(bus, spaced([adu(pdu) for turn in turns for pdu in turn]), line=LINE)
    done = spawned("replay", bus, "--speed", "max", "--influx", "--map", f"{tmp_path / 'drive.csv'}@17")
    values = [line.split(" ")[1] for line in done.out.splitlines() if line.startswith("modbus_value")]
    assert values == ["value=6.0", "value=7.0"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--metrics", "here"), "neither a port nor HOST:PORT"),
        (("--mqtt", "http://host"), "is not mqtt://"),
        (("--mqtt", "mqtt://host/a+b"), "a topic cannot contain +"),
        (("--metrics", "203.0.113.1:9617"), "--metrics 203.0.113.1:9617: "),
    ],
)
def test_mistakes_get_one_line(capsys, arguments, said):
    pytest.importorskip("paho.mqtt.client")
    assert said in refused(capsys, "replay", TROUBLED, *arguments)
