"""OpenMetrics for Prometheus and whoever scrapes alike: `rtuscope sniff PORT --metrics 9617`, then `/metrics`.

Counters grow from when listening began. A scrape reads numbers and never waits for the bus, nor the bus for it. A page
of the web that makes a browser ask is refused, also under a name that it made point here.
"""

from __future__ import annotations

import socket
import socketserver
import threading
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any, Final
from wsgiref.simple_server import WSGIRequestHandler, WSGIServer, make_server

import numpy as np

from ...extras import needs
from ...tables.findings import evidence, rules
from ...tables.schema import Kind
from ...webguard import refusal
from ..status import LineStatus, by_unit
from . import OutletError
from .gauges import ValueGauges

if TYPE_CHECKING:
    from captures.line import LineSettings
    from dissectors.maps.model import RegisterMap

    from ..session import SessionStep

_BUCKETS_S: Final = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)
_OF_UNIT: Final = {  # counter: its name among those of `by_unit`, help
    "requests": ("requests", "Requests that were settled"),
    "answers": ("answered", "Requests that got a good answer"),
    "unanswered": ("unanswered", "Requests that got no answer"),
    "damaged_answers": ("damaged", "Requests whose answer had a wrong check value"),
    "broadcasts": ("broadcasts", "Requests that nobody answers"),
    "retries": ("retries", "Requests repeated after no good answer"),
    "late_answers": ("late", "Answers after the client had moved on"),
}


class Metrics:
    """An HTTP server with the counts of a session."""

    def __init__(
        self,
        host: str,
        port: int,
        recorded: Callable[[], tuple[int, int]] | None = None,
        charts: Mapping[int, RegisterMap] | None = None,
    ) -> None:
        """`recorded` gives bytes of the line that are on the disk, and lost; `charts` are the register maps of units.
        OutletError where it cannot begin."""
        try:
            import prometheus_client as prometheus
        except ImportError as error:
            raise OutletError(needs("--metrics", "prometheus-client", "metrics")) from error
        prometheus.disable_created_metrics()
        registry = prometheus.CollectorRegistry()
        self._values = ValueGauges(charts or {})
        registry.register(self._values)

        def counter(name: str, words: str, *labels: str) -> Any:
            return prometheus.Counter(f"modbus_{name}", words, labels, registry=registry)

        self._status: LineStatus | None = None
        self._units = {name: counter(name, words, "unit") for name, (_, words) in _OF_UNIT.items()}
        self._exceptions = counter("exceptions", "Exceptions by code", "unit", "code")
        self._findings = counter("findings", "What was found, by kind", "code", "severity", "unit")
        self._frames = counter("frames", "Frames", "direction")
        self._damaged = counter("damaged_frames", "Frames with a wrong check value")
        self._noise = counter("noise_bytes", "Bytes outside frames")
        self._heard = counter("heard_bytes", "Bytes of the line")
        self._marked = counter("marked_bytes", "Bytes with a parity or framing error")
        self._missed = counter("not_analysed_bytes", "Bytes that were not analysed live")
        self._losses = counter("port_losses", "Times that a port went away")
        self._times = prometheus.Histogram(
            "modbus_response_time_seconds",
            "End of request to start of answer",
            ("unit",),
            registry=registry,
            buckets=_BUCKETS_S,
        )
        load = prometheus.Gauge("modbus_line_load_ratio", "Share of the last seconds in which bytes were on the line; "
                                "NaN where the line's speed is not known", registry=registry)  # fmt: skip
        load.set_function(lambda: float("nan") if self._status is None or (r := self._status.load) is None else r)
        if recorded is not None:
            for index, name in enumerate(("recorded_bytes", "recording_lost_bytes")):
                gauge = prometheus.Gauge(f"modbus_{name}", "Of the line, on the disk or lost", registry=registry)
                gauge.set_function(lambda index=index: recorded()[index])
        try:
            self._server = make_server(
                host, port, _guarded(prometheus.make_wsgi_app(registry), host), _server_at(host), _Quiet
            )
        except (OSError, OverflowError) as error:
            reason = str(getattr(error, "strerror", None) or error).lower()
            raise OutletError(f"--metrics {host}:{port}: {reason}") from error
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    @property
    def port(self) -> int:
        """Where it serves."""
        return int(self._server.server_port)

    def feed(self, step: SessionStep, line: LineSettings) -> None:
        """Count a step in."""
        if self._status is None:
            self._status = LineStatus(line)
        self._status.line = line
        self._status.feed(step)
        self._heard.inc(step.heard)
        self._marked.inc(step.marked)
        self._missed.inc(step.missed)
        self._losses.inc(sum(event.kind == "lost" for event in step.events))
        self._values.feed(step.batch)
        rows = step.batch.rows
        if len(rows):
            noise = rows.kind == Kind.NOISE
            self._noise.inc(int(rows.length[noise].sum()))
            self._damaged.inc(int(np.count_nonzero(~rows.check & ~noise)))
            for kind in (Kind.REQUEST, Kind.RESPONSE):
                self._frames.labels(kind.name.lower()).inc(int(np.count_nonzero(rows.kind == kind)))
        for traffic in by_unit(step.analysed.transactions):
            unit = str(traffic.unit)
            for name, (source, _) in _OF_UNIT.items():
                self._units[name].labels(unit).inc(traffic.counts[source])
            for code, count in traffic.exceptions.items():
                self._exceptions.labels(unit, str(code)).inc(count)
            times = self._times.labels(unit)
            for t_ns in traffic.times_ns:
                times.observe(t_ns / 1e9)
        declared = rules()
        for number, figures in zip(step.findings.rule.tolist(), step.findings.numbers.tolist(), strict=True):
            rule = declared[number]
            about = evidence(rule, figures).get("unit")
            self._findings.labels(rule.code, rule.severity.name.lower(), "" if about is None else f"{about:.0f}").inc()

    def close(self) -> None:
        """End the server."""
        self._server.shutdown()
        self._server.server_close()


class _Quiet(WSGIRequestHandler):
    """Logs nothing, and waits for no one who says nothing."""

    timeout = 10.0

    def log_message(self, *_: object) -> None: ...


def _server_at(host: str) -> type[WSGIServer]:
    """A server of a thread a request, for an address of this family."""

    class Server(socketserver.ThreadingMixIn, WSGIServer):
        daemon_threads = True
        address_family = socket.AF_INET6 if ":" in host else socket.AF_INET

        def handle_error(self, *_: object) -> None: ...  # a scraper that just goes is no trouble of ours

        def server_bind(self) -> None:
            """As it is, but without asking the network what this machine is called."""
            socketserver.TCPServer.server_bind(self)
            self.server_name, self.server_port = host, int(self.server_address[1])
            self.setup_environ()

    return Server


def _guarded(app: Any, listening: str) -> Callable[[dict[str, Any], Any], Iterable[bytes]]:
    """A WSGI application behind Host and Origin."""

    def guard(environ: dict[str, Any], start_response: Any) -> Iterable[bytes]:
        origins = [environ["HTTP_ORIGIN"]] if "HTTP_ORIGIN" in environ else []
        why = refusal(environ.get("HTTP_HOST", ""), origins, listening)
        if not why:
            answer: Iterable[bytes] = app(environ, start_response)
            return answer
        start_response("403 Forbidden", [("Content-Type", "text/plain; charset=utf-8")])
        return [f"{why}; --metrics NAME:PORT lets it listen by its name\n".encode()]

    return guard
