"""Where a live session goes besides: --metrics, --mqtt, --foxglove; and the addresses that such options take."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Final

from .inputs import chosen_charts

if TYPE_CHECKING:
    from captures.recording.recorder import Recorder

    from ..live.outlets import Outlet

_LOCAL: Final = "127.0.0.1"  # unless a host is named, nobody else is served


def add_outlet_arguments(parser: argparse.ArgumentParser) -> None:
    """The flags."""
    group = parser.add_argument_group("live outputs; a slow receiver never delays the capture (rtuscope help outlets)")
    group.add_argument(
        "--metrics",
        metavar="[HOST:]PORT",
        type=address,
        help="OpenMetrics for Prometheus, at http://HOST:PORT/metrics",
    )
    group.add_argument(
        "--mqtt",
        metavar="URL",
        help="values by --map, units' health and findings to a broker: mqtt://[USER@]HOST[:PORT][/TOPIC], mqtts://",
    )
    group.add_argument(
        "--foxglove", metavar="[HOST:]PORT", type=address, help="the topics of an MCAP export, live at ws://HOST:PORT"
    )
    group.add_argument(
        "--foxglove-origin",
        metavar="ORIGIN",
        action="append",
        default=[],
        help="allow a web page of your own, such as http://localhost:8080 (default: app.foxglove.dev and desktop "
        "programs)",
    )


def outlets_of(
    arguments: argparse.Namespace, tell: Callable[[str], None], recorders: Sequence[Recorder] = ()
) -> list[Outlet]:
    """Those that were asked for, begun; OutletError. `tell` must not wait for anybody; `recorders` holds the recorder
    once there is one."""
    begun: list[Outlet] = []
    if arguments.metrics is not None:
        from ..live.outlets.metrics import Metrics

        recorded = lambda: (sum(r.bytes for r in recorders), sum(r.lost for r in recorders))  # noqa: E731
        host, port = arguments.metrics
        metrics = Metrics(
            host, port, recorded if getattr(arguments, "output", None) else None, chosen_charts(arguments)
        )
        begun.append(metrics)
        tell(f"metrics: http://{shown_host(host)}:{metrics.port}/metrics")
    if arguments.foxglove is not None:
        from ..live.outlets.foxglove import Foxglove

        host, port = arguments.foxglove
        foxglove = Foxglove(host, port, chosen_charts(arguments), origins=arguments.foxglove_origin)
        begun.append(foxglove)
        tell(f"foxglove: ws://{shown_host(host)}:{foxglove.port}")
    if arguments.mqtt is not None:
        from ..live.outlets.mqtt import Mqtt

        begun.append(Mqtt(arguments.mqtt, chosen_charts(arguments), tell))
    return begun


def address(text: str) -> tuple[str, int]:
    """`[HOST:]PORT` as host and port; for argparse."""
    host, colon, port = text.rpartition(":")
    if not port.isdecimal() or int(port) > 65535 or (colon and not host):
        raise argparse.ArgumentTypeError(f"{text!r} is neither a port nor HOST:PORT")
    return host.strip("[]") or _LOCAL, int(port)


def destination(text: str) -> tuple[str, int]:
    """As `address`, of something to connect to: no port is 0 there."""
    host, port = address(text)
    if not port:
        raise argparse.ArgumentTypeError(f"{text!r} is neither a port nor HOST:PORT")
    return host, port


def shown_host(host: str) -> str:
    """A host as an URL has it."""
    return f"[{host}]" if ":" in host else host
