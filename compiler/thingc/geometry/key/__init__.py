"""Find the dependencies of a part: its code, the files that it reads, and versions of packages. Results of parts are cached, and the cache
keys are computed from these dependencies.
"""
