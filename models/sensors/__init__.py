"""The stages of a sensor, in the order of the signal, and the parts as data."""
