"""The parts of tools/stability: scenes that get harder by a knob, runs of limn, the page."""
