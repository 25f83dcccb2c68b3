"""Devices with register maps on the simulated bus.

`series` says what one value does in time, `device` what all of them hold and how they hang together (power from voltage
and current, energy from power), `client` how a master polls them. Beside the frames' truth there is the registers':
what each value that was asked for really is (`simulation.truth`).
"""
