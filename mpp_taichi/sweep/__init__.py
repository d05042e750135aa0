"""Sweeps: many members of one scene with other numbers, run in chunks that are kept, so that a sweep can be gone on with.

plan.py       the members and their values          order.py      which members come first
member.py     a member's scene, and its row         structure.py  which members can share one compiled step
gauges.py     the measured quantities of a member   replicas.py   members side by side    alone.py   one after the other
chunk.py      a part of the members as a file       store.py      the folder: what is done, what is missing
worker.py     a process that runs chunks            carrier.py    processes that share the chunks
results.py    the table of a sweep                  tables.py     its files               picture.py   its pictures
"""
