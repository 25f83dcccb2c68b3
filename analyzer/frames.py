"""What was found on the bus, as columns.

The one shape between the deframer and every view: a `Batch` holds rows (a structured array, a row a frame or a
stretch of noise, in wire order) and the bytes that they speak of. Rows of all batches tile each port's byte stream:
every byte once, in order. A `Frame` is a view of one row, made when somebody looks at it; nothing keeps one.
"""

from __future__ import annotations
