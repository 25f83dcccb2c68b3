"""Requests as suspects: which property of a request decides whether a unit answers it, and what to ask instead.

A unit that refuses some requests, or stays silent at them, and answers others meanwhile has a reason. `asked` reads a
request, `got` says what requests got, in order, `reasons` weighs what sets those that fail apart from those
that succeed, `corrections` makes requests that the unit can serve, `advice` says it of one request and its exception.
"""
