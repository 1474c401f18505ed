"""For every test of both distributions: property tests draw the same examples in every run, and no stop-watch.

The first example of a property may have to compile the inner loops, which takes seconds.
"""

from hypothesis import settings

settings.register_profile("shipshape", deadline=None, derandomize=True, database=None, print_blob=True)
settings.load_profile("shipshape")
