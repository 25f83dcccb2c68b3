"""RTUBench: a measure of tools that read Modbus RTU lines.

Eight tracks: frames, directions, pairs, damage, causes, texts, registers, speed. The corpus follows from a seed, so a
year is a seed. Tools are programs that read a file and print JSON lines; docs/rtubench.md tells how to add one and how
each score is reckoned. Nothing here imports the product: it is one tool among others, reached by its command line.
"""
