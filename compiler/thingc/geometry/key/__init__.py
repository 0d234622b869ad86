"""Find the dependencies of a part (its code, the files that it reads, versions of packages), and cache results under these dependencies."""
