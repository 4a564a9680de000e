"""Simulated hands with a marker, in configurations, before a virtual depth camera, with their true points."""
