"""Targets for frameworks of reinforcement learning. Each module writes Python modules that configure a robot in one framework.

The targets are registered in the entry points of the package `thingc`, in the same way as targets of other packages.
"""
