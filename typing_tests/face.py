"""What a type checker sees of `import rtuscope`: run by tests/test_face.py through mypy; nothing here is executed."""

from typing import assert_type

import rtuscope

from analyzer.analysis import Analysis
from analyzer.live.session import Session
from analyzer.paste.model import Paste
from analyzer.registers.roles import RegisterValue

assert_type(rtuscope.open("bus.jsonl"), Analysis)
assert_type(rtuscope.parse("11 03 00 6B 00 03 76 87"), Paste)
assert_type(rtuscope.build(3, unit=17, starting_address=107, quantity=3), bytes)
assert_type(rtuscope.listen("/dev/ttyUSB0", baud=19200), Session)
assert_type(rtuscope.registers("bus.jsonl"), list[RegisterValue])
assert_type(rtuscope.LineSettings(baud=19200).baud, int | None)
assert_type(rtuscope.Chunk(0, b"").data, bytes)

try:
    rtuscope.open("missing.mcap")
except rtuscope.RtuscopeError as error:
    assert_type(error, rtuscope.RtuscopeError)
