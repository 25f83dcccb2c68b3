"""A bus on an MQTT broker: `rtuscope sniff PORT --map MAP@17 --mqtt mqtt://HOST/base`.

    base/status                       online, offline (the broker says that, too, when we are gone)
    base/unit/17/available            online, offline: three requests without an answer, the adapter gone, nothing asked
    base/unit/17/values/Active_power  12.5, each time that it changes, and again before anybody could take it for stale;
                                      empty once it is stale
    base/unit/17/health               {"requests": 812, "answered": 810, ..., "answers": true}, once a second at most
    base/findings                     {"code": "no-response", ...}, an event each

All but findings are retained. After a time without the broker it is asked what it still holds, and gets what it lacks:
nothing is told twice. Messages go at most once each (QoS 0).

A broker gives what is retained to whoever comes later, as if it were new: so what is stale, or was left there by a
session before this one, is taken back. Home Assistant is told of values and units by its discovery (`homeassistant`).
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, Literal
from urllib.parse import parse_qs, unquote, urlsplit

import numpy as np

from captures.errors import os_reason
from dissectors.maps.model import MappedValue, RegisterMap

from ...exports.targets.mcap.schemas import topic_name
from ...extras import needs
from ...tables.findings import described
from ...tables.schema import Kind
from ..lines import FrameCache, confirmed_readings
from ..status import by_unit
from . import Letter, Mailbox, OutletError, Tell
from .freshness import Freshness, Presence
from .homeassistant import available_topic, health_entity, node_of, value_entity

if TYPE_CHECKING:
    from captures.line import LineSettings

    from ..session import SessionStep

_DEAF: Final = frozenset({"lost", "failed", "waiting"})  # events after which nothing is heard
_LOOK_S: Final = 1.0  # between two looks for what is stale
_PERIOD_S: Final = 1.0  # between two words on a unit's health
_SYNC_S: Final = 2.0  # for the broker to say what it holds
_GRACE_S: Final = 1.0  # at the end
_UNTOLD: Final = "Unspecified error"  # the client's words for a connection that just ended
_PASSWORD: Final = "RTUSCOPE_MQTT_PASSWORD"


@dataclass(frozen=True, slots=True)
class Broker:
    """A broker's URL taken apart."""

    host: str
    port: int
    tls: bool
    user: str | None
    password: str | None
    base: str
    discovery: str  # prefix of Home Assistant's topics; empty for none

    @classmethod
    def of(cls, url: str) -> Broker:
        """OutletError where it is none."""
        try:
            parts = urlsplit(url)
            port = parts.port
        except ValueError as error:
            raise OutletError(f"--mqtt {url}: {error}") from error
        if parts.scheme not in ("mqtt", "mqtts") or not parts.hostname:
            raise OutletError(f"--mqtt {url}: is not mqtt://[USER:PASSWORD@]HOST[:PORT][/TOPIC] or mqtts://")
        base = unquote(parts.path).strip("/") or "rtuscope"
        if any(letter in base for letter in "+#\0"):
            raise OutletError(f"--mqtt {url}: a topic cannot contain + or #")
        tls = parts.scheme == "mqtts"
        user = None if parts.username is None else unquote(parts.username)
        password = os.environ.get(_PASSWORD) if parts.password is None else unquote(parts.password)
        prefix = parse_qs(parts.query, keep_blank_values=True).get("discovery", ["homeassistant"])[-1]
        return cls(parts.hostname, port or (8883 if tls else 1883), tls, user, password, base, prefix.strip("/"))


