"""Rotations, integration of rates, alignment and attitude estimators."""
