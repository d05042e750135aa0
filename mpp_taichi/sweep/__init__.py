"""Sweeps: many members of one scene with other numbers, run in chunks that are kept, so that a sweep can be gone on with.

plan.py        the members and their values           order.py      which members come first
member.py      a member's scene, and its row          structure.py  which members can share one compiled step
replicas.py    members side by side                   alone.py      a member by itself        runner.py  which of the two
gauges.py      the measures of members                samples.py    members at one step
reductions.py  one number of many samples             extremes.py   those that look between samples
chunk.py       a part of the members as a file        store.py      the folder: what is done, what is missing
worker.py      a process that runs chunks             carrier.py    processes that share them, dask_carrier.py a cluster
results.py     the table of a sweep                   tables.py, picture.py, page.py  its files
cost.py        time and memory before the start       progress.py   what is done so far
"""
