"""The content-addressed cache of parts, on this machine or shared by several machines, and the locks for parts that are being built."""
