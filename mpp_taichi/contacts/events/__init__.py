"""Event-driven spheres: cells, predictions, queue and collisions.

event       next contact of a sphere with another one or a surface, or its crossing of a side of its cell
stale       an event whose partner has had another contact since the event was predicted
stamp       number of contacts that the partner had had when the event was predicted; by which stale events are detected
queue       the next event of each sphere, ordered by time: a heap for the present bucket, lists for the others
bucket      part of the time window of the queue
note        entry of a sphere in the list of a bucket
turn        how often a sphere has gone around a periodic box
fetch       request for a line of memory before it is needed
"""
