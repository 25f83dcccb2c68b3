"""Tools behind one protocol, a file each, run as programs: nothing of the bench but `speaking` is known to them."""
