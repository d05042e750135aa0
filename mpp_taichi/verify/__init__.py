"""Verify: the trust that this machine, a backend and a precision deserve, shown by questions whose answers are known.

A case (`cases/`) asks one question: it runs a small scene on a place, a backend with a precision, and compares a number with
its bound. Each place is examined by a process of its own (`worker.py`), so that a crash of a driver ends no other row.
"""
