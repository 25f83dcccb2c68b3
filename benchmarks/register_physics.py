"""Series of a third hand: plants by their physics. Power is what voltage and current make, energy its sum over time,
tanks fill, drives ramp, batteries take what the sun leaves.

A quantity has a name (`U1`, `TOT2`: the digits number the phase, the input); `Plant` gives it in its usual unit of
measure, one number a poll. Nothing here is shared with `register_plants` or `analyzer.simulation.mapped.series`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Number = float | np.integer[Any] | np.floating[Any]


class Plant:
    """Of one plant the quantities, each made when it is first asked for. `period` is that of the polls, in seconds."""

    def __init__(self, rng: np.random.Generator, polls: int, period: float) -> None:
        self.rng, self.n, self.period = rng, polls, period
        self.start = rng.uniform(0, 86400)
        self.t = self.start + np.arange(polls) * period + rng.normal(0, period * 0.01, polls)
        self.memo: dict[str, Floats] = {}
        self.rated_i = float(rng.choice([5, 16, 32, 63, 100, 250, 630, 1600]))
        self.load = float(rng.choice([0.0, 0.02, 0.1, 0.3, 0.6, 0.8], p=[0.06, 0.14, 0.2, 0.25, 0.2, 0.15]))
        self.age_h = float(10 ** rng.uniform(0.5, 5))
        self.idle = rng.random() < 0.12
        self.calm = float(rng.choice([0.3, 1, 3]))

    def __call__(self, name: str) -> Floats:
        if name not in self.memo:
            base = name.rstrip("0123456789")
            self.memo[name] = np.asarray(QUANTITIES[base](self, int(name[len(base) :] or 0)), np.float64)
        return self.memo[name]

    def ou(self, mean: Number, sd: float, tau: float, noise: float = 0.0) -> Floats:
        """What is drawn back to its mean within `tau` seconds."""
        a = np.exp(-self.period / tau)
        walk = np.empty(self.n)
        now = self.rng.normal(0, sd)
        pushes = self.rng.normal(0, sd * np.sqrt(1 - a * a), self.n)
        for i in range(self.n):
            now = a * now + pushes[i]
            walk[i] = now
        found: Floats = mean + walk + self.rng.normal(0, noise, self.n)
        return found

    def steps(self, levels: Sequence[Any] | NDArray[np.integer], mean_s: float) -> Floats:
        """What stays at one of some levels, for `mean_s` seconds on the average."""
        out, now = np.empty(self.n), self.rng.choice(levels)
        for i in range(self.n):
            if self.rng.random() < self.period / mean_s:
                now = self.rng.choice(levels)
            out[i] = now
        return out

    def const(self, value: Number) -> Floats:
        return np.full(self.n, float(value))

    def total(self, rate_per_s: ArrayLike, start: Number) -> Floats:
        dt = np.diff(self.t, prepend=self.t[0])
        found: Floats = start + np.cumsum(np.maximum(np.broadcast_to(rate_per_s, self.n), 0) * dt)
        return found


def _u(p: Plant, k: int) -> Floats:
    if k == 0:
        return (p("U1") + p("U2") + p("U3")) / 3
    return p.ou(p.rng.normal(231, 3), 1.2, 600, 0.12 * p.calm)


def _ul(p: Plant, k: int) -> Floats:
    a, b = p(f"U{k}"), p(f"U{k % 3 + 1}")
    return np.sqrt(a * a + b * b + a * b)


def _i(p: Plant, k: int) -> Floats:
    if k == 0:
        return p.ou(p.rated_i * p.load * 0.05, p.rated_i * p.load * 0.01, 60)
    base = p.rated_i * p.load * p.rng.uniform(0.7, 1.3)
    x = p.ou(base, base * 0.06, 120, base * 0.004 * p.calm) + p.steps([0, 0, base * 0.1, base * 0.4], 300)
    return np.maximum(x, 0) * (0 if p.idle else 1)


def _pf(p: Plant, k: int) -> Floats:
    if k == 0:
        return np.clip(np.abs(p("P") / np.maximum(p("S"), 1e-9)), 0, 1)
    return np.clip(p.ou(p.rng.choice([0.72, 0.85, 0.93, 0.98]), 0.01, 200, 0.001), -1, 1)


def _p(p: Plant, k: int) -> Floats:
    if k == 0:
        return p("P1") + p("P2") + p("P3")
    sign = p.memo.setdefault("sign", p.rng.choice([1, 1, 1, -1]) * np.ones(1))
    power = p(f"U{k}") * p(f"I{k}") * p(f"PF{k}") * sign
    if p.memo.setdefault("cross", np.array([p.rng.random() < 0.15]))[0]:
        power = power - np.mean(power) * p.rng.uniform(0.7, 1.3)
    return power


def _q(p: Plant, k: int) -> Floats:
    if k == 0:
        return p("Q1") + p("Q2") + p("Q3")
    s = p.memo.setdefault("qsign", p.rng.choice([1, 1, -1]) * np.ones(1))
    return s * np.sqrt(np.maximum(p(f"S{k}") ** 2 - p(f"P{k}") ** 2, 0))


def _s(p: Plant, k: int) -> Floats:
    if k == 0:
        return p("S1") + p("S2") + p("S3")
    return p(f"U{k}") * p(f"I{k}")


def _e(p: Plant, k: int) -> Floats:
    avg = max(p.rated_i * max(p.load, 0.01) * 230 * 0.8, 1)
    return p.total(np.maximum(p(f"P{k}"), 0) / 3600, avg * (3 if k == 0 else 1) * p.age_h * p.rng.uniform(0.4, 1))


def _ex(p: Plant, k: int) -> Floats:
    used = p.memo.setdefault("export", np.array([p.rng.random() < 0.3]))[0]
    rate = np.maximum(-p(f"P{k}"), 0) / 3600
    return p.total(rate, 0 if not used else 100 * p.age_h * p.rng.uniform(0.2, 3))


def _et(p: Plant, k: int) -> Floats:
    act = p.memo.setdefault("tariff", np.array([p.rng.integers(1, 4)]))[0]
    start = 1500 * p.age_h * p.rng.uniform(0.02, 1) if p.rng.random() < 0.7 or k == act else 0
    return p.total(np.maximum(p("P"), 0) / 3600 if k == act else 0, start)


def _dem(p: Plant, k: int) -> Floats:
    m = np.convolve(np.abs(p("P")), np.ones(8) / 8)[: p.n]
    m[:8] = m[7] if p.n > 7 else m[0]
    hold = max(int(60 / p.period), 1)
    return np.repeat(m[::hold], hold)[: p.n]


def _lev(p: Plant, k: int) -> Floats:
    kind = p.rng.integers(0, 3)
    if kind == 0:
        return p.ou(p.rng.uniform(0.3, 12), 0.002, 400, 0.0006 * p.calm)
    rate = p.rng.choice([-1, 1]) * p.rng.uniform(0.0001, 0.002)
    found: Floats = np.clip(p.rng.uniform(1, 9) + rate * (p.t - p.t[0]) + p.ou(0, 0.001, 60), 0, 20)
    return found


def _flow(p: Plant, k: int) -> Floats:
    on = p.steps([1, 1, 1, 0], 900) if p.rng.random() < 0.4 else 1
    size = 10 ** p.rng.uniform(-0.5, 2.6)
    return np.maximum(p.ou(size, size * 0.05, 60, size * 0.01 * p.calm), 0) * on


def _pres(p: Plant, k: int) -> Floats:
    s = p.rng.choice([1, 2.5, 6, 16])
    return np.maximum(p.ou(s * 0.6, s * 0.01, 120, s * 0.002 * p.calm), 0)


def _hz(p: Plant, k: int) -> Floats:
    ref, out, v = p("HZSET"), np.empty(p.n), 0.0
    v = ref[0]
    for i in range(p.n):
        v += np.clip(ref[i] - v, -5 * p.period, 5 * p.period) * 0.8
        out[i] = v
    return np.maximum(out + p.rng.normal(0, 0.01, p.n) * (out > 1), 0)


def _enc(p: Plant, k: int) -> Floats:
    sp = p.rng.choice([0, 3, 150, 4000])
    if p.rng.random() < 0.5:
        return np.cumsum(p.rng.normal(0, 1, p.n) * sp * 4) + p.rng.normal(0, 2e5)
    found: Floats = sp * 30 * np.sin((p.t - p.t[0]) / 70 + p.rng.uniform(0, 6)) + p.rng.choice([0, 0, 90000])
    return found


def _ppv(p: Plant, k: int) -> Floats:
    if k == 0:
        return p("VPV1") * p("IPV1") + p("VPV2") * p("IPV2")
    return p(f"VPV{k}") * p(f"IPV{k}")


def _bits(p: Plant, k: int) -> Floats:
    a, b = p.rng.integers(0, 65536), p.rng.integers(0, 16, 2)
    return p.steps([a, a ^ (1 << int(b[0])), a ^ (1 << int(b[1]))], 300)


def _fewb(p: Plant, k: int) -> Floats:
    b = p.rng.integers(0, 5, 2)
    return p.steps([0, 1 << int(b[0]), (1 << int(b[0])) | (1 << int(b[1]))], 600)


Quantity = Callable[[Plant, int], ArrayLike]
QUANTITIES: Final[dict[str, Quantity]] = {
    # electricity
    "U": _u,
    "UL": _ul,
    "I": _i,
    "PF": _pf,
    "P": _p,
    "Q": _q,
    "S": _s,
    "F": lambda p, k: p.ou(50, 0.015, 60, 0.003),
    "THD": lambda p, k: np.abs(p.ou(p.rng.uniform(1, 8), 0.2, 100, 0.05)),
    "ANG": lambda p, k: (p.ou([0, 0, 120, 240][k % 4], 0.2, 100, 0.1)) % 360,
    "E": _e,
    "EX": _ex,
    "EQ": lambda p, k: p.total(np.maximum(p(f"Q{k}"), 0) / 3600, 200 * p.age_h * p.rng.uniform(0.1, 2)),
    "ES": lambda p, k: p.total(p("S") / 3600, 900 * p.age_h * p.rng.uniform(0.5, 2)),
    "ET": _et,
    "EDAY": lambda p, k: p.total(np.abs(p("P")) / 3600, np.abs(p("P")).mean() * p.rng.uniform(0, 14)),
    "DEM": _dem,
    "PK": lambda p, k: np.maximum.accumulate(p("DEM")) * (1.3 if p.rng.random() < 0.8 else 0.99),
    "UN": lambda p, k: np.abs(p.ou(1, 0.2, 100, 0.05)),
    # heat, air
    "TOUT": lambda p, k: p.ou(p.rng.choice([-12, -2, 0.2, 1, 6, 18, 29]), 0.5, 3000, 0.03 * p.calm),
    "TIN": lambda p, k: p.ou(p.rng.uniform(18, 26), 0.35, 900, 0.04 * p.calm),
    "TSET": lambda p, k: p.steps([21, 21.5, 22, 20], 5000),
    "TSUP": lambda p, k: p.ou(p.rng.uniform(35, 90), 1.5, 400, 0.06 * p.calm),
    "TRET": lambda p, k: p("TSUP") - p.ou(p.rng.uniform(3, 30), 0.4, 500, 0.05),
    "TDIF": lambda p, k: p("TSUP") - p("TRET"),
    "TCOLD": lambda p, k: p.ou(p.rng.choice([-22, -18, -1, 2, 4]), 0.6, 500, 0.05),
    "TBOARD": lambda p, k: p.ou(p.rng.uniform(30, 55), 0.4, 1000, 0.1),
    "TK": lambda p, k: p.ou(p.rng.uniform(300, 1250), 1.5, 300, 0.3),
    "RH": lambda p, k: np.clip(p.ou(p.rng.uniform(25, 80), 1, 900, 0.1 * p.calm), 0, 100),
    "DEW": lambda p, k: p("TIN") - (100 - p("RH")) / 5,
    "COTWO": lambda p, k: p.ou(p.rng.uniform(420, 1300), 25, 600, 3),
    "LUX": lambda p, k: np.maximum(p.ou(p.rng.choice([0, 3, 400, 20000, 80000]), 50, 300, 5), 0),
    "WIND": lambda p, k: np.abs(p.ou(p.rng.uniform(1, 8), 1, 30, 0.4)),
    "DIR": lambda p, k: p.ou(p.rng.uniform(0, 360), 12, 100, 5) % 360,
    "BARO": lambda p, k: p.ou(1008, 0.4, 20000, 0.02),
    "RAIN": lambda p, k: p.total(p.steps([0, 0, 0, 0.001], 800), p.rng.uniform(0, 900)),
    # process
    "LEV": _lev,
    "VOL": lambda p, k: p("LEV") ** 1.2 * 850,
    "DENS": lambda p, k: p.ou(p.rng.uniform(690, 1010), 0.1, 3000, 0.02),
    "FLOW": _flow,
    "TOT": lambda p, k: p.total(
        p(f"FLOW{k or ''}") / 3600, p.age_h * p(f"FLOW{k or ''}").mean() * p.rng.uniform(0.1, 1)
    ),
    "TOTB": lambda p, k: p.total(0, 0 if p.rng.random() < 0.5 else p.age_h * p.rng.uniform(0.001, 0.1)),
    "PRES": _pres,
    "DP": lambda p, k: p.ou(p.rng.choice([0, 0, 12, 150]), 3, 60, 1),
    "VALVE": lambda p, k: np.clip(p.ou(p.rng.uniform(10, 90), 4, 90, 0.2), 0, 100),
    "MA": lambda p, k: 4 + 16 * np.clip(p.ou(p.rng.uniform(0.1, 0.9), 0.01, 200, 0.001 * p.calm), 0, 1),
    "WEIGHT": lambda p, k: p.steps([0, 0.02, 12.44, 12.46, 103.2, 350.8], 60) + p.ou(0, 0.005, 10),
    "PH": lambda p, k: p.ou(7.2, 0.05, 400, 0.01),
    "COND": lambda p, k: p.ou(10 ** p.rng.uniform(1, 4), 5, 200, 1),
    "HEAT": lambda p, k: p("FLOW") * p("TDIF") * 1.16,
    "EHEAT": lambda p, k: p.total(np.maximum(p("HEAT"), 0) / 3600, p.age_h * 9 * p.rng.uniform(0.3, 3)),
    "PROD": lambda p, k: np.floor(p.total(p.rng.choice([0.02, 0.2, 1, 9]), p.age_h * 40 * p.rng.random())),
    "SHIFT": lambda p, k: np.floor(p.total(p.rng.choice([0.02, 0.2, 1]), p.rng.integers(0, 4000))),
    "PULSE": lambda p, k: np.floor(p.total(p.rng.choice([0, 0.01, 0.3, 5, 40]), 10 ** p.rng.uniform(0, 8))),
    # drives
    "HZSET": lambda p, k: p.steps([0, 25, 35.5, 40, 50], 500),
    "HZ": _hz,
    "RPM": lambda p, k: p("HZ") * 29.1,
    "TORQ": lambda p, k: (p.ou(p.rng.uniform(20, 80), 6, 20, 1)) * (p("HZ") > 1),
    "MI": lambda p, k: (p.ou(p.rated_i * 0.5, p.rated_i * 0.03, 20, p.rated_i * 0.003)) * (p("HZ") > 1),
    "UDC": lambda p, k: p.ou(560, 3, 60, 0.6),
    "UOUT": lambda p, k: p("HZ") * 8,
    "PM": lambda p, k: p("RPM") * p("TORQ") / 500,
    "THEAT": lambda p, k: p.ou(p.rng.uniform(35, 60), 0.8, 400, 0.1),
    "HRS": lambda p, k: p.total(1 / 3600, p.age_h),
    "EKW": lambda p, k: p.total(p("PM") / 3600, p.age_h * 4),
    "STARTS": lambda p, k: np.floor(p.total(p.rng.choice([0, 0.001, 0.01]), p.age_h * p.rng.uniform(0.05, 2))),
    "ENC": _enc,
    "POSERR": lambda p, k: p.ou(0, 5, 3, 2),
    # solar, battery
    "IRR": lambda p, k: np.maximum(p.ou(p.rng.choice([0, 120, 500, 850]), 40, 90, 4), 0),
    "VPV": lambda p, k: p.ou(p.rng.uniform(300, 720), 4, 60, 0.5) * (1 if p("IRR").mean() > 20 else 0.02),
    "IPV": lambda p, k: p("IRR") / 100 * p.rng.uniform(0.8, 1.1),
    "PPV": _ppv,
    "PINV": lambda p, k: p("PPV") * 0.97,
    "GRID": lambda p, k: p.ou(p.rng.choice([-3000, 0, 0, 800, 2500]), 250, 60, 30),
    "HOME": lambda p, k: np.abs(p.ou(p.rng.uniform(200, 2500), 60, 60, 10) + p.steps([0, 0, 1800], 200)),
    "PBAT": lambda p, k: p("HOME") - p("PINV") - p("GRID"),
    "EPV": lambda p, k: p.total(p("PPV") / 3600, p.age_h * 600),
    "EPVD": lambda p, k: p.total(p("PPV") / 3600, p("PPV").mean() * 4),
    "CO": lambda p, k: p("EPV") * 0.000475,
    "VB": lambda p, k: p.ou(p.rng.choice([12.8, 25.9, 51.8, 398]), 0.12, 300, 0.02),
    "IB": lambda p, k: p("PBAT") / np.maximum(p("VB"), 1) if p.rng.random() < 0.8 else p.ou(0, 0.4, 60),
    "SOC": lambda p, k: np.clip(p.rng.uniform(5, 98) + np.cumsum(p.rng.normal(0, 0.01, p.n)) * p.period / 10, 0, 100),
    "SOH": lambda p, k: p.const(p.rng.integers(88, 101)),
    "CELL": lambda p, k: p("CELLM") + p.rng.normal(0, 0.004) + p.rng.normal(0, 0.0005, p.n),
    "CELLM": lambda p, k: p.ou(p.rng.uniform(3.1, 3.6), 0.01, 600),
    "CYC": lambda p, k: p.const(p.rng.integers(0, 1800)),
    "AH": lambda p, k: p.total(0.002, p.age_h * p.rng.uniform(0.5, 4)),
    "REM": lambda p, k: p("SOC") * 2.8,
    # words
    "UP": lambda p, k: np.floor(p.t - p.start + p.age_h * p.rng.choice([1, 60, 3600])),
    "UNIX": lambda p, k: np.floor(1.7e9 + p.rng.uniform(0, 8e7) + p.t),
    "MS": lambda p, k: np.floor((p.t - p.start) * 1000 + p.rng.uniform(0, 4e9)) % 2**32,
    "HB": lambda p, k: np.floor(np.arange(p.n) * p.rng.choice([1, 1, 3]) + p.rng.integers(0, 65536)) % 65536,
    "YEAR": lambda p, k: p.const(2024),
    "MON": lambda p, k: p.const(p.rng.integers(1, 13)),
    "DAY": lambda p, k: p.const(p.rng.integers(1, 29)),
    "HH": lambda p, k: np.floor(p.t / 3600) % 24,
    "MM": lambda p, k: np.floor(p.t / 60) % 60,
    "SS": lambda p, k: np.floor(p.t) % 60,
    "ST": lambda p, k: p.steps(p.rng.choice([0, 1, 2, 3, 4, 5, 7], 3), 400),
    "BITS": _bits,
    "FEWB": _fewb,
    "FLT": lambda p, k: p.const(0) if p.rng.random() < 0.8 else p.steps([0, 0, 0, p.rng.integers(1, 60)], 400),
    "PAR": lambda p, k: p.const(p.rng.choice([0, 1, 2, 5, 10, 50, 100, 250, 300, 1000, 1500, 4000, 9600, 30000])),
    "FPAR": lambda p, k: p.const(p.rng.choice([0, 1, 0.5, 100, 20, 4, 1.25, 60, 1500])),
    "MARK": lambda p, k: p.const(p.rng.choice([0xFFFF, 0x8000, 0x7FFF])),
    "SER": lambda p, k: p.const(p.rng.integers(1, 2**31)),
    "SERW": lambda p, k: p.const(p.rng.integers(0, 65536)),
    "VER": lambda p, k: p.const(p.rng.choice([0x0103, 0x0210, 102, 1])),
    "ERR": lambda p, k: np.floor(p.total(p.rng.choice([0, 0, 0.005, 0.1]), p.rng.integers(0, 800))),
    "PKT": lambda p, k: np.floor(p.total(p.rng.choice([0.2, 1, 20]), p.age_h * 3600 * p.rng.random())),
    "RSSI": lambda p, k: p.ou(-72, 3, 100, 2),
    "LOAD": lambda p, k: np.clip(p.ou(30, 8, 20, 3), 0, 100),
    "MEM": lambda p, k: p.ou(48000, 900, 30, 300),
    "CYCT": lambda p, k: np.abs(p.ou(8, 1, 3, 0.4)),
    "MEMB": lambda p, k: np.floor(p.ou(1.4e6, 5000, 60, 500) / 16) * 16,
}
