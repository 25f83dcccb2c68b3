"""Cases from the field: a line bit by bit, clients and units that hear it, and what is wrong there."""
