"""Filters on the measured angles."""