class Mqtt:
    """The client of one broker."""

    def __init__(
        self,
        url: str,
        charts: Mapping[int, RegisterMap],
        tell: Tell,
        *,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """OutletError where this cannot begin; a broker that is away is no reason. `clock`: steady, in seconds."""
        try:
            from paho.mqtt.client import Client
            from paho.mqtt.enums import CallbackAPIVersion
        except ImportError as error:
            raise OutletError(needs("--mqtt", "paho-mqtt", "mqtt")) from error
        self._broker = Broker.of(url)
        self._base, self._tell = self._broker.base, tell
        self._mail = Mailbox()
        self._states: dict[str, str] = {}  # topic: payload, as it should be at the broker
        self._retained: dict[str, str] = {}  # as it is there, while we ask
        self._clock = clock
        self._topics: dict[tuple[int, str, int], str] = {}  # of a value: unit, area, address
        self._fresh: dict[tuple[int, str, int], Freshness] = {}
        self._presence: dict[int, Presence] = {}
        self._looked_s = 0.0  # for what is stale
        self._readings = FrameCache(lambda frame: confirmed_readings(frame, charts)) if charts else None
        self._charts = charts
        self._health: dict[int, Counter[str]] = {}
        self._sent_at: dict[int, float] = {}
        self._stale: set[int] = set()  # units whose health is another by now
        self._closing = threading.Event()
        self._ready = threading.Event()  # connected, and what the broker holds is known
        self._connections = 0
        self._answer: Literal["", "accepted", "refused"] = ""  # of the broker that we are connected to
        self._mark = f"{self._base}/sync/{os.urandom(6).hex()}"
        self._away = ""  # why the broker is, as it was told
        client = self._client = Client(CallbackAPIVersion.VERSION2)
        client.on_connect, client.on_disconnect = self._connected, self._disconnected
        client.on_connect_fail, client.on_message = self._failed, self._heard
        client.reconnect_delay_set(1, 15)
        client.will_set(f"{self._base}/status", "offline", retain=True)
        if self._broker.user is not None:
            client.username_pw_set(self._broker.user, self._broker.password)
        if self._broker.tls:
            client.tls_set()
        self._state("status", "online")
        try:
            client.connect_async(self._broker.host, self._broker.port)
        except ValueError as error:
            raise OutletError(f"--mqtt {url}: {error}") from error
        client.loop_start()
        self._thread = threading.Thread(target=self._send, daemon=True)
        self._thread.start()

    def feed(self, step: SessionStep, line: LineSettings) -> None:  # noqa: ARG002
        """What of a step goes to the broker."""
        now_s = self._clock()
        for traffic in by_unit(step.analysed.transactions):
            self._health.setdefault(traffic.unit, Counter()).update(traffic.counts)
            counts = traffic.counts
            heard = counts["answered"] + counts["exceptions"] + counts["damaged"]
            self._presence.setdefault(traffic.unit, Presence()).settled(heard, counts["unanswered"], now_s)
            if heard or counts["requests"]:
                self._stale.add(traffic.unit)
        if any(event.kind in _DEAF for event in step.events):
            for presence in self._presence.values():
                presence.left()
        self._availability(now_s)
        self._values(step, now_s)
        for unit in [unit for unit in self._stale if now_s - self._sent_at.get(unit, -_PERIOD_S) >= _PERIOD_S]:
            self._tell_health(unit, now_s)
        for finding in described(step.findings):
            event = {"t_ns": finding.t_ns, "index": finding.index, **finding.to_json()}
            self._mail.put(Letter(f"{self._base}/findings", json.dumps(event, ensure_ascii=False), state=False))

    def close(self) -> None:
        """Tell what is left to be told and that we go; ends soon, whether the broker is there or not."""
        for unit in list(self._stale):
            self._tell_health(unit, self._clock())
        self._state("status", "offline")
        for unit in self._presence:
            self._unit_state(unit, there=False)
        until = time.monotonic() + _GRACE_S
        while self._ready.is_set() and len(self._mail) and time.monotonic() < until:
            time.sleep(0.01)
        self._closing.set()
        self._thread.join(_GRACE_S)
        left = len(self._mail)
        if not self._ready.is_set():
            self._tell(f"mqtt: {self._where}: not connected at the end, {left:,} messages were not sent{self._loss()}")
        elif left or (lost := self._loss()):
            self._tell(f"mqtt: {left:,} messages were not sent{'' if left else lost}")
        self._client.disconnect()
        self._client.loop_stop()

    def _availability(self, now_s: float) -> None:
        """Which units are there, and what of them is stale."""
        if now_s - self._looked_s < _LOOK_S and not self._stale and all(each.there for each in self._presence.values()):
            return
        self._looked_s = now_s
        for unit, presence in self._presence.items():
            self._unit_state(unit, there=presence.looked_at(now_s))
        for key, fresh in self._fresh.items():
            if fresh.goes_stale(now_s):
                self._state(self._topics[key], "")

    def _unit_state(self, unit: int, *, there: bool) -> None:
        """Tell whether a unit is there; of one that is not no value is kept at the broker."""
        state = "online" if there else "offline"
        if self._states.get(f"{self._base}/{available_topic(unit)}") == state:
            return
        self._state(available_topic(unit), state)
        self._stale.add(unit)
        for key, topic in self._topics.items() if not there else ():
            if key[0] == unit:
                self._fresh[key].stale = True
                self._state(topic, "")

    def _values(self, step: SessionStep, now_s: float) -> None:
        rows = step.batch.rows
        if self._readings is None or not len(rows):
            return
        for row in np.flatnonzero((rows.kind == Kind.RESPONSE) & rows.check).tolist():
            frame = step.batch.frame(row)
            for reading in self._readings.of(frame):
                value = reading.value
                number = isinstance(value, int | float) and reading.row.type not in ("enum", "bits", "time")
                payload = f"{value:.12g}" if number and value is not None else reading.text
                self._value(frame.unit, reading.row, payload, now_s)

    def _value(self, unit: int, row: MappedValue, payload: str, now_s: float) -> None:
        """A value came; at first, and when it is polled otherwise, Home Assistant is told of it."""
        key = (unit, row.area, row.address)
        fresh = self._fresh.setdefault(key, Freshness())
        if fresh.heard(now_s) or key not in self._topics:
            topic = self._topic(unit, row)
            chart = self._charts.get(unit)
            self._discover(*value_entity(self._base, unit, row, topic, chart, fresh.expire_s))
        topic = self._topics[key]
        if self._states.get(f"{self._base}/{topic}") != payload or fresh.is_due(now_s):
            fresh.told(now_s)
            self._state(topic, payload, again=True)

    def _topic(self, unit: int, row: MappedValue) -> str:
        """Where a value goes, below the base."""
        key = (unit, row.area, row.address)
        if key not in self._topics:
            topic = f"unit/{unit}/values/{topic_name(row.name)}"
            self._topics[key] = f"{topic}_{row.address}" if topic in self._topics.values() else topic
        return self._topics[key]

    def _tell_health(self, unit: int, now_s: float) -> None:
        if unit not in self._sent_at:
            self._discover(*health_entity(self._base, unit, self._charts.get(unit)))
        self._sent_at[unit] = now_s
        self._stale.discard(unit)
        counts = {name: count for name, count in self._health[unit].items() if count or name == "requests"}
        self._state(f"unit/{unit}/health", json.dumps({**counts, "answers": self._presence[unit].there}))

    def _discover(self, topic: str, config: Mapping[str, Any]) -> None:
        if self._broker.discovery:
            self._update(f"{self._broker.discovery}/{topic}", json.dumps(config, ensure_ascii=False))

    def _state(self, topic: str, payload: str, *, again: bool = False) -> None:
        self._update(f"{self._base}/{topic}", payload, again=again)

    def _update(self, topic: str, payload: str, *, again: bool = False) -> None:
        """State at the broker: sent where it is another, or is to be told again."""
        if again or self._states.get(topic) != payload:
            self._states[topic] = payload
            self._mail.put(Letter(topic, payload))

    # The client's thread:

    def _connected(self, client: Any, _data: Any, _flags: Any, reason: Any, _properties: Any) -> None:
        self._answer = "refused" if reason.is_failure else "accepted"
        if reason.is_failure:
            self._gone(str(reason).lower())
            return
        self._connections += 1
        self._retained = {}
        client.subscribe([(f"{self._base}/#", 0), *self._discovery_topics()])
        client.publish(self._mark, "")
        threading.Timer(_SYNC_S, self._synced, (self._connections,)).start()  # one that may not subscribe

    def _discovery_topics(self) -> list[tuple[str, int]]:
        """Home Assistant's topics that are ours."""
        node = node_of(self._base)
        kinds = ("sensor", "binary_sensor") if self._broker.discovery else ()
        return [(f"{self._broker.discovery}/{kind}/{node}/+/config", 0) for kind in kinds]

    def _heard(self, _client: Any, _data: Any, message: Any) -> None:
        if message.topic == self._mark:
            self._synced(self._connections)
        elif message.retain and not self._ready.is_set():
            self._retained[message.topic] = message.payload.decode(errors="replace")

    def _synced(self, connection: int) -> None:
        """What the broker holds is known, as far as it tells: it gets what it lacks."""
        if self._ready.is_set() or connection != self._connections or self._closing.is_set():
            return
        self._client.unsubscribe([f"{self._base}/#", *(topic for topic, _ in self._discovery_topics())])
        first = connection == 1
        lost = self._loss()
        for topic, payload in self._left_over() if first else ():
            self._states.setdefault(topic, payload)
        for topic, payload in list(self._states.items()):
            if self._retained.get(topic, "") != payload:
                self._mail.put(Letter(topic, payload))
        self._mail.dropped()  # a state that waited already waits anew
        self._ready.set()
        self._away = ""
        self._tell(f"mqtt: {self._where}: connected{'' if first else ' again'}{lost}")

    def _left_over(self) -> list[tuple[str, str]]:
        """What a session before left at the broker and nobody has heard since, with what is true instead."""
        units = [(topic, topic.removeprefix(f"{self._base}/unit/").split("/")) for topic in self._retained]
        units = [(topic, parts) for topic, parts in units if topic.startswith(f"{self._base}/unit/")]
        values = [(topic, "") for topic, parts in units if parts[1:2] == ["values"]]
        return [*values, *((topic, "offline") for topic, parts in units if parts[1:] == ["available"])]

    def _disconnected(self, _client: Any, _data: Any, _flags: Any, reason: Any, _properties: Any) -> None:
        self._ready.clear()
        self._connections += 1
        answer, self._answer = self._answer, ""
        if answer == "accepted":
            self._gone("connection lost" if str(reason) == _UNTOLD else str(reason).lower())
        elif not answer:  # one that refuses also ends the connection: why was told
            self._gone("closed before it answered" + ("" if self._broker.tls else "; with TLS it is mqtts://"))

    def _failed(self, *_: Any) -> None:
        error = sys.exc_info()[1]  # the client tells while it handles what the system said
        why = f"cannot be reached ({os_reason(error)})" if isinstance(error, OSError) else "cannot be reached"
        self._gone(why + ("; SSL_CERT_FILE=FILE adds one to trust" if hasattr(error, "verify_message") else ""))

    def _gone(self, why: str) -> None:
        if why != self._away and not self._closing.is_set():
            self._away = why
            self._tell(f"mqtt: {self._where}: {why}; the latest states go out when it is back")

    # The sending thread:

    def _send(self) -> None:
        while not self._closing.is_set():
            if not self._ready.wait(0.1):
                continue
            if (letter := self._mail.get(0.1)) is not None and not self._sent(letter):
                self._mail.put_back(letter)

    def _sent(self, letter: Letter) -> bool:
        """Whether it left this machine."""
        connection = self._connections
        if letter.state and self._states.get(letter.topic) != letter.payload:
            return True  # a newer one waits
        delivery = self._client.publish(letter.topic, letter.payload, qos=0, retain=letter.state)
        if delivery.rc:
            return False
        while not delivery.is_published():
            if connection != self._connections or self._closing.is_set():
                return False
            time.sleep(0.0005)
        return True

    def _loss(self) -> str:
        dropped = self._mail.dropped()
        return f"; {dropped:,} older messages were dropped" if dropped else ""

    @property
    def _where(self) -> str:
        return f"{self._broker.host}:{self._broker.port}"
