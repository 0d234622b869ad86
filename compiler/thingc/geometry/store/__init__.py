"""The content-addressed cache, on this machine or shared by several, and the locks of parts that are being built."""
