"""Packets of network captures (pcap, pcapng) to reads: what a serial line or a TCP connection carried, in order.

`packets` are the columns that both file formats give, and what stands around the bytes of a packet by link type; `tcp`
puts connections together, `choosing` says which of them are Modbus by their content, `source` is the capture.
"""
